"""Native FMUs as files: what the archive holds, for whom the binaries are, that others run and rebuild."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import binaries
import numpy as np
import pytest
import runs
from conftest import BOTH, EVERY, MODELS, as_small_as_can_be, of_each_kind
from fmi2 import FUNCTIONS
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.build import build_platform_binary
from fmpy.validation import validate_fmu
from once import once
from runtime import INCLUDES, RUNTIME_FILES
from runtime import compiler as compiler_here
from typer.testing import CliRunner

from lagfmu import names
from lagfmu.errors import BuildError, LagfmuError, UsageError
from lagfmu.testing import (
    NAMES,
    PLATFORMS,
    app,
    bundled,
    chosen,
    compile_libraries,
    compiler,
    find_compiler,
    host,
    prepare,
    reached,
    sources_of,
    unbundled,
    write,
)

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")

HERE = Path(__file__).parent
EXPORTS = {f"fmi2{name}" for name in FUNCTIONS} | {"lagfmu_batch"}  # the sweep's inner loop
LONG = 600  # seconds: the first build for Windows compiles its C library


def cross() -> compiler.Compiler:
    """The compiler for all platforms; the test is skipped where there is only the host's."""
    found = find_compiler()
    if found is None or not found.cross:
        pytest.skip("ziglang is not installed: pip install ziglang")
    return found


@pytest.fixture(scope="session")
def built_for(prepared, shared_folder) -> Callable[..., Path]:
    """built_for(PLATFORM, ...): Hemisphere.fmu for these, cross-compiled by one process for all."""
    cross()

    def get(*platforms: str) -> Path:
        def make(place: Path) -> None:
            with as_small_as_can_be():
                write(prepared("Hemisphere"), place, target="native", platforms=platforms)

        return once(shared_folder / f"for-{'-'.join(platforms)}", make) / "Hemisphere.fmu"

    return get


# ---------------------------------------------------------------------------- the archive


def described(path: Path) -> dict[str, dict[str, dict[str, str]]]:
    """By name, whatever its place: each variable, and each entry of the structure with its dependencies."""
    with zipfile.ZipFile(path) as archive:
        root = ET.fromstring(archive.read("modelDescription.xml"))
    variables = list(root.find("ModelVariables"))
    place = {str(k + 1): v.get("name") for k, v in enumerate(variables)}
    found: dict[str, dict[str, dict[str, str]]] = {"variables": {}}
    for v in variables:
        typed = {k: x for k, x in v[0].attrib.items() if k != "reinit"}
        if "derivative" in typed:
            typed["derivative"] = place[typed["derivative"]]
        said = {k: x for k, x in v.attrib.items() if k != "valueReference"} | typed
        if v.get("name") == names.METHOD:
            said.pop("description")  # rattle is native only
        found["variables"][v.get("name")] = said
    for part in root.find("ModelStructure"):
        found[part.tag] = {
            place[u.get("index")]: {
                "depends": " ".join(place[k] for k in u.get("dependencies", "").split()),
                "kinds": u.get("dependenciesKind", ""),
            }
            for u in part
        }
    return found


@pytest.mark.parametrize("name", of_each_kind(BOTH))
def test_both_targets_have_the_same_variables(native_fmu, python_fmu, name):
    """Names, causality, units, starts, structure: one table, but for the step of fixed-step methods."""
    native, python = (described(target(name)) for target in (native_fmu, python_fmu))
    assert native.keys() == python.keys()
    for part, entries in native.items():
        more = entries.keys() - python[part].keys()
        assert more <= {names.STEP}, more
        assert {n: entries[n] for n in entries if n not in more} == python[part]


def test_the_archive_holds_what_it_needs_and_no_more(native_fmu):
    """Binary, documentation, proof, and every source that the description lists."""
    path = native_fmu("Hemisphere")
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
        names = archive.namelist()
        assert names[0] == "modelDescription.xml"
        root = ET.fromstring(archive.read(names[0]))
    listed = [e.get("name") for e in root.findall("CoSimulation/SourceFiles/File")]
    assert listed == [e.get("name") for e in root.findall("ModelExchange/SourceFiles/File")]
    sources = {n.removeprefix("sources/") for n in names if n.startswith("sources/")}
    assert listed == ["all.c"]
    with zipfile.ZipFile(path) as archive:
        included = re.findall(r'#include "(\w+\.c)"', archive.read("sources/all.c").decode())
    assert {*included, "all.c", "identity.h"} == sources
    others = {n for n in names if not n.startswith("sources/")}
    assert others == {
        "modelDescription.xml",
        "documentation/index.html",
        "documentation/licenses/license.txt",
        "resources/lagfmu.json",
        "resources/page.json",
        "resources/picture.json",
        f"binaries/{host().folder}/Hemisphere{host().suffix}",
    }


