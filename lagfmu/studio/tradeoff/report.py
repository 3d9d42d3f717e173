"""A tradeoff as a table for the terminal, as JSON with everything, as a pipeline's suite."""

from __future__ import annotations

import platform
from dataclasses import asdict
from typing import Any

from rich.table import Table

from ...page.table import new_table
from ...verification.junit import Case, Report
from .measure import Tradeoff
from .quantities import MULTIPLIER
from .reference import FINER, REFERENCE

FORMAT = 2


def table(found: Tradeoff) -> Table:
    """One line a setting: tolerance or step, error, cost; ● won, ✗ misses a closed form."""
    won = found.front
    error = "error of λ" if found.headline == MULTIPLIER else f"error of {found.headline}"
    drawn = new_table(
        f"{found.name} ({found.target}), every {found.points[0].setting.communication:.3g} s",
        *("", "method", "tolerance", error, "steps", "ms/s"),
        words=("", "method"),
    )
    method = ""
    for point in found.points:
        if method not in ("", point.setting.method):
            drawn.add_section()
        method = point.setting.method
        drawn.add_row(
            ("●" if point in won else "") + ("✗" if point.missed else ""),
            method,
            point.setting.dial,
            f"{found.error(point):.1e}",
            str(point.steps),
            digits(1e3 * point.cost / found.simulated),
            style="bold" if point in won else None,
        )
    return drawn


def digits(value: float) -> str:
    """Three digits, and no exponent above a thousand."""
    return f"{value:.3g}" if value < 1e3 else f"{value:.0f}"


def remarks(found: Tradeoff) -> list[str]:
    """What the columns are, how right the reference is, what was missed, refused or cut."""
    own = max(found.reference.own.values(), default=0.0)
    lines = [
        f"error: relative to the largest magnitude, against a run at {REFERENCE:.0e} whose own error is "
        f"{own:.0e} (a run at {FINER:.0e} differs by that); ms/s: wall time per simulated second through "
        "fmpy, the least; ● won: no setting is both faster and more accurate"
    ]
    lines += [f"✗ {p.setting}: {'; '.join(p.missed)}" for p in found.points if p.missed]
    return [*lines, *found.notes]


def report(file: str, found: Tradeoff) -> Report:
    """A case a setting that was measured, none of which fails: a trade-off measures and does not judge.

    An FMU that runs with no setting at all could not be run.
    """
    if not found.points:
        return Report(file, error=f"no setting could be measured: {'; '.join(found.notes)}")
    cases = [Case(str(p.setting), found.name, seconds=p.cost) for p in found.points]
    return Report(file, found, cases, data(found))


def data(found: Tradeoff) -> dict[str, Any]:
    """Everything, as JSON knows it: times in s, relative errors."""
    reference, won = found.reference, found.front
    return {
        "format": FORMAT,
        "fmu": found.name,
        "target": found.target,
        "simulated": found.simulated,
        "machine": f"{platform.system()} {platform.machine()}",
        "reference": {
            q.name: asdict(q) | {"own": reference.own[q.name], "scale": reference.scale[q.name]}
            for q in reference.known
        },
        "points": [asdict(p) | {"cost": p.cost, "won": p in won} for p in found.points],
        "notes": list(found.notes),
    }
