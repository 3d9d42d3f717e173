"""What every command that judges FMUs hands to a pipeline: JSON, JUnit's XML and the exit code of all.

The exit codes of every command, and the words for those that an FMU alone would give.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ..errors import LagfmuError, UsageError, UserInterruptError

if TYPE_CHECKING:
    from .check import Check, Verification

HOLDS, FAILS, WRONG_USAGE, NOT_RUN, INTERRUPTED, TERMINATED = 0, 1, 2, 3, 130, 143
EXIT_CODES = {  # of every command
    HOLDS: "done; where something was judged, all of it holds",
    FAILS: "a statement fails, a probe is wrong, or a fit does not converge",
    WRONG_USAGE: "wrong usage: an option, a name that is not known, a value that is not taken, a table that "
    "cannot be read",
    NOT_RUN: "a file cannot be read or written, a model cannot be built, an FMU cannot be run; the others "
    "were",
    INTERRUPTED: "interrupted (Ctrl-C)",
    TERMINATED: "terminated (SIGTERM)",
}
VERDICTS = ("pass", "fail", "wrong usage", "not run")


def code_of(error: LagfmuError) -> int:
    """The exit code of a command that this error ends."""
    if isinstance(error, UserInterruptError):
        return INTERRUPTED
    return WRONG_USAGE if isinstance(error, UsageError) else NOT_RUN


# of XML 1.0
NOT_IN_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


@dataclass(frozen=True)
class Case:
    """One statement; `failure`: in what it fails; `skipped`: why nothing is known of it."""

    name: str
    group: str
    failure: str = ""
    skipped: str = ""
    seconds: float = 0.0


@dataclass(frozen=True)
class Report:
    """What came of one FMU, or of a file of which none could be made: what was `found`, as cases and as
    `data` for JSON; or `error`: why it could not be run, or (`misused`) was not."""

    file: str
    found: Any = None
    cases: Sequence[Case] = ()
    data: Mapping[str, Any] = field(default_factory=dict)
    error: str = ""
    properties: Mapping[str, str] = field(default_factory=dict)
    misused: bool = False

    @property
    def code(self) -> int:
        """The exit code that this FMU alone would give; nothing known is no success."""
        if self.error:
            return WRONG_USAGE if self.misused else NOT_RUN
        known = [c for c in self.cases if not c.skipped]
        return FAILS if not known or any(c.failure for c in known) else HOLDS


def refused(file: str, error: LagfmuError) -> Report:
    """Of an FMU that could not be run, or of a file of which none could be made."""
    return Report(file, error=str(error), misused=isinstance(error, UsageError))


def exit_code(reports: Sequence[Report]) -> int:
    """The largest of all."""
    return max((r.code for r in reports), default=HOLDS)


def as_json(reports: Sequence[Report]) -> str:
    """All that was found, in one list."""
    return text_of(
        [
            {"file": r.file, "verdict": VERDICTS[r.code], "error": r.error or None, **r.data}
            for r in reports
        ]
    )


def text_of(data: Any) -> str:
    """As JSON; numbers that are not finite, which it does not know, become null."""
    return json.dumps(_plain(data), indent=1, allow_nan=False) + "\n"


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def as_junit(command: str, reports: Sequence[Report]) -> bytes:
    """JUnit's XML: of what nothing is known is skipped, an FMU that could not be run is an error."""
    from junitparser import Error, Failure, JUnitXml, Skipped, TestCase, TestSuite

    document = JUnitXml(command)
    for s in reports:
        suite = TestSuite(_clean(s.file))
        for name, value in s.properties.items():
            suite.add_property(_clean(name), _clean(value))
        if s.error:
            case = TestCase("runs", _clean(s.file), 0.0)
            case.result = [Error(_clean(s.error), VERDICTS[s.code])]
            suite.add_testcase(case)
        for c in s.cases:
            case = TestCase(_clean(c.name), _clean(c.group), round(c.seconds, 6))
            if c.failure:
                case.result = [Failure(_clean(c.failure), "statement")]
            elif c.skipped:
                case.result = [Skipped(_clean(c.skipped))]
            suite.add_testcase(case)
        document.add_testsuite(suite)
    document.update_statistics()
    text: bytes = document.tostring()
    return text


def _clean(text: str) -> str:
    """What XML cannot hold, as a mark."""
    return NOT_IN_XML.sub("\N{REPLACEMENT CHARACTER}", text)


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
