"""The coarsest tolerance (or fixed step) that holds an accuracy with a margin, by bisection.

It is found on the scene's own values, at its communication step and at up to ten times that, and held against
other start values and parameters; where it misses the accuracy there, the next finer one is taken.  The
scene's method and formulation stay.
"""

from __future__ import annotations

import random
import tempfile
from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ... import names
from ...errors import BuildError, SimulationError
from ...fmu.read import Trajectory, joint_starts, kind_of
from ...fmu.session import Session
from ...fmu.write import write
from ...methods import METHODS
from ...model.model import Model
from ...model.scene import HELD_OUT_MARGIN, MARGIN, Goal, Scene
from ...page.documentation import template
from ...prepare.prepare import prepare
from ...verification.simulate import steps_of
from .converged import Reference, Setting, ladder, observe, opened, refer, selected, wider

SHARE = 0.05  # of a value, or of its largest magnitude in the scene where all start values are zero
CASES = 3
TRIES = 40


@dataclass(frozen=True)
class Case:
    """The FMU at other values: what was set, and what it should report there."""

    values: Mapping[str, float]
    reference: Reference


def _cases(session: Session) -> list[Case]:
    """Other points, with their references.  Raises SimulationError if it cannot be run there."""
    scene = observe(session, _built(session))
    drawn = [other_values(session, scene, random.Random(k)) for k in range(CASES)]
    return [Case(values, refer(session, values)) for values in drawn]


def other_values(session: Session, scene: Trajectory, chance: random.Random) -> dict[str, float]:
    """Every parameter and start value, moved by up to SHARE, within its bounds.

    Start values of zero stay, unless all are zero.  The FMU puts what misses the constraints back on
    them.  Values that it refuses, or at which other contacts are closed at the start, are drawn again.
    """
    reason = "other contacts are closed at the start"
    for _ in range(TRIES):
        values = _drawn(session, scene, chance)
        try:
            begun = observe(session, _built(session), values, stop=session.experiment.step_size)
        except SimulationError as error:
            reason = str(error)
            continue
        contacts = names.those(begun.dtype.names or (), names.CONTACT)
        if all(begun[n][0] == scene[n][0] for n in contacts):
            return values
    raise SimulationError(
        f"{session.description.modelName}: no other start values or parameters were found within "
        f"{SHARE:.0%} of the scene's that the FMU starts with ({reason})"
    )


def _built(session: Session) -> Setting:
    return Setting("", 0.0, 0.0, session.experiment.step_size)


def _drawn(session: Session, scene: Trajectory, chance: random.Random) -> dict[str, float]:
    given = [
        v
        for v in session.description.modelVariables
        if kind_of(v) == "Real" and v.start is not None and names.read(v.name).head != names.SOLVER
    ]
    outputs, joints = scene.dtype.names or (), joint_starts(session.description)
    starts = [
        v
        for v in given
        if v.initial in ("exact", "approx") and v.name in outputs and v.name not in joints
    ]
    still = all(float(v.start) == 0 for v in starts)
    values: dict[str, float] = {}
    for v in given:
        share, value = SHARE * chance.uniform(-1, 1), float(v.start)
        moved = value * (1 + share)
        if v in starts and still:
            moved = share * float(np.abs(scene[v.name]).max())
        elif v not in starts and v.causality != "parameter":
            continue
        if moved != value and not session.rules[v.name].problem(moved):
            values[v.name] = moved
    return values


TOLERANCES = tuple(float(f"{d}e-{k}") for k in range(3, 14) for d in (10, 5, 2))  # 1e-2 ... 2e-13
ATTEMPTS = 6
Tick = Callable[[str, int, int], None]  # what is done, how far, of how many


@dataclass(frozen=True)
class Trial:
    """One setting: the largest error of what was asked, of which quantity, and the internal steps."""

    setting: Setting
    error: float
    worst: str
    steps: int

    def __str__(self) -> str:
        return f"{self.setting}: {self.error:.1e}" + (f" of {self.worst}" if self.worst else "")


@dataclass(frozen=True)
class Choice:
    """What was chosen for a goal: the scene to build, its trial, all trials on the scene from coarse to fine,
    held-out cases with their trials, and what the errors are relative to."""

    goal: Goal
    scene: Scene
    trial: Trial
    trials: tuple[Trial, ...]
    cases: tuple[tuple[Case, Trial], ...]
    failed: tuple[tuple[Trial, float], ...]
    names: tuple[str, ...]
    reference: Reference

    @property
    def held_out_error(self) -> float:
        """The largest error at the held-out values, the reference's own added."""
        return max(trial.error for _, trial in self.cases)


