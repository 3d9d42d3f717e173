"""A stress run as a Markdown page, of one FMU with every probe or over all: what a reviewer files."""

from __future__ import annotations

import platform
import re
import sys
from collections import Counter
from collections.abc import Sequence
from importlib import metadata

from .probe import REFUSED, RIGHT, WRONG
from .report import MEANING, VERDICTS, WITHOUT, Stressed, ratio_of, remark

PACKAGES = ("lagfmu", "sympy", "numpy", "scipy", "fmpy", "pythonfmu")
REASONS = 20  # most frequent ones that are listed


def as_summary(found: Sequence[Stressed], every_probe: bool = False) -> str:
    """Versions, counts by FMU and by family, whatever is not right or refused, reasons of refusals."""
    target = found[0].target
    names = f"{len(found)} FMUs" if len(found) > 1 else found[0].name
    lines = [
        f"# Stress of {names} ({target})",
        "",
        *_circumstances(found),
        "",
        MEANING,
        "",
    ]
    lines += _counts(found)
    for verdict in VERDICTS:
        if verdict not in (RIGHT, REFUSED):
            lines += _listed(found, verdict)
    lines += _reasons(found)
    if every_probe:
        lines += _every(found)
    return "\n".join(lines) + "\n"


def cells(*contents: object) -> str:
    """A row of a table."""
    return "| " + " | ".join(str(c).replace("|", "\\|") for c in contents) + " |"


def _every(found: Sequence[Stressed]) -> list[str]:
    lines = ["", "## Every probe", ""]
    lines += ["| family | probe | verdict | checks | ratio | nearest to its limit, or reason |"]
    lines += ["| --- | --- | --- | ---: | ---: | --- |"]
    for r in (r for f in found for r in f.rows):
        answer = f"**{WRONG}**" if r.verdict == WRONG else r.verdict
        lines.append(cells(r.family, r.probe, answer, r.checks, ratio_of(r), remark(r)))
    return lines


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


def _counts(found: Sequence[Stressed]) -> list[str]:
    head = " | ".join(("probes", *VERDICTS, "checks"))
    rule = " ---: |" * (2 + len(VERDICTS))
    lines = [f"| FMU | {head} | SHA-256 |", f"| --- |{rule} --- |"]
    for f in found:
        counts = [f.count(v) for v in VERDICTS]
        checks = sum(r.checks for r in f.rows)
        lines.append(
            cells(
                f.name,
                len(f.rows),
                *counts,
                checks,
                f"`{f.digest if len(found) == 1 else f.digest[:16]}`",
            )
        )
    lines += ["", f"| family | {head} |", f"| --- |{rule}"]
    for family in dict.fromkeys(x for f in found for x in f.families):
        counts = [sum(f.count(v, family) for f in found) for v in VERDICTS]
        checks = sum(r.checks for f in found for r in f.rows if r.family == family)
        lines.append(cells(family, sum(counts), *counts, checks))
    counts = [sum(f.count(v) for f in found) for v in VERDICTS]
    checks = sum(r.checks for f in found for r in f.rows)
    return [*lines, cells("all", sum(counts), *counts, checks), ""]


def _listed(found: Sequence[Stressed], verdict: str) -> list[str]:
    rows = [(f.name, r) for f in found for r in f.rows if r.verdict == verdict]
    lines = [f"## {verdict.capitalize()}: {len(rows) or 'none'}", ""]
    lines += [f"- {name}, {r.family}, {r.probe}: {r.detail}" for name, r in rows]
    return [*lines, ""] if rows else lines


def _reasons(found: Sequence[Stressed]) -> list[str]:
    """Why probes were refused: the messages, with names and numbers left out."""
    count: Counter[str] = Counter()
    for row in (r for f in found for r in f.rows if r.verdict == REFUSED):
        text = re.sub(r"^\w+: \w+: ", "", row.detail)
        text = re.sub(r"'[^']*'", "'...'", text)
        text = re.sub(r"[-+]?\b(\d+\.?\d*(e[-+]?\d+)?|inf|nan)\b", "#", text)
        text = re.sub(r"[\w.()]+ = #(, )?", "... = #", text)
        count[re.sub(r"(\.\.\. = #)+", "... = #", text)] += 1
    lines = ["## Why probes were refused", "", "| probes | reason |", "| ---: | --- |"]
    lines += [cells(n, text) for text, n in count.most_common(REASONS)]
    rest = count.total() - sum(n for _, n in count.most_common(REASONS))
    return lines + ([cells(rest, "others")] if rest else [])
