"""A model in a scene -> all that is known about it before anything is packaged, in five steps."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .. import names
from ..codegen.py.equations import lower as lowered_form
from ..errors import CannotStartError, DerivationError, LagfmuWarning, ModelError, RequestError
from ..interface.table import differentiated, named, variable_table
from ..interface.variables import VariableTable
from ..mechanics import formulations, prune
from ..mechanics.derive import derive as derive_equations
from ..mechanics.equations import EquationsOfMotion
from ..mechanics.formulations import Form
from ..mechanics.jumps import with_jumps
from ..methods import AUTO, UNLESS_STIFF
from ..model.elements import Expr, unused
from ..model.model import Model, stuck
from ..model.scene import EVERYTHING, Scene, select
from ..names import motion
from ..numeric.instant import at_start, expanded
from .consistency import check_embedding, examined_structure, posed, structure_of, whole
from .starts import ALLOWED, StartMovedWarning, check_given
from .steps import Derived, Lowered, Narrowed, Prepared, Reduced, Request, Structure


@dataclass(frozen=True)
class Asked:
    """The scene with its formulation, the form that this gives, all its variables, the outputs by name, and
    with them what is computed for them."""

    scene: Scene
    form: Form
    whole: VariableTable
    outputs: tuple[str, ...]
    read: tuple[str, ...]


def _formulated(derived: Derived, acting: EquationsOfMotion, problems: list[str]) -> Asked:
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
        return replace(form, reduction=formulations.reduce(eom))
    except DerivationError as error:
        raise DerivationError(f"scene {scene.name!r}: {error}") from error


def _least(eom: EquationsOfMotion, scene: Scene) -> Asked | None:
    """In the minimal formulation, where the scene leaves it open and no multiplier is solved for then."""
    movable = any(e.free_symbols for e in eom.starts().values())  # follows what is set
    if scene.formulation is not None or scene.complete or eom.frictions or movable:
        return None
    try:
        form = Form(eom, formulations.reduce(eom), "minimal")
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


def _with_reduced_start(value: Prepared) -> Prepared:
    """The same, begun where `start` says in coordinates that are not stepped.

    Warns of it.  Raises CannotStartError where `start` misses the constraints, or cannot be followed.
    """
    missed = _misses(value)
    if not missed or _told_apart(value.form, missed):
        return value
    try:
        started = _started(value, structure_of(whole(value)), missed)
    except ModelError as error:
        raise CannotStartError(error.name, error.problems, value) from error
    form, coded = _of_model(value.form, started), _of_model(value.coded, started)
    all_of, table = variable_table(form, value.scene), variable_table(coded, value.scene)
    begun = replace(
        value,
        model=started,
        derived=replace(value.derived, model=started),
        form=form,
        coded=coded,
        whole=all_of,
        table=table.keeping(value.outputs),
    )
    begun = replace(begun, structure=structure_of(posed(begun)))
    _check_branch(value.model, _misses(begun, value))
    return begun


def _of_model(form: Form, model: Model) -> Form:
    """The form with the start values of a model."""
    reduction = form.reduction
    if reduction is not None:
        reduction = replace(reduction, reduced=replace(reduction.reduced, model=model))
    return replace(form, equations=replace(form.equations, model=model), reduction=reduction)


def _misses(value: Prepared, asked: Prepared | None = None) -> dict[str, tuple[float, float]]:
    """The values in the `start` of what is `asked` that the form does not begin with, by name: as given, and
    as it begins."""
    if value.form.reduction is None:
        return {}
    source = (asked or value).derived
    given = source.starts(embedded=False).items()
    wanted = {name: source.at_parameters(e, value.fixed) for name, e in given}
    (u, p), begun = posed(value).values, value.structure.start
    at, q, v = expanded(at_start(value.examined, begun.q, u, p), begun.q, begun.v)
    names, n = at.system.states, at.system.nq
    has = dict(zip(names, [*q.tolist(), *v.tolist()], strict=True))
    size = dict.fromkeys(names[:n], np.abs(q).max(initial=0.0))
    size |= dict.fromkeys(names[n:], np.abs(v).max(initial=0.0))
    return {
        name: (said, has[name])
        for name, said in wanted.items()
        if name in has and abs(has[name] - said) > ALLOWED * max(abs(said), size[name])
    }


def _told_apart(form: Form, missed: Mapping[str, Any]) -> bool:
    """Warns, and is True, where the independent coordinates are an Embedding's, with a start of its own."""
    reduction, eom = form.reduction, form.equations
    assert reduction is not None
    coordinates = {str(eom.symbols[q]) for q in eom.model.coordinates}
    if {str(s) for s in reduction.s} <= coordinates:
        return False
    begins = ", ".join(f"{n} = {given!r} there is {has!r}" for n, (given, has) in missed.items())
    warnings.warn(
        f"the start of the embedding is another than `start` says: {begins}; the minimal formulation begins "
        "with that of the embedding",
        StartMovedWarning,
        stacklevel=6,
    )
    return True


