"""Which programming errors do the tests find?

    python benchmarks/mutants.py [--stress] [--control] [WORD ...]

Each defect of mutants.toml is made in a copy of the package, and the tests aimed at it run there, of
those that `pytest` runs by itself, until one fails.  Printed is a row a defect: what it breaks, and the
test that noticed, or why none can; at the end, which were noticed only by tests without an end within 60
s of processor time.  WORD: only defects with one of these words in their file or description.  --stress:
not the tests but `lagfmu stress`, of the models that a defect names.  --control: the same tests without
any defect, first.  The exit code is 1 if a defect survives of which no reason is known, or one is found
that was thought to make no difference.
"""

from __future__ import annotations

import argparse
import importlib
import os
import re
import runpy
import shutil
import signal
import subprocess
import sys
import tempfile
import tomllib
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parent.parent
COPIED = ("lagfmu", "tests", "models", "benchmarks", "pyproject.toml")
EVER_THE_SAME = (
    "pytest",
    "numpy",
    "scipy.integrate",
    "sympy.physics.mechanics",
    "fmpy.fmi2",
    "rich",
    "typer",
)
PATIENCE = 60  # seconds of processor time, after which it is said to run without end
ENDLESS = f"no end within {PATIENCE} s"
STRICT = ("-std=c99", "-fsyntax-only", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror")


@dataclass(frozen=True)
class Defect:
    """`was` stands once in `file` (below lagfmu/) and becomes `becomes`; `breaks` says what no longer holds.

    `tests` (arguments of pytest) are tried first, then those aimed at the file.  `survives` says why nothing
    can notice.  `stress`: a file of models/ that has the feature.  `engines`: the scene by which seeded.py
    lays the two engines beside each other; `alike` says why they cannot differ.
    """

    file: str
    was: str
    becomes: str
    breaks: str
    tests: tuple[str, ...] = ()
    survives: str = ""
    stress: str = ""
    engines: str = ""
    alike: str = ""

    def made_in(self, text: str) -> str:
        """The file with the defect.  Raises ValueError if its place is not found, or not one."""
        if text.count(self.was) != 1:
            raise ValueError(f"{self.file}: found {text.count(self.was)} times: {self.was}")
        return text.replace(self.was, self.becomes)


def read() -> tuple[list[Defect], dict[str, list[str]]]:
    """The defects, and file -> the tests that are aimed at it."""
    table = tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))
    defects = [Defect(**{**d, "tests": tuple(d.get("tests", ()))}) for d in table["defect"]]
    return defects, table["tests"]


def _run(command: list[str], folder: Path) -> tuple[int, str]:
    """python -m COMMAND in the copy, in a child that has imported what stays as it is: end and output."""
    with tempfile.TemporaryFile("w+") as output:
        child = os.fork()
        if child == 0:
            import resource  # not on Windows, nor is fork

            resource.setrlimit(resource.RLIMIT_CPU, (PATIENCE, PATIENCE))
            for stream in (1, 2):
                os.dup2(output.fileno(), stream)
            os.chdir(folder)
            os.environ |= {"PYTHONPATH": str(folder), "COLUMNS": "400"}
            sys.path[0], sys.argv = str(folder), command
            end = 1
            try:
                runpy.run_module(command[0], run_name="__main__", alter_sys=True)
            except SystemExit as stopped:
                end = stopped.code if isinstance(stopped.code, int) else 0
            finally:
                sys.stdout.flush()
                os._exit(end)
        end = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        output.seek(0)
        return end, output.read()


def _found_by_tests(tests: list[str], folder: Path) -> str:
    """The test that fails first; empty if none does."""
    options = ["-x", "-v", "--tb=no", "-o", "addopts=-m 'not thorough'", "-p", "no:cacheprovider"]
    options += ["-k", "not [python and not -python"]  # the C runtime is not in those
    end, said = _run(["pytest", *options, f"--basetemp={folder / 'made'}", *tests], folder)
    if end == 0:
        return ""
    failed = re.findall(r"^(?:FAILED|ERROR) tests/\S+::(\w+)", said, re.MULTILINE)
    if failed:
        return failed[0]
    begun = re.findall(r"^tests/\S+::(\w+)", said, re.MULTILINE)
    if end >= 0 or not begun:
        raise RuntimeError(f"pytest {' '.join(tests)}: {said[-2000:]}")
    stopped = -end in (signal.SIGXCPU, signal.SIGKILL)
    return f"{begun[-1]} ({ENDLESS if stopped else f'signal {-end}'})"


def _found_by_stress(model: str, folder: Path) -> str:
    """The first wrong probe of `lagfmu stress`; empty if none is."""
    options = ["--target", "native", "--quick", "--limit", "20"]
    end, said = _run(["lagfmu", "stress", f"models/{model}.py", *options], folder)
    if end == 0:
        return ""
    wrong = re.findall(r"^ (\S.*?)\s+wrong\s", said, re.MULTILINE)
    return wrong[0] if wrong else f"exit code {end}: {said.strip()[-200:]}"


def _check(path: Path, text: str, folder: Path) -> None:
    """Raises RuntimeError if the defect does not compile: that would be no defect."""
    if path.suffix == ".py":
        compile(text, str(path), "exec")
        return
    includes = [f"-I{p}" for p in (folder / "lagfmu" / "runtime").iterdir() if p.is_dir()]
    run = subprocess.run(
        ["cc", *STRICT, *includes, str(path)], capture_output=True, text=True, check=False
    )
    if run.returncode:
        raise RuntimeError(run.stderr)


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("words", nargs="*", metavar="WORD")
    parser.add_argument("--stress", action="store_true")
    parser.add_argument("--control", action="store_true")
    asked = parser.parse_args()
    defects, aimed = read()
    if asked.stress:
        defects = [d for d in defects if d.stress]
    if asked.words:
        defects = [d for d in defects if any(w in f"{d.file} {d.breaks}" for w in asked.words)]
    for name in EVER_THE_SAME:
        importlib.import_module(name)
    surprises, endless = 0, []
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        for name in COPIED:
            copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
            copy(ROOT / name, folder / name)

        def found(defect: Defect) -> str:
            if asked.stress:
                return _found_by_stress(defect.stress, folder)
            tests = [*defect.tests, *aimed.get(defect.file, ())]
            return _found_by_tests([t if t[0] == "-" else f"tests/{t}" for t in tests], folder)

        if asked.control:
            for defect in {(d.file, d.tests, d.stress): d for d in defects}.values():
                if by := found(defect):
                    raise RuntimeError(f"without any defect: {defect.file}, {by}")
        print(
            f"| file | defect | {'stress' if asked.stress else 'found by'} |\n| --- | --- | --- |"
        )
        for defect in defects:
            path = folder / "lagfmu" / defect.file
            right = path.read_text("utf-8")
            path.write_text(defect.made_in(right), "utf-8")
            _check(path, defect.made_in(right), folder)
            by = found(defect)
            path.write_text(right, "utf-8")
            shutil.rmtree(folder / "made", ignore_errors=True)
            if not asked.stress:
                surprises += bool(by) == bool(defect.survives)
            if ENDLESS in by:
                endless.append(f"{path.name}: {defect.breaks}")
            why = defect.survives or "?"
            shown = f"`{by}`" if by else f"**nothing**{'' if asked.stress else ': ' + why}"
            print(f"| {path.name} | {defect.breaks} | {shown} |", flush=True)
        for line in [f"{ENDLESS}: {len(endless)} of {len(defects)}", *endless]:
            print(line)
    return int(surprises > 0)


if __name__ == "__main__":
    sys.exit(main())
