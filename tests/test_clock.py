"""Nothing that is built depends on how fast or how busy the machine is."""

from __future__ import annotations

import ast
import subprocess
import sys
import time
from pathlib import Path

from sympy import exp, sin
from sympy.physics.mechanics import dynamicsymbols

import lagfmu
from lagfmu import classify

HOUSE = Path(lagfmu.__file__).parent
TIMED = ("studio", "cli", "verification", "api.py", "page")  # they report what a run has cost
RUNS = ("fmu/session.py",)  # they measure it
A_LOGGER_A_THREAD = ("fmu/binary.py",)
CLOCKS = {"time", "timeit", "signal", "threading", "resource"}


def imports(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {a.name.split(".")[0] for a in node.names}
        if isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            found.add(node.module.split(".")[0])
    return found


def test_only_what_reports_reads_a_clock():
    """Model, mechanics, code and solver import no clock: what they give up, they give up by counting."""
    timed = {
        str(p.relative_to(HOUSE))
        for p in HOUSE.rglob("*.py")
        if p.relative_to(HOUSE).parts[0] not in TIMED and imports(p) & CLOCKS
    }
    assert timed == {*RUNS, *A_LOGGER_A_THREAD}


def test_a_search_without_an_end_is_given_up_by_what_it_has_done(monkeypatch):
    """y' = x^2 + y^2 + y sin x has no integral in closed form; the search ends although no clock moves, and
    one that runs away takes nothing from it."""
    x, y = dynamicsymbols("x y")
    riccati = y.diff() - (x**2 + y**2 + sin(x) * y) * x.diff()
    answers = []
    for clock in (lambda: 0.0, iter(float(k) for k in range(0, 10**12, 10**6)).__next__):
        for name in ("monotonic", "perf_counter", "time", "process_time"):
            monkeypatch.setattr(time, name, clock)
        answers.append(classify(riccati, [x, y]))
    assert answers[0] == answers[1]
    assert answers[0].holonomic_rank == 1
    (one,) = classify(x.diff() * exp(-x) * y + y.diff() * exp(-x), [x, y]).integrals
    assert one.f.has(y)


HARD = """
from sympy import *
from sympy.physics.mechanics import dynamicsymbols
from lagfmu import classify
x, y = dynamicsymbols("x y")
a = classify(y.diff() - (x**2 + y**2 + sin(x) * y) * x.diff(), [x, y])
print(a.kind, a.integrals, a.certificate)
"""


def test_what_is_given_up_is_the_same_in_every_process():
    """It is told by sizes alone, not by the order in which a process hashes its symbols."""
    told = [
        subprocess.run(
            [sys.executable, "-c", HARD],
            env={"PYTHONHASHSEED": h, "PYTHONPATH": str(HOUSE.parent)},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for h in ("0", "1")
    ]
    assert told[0] == told[1]
