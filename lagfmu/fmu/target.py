"""What an FMU is made of: native, compiled C, where a C compiler is at hand, else python."""

from __future__ import annotations

import warnings

from ..errors import BuildError, UsageError
from .compiler import REMEDY, find_compiler, host

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
