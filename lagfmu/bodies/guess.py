"""A rough place for each body: from the ground along the joints, each as far as it determines a place.

A body whose angle no joint determines starts parallel to the ground.
"""

from __future__ import annotations

import cmath
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..model.model import Model
from .body import Ground
from .draft import Draft
from .rows import Array, numbers_of

Pose = tuple[complex, float]  # of a frame in the plane: where it is [m], and how it is turned [rad]


def guessed(draft: Draft, model: Model, joints: Sequence[Any], given: Mapping[str, float]) -> Array:
    """The coordinates (n) in the order of the model; `given` by the names of the FMU."""
    local = _markers(draft, model)
    known: dict[Any, Pose] = {Ground(): (0j, 0.0)}
    bodies = [b for b in draft.motions if b not in known]
    ties = [j for j in joints if hasattr(j, "relative_pose")]

    def place(body: Any, at: complex, angle: float) -> None:
        x = given.get(f"{body.name}.position.x", at.real)
        y = given.get(f"{body.name}.position.y", at.imag)
        known[body] = complex(x, y), angle

    while len(known) <= len(bodies):
        for joint in ties:
            a, b = joint.first, joint.second
            if (a.body in known) == (b.body in known):
                continue
            turn, reach = joint.relative_pose(draft, model, given)
            forward = a.body in known
            base, free = (a, b) if forward else (b, a)
            p, angle = _frame(known[base.body], local[base])
            own = given.get(f"{free.body.name}.orientation.z")
            if own is None:
                own = 0.0
                if turn is not None:
                    own = angle + (turn if forward else -turn) - local[free][1]
            first = angle if forward else own + local[free][1]
            p += cmath.exp(1j * first) * (reach if forward else -reach)
            place(free.body, p - cmath.exp(1j * own) * local[free][0], own)
            break
        else:
            body = next(b for b in bodies if b not in known)
            place(body, 0j, given.get(f"{body.name}.orientation.z", 0.0))
    return np.array([x for b in bodies for x in (known[b][0].real, known[b][0].imag, known[b][1])])


def _frame(body: Pose, local: Pose) -> Pose:
    return body[0] + cmath.exp(1j * body[1]) * local[0], body[1] + local[1]


def _markers(draft: Draft, model: Model) -> dict[Any, Pose]:
    """Each marker in its body, from the centre of mass."""
    zero = dict.fromkeys(model.coordinates, 0)
    placed = draft.placed
    parts = [
        e.xreplace(zero) if hasattr(e, "xreplace") else e
        for p in placed.values()
        for e in (*p.point[:2], p.angle)
    ]
    found = numbers_of(model, parts).reshape(-1, 3).tolist()
    return {m: (complex(x, y), angle) for m, (x, y, angle) in zip(placed, found, strict=True)}
