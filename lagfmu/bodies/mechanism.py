"""Bodies, joints and loads -> an ordinary Model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import sympy as sp

from .. import names
from ..errors import ModelError
from ..model.elements import Input, Output, Parameter
from ..model.model import Model
from .assembly import assemble
from .body import Body, Ground, Marker
from .check import coinciding, problems_of, problems_of_containers, warn_of_radii
from .draft import Draft, readings_of
from .joints import Gear, Joint
from .laws import laws_of
from .loads import Motor, Torsion
from .motion import AXES
from .picture import picture_of
from .plane import PlaneMotion
from .space import SpaceMotion


def _lines_of(bodies: Sequence[Body], parts: Sequence[Any]) -> list[tuple[str, str]]:
    """The name of each, and what it is: what kind of joint it is, of which bodies."""
    lines = [
        (body.name, f"body{f': {body.description}' if body.description else ''}") for body in bodies
    ]
    return lines + [(part.name, _line(part)) for part in parts]


def _line(part: Any) -> str:
    """The kind, and what it takes hold of: the second first, which receives what is reported."""
    fields = ("second", "first", "joint", "at", "on")
    held = [getattr(part, field) for field in fields if getattr(part, field, None) is not None]
    kind, of = _words(type(part).__name__), " on ".join(map(_name, held))
    return f"{kind}: {of}" if of else kind


def _name(of: Any) -> str:
    """Of a body, of that of a marker, or of a joint, which may be given by its name."""
    of = of.body if isinstance(of, Marker) else of
    return of if isinstance(of, str) else str(of.name)


def _words(name: str) -> str:
    """SpringDamper -> spring damper."""
    return "".join(f" {c.lower()}" if c.isupper() and k else c.lower() for k, c in enumerate(name))


def mechanism(
    name: str,
    *,
    bodies: Sequence[Body],
    joints: Sequence[Any] = (),
    loads: Sequence[Any] = (),
    contacts: Sequence[Any] = (),
    plane: str | None = None,
    start: Mapping[str, Any] | None = None,
    near: Mapping[str, float] | None = None,
    read: Mapping[str, Any] | None = None,
    parameters: Sequence[Parameter] = (),
    inputs: Sequence[Input] = (),
    outputs: Sequence[Output] = (),
    **more: Any,
) -> Model:
    """The Model of a mechanism in space; with `plane` = 'xy' all points, forces and axes are of that plane.

    `start` maps names of the FMU to where they begin: 'angle.A', 'der(angle.A)', 'rod.position.x', or
    'rod.position' to all of its components; in space 'rod.rpy' to roll, pitch and yaw [rad].  The rest is
    assembled: what is omitted moves first, from where joint coordinates are `near`, else from 0.  `read` maps
    names to markers (to a body: its own frame), of which the FMU then tells NAME.position.x, NAME.velocity.x,
    NAME.acceleration.x and, in space, NAME.rpy.roll.
    `parameters`, `inputs`, `outputs` and `more` (a description, an author, a page) go to the Model as they
    are.

    Raises ModelError with every problem at once; of a mechanism that cannot be closed, by how much which
    joint misses.
    """
    lists = {"bodies": bodies, "joints": joints, "loads": loads, "contacts": contacts}
    problems = problems_of_containers(
        lists, {"start": start or {}, "near": near or {}, "read": read or {}}
    )
    if problems:
        raise ModelError(str(name), problems)
    parts = [*joints, *loads, *contacts, *readings_of(read or {}, plane is not None)]
    problems = problems_of(plane, bodies, parts)
    if problems:
        raise ModelError(str(name), problems)
    draft = Draft(plane or AXES)
    motion = PlaneMotion if plane else SpaceMotion
    draft.motions[Ground()] = motion(draft, Ground())
    for body in bodies:
        draft.motions[body] = motion(draft, body)
    draft.wound = _wound(parts, {**(near or {}), **(start or {})})
    for part in sorted(parts, key=lambda part: isinstance(part, Gear)):
        part.add(draft)
    draft.report_wrenches()
    if draft.problems:
        raise ModelError(str(name), draft.problems)
    coordinates, descriptions, speeds, kinematics = (
        {s: x for m in draft.motions.values() for s, x in getattr(m, field).items()}
        for field in ("coordinates", "descriptions", "speeds", "kinematics")
    )
    angles, curves = draft.unwrapped, draft.curves
    model = Model(
        name=name,
        lagrangian=sp.Add(*draft.kinetic, *(-V for V in draft.potential)),
        forces={q: Q for q, Q in draft.forces.items() if Q != 0},
        coordinates={
            **coordinates,
            **{s: of.unit for s, of in curves.items()},
            **dict.fromkeys(angles, "rad"),
        },
        speeds=speeds,
        kinematics={**kinematics, **{q: rate for q, (rate, _) in angles.items()}},
        unwrapped={q: within for q, (_, within) in angles.items()},
        constraints=draft.constraints,  # type: ignore[arg-type]
        parameters=[*draft.parameters.values(), *parameters],
        inputs=[*draft.inputs, *inputs],
        outputs=[*draft.outputs, *outputs],
        descriptions={**descriptions, **{s: of.text for s, of in curves.items()}},
        parts=_lines_of(bodies, parts),
        laws=laws_of(draft, parts),
        **{"picture": picture_of(draft, parts), **more},
    )
    started = model.started(*assemble(draft, model, parts, start or {}, near or {}))
    if problems := coinciding(draft, started, parts):
        raise ModelError(str(name), problems)
    warn_of_radii(draft, parts)
    return started


def _wound(parts: Sequence[Any], start: Mapping[str, Any]) -> set[str]:
    """The angles of joints that a screw, gear, motor, torsion spring, limit or the start needs over turns."""
    joints = {p.name: p for p in parts if isinstance(p, Joint)}
    named: list[Any] = [j for j in joints.values() if j.limits is not None or j.coupled]
    named += [j for p in parts if isinstance(p, Gear) for j in (p.first, p.second)]
    named += [p.joint for p in parts if isinstance(p, Motor | Torsion)]
    named += [f"angle.{n}" for j in joints.values() for n in getattr(j, "stops", ())]
    called = {j if isinstance(j, str) else j.name for j in named}
    found = {n if n.startswith("angle.") else f"angle.{n}" for n in called}
    return found | {names.read(name).coordinate for name in start if "angle." in name}
