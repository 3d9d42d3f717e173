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

from ..errors import ModelError
from ..interface.variables import VariableTable
from ..mechanics.form import Form
from ..model.model import Model
from ..names import motion
from ..numeric.instant import at_start, expanded
from ..numeric.start import Start
from ..numeric.system import System
from .consistency import Structure, values_at_start
from .starts import ALLOWED, StartMovedWarning, check_given


def misses(
    form: Form,
    table: VariableTable,
    system: System,
    numbers: Mapping[Any, Any],
    begun: Start,
    wanted: Mapping[str, float],
) -> dict[str, tuple[float, float]]:
    """The values `wanted` that the form, which begins with `begun`, does not begin with, by name: as given,
    and as it begins."""
    eom = form.equations
    if form.reduction is None or not wanted:
        return {}
    u, p = values_at_start(eom, table, numbers)
    at, q, v = expanded(at_start(system, begun.q, u, p), begun.q, begun.v)
    full = at.system
    has = dict(zip(motion(full.coordinates), [*q.tolist(), *v.tolist()], strict=True))
    n = full.n
    size = dict.fromkeys(motion(full.coordinates)[:n], np.abs(q).max(initial=0.0))
    size |= dict.fromkeys(motion(full.coordinates)[n:], np.abs(v).max(initial=0.0))
    found = {}
    for name, given in wanted.items():
        if name in has and abs(has[name] - given) > ALLOWED * max(abs(given), size[name]):
            found[name] = (given, has[name])
    return found


def told_apart(form: Form, missed: Mapping[str, Any]) -> bool:
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
        stacklevel=4,
    )
    return True


def restarted(model: Model, form: Form, structure: Structure, missed: Mapping[str, Any]) -> Model:
    """The model whose `start` names the independent coordinates alone, from where the constraints put it.

    `structure`: that of the full form.  Warns of it.  Raises ModelError where `start` misses the constraints.
    """
    reduction, eom = form.reduction, form.equations
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
    begun = structure.start
    check_given(model.name, begun.moved, structure.missed)
    names = motion([str(eom.symbols[q]) for q in model.coordinates])
    values = dict(zip(names, [*begun.q.tolist(), *begun.v.tolist()], strict=True))
    start = {own[n]: float(values[n]) for n in stepped}
    follow = ", ".join(f"{n} = {values[n]!r}" for n in stepped if values[n])
    warnings.warn(
        f"start gives {told}, which follows from {', '.join(map(str, reduction.s))}: the minimal "
        f"formulation begins with {follow or 'zeros'}",
        StartMovedWarning,
        stacklevel=4,
    )
    return replace(model, start=start)


def check_branch(model: Model, missed: Mapping[str, Any]) -> None:
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
