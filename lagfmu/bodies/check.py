"""What is wrong with the parts of a mechanism, in words, before any equation is written."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ..model.elements import NAME, Parameter, is_number
from ..model.picture import Box, Track, points_of
from ..model.spline import Spline
from ..names import RESERVED
from .body import Body, Ground, Marker
from .contacts import Contact
from .curves import PointOnCurve
from .joints import Distance, Gear, Joint, Rolling, Universal, name_of_joint
from .loads import Force, Gravity, Motor, SpringDamper, Torque, Torsion
from .picture import CARRIED, shapes_of
from .readings import Reading
from .rotation import problem_of
from .space import PAIRS
from .vectors import AXES

PARTS = (Joint, Distance, PointOnCurve, Rolling, Gear, Contact)
PARTS += (Gravity, SpringDamper, Torsion, Force, Torque, Motor)  # type: ignore[assignment]
PLANES = (None, "xy")


def problems_of(plane: object, bodies: Sequence[Any], parts: Sequence[Any]) -> list[str]:
    """All of them."""
    problems = []
    if plane not in PLANES:
        problems.append(f"plane = {plane!r}, expected 'xy', or nothing for a mechanism in space")
    problems += [
        f"bodies hold {b!r}, expected Body(...)" for b in bodies if not isinstance(b, Body)
    ]
    problems += [
        f"joints and loads hold {p!r}, expected one of {', '.join(k.__name__ for k in PARTS)}"
        for p in parts
        if not isinstance(p, (*PARTS, Reading))
    ]
    if problems:
        return problems
    return [
        *_names([*bodies, *parts]),
        *(problem for body in bodies for problem in _of_body(body, plane is not None)),
        *(problem for part in parts for problem in _of_markers(part, bodies, plane is not None)),
        *(p for of in (*bodies, *_grounds(parts)) for p in _of_shape(of, plane is not None)),
        *(
            p
            for part in parts
            if isinstance(part, Joint)
            for p in _of_joint(part, plane is not None)
        ),
        *(
            p
            for part in parts
            if isinstance(part, PointOnCurve)
            for p in _of_curve(part, plane is not None)
        ),
        *(problem for part in parts for problem in _of_references(part, parts)),
    ]


def _kind(part: Any) -> str:
    return type(part).__name__


def _names(named: Sequence[Any]) -> Iterator[str]:
    seen: dict[str, str] = {"ground": "Ground"}
    for part in named:
        name, kind = part.name, _kind(part)
        if not isinstance(name, str) or not NAME.match(name):
            yield (
                f"{kind} has the name {name!r}, expected one word of letters a-z, A-Z, digits and _, not "
                "beginning with a digit"
            )
        elif name in RESERVED:
            yield f"{kind} {name!r}: this name is reserved for the FMU's own variables: choose another"
        elif name in seen:
            yield f"the name {name!r} is used twice, by a {seen[name]} and a {kind}: rename one"
        seen[str(name)] = kind


def _of_body(body: Body, planar: bool) -> Iterator[str]:
    what = f"body {body.name!r}"
    masses = [("mass", body.mass, "kg")]
    if planar:
        masses.append(("inertia", body.inertia, "kg.m^2"))
    elif not isinstance(body.inertia, Sequence) or len(body.inertia) not in (3, 6):
        yield (
            f"{what} has the inertia {body.inertia!r}, expected three numbers (xx, yy, zz) in kg.m^2, or six "
            "with xy, xz, yz; a mechanism of the plane says so: plane='xy'"
        )
    else:
        masses += [
            (f"inertia {x}", J, "kg.m^2") for x, J in zip(PAIRS, body.inertia[:3], strict=False)
        ]
        yield from _of_tensor(what, body.inertia)
    for of, value, unit in masses:
        number = _value(value)
        if is_number(number) and not float(number) > 0:
            yield (
                f"{what} has the {of} {number!r}, expected a positive number in {unit}: what has none cannot "
                "move by itself: put its markers on the body that it belongs to, or use Distance for a rod "
                "without mass"
            )


def _of_shape(body: Body | Ground, planar: bool) -> Iterator[str]:
    """Shapes that no body has, or with points of another space."""
    what, count = f"{body.name!r} has the shape", 2 if planar else 3
    for shape in () if body.shape is None else shapes_of(body):
        if not isinstance(shape, CARRIED):
            known = ", ".join(f"lagfmu.{k.__name__}" for k in CARRIED)
            yield f"{what} {shape!r}, expected one of {known}, or several, in the body's own frame"
        elif any(not isinstance(p, Sequence) or len(p) != count for p in points_of(shape)):
            yield f"{what} {shape!r}, expected points and sizes of {count} numbers"
        elif isinstance(shape, Box):
            turned = body.at((0,) * count, rotation=shape.rotation)
            if wrong := "" if planar and _is_angle(shape.rotation) else problem_of(turned):
                yield f"{what} {shape!r}: {wrong}"


def _value(value: Any) -> Any:
    return value.value if isinstance(value, Parameter) else value


def _of_tensor(what: str, inertia: Sequence[Any]) -> Iterator[str]:
    """The principal moments of a rigid body satisfy the triangle inequality."""
    values = [_value(x) for x in inertia]
    if not all(map(is_number, values)) or min(map(float, values[:3])) <= 0:
        return
    xx, yy, zz, xy, xz, yz = [*map(float, values), 0.0, 0.0, 0.0][:6]
    least, middle, most = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).tolist()
    if least <= 0 or most > (least + middle) * (1 + 1e-9):
        yield (
            f"{what} has the principal moments of inertia {least:.6g}, {middle:.6g}, {most:.6g} kg.m^2, "
            "expected positive ones of which none is above the sum of the others: no distribution of "
            "mass has these; products of inertia are elements of the tensor, -sum m x y"
        )


def _markers(part: Any) -> Iterator[tuple[str, Any]]:
    for field in ("first", "second", "at"):
        if hasattr(part, field) and not isinstance(part, Gear):
            yield field, getattr(part, field)


def _grounds(parts: Sequence[Any]) -> list[Ground]:
    """The grounds that markers are on, and that may look differently."""
    found = [getattr(marker, "body", None) for part in parts for _, marker in _markers(part)]
    return list({id(ground): ground for ground in found if isinstance(ground, Ground)}.values())


def _of_markers(part: Any, bodies: Sequence[Body], planar: bool) -> Iterator[str]:
    what = f"{_kind(part)} {part.name!r}"
    found = dict(_markers(part))
    for field, marker in found.items():
        if not isinstance(marker, Marker):
            yield f"{what}: {field} is {marker!r}, expected a marker, as body.at((0.1, 0))"
        elif not isinstance(marker.body, Ground) and marker.body not in bodies:
            yield (
                f"{what}: its {field} marker is on {getattr(marker.body, 'name', marker.body)!r}, which is "
                f"not among the bodies ({', '.join(b.name for b in bodies)}): add it"
            )
        elif planar and (marker.axis is not None or not _is_angle(marker.rotation)):
            turned = marker.rotation if marker.axis is None else marker.axis
            yield f"{what}: its {field} marker is turned by {turned!r}, expected an angle in the plane [rad]"
        elif not planar and (wrong := problem_of(marker)):
            yield f"{what}: its {field} marker: {wrong}"
    if isinstance(part, Reading) and isinstance(part.at, Marker) and part.at.body == Ground():
        yield f"{what}: its marker is on the ground, which does not move: read one on a body"
    first, second = found.get("first"), found.get("second")
    if isinstance(first, Marker) and isinstance(second, Marker) and first.body == second.body:
        yield (
            f"{what}: both markers are on {first.body.name!r}, expected two bodies: what is fixed on one "
            "body needs no joint"
        )
    if isinstance(part, Torque) and part.on not in bodies:
        yield f"{what} acts on {part.on!r}, which is not among the bodies: name one of them"


def _is_angle(rotation: Any) -> bool:
    return rotation is None or is_number(rotation)


def _of_joint(joint: Joint, planar: bool) -> Iterator[str]:
    what = f"{_kind(joint)} {joint.name!r}"
    possible = joint.possible[0 if planar else 1]
    where = "in the plane xy" if planar else "in space"
    if not possible and planar:
        yield f"{what} is a joint in space: in the plane use Revolute, Prismatic or PointOnPlane"
        return
    if isinstance(joint, Universal) and joint.second_axis not in tuple(AXES):
        yield f"{what}: second_axis is {joint.second_axis!r}, expected 'x', 'y' or 'z'"
    if joint.axis and (len(joint.axis) > 1 or joint.axis not in possible):
        yield (
            f"{what}: axis is {joint.axis!r}, expected {' or '.join(map(repr, possible)) or 'none'} {where}"
        )
    if joint.friction is not None and not joint.measures:
        yield f"{what}: friction is given, but it leaves no motion that could rub: leave it out"
    elif joint.friction is not None and joint.turns and not _value(joint.radius):
        yield f"{what}: friction is given without the radius of the pin, expected radius=... in m"
    limits = joint.limits
    if limits is None:
        return
    if (joint.slides and joint.turns) or not (joint.slides or joint.turns):
        yield f"{what}: limits are given, but it has no angle or position to be limited: leave them out"
    elif isinstance(limits, str) or not isinstance(limits, Sequence) or len(limits) != 2:
        yield f"{what}: limits are {limits!r}, expected the smallest and the largest value"
    elif all(map(is_number, limits)) and not float(limits[0]) < float(limits[1]):  # type: ignore[arg-type]
        yield f"{what}: limits are {limits!r}, expected the smaller value first: exchange them"


def _of_curve(part: PointOnCurve, planar: bool) -> Iterator[str]:
    what, count = f"PointOnCurve {part.name!r}", 2 if planar else len(AXES)
    if not isinstance(part.curve, Track | Spline):
        yield (
            f"{what}: its curve is {part.curve!r}, expected a Track((x, y), s, first, last) of lagfmu, or in "
            "the plane a Spline"
        )
    elif len(part.along()[0]) != count:
        yield f"{what}: its curve has {len(part.along()[0])} components, expected {count}"


def _of_references(part: Any, parts: Sequence[Any]) -> Iterator[str]:
    """Joints that a gear, a motor or a torsion spring names."""
    if isinstance(part, Gear):
        named = [part.first, part.second]
    elif isinstance(part, Motor | Torsion):
        named = [part.joint]
    else:
        return
    known = {j.name: j for j in parts if isinstance(j, Joint)}
    fit = [n for n, j in known.items() if len(j.measures) == 1]
    fit += [m for j in known.values() if len(j.measures) > 1 for m in j.measures]
    alone = {m for j in known.values() for m in j.measures}
    for joint in map(name_of_joint, named):
        if joint in fit or joint in alone:
            continue
        if joint not in known:
            yield (
                f"{_kind(part)} {part.name!r}: no joint is called {joint!r}, expected one of "
                f"{', '.join(fit) or 'none: no joint turns or slides'}"
            )
        else:
            yield (
                f"{_kind(part)} {part.name!r}: {_kind(known[joint])} {joint!r} has no angle or position "
                f"or both, expected one of {', '.join(fit) or 'none: no joint turns or slides'}"
            )
    if len(named) == 2 and len({*map(name_of_joint, named)}) == 1:
        yield f"Gear {part.name!r} ties {name_of_joint(named[0])!r} to itself, expected two joints"