def test_the_sources_are_those_that_the_binary_is_made_of(native_fmu):
    """Of the runtime an FMU carries the C files of its scene, whole, and the headers that these include: the
    hemisphere's nothing of mechanisms, frictions, tables or steps that it has not."""
    files = runs.sources(native_fmu("Hemisphere"))
    runtime = {name: text for name, text in files.items() if name in RUNTIME_FILES}
    for name in runtime.keys() - {"optional.c"}:
        assert runtime[name] == RUNTIME_FILES[name].read_bytes(), name
    own = [name for name in files if name.endswith(".c") and name != "all.c"]
    assert {*reached(files, own)} == files.keys() - {"all.c"}
    gone = {"kinematics", "sliding", "stick_slip", "error_bars", "switches", "variation", "rattle"}
    assert not gone & {Path(name).stem for name in own}
    again = bundled(runtime, {name: files[name] for name in files.keys() - runtime.keys()})
    assert unbundled(again) == files


@pytest.mark.thorough
def test_the_fmu_is_small(native_fmu, built_for):
    """Bounds that a library linked in by mistake would break, and code that only some models need."""
    for name, most in (("PendulumCartesian", 280e3), ("Hemisphere", 310e3)):
        assert native_fmu(name).stat().st_size < most
    everywhere = built_for("all")
    assert everywhere.stat().st_size < 900e3
    with zipfile.ZipFile(everywhere) as archive:
        carried = [i for i in archive.infolist() if i.filename.startswith("sources/")]
        here = f"binaries/{host().folder}/Hemisphere{host().suffix}"
        others = [
            i
            for i in archive.infolist()
            if i.filename.startswith("binaries/") and i.filename != here
        ]
    sources = sum(i.compress_size for i in carried)
    assert everywhere.stat().st_size - sources < 710e3
    assert everywhere.stat().st_size - sources - sum(i.compress_size for i in others) < 130e3


def test_the_sources_can_be_left_out(prepared, tmp_path):
    """Who counts bytes builds without them: the description lists none, and the numbers are the same."""
    path = write(prepared("PendulumCartesian"), tmp_path, target="native", sources=False)
    with zipfile.ZipFile(path) as archive:
        assert not [n for n in archive.namelist() if n.startswith("sources/")]
        assert b"SourceFiles" not in archive.read("modelDescription.xml")
    assert validate_fmu(str(path)) == []


# ---------------------------------------------------------------------------- the binaries

MADE_FOR = {
    "linux64": [("linux", "x86_64", None)],
    "aarch64-linux": [("linux", "aarch64", None)],
    "win64": [("windows", "x86_64", None)],
    "darwin64": [("darwin", "x86_64", (10, 15)), ("darwin", "aarch64", (11, 0))],
    "aarch64-darwin": [("darwin", "aarch64", (11, 0))],
}
SYSTEM_LIBRARIES = ("libc.so.6", "libm.so.6", "KERNEL32.dll", "/usr/lib/libSystem.B.dylib")


FOLDERS = of_each_kind(NAMES, kinds=("linux64",))


@pytest.mark.parametrize("folder", FOLDERS)
def test_each_binary_is_for_its_platform_and_exports_fmi_alone(built_for, folder):
    """All 44 functions of FMI 2.0 and nothing else; no library but the system's own."""
    suffix = next(p.suffix for p in PLATFORMS if p.folder == folder)
    with zipfile.ZipFile(built_for(folder)) as archive:
        data = archive.read(f"binaries/{folder}/Hemisphere{suffix}")
    found = binaries.read(data)
    assert [(b.system, b.machine, b.oldest) for b in found] == MADE_FOR[folder]
    assert len(EXPORTS) == 45
    for b in found:
        # the linker's
        own = {"__dso_handle", "_mh_dylib_header"} if b.system == "darwin" else set()
        assert b.exports - own == EXPORTS
        for needed in b.needs:
            assert needed in SYSTEM_LIBRARIES or needed.startswith("api-ms-win-crt-"), needed
        if b.system == "darwin":
            assert b.name == "@rpath/Hemisphere.dylib"
            assert b.signed or b.machine == "x86_64"


