"""Many random runs of the models with friction: does any hang, break a cone, gain energy, report a NaN?

    python benchmarks/friction_runs.py [RUNS [SEED [MODEL ...]]]

Random parameters, starts, communication steps, tolerances and methods, native target.  Each run is held at
every communication point against Coulomb's and Lagrange's laws as they follow from the model file alone
(lagfmu/studio/stress/lagrange.py), and against the balance of energy and heat.  Prints a table: runs, points,
changes of mode, what was wrong, refusals by their cause.  A batch that does not return in ten minutes ends
the script, named.
"""

from __future__ import annotations

import faulthandler
import re
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import fmpy
import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from sympy import Abs, sympify

from lagfmu.fmu.batch import LAST, Plan, run_batch
from lagfmu.fmu.closed_forms import carried
from lagfmu.fmu.session import Session
from lagfmu.fmu.write import write
from lagfmu.methods import FIXED_STEP, MENU
from lagfmu.model.file import load
from lagfmu.prepare.prepare import prepare
from lagfmu.studio.stress.closed_forms import LEEWAY, Compiled, laws
from lagfmu.studio.stress.lagrange import lagrange

MODELS = Path(__file__).parent.parent / "models"
STILL = 1e-15  # a slip velocity that is none, of bodies that all have come to rest [m/s]
TOGETHER, LIMIT = 5, 600.0  # runs with the same communication points, and what they may take [s]
METHODS = {m.number: m.name for m in MENU if m.name in ("auto", "dop853", "radau5", "rk4")}
KINDS = {"Real": np.float64, "Integer": np.int32, "Boolean": np.bool_}
CAUSES = {
    "no acceleration, or several": "Painleve: sliding",
    "sliding problem has no solution": "Painleve: modes",
    "Painleve": "Painleve, other",
    "solver.maximum_steps": "more steps than allowed",
    "impact": "impact",
    "leave and close": "chattering",
}


def belt(r, p):
    return {"x": r.normal(0, 0.3), "der(x)": r.choice([p["speed"], r.normal(0, 1)]), **drop(r, "z")}


def bowling(r, p):
    return {"der(x)": r.normal(0, 4), "der(phi)": r.normal(0, 40), **drop(r, "z")}


def incline_friction(r, p):
    spin = {} if r.random() < 0.3 else {"der(y)": r.normal(0, 1), "der(theta)": r.normal(0, 10)}
    return {**spin, **drop(r, "z")}


def friction_oscillator(r, p):
    return {"x": r.normal(0, 0.3), "der(x)": r.choice([0, r.normal(0, 1)])}


def rough_hemisphere(r, p):
    return {"r": p["a"], "theta": r.uniform(-1.5, 1.5), "der(theta)": r.choice([0, r.normal(0, 1)])}


def rolling_sphere(r, p):
    return {**rough_hemisphere(r, p), "r": p["a"] + p["R"], "der(phi)": r.normal(0, 3)}


def falling_rod(r, p):
    angle = r.uniform(0.05, np.pi - 0.05)
    height = p["l"] * np.sin(angle) + r.choice([0, r.uniform(0, 1)])
    moving = {f"der({q})": r.normal(0, 2) for q in ("x", "theta")} if r.random() < 0.7 else {}
    return {"y": height, "theta": angle, **moving}


def half_car(r, p):
    return {"s": r.uniform(2, 9), "der(s)": r.uniform(0, 40), "theta": r.normal(0, 0.02)}


def two_feet(r, p):
    moving = {f"der({q})": r.normal(0, 1) for q in ("x", "theta")} if r.random() < 0.6 else {}
    tilt = r.choice([0, r.normal(0, 0.5)])
    height = (
        p["h"] * np.cos(tilt) + p["a"] * np.abs(np.sin(tilt)) + r.choice([0, r.uniform(0, 0.5)])
    )
    return {"y": height, "theta": tilt, **moving}


def puck(r, p):
    return {"der(x)": r.normal(0, 1), "der(y)": r.choice([0, r.normal(0, 1)]), **drop(r, "z")}


def drop(r, q):
    """Now and then it falls onto the surface."""
    return {q: r.uniform(0, 0.3), f"der({q})": r.normal(0, 1)} if r.random() < 0.3 else {}


STARTS = {
    f.__name__: f
    for f in (
        belt,
        bowling,
        incline_friction,
        friction_oscillator,
        rough_hemisphere,
        rolling_sphere,
        falling_rod,
        half_car,
        two_feet,
        puck,
    )
}


