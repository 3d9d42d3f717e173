"""The C runtime by itself: compiled with the machine's compiler, called through ctypes."""

from __future__ import annotations

import ctypes
import getpass
import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path

import pytest
from once import once

RUNTIME = Path(__file__).parent.parent / "lagfmu" / "runtime"
RUNTIME_FILES = {p.name: p for p in sorted(RUNTIME.glob("*/*.[ch]"))}
INCLUDES = tuple(f"-I{folder}" for folder in sorted(p for p in RUNTIME.iterdir() if p.is_dir()))
FLAGS = ("-std=c99", "-O1", "-ffp-contract=off", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion")


@cache
def compiler() -> str:
    """The system's C compiler; the test is skipped, with that reason, where there is none."""
    found = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if found is None:
        pytest.skip("no C compiler (cc) on this machine")
    return found


SANITIZE = (
    *("-O0", "-g", "-fno-omit-frame-pointer"),
    *("-fsanitize=address,undefined", "-fno-sanitize-recover=all"),
)


def objects(files: Iterable[Path], flags: Sequence[str] = ()) -> list[str]:
    """Object files of C files that include headers of the runtime alone; warnings are errors.

    Each is compiled once on this machine for what it holds: all tests that link it share it.
    """
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        return list(pool.map(lambda file: _object(file, tuple(flags)), files))


@cache
def _object(file: Path, flags: tuple[str, ...]) -> str:
    command = [compiler(), *FLAGS, *flags, "-Werror", "-fPIC"]
    digest = hashlib.sha256("\0".join([_identity(), *command]).encode())
    digest.update(file.read_bytes())

    def make(folder: Path) -> None:
        made = ["-c", str(file), "-o", str(folder / f"{file.stem}.o")]
        run = subprocess.run(
            [*command, *INCLUDES, *made], capture_output=True, text=True, timeout=300
        )
        if run.returncode and "sanitize" in run.stderr:
            pytest.skip("the compiler has no sanitizers")
        assert run.returncode == 0, run.stderr[-2000:]

    cached = Path(tempfile.gettempdir(), f"lagfmu-objects-{getpass.getuser()}")
    return str(once(cached / digest.hexdigest()[:24], make) / f"{file.stem}.o")


@cache
def _identity() -> str:
    """The compiler's version and the runtime's headers."""
    run = subprocess.run([compiler(), "--version"], capture_output=True, text=True, timeout=60)
    headers = (p.read_text("utf-8") for n, p in RUNTIME_FILES.items() if n.endswith(".h"))
    return "\0".join([run.stdout, *headers])


def compile_library(
    folder: Path, sources: Sequence[str], extra: str = "", flags: Sequence[str] = ()
) -> ctypes.CDLL:
    """A library of the runtime files `sources` and of the C text `extra`; warnings are errors."""
    key = hashlib.sha256("\0".join([*sources, extra, *flags]).encode()).hexdigest()[:12]
    target = folder / f"runtime_{key}.so"
    if "interval_" in extra and "interval.c" not in sources:
        sources = [*sources, "interval.c"]  # which generated bounds are made of
    kinds = [flag for flag in flags if not flag.startswith("-I")]
    files = objects([RUNTIME_FILES[name] for name in sources], kinds)
    if extra:
        text = folder / f"extra_{key}.c"
        text.write_text(extra, encoding="utf-8")
        files.append(str(text))
    command = [compiler(), *FLAGS, *flags, "-Werror", "-shared", "-fPIC", *INCLUDES]
    subprocess.run([*command, "-o", str(target), *files, "-lm"], check=True, timeout=300)
    return ctypes.CDLL(str(target))
