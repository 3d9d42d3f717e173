"""The archive of an FMU: a zip file whose bytes depend on its contents only; and its files, read by one door
that lets no damaged and no hostile archive in.

The runtime's files stand in it as one, sources/runtime.c, each whole, below its name and behind all that it
includes.  Where one includes another of the runtime it says so in a comment; so do the generated files, which
stand beside it.  A hundred small files would make the archive a fifth larger, since each is compressed by
itself.
"""

from __future__ import annotations

import contextlib
import importlib.metadata
import io
import re
import shutil
import stat
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from pathlib import Path

from ..errors import TemporaryFolderError, VerificationError

LARGEST = 1 << 31  # bytes of all files of an FMU, unpacked
LARGEST_TEXT = 64_000_000  # bytes of a file that is read as a whole
MOST = 100_000  # files
SHOWN = 3  # problems in a message
READ = ("documentation/", "sources/")  # what people and compilers read: no run needs it
LEVEL = 9  # of zlib: as small as can be
DAMAGED = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, struct.error)
OUTSIDE = re.compile(r"[/\\]|.*[:\\]|(.*/)?\.\.(/|\Z)", re.S)  # absolute, of a drive, or above


def tool() -> str:
    """What FMUs name as the tool that made them."""
    return f"lagfmu {version()}"


def version() -> str:
    """The version of lagfmu that is installed."""
    return importlib.metadata.version("lagfmu")


def pack(contents: Mapping[str, bytes]) -> bytes:
    """A zip archive whose bytes depend on the contents only: fixed times, modes and order."""
    buffer = io.BytesIO()
    order = sorted(contents, key=lambda name: (name != "modelDescription.xml", name))
    with zipfile.ZipFile(buffer, "w") as archive:
        for name in order:
            info = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            info.create_system = 3
            info.external_attr = 0o644 << 16
            info.compress_type = zipfile.ZIP_DEFLATED
            # that of `archive` is not taken
            archive.writestr(info, contents[name], compresslevel=LEVEL)
    return buffer.getvalue()


@contextlib.contextmanager
def opened(fmu: Path) -> Iterator[zipfile.ZipFile]:
    """An FMU's archive, to be read.

    Raises VerificationError if the file is missing, is no zip archive, holds what an FMU does not (names
    outside its folder, links, encrypted files, more than unpacked fits on a disk), or turns out to be
    damaged while it is read.
    """
    if not fmu.is_file():
        what = "this is a folder, expected the archive" if fmu.is_dir() else "there is no such file"
        raise VerificationError(f"{str(fmu)!r}: {what}")
    try:
        with zipfile.ZipFile(fmu) as archive:
            if any(i.compress_size > fmu.stat().st_size for i in archive.infolist()):
                raise zipfile.BadZipFile("a file in it is longer than the archive")
            if problems := _problems(archive.infolist()):
                raise VerificationError(f"{str(fmu)!r} is not unpacked: {'; '.join(problems)}")
            yield archive
    except (*DAMAGED, OSError) as error:
        raise VerificationError(
            f"{str(fmu)!r} is no FMU or damaged, expected a zip archive with modelDescription.xml ({error})"
        ) from None


def entry(archive: zipfile.ZipFile, name: str) -> bytes:
    """A file of an archive that is a text.  Raises VerificationError for one that is too large to be read."""
    if (size := archive.getinfo(name).file_size) > LARGEST_TEXT:
        raise VerificationError(
            f"{str(archive.filename)!r}: its file {name!r} has {size} bytes, expected at most "
            f"{LARGEST_TEXT}: build the FMU anew"
        )
    return archive.read(name)


def _problems(files: list[zipfile.ZipInfo]) -> list[str]:
    found = []
    for file in files:
        if OUTSIDE.match(file.orig_filename) or OUTSIDE.match(file.filename):
            found.append(f"its file {file.orig_filename!r} would be put outside its folder")
        elif stat.S_ISLNK(file.external_attr >> 16):
            found.append(f"its file {file.filename!r} is a link")
        elif file.flag_bits & 1:
            found.append(f"its file {file.filename!r} is encrypted")
    if len(found) > SHOWN:
        found[SHOWN:] = [f"and {len(found) - SHOWN} more"]
    if len(files) > MOST:
        found.append(f"it holds {len(files)} files, expected at most {MOST}")
    if (size := sum(file.file_size for file in files)) > LARGEST:
        found.append(f"its files have {size / 1e9:.3g} GB, expected at most {LARGEST / 1e9:.3g} GB")
    return found


