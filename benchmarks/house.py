"""How heavy is the house, before and after?  Of a commit and of this working tree, side by side:

    python benchmarks/house.py COMMIT [--junit BEFORE.xml AFTER.xml]

lines     of the files of a room of lagfmu/, a layer of runtime/, tests/, benchmarks/; words of docs/*.md
rooms     what stands directly in lagfmu/, but for runtime/
files     of Python and C; members of `struct Solver`; how often C says `OPTIONAL.`
places    files of lagfmu/ that say the word of one output (margin), of one saved number (lost_old), of one
          method (rattle), but for what they say in comments and docstrings
arrows    pairs of rooms, of which one imports from the other: at the top, in a function, for types alone, or
          by a name in a text (import_module)
floors    rooms on the longest way along arrows; rooms of a circle are on one
circles   groups of Python files that import each other; of C files that call each other's functions
help      processor time of `lagfmu --help` [s], the median of five
stays     calls by which a build of models/hemisphere.py passes from another file into one of prepare/; how
          many files that are, and how often it comes back to one
tests     functions test_...; with --junit also what has run, and the seconds of the suite
"""

from __future__ import annotations

import argparse
import ast
import os
import re
import resource
import statistics
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterable, Mapping
from functools import cache
from io import BytesIO
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).parent.parent
Graph = Mapping[str, set[str]]
Figures = dict[str, float]
SECRET = re.compile(r"""import_module\(\s*f?["']([\w.]+)["'](?:, *__package__)?""")
DEFINED = re.compile(
    r"^(?!typedef|return|else|static)[A-Za-z][\w \*]*?\b(\w+)\([^;{]*\{", re.MULTILINE
)
CALLED = re.compile(r"(?<![\w.>])(\w+)\(")
HANDED = re.compile(r"\(\*(\w+)\)\(")  # an argument that is a function
SAMPLES = {"an output": "margin", "a saved number": "lost_old", "a method": "rattle"}
UNSEEN = re.compile(r'"(?:\\.|[^"\\])*"|/\*.*?\*/', re.DOTALL)
BUILD = """
import os, sys, tempfile
from pathlib import Path
import lagfmu
from lagfmu.model.file import load
room = os.path.join(os.path.dirname(lagfmu.__file__), "prepare", "")
stays = []
def passed(frame, event, _):
    here = frame.f_code.co_filename
    known = here.startswith(room) and frame.f_code.co_name != "<module>"
    if event == "call" and known and frame.f_back.f_code.co_filename != here:
        stays.append(here)
file = load(Path("models/hemisphere.py"))
with tempfile.TemporaryDirectory() as folder:
    sys.setprofile(passed)
    lagfmu.build_fmu(file.model, folder, file.scenes[0], target="native", check=False)
    sys.setprofile(None)
print(len(stays), len(set(stays)))
"""


def measured(tree: Path, junit: Path | None) -> Figures:
    """All figures of one tree, in the order in which they are shown."""
    package = tree / "lagfmu"
    entries = [p for p in sorted(package.iterdir()) if p.suffix == ".py" or p.is_dir()]
    rooms = [p for p in entries if p.stem not in ("__pycache__", "runtime")]
    lines = {f"Python: {p.stem}": _lines([p, *p.rglob("*.py")]) for p in rooms}
    layers = {
        f"C: {p.name}": _lines([*p.glob("*.c"), *p.glob("*.h")])
        for p in sorted(package.glob("runtime/*"))
        if p.is_dir()
    }
    files = imports(package)
    of_rooms = condensed(files)
    return {
        **lines,
        "Python": sum(lines.values()),
        **layers,
        "C": sum(layers.values()),
        "files, Python": len([*package.rglob("*.py")]),
        "files, C": len([*package.glob("runtime/*/*.[ch]")]),
        "members of Solver": members(package / "runtime" / "simulation" / "solver.h"),
        "OPTIONAL.": sum(
            p.read_text("utf-8").count("OPTIONAL.") for p in package.glob("runtime/*/*.c")
        ),
        **{f"places of {what}": places(package, word) for what, word in SAMPLES.items()},
        "tests": _lines([*tree.glob("tests/*.py"), *tree.glob("tests/*.c")]),
        "benchmarks": _lines(tree.glob("benchmarks/**/*.py")),
        "words of docs/": sum(len(p.read_text("utf-8").split()) for p in tree.glob("docs/*.md")),
        "rooms": len([p for p in rooms if not p.stem.startswith("__")]),
        "floors": floors(of_rooms),
        "arrows": sum(map(len, of_rooms.values())),
        **_of_circles("Python", files),
        **_of_circles("C", calls(package / "runtime")),
        "help [s]": help_time(tree),
        **stays(tree),
        "tests, functions": sum(
            len(re.findall(r"^ *def test_", p.read_text("utf-8"), re.MULTILINE))
            for p in tree.glob("tests/test_*.py")
        ),
        **_suite(junit),
    }