def _started(value: Prepared, full: Structure, missed: Mapping[str, Any]) -> Model:
    """The model whose `start` names the independent coordinates alone, from where the constraints put it.

    `full`: that of all coordinates.  Warns of it.  Raises ModelError where `start` misses the constraints.
    """
    model, eom, reduction = value.model, value.equations, value.form.reduction
    assert reduction is not None
    own = {str(s): q for q, s in eom.symbols.items()}
    stepped = [str(s) for s in (*reduction.s, *reduction.sdot)]
    told = ", ".join(f"{n} = {given!r}" for n, (given, _) in missed.items())
    if any(eom.plain(e).free_symbols for e in model.start.values()):
        raise ModelError(
            model.name,
            [
                f"start gives {told} by expressions of parameters, which the minimal formulation would have "
                f"to solve for {', '.join(map(str, reduction.s))}: start these, or take formulation "
                "'multipliers'"
            ],
        )
    begun = full.start
    check_given(model.name, begun.moved, full.missed)
    names = motion([str(eom.symbols[q]) for q in model.coordinates])
    values = dict(zip(names, [*begun.q.tolist(), *begun.v.tolist()], strict=True))
    start = {own[n]: float(values[n]) for n in stepped}
    follow = ", ".join(f"{n} = {values[n]!r}" for n in stepped if values[n])
    warnings.warn(
        f"start gives {told}, which follows from {', '.join(map(str, reduction.s))}: the minimal "
        f"formulation begins with {follow or 'zeros'}",
        StartMovedWarning,
        stacklevel=6,
    )
    return replace(model, start=start)


def _check_branch(model: Model, missed: Mapping[str, Any]) -> None:
    """Raises ModelError if what `start` gives is missed though s begins as the constraints ask for."""
    if missed:
        told = "; ".join(f"{n} = {given!r} becomes {has!r}" for n, (given, has) in missed.items())
        raise ModelError(
            model.name,
            [
                "the minimal formulation solves the constraints for another branch than start gives "
                f"({told}): take formulation 'multipliers'"
            ],
        )


def prepare(
    model: Model, scene: Scene | None = None, known: EquationsOfMotion | None = None
) -> Prepared:
    """Derive, narrow to the scene, reduce, lower and examine.  Raises ModelError (RequestError for what the
    scene asks for and the model does not have, CannotStartError) or DerivationError.

    `known`: the equations of the model, where they are known from another scene.
    """
    request = Request(model, scene or Scene(model.name), known)
    return examine(lower(reduce(narrow(derive(request)))))


def derive(request: Request) -> Derived:
    """The equations of motion of the model, frictions that the scene lets stick as constraints."""
    problems: list[str] = []
    model, known = stuck(request.model, request.asked.frictions, problems), request.known
    if problems:
        raise RequestError(request.asked.name, problems)
    if known is None or known.model is not model:
        for name in unused(request.model):
            text = (
                f"parameter {name!r} stands nowhere in the model and changes no motion: leave it out; a "
                "closed form that needs it can hold its number"
            )
            warnings.warn(f"model {model.name!r}: {text}", LagfmuWarning, stacklevel=4)
        known = with_jumps(derive_equations(model))
    return Derived(model, request.asked, known)


def narrow(derived: Derived) -> Narrowed:
    """To the scene: contacts that cannot open, what is fixed, the formulation, the outputs by name."""
    scene, problems = derived.asked, list[str]()
    acting = prune.held(derived.derived, scene, problems)
    fixed = prune.numbers_of(derived.derived, scene, problems)
    asked = _formulated(derived, acting, problems)
    return Narrowed(**vars(derived), **vars(asked), fixed=fixed)


def reduce(narrowed: Narrowed) -> Reduced:
    """To what the outputs need: coordinates and rows, energies and equations that are read, parameters."""
    form, scene, fixed = narrowed.form, narrowed.scene, dict(narrowed.fixed)
    coded, read, whole = form, narrowed.read, narrowed.whole
    if not scene.complete:
        equations = prune.only(form.equations, *prune.needed(_with_numbers(form, fixed), read))
        reduction = form.reduction
        if reduction is not None and equations is not form.equations:
            reduction = formulations.reduce(equations)
        own = prune.own(equations, read)
        if own != equations.outputs:
            equations = replace(equations, outputs=own)
        form = replace(form, equations=equations, reduction=reduction)
        coded = prune.read_only(replace(form, equations=prune.silent(form.equations, read)), read)
        asked = named(scene.sensitivities)
        idle = [p for p in prune.idle(_with_numbers(coded, fixed)) if str(p) not in asked]
        fixed |= prune.values(idle, narrowed.model)
        damped = prune.damped(coded.equations, fixed)
        if scene.method == AUTO and scene.methods is None and not damped:
            scene = replace(scene, method=UNLESS_STIFF)
        whole = variable_table(form, scene)
    check_embedding(form)
    coded = prune.folded_form(coded, fixed)
    numbers = {str(s): n for s, n in coded.equations.numbers.items()}
    made = {"scene": scene, "form": form, "whole": whole, "fixed": fixed}
    return Reduced(**vars(narrowed) | made, coded=coded, numbers=numbers)


def _with_numbers(form: Form, fixed: Mapping[Expr, Expr]) -> Form:
    """With numbers in the equations, for asking what depends on what."""
    return replace(form, equations=prune.folded(form.equations, fixed))


def lower(reduced: Reduced) -> Lowered:
    """To the variables of the FMU, and to numbers."""
    table = reduced.whole
    examined = system = lowered_form(reduced.coded)
    if reduced.coded is not reduced.form:
        table, examined = variable_table(reduced.coded, reduced.scene), lowered_form(reduced.form)
    table = table.keeping(reduced.outputs)
    return Lowered(**vars(reduced), table=table, system=system, examined=examined)


def examine(lowered: Lowered) -> Prepared:
    """Whether and where it starts, its rank and what is redundant."""
    prepared = Prepared(**vars(lowered), structure=examined_structure(lowered))
    return _with_reduced_start(prepared) if lowered.form.reduction is not None else prepared
