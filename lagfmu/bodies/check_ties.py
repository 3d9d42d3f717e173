"""What is wrong with joints, with points on curves, and with what names joints, in words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import sympy as sp

from ..model.elements import Parameter, is_number
from ..model.picture import Track
from ..model.spline import Spline
from .body import several
from .curves import PointOnCurve
from .joints import Gear, Joint, Planar, Screw, Universal, name_of_joint
from .loads import Motor, Rotor, Torsion
from .vectors import AXES


def kind_of(part: Any) -> str:
    """Revolute, Motor, ..."""
    return type(part).__name__


def value_of(value: Any) -> Any:
    """Of a Parameter its value, else what was given."""
    return value.value if isinstance(value, Parameter) else value


def problems_of_ties(parts: Sequence[Any], planar: bool) -> Iterator[str]:
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
    what = f"{kind_of(joint)} {joint.name!r}"
    possible = joint.possible[0 if planar else 1]
    where = "in the plane xy" if planar else "in space"
    if not possible and planar:
        yield f"{what} is a joint in space: in the plane use Revolute, Prismatic or PointOnPlane"
        return
    if isinstance(joint, Universal) and joint.second_axis not in tuple(AXES):
        yield f"{what}: second_axis is {joint.second_axis!r}, expected 'x', 'y' or 'z'"
    if joint.axis and joint.axis not in tuple(possible):
        yield (
            f"{what}: axis is {joint.axis!r}, expected {' or '.join(map(repr, possible)) or 'none'} {where}"
        )
    if joint.friction is not None and isinstance(joint, Planar):
        yield f"{what}: friction is given, but no force across its axis could press: rub a Contact instead"
    elif joint.friction is not None and not joint.measures:
        rubs = "Revolute, Prismatic and Cylindrical joints, PointOnCurve and Contact"
        yield f"{what}: friction is given, but only {rubs} rub: leave it out"
    elif joint.friction is not None and joint.turns and not value_of(joint.radius):
        yield f"{what}: friction is given without the radius of the pin, expected radius=... in m"
    if isinstance(joint, Screw) and joint.friction is not None:
        yield f"{what}: friction is given, but a thread has none here: brake its turn by a Torsion's damping"
    if (
        isinstance(joint, Screw)
        and is_number(value_of(joint.lead))
        and not float(value_of(joint.lead))
    ):
        yield f"{what}: lead is {joint.lead!r}, expected metres a turn, not 0 (left-handed: negative)"
    yield from _of_constant(what, joint)
    if joint.length is not None and joint.friction is None:
        yield f"{what}: the length of its bearing is given, but no friction: give friction, or leave it out"
    elif joint.length is not None and (isinstance(joint, Planar) or (planar and joint.turns)):
        yield f"{what}: length is given, but its bearing takes no moment: leave it out"
    limits = joint.limits
    if limits is None:
        if not is_number(joint.restitution) or float(joint.restitution):  # type: ignore[arg-type]
            yield f"{what}: restitution is given, but no limits at which it could rebound: give limits"
        return
    both = joint.slides and joint.turns and not isinstance(joint, Screw)
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
    what = f"{kind_of(part)} {part.name!r}"
    radius, restitution = (value_of(getattr(part, n, 0.0)) for n in ("radius", "restitution"))
    friction = getattr(part, "friction", None)
    if is_number(radius) and float(radius) < 0:
        yield f"{what}: radius is {radius!r}, expected a number of at least 0 in m"
    if is_number(restitution) and not 0 <= float(restitution) <= 1:
        yield f"{what}: restitution is {restitution!r}, expected a number from 0 to 1"
    if isinstance(friction, tuple | list) and len(friction) != 2:
        yield f"{what}: friction is {friction!r}, expected one coefficient, or the static and the kinetic"
    if isinstance(part, Gear) and _is_zero(part.ratio) and all(map(_is_zero, part.higher)):
        yield f"{what}: ratio is 0, expected another number: what does not move is Fixed"
    if isinstance(part, Motor) and part.torque is not None and part.motion is not None:
        yield f"{what}: torque and motion are given, expected one of them: the other follows"


def _is_zero(number: Any) -> bool:
    value = value_of(number)
    return is_number(value) and float(value) == 0


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
            yield f"{kind_of(part)} {part.name!r} names the joint {joint!r}, expected a joint or its name"
            continue
        if joint in fit or joint in alone:
            continue
        if joint not in known:
            yield (
                f"{kind_of(part)} {part.name!r}: no joint is called {joint!r}, expected one of "
                f"{', '.join(fit) or 'none: no joint turns or slides'}"
            )
        else:
            yield (
                f"{kind_of(part)} {part.name!r}: {kind_of(known[joint])} {joint!r} has no angle or position "
                f"or both, expected one of {', '.join(fit) or 'none: no joint turns or slides'}"
            )
    if len(named) == 2 and len({*map(name_of_joint, named)}) == 1:
        yield f"Gear {part.name!r} ties {name_of_joint(named[0])!r} to itself, expected two joints"
