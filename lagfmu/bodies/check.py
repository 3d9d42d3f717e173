"""What is wrong with the parts of a mechanism, in words, before any equation is written.

What is told of a mechanism that is put together: springs without a direction, radii that are no radii.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import sympy as sp

from ..errors import LagfmuWarning
from ..model.attitude import written_out
from ..model.elements import NAME, Expr, is_number
from ..model.model import Model
from ..model.picture import Box, Track, points_of
from ..model.spline import Spline
from ..names import RESERVED
from ..numeric.contacts import REBOUND, is_restitution
from .body import Body, Ground, Marker, problem_of, several, value_of
from .contacts import Contact, PointOnCurve
from .draft import Draft, Reading
from .joints import Distance, Gear, Joint, Rolling, name_of_joint
from .loads import Force, Gravity, Motor, Rotor, SpringDamper, Torque, Torsion
from .motion import AXES, between
from .picture import CARRIED, shapes_of
from .space import PAIRS


def _kind_of(part: Any) -> str:
    """Revolute, Motor, ..."""
    return type(part).__name__


def _problems_of_ties(parts: Sequence[Any], planar: bool) -> Iterator[str]:
    """All of them."""
    for part in parts:
        if isinstance(part, Joint):
            yield from _of_joint(part, planar)
        elif isinstance(part, PointOnCurve):
            yield from _of_curve(part, planar)
        yield from _of_numbers(part)
        yield from _of_references(part, parts)
    motors: dict[Any, Motor] = {}
    for part in parts:
        if isinstance(part, Motor) and isinstance(name := name_of_joint(part.joint), str):
            other = motors.setdefault(name.split(".")[-1], part)
            if other is not part and (part.motion is not None or other.motion is not None):
                yield (
                    f"Motors {other.name!r} and {part.name!r} both drive the joint {name!r}, of which one "
                    "prescribes the motion: leave one out"
                )


def _of_joint(joint: Joint, planar: bool) -> Iterator[str]:
    what = f"{_kind_of(joint)} {joint.name!r}"
    possible = joint.possible[0 if planar else 1]
    where = "in the plane xy" if planar else "in space"
    if not possible and planar:
        yield f"{what} is a joint in space: in the plane use Revolute, Prismatic or PointOnPlane"
        return
    yield from (f"{what}: {problem}" for problem in joint.problems())
    if joint.axis and joint.axis not in tuple(possible):
        yield (
            f"{what}: axis is {joint.axis!r}, expected {' or '.join(map(repr, possible)) or 'none'} {where}"
        )
    if joint.friction is not None and joint.smooth:
        yield f"{what}: friction is given, but {joint.smooth}"
    elif joint.friction is not None and not joint.measures:
        rubs = "Revolute, Prismatic and Cylindrical joints, PointOnCurve and Contact"
        yield f"{what}: friction is given, but only {rubs} rub: leave it out"
    elif joint.friction is not None and joint.turns and not value_of(joint.radius):
        yield f"{what}: friction is given without the radius of the pin, expected radius=... in m"
    yield from _of_constant(what, joint)
    if joint.length is not None and joint.friction is None:
        yield f"{what}: the length of its bearing is given, but no friction: give friction, or leave it out"
    elif joint.length is not None and planar and joint.turns:
        yield f"{what}: length is given, but its bearing takes no moment: leave it out"
    limits = joint.limits
    if limits is None:
        if not is_number(joint.restitution) or float(joint.restitution):  # type: ignore[arg-type]
            yield f"{what}: restitution is given, but no limits at which it could rebound: give limits"
        return
    both = joint.slides and joint.turns and not joint.coupled
    if both or not (joint.slides or joint.turns):
        yield f"{what}: limits are given, but it has no angle or position to be limited: leave them out"
    elif isinstance(limits, str) or not isinstance(limits, Sequence) or len(limits) != 2:
        yield f"{what}: limits are {limits!r}, expected the smallest and the largest value"
    elif all(map(is_number, limits)) and not float(limits[0]) < float(limits[1]):  # type: ignore[arg-type]
        yield f"{what}: limits are {limits!r}, expected the smaller value first, then a larger one"


def _of_constant(what: str, joint: Joint) -> Iterator[str]:
    """Its friction torque or force."""
    if joint.constant is None:
        return
    word = f"friction_{'torque' if joint.turns else 'force'}"
    if joint.friction is not None:
        yield f"{what}: friction and {word} are given, expected one of them"
    of = several(joint.constant)
    numbers = [value_of(x) for x in of]
    if len(of) not in (1, 2) or any(is_number(x) and float(x) < 0 for x in numbers):
        yield f"{what}: {word} is {joint.constant!r}, expected one number of at least 0, or two"
    elif all(map(is_number, numbers)) and float(numbers[0]) < float(numbers[-1]):
        yield f"{what}: {word} is {joint.constant!r}, expected the static one, then a smaller kinetic one"


def _of_curve(part: PointOnCurve, planar: bool) -> Iterator[str]:
    what, count = f"PointOnCurve {part.name!r}", 2 if planar else len(AXES)
    if not isinstance(part.curve, Track | Spline):
        yield (
            f"{what}: its curve is {part.curve!r}, expected a Track((x, y), s, first, last) of lagfmu, or in "
            "the plane a Spline"
        )
    elif len(part.along()[0]) != count:
        yield f"{what}: its curve has {len(part.along()[0])} components, expected {count}"
    elif isinstance(part.curve, Track):
        over, points = part.curve.over, part.curve.point
        if not isinstance(over, sp.Symbol) or not any(sp.sympify(e).has(over) for e in points):
            yield f"{what}: its points {points} do not depend on {over!r}, expected expressions of a symbol"


def _of_numbers(part: Any) -> Iterator[str]:
    """Numbers that are out of bounds, where they are numbers."""
    what = f"{_kind_of(part)} {part.name!r}"
    radius, restitution = (value_of(getattr(part, n, 0.0)) for n in ("radius", "restitution"))
    friction = getattr(part, "friction", None)
    if is_number(radius) and float(radius) < 0:
        yield f"{what}: radius is {radius!r}, expected a number of at least 0 in m"
    if is_number(restitution) and not is_restitution(float(restitution)):
        yield f"{what}: restitution is {restitution!r}, {REBOUND}"
    if isinstance(friction, tuple | list) and len(friction) != 2:
        yield f"{what}: friction is {friction!r}, expected one coefficient, or the static and the kinetic"
    if isinstance(part, Gear) and _is_zero(part.ratio) and all(map(_is_zero, part.higher)):
        yield f"{what}: ratio is 0, expected another number: what does not move is Fixed"
    if isinstance(part, Motor) and part.torque is not None and part.motion is not None:
        yield f"{what}: torque and motion are given, expected one of them: the other follows"


def _is_zero(number: Any) -> bool:
    value = value_of(number)
    return is_number(value) and float(value) == 0


NO_MOTION = "none: no joint turns or slides"


def _unfit(joint: Joint) -> str:
    """Why it is not named as it stands by what drives one motion."""
    both = "turns and slides: one of the two is named"
    return both if joint.measures else "has neither an angle nor a position"


def _of_references(part: Any, parts: Sequence[Any]) -> Iterator[str]:
    """Joints that a gear, a motor or a torsion spring names."""
    if isinstance(part, Gear):
        named = [part.first, part.second]
    elif isinstance(part, Motor | Rotor | Torsion):
        named = [part.joint]
    else:
        return
    known = {j.name: j for j in parts if isinstance(j, Joint)}
    fit = [n for n, j in known.items() if len(j.measures) == 1]
    fit += [m for j in known.values() if len(j.measures) > 1 for m in j.measures]
    alone = {m for j in known.values() for m in j.measures}
    for joint in map(name_of_joint, named):
        if not isinstance(joint, str):
            yield f"{_kind_of(part)} {part.name!r} names the joint {joint!r}, expected a joint or its name"
            continue
        if joint in fit or joint in alone:
            continue
        if joint not in known:
            yield (
                f"{_kind_of(part)} {part.name!r}: no joint is called {joint!r}, expected one of "
                f"{', '.join(fit) or NO_MOTION}"
            )
        else:
            yield (
                f"{_kind_of(part)} {part.name!r}: {_kind_of(known[joint])} {joint!r} "
                f"{_unfit(known[joint])}, expected one of {', '.join(fit) or NO_MOTION}"
            )
    if len(named) == 2 and len({*map(name_of_joint, named)}) == 1:
        yield f"Gear {part.name!r} ties {name_of_joint(named[0])!r} to itself, expected two joints"


PARTS = (Joint, Distance, PointOnCurve, Rolling, Gear, Contact)
PARTS += (Gravity, SpringDamper, Torsion, Force, Torque, Motor, Rotor)  # type: ignore[assignment]
ROUNDED = 1e-3  # of the largest moment, by which an inertia may miss an inequality
SINGULAR = 1e-12  # of the largest moment: how far below 0 another is rounding
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
        *_problems_of_ties(parts, plane is not None),
    ]


def _names(named: Sequence[Any]) -> Iterator[str]:
    seen: dict[str, str] = {"ground": "Ground"}
    for part in named:
        name, kind = part.name, _kind_of(part)
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
        if is_number(number) and not float(number) >= 0:
            yield (
                f"{what} has the {of} {number!r}, expected a positive number in {unit}, or 0 where joints to "
                "others say how it moves: correct it"
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
    if not all(map(is_number, values)) or min(map(float, values[:3])) < 0:
        return
    xx, yy, zz, xy, xz, yz = [*map(float, values), 0.0, 0.0, 0.0][:6]
    least, middle, most = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).tolist()
    missed = most - (least + middle)
    positive = least >= -SINGULAR * most
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
            "expected none below 0, of which none is above the sum of the others: no distribution of "
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
    what = f"{_kind_of(part)} {part.name!r}"
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
                f"{_kind_of(part)} {part.name!r}: the radius of its pin is {float(radius):g} m, and no "
                f"marker is farther than {far:g} m from the centre of its body: is it in metres?",
                LagfmuWarning,
                stacklevel=3,
            )
