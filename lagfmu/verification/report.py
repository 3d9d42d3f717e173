"""What a verification found, for machines: JSON, and JUnit's XML, a suite an FMU, a case a statement."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from junitparser import Error, Failure, JUnitXml, Skipped, TestCase, TestSuite

from .verify import Check, Verification

HOLDS, FAILS, WRONG_USAGE, NOT_RUN = 0, 1, 2, 3  # exit codes


@dataclass(frozen=True)
class Examined:
    """One FMU of a pipeline: what was found, or why it could not be run."""

    file: str
    found: Verification | None
    error: str = ""

    @property
    def code(self) -> int:
        """The exit code that this FMU alone would give."""
        if self.found is None:
            return NOT_RUN
        return HOLDS if self.found.passed else FAILS


def exit_code(examined: Sequence[Examined]) -> int:
    """The largest of all."""
    return max((e.code for e in examined), default=HOLDS)


def as_json(examined: Sequence[Examined]) -> str:
    """Everything, numbers as numbers; what is not finite is null."""
    data = [
        {
            "file": e.file,
            "name": None if e.found is None else e.found.name,
            "verdict": ("pass", "fail", "", "not run")[e.code],
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


def as_junit(examined: Sequence[Examined]) -> bytes:
    """JUnit's XML: a statement that was not reached is skipped, an FMU that could not be run is an error."""
    document = JUnitXml("lagfmu verify")
    for e in examined:
        suite = TestSuite(e.file)
        if e.found is None:
            case = TestCase("runs", e.file, 0.0)
            case.result = [Error(e.error, "not run")]
            suite.add_testcase(case)
        else:
            suite.add_property("uncovered outputs", ", ".join(e.found.uncovered))
            for k, check in enumerate(e.found.checks):
                # one run serves all statements: its time stands at the first
                case = TestCase(check.name, e.found.name, 0.0 if k else round(e.found.seconds, 6))
                if check.points == 0:
                    case.result = [Skipped("not reached in this run")]
                elif not check.passed:
                    case.result = [Failure(str(check), "statement")]
                suite.add_testcase(case)
        document.add_testsuite(suite)
    document.update_statistics()
    text: bytes = document.tostring()
    return text
