"""A stress run for the terminal, and with every row for a pipeline; as Markdown: summary.py."""

from __future__ import annotations

import platform
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from rich.markup import escape
from rich.table import Table

from ...page.table import new_table
from ...verification.pipeline import Case, Report
from .probe import CONSISTENT, REFUSED, RIGHT, UNFINISHED, WRONG, Verdict

FORMAT = 1
VERDICTS = (RIGHT, CONSISTENT, REFUSED, WRONG, UNFINISHED)
COLOURS = {
    RIGHT: "green",
    CONSISTENT: "green",
    REFUSED: "cyan",
    WRONG: "bold red",
    UNFINISHED: "yellow",
}
MEANING = (
    "right: every check held. consistent: so did Lagrange's equations and the constraints at each "
    "instant, but nothing could be said of the course of the motion. refused: discard or error, with a "
    "message that names the cause, and everything before it right. wrong: a check failed, the process "
    "was taken down, or a refusal had no cause. unfinished: still at work at the time limit; nothing is "
    "known. Ratio: the error of the check that came nearest to its limit, over that limit."
)
WITHOUT = (
    "An FMU without its model file: judged by the closed forms and invariants that it carries, not by "
    "Lagrange's equations."
)


@dataclass(frozen=True)
class Stressed:
    """The verdicts on one FMU; `digest`: SHA-256 of the file; `limit` [s] of each probe; `laws`: it was
    held against Lagrange's equations of its model, too."""

    name: str
    target: str
    digest: str
    quick: bool
    limit: float
    laws: bool
    rows: tuple[Verdict, ...]

    def count(self, verdict: str, family: str | None = None) -> int:
        """Rows with that verdict."""
        return sum(r.verdict == verdict and family in (None, r.family) for r in self.rows)

    @property
    def families(self) -> list[str]:
        """In order of appearance."""
        return list(dict.fromkeys(r.family for r in self.rows))


def table(found: Stressed) -> Table:
    """One line a probe."""
    last = "nearest to its limit, or the reason"
    drawn = new_table(
        f"{found.name} ({found.target})",
        *("probe", "verdict", "checks", "ratio", last),
        text=("probe", last),
        words=("verdict",),
    )
    family = ""
    for row in found.rows:
        if row.family != family:
            drawn.add_section()
            drawn.add_row(f"[bold]{escape(row.family)}[/]")
        family = row.family
        drawn.add_row(
            escape(row.probe),
            f"[{COLOURS[row.verdict]}]{row.verdict}[/]",
            str(row.checks),
            ratio_of(row),
            escape(remark(row)),
        )
    return drawn


def summary(all_found: Sequence[Stressed]) -> Table:
    """One line an FMU."""
    columns = ("FMU", "target", "probes", *VERDICTS, "checks")
    drawn = new_table("", *columns, words=("FMU", "target"))
    for f in all_found:
        counts = [f"[{COLOURS[v]}]{f.count(v)}[/]" if f.count(v) else "0" for v in VERDICTS]
        checks = str(sum(r.checks for r in f.rows))
        drawn.add_row(escape(f.name), f.target, str(len(f.rows)), *counts, checks)
    return drawn


def ratio_of(row: Verdict) -> str:
    """Of the check that came nearest to its limit."""
    return f"{row.ratio:.1e}" if row.ratio else ""


def remark(row: Verdict) -> str:
    """What came nearest to its limit, or the reason."""
    nearest = row.closest if row.verdict == RIGHT and row.ratio else ""
    return "; ".join(t for t in (nearest, row.detail) if t)


def report(file: str, found: Stressed) -> Report:
    """A case a probe: wrong fails, unfinished is skipped, a clear refusal is as good as right."""
    return Report(file, found, [_case(r) for r in found.rows], data(found))


def _case(row: Verdict) -> Case:
    failure = row.detail if row.verdict == WRONG else ""
    skipped = row.detail if row.verdict == UNFINISHED else ""
    return Case(row.probe, row.family, failure, skipped, row.seconds)


def data(found: Stressed) -> dict[str, Any]:
    """Everything, as JSON knows it."""
    return {
        "format": FORMAT,
        "fmu": found.name,
        "target": found.target,
        "sha256": found.digest,
        "quick": found.quick,
        "limit": found.limit,
        "lagrange": found.laws,
        "machine": {
            "system": platform.system(),
            "processor": platform.machine(),
            "python": sys.version.split()[0],
        },
        "verdicts": {v: found.count(v) for v in VERDICTS},
        "rows": [asdict(r) for r in found.rows],
    }
