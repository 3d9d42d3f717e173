"""Errors once, times again and again: the settings take turns, so that a busy spell of the machine
falls on all of them alike; the median and the quartiles are kept."""

from __future__ import annotations

import math
import random
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from ... import names
from ...errors import LagfmuError, SimulationError, VerificationError
from ...fmu.closed_forms import CarriedForm
from ...fmu.described import file_stem, numbers_of
from ...methods import FIXED_STEP, INTEGRATORS
from ...verification.simulate import steps_of
from ...verification.verify import check_closed_form, closed_forms_in
from .front import front
from .importer import Importer
from .quantities import GROUPS, MULTIPLIER, Quantity, residual
from .reference import Reference, refer
from .setting import Setting, dials, tolerances

REPEATS = 7  # timed runs a setting, if the budget allows
QUICK_REPEATS = 31
FEWEST = 3
WIDER = (10, 5, 2)
COARSE_GRID = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11)  # tolerances
SHORTEST, MOST = 1e-3, 20  # a timed piece of work [s], and how many runs it may be made of
PAUSE = 2e-4  # [s] before each, so that it starts on a time slice of its own
Tick = Callable[[str, int, int], None]  # what is done, how far, of how many


@dataclass(frozen=True)
class Plan:
    """What to measure: communication steps [s], tolerances, methods; and how long that may take.

    A fixed step is halved `halvings` times.
    A run longer than `limit` [s] ends its method's refinement; after `budget` [s] of timing no
    setting is run again that was run `FEWEST` times.  Without `warm_up` the first run is a time like
    any other: right where a run takes long.
    """

    communications: tuple[float, ...]
    tolerances: tuple[float, ...] = tolerances()
    methods: tuple[str, ...] = INTEGRATORS
    halvings: int = 7
    repeats: int = REPEATS
    limit: float = 3.0
    budget: float = 60.0
    warm_up: bool = True


@dataclass(frozen=True)
class Weighed:
    """One setting, measured.

    `errors` relative to the reference's scales; `residual` the largest |residual| in SI units;
    `statements` the errors of the closed forms along the run; `seconds` each timed run [s]; `below`:
    quantities whose error is less than that of the reference itself; `broken`: closed forms that are not
    held as `lagfmu verify` holds them at this tolerance (a fixed step promises none).
    """

    setting: Setting
    errors: Mapping[str, float]
    residual: float
    statements: Mapping[str, float]
    steps: int
    seconds: tuple[float, ...] = ()
    below: tuple[str, ...] = ()
    broken: tuple[str, ...] = ()

    @property
    def median(self) -> float:
        """Median wall time of a run [s]."""
        return float(np.median(self.seconds)) if self.seconds else float("nan")

    @property
    def quartiles(self) -> tuple[float, float]:
        """Lower and upper quartile of the wall time [s]."""
        if not self.seconds:
            return float("nan"), float("nan")
        low, high = np.percentile(self.seconds, [25, 75])
        return float(low), float(high)


@dataclass(frozen=True)
class Tradeoff:
    """All that was measured of one FMU; `floor` maps a communication step to fmpy's own seconds."""

    name: str
    target: str
    simulated: float
    step_size: float
    reference: Reference
    rows: tuple[Weighed, ...]
    floor: Mapping[float, float]
    refused: Mapping[str, str]
    cut: tuple[str, ...]

    @property
    def known(self) -> tuple[Quantity, ...]:
        """The quantities that are measured."""
        return self.reference.known

    def worst(self, row: Weighed, group: str | Sequence[str]) -> float:
        """The largest relative error among the quantities of a group, or among those named.

        What is below the reference's own error counts as that error.
        """
        those = [q.name for q in self.known if q.group == group or q.name in group]
        return max((max(row.errors[n], self.reference.own[n]) for n in those), default=0.0)

    @property
    def groups(self) -> tuple[str, ...]:
        """The groups that this FMU has quantities of and, for event times, that took place."""
        counts = {
            q.name: self.reference.run[names.name(names.DEPARTURES, q.contact)][-1]
            for q in self.known
            if q.contact
        }
        present = {q.group for q in self.known if counts.get(q.name, 1) > 0}
        return tuple(g for g in GROUPS if g in present)

    @property
    def headline(self) -> str:
        """The group that speed is weighed against: lambda if there is one."""
        return MULTIPLIER if MULTIPLIER in self.groups else self.groups[0]

    def front(self, communication: float | None = None, group: str | None = None) -> list[Weighed]:
        """The rows that no other beats in both error and time, at one communication step or at all."""
        rows = [
            r
            for r in self.rows
            if communication is None or r.setting.communication == communication
        ]
        points = [(self.worst(r, group or self.headline), r.median) for r in rows]
        return [rows[k] for k in front(points)]


