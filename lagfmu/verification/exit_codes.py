"""The exit codes of every command, and the words for those that an FMU alone would give."""

from __future__ import annotations

from ..errors import LagfmuError, UsageError, UserInterruptError

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
