"""How a mechanism looks: its bodies, its joints and loads, and the forces of its joints.

The uniform solid that has the mass and the inertia of a body: what is drawn of one without a shape.

    sphere    J = 2/5 m r^2
    cylinder  J along its axis m r^2/2, across it m (3 r^2 + h^2)/12
    box       J about x m (b^2 + c^2)/12, and so on

All three principal moments equal make it a sphere, two of them a cylinder.  The triangle inequality, which
every tensor of inertia satisfies, is that h^2, a^2, b^2, c^2 >= 0.
"""

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
from .contacts import Contact, PointOnCurve
from .draft import Draft
from .joints import Distance, Gear, Joint, Rolling
from .loads import Gravity, Motor, SpringDamper, Torsion
from .motion import AXES, Motion, Placed, Vector, dot, minus, plus, times

EQUAL = 1e-6  # relative, of two principal moments
THIN = 0.02  # of its largest side: the least that is drawn of another

NEXT = 1.1  # times its size: what is next to a solid


def solid(
    mass: float, inertia: Sequence[float], center: Any, reach: float
) -> Box | Rod | Sphere | None:
    """The solid about `center` [m] of a body of `mass` [kg] with the inertia xx, yy, zz, xy, xz, yz [kg.m^2].

    One that is larger than `reach` [m], which the mechanism's dimensions suggest, is drawn smaller in
    proportion; 0 says nothing.  A mass without inertia is a small sphere; without mass there is none.
    """
    xx, yy, zz, xy, xz, yz = inertia
    J, axes = np.linalg.eigh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    J = np.maximum(J, 0.0)  # of a line one is rounding
    if np.linalg.det(axes) < 0:
        axes[:, 0] *= -1
    center = np.array(center, dtype=float)
    if not mass > 0 or not J[2] > 0:
        return Sphere(tuple(center), THIN * reach) if mass > 0 and reach > 0 else None
    near = EQUAL * J[2]
    if J[2] - J[0] < near:
        return Sphere(tuple(center), _within(np.sqrt(10 * J / mass), reach)[0] / 2)
    if min(J[1] - J[0], J[2] - J[1]) < near:
        odd = 2 if J[1] - J[0] < near else 0
        h = np.sqrt(max(12 * J[1] - 6 * J[odd], 0.0) / mass)
        h, width = _within(np.array([h, np.sqrt(8 * J[odd] / mass)]), reach)
        half = axes[:, odd] * h / 2
        return Rod(tuple(center - half), tuple(center + half), width / 2)
    size = np.sqrt(np.maximum(6 / mass * (J.sum() - 2 * J), 0.0))
    return Box(tuple(center), tuple(_within(size, reach)), axes.tolist())


def _holds(found: Box | Rod | Sphere, point: Any) -> bool:
    """Whether a point of the body is in that solid, or next to it."""
    if isinstance(found, Box):
        arm = np.array(found.rotation).T @ (np.array(point) - found.center)
        return bool((np.abs(arm) <= NEXT * np.array(found.size) / 2).all())
    if isinstance(found, Sphere):
        return bool(np.linalg.norm(np.array(point) - found.center) <= NEXT * found.radius)
    start, end, r = np.array(found.start), np.array(found.end), float(found.radius or 0)
    half = (end - start) / 2
    arm = np.array(point) - (start + end) / 2
    along = float(arm @ half) / float(np.linalg.norm(half))
    across = np.sqrt(max(float(arm @ arm) - along**2, 0.0))
    return bool(abs(along) <= NEXT * np.linalg.norm(half) and across <= NEXT * r)


def _within(sizes: Any, reach: float) -> list[float]:
    """Numbers of which none is much smaller than the largest, nor that one larger than the reach."""
    largest = float(sizes.max())
    shrunk = min(1.0, reach / largest) if reach > 0 else 1.0
    found: list[float] = (shrunk * np.maximum(sizes, THIN * largest)).tolist()
    return found


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
        surfaces = {id(p.first) for p in parts if isinstance(p, Contact | Rolling | PointOnCurve)}
        held = [p for m, p in draft.placed.items() if id(m) not in surfaces]
        shapes += map(Pivot, _points(draft, [p for p in held if isinstance(p.body, Ground)]))
    for part in parts:
        shapes += _touching(draft, part) if isinstance(part, Contact | Rolling) else []
    for body in (*grounds.values(), *(b for b in draft.motions if b != Ground())):
        motion = draft.motions[body]
        if body.shape is not None:
            shapes += [_carried(draft, motion, shape) for shape in shapes_of(body)]
        elif isinstance(body, Ground):
            continue
        elif planar:
            shapes += _flat(draft, motion, markers[body])
        else:
            shapes += _in_space(draft, motion, markers[body], reach)
    for part in parts:
        shapes += _of_part(draft, part)
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


def _flat(draft: Draft, motion: Motion, markers: Sequence[Placed]) -> Iterator[Shape]:
    """A body of the plane by its markers, each place once: a rod, or where they are on no line their hull's
    outline."""
    places: dict[tuple[float, ...], tuple[Any, ...]] = {}
    for placed in markers:
        arm = tuple(round(_value(draft, x) or 0.0, 12) for x in placed.arm[:2])
        places.setdefault(arm, _drawn(draft, placed.point))
    center = _drawn(draft, motion.position)
    if len(places) == 1 and (0.0, 0.0) not in places:
        places[0.0, 0.0] = center
    outline = _hull(sorted(places))
    if len(outline) == 2:
        yield Rod(*(places[arm] for arm in outline))
    elif len(outline) > 2:
        yield Line(*(places[arm] for arm in (*outline, outline[0])))
    yield from (Pivot(at) for arm, at in places.items() if len(outline) > 2 or arm not in outline)
    yield Disk(center)


