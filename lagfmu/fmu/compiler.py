"""C sources -> shared libraries for several platforms, by `ziglang` (from any host) or the system's cc.

The objects of the runtime are the same for all FMUs: each is compiled once for a platform, into the user's
cache, where its name tells what it was made of, and linked from there.
"""

from __future__ import annotations

import atexit
import contextlib
import errno
import hashlib
import importlib.metadata
import importlib.util
import os
import platform
import shutil
import struct
import subprocess
import sys
import tempfile
from collections.abc import Collection, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path

from ..errors import BuildError, TemporaryFolderError, UsageError
from ..methods import INTEGRATORS
from .archive import reached

HOST, ALL = "host", "all"
TIMEOUT = 600  # seconds for one call of the compiler
LITTLE = 100_000  # bytes of room, in which a compiler that fails has failed for want of it
CACHE = "LAGFMU_CACHE"
REMEDY = "no C compiler was found: pip install ziglang"
FLAGS = (
    "-std=c99",
    "-fPIC",
    "-fvisibility=hidden",
    "-ffp-contract=off",  # the same rounding everywhere
    "-fno-math-errno",
    "-fomit-frame-pointer",  # zig keeps it, which costs 1 % of bytes and of time
    "-ffunction-sections",
    "-fdata-sections",
    "-fno-unroll-loops",  # most models are small: code that fits into the cache is faster
    "-fno-tree-vectorize",
    "-fno-tree-slp-vectorize",
    "-g0",
)
FAST = "-O2"
SMALL = ("-Os", "-Xclang", "-Oz")  # zig takes -Oz for -Os, which clang packs 7 % worse
HOT = {  # where the time of a step and of a communication point goes; all else is compiled for size
    *("model.c", "mechanism.c", "project.c", "sliding.c", "sensitivity.c"),
    *("sliding_along.c", "variation.c", "derivatives.c"),
    *("linear.c", "schur.c", "ldlt.c", "lu.c", "painleve.c"),
    *(f"{method}.c" for method in INTEGRATORS),
    "integrator.c",
    *("segment.c", "state.c", "observe.c", "minimum_gap.c", "system.c"),
}

HINTED = "-finline-hint-functions"  # clang: inline what is declared so, not each helper at each of its calls

SHARED = ("-shared", "-s", "-Os")  # -Os is for what the compiler adds of its own
# Windows cannot do without
NO_UNWINDING = ("-fno-asynchronous-unwind-tables", "-fno-unwind-tables")


@dataclass(frozen=True)
class Platform:
    """One folder below binaries/ (FMI 2.0.5, section 2.3: names of its own for x86, else tuples).

    `targets` are zig's names; several make a universal binary.  `systems` are the hosts, as
    (system, machine), whose FMI tools load this folder first.
    """

    folder: str
    suffix: str
    targets: tuple[str, ...]
    systems: tuple[tuple[str, str], ...]


PLATFORMS = (
    Platform("linux64", ".so", ("x86_64-linux-gnu.2.17",), (("linux", "x86_64"),)),
    Platform("aarch64-linux", ".so", ("aarch64-linux-gnu.2.17",), (("linux", "aarch64"),)),
    Platform("win64", ".dll", ("x86_64-windows-gnu",), (("windows", "x86_64"),)),
    Platform(  # universal: some tools look here on either processor
        "darwin64",
        ".dylib",
        ("x86_64-macos.10.15", "aarch64-macos.11.0"),
        (("darwin", "x86_64"),),
    ),
    Platform("aarch64-darwin", ".dylib", ("aarch64-macos.11.0",), (("darwin", "aarch64"),)),
)
NAMES = tuple(p.folder for p in PLATFORMS)
WASM = Platform("wasm32", ".wasm", ("wasm32-wasi",), ())  # for a page: no FMU has a binary of it


