"""A stress run for the terminal, and with every row for a pipeline."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from rich.markup import escape
from rich.table import Table

from ...page.table import new_table
from ...verification.pipeline import Case, Report
from .probes import CONSISTENT, REFUSED, RIGHT, UNFINISHED, WRONG, Verdict

FORMAT = 2
VERDICTS = (RIGHT, CONSISTENT, REFUSED, WRONG, UNFINISHED)
COLOURS = dict(zip(VERDICTS, ("green", "green", "cyan", "bold red", "yellow"), strict=True))
WORRY, NO_WORRY = "look at it: near the model's own values", "no worry: far from them"
UNFIT = "no worry: a method for other models"
MEANING = (
    "right: every check held. consistent: every check at single instants held; the course of the motion "
    "could not be judged. refused: the FMU returned an error with the cause, and everything before was "
    "right. wrong: a check failed, the process crashed, or a refusal gave no cause. unfinished: still "
    "running at the time limit. near: refusals of values within a factor of ten of the model's own: look "
    "at them. ratio: the error of the check that came nearest to its limit, over that limit."
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

    def counts(self) -> list[int]:
        """Probes, rows of each verdict, refusals near the model's own values, checks."""
        found = [sum(r.verdict == v for r in self.rows) for v in VERDICTS]
        near = sum(r.worry for r in self.rows)
        return [len(self.rows), *found, near, sum(r.checks for r in self.rows)]


HEADS = ("probes", *VERDICTS, "near", "checks")


def table(found: Stressed) -> Table:
    """One line a probe."""
    last = "nearest to its limit, or the reason"
    drawn = new_table(
        f"{found.name} ({found.target})" + ("" if found.laws else ", without Lagrange's equations"),
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
            _ratio(row),
            escape(_remark(row)),
        )
    return drawn


def summary(all_found: Sequence[Stressed]) -> Table:
    """One line an FMU."""
    drawn = new_table("", "FMU", "target", *HEADS, words=("FMU", "target"))
    for f in all_found:
        drawn.add_row(escape(f.name), f.target, *map(str, f.counts()))
    return drawn


def _ratio(row: Verdict) -> str:
    """Of the check that came nearest to its limit."""
    return f"{row.ratio:.1e}" if row.ratio else ""


def _remark(row: Verdict) -> str:
    """What came nearest to its limit, or the reason; of a refusal, whether to worry."""
    nearest = row.closest if row.verdict == RIGHT and row.ratio else ""
    advice = ""
    if row.verdict == REFUSED:
        advice = WORRY if row.near else UNFIT if row.family == "method" else NO_WORRY
    return "; ".join(t for t in (advice, nearest, row.detail) if t)


def report(file: str, found: Stressed) -> Report:
    """A case a probe: wrong fails, unfinished is skipped, a clear refusal is as good as right."""
    return Report(file, found, [_case(r) for r in found.rows], _data(found))


def _case(row: Verdict) -> Case:
    failure = row.detail if row.verdict == WRONG else ""
    skipped = row.detail if row.verdict == UNFINISHED else ""
    return Case(row.probe, row.family, failure, skipped, row.seconds)


def _data(found: Stressed) -> dict[str, Any]:
    """Everything, as JSON knows it."""
    return {
        "format": FORMAT,
        "fmu": found.name,
        "target": found.target,
        "sha256": found.digest,
        "quick": found.quick,
        "limit": found.limit,
        "lagrange": found.laws,
        "verdicts": dict(zip(HEADS, found.counts(), strict=True)),
        "rows": [asdict(r) for r in found.rows],
    }
