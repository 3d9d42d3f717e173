"""Where a mechanism begins: rough places and joint coordinates -> positions that satisfy every joint.

Newton's method with the least movement in the metric of M, damped by halving,

    minimize  d^T M d   with   f(q) + f_q d = 0 ,   then   minimize  (v - v0)^T M (v - v0)   with   G v = nu ,

at first with all that was given held by rows of its own; if that cannot be closed, given values move too, and
each that does is told with both numbers.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import sympy as sp
from sympy.core.function import AppliedUndef

from ..errors import ModelError
from ..model.elements import Contact, Expr, Holonomic, Nonholonomic
from ..model.model import Model
from ..names import derivative
from .branches import CLOSED, has_loop, is_small, other_angles, tell_second_branch
from .draft import Draft
from .guess import guessed
from .moving import moving_of
from .nearest import Nearest
from .rows import Array, Rows, condition
from .start_values import Beginning, GivenStartWarning, given_values, known_names
from .unclosed import left_open, parallel, turned_over, unfollowed

EPS = float(np.finfo(float).eps)


@np.errstate(all="ignore")  # what is not finite is told
def assemble(
    draft: Draft,
    model: Model,
    parts: Sequence[Any],
    start: Mapping[str, Any],
    near: Mapping[str, Any],
) -> tuple[dict[Expr, float], list[Expr], dict[str, tuple[float, bool]]]:
    """The start of each coordinate and velocity, in SI, and those of them that nothing given speaks of; then
    that of each joint coordinate that is free, and of its rate, and whether it is given.

    Raises ModelError if a name is unknown, or the joints cannot be closed.
    """
    known = known_names(draft, model)
    given = given_values(draft, model, known, start)
    hints = given_values(draft, model, known, near)
    places = {n: x for n, x in given.items() if not known[n].of_velocities}
    rates = {n: x for n, x in given.items() if known[n].of_velocities}
    acting = [
        c
        for c in model.constraints
        if not (isinstance(c, Contact) or c.while_closed or c.name in model.limited)
    ]
    closing = [c for c in acting if isinstance(c, Holonomic)]
    rolling = [c for c in acting if isinstance(c, Nonholonomic)]
    f = Rows(model, [condition(model, c) for c in closing])
    held = Rows(model, [known[n][:2] for n in places])
    wanted = np.concatenate([np.zeros(len(closing)), np.array([*places.values()])])
    moving = moving_of(draft, model)
    rough = moving.tied(guessed(draft, model, parts, {**hints, **places}), {**hints, **places})
    if problems := list(parallel(closing, f.values(rough))):
        raise ModelError(model.name, problems)
    size = moving.sized(rough)
    measures = {n: of.values[0] for n, of in draft.relative.items() if n not in places}

    def from_other_angles() -> Iterator[tuple[Array, Array]]:
        for angles in other_angles(measures):
            put = guessed(draft, model, parts, {**angles, **places})
            yield moving.newton([f, held], wanted, moving.tied(put, places), CLOSED)

    q, missed = moving.newton([f, held], wanted, rough)
    at_once = missed.max(initial=0.0) <= CLOSED
    if not at_once:
        q, missed = moving.closed([f, held], wanted, rough)
    if missed.max(initial=0.0) > CLOSED:
        begun = [(q, missed), *from_other_angles(), (rough, missed)]
        q, missed = min(begun, key=lambda found: float(found[1].max(initial=0.0)))
        if missed.max(initial=0.0) > CLOSED:
            starts = [found for found, _ in begun]
            q, missed = Nearest(moving, [f], held, np.array([*places.values()])).places(starts)
    if missed.max(initial=0.0) > CLOSED:
        problems = list(turned_over(moving, closing, f.values(q), q))
        problems += list(unfollowed(draft, model, parts, moving, closing, starts))
        raise ModelError(model.name, problems or list(left_open(closing, f.values(q), missed)))
    _tell(model, places, held.values(q), size)
    _tell_beyond_limits(model, draft, parts, q)
    if is_small(draft) and (has_loop(draft, parts) or not at_once):
        told = {
            n: e
            for n, e in measures.items()
            if n not in hints
            and moving.determines([f, held], q, Rows(model, [draft.relative[n].values[:2]]))
        }
        others = from_other_angles() if at_once else moving.closed_about([f, held], wanted, rough)
        tell_second_branch(model, told, others, rough, q)

    still = [f, Rows(model, [condition(model, c) for c in rolling])]
    driven = Rows(model, [known[n][:2] for n in rates])
    asked = np.concatenate([np.zeros(len(acting)), np.array([*rates.values()])])
    v = moving.velocities([*still, driven], asked, q, np.zeros(len(model.directions)))
    v = moving.velocities(still, np.zeros(len(acting)), q, v)
    if struck := _struck(model, q, v, size):
        still.append(Rows(model, [condition(model, c) for c in struck]))
        v = moving.velocities(still, np.zeros(len(acting) + len(struck)), q, v)
    found = driven.rates(q, v)
    fastest = float(np.abs(found).max(initial=0.0))
    if (np.abs(found - [*rates.values()]) > CLOSED * fastest).any():
        v = Nearest(moving, still, driven, np.array([*rates.values()])).velocities(q, v)
        found = driven.rates(q, v)
    _tell(model, rates, found, float(np.abs(found).max(initial=0.0)))
    fast = float(np.abs(v / moving.scale).max(initial=0.0))
    rounding = 4 * EPS * np.concatenate([np.full(len(q), size), moving.scale * fast])
    begins = {
        s: float(x) if abs(x) > least else 0.0
        for s, x, least in zip(model.states, (*q, *v), rounding, strict=True)
    }
    said = _spoken_of(model, known, given)
    left = [s for s in model.states if s not in said]
    return begins, left, _of_joints(draft, model, given, q, v)


def _of_joints(
    draft: Draft, model: Model, given: Mapping[str, float], q: Array, v: Array
) -> dict[str, tuple[float, bool]]:
    """The start of each joint coordinate that no motor prescribes, and of its rate, and whether it is given:
    then as it is given, but for rounding."""
    free = {n: of.values[:2] for n, of in draft.relative.items() if n not in draft.driven}
    rows = Rows(model, [*free.values()])
    found = dict(zip(free, rows.values(q).tolist(), strict=True))
    found |= dict(zip(map(derivative, free), rows.rates(q, v).tolist(), strict=True))
    as_given = {n: given[n] for n, x in found.items() if n in given and math.isclose(x, given[n])}
    return {n: (as_given.get(n, x), n in given) for n, x in found.items()}


def _spoken_of(model: Model, known: Mapping[str, Beginning], given: Iterable[str]) -> set[Expr]:
    """The coordinates of which given values are made, the velocities of which given rates are."""
    places, found = list(model.coordinates), set()
    for of in map(known.__getitem__, given):
        symbols = (of.rate if of.of_velocities else of.value).atoms(AppliedUndef, sp.Derivative)
        found |= symbols - {*places} if of.of_velocities else symbols
    turned = (model.unwrapped[q].atoms(AppliedUndef) for q in found & model.unwrapped.keys())
    return found.union(*turned)


def _struck(model: Model, q: Array, v: Array, size: float) -> list[Contact]:
    """The contacts that touch at q and would be run into with v: they begin closed, without a blow."""
    contacts = [c for c in model.constraints if isinstance(c, Contact)]
    gaps = Rows(model, [condition(model, c) for c in contacts])
    found = zip(contacts, gaps.values(q), gaps.rates(q, v), strict=True)
    return [c for c, gap, rate in found if abs(gap) <= CLOSED * size and rate < 0]


def _tell_beyond_limits(model: Model, draft: Draft, parts: Sequence[Any], q: Array) -> None:
    """Joints that were assembled beyond a limit, with how to choose another place."""
    for part in parts:
        if getattr(part, "limits", None) is None:
            continue
        name = part.measures[0]
        stops = [model.constraint(f"{part.name}.{end}").expression for end in ("lower", "upper")]
        places = [draft.relative[name].values[0], *stops]
        value, *gaps = Rows(model, [(place, sp.S.Zero) for place in places]).values(q)
        if min(gaps) < -CLOSED:
            warnings.warn(
                f"model {model.name!r}: {name} is assembled at {float(value)!r}, beyond its limits: give "
                f"{name!r} a start within them; without one it is moved to a limit, or the start is refused",
                GivenStartWarning,
                stacklevel=5,
            )


def _tell(model: Model, given: Mapping[str, float], found: Array, size: float) -> None:
    """Given values that had to move, with both numbers."""
    for (name, asked), is_now in zip(given.items(), found.tolist(), strict=True):
        if abs(is_now - asked) > CLOSED * max(abs(asked), size):
            told = is_now if abs(is_now) > CLOSED * abs(asked) else 0.0
            warnings.warn(
                f"model {model.name!r}: the joints do not allow the given start {name} = {asked!r}, alone "
                f"or with the other given values: the mechanism starts with {name} = {told:.9g} instead",
                GivenStartWarning,
                stacklevel=5,
            )