@dataclass(frozen=True)
class Compiler:
    """A command that compiles C; `cross` if it knows all targets, `identity` names its version."""

    command: tuple[str, ...]
    cross: bool
    identity: str


@cache
def find_compiler() -> Compiler | None:
    """`ziglang` where it is installed, else the system's cc, else None."""
    found = importlib.util.find_spec("ziglang")
    if found is not None and found.origin is not None:
        program = Path(found.origin).parent / ("zig.exe" if os.name == "nt" else "zig")
        if program.exists():
            version = importlib.metadata.version("ziglang")
            return Compiler((str(program), "cc"), True, f"ziglang {version}")
    for name in ("cc", "gcc", "clang"):
        path = shutil.which(name)
        if path is not None:
            run = subprocess.run(
                [path, "--version"], capture_output=True, text=True, check=False, timeout=TIMEOUT
            )
            return Compiler((path,), False, f"{path} {run.stdout}")
    return None


def host() -> Platform:
    """The platform of this machine.  Raises BuildError if FMUs have no name for it."""
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(
        platform.machine().lower(), platform.machine().lower()
    )
    here = (platform.system().lower(), machine)
    for p in PLATFORMS:
        if here in p.systems:
            return p
    raise BuildError(f"no native FMU can be built for {'-'.join(here)}; known: {', '.join(NAMES)}")


def chosen(names: Iterable[str]) -> tuple[Platform, ...]:
    """Platforms by name; `host` and `all` are names too.  Raises UsageError for unknown ones."""
    wanted: set[str] = set()
    for name in names:
        if name == ALL:
            wanted |= set(NAMES)
        elif name == HOST:
            wanted.add(host().folder)
        elif name in NAMES:
            wanted.add(name)
        else:
            raise UsageError(
                f"platform {name!r} is unknown, expected {ALL}, {HOST} or some of {', '.join(NAMES)}"
            )
    if not wanted:
        raise UsageError("no platform was chosen")
    return tuple(p for p in PLATFORMS if p.folder in wanted)


def compile_libraries(
    name: str,
    generated: Mapping[str, bytes],
    runtime: Mapping[str, bytes],
    platforms: Sequence[Platform],
    left_out: Collection[str] = (),
) -> dict[str, bytes]:
    """Folder -> the library `name` made of the .c files of both; BuildError with the first error.

    The `runtime` files must not depend on the generated ones.  Those in `left_out`, and those of which
    there is a generated one, are not linked.
    """
    compiler = find_compiler()
    if compiler is None:
        raise BuildError(REMEDY)
    foreign = [p.folder for p in platforms if p != host()] if not compiler.cross else []
    if foreign:
        raise BuildError(
            f"{compiler.command[0]} compiles for this machine only, not for {', '.join(foreign)}: "
            "pip install ziglang"
        )
    targets = dict.fromkeys(t for p in platforms for t in (p.targets if compiler.cross else ("",)))
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        jobs = {
            t: pool.submit(_library, compiler, t, name, generated, runtime, left_out)
            for t in targets
        }
        made = {t: job.result() for t, job in jobs.items()}
    return {
        p.folder: universal([made[t] for t in (p.targets if compiler.cross else ("",))])
        for p in platforms
    }


def is_first(platforms: Sequence[Platform], runtime: Mapping[str, bytes]) -> bool:
    """True if an object of the runtime is not in the cache for one of the platforms."""
    compiler = find_compiler()
    if compiler is None:
        return False
    return any(
        not place.exists()
        for p in platforms
        for t in (p.targets if compiler.cross else ("",))
        for place in _places(compiler, t, runtime).values()
    )


