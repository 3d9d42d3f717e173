"""What does the native target cost?  Against SUNDIALS in C, the python target and SciPy, and by itself.

    python benchmarks/native.py [--out DIR] [--rounds N] [pendulum|four-bar|python|rhs|bare|growth|call ...]

pendulum, four-bar: error of lambda against cost at tolerances 1e-3 ... 1e-13, every program on the same
    generated model.c; cost at an error of 1e-6 and 1e-9, and the ratio to the better peer.
python: the same two models by the python target and by SciPy on the index-1 equations.
rhs: one right-hand side in ns.  bare: a run over the right-hand sides that it evaluates.
growth: chains of 8 ... 512 links.  call: doStep and getReal.

Needs gcc and SUNDIALS (Debian: libsundials-dev).  Programs run interleaved, N rounds; medians, of
processor time, so that other load on the machine is not counted.  Errors are the largest over 100 samples
in 10 s and over all constraints, relative to the largest |lambda|; costs are of stepping and of reading
lambda, in microseconds a simulated second.  Writes to --out alone.
"""

from __future__ import annotations

import argparse
import math
import os
import statistics
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import python_side
from chain import chain
from programs import (
    BUDGET,
    STEP,
    STOP,
    Curve,
    algebra,
    compiled,
    core,
    evaluations,
    launch,
    native,
    native_fmu,
    numbers,
    peer,
    problem_of,
    write_problem,
)
from sympy.core.cache import clear_cache

from lagfmu import derive
from lagfmu.codegen.c.equations import model_source
from lagfmu.mechanics.form import Form

TOLERANCES = [10.0**-k for k in range(3, 14)]
TARGETS = (1e-6, 1e-9)
ALGEBRAS = ("dense", "runtime")
PROJECTED = [
    *(("cvode", method) for method in ("bdf-newton", "bdf-exact", "bdf-fixed")),
    *(("ida", method) for method in ("newton", "exact")),
]
UNPROJECTED = [("cvode", "adams"), ("cvode", "adams-newton")]
OURS = [("dop853", 0.1), ("dop853", 0.01), ("dop853", 0.001)]
SIZES = (8, 32, 128, 512)
Command = Callable[[float], list[Any]]


def cells(values: Iterable[float]) -> str:
    """The end of a table's row."""
    return " | ".join("not reached" if math.isnan(x) else f"{x:.3g}" for x in values) + " |"


def least(values: Iterable[float]) -> float:
    """The smallest of the numbers that are there."""
    return min((v for v in values if math.isfinite(v)), default=math.nan)


def table(curves: dict[str, Curve]) -> None:
    """Error, cost and steps by tolerance."""
    print("| tolerance | " + " | ".join(curves) + " |")
    print("| --- |" + " --- |" * len(curves))
    for tolerance in TOLERANCES:
        row = []
        for c in curves.values():
            if tolerance in c.costs:
                cost = statistics.median(c.costs[tolerance])
                row.append(f"{c.errors[tolerance]:.0e}, {cost:.4g}, {c.steps[tolerance]}")
            else:
                row.append("-")
        print(f"| {tolerance:.0e} | " + " | ".join(row) + " |")


def measure(jobs: dict[str, Command], m: int, exact: Any, rounds: int) -> dict[str, Curve]:
    """Every program at every tolerance, interleaved; what gives up once is not asked again."""
    curves = {label: Curve(label) for label in jobs}
    failed: set[tuple[str, float]] = set()
    for _ in range(rounds):
        for tolerance in TOLERANCES:
            for label, command in jobs.items():
                if (label, tolerance) in failed:
                    continue
                answer = launch(command(tolerance), m)
                if answer is None:
                    failed.add((label, tolerance))
                    continue
                steps, ns, lam = answer
                curves[label].add(tolerance, lam, exact, ns / 1e3 / STOP, steps)
    return curves


