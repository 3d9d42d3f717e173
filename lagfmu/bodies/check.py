"""What is wrong with the parts of a mechanism, in words, before any equation is written."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ..errors import LagfmuWarning
from ..model.elements import NAME, is_number
from ..model.picture import Box, points_of
from ..names import RESERVED
from .body import Body, Ground, Marker
from .check_ties import kind_of, problems_of_ties, value_of
from .contacts import Contact
from .curves import PointOnCurve
from .joints import Distance, Gear, Joint, Rolling
from .loads import Force, Gravity, Motor, Rotor, SpringDamper, Torque, Torsion
from .picture import CARRIED, shapes_of
from .readings import Reading
from .rotation import problem_of
from .space import PAIRS

PARTS = (Joint, Distance, PointOnCurve, Rolling, Gear, Contact)
PARTS += (Gravity, SpringDamper, Torsion, Force, Torque, Motor, Rotor)  # type: ignore[assignment]
ROUNDED = 1e-3  # of the largest moment, by which an inertia may miss an inequality
SINGULAR = 1e-12  # of the largest moment: the least that is none
PLANES = (None, "xy")


def problems_of_containers(lists: Mapping[str, object], dicts: Mapping[str, object]) -> list[str]:
    """What is no list, or no dict by names."""
    problems = [
        f"{name} is {value!r}, expected a list: {name}=[...]"
        for name, value in lists.items()
        if isinstance(value, str) or not isinstance(value, Sequence)
    ]
    return problems + [
        f"{name} is {value!r}, expected a dict by names: {name}={{'{example}': ...}}"
        for (name, value), example in zip(dicts.items(), ("angle.A", "angle.A", "tip"), strict=True)
        if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value)
    ]


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
        *problems_of_ties(parts, plane is not None),
    ]


def _names(named: Sequence[Any]) -> Iterator[str]:
    seen: dict[str, str] = {"ground": "Ground"}
    for part in named:
        name, kind = part.name, kind_of(part)
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
    elif not (
        isinstance(body.inertia, Sequence)
        and len(body.inertia) in (3, 6)
        and not any(isinstance(x, Sequence) for x in body.inertia)
    ):
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
        number = value_of(value)
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


def _of_tensor(what: str, inertia: Sequence[Any]) -> Iterator[str]:
    """The principal moments of a rigid body satisfy the triangle inequality."""
    values = [value_of(x) for x in inertia]
    if not all(map(is_number, values)) or min(map(float, values[:3])) <= 0:
        return
    xx, yy, zz, xy, xz, yz = [*map(float, values), 0.0, 0.0, 0.0][:6]
    least, middle, most = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).tolist()
    missed = most - (least + middle)
    positive = least > SINGULAR * most
    if positive and 1e-9 * most < missed < ROUNDED * most:
        warnings.warn(
            f"{what}: its largest principal moment of inertia, {most!r} kg.m^2, is above the sum of the "
            f"others, {least + middle!r}, by what a program rounds: it is used as it is",
            LagfmuWarning,
            stacklevel=2,
        )
    elif not positive or missed > 1e-9 * most:
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
    what = f"{kind_of(part)} {part.name!r}"
    found = dict(_markers(part))
    for field, marker in found.items():
        if not isinstance(marker, Marker):
            yield f"{what}: {field} is {marker!r}, expected a marker, as body.at((0.1, 0))"
        elif isinstance(marker.body, Ground) and marker.body != Ground():
            yield (
                f"{what}: its {field} marker is on the ground {marker.body.name!r}, expected "
                f"{Ground().name!r}: there is one ground"
            )
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
    if isinstance(part, Force) and isinstance(part.at, Marker) and part.at.body == Ground():
        yield f"{what} acts on the ground, which does not move: name a marker on a body"
    if isinstance(part, Torque) and part.on not in bodies:
        yield f"{what} acts on {part.on!r}, which is not among the bodies: name one of them"


def _is_angle(rotation: Any) -> bool:
    return rotation is None or is_number(rotation)
