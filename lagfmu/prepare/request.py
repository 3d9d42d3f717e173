"""What a scene asks of a model: its formulation, and outputs by name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from .. import names
from ..errors import DerivationError, ModelError, RequestError
from ..interface.table import differentiated, named, variable_table
from ..interface.variables import VariableTable
from ..mechanics import prune
from ..mechanics.equations import EquationsOfMotion
from ..mechanics.formulations import Form, reduce
from ..model.scene import EVERYTHING, Scene, select
from .steps import Derived


@dataclass(frozen=True)
class Asked:
    """The scene with its formulation, the form that this gives, all its variables, the outputs by name, and
    with them what is computed for them."""

    scene: Scene
    form: Form
    whole: VariableTable
    outputs: tuple[str, ...]
    read: tuple[str, ...]


def formulated(derived: Derived, acting: EquationsOfMotion, problems: list[str]) -> Asked:
    """What the scene asks for.

    `acting`: the equations with contacts that cannot open as constraints; `problems`: what is wrong with the
    scene so far.  Raises RequestError with all of them, DerivationError, and ModelError for peaks.
    """
    scene = derived.asked
    if acting.frictions:
        problems += _refused_with_friction(acting, scene)
    found = _least(acting, scene)
    if found is None:
        chosen = replace(scene, formulation=scene.formulation or "multipliers")
        form = _form(acting, chosen)
        found = _asked(form, chosen, problems)
    problems += _unknown_sensitivities(found)
    if problems:
        raise RequestError(scene.name, problems)
    _check_peaks(derived, found.scene, found.form)
    return found


def _form(eom: EquationsOfMotion, scene: Scene) -> Form:
    form = Form(eom, None, scene.formulation or "multipliers")
    if form.formulation != "minimal" or eom.frictions:
        return form
    try:
        return replace(form, reduction=reduce(eom))
    except DerivationError as error:
        raise DerivationError(f"scene {scene.name!r}: {error}") from error


def _least(eom: EquationsOfMotion, scene: Scene) -> Asked | None:
    """In the minimal formulation, where the scene leaves it open and no multiplier is solved for then."""
    movable = any(e.free_symbols for e in eom.starts().values())  # follows what is set
    if scene.formulation is not None or scene.complete or eom.frictions or movable:
        return None
    try:
        form = Form(eom, reduce(eom), "minimal")
    except DerivationError:
        return None
    if form.reduction is None or form.reduction.rows:
        return None
    unknown = list[str]()
    found = _asked(form, replace(scene, formulation="minimal"), unknown)
    return None if unknown or prune.read_only(form, found.read) is form else found


def _refused_with_friction(eom: EquationsOfMotion, scene: Scene) -> list[str]:
    """What a scene of a model with friction cannot ask for."""
    names = ", ".join(repr(law.name) for law in eom.frictions)
    problems = []
    if scene.formulation == "minimal":
        problems.append(
            f"formulation 'minimal' with friction ({names}): the normal force is needed in every mode, "
            "and the reduction eliminates it: choose 'multipliers' or 'nullspace'"
        )
    if scene.derivatives:
        problems.append(
            f"derivatives with friction ({names}): directional derivatives do not know the force of "
            "sliding: leave `derivatives` out"
        )
    return problems


def _check_peaks(derived: Derived, scene: Scene, form: Form) -> None:
    """Each Peak is of a Real output of the FMU that has everything.  Raises ModelError."""
    wanted, problems = [peak.of for peak in derived.model.peaks], list[str]()
    if wanted and tuple(scene.frictions) == EVERYTHING:
        forms: Sequence[Form] = (Form(derived.derived), form)
        known = [v.name for each in forms for v in variable_table(each, scene).measurable]
        select(wanted, list(dict.fromkeys(known)), "Peak: the Real output", problems)
    if problems:
        raise ModelError(derived.model.name, problems)


def _unknown_sensitivities(found: Asked) -> list[str]:
    """What the scene takes derivatives of, or by, and is not there to be read or set."""
    scene, problems = found.scene, list[str]()
    whole = variable_table(found.form, replace(scene, sensitivities=()))
    differentiated(whole.variables, scene.sensitivities, problems)
    fixed = {text.partition("=")[0].strip() for text in scene.fixed}
    problems += [
        f"sensitivities by {name!r}, which the scene fixes: leave it out of `fixed`"
        for name in sorted(named(scene.sensitivities))
        if name in fixed
    ]
    return problems


def _asked(form: Form, scene: Scene, problems: list[str]) -> Asked:
    whole = variable_table(form, scene)
    known = [v.name for v in whole.outputs]
    found = set(select(scene.outputs, known, "output", problems))
    found |= {names.barred(name) for name in found}  # a bar is of an output, ...
    found |= {names.bar(name) for name in found}  # ... and an output has its own
    found |= {name for name in known if names.read(name).head == names.SENSITIVITY}
    found |= {names.varied(name) for name in found}  # a derivative stands beside what it is of
    outputs = tuple(name for name in known if name in found)
    behind = [names.measured(name) for name in outputs]
    read = tuple(dict.fromkeys((*outputs, *(name for name in behind if name))))
    return Asked(scene, form, whole, outputs, read)