def _hull(points: Sequence[tuple[float, ...]]) -> list[tuple[float, ...]]:
    """Corners of the convex hull of sorted points, counterclockwise; both ends of points on a line."""

    def half(way: Sequence[tuple[float, ...]]) -> list[tuple[float, ...]]:
        found: list[tuple[float, ...]] = []
        for p in way:
            while len(found) > 1 and _turn_at(found[-2], found[-1], p) <= 0:
                found.pop()
            found.append(p)
        return found[:-1]

    return [*half(points), *half(points[::-1])] if len(points) > 1 else list(points)


def _turn_at(a: Sequence[float], b: Sequence[float], c: Sequence[float]) -> float:
    """Positive where a, b, c turn to the left by more than rounding, else 0 or less."""
    u, v = np.subtract(b, a), np.subtract(c, b)
    size = float(np.hypot(*u) * np.hypot(*v))
    turn = float(u[0] * v[1] - u[1] * v[0])
    return turn if abs(turn) > 1e-9 * size else 0.0


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
    if found is not None:
        yield _carried(draft, motion, found)
    for placed in markers:
        arm = [x for x in (_value(draft, x) for x in placed.arm) if x is not None]
        on_it = found is not None and len(arm) == 3 and _holds(found, np.add(arm, known[6:]))
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
    """A joint, a rod without mass, a load; in space the direction of gravity."""
    if isinstance(part, Gravity):
        if len(draft.components) == 3:
            yield Direction(part.name, _drawn(draft, draft.gravity[part.name]))
    elif isinstance(part, Distance):
        yield Rod(*_ends(draft, part))
    elif isinstance(part, SpringDamper):
        yield Spring(
            *_ends(draft, part), coils=8 if part.stiffness != 0 or part.preload != 0 else 0
        )
    elif isinstance(part, Joint):
        yield from _pivots(draft, part, draft.placed[part.first], draft.placed[part.second])
    elif isinstance(part, Motor):
        yield _about(draft, part.joint, "motor")
    elif isinstance(part, Torsion):
        yield from _elastic(draft, part)
    elif isinstance(part, Gear):
        yield from (_about(draft, joint, "gear") for joint in (part.first, part.second))


def _ends(draft: Draft, part: Any) -> tuple[Any, Any]:
    """The points of both markers."""
    first, second = draft.placed[part.first], draft.placed[part.second]
    return _drawn(draft, first.point), _drawn(draft, second.point)


def _along(draft: Draft, placed: Placed, axis: int) -> Any:
    """An axis of a marker; in the plane its x axis for z, which is not seen."""
    flat = len(draft.components) == 2 and axis == 2
    return _drawn(draft, placed.axes[0 if flat else axis].value)


def _about(draft: Draft, joint: Any, kind: str) -> Pivot:
    """What drives a joint."""
    of = draft.motion_of(joint)
    return Pivot(_drawn(draft, of.second.point), _along(draft, of.first, of.axis), kind)


def _elastic(draft: Draft, part: Torsion) -> Iterator[Shape]:
    """About the axis of a hinge; in a slide between its markers."""
    of = draft.motion_of(part.joint)
    if of.unit == "rad":
        yield _about(draft, part.joint, "torsion")
        return
    coils = 8 if part.stiffness != 0 or part.preload != 0 else 0
    yield Spring(_drawn(draft, of.first.point), _drawn(draft, of.second.point), coils=coils)


def _touching(draft: Draft, part: Contact | Rolling) -> Iterator[Shape]:
    """A wheel or a ball, and below it what it stands on."""
    a, b = draft.placed[part.first], draft.placed[part.second]
    n = len(draft.components) - 1
    normal, at = a.axes[n].value, b.point
    d = minus(at, a.point)
    foot = _drawn(draft, minus(at, times(dot(normal, d), normal)))
    yield Pivot(foot, _drawn(draft, normal), "plate")
    r = draft.number(part.radius, f"{part.name}.radius", "m")
    if r != 0 and n == 1:
        yield Disk(_drawn(draft, at), r, b.angle)
    elif r != 0:
        yield Sphere(_drawn(draft, at), r)


def _pivots(draft: Draft, joint: Joint, first: Placed, second: Placed) -> Iterator[Shape]:
    """A pin about the axis of a hinge, a sleeve along that of a slide and the way it has gone, a plate on a
    plane, a cross where nothing is free, else a ball."""
    planar = len(draft.components) == 2
    a = AXES.index(joint.axis or joint.usual[0 if planar else 1])
    axis, other = _drawn(draft, first.axes[a].value), _drawn(draft, second.point)
    if joint.crossed:
        b = AXES.index(joint.crossed)
        yield Pivot(other, axis)
        yield Pivot(other, _drawn(draft, second.axes[b].value))
    elif joint.slides:
        if joint.slides == "along":
            yield Line(_drawn(draft, first.point), other)
        yield Pivot(other, axis, "sleeve" if joint.slides == "along" else "plate")
    elif joint.turns == "about" and not planar:
        yield Pivot(other, axis)
    elif joint.turns:
        yield Pivot(other)
    else:
        yield Pivot(other, _along(draft, first, a), "weld")


def _force(draft: Draft, part: Any) -> Arrow:
    """What the second body receives, of components along the axes of the first marker."""
    first, second = draft.placed[part.first], draft.placed[part.second]
    force = [output(f"force.{part.name}.{x}") for x in draft.components]
    along: Expr = tuple(
        sp.Add(*(f * axis.value[k] for f, axis in zip(force, first.axes, strict=False)))
        for k in range(3)
    )
    return Arrow(part.name, _drawn(draft, second.point), force=_drawn(draft, along))
