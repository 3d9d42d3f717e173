"""The house: what stands where, and that imports run in one direction."""

from __future__ import annotations

import ast
import os
import re
import runpy
import shutil
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import lagfmu
from lagfmu.testing import HELPERS

ROOT = Path(lagfmu.__file__).parent
ROOMS = (  # each imports from those before it, and from no other
    "errors",
    "names",
    "methods",
    "files",
    "numeric",
    "solver",
    "model",
    "bodies",
    "mechanics",
    "interface",
    "codegen",
    "prepare",
    "page",
    "fmu",
    "verification",
    "studio",
    "api",
    "cli",
    "testing",
)
FLOORS = ("base", "linear", "ode", "mechanics", "simulation", "fmi")  # of the C runtime
HOUSE = runpy.run_path(str(ROOT.parent / "benchmarks" / "house.py"))
CORE = ROOMS[: ROOMS.index("studio")]
MODULES = sorted(p for p in ROOT.rglob("*.py") if p.parent != ROOT or p.stem in ROOMS)


def room(path: Path) -> str:
    """The folder or file directly in lagfmu/ that a module belongs to."""
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


def imported(path: Path) -> set[str]:
    """The rooms that a module imports from, whenever it does."""
    package = ["lagfmu", *path.relative_to(ROOT).parts[:-1]]
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            names = [*base, *(node.module or "").split(".")]
            if names[0] == "lagfmu" and len(names) > 1 and names[1]:
                found.add(names[1])
            elif names[0] == "lagfmu":
                found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.Import):
            found |= {a.name.split(".")[1] for a in node.names if a.name.startswith("lagfmu.")}
    return found


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_run_in_one_direction(path: Path) -> None:
    """A room knows those below it: the model no solver's inside, the solver no model, and only fmu/ and
    what stands above it any FMU."""
    own = ROOMS.index(room(path))
    above = {name for name in imported(path) if ROOMS.index(name) > own}
    assert not above


