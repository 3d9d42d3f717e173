"""The coarsest tolerance (or fixed step) that holds an accuracy with a margin, by bisection.

It is found on the scene's own values, at its communication step and at up to ten times that, and held against
other start values and parameters; where it misses the accuracy there, the next finer one is taken.  The
scene's method and formulation stay.
"""

from __future__ import annotations

import tempfile
from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from ...errors import BuildError, SimulationError
from ...fmu.session import Session
from ...fmu.write import write
from ...methods import METHODS
from ...model.goal import Goal
from ...model.model import Model
from ...model.scene import Scene
from ...prepare.prepare import prepare
from ...verification.simulate import steps_of
from .held_out import Case, cases
from .observe import observe, opened
from .quantities import selected
from .reference import Reference, refer, wider
from .setting import Setting, ladder

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
            tried[k] = attempt(session, dials[k], reference, names)
        return tried[k].error <= goal.on_the_scene

    first = bisect_left(range(len(dials)), True, key=holds)
    others = cases(session) if first < len(dials) else []
    failed: list[tuple[Trial, float]] = []
    for k in range(first, len(dials)):
        if len(failed) == ATTEMPTS:
            break
        if not holds(k) or any(tried[k].error >= t.error for t, _ in failed):
            continue  # what misses elsewhere is not replaced by something no more accurate
        found: list[tuple[Case, Trial]] = []
        for case in others:
            say(f"{dials[k]} at held-out values", len(found), len(others))
            found.append((case, attempt(session, dials[k], case.reference, names, case.values)))
        worst = max(trial.error for _, trial in found)
        if worst <= goal.held_out:
            tolerance, trials = dials[k].tolerance, tuple(tried[j] for j in sorted(tried))
            settled = replace(scene, tolerance=tolerance or goal.accuracy, step=dials[k].step)
            return Choice(
                *(goal, settled, tried[k], trials, tuple(found), tuple(failed), names, reference)
            )
        failed.append((tried[k], worst))
    raise BuildError(_nothing(scene, goal, list(tried.values()), failed))


def attempt(
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