def _lines(paths: Iterable[Path]) -> int:
    return sum(len(p.read_text("utf-8").splitlines()) for p in {*paths} if p.is_file())


def members(header: Path) -> int:
    """How many members `struct Solver` has."""
    text = UNSEEN.sub("", header.read_text("utf-8"))
    body = re.split(r"typedef struct Solver \{|\} Solver;", text)[1]
    body = re.sub(r"\([^()]*\)", "", body)
    return sum(line.count(",") + 1 for line in body.split(";") if line.strip())


def places(package: Path, word: str) -> int:
    """Files whose code, not their comments and docstrings, says a word."""
    said = re.compile(rf"(?<![a-z]){word}(?![a-z])", re.IGNORECASE)
    found = [p for p in package.rglob("*.[chp]*") if p.suffix in (".c", ".h", ".py")]
    return sum(1 for p in found if said.search(_code(p)))


def _code(path: Path) -> str:
    text = path.read_text("utf-8")
    if path.suffix != ".py":
        return re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    return re.sub(r'"""[\s\S]*?"""|#.*', "", text)


def imports(package: Path) -> dict[str, set[str]]:
    """File -> files of the package that it imports from, each as a/b/c; a package is its __init__.py."""
    known = {str(p.relative_to(package).with_suffix("")): p for p in package.rglob("*.py")}
    found = {}
    for name, path in known.items():
        here = ["lagfmu", *name.split("/")[:-1]]
        wanted = []
        for node in ast.walk(ast.parse(text := path.read_text("utf-8"))):
            if isinstance(node, ast.ImportFrom):
                said = f"{'.' * node.level}{node.module or ''}"
                wanted += [[*_absolute(said, here), alias.name] for alias in node.names]
            elif isinstance(node, ast.Import):
                wanted += [alias.name.split(".") for alias in node.names]
        wanted += [_absolute(said, here) for said in SECRET.findall(text)]
        found[name] = {place for w in wanted if (place := _place(w, known))} - {name}
    return found


def _absolute(said: str, here: list[str]) -> list[str]:
    """The parts of a module's name, of which each leading dot but the first goes one package up."""
    bare = said.lstrip(".")
    up = len(said) - len(bare)
    return [*(here[: len(here) - up + 1] if up else []), *filter(None, bare.split("."))]


def _place(parts: list[str], known: Mapping[str, Path]) -> str:
    """The file of lagfmu that is imported: the longest beginning of the name that is one."""
    if parts[0] == "lagfmu":
        for end in range(len(parts), 1, -1):
            name = "/".join(parts[1:end])
            for place in (name, f"{name}/__init__"):
                if place in known:
                    return place
    return ""


def condensed(files: Graph) -> dict[str, set[str]]:
    """Room -> rooms from which one of its files imports."""
    rooms: dict[str, set[str]] = {}
    for name, others in files.items():
        room = name.split("/")[0]
        if not room.startswith("__"):
            rooms.setdefault(room, set()).update(o.split("/")[0] for o in others)
    return {room: {o for o in others if o in rooms} - {room} for room, others in rooms.items()}


