"""The error tree.  Each message names the thing, its value, what was expected and the remedy."""

from __future__ import annotations

import errno
import re
import tempfile
from collections.abc import Sequence
from typing import Any

LONGEST, MOST = 400, 20_000  # letters that a message shows of one word, and in all
WORD = re.compile(rf"\S{{{LONGEST + 1},}}|[ \t]{{{LONGEST + 1},}}")


class LagfmuError(Exception):
    """Base of every error that lagfmu raises on purpose.

    Its message shows the ends alone of what is longer than any name, which a file that others wrote may hold.
    """

    def __str__(self) -> str:
        return shortened(super().__str__())


def shortened(text: str) -> str:
    """A message without the middle of words that are longer than any name."""
    text = WORD.sub(lambda m: _ends(m[0], LONGEST), text)
    return text if len(text) <= MOST else _ends(text, MOST)


def _ends(text: str, most: int) -> str:
    return f"{text[: most // 2]}...({len(text) - most} letters)...{text[-most // 2 :]}"


def remedy_of(error: OSError) -> str:
    """What helps against an error of the system; empty where that depends on what was done."""
    if error.errno in (errno.EMFILE, errno.ENFILE):
        return "close some, or allow more, as `ulimit -n 4096` does"
    if error.errno in (errno.ENOMEM, errno.EAGAIN):
        return "end other programs, or use fewer workers"
    return ""


class UsageError(LagfmuError):
    """A request that cannot be meant: an option, a name or a value."""


class UserInterruptError(LagfmuError):
    """Work that was ended by Ctrl-C; the message says what is kept of it."""


class ModelError(LagfmuError):
    """A model that cannot be accepted; `problems` lists everything that is wrong with it at once."""

    def __init__(self, name: str, problems: Sequence[str]) -> None:
        self.name = name
        self.problems = tuple(problems)
        lines = "\n".join(f"  - {problem}" for problem in self.problems)
        count = "1 problem" if len(self.problems) == 1 else f"{len(self.problems)} problems"
        super().__init__(f"model {name!r} has {count}:\n{lines}")


class RequestError(UsageError, ModelError):
    """Something asked of a model that it does not have: an output, a method, an argument of its family."""


class CannotStartError(ModelError):
    """A model whose equations stand and whose start does not; `known` is what can be shown of it."""

    def __init__(self, name: str, problems: Sequence[str], known: Any) -> None:
        super().__init__(name, problems)
        self.known = known


class TableError(LagfmuError):
    """A table that is no function; `problems` lists everything that is wrong with it at once."""

    def __init__(self, name: str, problems: Sequence[str]) -> None:
        self.name = name
        self.problems = tuple(problems)
        super().__init__(f"spline {name!r}: " + "; ".join(self.problems))


class LagfmuWarning(UserWarning):
    """Something that is allowed, and may not be what was meant."""

    def __str__(self) -> str:
        return shortened(super().__str__())


class UnitError(LagfmuError):
    """A unit that cannot be read, or is not coherent SI."""


class DerivationError(LagfmuError):
    """Equations of motion that cannot be derived in the form that was asked for."""


class BuildError(LagfmuError):
    """An FMU, a plot or a report that cannot be built or written."""


class TemporaryFolderError(LagfmuError):
    """Temporary files that cannot be written; for what the user names see its own errors."""

    def __init__(self, error: OSError, variable: str = "TMPDIR") -> None:
        where = error.filename or tempfile.gettempdir()
        full = error.errno not in (
            errno.ENOENT,
            errno.EACCES,
            errno.EPERM,
            errno.EROFS,
            errno.ENOTDIR,
        )
        remedy = remedy_of(error) or (
            f"{'is the disk full?' if full else 'it cannot be written to.'} The environment variable "
            f"{variable} chooses another folder for temporary files"
        )
        super().__init__(f"{where}: {error.strerror or error}: {remedy}")


class VerificationError(LagfmuError):
    """A file that cannot be verified, because it is corrupt or no FMU of lagfmu."""


class SimulationError(LagfmuError):
    """A simulation that cannot go on; the message names the physical or numerical cause."""


class SettingError(UsageError, SimulationError):
    """A name that the FMU does not have, or a value that it does not take."""
