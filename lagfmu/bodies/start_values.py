"""What `start` may name, and what it says: names of the FMU, with a value for each component."""

from __future__ import annotations

import difflib
import re
import warnings
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import sympy as sp

from ..errors import LagfmuWarning, ModelError
from ..model.elements import TIME, Expr, is_number, name_of
from ..model.model import Model
from ..names import derivative
from .body import Body
from .draft import Draft
from .rotation import given_rotation, quaternion
from .rows import Array

ROUNDED = 1e-3  # of the norm of a quaternion that was written with few digits


class GivenStartWarning(LagfmuWarning):
    """A start value that was given, and cannot be."""


class Beginning(NamedTuple):
    """What may begin somewhere: its value and its rate; `of_velocities`: the rate is what begins."""

    value: Expr
    rate: Expr
    of_velocities: bool


def known_names(draft: Draft, model: Model) -> dict[str, Beginning]:
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


def given_values(
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
