"""Bodies, joints and loads -> an ordinary Model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import sympy as sp

from ..errors import ModelError
from ..model.elements import Input, Output, Parameter
from ..model.model import Model
from .assembly import assemble
from .body import Body, Ground
from .check import problems_of
from .draft import Draft
from .joints import Gear
from .picture import picture_of
from .plane import PlaneMotion
from .told import lines_of


def mechanism(
    name: str,
    *,
    bodies: Sequence[Body],
    joints: Sequence[Any] = (),
    loads: Sequence[Any] = (),
    contacts: Sequence[Any] = (),
    plane: str | None = None,
    start: Mapping[str, Any] | None = None,
    parameters: Sequence[Parameter] = (),
    inputs: Sequence[Input] = (),
    outputs: Sequence[Output] = (),
    **more: Any,
) -> Model:
    """The Model of a mechanism; with `plane` = 'xy' all points, forces and axes are of that plane.

    `start` maps names of the FMU to where they begin: 'angle.A', 'der(angle.A)', 'rod.position.x', or
    'rod.position' to all of its components.  The rest is assembled: what is omitted moves first.
    `parameters`, `inputs`, `outputs` and `more` (a description, an author, a page) go to the Model as they
    are.

    Raises ModelError with every problem at once; of a mechanism that cannot be closed, by how much which
    joint misses.
    """
    parts = [*joints, *loads, *contacts]
    problems = problems_of(plane, bodies, parts)
    if problems:
        raise ModelError(str(name), problems)
    draft = Draft("xy")
    draft.motions[Ground()] = PlaneMotion(draft, Ground())
    for body in bodies:
        draft.motions[body] = PlaneMotion(draft, body)
    for part in sorted(parts, key=lambda part: isinstance(part, Gear)):
        part.add(draft)
    draft.report_wrenches()
    if draft.problems:
        raise ModelError(str(name), draft.problems)
    coordinates = {q: u for m in draft.motions.values() for q, u in m.coordinates.items()}
    descriptions = {q: t for m in draft.motions.values() for q, t in m.descriptions.items()}
    model = Model(
        name=name,
        lagrangian=sp.Add(*draft.kinetic, *(-V for V in draft.potential)),
        forces={q: Q for q, Q in draft.forces.items() if Q != 0},
        coordinates=coordinates,
        constraints=draft.constraints,  # type: ignore[arg-type]
        parameters=[*draft.parameters.values(), *parameters],
        inputs=[*draft.inputs, *inputs],
        outputs=[*draft.outputs, *outputs],
        descriptions=descriptions,
        parts=lines_of(bodies, parts),
        **{"picture": picture_of(draft), **more},
    )
    return replace(model, start=assemble(draft, model, parts, start or {}))
