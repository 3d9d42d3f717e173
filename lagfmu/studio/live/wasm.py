"""The C sources of an FMU -> one WebAssembly module, with an importer for pages (web/importer.c)."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.resources import files

from ...errors import BuildError
from ...fmu.compiler import WASM, compile_libraries, find_compiler
from ...fmu.native import ALL, GENERATED

IMPORTER = "importer.c"


def compile_module(name: str, sources: Mapping[str, bytes]) -> bytes:
    """The module of `sources` (file name -> text, as below sources/ of a native FMU).

    It imports nothing and exports what web/importer.c marks.  Of the runtime there are a few, by what a
    scene needs: each is compiled once.  Raises BuildError without ziglang, or with the compiler's first
    error.
    """
    compiler = find_compiler()
    if compiler is None or not compiler.cross:
        raise BuildError(
            "a page needs ziglang, which compiles the FMU's C sources to WebAssembly, and it is not "
            "installed: pip install ziglang"
        )
    own = {file: text for file, text in sources.items() if file in GENERATED}
    runtime = {file: text for file, text in sources.items() if file not in own and file != ALL}
    own[IMPORTER] = files("lagfmu").joinpath("studio/live/web", IMPORTER).read_bytes()
    return compile_libraries(name, own, runtime, [WASM])[WASM.folder]