def unpack(fmu: Path) -> str:
    """A temporary folder with what a run of an FMU needs, which the caller removes.

    Raises VerificationError as `opened` does, and TemporaryFolderError.
    """
    folder = ""
    try:
        with opened(fmu) as archive:
            try:
                folder = tempfile.mkdtemp(prefix="lagfmu_")
                archive.extractall(
                    folder, [n for n in archive.namelist() if not n.startswith(READ)]
                )
            except OSError as error:
                raise TemporaryFolderError(error) from None
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    return folder


def platforms(fmu: Path) -> list[str]:
    """For which an FMU, a file or an unpacked folder, has binaries."""
    if fmu.is_dir():
        return sorted(p.name for p in fmu.glob("binaries/*"))
    with opened(fmu) as archive:
        parts = [name.split("/") for name in archive.namelist()]
    return sorted({p[1] for p in parts if p[0] == "binaries" and len(p) > 1 and p[1]})


BUNDLE = "runtime.c"
INCLUDE = re.compile(rb'^#include "(\w+\.[ch])"$', re.MULTILINE)
INCLUDED = re.compile(rb'^/\* (#include "\w+\.[ch]") \*/$', re.MULTILINE)
# comments, texts and inclusions
SILENT = re.compile(rb'/\*.*?\*/|"(?:[^"\\\n]|\\.)*"', re.DOTALL)
DEFINED = re.compile(  # for other files: a function, or a value
    rb"^(?!static|SHARED )[A-Za-z_][\w \*]*?\b(\w+)(?:\[[^\]]*\])*(?:\(| = )", re.MULTILINE
)
USED = re.compile(rb"(?<![.\w])(?<!->)[A-Za-z_]\w*")  # no member of a structure
HEAD = b"""/* runtime.c -- the part of lagfmu's runtime that this FMU holds: its files one behind the other,
 * each below its name.  What one includes stands above it. */
"""
NAME = "\n/* ======== {} ======== */\n"
NAMED = re.compile(rb"\n/\* ======== (\w+\.[ch]) ======== \*/\n")


@lru_cache(maxsize=1024)
def _includes(text: bytes) -> tuple[str, ...]:
    return tuple(file.decode() for file in INCLUDE.findall(text))


def reached(files: Mapping[str, bytes], begin: Iterable[str]) -> list[str]:
    """Those of `files` that the ones in `begin` include, and these; each behind all that it includes."""
    found: dict[str, None] = {}

    def visit(file: str) -> None:
        if file in found or file not in files:
            return
        for other in _includes(files[file]):
            visit(other)
        found[file] = None

    for file in begin:
        visit(file)
    return [*found]


@lru_cache(maxsize=1024)
def _names(text: bytes) -> tuple[frozenset[bytes], frozenset[bytes]]:
    """Those that a C file defines for others, and those that it uses, its own among them."""
    code = SILENT.sub(b"", text)
    return frozenset(DEFINED.findall(code)), frozenset(USED.findall(code))


def linked(runtime: Mapping[str, bytes], generated: Mapping[str, bytes], begin: str) -> list[str]:
    """The C files of the runtime that are reached by name, as a linker finds them, from the generated files
    and those whose names `begin` so.  What a generated file defines is looked for nowhere else."""
    files = {f: text for f, text in {**runtime, **generated}.items() if f.endswith(".c")}
    owner = {name: f for f, text in files.items() for name in _names(text)[0]}
    waiting = [f for f in files if f in generated or f.startswith(begin)]
    found = set(waiting)
    while waiting:
        used = _names(files[waiting.pop()])[1]
        more = {owner[name] for name in used & owner.keys()} - found
        found |= more
        waiting += more
    return [f for f in files if f in found and f not in generated]


def bundled(runtime: Mapping[str, bytes], generated: Mapping[str, bytes]) -> dict[str, bytes]:
    """The generated files, and those of the runtime as one."""

    def told(text: bytes) -> bytes:
        return INCLUDE.sub(lambda m: b"/* %b */" % m[0] if m[1].decode() in runtime else m[0], text)

    order = reached(runtime, [*(f for f in runtime if f.endswith(".c")), *runtime])
    parts = [NAME.format(file).encode() + told(runtime[file]) for file in order]
    return {BUNDLE: HEAD + b"".join(parts)} | {f: told(text) for f, text in generated.items()}


def unbundled(carried: Mapping[str, bytes]) -> dict[str, bytes]:
    """The files of which `bundled` made these; without a bundle they are taken as they are."""
    if BUNDLE not in carried:
        return dict(carried)
    _, *parts = NAMED.split(carried[BUNDLE])
    files = dict(zip((name.decode() for name in parts[::2]), parts[1::2], strict=True))
    files |= {f: text for f, text in carried.items() if f != BUNDLE}
    return {f: INCLUDED.sub(rb"\1", text) for f, text in files.items()}
