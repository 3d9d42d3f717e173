"""How a command ends that judges FMUs: tables for eyes, files and an exit code for pipelines."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import typer
from rich.markup import escape

from ..files import write_whole
from ..page.table import new_table, print_whole
from ..verification.check import Verification
from ..verification.junit import Report, as_json, as_junit, exit_code
from ..verification.verify import OF_THE_FILE
from .terminal import console, errors, say, say_error


def finish(command: str, reports: Sequence[Report], json: Path | None, junit: Path | None) -> None:
    """Write what a pipeline reads, say what could not be run, and end with the exit code."""
    if json is not None:
        write_whole(json, as_json(reports).encode())
    if junit is not None:
        write_whole(junit, as_junit(f"lagfmu {command}", reports))
    for one in reports:
        if one.error:
            say_error(one.error if one.file in one.error else f"{one.file}: {one.error}")
    raise typer.Exit(exit_code(reports))


def print_verdicts(found: Verification) -> None:
    """A row a statement, and in words what failed."""
    title = f"{found.name}: {'pass' if found.passed else 'FAIL'}"
    table = new_table(
        title, "statement", "largest error", "allowed", "points", "verdict", text=["statement"]
    )
    for row, check in found.told():
        colour = {"pass": "green", "FAIL": "bold red"}.get(check.verdict, "yellow")
        table.add_row(escape(row[0]), *row[1:4], f"[{colour}]{row[4]}[/]")
    print_whole(console, table)
    if all(c.name in OF_THE_FILE for c in found.checks):
        say(
            f"{found.name}: the FMU carries no closed forms: its physics was not checked",
            "note:",
            "yellow",
        )
    if found.left_out:
        of = f"{found.left_out} of {found.left_out + found.closed_forms} closed forms"
        told = f"{found.name}: {of} were not checked: this FMU leaves out what they need"
        say(told, "note:", "yellow")
    for check in found.checks:
        if check.failed and check.detail:
            say(check.detail, f"{escape(found.name)}: {escape(check.name)}:", "red", errors)