def calls(runtime: Path) -> dict[str, set[str]]:
    """C file -> C files whose functions, but for static ones, it calls by name."""
    bare = {p.stem: UNSEEN.sub("", p.read_text("utf-8")) for p in sorted(runtime.rglob("*.c"))}
    owner = {f: stem for stem, text in bare.items() for f in DEFINED.findall(text)}
    found = {}
    for stem, text in bare.items():
        named = {*CALLED.findall(text)} - {*HANDED.findall(text)}
        found[stem] = {owner[name] for name in named if name in owner} - {stem}
    return found


def reached(graph: Graph) -> dict[str, set[str]]:
    """Node -> all nodes that ways from it lead to."""
    found = {name: set(others) for name, others in graph.items()}
    for by in graph:
        for others in found.values():
            others |= found[by] if by in others else set()
    return found


def circles(graph: Graph) -> list[set[str]]:
    """Groups of two and more, of which each reaches each."""
    far = reached(graph)
    groups = {frozenset(b for b in far[a] if a in far[b]) for a in graph}
    return [set(g) for g in groups if len(g) > 1]


def floors(graph: Graph) -> int:
    """Nodes on the longest way; nodes of one circle are on one floor."""
    far = reached(graph)

    @cache
    def height(a: str) -> int:
        return 1 + max((height(b) for b in far[a] if a not in far[b]), default=0)

    return max(map(height, graph))


def _of_circles(what: str, graph: Graph) -> Figures:
    found = circles(graph)
    return {f"circles in {what}": len(found), f"files in them, {what}": sum(map(len, found))}


def _run(tree: Path, *arguments: str) -> str:
    command = [sys.executable, *arguments]
    env = {**os.environ, "PYTHONPATH": str(tree)}
    return subprocess.run(
        command, cwd=tree, env=env, check=True, capture_output=True, text=True
    ).stdout


def help_time(tree: Path) -> float:
    """User and system time, after a first run that compiles the files."""
    spent = []
    for _ in range(6):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        _run(tree, "-m", "lagfmu", "--help")
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return round(statistics.median(spent[1:]), 2)


def stays(tree: Path) -> Figures:
    """In prepare/, during one build; the files, and how often it comes back to one."""
    count, files = map(int, _run(tree, "-c", BUILD).split())
    return {"stays in prepare/": count, "files": files, "returns": count - files}


def _suite(junit: Path | None) -> Figures:
    if junit is None:
        return {}
    suites = [*ElementTree.parse(junit).getroot().iter("testsuite")]
    return {
        "tests that ran": sum(int(s.get("tests", 0)) for s in suites),
        "the suite [s]": round(sum(float(s.get("time", 0)) for s in suites)),
    }


def main() -> None:
    """Print a line a figure: before, after, and what came or went."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("commit")
    parser.add_argument("--junit", nargs=2, type=Path, metavar=("BEFORE.xml", "AFTER.xml"))
    given = parser.parse_args()
    reports = given.junit or (None, None)
    archive = subprocess.run(
        ["git", "archive", given.commit], cwd=ROOT, check=True, capture_output=True
    ).stdout
    with tempfile.TemporaryDirectory() as folder:
        with tarfile.open(fileobj=BytesIO(archive)) as packed:
            packed.extractall(folder, filter="data")
        before, after = measured(Path(folder), reports[0]), measured(ROOT, reports[1])
    print(f"{'':26} {'before':>8} {'after':>8} {'change':>8}")
    new = [n for n in after if n not in before]
    order = sorted([*before, *new], key=[*after, *before].index)
    for name in order:
        a, b = before.get(name, 0), after.get(name, 0)
        print(f"{name:26} {a:8g} {b:8g} {b - a:+8g}")


if __name__ == "__main__":
    main()
