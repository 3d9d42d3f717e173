"""The settings and formulations of a scene, measured, so that one can be chosen for any accuracy.

Times are those at the scene's communication step.  Errors are the larger ones of that step and of ten
times that, so that what is chosen does not lean on an importer that cuts the solver's steps short.
"""

from __future__ import annotations

import contextlib
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from ...errors import LagfmuError, SimulationError
from ...fmu.write import write
from ...methods import EVALUATIONS, METHODS
from ...model.closed_form import ClosedForm, Conserved
from ...model.model import Model
from ...model.scene import Scene
from ...prepare.prepare import prepare
from ...verification.verify import claims_in
from .goal import Goal
from .importer import Importer
from .measure import Plan, Row, Tick, accepts, default_plan, take_turns, weigh, wider
from .quantities import selected
from .reference import Reference, refer
from .setting import dials

BUDGET = 20.0  # [s] of timing
ENOUGH = 3  # settings of a method that hold the accuracy, before no finer one is measured
SLOW = 5.0  # times the fastest that holds it: what takes longer is not timed
ALIKE = 1.25  # times within this factor, with quartiles that overlap, cannot be told apart


@dataclass(frozen=True)
class Option:
    """A formulation with a setting, measured; `error` is that of the quantities asked for."""

    formulation: str
    row: Row
    error: float

    @property
    def evaluations(self) -> int:
        """Evaluations of the equations in a run, about: what a run costs without noise."""
        return self.row.steps * EVALUATIONS.get(self.row.setting.method, 1)

    def __str__(self) -> str:
        return f"{self.formulation}, {self.row.setting.method} {self.row.setting.dial}"


@dataclass(frozen=True)
class Survey:
    """All options of a scene; `dropped`: methods and formulations that it does not have, and why."""

    scene: Scene
    target: str
    simulated: float
    names: tuple[str, ...]
    reference: Reference
    options: tuple[Option, ...]
    floor: float
    dropped: tuple[str, ...]


def formulations(model: Model, scene: Scene) -> tuple[str, ...]:
    """Those to try: a scene that names its formulation keeps it."""
    if scene.formulation is not None:
        return (scene.formulation,)
    return ("multipliers", "nullspace") + (("minimal",) if model.embedding is not None else ())


def survey(
    model: Model,
    scene: Scene,
    closed_forms: Sequence[ClosedForm | Conserved],
    goal: Goal,
    tick: Tick | None = None,
    target: str = "python",
    plan: Plan | None = None,
) -> Survey:
    """Measure the options of a scene, up to those that hold the goal with its margin.

    Raises LagfmuError if the scene cannot be built as it stands.
    """
    say = tick or (lambda *_: None)
    dropped: list[str] = []
    with tempfile.TemporaryDirectory(prefix="lagfmu_") as folder, contextlib.ExitStack() as stack:
        importers: dict[str, Importer] = {}
        tried = formulations(model, scene)
        for formulation in tried:
            say(f"building {formulation}", 0, 1)
            try:
                wide = replace(scene, formulation=formulation, methods=METHODS)
                prepared = prepare(model, wide)
                path = write(prepared, Path(folder, formulation), closed_forms, target=target)
                importers[formulation] = stack.enter_context(Importer(path))
            except LagfmuError as error:
                if formulation == tried[0]:
                    raise
                dropped.append(f"{formulation}: {error}")
        first = importers[tried[0]]
        plan = plan or replace(default_plan(first), budget=BUDGET)
        say("reference", 0, 1)
        reference = refer(first, claims_in(first.path), communication=scene.step_size)
        names = tuple(q.name for q in selected(reference.known, goal.names))
        found: list[tuple[str, Row, float]] = []
        for formulation, importer in importers.items():
            found += _weighed(formulation, importer, reference, names, goal, plan, dropped, say)
        kept = _worth_timing(found, names, reference, goal)
        work = [partial(importers[f].seconds, r.setting, names) for f, r, _ in kept]
        timed = take_turns([*work, partial(first.floor, scene.step_size, names)], plan, say)
        options = tuple(
            Option(f, replace(row, seconds=s), _error(row, names, reference))
            for (f, row, _), s in zip(kept, timed, strict=False)
        )
        floor = sorted(timed[-1])[len(timed[-1]) // 2]
        return Survey(
            scene, target, first.stop_time, names, reference, options, floor, tuple(dropped)
        )


def _error(row: Row, names: Sequence[str], reference: Reference) -> float:
    return max(max(row.errors[n], reference.own[n]) for n in names)


def _weighed(
    formulation: str,
    importer: Importer,
    reference: Reference,
    names: Sequence[str],
    goal: Goal,
    plan: Plan,
    dropped: list[str],
    say: Tick,
) -> list[tuple[str, Row, float]]:
    """(formulation, row, seconds of that first run), from coarse to fine, method by method."""
    found: list[tuple[str, Row, float]] = []
    for k, method in enumerate(plan.methods):
        say(f"errors of {formulation}, {method}", k, len(plan.methods))
        if not accepts(importer, method):
            if method not in dropped:
                dropped.append(method)
            continue
        enough = 0
        for setting in dials(method, importer.step_size, plan.tolerances, plan.halvings):
            begun = time.perf_counter()
            try:
                row = weigh(importer, setting, reference)
                seconds = time.perf_counter() - begun
                wide = replace(setting, communication=wider(importer))
                row = _worse(row, reference.errors(importer.observe(wide)))
            except SimulationError:
                continue
            found.append((formulation, row, seconds))
            enough += _error(row, names, reference) <= goal.on_the_scene
            if enough == ENOUGH or seconds > plan.limit:
                break
    return found


def _worse(row: Row, others: Mapping[str, float]) -> Row:
    return replace(row, errors={n: max(e, others[n]) for n, e in row.errors.items()})


def _worth_timing(
    found: Sequence[tuple[str, Row, float]],
    names: Sequence[str],
    reference: Reference,
    goal: Goal,
) -> list[tuple[str, Row, float]]:
    good = [s for _, r, s in found if _error(r, names, reference) <= goal.on_the_scene]
    longest = SLOW * min(good, default=float("inf"))
    return [(f, r, s) for f, r, s in found if s <= longest]


def ranked(options: Sequence[Option], error: float) -> list[Option]:
    """The options whose error is at most `error`, cheapest first.

    Where the times cannot be told apart, the fewest evaluations of the equations decide: within
    `ALIKE`, or on a busy machine within the ratio of the quartiles that most options have.
    """
    left = [o for o in options if o.error <= error]
    spreads = sorted(o.row.quartiles[1] / o.row.quartiles[0] for o in options)
    factor = max(ALIKE, spreads[len(spreads) // 2] if spreads else 0.0)
    order = []
    while left:
        fastest = min(left, key=lambda o: o.row.median)
        alike = [
            o
            for o in left
            if o.row.quartiles[0] <= fastest.row.quartiles[1]
            and o.row.median <= factor * fastest.row.median
        ]
        best = min(alike, key=lambda o: (o.evaluations, o.error))
        order.append(best)
        left.remove(best)
    return order