def choose(
    model: Model, scene: Scene, goal: Goal, tick: Tick | None = None, target: str | None = None
) -> Choice:
    """Raises BuildError naming the best that was reached if nothing holds."""
    wide = replace(scene, methods=METHODS, reals_only=False, error_bars=False)
    with tempfile.TemporaryDirectory(prefix="lagfmu_") as folder:
        path = write(prepare(model, wide), folder, (), target=target)
        with opened(path) as session:
            return _chosen(session, scene, goal, tick or (lambda *_: None))


def _chosen(session: Session, scene: Scene, goal: Goal, say: Tick) -> Choice:
    say("reference", 0, 1)
    reference = refer(session)
    names = tuple(q.name for q in selected(reference.known, goal.names))
    dials = ladder(scene.method, session.experiment.step_size, TOLERANCES)
    tried: dict[int, Trial] = {}

    def holds(k: int) -> bool:
        if k not in tried:
            say(str(dials[k]), len(tried), len(dials).bit_length())
            tried[k] = _attempt(session, dials[k], reference, names)
        return tried[k].error <= goal.on_the_scene

    first = bisect_left(range(len(dials)), True, key=holds)
    others = _cases(session) if first < len(dials) else []
    failed: list[tuple[Trial, float]] = []
    for k in range(first, len(dials)):
        if len(failed) == ATTEMPTS:
            break
        if not holds(k) or any(tried[k].error >= t.error for t, _ in failed):
            continue  # what misses elsewhere is not replaced by something no more accurate
        found: list[tuple[Case, Trial]] = []
        for case in others:
            say(f"{dials[k]} at held-out values", len(found), len(others))
            found.append((case, _attempt(session, dials[k], case.reference, names, case.values)))
        worst = max(trial.error for _, trial in found)
        if worst <= goal.held_out:
            tolerance, trials = dials[k].tolerance, tuple(tried[j] for j in sorted(tried))
            settled = replace(scene, tolerance=tolerance or goal.accuracy, step=dials[k].step)
            return Choice(
                *(goal, settled, tried[k], trials, tuple(found), tuple(failed), names, reference)
            )
        failed.append((tried[k], worst))
    raise BuildError(_nothing(scene, goal, list(tried.values()), failed))


def _attempt(
    session: Session,
    setting: Setting,
    reference: Reference,
    names: Sequence[str],
    values: Mapping[str, float] | None = None,
) -> Trial:
    """The larger error at the FMU's communication step and at the wider one, the reference's own added;
    infinite where it cannot be run."""
    worst, largest, steps = "", 0.0, 0
    for width in (session.experiment.step_size, wider(session)):
        try:
            run = observe(session, replace(setting, communication=width), values)
        except SimulationError:
            return Trial(setting, float("inf"), "", 0)
        errors = reference.errors(run)
        name = max(names, key=lambda n: errors[n] + reference.own[n])
        if errors[name] + reference.own[name] > largest:
            worst, largest = name, errors[name] + reference.own[name]
        steps = max(steps, steps_of(run))
    return Trial(setting, largest, worst, steps)


def _nothing(
    scene: Scene, goal: Goal, tried: Sequence[Trial], failed: Sequence[tuple[Trial, float]]
) -> str:
    lines = [
        f"{scene.name}: no setting holds a relative error of {goal} with its margin",
        f"the best on the scene is {min(tried, key=lambda t: t.error)}",
    ]
    lines += [f"{t} on the scene, but {e:.1e} on held-out values" for t, e in failed]
    lines.append(
        "ask for less, name the outputs that matter (--accuracy 1e-6:lambda.NAME), take another method, "
        "or shorten the scene"
    )
    return "; ".join(lines)


def section(choice: Choice) -> str:
    """HTML: what was asked, what was chosen, the trials, the held-out cases."""
    return template("page/choice.html.j2").render(
        goal=choice.goal,
        choice=choice,
        reference=choice.reference,
        margin=f"{MARGIN:g}",
        held_out_margin=f"{HELD_OUT_MARGIN:g}",
        values=[
            ", ".join(f"{n} = {v:.4g}" for n, v in case.values.items()) for case, _ in choice.cases
        ],
    )
