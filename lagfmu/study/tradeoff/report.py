"""A tradeoff as a table for the terminal, as JSON with everything, CSV with the rows, a pipeline's suite."""

from __future__ import annotations

import csv
import io
import platform
from collections.abc import Sequence
from typing import Any

from rich.table import Table

from ...page.table import new_table
from ...verification.pipeline import Case, Report
from .measure import Tradeoff, Weighed
from .quantities import EVENT, FORCE, MOTION, MULTIPLIER, OWN

SYMBOLS = {MULTIPLIER: "λ", FORCE: "Q", MOTION: "motion", OWN: "outputs", EVENT: "event"}
FORMAT = 1
BUSY = 1.3  # ratio of quartiles from which the times come with a warning
GOALS = (1e-4, 1e-7, 1e-10)


def table(found: Tradeoff, communication: float) -> Table:
    """One line a setting at one communication step: errors, time, spread; the front is marked."""
    chosen = found.front(communication)
    points = round(found.simulated / communication)
    drawn = new_table(
        f"{found.name} ({found.target}), {points} communication steps of {communication:.3g} s",
        *("", "method", "dial", *(SYMBOLS[g] for g in found.groups), "steps", "ms/s"),
        words=("", "method"),
    )
    method = ""
    for row in (r for r in found.rows if r.setting.communication == communication):
        if method not in ("", row.setting.method):
            drawn.add_section()
        method = row.setting.method
        scale = 1e3 / found.simulated
        drawn.add_row(
            ("●" if row in chosen else "") + ("✗" if row.broken else ""),
            method,
            row.setting.dial,
            *(_error(found, row, g) for g in found.groups),
            str(row.steps),
            digits(scale * row.median),
            style="bold" if row in chosen else None,
        )
    return drawn


def _error(found: Tradeoff, row: Weighed, group: str) -> str:
    names = [q.name for q in found.known if q.group == group]
    below = all(n in row.below for n in names)
    return f"{'≤' if below else ''}{found.worst(row, group):.1e}"


def digits(value: float) -> str:
    """Three digits, and no exponent above a thousand."""
    return f"{value:.3g}" if value < 1e3 else f"{value:.0f}"


