"""The methods of an FMU over their tolerances or steps: errors once, times again and again.

The settings take turns, so that a busy spell of the machine falls on all of them alike; the least time
counts, for other work on the machine only adds to it.
"""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from ... import names
from ...errors import SimulationError, VerificationError
from ...fmu.closed_forms import CarriedForm
from ...fmu.read import file_stem, numbers_of, target_in
from ...fmu.session import Session
from ...methods import FIXED_STEP, INTEGRATORS
from ...verification.closed_forms import check_closed_form
from ...verification.simulate import steps_of
from ...verification.verify import closed_forms_in
from .choose import Tick
from .observe import observe, opened, seconds
from .quantities import GROUPS, MULTIPLIER
from .reference import Reference, refer
from .setting import HALVINGS, Setting, ladder

COARSE, DECADES = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11), tuple(float(f"1e-{k}") for k in range(3, 14))
FEWEST = 3  # runs of each setting that are timed whatever it takes
SHORTEST, MOST = 1e-3, 20  # a timed piece of work [s], and how many runs it may be made of


@dataclass(frozen=True)
class Plan:
    """What to measure: the communication step [s] (0: the FMU's own), tolerances, methods; and how long that
    may take.

    A fixed step is halved `halvings` times.  A run longer than `limit` [s] ends its method's refinement;
    after `budget` [s] no setting is timed again that was timed `FEWEST` times.
    """

    communication: float = 0.0
    tolerances: tuple[float, ...] = COARSE
    methods: tuple[str, ...] = INTEGRATORS
    halvings: int = HALVINGS
    repeats: int = 7
    limit: float = 1.5
    budget: float = 5.0


@dataclass(frozen=True)
class Point:
    """One setting, measured.

    `errors` relative to the reference's scales; `seconds` each timed run [s]; `missed`: closed forms that are
    not held as `lagfmu verify` holds them at this tolerance (a fixed step promises none).
    """

    setting: Setting
    errors: Mapping[str, float]
    steps: int
    missed: tuple[str, ...] = ()
    seconds: tuple[float, ...] = ()

    @property
    def cost(self) -> float:
        """The least wall time of a run [s]."""
        return min(self.seconds, default=float("nan"))


@dataclass(frozen=True)
class Tradeoff:
    """All that was measured of one FMU; `notes`: methods that it refuses, and what was cut short."""

    name: str
    target: str
    simulated: float
    reference: Reference
    points: tuple[Point, ...]
    notes: tuple[str, ...]

    @property
    def headline(self) -> str:
        """The group that speed is weighed against: lambda, if there is one."""
        return min((q.group for q in self.reference.known), key=GROUPS.index, default=MULTIPLIER)

    def error(self, point: Point) -> float:
        """The largest error of the headline's quantities; no less than the reference's own."""
        own = self.reference.own
        those = [q.name for q in self.reference.known if q.group == self.headline]
        return max((max(point.errors[n], own[n]) for n in those), default=0.0)

    @property
    def front(self) -> list[Point]:
        """The points that no other beats in both error and time, the cheapest first."""
        kept: list[Point] = []
        for point in sorted(self.points, key=lambda p: (p.cost, self.error(p))):
            if self.error(point) < min((self.error(p) for p in kept), default=float("inf")):
                kept.append(point)
        return kept


def measure(fmu: Path, plan: Plan | None = None, tick: Tick | None = None) -> Tradeoff:
    """Errors and times of an FMU.  Raises SimulationError if not even the reference can be run."""
    say = tick or (lambda *_: None)
    with opened(fmu) as session:
        if names.METHOD not in session.rules:
            raise VerificationError(
                f"{str(fmu)!r} has no parameter 'solver.method': it was built for a scene with one "
                "method, and there is none to compare with (give the scene more of them in `methods`)"
            )
        plan = plan or Plan()
        if not plan.communication:
            plan = replace(plan, communication=session.experiment.step_size)
        say("reference", 0, 1)
        reference = refer(session, communication=plan.communication)
        points, notes = _errors(session, reference, closed_forms_in(fmu), plan, say)
        read = [q.name for q in reference.known]
        work = [partial(seconds, session, p.setting, read) for p in points]
        timed = take_turns(work, plan, say)
        return Tradeoff(
            name=file_stem(session.description),
            target=target_in(fmu),
            simulated=session.experiment.stop_time,
            reference=reference,
            points=tuple(replace(p, seconds=s) for p, s in zip(points, timed, strict=True)),
            notes=tuple(notes),
        )


def _errors(
    session: Session,
    reference: Reference,
    closed_forms: Sequence[CarriedForm],
    plan: Plan,
    say: Tick,
) -> tuple[list[Point], list[str]]:
    """One point a setting, without times; the notes."""
    points: list[Point] = []
    notes: list[str] = []
    parameters = numbers_of(session.description)
    for k, method in enumerate(plan.methods):
        say(f"errors of {method}", k, len(plan.methods))
        own: list[Point] = []
        failed: list[str] = []
        for setting in ladder(method, plan.communication, plan.tolerances, plan.halvings):
            begun = time.perf_counter()
            try:
                run = observe(session, setting)
            except SimulationError as error:
                failed.append(str(error))
                continue
            spent = time.perf_counter() - begun
            held = closed_forms if setting.tolerance else ()
            checks = [check_closed_form(c, run, parameters, setting.tolerance) for c in held]
            missed = tuple(str(c) for c in checks if c.failed)
            own.append(Point(setting, reference.errors(run), steps_of(run), missed))
            if spent > plan.limit:
                notes.append(
                    f"{setting}: a run takes longer than {plan.limit:.3g} s, no finer ones"
                )
                break
            if method in FIXED_STEP and len(own) > 2 and _largest(own[-1]) > _largest(own[-3]):
                break  # the rounding of the many steps has taken over
        notes += failed if own else [f"{method} is refused: {failed[0]}"]
        points += own
    return points, notes


def _largest(point: Point) -> float:
    return max(point.errors.values(), default=0.0)


def take_turns(
    work: Sequence[Callable[[], float]], plan: Plan, say: Tick
) -> list[tuple[float, ...]]:
    """Wall times [s] of each piece of work, done in rounds, each round in another order.

    What takes less than `SHORTEST` is done several times in a row, and the mean is one time.
    """
    seconds: list[list[float]] = [[] for _ in work]
    begun = time.perf_counter()
    warm = [piece() for piece in work]
    often = [max(1, min(MOST, int(SHORTEST / max(s, 1e-9)))) for s in warm]
    order = list(range(len(work)))
    shuffle = random.Random(0).shuffle
    for k in range(plan.repeats):
        if k >= FEWEST and time.perf_counter() - begun > plan.budget:
            break
        say("timing", k, plan.repeats)
        shuffle(order)
        for j in order:
            seconds[j].append(sum(work[j]() for _ in range(often[j])) / often[j])
    return [tuple(s) for s in seconds]
