"""The runtime's files that an FMU carries as one, sources/runtime.c, and back.

Each stands in it whole, below its name and behind all that it includes.  Where one includes another of the
runtime it says so in a comment; so do the generated files, which stand beside it.  A hundred small files
would make the archive a fifth larger, since each is compressed by itself.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from functools import lru_cache

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
