"""How a mechanism looks: its bodies, in space its joints and springs, and the forces of its joints."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import sympy as sp

from ..model.closed_form import output
from ..model.elements import Expr, Parameter
from ..model.picture import (
    Arrow,
    Box,
    Direction,
    Disk,
    Frame,
    Line,
    Pivot,
    Rod,
    Shape,
    Sphere,
    Spring,
    Track,
)
from .body import Ground, Marker
from .curves import PointOnCurve
from .draft import Draft
from .joints import Distance, Joint, Universal
from .loads import Gravity, SpringDamper
from .motion import Motion, Placed
from .solid import holds, solid
from .vectors import AXES, Vector, plus, times

CARRIED = (Box, Rod, Sphere, Disk, Line, Spring)
LARGEST = 3.0  # times the farthest distance of a marker from its body's centre: the solid of a body


def picture_of(draft: Draft, parts: Sequence[Any]) -> list[Shape]:
    """The shapes: a body without one is, in the plane, a rod between its markers (from the centre of mass
    where there is one), in space the solid of its inertia, with rods to its markers."""
    planar = len(draft.components) == 2
    reach = LARGEST * max((_far(draft, p) for p in draft.placed.values()), default=0.0)
    markers: dict[Any, list[Placed]] = defaultdict(list)
    for placed in draft.placed.values():
        markers[placed.body].append(placed)
    grounds = {id(m.body): m.body for m in draft.placed if isinstance(m.body, Ground)}
    shapes: list[Any] = []
    if planar:
        shapes += map(Disk, _points(draft, markers[Ground()]))
    for body in (*grounds.values(), *(b for b in draft.motions if b != Ground())):
        motion = draft.motions[body]
        if body.shape is not None:
            shapes += [_carried(draft, motion, shape) for shape in shapes_of(body)]
        elif isinstance(body, Ground):
            continue
        elif planar:
            shapes += _flat(_points(draft, markers[body]), _drawn(draft, motion.position))
        else:
            shapes += _in_space(draft, motion, markers[body], reach)
    for part in parts:
        shapes += [] if planar else _of_part(draft, part)
        shapes += [_curve(draft, part)] if isinstance(part, PointOnCurve) else []
    shapes += [Frame(_drawn(draft, p.point), _turn(draft, p)) for p in draft.readings.values()]
    for part in parts:
        if part.name in draft.wrenches and isinstance(getattr(part, "second", None), Marker):
            shapes.append(_force(draft, part))
    return shapes


def _curve(draft: Draft, part: PointOnCurve) -> Track:
    """In the frame of its first marker."""
    first, (_, over, (begin, end), _) = draft.placed[part.first], part.along()
    at = first.point
    for length, axis in zip(part.lengths(draft), first.axes, strict=False):
        at = plus(at, times(length, axis.value))
    return Track(_drawn(draft, at), over, begin, end)


def shapes_of(body: Any) -> Sequence[Any]:
    """The shapes that were given to it."""
    given = () if body.shape is None else body.shape
    return given if isinstance(given, Sequence) else [given]


def _drawn(draft: Draft, vector: Vector) -> tuple[Any, ...]:
    return tuple(sp.sympify(x) for x in vector[: len(draft.components)])


def _points(draft: Draft, markers: Sequence[Placed]) -> list[tuple[Any, ...]]:
    """Where markers are, each place once."""
    return list(dict.fromkeys(_drawn(draft, placed.point) for placed in markers))


def _flat(ends: Sequence[Any], center: Any) -> Iterator[Shape]:
    """A body of the plane by its markers."""
    if len(ends) == 2:
        yield Rod(*ends)
    elif len(ends) > 2:
        yield Line(*ends, ends[0])
    elif ends and ends != [center]:
        yield Rod(center, ends[0])
    yield Disk(center)


def _value(draft: Draft, expression: Any) -> float | None:
    """With the parameters' own values; None for what is no number then."""
    if isinstance(expression, Parameter):
        return float(expression.value)
    found = sp.sympify(expression)
    known = found.free_symbols & draft.parameters.keys()
    found = found.xreplace({s: sp.sympify(draft.parameters[s].value) for s in known})
    return float(found) if found.is_number else None


def _far(draft: Draft, placed: Placed) -> float:
    """How far a marker is from its body's centre of mass [m]."""
    if isinstance(placed.body, Ground):
        return 0.0
    return float(np.linalg.norm([_value(draft, x) or 0.0 for x in placed.arm]))


