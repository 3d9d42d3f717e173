"""A start in coordinates that a reduced form does not step -> the start of those that it does.

`minimal` steps the independent coordinates s of q = phi(s, t). The model's `start` may name any of q: the
start is then the one that the constraints make of it, as with multipliers, and s begins there.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ..errors import CannotStartError, ModelError
from ..interface.table import variable_table
from ..mechanics.formulations import Form
from ..model.model import Model
from ..names import motion
from ..numeric.instant import at_start, expanded
from .consistency import posed, structure_of, whole
from .starts import ALLOWED, StartMovedWarning, check_given
from .steps import Prepared, Structure


def with_reduced_start(value: Prepared) -> Prepared:
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