@pytest.mark.parametrize("folder", FOLDERS)
def test_no_path_of_the_building_machine_is_inside(built_for, folder):
    """Neither folders of this repository, of the compiler and its caches, nor temporary ones."""
    path = built_for(folder)
    traces = {
        str(HERE.parent),
        str(path.parent),
        sys.prefix,
        os.path.expanduser("~"),
        "/tmp/",
    }
    with zipfile.ZipFile(path) as archive:
        for name in archive.namelist():
            data = archive.read(name)
            assert not [t for t in traces if t.encode() in data], name
            if name.startswith("binaries/"):
                assert b".pdb" not in data
                assert b"lagfmu_" not in data.replace(b"lagfmu_batch", b"")


BUILD = """
import sys
from dataclasses import replace
from pathlib import Path
from lagfmu.testing import load, prepare, write
file = load(Path(sys.argv[1]))
for s in file.scenes:
    if s.name == "PendulumCartesian":
        for target in ("native", "python"):
            write(prepare(file.model, s), Path(sys.argv[2], target), (), target)
"""


@pytest.mark.thorough
def test_two_processes_build_the_same_bytes(tmp_path):
    """Another hash seed, folder, and a cache that is empty: the same FMU of either target."""
    made = []
    for seed in ("1", "2"):
        folder = tmp_path / f"work{seed}" / ("deep/er" if seed == "2" else ".")
        folder.mkdir(parents=True)
        environment = {**os.environ, "PYTHONHASHSEED": seed}
        if seed == "2":
            environment["LAGFMU_CACHE"] = str(tmp_path / "cache")
        command = [sys.executable, "-c", BUILD, str(MODELS / "pendulum.py"), str(folder)]
        subprocess.run(command, cwd=folder, env=environment, check=True, timeout=LONG)
        made.append({p.parent.name: p.read_bytes() for p in folder.glob("*/*.fmu")})
    assert made[0].keys() == {"native", "python"}
    assert made[0] == made[1]


# ---------------------------------------------------------------------------- others run it

COLUMNS = ("r", "theta", "der(theta)", "lambda.surface", "departure.surface.time")


def hemisphere_by(command: list[str], library: str, path: Path) -> np.ndarray:
    """The table that tests/host.c prints: time and COLUMNS."""
    description = read_model_description(str(path))
    reference = {v.name: str(v.valueReference) for v in description.modelVariables}
    arguments = [library, description.guid, "2", "0.05", *(reference[c] for c in COLUMNS)]
    run = subprocess.run(
        [*command, *arguments],
        capture_output=True,
        text=True,
        timeout=LONG,
        check=False,
        env={**os.environ, "WINEDEBUG": "-all", "WINEPREFIX": str(path.parent / "wine")},
    )
    assert run.returncode == 0, run.stderr
    return np.array([[float(x) for x in line.split()] for line in run.stdout.splitlines()])


def build_host(target: str, folder: Path, suffix: str = "") -> str:
    """tests/host.c for a platform."""
    program = folder / f"host_{target}{suffix}"
    command = [*cross().command, "-target", target, "-O1", *INCLUDES, str(HERE / "host.c")]
    libraries = [] if "windows" in target else ["-ldl"]
    subprocess.run([*command, "-o", str(program), *libraries], check=True, timeout=LONG)
    return str(program)


def on_this_machine(fmu: Path, tmp_path: Path) -> tuple[np.ndarray, Path]:
    folder = Path(extract(str(fmu), str(tmp_path / "fmu")))
    if host().folder != "linux64":
        pytest.skip("the reference run is that of linux x86_64")
    program = build_host("x86_64-linux-gnu.2.17", tmp_path)
    library = folder / "binaries" / "linux64" / "Hemisphere.so"
    return hemisphere_by([program], str(library), fmu), folder


def test_the_windows_binary_gives_the_same_numbers_under_wine(built_for, tmp_path):
    """To 1e-12, the departure in between; Windows has another C library."""
    wine = shutil.which("wine") or shutil.which("wine64")
    if wine is None:
        pytest.skip("wine is not installed (Debian: wine64)")
    path = built_for("linux64", "win64")
    expected, folder = on_this_machine(path, tmp_path)
    program = build_host("x86_64-windows-gnu", tmp_path, ".exe")
    library = folder / "binaries" / "win64" / "Hemisphere.dll"
    found = hemisphere_by([wine, program], str(library), path)
    assert expected[-1, -1] > 1.6
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


