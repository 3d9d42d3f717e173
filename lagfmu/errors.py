"""The error tree.  Each message names the thing, its value, what was expected and the remedy."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from typing import Any


class LagfmuError(Exception):
    """Base of every error that lagfmu raises on purpose."""


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
        super().__init__(
            f"{where}: {error.strerror or error}: is the disk full? The environment variable {variable} "
            "chooses another folder for temporary files"
        )


class VerificationError(LagfmuError):
    """A file that cannot be verified, because it is corrupt or no FMU of lagfmu."""


class SimulationError(LagfmuError):
    """A simulation that cannot go on; the message names the physical or numerical cause."""


class SettingError(UsageError, SimulationError):
    """A name that the FMU does not have, or a value that it does not take."""