def _in_space(
    draft: Draft, motion: Motion, markers: Sequence[Placed], reach: float
) -> Iterator[Shape]:
    """The solid of a body's inertia, and rods to the markers that are not on it."""
    body, at = motion.body, _drawn(draft, motion.position)
    J, center = [*body.inertia, 0.0, 0.0, 0.0][:6], body.center or (0.0, 0.0, 0.0)
    mass, *numbers = (_value(draft, x) for x in (body.mass, *J, *center))
    known = [x for x in numbers if x is not None]
    found = None
    if mass is not None and len(known) == len(numbers):
        found = solid(mass, known[:6], known[6:], reach)
        yield _carried(draft, motion, found)
    for placed in markers:
        arm = [x for x in (_value(draft, x) for x in placed.arm) if x is not None]
        on_it = found is not None and len(arm) == 3 and holds(found, np.add(arm, known[6:]))
        if not on_it and arm != [0.0, 0.0, 0.0]:
            yield Rod(at, _drawn(draft, placed.point))


def _carried(draft: Draft, motion: Motion, shape: Any) -> Shape:
    """A shape in the frame of a body, where that is."""

    def placed(point: Any, rotation: Any = None) -> Placed:
        x, y, z = [*map(sp.sympify, point), sp.S.Zero][:3]
        return motion.placed(motion.body.at(point, rotation=rotation), (x, y, z))

    def there(point: Any) -> tuple[Any, ...]:
        return _drawn(draft, placed(point).point)

    if isinstance(shape, Line):
        return Line(*map(there, shape.points), length=shape.length)
    if isinstance(shape, Rod | Spring):
        return replace(shape, start=there(shape.start), end=there(shape.end))
    if isinstance(shape, Box):
        turn = _turn(draft, placed(shape.center, shape.rotation))
        return Box(there(shape.center), shape.size, turn)
    if isinstance(shape, Disk) and len(draft.components) == 2:
        angle = placed(shape.center).angle + (shape.angle or 0)
        return replace(shape, center=there(shape.center), angle=angle)
    found: Shape = replace(shape, center=there(shape.center))
    return found


def _turn(draft: Draft, placed: Placed) -> Any:
    """An angle in the plane; in space the matrix whose columns are its axes."""
    if len(draft.components) == 2:
        return placed.angle
    return sp.Matrix(3, 3, lambda i, k: placed.axes[k].value[i])


def _of_part(draft: Draft, part: Any) -> Iterator[Shape]:
    """A joint, a rod without mass, a spring, the direction of gravity, in space."""
    if isinstance(part, Gravity):
        yield Direction(part.name, _drawn(draft, draft.gravity[part.name]))
    if not isinstance(part, Joint | Distance | SpringDamper):
        return
    first, second = draft.placed[part.first], draft.placed[part.second]
    at, to = _drawn(draft, first.point), _drawn(draft, second.point)
    if isinstance(part, Distance):
        yield Rod(at, to)
    elif isinstance(part, SpringDamper):
        yield Spring(at, to)
    elif isinstance(part, Joint):
        yield from _pivots(draft, part, first, second)


def _pivots(draft: Draft, joint: Joint, first: Placed, second: Placed) -> Iterator[Pivot]:
    """A pin about the axis of a hinge, a sleeve along that of a slide, a plate on a plane, else a ball."""
    a = AXES.index(joint.axis or joint.usual[1])
    axis, other = _drawn(draft, first.axes[a].value), _drawn(draft, second.point)
    if isinstance(joint, Universal):
        b = AXES.index(joint.second_axis)
        yield Pivot(other, axis)
        yield Pivot(other, _drawn(draft, second.axes[b].value))
    elif joint.slides:
        yield Pivot(other, axis, "sleeve" if joint.slides == "along" else "plate")
    elif joint.turns == "about":
        yield Pivot(other, axis)
    elif joint.turns:
        yield Pivot(other)


def _force(draft: Draft, part: Any) -> Arrow:
    """What the second body receives, of components along the axes of the first marker."""
    first, second = draft.placed[part.first], draft.placed[part.second]
    force = [output(f"force.{part.name}.{x}") for x in draft.components]
    along: Expr = tuple(
        sp.Add(*(f * axis.value[k] for f, axis in zip(force, first.axes, strict=False)))
        for k in range(3)
    )
    return Arrow(part.name, _drawn(draft, second.point), force=_drawn(draft, along))