def test_the_aarch64_binary_gives_the_same_numbers_under_qemu(built_for, tmp_path):
    """To 1e-12, the departure in between."""
    qemu = shutil.which("qemu-aarch64") or shutil.which("qemu-aarch64-static")
    root = Path("/usr/aarch64-linux-gnu")
    if qemu is None:
        pytest.skip("qemu-aarch64 is not installed (Debian: qemu-user)")
    if not (root / "lib" / "ld-linux-aarch64.so.1").exists():
        pytest.skip("no C library for aarch64 (Debian: libc6-arm64-cross)")
    path = built_for("linux64", "aarch64-linux")
    expected, folder = on_this_machine(path, tmp_path)
    program = build_host("aarch64-linux-gnu.2.17", tmp_path)
    library = folder / "binaries" / "aarch64-linux" / "Hemisphere.so"
    found = hemisphere_by([qemu, "-L", str(root), program], str(library), path)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.thorough
def test_the_sources_link_into_an_importer(built_for, native_fmu, tmp_path):
    """With a prefix for the functions, as the standard has it for several FMUs in one program: two of them
    share no name, and the numbers are those of the binary, bit for bit."""
    path = built_for("linux64")
    expected, folder = on_this_machine(path, tmp_path)
    other = Path(extract(str(native_fmu("HalfCar")), str(tmp_path / "other")))
    program, linked = tmp_path / "linked", []
    cc = [*cross().command, "-target", "x86_64-linux-gnu.2.17", "-O1", "-ffp-contract=off"]
    for name, place in (("Hemisphere", folder), ("HalfCar", other)):
        linked.append(str(tmp_path / f"{name}.o"))
        sources = place / "sources"
        flags = [f"-DFMI2_FUNCTION_PREFIX={name}_", f"-I{sources}", "-c", "-o", linked[-1]]
        subprocess.run([*cc, *flags, str(sources / "all.c")], check=True, timeout=LONG)
    flags = ["-DLINKED", "-DFMI2_FUNCTION_PREFIX=Hemisphere_", "-o", str(program)]
    command = [*cc, *flags, *INCLUDES, str(HERE / "host.c"), *linked, "-lm"]
    subprocess.run(command, check=True, timeout=LONG)
    found = hemisphere_by([str(program)], "none", path)
    np.testing.assert_array_equal(found, expected)


# ---------------------------------------------------------------------------- fmpy


def test_the_drift_of_model_exchange_is_bounded(native_fmu):
    """A pendulum for 200 s with CVODE at 1e-6: the rod's length to 1e-4, without a single event."""
    found = simulate_fmu(
        str(native_fmu("PendulumCartesian")),
        fmi_type="ModelExchange",
        stop_time=200.0,
        output_interval=1.0,
        relative_tolerance=1e-6,
        output=["residual.rod", "energy.total"],
    )
    assert len(found) == 201
    assert abs(found["residual.rod"]).max() < 1e-4
    assert abs(found["residual.rod"]).max() > 0


@pytest.mark.parametrize("name", of_each_kind(EVERY))
def test_the_listed_source_is_a_program(native_fmu, tmp_path, name):
    """An importer compiles the one file that the description lists: what all others define, in the runtime
    and in the model, is there once."""
    with zipfile.ZipFile(native_fmu(name)) as archive:
        archive.extractall(tmp_path)
    command = [compiler_here(), "-std=c99", "-fsyntax-only", "-Werror", "all.c"]
    run = subprocess.run(
        command, cwd=tmp_path / "sources", capture_output=True, text=True, timeout=120
    )
    assert run.returncode == 0, run.stderr[:1000]


@pytest.mark.thorough
def test_a_recompilation_from_the_sources_agrees(native_fmu, tmp_path):
    """fmpy, CMake and the system's compiler make the same FMU from what is inside."""
    if shutil.which("cmake") is None or shutil.which("cc") is None:
        pytest.skip("cmake and cc are needed")
    path = native_fmu("Hemisphere")
    folder = Path(extract(str(path), str(tmp_path / "fmu")))
    (binary,) = (folder / "binaries").rglob("Hemisphere*")
    binary.unlink()
    build_platform_binary(folder, cmake_options={"CMAKE_SHARED_LINKER_FLAGS:STRING": "-lm"})
    assert binary.exists()
    expected, found = (
        simulate_fmu(str(p), fmi_type="CoSimulation", relative_tolerance=1e-10, output=COLUMNS)
        for p in (path, folder)
    )
    assert expected["departure.surface.time"][-1] > 1.6
    for n in COLUMNS:
        np.testing.assert_allclose(found[n], expected[n], rtol=1e-12, atol=1e-12)


