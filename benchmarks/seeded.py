"""Which programming errors in either engine does the comparison of the two find?

    python benchmarks/seeded.py [--control] [WORD ...]

Each defect of mutants.toml that names `engines`, a scene that needs the place (MODEL/SCENE, or with values
to start with MODEL/SCENE/NAME=VALUE), is made in a copy of the package.  The engine that has it runs the
scene at the tolerance 1e-10, and is laid beside the other engine as it is.  A defect is found if the run
fails, if an output differs MARGIN times as much as it does without any defect, if contacts are open in the
one and closed in the other at more points, or if the steps of the two stand in another ratio by LONGER.
Printed is a row a defect: what shows it, by how much relative to its largest value, and by how much it
differs without the defect.  WORD: only defects with one of these words in their file or description.
--control: the scenes without any defect alone.  The exit code is 1 if a defect is not found whose `alike`
does not say why the engines cannot differ by it, or if one is found that has such a reason.
"""

from __future__ import annotations

import argparse
import importlib
import multiprocessing
import resource
import shutil
import sys
import tempfile
import warnings
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import cache
from pathlib import Path

import numpy as np
from mutants import EVER_THE_SAME, PATIENCE, ROOT, Defect, read

TOLERANCE = 1e-10
MARGIN = 10.0
ROUNDING = 1e-12  # relative: less is no difference
LONGER = 1.5
LONGEST = 3.0  # s of a scene that are run
NATIVE, PYTHON = "native", "python"
CONTACT, STEPS = "contact", "solver.steps"  # outputs
COPIED = ("lagfmu", "models", "tests/unseen")


def simulated(folder: Path, spec: str, target: str) -> np.ndarray | str:
    """In a process that has not imported lagfmu: the outputs by the package in `folder`, or why none."""
    resource.setrlimit(resource.RLIMIT_CPU, (PATIENCE, PATIENCE))
    sys.path.insert(0, str(folder))
    warnings.simplefilter("ignore")
    from lagfmu import simulate
    from lagfmu.errors import LagfmuError
    from lagfmu.testing import load

    model, name, *given = spec.split("/")
    place = next(p for p in folder.glob(f"**/{model}.py") if p.parent.name in {"models", "unseen"})
    file = load(place)
    scene = next(s for s in file.scenes if s.name == name)
    pairs = (text.split("=") for text in given)
    values = {k: float(x) if x[0] in "-0123456789" else x for k, x in pairs}
    try:
        return np.asarray(
            simulate(
                file.model,
                scene=scene,
                stop_time=min(scene.stop_time, LONGEST),
                target=target,
                tolerance=TOLERANCE,
                start_values=values,
            )
        )
    except LagfmuError as error:
        return " ".join(str(error).split())


def run(folder: Path, spec: str, target: str) -> np.ndarray | str:
    """The same from here."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("fork")) as pool:
        try:
            return pool.submit(simulated, folder, spec, target).result()
        except BrokenProcessPool:
            return f"crashed, or ran for more than {PATIENCE} s"


def differences(a: np.ndarray, b: np.ndarray) -> dict[str, float]:
    """Of each output of both, relative to its largest; "contacts": points at which they stand otherwise;
    "steps": their ratio.
    """
    shared = [n for n in a.dtype.names or () if n in (b.dtype.names or ())]
    flags = [n for n in shared if n.startswith(f"{CONTACT}.")]
    same = np.ones(len(a), dtype=bool)
    for name in flags:
        same &= a[name] == b[name]
    found = {"contacts": float((~same).sum())}
    for name in shared:
        if name in flags or name == "time":
            continue
        x, y = a[name].astype(float), b[name].astype(float)
        if name == STEPS:
            found["steps"] = x[-1] / y[-1]
            continue
        size = np.nanmax(np.abs(y), initial=0.0) or 1.0
        apart = np.where(np.isnan(x) & np.isnan(y), 0.0, np.abs(x - y))[same]
        found[name] = float(np.nan_to_num(apart, nan=np.inf).max(initial=0.0)) / size
    return found


def verdict(defective: np.ndarray | str, right: np.ndarray, plain: dict[str, float]) -> str:
    """How the defect shows; empty if it does not."""
    if isinstance(defective, str):
        return f"refused: {defective[:160]}"
    if len(defective) != len(right):
        return f"ends at {defective['time'][-1]:.6g} s"
    now = differences(defective, right)
    beyond = {
        name: now[name] / max(plain[name], ROUNDING)
        for name in now.keys() - {"steps", "contacts"}
        if now[name] > MARGIN * max(plain[name], ROUNDING)
    }
    if beyond:
        forces = {n: x for n, x in beyond.items() if n.startswith("lambda")} or beyond
        name = max(forces, key=lambda n: forces[n])
        return f"`{name}` {now[name]:.1e}, without {plain[name]:.1e}"
    if now["contacts"] > plain["contacts"]:
        return f"contacts at {now['contacts']:.0f} points, without {plain['contacts']:.0f}"
    if "steps" in now:
        ratio = now["steps"] / plain["steps"]
        if max(ratio, 1 / ratio) > LONGER:
            return f"steps {ratio:.2f} times"
    return ""


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("words", nargs="*", metavar="WORD")
    parser.add_argument("--control", action="store_true")
    asked = parser.parse_args()
    defects = [d for d in read()[0] if d.engines]
    if asked.words:
        defects = [d for d in defects if any(w in f"{d.file} {d.breaks}" for w in asked.words)]
    for name in EVER_THE_SAME:
        importlib.import_module(name)
    surprises, counts = 0, {NATIVE: [0, 0], PYTHON: [0, 0]}
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        for name in COPIED:
            shutil.copytree(ROOT / name, folder / name)
        plain_run = cache(lambda spec, target: run(folder, spec, target))

        def found(defect: Defect) -> str:
            mine = PYTHON if defect.file.startswith("solver/") else NATIVE
            other = NATIVE if mine == PYTHON else PYTHON
            as_is, right = plain_run(defect.engines, mine), plain_run(defect.engines, other)
            if isinstance(as_is, str) or isinstance(right, str):
                raise RuntimeError(f"without any defect: {defect.engines}: {as_is!r} {right!r}")
            plain = differences(as_is, right)
            if asked.control:
                worst = max(plain.keys() - {"steps"}, key=lambda n: plain[n])
                print(f"| {defect.engines} | `{worst}` {plain[worst]:.1e} |", flush=True)
                return ""
            path = folder / "lagfmu" / defect.file
            text = path.read_text("utf-8")
            path.write_text(defect.made_in(text), "utf-8")
            shown = verdict(run(folder, defect.engines, mine), right, plain)
            path.write_text(text, "utf-8")
            counts[mine][0] += bool(shown)
            counts[mine][1] += 1
            return shown

        if asked.control:
            for defect in {d.engines: d for d in defects}.values():
                found(defect)
            return 0
        print("| file | defect | scene | found by |\n| --- | --- | --- | --- |")
        for defect in defects:
            shown = found(defect)
            surprises += bool(shown) == bool(defect.alike)
            by = shown or f"**nothing**: {defect.alike or '?'}"
            print(
                f"| {defect.file.removeprefix('runtime/')} | {defect.breaks} | {defect.engines} | {by} |",
                flush=True,
            )
    for target, (seen, all_of) in counts.items():
        print(f"{target}: {seen} of {all_of} found")
    return int(surprises > 0)


if __name__ == "__main__":
    sys.exit(main())
