"""The cheapest method, tolerance or step, and formulation that holds an accuracy, with a margin.

It is chosen on the scene's own values and held against others, on the FMU as it is built; where it
fails there, the next that is more accurate is taken.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace

from ...errors import BuildError, LagfmuError
from ...fmu.write import write
from ...methods import METHODS
from ...model.closed_form import ClosedForm, Conserved
from ...model.goal import Goal
from ...model.model import Model
from ...model.scene import Scene
from ...prepare.prepare import prepare
from ...verification.verify import closed_forms_in
from .held_out import Case, held_out
from .importer import Importer
from .measure import Tick
from .survey import Option, Survey, ranked, survey

ATTEMPTS = 6


@dataclass(frozen=True)
class Choice:
    """What was chosen for a goal: the scene to build, the option, the held-out cases, the survey.

    `failed` are options that held the accuracy on the scene and missed it elsewhere.
    """

    goal: Goal
    scene: Scene
    option: Option
    cases: tuple[Case, ...]
    failed: tuple[tuple[Option, float], ...]
    survey: Survey

    @property
    def held_out_error(self) -> float:
        """The largest error at the held-out values, the reference's own added."""
        return max(c.error(self.survey.names) for c in self.cases)


def choose(
    model: Model,
    scene: Scene,
    closed_forms: Sequence[ClosedForm | Conserved],
    goal: Goal,
    tick: Tick | None = None,
    target: str = "python",
) -> Choice:
    """Measure and choose.  Raises BuildError naming the best that was reached if nothing holds."""
    measured = survey(model, scene, closed_forms, goal, tick, target)
    return pick(model, measured, closed_forms, goal, tick)


def pick(
    model: Model,
    measured: Survey,
    closed_forms: Sequence[ClosedForm | Conserved],
    goal: Goal,
    tick: Tick | None = None,
) -> Choice:
    """The choice from a survey; see `choose`."""
    say = tick or (lambda *_: None)
    failed: list[tuple[Option, float]] = []
    reasons: list[str] = []
    for option in ranked(measured.options, goal.on_the_scene):
        if len(failed) + len(reasons) == ATTEMPTS:
            break
        if any(option.error >= f.error for f, _ in failed):
            continue  # what fails elsewhere is not replaced by something less accurate
        say(f"held-out values: {option}", len(failed), ATTEMPTS)
        try:
            chosen = as_scene(measured.scene, option, goal)
            with tempfile.TemporaryDirectory(prefix="lagfmu_") as folder:
                prepared = prepare(
                    model, replace(chosen, methods=METHODS, reals_only=False, error_bars=False)
                )
                path = write(prepared, folder, closed_forms, target=measured.target)
                with Importer(path) as importer:
                    cases = held_out(importer, closed_forms_in(path))
        except LagfmuError as error:
            reasons.append(f"{option}: {error}")
            continue
        choice = Choice(goal, chosen, option, tuple(cases), tuple(failed), measured)
        if choice.held_out_error <= goal.held_out:
            return choice
        failed.append((option, choice.held_out_error))
    raise BuildError(_nothing(measured, goal, failed, reasons))


def as_scene(scene: Scene, option: Option, goal: Goal) -> Scene:
    """The scene whose FMU has the option's formulation and setting by default.

    With a fixed step, which has no tolerance, the FMU states the accuracy that was asked for.
    """
    setting = option.row.setting
    return replace(
        scene,
        formulation=option.formulation,
        method=setting.method,
        tolerance=setting.tolerance or goal.accuracy,
        step=setting.step,
    )


def _nothing(
    measured: Survey, goal: Goal, failed: Sequence[tuple[Option, float]], reasons: Sequence[str]
) -> str:
    best = min(measured.options, key=lambda o: o.error, default=None)
    lines = [f"{measured.scene.name}: no setting holds a relative error of {goal} with its margin"]
    if best is not None:
        worst = max(
            measured.names, key=lambda n: max(best.row.errors[n], measured.reference.own[n])
        )
        lines.append(f"the best on the scene is {best}: {best.error:.1e} of {worst}")
    lines += [
        f"{o} holds {o.error:.1e} on the scene but {e:.1e} on held-out values" for o, e in failed
    ]
    lines += list(reasons)
    lines.append(
        "ask for less, name the outputs that matter (--accuracy 1e-6:lambda.NAME), or shorten the "
        "scene"
    )
    return "; ".join(lines)
