"""The settings and formulations of a scene, measured, so that one can be chosen for any accuracy.

Times are those at the scene's communication step.  Errors are the larger ones of that step and of ten
times that, so that what is chosen does not lean on an importer that cuts the solver's steps short.
"""

from __future__ import annotations

import contextlib
import math
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from ...errors import LagfmuError
from ...fmu.write import write
from ...methods import EVALUATIONS, METHODS
from ...model.closed_form import ClosedForm, Conserved
from ...model.goal import Goal
from ...model.model import Model
from ...model.scene import Scene
from ...prepare.prepare import prepare
from ...verification.verify import closed_forms_in
from .importer import Importer
from .measure import Plan, Tick, Weighed, accepts, default_plan, take_turns, weigh, wider
from .quantities import selected
from .reference import Reference, refer
from .search import SLOW, Clock, Walk, coarsest, start
from .setting import Setting, dials

BUDGET = 5.0  # [s] of timing
SPREAD = 3  # times from which on quartiles say something
ALIKE = 1.25  # times within this factor, with quartiles that overlap, cannot be told apart


@dataclass(frozen=True)
class Option:
    """A formulation with a setting, measured; `error` is that of the quantities asked for."""

    formulation: str
    row: Weighed
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
    """Measure the options of a scene about those that hold the goal with its margin (search.py).

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
                wide = replace(
                    scene,
                    formulation=formulation,
                    methods=METHODS,
                    reals_only=False,
                    error_bars=False,
                )
                prepared = prepare(model, wide)
                path = write(prepared, Path(folder, formulation), closed_forms, target=target)
                importers[formulation] = stack.enter_context(Importer(path))
            except LagfmuError as error:
                if formulation == tried[0]:
                    raise
                dropped.append(f"{formulation}: {error}")
        first = importers[tried[0]]
        if plan is None:
            plan = replace(default_plan(first), budget=BUDGET)
            if first.target == "python":  # each run takes long: one is a time
                plan = replace(plan, repeats=0, warm_up=False)
        say("reference", 0, 1)
        carried = closed_forms_in(first.path)
        reference = refer(first, carried, communication=scene.step_size, second_opinion=False)
        names = tuple(q.name for q in selected(reference.known, goal.names))
        found: list[tuple[str, Weighed, float]] = []
        clock, near = Clock(), dict[str, int]()
        for formulation, importer in importers.items():
            task = _Task(formulation, importer, reference, names, goal.on_the_scene, clock, near)
            found += _weighed(task, plan, dropped, say)
        kept = _worth_timing(found, names, reference, goal, plan)
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


def _error(row: Weighed, names: Sequence[str], reference: Reference) -> float:
    return max(max(row.errors[n], reference.own[n]) for n in names)


@dataclass(frozen=True)
class _Task:
    """What to measure a formulation for; `near`: by method, the dial that held it in another one."""

    formulation: str
    importer: Importer
    reference: Reference
    names: Sequence[str]
    goal: float
    clock: Clock
    near: dict[str, int]
    wide: dict[Setting, Mapping[str, float]] = field(default_factory=dict)

    def coarse(self, setting: Setting, limit: float) -> float:
        """The error at the wider communication step."""
        errors = self._wide(setting, limit)
        return max(max(errors[n], self.reference.own[n]) for n in self.names)

    def full(self, setting: Setting, limit: float) -> tuple[Weighed, float]:
        """The row, with the larger errors of both communication steps, and the largest of them."""
        row = _worse(
            weigh(self.importer, setting, self.reference, limit=limit), self._wide(setting, limit)
        )
        return row, _error(row, self.names, self.reference)

    def _wide(self, setting: Setting, limit: float) -> Mapping[str, float]:
        if setting not in self.wide:
            coarse = replace(setting, communication=wider(self.importer))
            run = self.importer.observe(coarse, limit=limit)
            self.wide[setting] = self.reference.errors(run)
        return self.wide[setting]


def _weighed(
    task: _Task, plan: Plan, dropped: list[str], say: Tick
) -> list[tuple[str, Weighed, float]]:
    """(formulation, row, seconds of that first run), method by method, from coarse to fine."""
    found: list[tuple[str, Weighed, float]] = []
    for j, method in enumerate(plan.methods):
        say(f"errors of {task.formulation}, {method}", j, len(plan.methods))
        if not accepts(task.importer, method):
            if method not in dropped:
                dropped.append(method)
            continue
        grid = dials(method, task.importer.step_size, plan.tolerances, plan.halvings)
        walk = Walk(grid, task, task.goal, task.clock)
        held = coarsest(walk, task.near.get(method, start(grid, task.goal)), plan.warm_up)
        if held is not None:
            task.near.setdefault(method, held)
        found += [(task.formulation, row, s) for _, (row, _, s) in sorted(walk.found.items())]
    return found


def _worse(row: Weighed, others: Mapping[str, float]) -> Weighed:
    return replace(row, errors={n: max(e, others[n]) for n, e in row.errors.items()})


def _worth_timing(
    found: Sequence[tuple[str, Weighed, float]],
    names: Sequence[str],
    reference: Reference,
    goal: Goal,
    plan: Plan,
) -> list[tuple[str, Weighed, float]]:
    """What takes no longer than SLOW times the fastest that holds the goal.

    Where runs take long (no `warm_up`) only what holds it, unless nothing does.
    """
    good = [x for x in found if _error(x[1], names, reference) <= goal.on_the_scene]
    longest = SLOW * min((s for _, _, s in good), default=math.inf)
    among = found if plan.warm_up or not good else good
    return [x for x in among if x[2] <= longest]


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
        few = len(fastest.row.seconds) < SPREAD
        alike = [
            o
            for o in left
            if o.row.median <= factor * fastest.row.median
            and (few or o.row.quartiles[0] <= fastest.row.quartiles[1])
        ]
        best = min(alike, key=lambda o: (o.evaluations, o.error))
        order.append(best)
        left.remove(best)
    return order
