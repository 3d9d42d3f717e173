"""What every command that judges FMUs hands to a pipeline: an exit code, and JUnit's XML."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from junitparser import Error, Failure, JUnitXml, Skipped, TestCase, TestSuite

from ..errors import LagfmuError

HOLDS, FAILS, WRONG_USAGE, NOT_RUN = 0, 1, 2, 3  # exit codes
VERDICTS = ("pass", "fail", "wrong usage", "not run")


class UsageError(LagfmuError):
    """A command that cannot be meant."""


@dataclass(frozen=True)
class Case:
    """One statement; `failure`: in what it fails; `skipped`: why nothing is known of it."""

    name: str
    group: str
    failure: str = ""
    skipped: str = ""
    seconds: float = 0.0


@dataclass(frozen=True)
class Suite:
    """The statements about one FMU; `error`: why it could not be run, or (`misused`) was not."""

    name: str
    cases: Sequence[Case]
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


def exit_code(suites: Sequence[Suite]) -> int:
    """The largest of all."""
    return max((s.code for s in suites), default=HOLDS)


def as_junit(command: str, suites: Sequence[Suite]) -> bytes:
    """JUnit's XML: of what nothing is known is skipped, an FMU that could not be run is an error."""
    document = JUnitXml(command)
    for s in suites:
        suite = TestSuite(s.name)
        for name, value in s.properties.items():
            suite.add_property(name, value)
        if s.error:
            case = TestCase("runs", s.name, 0.0)
            case.result = [Error(s.error, VERDICTS[s.code])]
            suite.add_testcase(case)
        for c in s.cases:
            case = TestCase(c.name, c.group, round(c.seconds, 6))
            if c.failure:
                case.result = [Failure(c.failure, "statement")]
            elif c.skipped:
                case.result = [Skipped(c.skipped)]
            suite.add_testcase(case)
        document.add_testsuite(suite)
    document.update_statistics()
    text: bytes = document.tostring()
    return text
