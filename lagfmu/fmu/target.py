"""What an FMU is: native, compiled C, where a C compiler is at hand, else python; of which version of FMI,
and what of 3.0 it has besides.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

from ..errors import BuildError, UsageError
from .compiler import REMEDY, Platform, find_compiler, host

NATIVE, PYTHON = TARGETS = ("native", "python")


class NoCompilerWarning(UserWarning):
    """An FMU is python because nothing here can compile a native one."""


def target_of(asked: str | None = None) -> str:
    """The target that was asked for; where none was, native, or python with a warning of what is missing.

    Raises UsageError for a target that is unknown.
    """
    if asked is not None and asked not in TARGETS:
        raise UsageError(f"target {asked!r} is unknown, expected one of {', '.join(TARGETS)}")
    missing = "" if asked else missing_for_native()
    if missing:
        warnings.warn(f"{missing}; the target is python", NoCompilerWarning, stacklevel=3)
    return asked or (PYTHON if missing else NATIVE)


def missing_for_native() -> str:
    """Why no native FMU can be compiled for this machine, and the remedy; empty where one can."""
    try:
        host()
    except BuildError as error:
        return str(error)
    return "" if find_compiler() is not None else REMEDY


VERSIONS = (2, 3)
TUPLES = {  # the folders of FMI 3.0 (section 2.5.1.4) where FMI 2.0 has other names
    "linux64": "x86_64-linux",
    "win64": "x86_64-windows",
    "darwin64": "x86_64-darwin",
}
FILES = {2: ("fmi2",), 3: ("fmi3", "dependencies.h")}  # how those of one version begin


@dataclass(frozen=True)
class Face:
    """`fmi`: 2 or 3.  Of 3 with `clocks`, one ticks at the events of each contact and friction, and the
    importer must use event mode; with `arrays` there are further outputs, one for each unit of lambda, Q and
    residuals; with `dae` an importer of model exchange may solve for the multipliers (dae.py).

    Raises UsageError.
    """

    fmi: int = 2
    clocks: bool = False
    arrays: bool = False
    dae: bool = False

    def __post_init__(self) -> None:
        if self.fmi not in VERSIONS:
            expected = " or ".join(map(str, VERSIONS))
            raise UsageError(f"fmi = {self.fmi!r} is no version that is known, expected {expected}")
        further = [n for n in ("clocks", "arrays", "dae") if getattr(self, n)]
        if self.fmi == 2 and further:
            raise UsageError(
                f"{' and '.join(further)}: FMI 2.0 has none: ask for FMI 3.0 (fmi = 3) too"
            )

    def target(self, asked: str | None) -> str:
        """As target_of, where FMI 3.0 is native.  Raises UsageError for another target of it."""
        if self.fmi == 2:
            return target_of(asked)
        if asked not in (None, NATIVE):
            raise UsageError(f"the target {asked} has FMI 2.0 alone: FMI 3.0 is for native FMUs")
        return NATIVE

    def folder(self, target: str) -> str:
        """Where FMUs of a target stand, one of each version beside the other."""
        return target if self.fmi == 2 else f"{target}-fmi{self.fmi}"

    def binaries(self, platform: Platform) -> str:
        """The folder of a library in the FMU."""
        name = platform.folder if self.fmi == 2 else TUPLES.get(platform.folder, platform.folder)
        return f"binaries/{name}"

    def holds(self, file: str) -> bool:
        """Whether a C file of the runtime is none of the other version's."""
        others = tuple(start for v, start in FILES.items() if v != self.fmi)
        return not any(file.startswith(start) for start in others)


USUAL = Face()
