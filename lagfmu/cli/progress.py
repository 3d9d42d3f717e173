"""How far a command has come, on a terminal and in a log; and how one ends that judges FMUs: tables for eyes,
files and an exit code for pipelines.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    TextColumn,
)

from ..errors import UserInterruptError
from ..files import write_whole
from ..page.table import new_table, print_whole
from ..verification.check import Verification
from ..verification.pipeline import Report, as_json, as_junit, exit_code
from .terminal import console, errors, say, say_error

FIRST, QUIET = 2.0, 10.0  # [s] until the first line, and between lines, without a terminal
Tick = Callable[[str, int, int], None]  # what is done, how far, of how many


@contextmanager
def progress(console: Console, title: str) -> Iterator[Tick]:
    """A bar that goes when the work is done; what it yields is told how far it has come.  Without a terminal
    the title alone."""
    if not console.is_terminal:
        say(f"{title} ...", on=console)
    with _bar(console, title, SpinnerColumn()) as tick:
        yield tick


@contextmanager
def _bar(console: Console, title: str, *first: ProgressColumn) -> Iterator[Tick]:
    what = TextColumn("{task.fields[what]}", markup=False)
    columns = (*first, TextColumn(title, markup=False), BarColumn(), MofNCompleteColumn(), what)
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as shown:
        task = shown.add_task("", total=None, what="")

        def tick(what: str, done: int, total: int) -> None:
            shown.update(task, completed=done, total=total, what=what)

        yield tick


@contextmanager
def told(out: Path | None, workers: int | None) -> Iterator[Callable[[int, int, int], None]]:
    """Progress with rate, remaining time and what a run costs on one of the `workers`; after an interruption,
    what is left and how to go on."""
    begun, due, first = time.monotonic(), FIRST, -1
    with _bar(console, "runs") as tick:

        def tell(done: int, total: int, refused: int) -> None:
            nonlocal begun, due, first
            now = time.monotonic()
            if first < 0:  # those of the sweep that goes on cost nothing here
                begun, first = now, done
            pace = _pace(done - first, total - done, now - begun, workers)
            pace += f", {refused} refused" if refused else ""
            tick(pace, done, total)
            if not console.is_terminal and now - begun > due and done < total:
                due = now - begun + QUIET
                say(f"{done} of {total} runs: {pace}")

        try:
            yield tell
        except KeyboardInterrupt:
            raise UserInterruptError(
                "interrupted: nothing was kept, because there is no --out"
                if out is None
                else f"interrupted: what is finished is in {out}.parts; go on with the same command and "
                "--resume"
            ) from None


def _pace(done: int, left: int, spent: float, workers: int | None) -> str:
    """Runs a second, the time that the rest will take, and what one costs a worker."""
    if not done or spent <= 0:
        return f"none done after {spent:.0f} s"
    rate = done / spent
    cost = "" if workers is None else f", {_time(workers / rate)} a run"
    return f"{rate:.3g}/s{cost}, {_time(left / rate)} left"


def _time(seconds: float) -> str:
    """With the unit in which it is read."""
    if seconds < 1:
        return f"{1e3 * seconds:.3g} ms"
    if seconds < 100:
        return f"{seconds:.2g} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 100 else f"{seconds / 3600:.1f} h"


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
    from ..verification.verify import OF_THE_FILE

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
