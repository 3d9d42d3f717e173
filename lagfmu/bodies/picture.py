"""How a mechanism of the plane looks: each body by its markers, each joint by its force."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

from ..model.picture import Disk, Line, Rod
from .body import Ground
from .draft import Draft


def picture_of(draft: Draft) -> list[Any]:
    """Rods between the markers of a body (from the centre of mass where there is one marker), dots on the
    ground, springs."""
    points: dict[Any, list[Any]] = defaultdict(list)
    for placed in draft.placed.values():
        at = placed.point[:2]
        if at not in points[placed.body]:
            points[placed.body].append(at)
    shapes: list[Any] = [Disk(at) for at in points.pop(Ground(), [])]
    for body, ends in points.items():
        center = draft.motions[body].position[:2]
        if len(ends) == 2:
            shapes.append(Rod(*ends))
        elif len(ends) > 2:
            shapes.append(Line(*ends, ends[0]))
        elif ends != [center]:
            shapes.append(Rod(center, ends[0]))
        shapes.append(Disk(center))
    return shapes
