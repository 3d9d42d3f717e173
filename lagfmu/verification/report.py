"""What a verification found, for machines: a case a statement, and everything as JSON knows it."""

from __future__ import annotations

from .check import Check, Verification
from .junit import Case, Report


def report(file: str, found: Verification) -> Report:
    """A case a statement; numbers as numbers."""
    cases = [  # one run serves all: its time at the first
        _case(c, found.name, 0.0 if k else found.seconds) for k, c in enumerate(found.checks)
    ]
    data = {
        "name": found.name,
        "simulated_s": found.simulated,
        "wall_s": found.seconds,
        "steps": found.steps,
        "statements": [
            {k: getattr(c, k) for k in ("name", "error", "allowed", "points", "detail", "verdict")}
            for c in found.checks
        ],
        "uncovered_outputs": found.uncovered,
        "closed_forms_left_out": found.left_out,
    }
    uncovered = {"uncovered outputs": ", ".join(found.uncovered)}
    return Report(file, found, cases, data, properties=uncovered)


def _case(check: Check, fmu: str, seconds: float) -> Case:
    skipped = "not reached in this run" if check.points == 0 else ""
    failure = str(check) if check.failed else ""
    return Case(check.name, fmu, failure, skipped, seconds)