# ---------------------------------------------------------------------------- doors and refusals


def test_the_command_builds_and_verifies_a_native_fmu(tmp_path):
    """lagfmu build MODEL.py --platforms host: what has platforms is native."""
    arguments = ["build", str(MODELS / "pendulum.py"), "--scene", "PendulumAngle"]
    native = ["--platforms", "host", "--out", str(tmp_path)]
    run = CliRunner().invoke(app, [*arguments, *native])
    assert run.exit_code == 0, run.output
    assert (tmp_path / "native" / "PendulumAngle.fmu").exists()
    wrong = CliRunner().invoke(app, [*arguments, *native, "--target", "python"])
    assert wrong.exit_code == 2
    assert "--target native" in wrong.output
    unknown = CliRunner().invoke(app, [*arguments, "--platforms", "amiga"])
    assert unknown.exit_code == 2
    assert "'amiga' is unknown" in unknown.output


def test_platforms_are_chosen_by_name():
    """`host`, `all`, folders; in the order of the table; unknown ones are refused with the known ones."""
    assert [p.folder for p in chosen(["all"])] == list(NAMES)
    assert chosen(["host"]) == (host(),)
    assert [p.folder for p in chosen(["win64", "linux64"])] == ["linux64", "win64"]
    with pytest.raises(UsageError, match=r"'beos' is unknown.*aarch64-linux"):
        chosen(["beos"])


def test_without_a_compiler_the_remedy_is_named(prepared, tmp_path, monkeypatch):
    """None at all, or one for this machine only."""
    monkeypatch.setattr(compiler, "find_compiler", lambda: None)
    with pytest.raises(BuildError, match=r"pip install ziglang"):
        write(prepared("PendulumAngle"), tmp_path, target="native")
    only = compiler.Compiler(("cc",), False, "cc")
    monkeypatch.setattr(compiler, "find_compiler", lambda: only)
    with pytest.raises(BuildError, match=r"this machine only.*pip install ziglang"):
        write(prepared("PendulumAngle"), tmp_path, target="native", platforms=("all",))
    assert not list(tmp_path.iterdir())


@pytest.mark.thorough
def test_the_systems_compiler_makes_the_same_motion(native_fmu, prepared, tmp_path, monkeypatch):
    """Without ziglang cc compiles for this machine, and the numbers agree."""
    path = shutil.which("cc")
    if path is None:
        pytest.skip("no cc")
    expected = simulate_fmu(str(native_fmu("PendulumCartesian")), output=["x", "lambda.rod"])
    monkeypatch.setattr(compiler, "find_compiler", lambda: compiler.Compiler((path,), False, "cc"))
    monkeypatch.setenv("LAGFMU_CACHE", str(tmp_path / "cache"))
    made = write(prepared("PendulumCartesian"), tmp_path, target="native")
    found = simulate_fmu(str(made), output=["x", "lambda.rod"])
    for n in ("x", "lambda.rod"):
        np.testing.assert_allclose(found[n], expected[n], rtol=1e-12, atol=1e-12)
    with zipfile.ZipFile(made) as archive:
        (library,) = [n for n in archive.namelist() if n.startswith("binaries/")]
        (binary,) = binaries.read(archive.read(library))
    assert binary.exports == EXPORTS


def test_the_compilers_first_error_is_told():
    """BuildError with the line that says what is wrong, not a page of output."""
    with pytest.raises(BuildError, match=r"model\.c:1:\d+: error") as caught:
        compile_libraries("Bad", {"model.c": b"int broken(\n"}, {"empty.h": b""}, (host(),))
    assert "\n" not in str(caught.value)


def test_an_unknown_target_is_refused(prepared, tmp_path):
    """The known ones are named."""
    with pytest.raises(UsageError, match="'fortran' is unknown, expected one of native, python"):
        write(prepared("PendulumAngle"), tmp_path, target="fortran")


# ---------------------------------------------------------------------------- rattle