def _library(
    compiler: Compiler,
    target: str,
    name: str,
    generated: Mapping[str, bytes],
    runtime: Mapping[str, bytes],
    left_out: Collection[str],
) -> bytes:
    with tempfile.TemporaryDirectory(prefix="lagfmu_") as folder:
        for file, content in {**runtime, **generated}.items():
            if file.endswith(".h") or file in generated:
                Path(folder, file).write_bytes(content)
        linked = []
        for file, content in _objects(compiler, target, runtime).items():
            if file not in left_out and file not in generated:
                linked.append(f"{file[:-2]}.o")
                Path(folder, linked[-1]).write_bytes(content)
        for file in sorted(f for f in generated if f.endswith(".c")):
            _compile(compiler, target, file, f"{file[:-2]}.o", folder)
            linked.append(f"{file[:-2]}.o")
        library = name + _suffix(target)
        arguments = [*_link_flags(target, library), "-o", library, *linked, "-lm"]
        _run(compiler, target, arguments, folder)
        return Path(folder, library).read_bytes()


def _objects(compiler: Compiler, target: str, runtime: Mapping[str, bytes]) -> dict[str, bytes]:
    """C file of the runtime -> its object, from the cache; compiled if it is not there whole."""
    places = _places(compiler, target, runtime)
    found = {file: _cached(place) for file, place in places.items()}
    objects = {file: content for file, content in found.items() if content is not None}
    wanted = [file for file in places if file not in objects]
    if not wanted:
        return objects
    try:
        _cache().mkdir(parents=True, exist_ok=True)
        room = tempfile.TemporaryDirectory(prefix=".lagfmu_", dir=str(_cache()))
    except OSError as error:
        raise TemporaryFolderError(error, CACHE) from None
    with room as folder:
        for file, content in runtime.items():
            Path(folder, file).write_bytes(content)
        for file in wanted:
            made = f"{file[:-2]}.o"
            _compile(compiler, target, file, made, folder)
            objects[file] = content = Path(folder, made).read_bytes()
            Path(folder, made).write_bytes(hashlib.sha256(content).digest() + content)
            with contextlib.suppress(OSError):  # another process was faster
                Path(folder, made).replace(places[file])
    return {file: objects[file] for file in places}  # in one order: that of the bytes of a library


def _cached(place: Path) -> bytes | None:
    """An object of the cache, behind its digest; None if it is not there, or not whole."""
    try:
        held = place.read_bytes()
    except OSError:
        return None
    digest, content = held[:32], held[32:]
    return content if hashlib.sha256(content).digest() == digest else None


def _places(compiler: Compiler, target: str, runtime: Mapping[str, bytes]) -> dict[str, Path]:
    """Where the objects are: named by compiler, platform, flags, and what the file holds and includes."""
    common = hashlib.sha256()

    def take(digest: hashlib._Hash, *parts: bytes) -> str:
        for part in parts:
            digest.update(len(part).to_bytes(8, "big") + part)
        return digest.hexdigest()[:24]

    take(common, compiler.identity.encode(), target.encode())
    places = {}
    for file in sorted(f for f in runtime if f.endswith(".c")):
        flags = map(str.encode, _flags(compiler, target, file))
        name = take(common.copy(), *flags, *(_digest(runtime[f]) for f in reached(runtime, [file])))
        places[file] = _cache() / f"{file[:-2]}-{target or 'host'}-{name}.object"
    return places


@lru_cache(maxsize=1024)
def _digest(text: bytes) -> bytes:
    return hashlib.sha256(text).digest()


def _cache() -> Path:
    """The user's cache folder of lagfmu, below LAGFMU_CACHE if that is set, and not empty."""
    if os.environ.get(CACHE):
        return Path(os.environ[CACHE])
    if sys.platform == "win32" and "LOCALAPPDATA" in os.environ:
        return Path(os.environ["LOCALAPPDATA"], "lagfmu")
    try:
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "lagfmu")
    except RuntimeError:  # nobody's home
        return _lent()