def remarks(found: Tradeoff) -> list[str]:
    """What the reference is and how right it is, what was refused or cut, and fmpy's own share."""
    reference = found.reference
    lines = [
        "dial: tolerance, or step; errors relative to the largest magnitude of each quantity; ≤: not "
        "above the reference's own; ms/s: wall time per simulated second, median; ● nothing is both "
        f"faster and more accurate in {SYMBOLS[found.headline]}; quartiles and residuals: in the files"
    ]
    for source in dict.fromkeys(reference.source.values()):
        names = [n for n, s in reference.source.items() if s == source]
        own = max(reference.own[n] for n in names)
        lines.append(f"reference of {', '.join(names)}: {source}, own error {own:.0e}")
    method, difference = reference.opinion
    lines.append(f"second opinion on the converged run: {method} differs by {difference:.0e}")
    if reference.checked is not None:
        lines.append(f"the converged run differs from the closed forms by {reference.checked:.0e}")
    for h, seconds in found.floor.items():
        lines.append(
            f"fmpy's own calls, every {h:.3g} s: {1e6 * h * seconds / found.simulated:.1f} µs a "
            f"communication step, {1e3 * seconds / found.simulated:.3g} ms per simulated second"
        )
    spread = sorted(r.quartiles[1] / r.quartiles[0] for r in found.rows)[len(found.rows) // 2]
    if spread > BUSY:
        lines.append(
            f"the machine was busy: the quartiles of the times differ by a factor of {spread:.1f} "
            "(median over the settings); what lies closer together is not told apart"
        )
    lines += [f"{method} is refused: {why}" for method, why in found.refused.items()]
    lines += [f"✗ {r.setting}: {'; '.join(r.broken)}" for r in found.rows if r.broken]
    return lines + list(found.cut)


def cheapest(found: Tradeoff, goal: float, communication: float | None = None) -> Weighed | None:
    """The fastest row whose error (of lambda, if there is one) is at most `goal`."""
    good = [
        r
        for r in found.rows
        if found.worst(r, found.headline) <= goal
        and (communication is None or r.setting.communication == communication)
    ]
    return min(good, key=lambda r: r.median, default=None)


def summary(all_found: Sequence[Tradeoff]) -> Table:
    """For each FMU and communication step, the cheapest setting at three accuracies of lambda."""
    drawn = new_table(
        "The cheapest setting for an error of λ, and its wall time in ms per simulated second",
        *("FMU", "every", "error", "setting", "ms/s"),
        text=("FMU",),
    )
    for found in all_found:
        head = f"{found.name} ({found.target})"
        for h in dict.fromkeys(r.setting.communication for r in found.rows):
            every = f"{h:.3g} s"
            for goal in GOALS:
                row = cheapest(found, goal, h)
                setting = "none" if row is None else f"{row.setting.method} {row.setting.dial}"
                spent = "" if row is None else digits(1e3 * row.median / found.simulated)
                drawn.add_row(head, every, f"{goal:.0e}", setting, spent)
                head = every = ""
        drawn.add_section()
    return drawn


def report(file: str, found: Tradeoff) -> Report:
    """A case a setting that was measured, none of which fails: a trade-off measures and does not judge.

    A method that the FMU refuses is skipped; an FMU that runs with no setting at all could not be run.
    """
    if not found.rows:
        reasons = "; ".join([*found.refused.values(), *found.cut])
        return Report(file, error=f"no setting could be measured: {reasons}")
    cases = [Case(str(r.setting), found.name, seconds=r.median) for r in found.rows]
    cases += [Case(m, found.name, "", f"refused: {why}") for m, why in found.refused.items()]
    return Report(file, found, cases, data(found))


def data(found: Tradeoff) -> dict[str, Any]:
    """Everything, as JSON knows it, with units in the keys: seconds of wall time, relative errors."""
    reference = found.reference
    fronts = [row for h in found.floor for row in found.front(h)]
    return {
        "format": FORMAT,
        "fmu": found.name,
        "target": found.target,
        "simulated_s": found.simulated,
        "communication_step_of_the_fmu_s": found.step_size,
        "machine": {"system": platform.system(), "processor": platform.machine()},
        "reference": {
            "quantities": {
                q.name: {
                    "group": q.group,
                    "unit": q.unit,
                    "source": reference.source[q.name],
                    "own_error": reference.own[q.name],
                    "relative_to": reference.scale[q.name],
                }
                for q in found.known
            },
            "second_opinion": {"by": reference.opinion[0], "differs_by": reference.opinion[1]},
            "converged_run_differs_from_closed_forms_by": reference.checked,
        },
        "floor": [{"communication_s": h, "wall_s": s} for h, s in found.floor.items()],
        "rows": [
            {
                "method": row.setting.method,
                "tolerance": row.setting.tolerance or None,
                "step_s": row.setting.step or None,
                "communication_s": row.setting.communication,
                "errors": dict(row.errors),
                "not_above_the_reference": list(row.below),
                "residual_si": row.residual,
                "closed_forms_along_the_run": dict(row.statements),
                "closed_forms_that_do_not_hold": list(row.broken),
                "steps": row.steps,
                "wall_s": {
                    "median": row.median,
                    "quartiles": list(row.quartiles),
                    "runs": list(row.seconds),
                },
                "pareto_front_at_this_communication_step": row in fronts,
            }
            for row in found.rows
        ],
        "refused": dict(found.refused),
        "cut_short": list(found.cut),
    }


def as_csv(found: Tradeoff) -> str:
    """One line a setting."""
    text = io.StringIO()
    names = [q.name for q in found.known]
    writer = csv.writer(text, lineterminator="\n")
    head = ["method", "tolerance", "step_s", "communication_s", "steps", "residual_si"]
    head += ["wall_s_median", "wall_s_lower_quartile", "wall_s_upper_quartile", "runs"]
    writer.writerow(head + [f"error({n})" for n in names])
    for row in found.rows:
        s = row.setting
        line: list[object] = [s.method, s.tolerance or "", s.step or "", s.communication]
        line += [row.steps, row.residual, row.median, *row.quartiles, len(row.seconds)]
        writer.writerow(line + [row.errors[n] for n in names])
    return text.getvalue()