def work_precision(name: str, out: Path, rounds: int) -> dict[str, Curve]:
    """Our FMU in a C host against SUNDIALS in C: tables and ratios."""
    problem = problem_of(name, out)
    fmu = native_fmu(problem)
    jobs: dict[str, Command] = {}
    for linear in ALGEBRAS:
        for program in ("cvode", "ida"):
            binary = peer(problem, program, linear)
            for known, method in (*PROJECTED, *UNPROJECTED):
                if known == program:
                    jobs[f"{program} {method}, {linear}"] = lambda tol, b=binary, k=method: [
                        *(b, k, tol, STOP, STEP, BUDGET)
                    ]
    for method, communication in OURS:
        jobs[f"native {method}, doStep {communication} s"] = lambda tol, k=method, c=communication: (
            fmu.command(tol, c, problem.multipliers, k)
        )
    curves = measure(jobs, problem.m, problem.exact, rounds)
    best = {}  # shown of a peer: of the two ways to solve the index-1 equations the better
    for program, method in (*PROJECTED, *UNPROJECTED):
        both = [curves[f"{program} {method}, {linear}"] for linear in ALGEBRAS]
        better = min(both, key=lambda c: (-len(c.costs), c.total))  # giving up is not being quick
        best[better.label] = better
    ours = {label: c for label, c in curves.items() if label.startswith("native")}
    print(f"\n## {name}: error of lambda, us a simulated second, steps\n")
    table(best | ours)
    print("\n| us a simulated second at an error of | 1e-6 | 1e-9 |\n| --- | --- | --- |")
    for label, curve in (best | ours).items():
        print(f"| {label} | " + cells(curve.at(e) for e in TARGETS))
    every = [c for label, c in curves.items() if label not in ours]  # whichever is cheapest there
    free = [c for c in every if "adams" in c.label]
    holding = [c for c in every if "adams" not in c.label]
    for curve in ours.values():
        for what, group in (("projected peer", holding), ("peer without projection", free)):
            ratios = [least(c.at(e) for c in group) / curve.at(e) for e in TARGETS]
            print(f"| best {what} / {curve.label} | " + cells(ratios))
    return ours


