"""A model in a scene -> all that is known about it before anything is packaged, in five steps."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace

from ..codegen.py.equations import compile_system, source
from ..codegen.py.equations import lower as lowered_form
from ..errors import LagfmuWarning, RequestError
from ..interface.table import named, variable_table
from ..mechanics import formulations, prune
from ..mechanics.derive import derive as derive_equations
from ..mechanics.equations import EquationsOfMotion
from ..mechanics.formulations import Form
from ..mechanics.jumps import with_jumps
from ..methods import AUTO, UNLESS_STIFF
from ..model.elements import Expr, unused
from ..model.model import Model, stuck
from ..model.scene import Scene
from .consistency import check_embedding, examined_structure
from .reduced_start import with_reduced_start
from .request import formulated
from .steps import Derived, Lowered, Narrowed, Reduced, Request
from .steps import Prepared as Prepared


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
    asked = formulated(derived, acting, problems)
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
    """To the variables of the FMU, and to numbers: the equations as the text of a Python module."""
    table = reduced.whole
    text = source(reduced.coded)
    examined = system = compile_system(text)
    if reduced.coded is not reduced.form:
        table, examined = variable_table(reduced.coded, reduced.scene), lowered_form(reduced.form)
    table = table.keeping(reduced.outputs)
    return Lowered(**vars(reduced), table=table, text=text, system=system, examined=examined)


def examine(lowered: Lowered) -> Prepared:
    """Whether and where it starts, its rank and what is redundant."""
    prepared = Prepared(**vars(lowered), structure=examined_structure(lowered))
    return with_reduced_start(prepared) if lowered.form.reduction is not None else prepared