def wider(importer: Importer) -> float:
    """Ten times the FMU's own communication step [s], or less where a quarter of the run is shorter."""
    h = importer.step_size
    return next((k * h for k in WIDER if k * h <= importer.stop_time / 4), h)


def default_plan(importer: Importer) -> Plan:
    """The FMU's own communication step and ten times that; a finer grid where a run costs little."""
    steps = tuple(dict.fromkeys((importer.step_size, wider(importer))))
    if importer.target == "native":
        return Plan(steps, tolerances(1), repeats=QUICK_REPEATS, limit=1.0, budget=20.0)
    return Plan(steps)


def quick_plan(importer: Importer) -> Plan:
    """The same communication steps with fewer points between: an answer within half a minute an FMU."""
    plan = replace(default_plan(importer), tolerances=COARSE_GRID, budget=5.0)
    if importer.target == "native":
        return plan
    return replace(plan, halvings=2, repeats=1, limit=1.5, warm_up=False)


def measure(
    fmu: Path, plan: Plan | None = None, tick: Tick | None = None, repeats: int | None = None
) -> Tradeoff:
    """Errors and times of an FMU.  Raises SimulationError if not even the reference can be run."""
    say = tick or (lambda *_: None)
    closed_forms = _closed_forms(fmu)
    with Importer(fmu) as importer:
        if names.METHOD not in importer.variables:
            raise VerificationError(
                f"{str(fmu)!r} has no parameter 'solver.method': it was built for a scene with one "
                "method, and there is none to compare with (give the scene more of them in `methods`)"
            )
        plan = plan or default_plan(importer)
        plan = replace(plan, repeats=repeats or plan.repeats)
        say("reference", 0, 1)
        reference = refer(importer, closed_forms, communication=min(plan.communications))
        rows, refused, cut = _errors(importer, reference, closed_forms, plan, say)
        read = [q.name for q in reference.known]
        work = [partial(importer.seconds, r.setting, read) for r in rows]
        work += [partial(importer.floor, h, read) for h in plan.communications]
        timed = take_turns(work, plan, say)
        floor = [float(np.median(s)) for s in timed[len(rows) :]]
        return Tradeoff(
            name=file_stem(importer.description),
            target=importer.target,
            simulated=importer.stop_time,
            step_size=importer.step_size,
            reference=reference,
            rows=tuple(replace(r, seconds=s) for r, s in zip(rows, timed, strict=False)),
            floor=dict(zip(plan.communications, floor, strict=True)),
            refused=refused,
            cut=tuple(cut),
        )


def _closed_forms(fmu: Path) -> list[CarriedForm]:
    try:
        return closed_forms_in(fmu)
    except LagfmuError:
        return []  # an FMU of another tool has none; it is measured against a converged run


