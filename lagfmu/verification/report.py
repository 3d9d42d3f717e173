"""What a verification found, for machines: JSON, and a suite an FMU with a case a statement."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from .pipeline import VERDICTS, Case, Suite
from .verify import Check, Verification


@dataclass(frozen=True)
class Examined:
    """One FMU of a pipeline: what was found, or why it could not be run."""

    file: str
    found: Verification | None
    error: str = ""
    misused: bool = False  # not run because of what was asked for

    @property
    def suite(self) -> Suite:
        """A case a statement."""
        if self.found is None:
            return Suite(self.file, (), self.error, misused=self.misused)
        name, seconds = (
            self.found.name,
            self.found.seconds,
        )  # one run serves all: its time at the first
        cases = [_case(c, name, 0.0 if k else seconds) for k, c in enumerate(self.found.checks)]
        return Suite(self.file, cases, "", {"uncovered outputs": ", ".join(self.found.uncovered)})


def _case(check: Check, fmu: str, seconds: float) -> Case:
    skipped = "not reached in this run" if check.points == 0 else ""
    failure = "" if skipped or check.passed else str(check)
    return Case(check.name, fmu, failure, skipped, seconds)


def as_json(examined: Sequence[Examined]) -> str:
    """Everything, numbers as numbers; what is not finite is null."""
    data = [
        {
            "file": e.file,
            "name": None if e.found is None else e.found.name,
            "verdict": VERDICTS[e.suite.code],
            "error": e.error or None,
            "simulated_s": None if e.found is None else e.found.simulated,
            "wall_s": None if e.found is None else e.found.seconds,
            "steps": None if e.found is None else e.found.steps,
            "statements": [] if e.found is None else [_statement(c) for c in e.found.checks],
            "uncovered_outputs": [] if e.found is None else list(e.found.uncovered),
        }
        for e in examined
    ]
    return json.dumps(data, indent=1, allow_nan=False) + "\n"


def _statement(check: Check) -> dict[str, Any]:
    return {
        "name": check.name,
        "error": check.error if math.isfinite(check.error) else None,
        "allowed": check.allowed,
        "points": check.points,
        "verdict": check.verdict,
        "detail": check.detail,
    }