def test_the_core_knows_no_studio(tmp_path: Path) -> None:
    """What makes an FMU that is right works without the folder of what makes many runs of it: a model is
    built and verified there."""
    assert not [p for p in MODULES if room(p) in CORE and "studio" in imported(p)]
    copy = shutil.copytree(
        ROOT, tmp_path / "lagfmu", ignore=shutil.ignore_patterns("studio", "__pycache__")
    )
    model, where = (
        ROOT.parent / "models" / "hemisphere.py",
        {**os.environ, "PYTHONPATH": str(tmp_path)},
    )
    for words in (["build", str(model)], ["verify", "dist/native/Hemisphere.fmu"]):
        done = subprocess.run(
            [sys.executable, "-m", "lagfmu", *words],
            cwd=tmp_path,
            env=where,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        assert "pass" in done.stdout
    assert not (copy / "studio").exists()


@pytest.mark.parametrize("folder", sorted(p.parent.name for p in ROOT.glob("*/__init__.py")))
def test_a_folder_says_what_it_is_for(folder: str) -> None:
    """What comes in, what goes out, and what it never knows."""
    words = (ROOT / folder / "__init__.py").read_text()
    assert all(f"\n{said}: " in words for said in ("In", "Out", "Never knows"))


def test_no_module_is_imported_in_secret() -> None:
    """A room that is imported by a name in a text is no arrow that anybody sees."""
    secret = re.compile(r"\b(import_module|__import__)\(\s*f?[\"'](lagfmu|\.)")
    for path in sorted(ROOT.rglob("*.py")):
        assert not secret.search(path.read_text(encoding="utf-8")), path.name


def test_no_files_of_python_import_each_other() -> None:
    """Whoever reads a file has read what it stands on before: there is no circle, wherever in a file it
    imports."""
    assert HOUSE["circles"]({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == [{"b", "c"}]
    files = HOUSE["imports"](ROOT)
    assert len(files) > len(MODULES)
    assert HOUSE["circles"](files) == []


def test_a_test_imports_no_room() -> None:
    """A test knows what users know and what lagfmu.testing hands on: no room that moves breaks it."""
    known = {
        "lagfmu",
        *(f"lagfmu.{name}" for name in ("bodies", "cli", "errors", "methods", "names", "testing")),
    }
    for path in sorted(Path(__file__).parent.glob("*.py")):
        text = path.read_text(encoding="utf-8")
        imported = re.findall(r"\b(?:from|import) (lagfmu\b[\w.]*)", text)
        named = re.findall(r"[\"':](lagfmu\.[a-z_]+)\.[\w.]+[\"']", text)
        assert {*imported, *named} <= known, path.name


def test_the_solver_stands_alone() -> None:
    """It travels inside python FMUs, with the numeric form and the names of variables, where there is no
    lagfmu."""
    for path in [*ROOT.glob("solver/*.py"), *ROOT.glob("numeric/*.py")]:
        assert imported(path) <= {"solver", "numeric", "names"}, path.name


def test_what_changed_is_one_page() -> None:
    """Of the version to come, by topic; a merge that unites two of its texts brings old lines back."""
    text = (ROOT.parent / "CHANGELOG.md").read_text(encoding="utf-8")
    assert len(text.split()) < 1_200


def test_the_rooms_can_be_counted() -> None:
    """What lies directly in lagfmu/ is these rooms, besides the runtime's C and the two
    files that Python asks for."""
    found = {p.stem for p in ROOT.iterdir() if p.suffix == ".py" or p.is_dir()}
    assert found - {"__init__", "__main__", "__pycache__", "runtime"} == set(ROOMS)


@pytest.mark.parametrize("floor", FLOORS)
def test_the_runtime_stands_in_layers(floor: str) -> None:
    """A C file includes headers of its own floor and of those below, and no two files share a name: they
    are compiled side by side."""
    place = {p.name: p.parent.name for p in ROOT.glob("runtime/*/*.[ch]")}
    assert len(place) == len(list(ROOT.glob("runtime/*/*.[ch]")))
    for path in ROOT.glob(f"runtime/{floor}/*.[ch]"):
        for header in re.findall(r'^#include "(\w+\.h)"', path.read_text(), re.MULTILINE):
            if header in place:
                assert FLOORS.index(place[header]) <= FLOORS.index(floor), (path.name, header)


def test_preparing_is_a_pipeline() -> None:
    """Five steps in the order in which they stand, each from one value to one value; none calls another or
    the whole, and no file beside them leads back."""
    steps = ("derive", "narrow", "reduce", "lower", "examine")
    tree = ast.parse(ROOT.joinpath("prepare", "prepare.py").read_text(encoding="utf-8"))
    found = {n.name: n for n in tree.body if isinstance(n, ast.FunctionDef)}
    assert tuple(name for name in found if name in steps) == steps
    for name in steps:
        assert len(found[name].args.args) == 1, name
        called = {ast.unparse(n.func) for n in ast.walk(found[name]) if isinstance(n, ast.Call)}
        assert not called & {*steps, "prepare"}, name
    for path in ROOT.glob("prepare/*.py"):
        assert "from .prepare import" not in path.read_text(encoding="utf-8"), path.name


@pytest.mark.parametrize("method", ["rk4", "rattle"])
def test_a_method_is_one_file(method: str) -> None:
    """Its row in methods.py, its file, and the list of all of them for what runs without an FMU: nothing else
    in lagfmu says its name."""
    assert HOUSE["places"](ROOT, method) == 3


@pytest.mark.parametrize(
    ("said", "place"),
    [
        ("the integration stops at", "runtime/ode/refused_step.c"),
        ("makes no headway", "runtime/ode/refused_step.c"),
        ("#c2410c", "studio/live/web/page.css"),
        ("DEFAULT_TOLERANCE = 1e-8", "numeric/thresholds.py"),
        ("PROJECTION_SMALL =", "runtime/base/thresholds.h"),
    ],
)
def test_a_fact_stands_in_one_place(said: str, place: str) -> None:
    """The words of a refused step, the colour of forces, a tolerance."""
    files = (p for p in ROOT.rglob("*.*") if p.suffix in (".c", ".h", ".py", ".css", ".js", ".j2"))
    code = (p for p in files if "vendor" not in p.parts and p.name != "refused_step.h")
    assert [p.relative_to(ROOT).as_posix() for p in code if said in p.read_text("utf-8")] == [place]


def test_the_solver_is_no_store_of_scratch() -> None:
    """What a part of the simulation needs for itself it keeps in memory that is laid out in its own files."""
    assert HOUSE["members"](ROOT / "runtime" / "simulation" / "solver.h") <= 30


def test_only_the_fmi_layer_says_fmi() -> None:
    """Nothing outside fmu/ and runtime/fmi/ names a function, a type or a file of one version of FMI: each is
    theirs alone; and in runtime/fmi/ the instance knows no version."""
    sources = [p for p in ROOT.rglob("*") if p.suffix in (".py", ".c", ".h", ".js", ".j2", ".html")]
    named = {
        str(path.relative_to(ROOT))
        for path in sources
        if re.search("fmi[23]", path.read_text(encoding="utf-8"), re.IGNORECASE)
    }
    assert named
    for name in named:
        assert name.startswith(("fmu/", "runtime/fmi/fmi2", "runtime/fmi/fmi3")), name


def test_one_door_writes_files() -> None:
    """What a user keeps is written beside what was there, and takes its place when it is whole: elsewhere
    files are written below temporary folders alone, and to packed archives in memory."""
    writes = re.compile(
        r"\.(write_text|write_bytes|savefig|to_csv|to_parquet|to_netcdf|to_zarr|savez|write_table|saving)\((?!FILE)"
        r"|\bopen\([^)\n]*[\"'][wax]b?[\"']|\bshutil\.(copy\w*|move)\("
    )
    found = {p.relative_to(ROOT).as_posix() for p in MODULES if writes.search(p.read_text("utf-8"))}
    beside = {  # what they hand to write_whole, or to a figure's picture in memory
        *("files.py", "verification/plot.py", "studio/film.py", "studio/live/view.py"),
        *("studio/report/report.py", "studio/sweep/results.py", "studio/sweep/sweep.py"),
    }
    temporary = {
        *("fmu/compiler.py", "fmu/native.py", "verification/simulate.py"),
        "studio/report/pdf.py",
    }
    assert found <= beside | temporary, found - beside - temporary


def test_one_loop_runs_an_fmu() -> None:
    """A session steps instances; nothing else in lagfmu steps or loads one."""
    steps = re.compile(
        r"\.(doStep|fmi[23]DoStep)\b|\bsimulate_fmu\b|\binstantiate_fmu\b|\bFMU[123](Slave|Model)\("
    )
    found = {path for path in MODULES if steps.search(path.read_text(encoding="utf-8"))}
    assert {p.relative_to(ROOT).as_posix() for p in found} == {
        "fmu/binary.py",
        "fmu/session.py",
    }


def test_names_of_variables_are_composed_in_one_place() -> None:
    """What a variable is of is looked up: outside names.py no f-string makes a name, and nothing takes one
    apart by its beginning."""
    heads = (
        "lambda|unique|residual|Q|contact|departure|sticks|margin|power|slip|slipping|energy|error"
    )
    made = re.compile(rf'f"(?:{heads})\.\{{|(?:startswith|removeprefix)\(\(?"(?:{heads})\.')
    for path in MODULES:
        if path.name != "names.py":
            assert not made.search(path.read_text(encoding="utf-8")), path.name


def test_what_a_header_defines_is_defined_nowhere_else() -> None:
    """An FMU carries the runtime as one C file, where a constant of a header and one of a file's own would be
    two of one name."""
    defined = re.compile(r"^static const \w+ (\w+)", re.MULTILINE)
    shared = {n: p for p in ROOT.glob("runtime/*/*.h") for n in defined.findall(p.read_text())}
    for path in ROOT.glob("runtime/*/*.c"):
        twice = set(defined.findall(path.read_text())) & shared.keys()
        assert not twice, (path.name, twice)


TOKENS = re.compile(r'"(?:\\.|[^"\\])*"|\'(?:\\.|[^\'\\])*\'|/\*.*?\*/', re.DOTALL)
OWN_NAMES = (  # functions and values, types, numbers
    re.compile(r"^static [^;{(]*?\b(\w+)(?:\[\w*\])*(?: =|;|\()", re.MULTILINE),
    re.compile(r"^(?!typedef|enum|return)\w[\w \*]*?\b(\w+)(?:\[\w*\])*(?: =|\()", re.MULTILINE),
    re.compile(r"^\} (\w+);", re.MULTILINE),
)
NUMBERS = re.compile(
    r"^(?:static const \w+ (\w+ = [^;]*);|(?:typedef )?enum \{([^}]*)\})", re.MULTILINE
)


def names_of(text: str) -> set[str]:
    """What a C file defines outside of functions."""
    bare = TOKENS.sub(lambda m: "" if m[0].startswith("/*") else '""', text)
    found = {name for pattern in OWN_NAMES for name in pattern.findall(bare)}
    return found | numbers_of(bare)


def numbers_of(bare: str) -> set[str]:
    """The constants and enumerators that a file without comments defines."""
    several = (one.split(",") for found in NUMBERS.findall(bare) for one in found)
    return {part.split("=")[0].strip() for parts in several for part in parts} - {""}


def test_a_name_of_the_runtime_stands_in_one_file() -> None:
    """An FMU's all.c includes its C files one behind the other, the model's last: no two of them define the
    same name; but the faces of two versions of FMI are never in one FMU."""
    places: dict[str, list[str]] = {}
    for path in sorted(ROOT.joinpath("runtime").rglob("*.c")):
        for name in names_of(path.read_text(encoding="utf-8")):
            places.setdefault(name, []).append(path.name)
    for path in sorted(ROOT.joinpath("runtime").rglob("*.h")):
        bare = TOKENS.sub("", path.read_text(encoding="utf-8"))
        for name in {*OWN_NAMES[0].findall(bare), *numbers_of(bare)}:
            places.setdefault(name, []).append(path.name)
    for helper in HELPERS.values():
        for name in names_of(helper):
            places.setdefault(name, []).append("the model's own")
    for version in ("fmi2", "fmi3"):
        held = {
            name: [f for f in files if not f.startswith(version)] for name, files in places.items()
        }
        assert {name: files for name, files in held.items() if len(files) > 1} == {}


DECLARED = re.compile(r"^SHARED[^;{]*;", re.MULTILINE)
FUNCTION = re.compile(
    r"^(?:static inline )?(?!static|typedef|return)(?:[A-Za-z]\w*[ *]+)+(\w+)\([^;{]*\) \{",
    re.MULTILINE,
)
TAKEN = re.compile(r"(?<![\w.>])(\w+)\b(?=[(,;)}])")  # called, or handed on; no member


def test_files_of_the_runtime_call_each_other_in_no_circle() -> None:
    """Of two files that call each other neither can be read alone: what both need has an owner below them."""
    texts: dict[str, str] = {}
    owner: dict[str, str] = {}
    for path in sorted(ROOT.joinpath("runtime").rglob("*.[ch]")):
        text = DECLARED.sub("", TOKENS.sub("", path.read_text(encoding="utf-8")))
        inline = "static inline " if path.suffix == ".c" else " "  # of a .c file: its own
        own = [m for m in FUNCTION.finditer(text) if not m[0].startswith(inline)]
        owner |= {m[1]: path.stem for m in own}
        texts[path.stem] = texts.get(path.stem, "") + text
    calls = {
        stem: {owner[name] for name in TAKEN.findall(text) if name in owner} - {stem}
        for stem, text in texts.items()
    }
    assert {"mechanism", "nominals"} <= calls["segment"]
    TopologicalSorter(calls).prepare()  # CycleError names the files


def test_values_that_files_of_the_runtime_share_are_defined_so() -> None:
    """What a header declares SHARED without a parameter list a file defines as SHARED_VALUE."""
    shared, defined = set(), set()
    for path in sorted(ROOT.joinpath("runtime").rglob("*.[ch]")):
        bare = TOKENS.sub("", path.read_text(encoding="utf-8"))
        for line in re.findall(r"^SHARED const ([^;(]*);", bare, re.MULTILINE):
            shared |= {re.findall(r"\w+", part.split("[")[0])[-1] for part in line.split(",")}
        defined |= set(re.findall(r"^const [^;(]*?\b(\w+)(?:\[\w*\])* =", bare, re.MULTILINE))
    assert shared
    assert shared & defined == set()


def test_what_files_of_the_runtime_share_is_declared_so() -> None:
    """SHARED makes it static where one file includes all: only the functions of FMI are exported."""
    plain = re.compile(
        r"^(?!typedef|static|return|#|SHARED|FMI[23]_)[A-Za-z][\w \*]*\(", re.MULTILINE
    )
    for path in sorted(ROOT.joinpath("runtime").rglob("*.h")):
        bare = TOKENS.sub("", path.read_text(encoding="utf-8"))
        assert plain.findall(bare) == [], path.name
        assert "extern" not in bare or path.name in ("fmi2.h", "fmi3.h", "linkage.h"), path.name


def test_the_map_names_files_that_exist() -> None:
    """Where a change belongs is said by paths below lagfmu/, or by a file's name."""
    told = (ROOT.parent / "CONTRIBUTING.md").read_text("utf-8")
    places = re.findall(r"`([\w/*]+(?:/|\.(?:py|c|h|css|js)))`", told)
    lost = [
        p
        for p in places
        if "NAME" not in p and not (any(ROOT.parent.glob(p)) or any(ROOT.rglob(p)))
    ]
    assert len(places) > 60
    assert not lost