def parameters(model, r):
    """Each within its bounds; coefficients of friction from 0 to 1.5, kinetic = static one run in three."""
    found = {}
    for p in model.parameters:
        name, low = str(p.symbol), p.min or 0.0
        if p.unit == "1" and p.max == 1:  # a restitution
            found[name] = r.choice([0, 1, r.uniform()], p=[0.4, 0.1, 0.5])
        elif name.startswith("mu"):
            none = 0 if not p.symbol.is_positive else 1e-3
            found[name] = r.choice(
                [none, r.uniform(0, 0.6), r.uniform(0, 1.5)], p=[0.05, 0.6, 0.35]
            )
        else:
            high = np.inf if p.max is None else p.max
            found[name] = min(max(low, p.value * np.exp(r.normal(0, 0.6))), high)
    if "mu_s" in found:
        found["mu_k"] = found["mu_s"] * r.choice([1, r.uniform()], p=[1 / 3, 2 / 3])
    return found


class Bench:
    """One model's FMU, and its laws."""

    def __init__(self, name, folder):
        path = Path(__file__).with_name(f"{name}.py")
        file = load(path if path.exists() else MODELS / f"{name}.py")
        self.model = file.model
        scene = file.scenes[-1]
        prepared = prepare(file.model, scene)
        path = write(prepared, folder, (), target="native")
        description = fmpy.read_model_description(str(path))
        self.session = Session(path)
        self.read = [v for v in description.modelVariables if v.causality in ("output", "input")]
        self.settable = {
            v.name: float(v.start)
            for v in description.modelVariables
            if v.type == "Real" and v.start
        }
        names = frozenset(v.name for v in description.modelVariables)
        self.laws = [
            (
                law,
                None
                if law.closed_form.when is None
                else Compiled(law.closed_form.when, law.closed_form.name),
            )
            for law in laws(tuple(carried(scene, lagrange(file.model, names))))
        ]
        self.fields = [("time", np.float64), *((v.name, KINDS[v.type]) for v in self.read)]
        # what a moving surface gives: lambda . nu, nu = - (rate of the row at rest)
        self.drives = [
            (n, v) for law in file.model.frictions for n in law.of if (v := surface(file.model, n))
        ]

    def run(self, name, r, stop):
        """TOGETHER runs: rows of each, what was set, tolerance, status, reason."""
        step = stop * np.exp(r.uniform(np.log(2e-3), 0))
        times = np.append(np.arange(0, stop - step / 2, step), stop)
        tolerance = 10 ** r.uniform(-11, -4)
        runs = []
        for _ in range(TOGETHER):
            values = parameters(self.model, r)
            values |= STARTS[name](r, values)
            values["solver.method"] = r.choice(list(METHODS), p=[0.6, 0.15, 0.15, 0.1])
            runs.append({k: float(v) for k, v in values.items()})
        vary = tuple(sorted(set().union(*runs)))
        table = np.array([[run.get(n, self.settable.get(n) or 0.0) for n in vary] for run in runs])
        plan = Plan(
            vary, tuple((v.name, LAST) for v in self.read), times, tolerance=tolerance, whole=True
        )
        found = run_batch(self.session, plan, table)
        for k in range(TOGETHER):
            there = int(np.searchsorted(times, found.reached[k], "right"))
            values = found.trajectory[k, :there]
            if found.status[k] > 1 and there == 1 and np.isnan(values).all():
                values = values[:0]  # the start itself was refused
            values_set = dict(zip(vary, table[k], strict=True))
            yield (
                times,
                values,
                values_set,
                tolerance,
                int(found.status[k]),
                found.reasons.get(k, ""),
            )

    def judge(self, times, values, known, tolerance):
        """What is wrong with a run."""
        if not np.isfinite(values).all():
            at = sorted({self.read[j].name for j in np.argwhere(~np.isfinite(values))[:, 1]})
            return ["not finite: " + ", ".join(at[:3])], 0
        rows = np.zeros(len(values), dtype=self.fields)
        rows["time"] = times[: len(values)]
        for j, v in enumerate(self.read):
            rows[v.name] = values[:, j]
        run = SimpleNamespace(rows=rows, values=known, tolerance=tolerance)
        wrong = []
        for law, when in self.laws:
            error, allowed = hold(law, when, run)
            worst = int(np.argmax(error - allowed)) if len(error) else 0
            if len(error) and error[worst] > allowed[worst]:
                wrong.append(f"{law.closed_form.name}: {error[worst]:.1e} > {allowed[worst]:.1e}")
        changes = sum(
            int((np.diff(rows[n].astype(int)) != 0).sum())
            for n in rows.dtype.names
            if n.startswith(("sticks.", "contact."))
        )
        if (
            METHODS[int(known["solver.method"])] not in FIXED_STEP
            and "energy.total" in rows.dtype.names
        ):
            wrong += self.energy(rows, known, tolerance)
        return wrong, changes

    def energy(self, rows, known, tolerance):
        """Energy and heat: no gain, but for what a moving surface gives."""
        if self.model.forces or len(rows) < 2 or "energy.dissipated" not in rows.dtype.names:
            return []
        heat = rows["energy.dissipated"]
        total = rows["energy.total"] + heat
        size = (np.abs(rows["energy.kinetic"]) + np.abs(rows["energy.potential"]) + heat).max()
        given = np.zeros(len(rows) - 1)
        loose = np.zeros(len(rows) - 1)  # where the trapezoidal rule is none
        for name, speed in self.drives:
            power = rows[f"lambda.{name}"] * known[speed]
            h = np.diff(rows["time"])
            given += h * (power[1:] + power[:-1]) / 2
            modes = [n for n in rows.dtype.names if re.match(r"sticks|contact|slipping.*count", n)]
            signs = [rows[n].astype(float) for n in modes] + [np.sign(rows[f"slip.{name}"])]
            loose += sum(np.abs(np.diff(x)) for x in signs) > 0
            loose += h * np.sqrt(known["k"] / known["m"]) > 1  # it may have turned round twice
        gained = np.diff(total) - given
        if loose.any() or self.drives:
            gained = gained[loose == 0]
            gain = float(gained.max(initial=0))
        else:
            gain = float((np.cumsum(gained) - np.minimum.accumulate(np.cumsum(gained))).max())
        fall = float(-np.diff(heat).min(initial=0))
        interpolated = tolerance ** (2 / 3)  # radau5's, of order 3 within steps of order 5
        stiff = METHODS[int(known["solver.method"])] == "radau5"
        allowed = (100 * tolerance + (interpolated if stiff else 1e-10)) * size
        wrong = [f"gain of energy: {gain:.1e} > {allowed:.1e}"] if gain > allowed else []
        return wrong + ([f"heat falls: {fall:.1e}"] if fall > 1e-13 * size else [])


