"""The methods of an FMU over their tolerances or steps: errors once, times again and again.

The settings take turns, so that a busy spell of the machine falls on all of them alike; the least time
counts, for other work on the machine only adds to it.

A tradeoff as a table for the terminal, as JSON with everything, as a pipeline's suite.

Work against precision: wall time over error, logarithmic, one line a method.

To the right is more accurate, down is faster.  Ringed is what won, named by its tolerance or step; the
hatched part lies below the reference's own error.
"""

from __future__ import annotations

import platform
import random
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from ... import names
from ...errors import SimulationError, VerificationError
from ...fmu.closed_forms import CarriedForm
from ...fmu.read import file_stem, numbers_of, target_in
from ...fmu.session import Session
from ...methods import FIXED_STEP, INTEGRATORS, MENU
from ...page.table import new_table
from ...verification.closed_forms import check_closed_form
from ...verification.pipeline import Case, Report
from ...verification.simulate import steps_of
from ...verification.verify import closed_forms_in
from .choose import Tick
from .converged import (
    FINER,
    GROUPS,
    HALVINGS,
    MULTIPLIER,
    REFERENCE,
    Reference,
    Setting,
    ladder,
    observe,
    opened,
    refer,
    seconds,
)

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
        timed = _take_turns(work, plan, say)
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


def _take_turns(
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


FORMAT = 2


def table(found: Tradeoff) -> Table:
    """One line a setting: tolerance or step, error, cost; ● won, ✗ misses a closed form."""
    won = found.front
    error = "error of λ" if found.headline == MULTIPLIER else f"error of {found.headline}"
    drawn = new_table(
        f"{found.name} ({found.target}), every {found.points[0].setting.communication:.3g} s",
        *("", "method", "tolerance", error, "steps", "ms/s"),
        words=("", "method"),
    )
    method = ""
    for point in found.points:
        if method not in ("", point.setting.method):
            drawn.add_section()
        method = point.setting.method
        drawn.add_row(
            ("●" if point in won else "") + ("✗" if point.missed else ""),
            method,
            point.setting.dial,
            f"{found.error(point):.1e}",
            str(point.steps),
            _digits(1e3 * point.cost / found.simulated),
            style="bold" if point in won else None,
        )
    return drawn


def _digits(value: float) -> str:
    """Three digits, and no exponent above a thousand."""
    return f"{value:.3g}" if value < 1e3 else f"{value:.0f}"


def remarks(found: Tradeoff) -> list[str]:
    """What the columns are, how right the reference is, what was missed, refused or cut."""
    own = max(found.reference.own.values(), default=0.0)
    lines = [
        f"error: relative to the largest magnitude, against a run at {REFERENCE:.0e} whose own error is "
        f"{own:.0e} (a run at {FINER:.0e} differs by that); ms/s: wall time per simulated second through "
        "fmpy, the least; ● won: no setting is both faster and more accurate"
    ]
    lines += [f"✗ {p.setting}: {'; '.join(p.missed)}" for p in found.points if p.missed]
    return [*lines, *found.notes]


def report(file: str, found: Tradeoff) -> Report:
    """A case a setting that was measured, none of which fails: a trade-off measures and does not judge.

    An FMU that runs with no setting at all could not be run.
    """
    if not found.points:
        return Report(file, error=f"no setting could be measured: {'; '.join(found.notes)}")
    cases = [Case(str(p.setting), found.name, seconds=p.cost) for p in found.points]
    return Report(file, found, cases, _data(found))


def _data(found: Tradeoff) -> dict[str, Any]:
    """Everything, as JSON knows it: times in s, relative errors."""
    reference, won = found.reference, found.front
    return {
        "format": FORMAT,
        "fmu": found.name,
        "target": found.target,
        "simulated": found.simulated,
        "machine": f"{platform.system()} {platform.machine()}",
        "reference": {
            q.name: asdict(q) | {"own": reference.own[q.name], "scale": reference.scale[q.name]}
            for q in reference.known
        },
        "points": [asdict(p) | {"cost": p.cost, "won": p in won} for p in found.points],
        "notes": list(found.notes),
    }


COLOURS = {m.name: m.colour for m in MENU if m.colour}
MARKERS = {m.name: m.marker for m in MENU if m.marker}
WORTH = 0.1  # part of the error of the last named point at which the next one is named


def draw(found: Tradeoff, out: Path) -> Path:
    """Write the figure (the ending says the format).  Raises BuildError if it cannot be."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    from ...verification.plot import STYLE, plain, save

    factor = 1e3 / found.simulated
    with mpl.rc_context(STYLE | {"font.size": 10, "hatch.linewidth": 0.4}):
        figure = Figure(figsize=(6.4, 4.2), layout="constrained")
        axis = figure.subplots()
        axis.set_xscale("log")
        axis.set_yscale("log")
        for method in COLOURS:
            own = [p for p in found.points if p.setting.method == method]
            _line(axis, found, own, factor)
        _winners(axis, found, factor)
        _limits(axis, found)
        what = "λ" if found.headline == MULTIPLIER else found.headline
        axis.set_xlabel(f"largest error of {plain(what)}, relative to its largest magnitude")
        axis.set_ylabel("wall time per simulated second in ms")
        step = found.points[0].setting.communication
        axis.set_title(
            f"{plain(found.name)} ({found.target} FMU), every {step:.3g} s", fontsize=10.5
        )
        figure.legend(loc="outside right upper", frameon=False, fontsize=9)
        return save(figure, out)


def _line(axis: Any, found: Tradeoff, points: Sequence[Point], factor: float) -> None:
    """One method: wall times over errors."""
    known = [p for p in points if np.isfinite(found.error(p))]
    if known:
        method = known[0].setting.method
        axis.plot(
            [found.error(p) for p in known],
            [factor * p.cost for p in known],
            color=COLOURS[method],
            marker=MARKERS[method],
            markersize=4.5,
            linewidth=1.6,
            label=method,
        )


def _winners(axis: Any, found: Tradeoff, factor: float) -> None:
    """A ring about each, and the tolerance or step below it where it is much better than the one before."""
    xs = [found.error(p) for p in found.front]
    ys = [factor * p.cost for p in found.front]
    ring = {"markerfacecolor": "none", "color": "#222222", "linewidth": 0}
    axis.plot(xs, ys, "o", markersize=10, label="won", **ring)
    last = float("inf")
    for point, x, y in zip(found.front, xs, ys, strict=True):
        if x > WORTH * last:
            continue
        last = x
        axis.annotate(
            point.setting.dial,
            (x, y),
            (0, -10),
            textcoords="offset points",
            ha="center",
            va="top",
            fontsize=8,
            fontweight="bold",
            color=COLOURS[point.setting.method],
        )


def _limits(axis: Any, found: Tradeoff) -> None:
    """More accurate to the right; hatched what the reference does not know."""
    own = [found.reference.own[q.name] for q in found.reference.known if q.group == found.headline]
    errors = [e for e in map(found.error, found.points) if np.isfinite(e)]
    lowest, edge = min([*errors, *own]), max(own)
    axis.axvspan(edge, edge * 1e-9, facecolor="none", edgecolor="#999999", hatch="///")
    axis.set_xlim(max([*errors, 1e3 * lowest]) * 4, lowest / 6)
    axis.margins(y=0.15)