def in_python(name: str, out: Path, rounds: int, ours: dict[str, Curve]) -> None:
    """The python target and SciPy against the native FMU."""
    curves = python_side.curves(problem_of(name, out), TOLERANCES, max(1, rounds // 2))
    print(f"\n## {name} in Python: error of lambda, us a simulated second, steps (evaluations)\n")
    table(curves)
    print("\n| us a simulated second at an error of | 1e-6 | 1e-9 |\n| --- | --- | --- |")
    for label, curve in curves.items():
        print(f"| {label} | " + cells(curve.at(e) for e in TARGETS))
    mine = next(iter(ours.values()))
    for what in ("python FMU", "lagfmu.simulate", "solve_ivp"):
        group = [c for label, c in curves.items() if label.startswith(what)]
        ratios = [least(c.at(e) for c in group) / mine.at(e) for e in TARGETS]
        print(f"| best {what} / {mine.label} | " + cells(ratios))


def right_hand_side(out: Path) -> None:
    """ns of evaluating, factoring and solving."""
    print("\n## One right-hand side, ns\n")
    print("| model | algebra | evaluate | factor | solve | all | in a row | all / evaluate |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    models = {
        "pendulum": problem_of("pendulum", out).prepared.equations,
        "four-bar": problem_of("four-bar", out).prepared.equations,
        "chain of 16": derive(chain(16)),
    }
    for name, equations in models.items():
        folder = out / name.replace(" ", "_")
        model = write_problem(folder, equations)
        for linear in ALGEBRAS:
            sources = [*native("rhs.c"), *model, *algebra(linear, out)]
            row = numbers([compiled(folder / f"rhs_{linear}", sources), 1.0])
            print(f"| {name} | {linear} | " + cells([*row, row[3] / row[0]]))


def bare(out: Path, rounds: int) -> None:
    """A run over the right-hand sides that it evaluates, one after the other as its stages need them."""
    print("\n## A run over its bare right-hand sides, tolerance 1e-6\n")
    print(
        "| model | lambda read every | evaluations a s | ns each in a row | us a s | ratio |"
        "\n| --- | --- | --- | --- | --- | --- |"
    )
    for name in ("pendulum", "four-bar"):
        problem = problem_of(name, out)
        fmu, alone = native_fmu(problem), core(problem.folder, problem.model)
        sources = [*native("rhs.c"), *problem.model, *algebra("runtime", out)]
        program = compiled(problem.folder / "rhs_runtime", sources)
        for h in (STOP, 0.1):
            pairs = []
            for _ in range(rounds):
                counted = evaluations([alone, "dop853", 1e-6, STOP, h, BUDGET, h])
                run = launch(fmu.command(1e-6, h, problem.multipliers, "dop853", step=h), problem.m)
                if run is None:
                    raise SystemExit("a run failed")
                pairs.append((run[1], numbers([program, 1.0])[4]))
            ns, each = (statistics.median(column) for column in zip(*pairs, strict=True))
            row = [counted / STOP, each, 1e-3 * ns / STOP, ns / (counted * each)]
            print(f"| {name} | {h:g} s | " + cells(row))


def growth(out: Path, rounds: int) -> None:
    """Derivation, generation, compilation and time per step of chains, with growth exponents."""
    print("\n## Chains of n links in absolute coordinates, 1 s from rest, tolerance 1e-6\n")
    print("| n | derive s | generate s | compile s | us a step | steps | growth exponent of each |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    derive(chain(2))  # SymPy's own start-up
    costs: dict[int, list[float]] = {}
    for n in SIZES:
        runs = [chain_costs(n, out / f"chain_{n}") for _ in range(rounds)]
        costs[n] = [statistics.median(column) for column in list(zip(*runs, strict=True))[:4]]
        row = " | ".join(f"{c:.3g}" for c in costs[n])
        before = SIZES[max(0, SIZES.index(n) - 1)]
        print(f"| {n} | {row} | {runs[0][4]} | {exponents(costs, before, n)} |", flush=True)
    print(f"| all | | | | | | {exponents(costs, SIZES[0], SIZES[-1])} |")


def chain_costs(n: int, folder: Path) -> tuple[float, float, float, float, int]:
    """Seconds of deriving, generating and compiling; us a step; steps."""
    clear_cache()  # of SymPy: what a shorter chain left there would help this one
    model = chain(n)
    moments = [time.process_time()]
    equations = derive(model)
    moments.append(time.process_time())
    model_source(Form(equations))
    moments.append(time.process_time())
    written = write_problem(folder, equations)
    begun = os.times().children_user
    compiled(folder / "model.o", written[:1], "-c")
    compilation = os.times().children_user - begun
    answer = launch([core(folder, written), "dop853", 1e-6, 1.0, 1.0, 0.5, 1.0], n)
    if answer is None:
        raise SystemExit(f"chain of {n} links: the run failed")
    steps, ns, _ = answer
    return moments[1] - moments[0], moments[2] - moments[1], compilation, 1e-3 * ns / steps, steps


def exponents(costs: dict[int, list[float]], a: int, b: int) -> str:
    """Growth exponent of each cost from size a to size b."""
    if a == b:
        return ""
    pairs = zip(costs[a], costs[b], strict=True)
    return " ".join(f"{math.log(y / x) / math.log(b / a):.2f}" for x, y in pairs)


def calls(out: Path, rounds: int) -> None:
    """doStep and getReal beyond the integration: what our solver takes without FMI is subtracted."""
    problem = problem_of("pendulum", out)
    fmu, bare = native_fmu(problem), core(problem.folder, problem.model)
    print("\n## Pendulum, ns a communication point (doStep, getReal of lambda), tolerance 1e-8\n")
    print(
        "| communication step s | solver alone | through FMI | difference |"
        " doStep | first getReal | further getReal |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for h in (1e-1, 1e-2, 1e-3, 1e-4):
        command = fmu.command(1e-8, h, problem.multipliers, step=h)
        pairs = []
        for _ in range(rounds):
            one = launch([bare, "dop853", 1e-8, STOP, h, 0.1, h], problem.m)
            two = launch(command, problem.m)
            if one is None or two is None:
                raise SystemExit("a run failed")
            pairs.append((one[1] * h / STOP, two[1] * h / STOP))
        a, b = (statistics.median(column) for column in zip(*pairs, strict=True))
        parts = numbers(fmu.command(1e-8, h, problem.multipliers, mode="overhead"))
        print(f"| {h:g} | " + cells([a, b, b - a, *parts]))


def main() -> None:
    """Answer what is asked."""
    every = ("pendulum", "four-bar", "python", "rhs", "bare", "growth", "call")
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("questions", nargs="*", help=f"of {', '.join(every)}; default: all")
    parser.add_argument("--out", type=Path, help="folder for what is built (default: temporary)")
    parser.add_argument("--rounds", type=int, default=5)
    asked = parser.parse_args()
    questions = asked.questions or every
    if unknown := set(questions) - set(every):
        parser.error(f"no such question: {', '.join(sorted(unknown))}")
    with tempfile.TemporaryDirectory() as temporary:
        out = (asked.out or Path(temporary)).resolve()
        for name in every[:2]:
            if name in questions or "python" in questions:
                ours = work_precision(name, out, asked.rounds)
                if "python" in questions:
                    in_python(name, out, asked.rounds, ours)
        if "rhs" in questions:
            right_hand_side(out)
        if "bare" in questions:
            bare(out, asked.rounds)
        if "growth" in questions:
            growth(out, asked.rounds)
        if "call" in questions:
            calls(out, asked.rounds)


if __name__ == "__main__":
    main()
