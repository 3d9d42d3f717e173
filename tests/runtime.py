"""The C runtime by itself: compiled with the machine's compiler, called through ctypes."""

from __future__ import annotations

import ctypes
import hashlib
import shutil
import subprocess
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import pytest

RUNTIME = Path(__file__).parent.parent / "lagfmu" / "runtime"
RUNTIME_FILES = {p.name: p for p in sorted(RUNTIME.glob("*/*.[ch]"))}
INCLUDES = tuple(f"-I{folder}" for folder in sorted(p for p in RUNTIME.iterdir() if p.is_dir()))
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion")


@cache
def compiler() -> str:
    """The system's C compiler; the test is skipped, with that reason, where there is none."""
    found = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if found is None:
        pytest.skip("no C compiler (cc) on this machine")
    return found


def compile_library(
    folder: Path, sources: Sequence[str], extra: str = "", flags: Sequence[str] = ()
) -> ctypes.CDLL:
    """A library of the runtime files `sources` and of the C text `extra`; warnings are errors."""
    key = hashlib.sha256("\0".join([*sources, extra, *flags]).encode()).hexdigest()[:12]
    target = folder / f"runtime_{key}.so"
    if "interval_" in extra and "interval.c" not in sources:
        sources = [*sources, "interval.c"]  # which generated bounds are made of
    files = [str(RUNTIME_FILES[name]) for name in sources]
    if extra:
        text = folder / f"extra_{key}.c"
        text.write_text(extra, encoding="utf-8")
        files.append(str(text))
    command = [compiler(), *FLAGS, *flags, "-Werror", "-shared", "-fPIC", *INCLUDES]
    subprocess.run([*command, "-o", str(target), *files, "-lm"], check=True, timeout=300)
    return ctypes.CDLL(str(target))