def hold(law, when, run):
    """Error of a law, and what rounding of its terms allows, where it says something."""
    every = np.ones(len(run.rows), dtype=bool)
    chosen = every if when is None else when.at(every, run) != 0
    if law.closed_form.while_closed is not None:
        chosen = chosen & run.rows[f"contact.{law.closed_form.while_closed}"]
    actual, expected = law.actual.at(chosen, run), law.expected.at(chosen, run)
    terms = [np.abs(expected), *(np.abs(s.at(chosen, run)) for s in law.sizes)]
    allowed = LEEWAY * law.closed_form.rounding * np.maximum.reduce(terms) + np.finfo(float).tiny
    if law.closed_form.name.endswith("while it sticks"):
        allowed = np.maximum(allowed, STILL)
    error = np.where(np.isfinite(expected + allowed), np.abs(actual - expected), 0.0)
    return error, np.where(np.isfinite(allowed), allowed, np.inf)


def surface(model, name):
    """The parameter that is the speed of the surface, if it moves."""
    rest = sympify(model.constraint(name).expression)
    rest = rest.xreplace({q.diff(): 0 for q in model.coordinates})
    return str(Abs(rest).free_symbols.pop()) if rest != 0 else ""


def cause(reason):
    return next((c for text, c in CAUSES.items() if text in reason), reason[:100])


def main():
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 10000
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    names = sys.argv[3:] or list(STARTS)
    table = Table(box=SIMPLE_HEAD, title=f"random runs, seed {seed}", title_justify="left")
    for column in (
        "model",
        "runs",
        "points",
        "changes of mode",
        "wrong",
        "refused",
        "CPU ms a run, most",
    ):
        table.add_column(column, justify="left" if column == "model" else "right")
    causes, wrongs, console = Counter(), [], Console(width=110)
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            number = list(STARTS).index(name)
            bench = Bench(name, Path(folder))
            share = -(-runs // len(names) // TOGETHER) * TOGETHER
            count = Counter()
            longest = 0.0
            for chunk in range(share // TOGETHER):
                r = np.random.default_rng([seed, number, chunk])
                faulthandler.dump_traceback_later(LIMIT, exit=True)
                begun = time.process_time()
                done = list(bench.run(name, r, float(r.choice([0.3, 1.0, 3.0]))))
                longest = max(longest, time.process_time() - begun)
                faulthandler.cancel_dump_traceback_later()
                for k, (times, values, known, tolerance, status, reason) in enumerate(done):
                    wrong, changes = bench.judge(times, values, known, tolerance)
                    if status > 1:
                        causes[name, cause(reason)] += 1
                    if status > 3 or (status > 1 and not reason):
                        wrong.append(f"status {status}: {reason}")
                    count["runs"] += 1
                    count["points"] += len(values)
                    count["changes"] += changes
                    count["wrong"] += bool(wrong)
                    count["refused"] += status > 1
                    if wrong:
                        wrongs.append(f"{name} chunk {chunk} run {k}: {'; '.join(wrong)}")
            bench.session.close()
            print(f"{name}: {dict(count)}", file=sys.stderr, flush=True)
            figures = [str(count[n]) for n in ("runs", "points", "changes", "wrong", "refused")]
            table.add_row(name, *figures, f"{1e3 * longest / TOGETHER:.0f}")
    console.print(table)
    for (name, text), number in sorted(causes.items()):
        print(f"refused {number:5d}  {name}: {text}")
    for text in wrongs[:40]:
        print(text)
    sys.exit(bool(wrongs))


if __name__ == "__main__":
    main()