@cache
def _lent() -> Path:
    """A folder of this process's own, that goes with it."""
    folder = Path(tempfile.mkdtemp(prefix="lagfmu_"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def _surroundings() -> dict[str, str]:
    """The environment of the compiler: without a home zig does not know where to keep what it makes."""
    found = dict(os.environ)
    if not found.get("HOME") and not found.get("XDG_CACHE_HOME"):
        found.setdefault("ZIG_GLOBAL_CACHE_DIR", str(_cache() / "zig"))
    return found


def _suffix(target: str) -> str:
    if not target:
        return host().suffix
    return next(p.suffix for p in (*PLATFORMS, WASM) if target in p.targets)


def _link_flags(target: str, library: str) -> list[str]:
    if _suffix(target) == ".dylib":
        return [*SHARED, "-Wl,-dead_strip", "-Wl,-x", f"-Wl,-install_name,@rpath/{library}"]
    if _suffix(target) == ".dll":
        return [*SHARED, "-Wl,--gc-sections"]
    if _suffix(target) == WASM.suffix:  # what the sources mark as exported
        return ["-mexec-model=reactor", "-s", "-Os", "-Wl,--gc-sections"]
    lean = ("-Wl,--gc-sections", "-Wl,--build-id=none", "-Wl,--hash-style=gnu", "-Wl,-Bsymbolic")
    return [*SHARED, *lean, f"-Wl,-soname,{library}"]


def _compile(compiler: Compiler, target: str, file: str, made: str, folder: str) -> None:
    _run(compiler, target, [*_flags(compiler, target, file), "-c", file, "-o", made], folder)


def _flags(compiler: Compiler, target: str, file: str) -> tuple[str, ...]:
    speed: tuple[str, ...] = (FAST,) if file in HOT else SMALL if compiler.cross else SMALL[:1]
    if file == "model.c" and compiler.cross:
        speed += (HINTED,)
    flags = (*FLAGS, *speed) if _suffix(target) == ".dll" else (*FLAGS, *speed, *NO_UNWINDING)
    if _suffix(target) == WASM.suffix:
        flags = tuple(f for f in flags if f != "-fPIC")
    return (*flags, "-fno-sanitize=undefined") if target else flags


def _run(compiler: Compiler, target: str, arguments: Sequence[str], folder: str) -> None:
    command = [*compiler.command]
    if target:
        command += ["-target", target]
    command += arguments
    try:
        run = subprocess.run(
            command,
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
            timeout=TIMEOUT,
            env=_surroundings(),
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise BuildError(f"the C compiler {compiler.command[0]} cannot run: {error}") from None
    if run.returncode != 0:
        place = Path(folder).parent
        if "FdQuotaExceeded" in run.stderr or "Too many open files" in run.stderr:
            raise TemporaryFolderError(OSError(errno.EMFILE, os.strerror(errno.EMFILE), str(place)))
        if "No space left" in run.stderr or shutil.disk_usage(place).free < LITTLE:
            full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(place))
            raise TemporaryFolderError(full, CACHE if place == _cache() else "TMPDIR")
        lines = [line for line in run.stderr.splitlines() if line.strip()]
        first = next(
            (line for line in lines if "error" in line), lines[0] if lines else "no message"
        )
        raise BuildError(f"the C compiler failed for {target or 'this machine'}: {first.strip()}")


# ---------------------------------------------------------------------------- universal binaries

FAT_MAGIC, ALIGNMENT = 0xCAFEBABE, 14  # 2^14 bytes, the page of arm64


def universal(slices: Sequence[bytes]) -> bytes:
    """One Mach-O file of several (<mach-o/fat.h>); a single library stays as it is."""
    if len(slices) == 1:
        return slices[0]
    head = struct.pack(">II", FAT_MAGIC, len(slices))
    offset, body = 1 << ALIGNMENT, b""
    for library in slices:
        cpu, subtype = struct.unpack_from("<II", library, 4)
        head += struct.pack(">IIIII", cpu, subtype, offset + len(body), len(library), ALIGNMENT)
        body += library + b"\0" * (-len(library) % (1 << ALIGNMENT))
    return head.ljust(offset, b"\0") + body
