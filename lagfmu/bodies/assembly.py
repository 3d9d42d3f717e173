"""Where a mechanism begins: rough places and joint coordinates -> positions that satisfy every joint.

Newton's method with the least movement in the metric of M, damped by halving,

    minimize  d^T M d   with   f(q) + f_q d = 0 ,   then   minimize  (v - v0)^T M (v - v0)   with   G v = nu ,

at first with all that was given held by rows of its own; if that cannot be closed, given values move too, and
each that does is told with both numbers.

What `start` may name, and what it says: names of the FMU, with a value for each component.
"""

from __future__ import annotations

import difflib
import math
import re
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import sympy as sp
from sympy.core.function import AppliedUndef

from ..errors import LagfmuWarning, ModelError
from ..model.elements import TIME, Contact, Expr, Holonomic, Nonholonomic, is_number, name_of
from ..model.model import Model
from ..names import derivative
from .body import Body, given_rotation, quaternion
from .draft import Draft
from .guess import guessed
from .moving import CLOSED, has_loop, is_small, moving_of, other_angles, tell_second_branch
from .rows import Array, Rows, condition
from .unclosed import Nearest, left_open, parallel, turned_over, unfollowed

ROUNDED = 1e-3  # of the norm of a quaternion that was written with few digits


class GivenStartWarning(LagfmuWarning):
    """A start value that was given, and cannot be."""


class Beginning(NamedTuple):
    """What may begin somewhere: its value and its rate; `of_velocities`: the rate is what begins."""

    value: Expr
    rate: Expr
    of_velocities: bool


def _known_names(draft: Draft, model: Model) -> dict[str, Beginning]:
    """By their names in the FMU."""
    found: dict[str, Beginning] = {}
    for q in model.coordinates:
        rate = model.kinematics.get(q, q.diff(TIME))
        found[name_of(q)] = Beginning(q, rate, False)
        found[derivative(name_of(q))] = Beginning(sp.S.Zero, rate, True)
    found |= {name_of(w): Beginning(sp.S.Zero, w, True) for w in model.speeds}
    for of in draft.relative.values():
        value, rate, _ = of.values
        found[of.name] = Beginning(value, rate, False)
        found[derivative(of.name)] = Beginning(sp.S.Zero, rate, True)
    for name, at in draft.readings.items():
        parts = zip(draft.components, at.origin.value, at.origin.rate, strict=False)
        found |= {f"{name}.position.{x}": Beginning(value, rate, False) for x, value, rate in parts}
    moving = re.compile(r"\w+\.(velocity|omega)\.\w")
    outputs = (o for o in draft.outputs if moving.fullmatch(o.name))
    return found | {o.name: Beginning(sp.S.Zero, o.expression, True) for o in outputs}


def _given_values(
    draft: Draft, model: Model, known: Mapping[str, Any], start: Mapping[str, Any]
) -> dict[str, float]:
    """Each component by itself.  Raises ModelError for names and values that cannot be."""
    found: dict[str, float] = {}
    problems = []
    turns = _turns(draft)
    for name, value in start.items():
        if name in turns:
            if not isinstance(value, Sequence) or len(value) != 3 or not all(map(is_number, value)):
                problems.append(
                    f"start of {name!r} is {value!r}, expected three numbers: roll, pitch and yaw in rad"
                )
                continue
            body, own = turns[name]
            R = given_rotation(("rpy", *value)) @ own.T
            if any(n.startswith(f"{body}.orientation") for n in (*found, *start)):
                problems.append(
                    f"start: the attitude of {body!r} is given twice, by {name!r} and another: leave out one"
                )
            name, value = f"{body}.orientation", quaternion(R).tolist()
        parts = [n for n in known if n.startswith(f"{name}.")]
        values = [value] if name in known else value
        if name not in known and not parts:
            near = difflib.get_close_matches(str(name), [*known, *turns], 1)
            problems.append(
                f"start names {name!r}, which has no start of its own, expected a coordinate, the angle or "
                f"the position of a joint, or a rate of these{f'; did you mean {near[0]!r}?' if near else ''}"
            )
        elif not isinstance(values, Sequence) or len(values) != len(parts or values):
            problems.append(f"start of {name!r} is {value!r}, expected {len(parts)} numbers")
        elif not all(map(is_number, values)):
            problems.append(f"start of {name!r} is {value!r}, expected finite numbers")
        else:
            names = [name] if name in known else parts
            norm = float(np.linalg.norm(values)) if len(parts) == 4 else 1.0
            if norm == 0:
                problems.append(f"start of {name!r} is {value!r}, expected a quaternion of norm 1")
                continue
            taken = {n: float(x) / norm for n, x in zip(names, values, strict=True)}
            if abs(norm - 1) > ROUNDED:
                warnings.warn(
                    f"model {model.name!r}: start of {name} = {value!r} has the norm {norm:.6g}, expected 1: "
                    f"it begins at {(*taken.values(),)!r}",
                    GivenStartWarning,
                    stacklevel=5,
                )
            found |= taken
    if problems:
        raise ModelError(model.name, problems)
    return found


def _turns(draft: Draft) -> dict[str, tuple[str, Array]]:
    """In space b.rpy, of a body or of a marker that is read: the body, and its axes in that (3, 3)."""
    if len(draft.components) == 2:
        return {}
    upright = np.eye(3)
    found = {f"{b.name}.rpy": (b.name, upright) for b in draft.motions if isinstance(b, Body)}
    for name, at in draft.readings.items():
        found[f"{name}.rpy"] = at.body.name, np.array(at.own_axes, dtype=float).T
    return found


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
    known = _known_names(draft, model)
    given = _given_values(draft, model, known, start)
    hints = _given_values(draft, model, known, near)
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
