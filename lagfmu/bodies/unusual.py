"""What is told of a mechanism that is put together: springs without a direction, radii that are no radii."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from typing import Any

import sympy as sp

from ..errors import LagfmuWarning
from ..model.attitude import written_out
from ..model.elements import Expr, is_number
from ..model.model import Model
from .check_ties import kind_of, value_of
from .draft import Draft
from .loads import SpringDamper
from .motion import between

TOUCHING = 1e-12  # of how far its points are from the origin: they are one


def coinciding(draft: Draft, model: Model, parts: Sequence[Any]) -> list[str]:
    """Springs and dampers whose ends are at one point at the start."""
    known = {p.symbol: sp.sympify(p.value) for p in model.parameters}
    known |= {q: sp.sympify(x) for q, x in model.start.items()}

    def size(vector: Sequence[Expr]) -> float | None:
        found = [written_out(sp.sympify(x)).xreplace(known) for x in vector]
        found = [
            x.xreplace(dict.fromkeys(x.atoms(sp.core.function.AppliedUndef), sp.S.Zero))
            for x in found
        ]
        return math.hypot(*map(float, found)) if all(x.is_number for x in found) else None

    problems = []
    for part in parts:
        if isinstance(part, SpringDamper):
            a, b = draft.placed[part.first], draft.placed[part.second]
            apart, far = size(between(a, b).value), size(b.point)
            if apart is not None and far is not None and apart <= TOUCHING * far:
                problems.append(
                    f"SpringDamper {part.name!r}: its ends are at one point at the start, where its pull has "
                    "no direction: move a marker, or start elsewhere; in a joint use Torsion"
                )
    return problems


def warn_of_radii(draft: Draft, parts: Sequence[Any]) -> None:
    """Pins that are wider than the mechanism is."""
    values = {s: sp.sympify(p.value) for s, p in draft.parameters.items()}
    arms = [x for placed in draft.placed.values() for x in placed.arm]
    numbers = [x.xreplace(values) for x in map(sp.sympify, arms)]
    far = max((abs(float(x)) for x in numbers if x.is_number), default=0.0)
    for part in parts:
        if getattr(part, "friction", None) is None or not hasattr(part, "measures"):
            continue
        radius = value_of(part.radius)
        if far > 0 and is_number(radius) and float(radius) > far:
            warnings.warn(
                f"{kind_of(part)} {part.name!r}: the radius of its pin is {float(radius):g} m, and no marker "
                f"is farther than {far:g} m from the centre of its body: is it in metres?",
                LagfmuWarning,
                stacklevel=3,
            )