def _errors(
    importer: Importer,
    reference: Reference,
    closed_forms: Sequence[CarriedForm],
    plan: Plan,
    say: Tick,
) -> tuple[list[Weighed], dict[str, str], list[str]]:
    """One row a setting, without times; methods that the FMU refuses, and why; what was cut short."""
    rows: list[Weighed] = []
    refused: dict[str, str] = {}
    cut: list[str] = []
    total = len(plan.communications) * len(plan.methods)
    for k, (h, method) in enumerate((h, m) for h in plan.communications for m in plan.methods):
        say(f"errors of {method} every {h:.3g} s", k, total)
        for setting in (
            dials(method, h, plan.tolerances, plan.halvings) if method not in refused else ()
        ):
            begun = time.perf_counter()
            try:
                rows.append(weigh(importer, setting, reference, closed_forms))
            except SimulationError as error:
                if method not in {r.setting.method for r in rows} and not accepts(importer, method):
                    refused[method] = str(error)
                    break
                cut.append(str(error))
                continue
            own = [r for r in rows if r.setting.method == method and r.setting.communication == h]
            if len(own) > 1 and all(len(r.below) == len(reference.known) for r in own[-2:]):
                break  # what is finer cannot be told apart
            if method in FIXED_STEP and len(own) > 2 and _largest(own[-1]) > _largest(own[-3]):
                break  # the rounding of the many steps has taken over
            if time.perf_counter() - begun > plan.limit:
                cut.append(f"{setting}: a run takes longer than {plan.limit:.3g} s, no finer ones")
                break
    return rows, refused, cut


def _largest(row: Weighed) -> float:
    return max(row.errors.values(), default=0.0)


def accepts(importer: Importer, method: str) -> bool:
    """Whether an FMU starts with a method at all: then what failed was the step, not the method."""
    step = importer.step_size if method in FIXED_STEP else 0.0
    setting = Setting(method, 0.0 if step else 1e-8, step / 64, importer.step_size)
    try:
        importer.observe(setting, stop=importer.step_size)
    except SimulationError:
        return False
    return True


def weigh(
    importer: Importer,
    setting: Setting,
    reference: Reference,
    closed_forms: Sequence[CarriedForm] = (),
    limit: float = math.inf,
) -> Weighed:
    """The errors of one setting.

    Raises SimulationError if the FMU refuses it, TooSlowError if it takes longer than `limit` [s].
    """
    run = importer.observe(setting, limit=limit)
    errors = reference.errors(run)
    parameters = numbers_of(importer.description)
    checks = [check_closed_form(c, run, parameters, setting.tolerance) for c in closed_forms]
    return Weighed(
        setting=setting,
        errors=errors,
        residual=residual(run),
        statements={c.name: c.error for c in checks if c.points},
        steps=steps_of(run),
        below=tuple(n for n, e in errors.items() if e < reference.own[n]),
        broken=tuple(str(c) for c in checks if setting.tolerance and not c.passed),
    )


def take_turns(
    work: Sequence[Callable[[], float]], plan: Plan, say: Tick
) -> list[tuple[float, ...]]:
    """Wall times [s] of each piece of work, done in rounds, each round in another order.

    What takes less than `SHORTEST` is done several times in a row, and the mean is one time.
    """
    seconds: list[list[float]] = [[] for _ in work]
    warm = [work[j]() for j in say_each(range(len(work)), "timing", say)]
    often = [max(1, min(MOST, int(SHORTEST / max(s, 1e-9)))) for s in warm]
    if not plan.warm_up:
        seconds = [[s] for s in warm]
    order = list(range(len(work)))
    shuffle = random.Random(0).shuffle
    begun = time.perf_counter()
    for k in range(plan.repeats):
        if k >= FEWEST and time.perf_counter() - begun > plan.budget:
            break
        shuffle(order)
        for j in say_each(order, f"timing, round {k + 1} of {plan.repeats}", say):
            time.sleep(PAUSE)
            seconds[j].append(sum(work[j]() for _ in range(often[j])) / often[j])
    return [tuple(s) for s in seconds]


def say_each(items: Sequence[int], what: str, say: Tick) -> Iterable[int]:
    """The items, telling how far it has come before each."""
    for k, item in enumerate(items):
        say(what, k, len(items))
        yield item
