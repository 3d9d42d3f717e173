"""How a mechanism looks: each body by its markers and its centre of mass."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import sympy as sp

from ..model.attitude import written_out
from ..model.closed_form import output
from ..model.picture import Arrow, Disk, Line, Rod
from .body import Ground, Marker
from .draft import Draft
from .vectors import Vector


def picture_of(draft: Draft, parts: Sequence[Any]) -> list[Any]:
    """Rods between the markers of a body (from the centre of mass where there is one marker), dots on the
    ground and at centres of mass, the force that the second body receives through each joint."""

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
    for part in parts:
        if part.name in draft.wrenches and isinstance(getattr(part, "second", None), Marker):
            first, second = draft.placed[part.first], draft.placed[part.second]
            force = [output(f"force.{part.name}.{x}") for x in draft.components]
            axes = [axis.value for axis in first.axes]
            along = tuple(
                sp.Add(*(f * axis[k] for f, axis in zip(force, axes, strict=False)))
                for k in range(3)
            )
            shapes.append(Arrow(part.name, drawn(second.point), force=drawn(along)))
    return shapes
