"""How a mechanism looks: each body by its markers and its centre of mass."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import sympy as sp

from ..model.attitude import written_out
from ..model.picture import Disk, Line, Rod
from .body import Ground
from .draft import Draft
from .vectors import Vector


def picture_of(draft: Draft) -> list[Any]:
    """Rods between the markers of a body (from the centre of mass where there is one marker), dots on the
    ground and at centres of mass."""

    def drawn(point: Vector) -> tuple[Any, ...]:
        return tuple(written_out(sp.sympify(x)) for x in point[: len(draft.components)])

    points: dict[Any, list[Any]] = defaultdict(list)
    for placed in draft.placed.values():
        at = drawn(placed.point)
        if at not in points[placed.body]:
            points[placed.body].append(at)
    shapes: list[Any] = [Disk(at) for at in points.pop(Ground(), [])]
    for body, ends in points.items():
        center = drawn(draft.motions[body].position)
        if len(ends) == 2:
            shapes.append(Rod(*ends))
        elif len(ends) > 2:
            shapes.append(Line(*ends, ends[0]))
        elif ends != [center]:
            shapes.append(Rod(center, ends[0]))
        shapes.append(Disk(center))
    return shapes