def test_a_scene_may_ask_for_rattle_where_the_lagrangian_is_separable(prepared, tmp_path):
    """The Cartesian pendulum is built with it, and its energy does not drift: after 200 s it is no
    further off than in the first 20."""
    made = prepared("PendulumCartesian")
    scene = replace(made.scene, method="rattle", step=0.05)
    path = write(prepare(made.model, scene), tmp_path, target="native")
    energy = simulate_fmu(str(path), stop_time=200.0, output_interval=0.5)["energy.total"]
    off = np.abs(energy - energy[0])
    assert off[:40].max() > 0
    assert off.max() < 1.5 * off[:40].max() < 1e-6


def test_rattle_is_refused_at_the_build_where_it_cannot_step(prepared, tmp_path):
    """A mass matrix that changes, forces of velocity, another formulation, the python target: each is
    named, and nothing is written."""
    for name, *parts in (
        ("Hemisphere", "mass matrix", "velocities"),
        ("CartPendulum", "the forces on s hold velocities"),
        ("KnifeEdge", "'edge' is nonholonomic"),
        ("PendulumNullspace", "formulation is 'nullspace'"),
        ("Belt", "friction"),
    ):
        made = prepared(name)
        scene = replace(made.scene, method="rattle")
        with pytest.raises(BuildError) as caught:
            write(prepare(made.model, scene), tmp_path, target="native")
        for part in parts:
            assert part in str(caught.value)
    made = prepared("PendulumCartesian")
    with pytest.raises(BuildError, match="native"):
        write(prepare(made.model, replace(made.scene, method="rattle")), tmp_path, (), "python")
    assert not list(tmp_path.iterdir())


def test_an_object_of_the_cache_that_is_not_whole_is_made_anew(tmp_path, monkeypatch):
    """Half of it, nothing, or a bit that is another: the library has the same bytes as before, though others
    of its objects are whole, and so has the object then."""
    monkeypatch.setenv("LAGFMU_CACHE", str(tmp_path))
    seen = b'__attribute__((visibility("default"))) '
    runtime = {
        f"{n}.c": seen + b"int %b(void) { return 1; }\n" % n.encode() for n in ("one", "two")
    }

    def library() -> bytes:
        (made,) = compile_libraries("One", {}, runtime, (host(),)).values()
        return made

    expected = library()
    (place,) = tmp_path.glob("one-*")
    whole = place.read_bytes()
    for spoilt in (whole[: len(whole) // 2], b"", whole[:-1] + bytes([whole[-1] ^ 1])):
        place.write_bytes(spoilt)
        assert library() == expected
        assert place.read_bytes() == whole


def test_what_two_fmus_hold_alike_is_compiled_once(prepared, monkeypatch):
    """A pendulum and a machine, each with one rod and no contact, differ by their equations and variables."""
    compiled: list[str] = []
    compile_one = compiler._compile

    def told(*arguments: str) -> None:
        compiled.append(arguments[2])
        compile_one(*arguments)

    monkeypatch.setattr(compiler, "_compile", told)
    for name in ("PendulumCartesian", "Atwood"):
        compiled.clear()
        sources_of(prepared(name)).compiled(name, (host(),))
    assert compiled == ["model.c", "variables.c"]


def test_an_empty_cache_folder_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """LAGFMU_CACHE= is not the working folder: no compiled files are strewn about it."""
    monkeypatch.setenv("LAGFMU_CACHE", "")
    assert compiler._cache() != Path("")


@pytest.mark.skipif(os.name == "nt", reason="the compiler is a shell script")
@pytest.mark.parametrize(("place", "variable"), [("cache", "LAGFMU_CACHE"), ("other", "TMPDIR")])
def test_a_compiler_without_room_is_told_from_one_that_fails(
    tmp_path, monkeypatch, place, variable
):
    """The full folder is named, and what chooses another; a compiler that has room is to blame itself."""
    program, folder = tmp_path / "cc", tmp_path / place / "x"
    folder.mkdir(parents=True)
    monkeypatch.setenv("LAGFMU_CACHE", str(tmp_path / "cache"))
    only = compiler.Compiler((str(program),), False, "cc")

    def refusal(said):
        program.write_text(f"#!/bin/sh\necho '{said}' >&2\nexit 1\n")
        program.chmod(0o755)
        with pytest.raises(LagfmuError) as caught:
            compiler._run(only, "", [], str(folder))
        return str(caught.value)

    told = refusal("ld: final link failed: No space left on device")
    assert told.startswith(f"{folder.parent}: No space left on device")
    assert f"environment variable {variable} " in told
    assert "compiler failed" in refusal("error: no such file")
    usage = shutil.disk_usage(tmp_path)._replace(free=0)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage)
    assert f"environment variable {variable} " in refusal("")
