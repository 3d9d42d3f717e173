"""A stress run for the terminal, as JSON with every row, and as Markdown that can be filed."""

from __future__ import annotations

import json
import math
import platform
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from ...verification import pipeline
from ...verification.pipeline import Case, Suite
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
    drawn = Table(
        title=f"{found.name} ({found.target})",
        title_justify="left",
        box=SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )
    drawn.add_column("probe")
    drawn.add_column("verdict", no_wrap=True)
    drawn.add_column("checks", justify="right", no_wrap=True)
    drawn.add_column("ratio", justify="right", no_wrap=True)
    drawn.add_column("nearest to its limit, or the reason")
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
            escape(_text(row)),
        )
    return drawn


def summary(all_found: Sequence[Stressed]) -> Table:
    """One line an FMU."""
    drawn = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for column in ("FMU", "target", "probes", *VERDICTS, "checks"):
        drawn.add_column(column, justify="left" if column in ("FMU", "target") else "right")
    for f in all_found:
        counts = [f"[{COLOURS[v]}]{f.count(v)}[/]" if f.count(v) else "0" for v in VERDICTS]
        checks = str(sum(r.checks for r in f.rows))
        drawn.add_row(escape(f.name), f.target, str(len(f.rows)), *counts, checks)
    return drawn


def _ratio(row: Verdict) -> str:
    return f"{row.ratio:.1e}" if row.ratio else ""


def _text(row: Verdict) -> str:
    nearest = row.closest if row.verdict == RIGHT and row.ratio else ""
    return "; ".join(t for t in (nearest, row.detail) if t)


@dataclass(frozen=True)
class Tried:
    """An FMU, or a file of which none could be made: what was found, or why it could not be run."""

    file: str
    found: Stressed | None
    error: str = ""

    @property
    def suite(self) -> Suite:
        """A case a probe: wrong fails, unfinished is skipped, a clear refusal is as good as right."""
        rows = () if self.found is None else self.found.rows
        return Suite(self.file, [_case(r) for r in rows], self.error)


def _case(row: Verdict) -> Case:
    failure = row.detail if row.verdict == WRONG else ""
    skipped = row.detail if row.verdict == UNFINISHED else ""
    return Case(row.probe, row.family, failure, skipped, row.seconds)


def all_as_json(tried: Sequence[Tried]) -> str:
    """Every FMU with all its rows, in one list."""
    data = [
        {"file": t.file, "verdict": pipeline.VERDICTS[t.suite.code]}
        | {"error": t.error or None}
        | ({} if t.found is None else _data(t.found))
        for t in tried
    ]
    return json.dumps(data, indent=1, allow_nan=False) + "\n"


def as_json(found: Stressed) -> str:
    """Everything."""
    return json.dumps(_data(found), indent=1, allow_nan=False) + "\n"


def _data(found: Stressed) -> dict[str, Any]:
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
        "rows": [
            asdict(r) | {"ratio": r.ratio if math.isfinite(r.ratio) else None} for r in found.rows
        ],
    }


def as_markdown(found: Stressed) -> str:
    """A summary by family, what is wrong first, then every row."""
    lines = [f"# Stress of {found.name} ({found.target})", ""]
    lines += [f"SHA-256 of the FMU: `{found.digest}`.", ""]
    if not found.laws:
        lines += [WITHOUT, ""]
    if found.quick:
        lines += ["A quick run: some of the probes only.", ""]
    lines += [MEANING, ""]
    lines.append(cells("family", "probes", *VERDICTS))
    lines.append("| --- |" + " ---: |" * (1 + len(VERDICTS)))
    for family in found.families:
        counts = [found.count(v, family) for v in VERDICTS]
        lines.append(cells(family, sum(counts), *counts))
    counts = [found.count(v) for v in VERDICTS]
    lines += [cells("all", sum(counts), *counts), ""]
    for title, verdict in (("Wrong", WRONG), ("Unfinished", UNFINISHED)):
        bad = [r for r in found.rows if r.verdict == verdict]
        if bad:
            lines += [f"## {title}", ""]
            lines += [f"- {r.family}, {r.probe}: {r.detail}" for r in bad] + [""]
    lines += ["## Every probe", ""]
    lines += ["| family | probe | verdict | checks | ratio | nearest to its limit, or reason |"]
    lines += ["| --- | --- | --- | ---: | ---: | --- |"]
    for r in found.rows:
        answer = f"**{WRONG}**" if r.verdict == WRONG else r.verdict
        lines.append(cells(r.family, r.probe, answer, r.checks, _ratio(r), _text(r)))
    return "\n".join(lines) + "\n"


def cells(*contents: object) -> str:
    """A row of a Markdown table."""
    return "| " + " | ".join(str(c).replace("|", "\\|") for c in contents) + " |"
