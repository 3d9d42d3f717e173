"""The C sources of an FMU -> one WebAssembly module, with an importer for pages (web/importer.c)."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.resources import files

from ..errors import BuildError
from ..fmu.compiler import WASM, compile_libraries, find_compiler
from ..fmu.native import runtime_files

IMPORTER = "importer.c"


def compile_module(name: str, sources: Mapping[str, bytes]) -> bytes:
    """The module of `sources` (file name -> text, as below sources/ of a native FMU).

    It imports nothing and exports what web/importer.c marks.  Files that are this version's own
    runtime are compiled once for all models.  Raises BuildError without ziglang, or with the
    compiler's first error.
    """
    compiler = find_compiler()
    if compiler is None or not compiler.cross:
        raise BuildError(
            "a page needs ziglang, which compiles the FMU's C sources to WebAssembly, and it is not "
            "installed: pip install lagfmu[native]"
        )
    runtime = runtime_files()
    own = {file: text for file, text in sources.items() if runtime.get(file) != text}
    own[IMPORTER] = files("lagfmu").joinpath("live/web", IMPORTER).read_bytes()
    gone = runtime.keys() - sources.keys()
    return compile_libraries(name, own, runtime, [WASM], gone)[WASM.folder]
