"""A stress run for the terminal, as Markdown for a reviewer, and with every row for a pipeline."""

from __future__ import annotations

import platform
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib import metadata
from typing import Any

from rich.markup import escape
from rich.table import Table

from ...page.table import new_table
from ...verification.pipeline import Case, Report
from .probe import CONSISTENT, REFUSED, RIGHT, UNFINISHED, WRONG, Verdict

FORMAT = 2
VERDICTS = (RIGHT, CONSISTENT, REFUSED, WRONG, UNFINISHED)
COLOURS = dict(zip(VERDICTS, ("green", "green", "cyan", "bold red", "yellow"), strict=True))
PACKAGES = ("lagfmu", "sympy", "numpy", "scipy", "fmpy", "pythonfmu")
WORRY, NO_WORRY = "look at it: near the model's own values", "no worry: far from them"
MEANING = (
    "right: every check held. consistent: so did Lagrange's equations and the constraints at each "
    "instant, but nothing could be said of the course of the motion. refused: discard or error, with a "
    "message that names the cause, and everything before it right. wrong: a check failed, the process "
    "was taken down, or a refusal had no cause. unfinished: still at work at the time limit; nothing is "
    "known. near: refusals of values within a factor of ten of the model's own, which a user should look "
    "at. Ratio: the error of the check that came nearest to its limit, over that limit."
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
            _ratio(row),
            escape(remark(row)),
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


def remark(row: Verdict) -> str:
    """What came nearest to its limit, or the reason; of a refusal, whether to worry."""
    nearest = row.closest if row.verdict == RIGHT and row.ratio else ""
    advice = "" if row.verdict != REFUSED else WORRY if row.near else NO_WORRY
    return "; ".join(t for t in (advice, nearest, row.detail) if t)


def as_markdown(found: Sequence[Stressed]) -> str:
    """Versions, counts by FMU, whatever is not right, and of one FMU every row."""
    names = f"{len(found)} FMUs" if len(found) > 1 else found[0].name
    lines = [
        f"# Stress of {names} ({found[0].target})",
        "",
        *_circumstances(found),
        "",
        MEANING,
        "",
    ]
    lines += [cells("FMU", *HEADS, "SHA-256"), cells("---", *["---:"] * len(HEADS), "---")]
    width = 16 if len(found) > 1 else 64
    lines += [cells(f.name, *f.counts(), f"`{f.digest[:width]}`") for f in found]
    for what in (WRONG, UNFINISHED, CONSISTENT):
        rows = [(f.name, r) for f in found for r in f.rows if r.verdict == what]
        lines += _listed(what.capitalize(), rows)
    worries = [(f.name, r) for f in found for r in f.rows if r.worry]
    lines += _listed("Refused within a factor of ten of the model's own values", worries)
    if len(found) == 1:
        heads = ("family", "probe", "verdict", "checks", "ratio", "nearest to its limit, or reason")
        lines += ["", "## Every probe", "", cells(*heads), cells(*["---"] * len(heads))]
        lines += [
            cells(r.family, r.probe, r.verdict, r.checks, _ratio(r), remark(r))
            for r in found[0].rows
        ]
    return "\n".join(lines) + "\n"


def cells(*contents: object) -> str:
    """A row of a table."""
    return "| " + " | ".join(str(c).replace("|", "\\|") for c in contents) + " |"


def _listed(title: str, rows: Sequence[tuple[str, Verdict]]) -> list[str]:
    lines = ["", f"## {title}: {len(rows) or 'none'}", ""]
    return lines + [f"- {name}, {r.family}, {r.probe}: {r.detail}" for name, r in rows]


def _circumstances(found: Sequence[Stressed]) -> list[str]:
    versions = ", ".join(f"{p} {_version(p)}" for p in PACKAGES)
    machine = f"{platform.system()} {platform.machine()}, Python {sys.version.split()[0]}"
    limits = ", ".join(f"{x:g} s" for x in sorted({f.limit for f in found}))
    lines = [f"{versions}; {machine}. At most {limits} for each probe."]
    if any(f.quick for f in found):
        lines.append("A quick run: some of the probes only.")
    if without := [f.name for f in found if not f.laws]:
        lines.append(f"{', '.join(without)}: {WITHOUT}")
    return lines


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "(not installed)"


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
        "verdicts": dict(zip(HEADS, found.counts(), strict=True)),
        "rows": [asdict(r) for r in found.rows],
    }
