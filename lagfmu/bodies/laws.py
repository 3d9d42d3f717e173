"""What acts on each body of a mechanism, in what its FMU tells (model/closed_form.py)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import sympy as sp

from .. import names
from ..model.attitude import written_out
from ..model.closed_form import GROUND, Act, Laws, Where, in_variables, output
from ..model.elements import Expr, Parameter
from .body import Body
from .draft import Draft, Relative
from .joints import Gear
from .loads import Force, Rotor, SpringDamper, Torque, Torsion
from .motion import AXES, ZERO, Placed
from .space import PAIRS

EYE = tuple(sp.Integer(i == j) for i in range(3) for j in range(3))
STILL = Where(GROUND, ZERO, EYE)


def laws_of(draft: Draft, parts: Sequence[Any]) -> Laws:
    """The laws of all bodies."""
    acting = _Acting(draft)
    for part in parts:
        acting.add(part)
    bodies, planar = acting.bodies, len(draft.components) == 2
    inertias = [
        [acting.number(body.inertia, f"{body.name}.inertia")]
        if planar
        else [
            acting.number(value, f"{body.name}.inertia.{pair}")
            for pair, value in zip(PAIRS, [*body.inertia, 0, 0, 0], strict=False)
        ]
        for body in bodies
    ]
    fields = list(draft.gravity.values())
    return Laws(
        planar,
        len(draft.constraints) + sum(len(m.directions) for m in draft.motions.values()),
        [body.name for body in bodies],
        [draft.motions[body].mass for body in bodies],
        inertias,
        [sp.Add(*(g[k] for g in fields)) for k in range(3)],
        acting.acts,
        sorted(acting.jumps, key=str),
    )


class _Acting:
    """What acts, while it is collected."""

    def __init__(self, draft: Draft) -> None:
        self.draft = draft
        self.bodies = [body for body in draft.motions if isinstance(body, Body)]
        self.numbers = {id(body): k for k, body in enumerate(self.bodies)}
        self.acts: list[Act] = []
        self.jumps: set[Expr] = set()

    def where(self, placed: Placed) -> Where:
        """A marker."""
        axes = [x for axis in placed.own_axes for x in axis]
        return Where(self.numbers.get(id(placed.body), GROUND), placed.arm, axes)

    def pair(self, a: Placed, b: Placed, force: Any, torque: Any, size: Expr = 0) -> None:
        """What the second body receives in the axes of the first marker, and the first the opposite of."""
        on, along = self.where(b), self.where(a)
        self.acts.append(Act(on, along, along.body, False, force, torque, size))

    def drive(self, of: Relative, effort: Expr, size: Expr = 0) -> None:
        """A torque or force along the motion that a joint leaves free."""
        along = [effort * in_variables(written_out(share)) for share in of.shares]
        pair = (ZERO, along) if of.unit == "rad" else (along, ZERO)
        force, torque = pair
        self.pair(of.first, of.second, force, torque, size)

    def add(self, part: Any) -> None:
        """What a joint, a load or a contact does; a motor is in the wrench of its joint."""
        draft, name = self.draft, part.name
        if name in draft.wrenches:
            force = self.told(f"force.{name}", draft.components)
            torque = self.told(f"torque.{name}", AXES if len(draft.components) == 3 else "z")
            self.pair(draft.placed[part.first], draft.placed[part.second], force, torque)
        elif isinstance(part, SpringDamper):
            pull, k, free = self.told_of(part, f"force.{name}", "stiffness", "length")
            self.pair(draft.placed[part.first], draft.placed[part.second], (pull, 0, 0), ZERO, k)
            act = self.acts.pop()
            self.acts.append(replace(act, line=True, torque=(sp.Abs(k * free), 0, 0)))
        elif isinstance(part, Torsion):
            of = draft.motion_of(part.joint)
            effort = f"{'torque' if of.unit == 'rad' else 'force'}.{name}"
            effort, k, slack = self.told_of(part, effort, "stiffness", "angle")
            self.drive(of, effort, sp.Abs(k) * (sp.Abs(output(of.name)) + sp.Abs(slack)))
        elif isinstance(part, Rotor):
            self.drive(draft.motion_of(part.joint), output(names.name(names.MULTIPLIER, name)))
        elif isinstance(part, Gear):
            effort = output(names.name(names.MULTIPLIER, name))
            self.drive(draft.motion_of(part.first), effort)
            second = draft.motion_of(part.second)
            ratio = self.number(part.ratio, f"{name}.ratio")
            for k, factor in enumerate(part.higher, 2):
                slope = k * output(second.name) ** (k - 1)
                ratio += self.number(factor, f"{name}.higher{k}") * slope
            self.drive(second, -ratio * effort)
        elif isinstance(part, Force):
            on = self.where(draft.placed[part.at])
            force = self.given(part.force, name, draft.components)
            along = on if part.follows else STILL
            self.acts.append(Act(on, along, GROUND, False, force, ZERO))
        elif isinstance(part, Torque):
            axes = AXES if len(draft.components) == 3 else "z"
            given = [part.torque] if axes == "z" and part.torque is not None else part.torque
            on = replace(STILL, body=self.numbers.get(id(part.on), GROUND))
            torque = self.given(given, name, axes)
            self.acts.append(Act(on, STILL, GROUND, False, ZERO, torque))

    def told_of(self, part: Any, effort: str, *numbers: str) -> list[Expr]:
        """An effort that the FMU tells, and numbers of a load."""
        found = (self.number(getattr(part, x), f"{part.name}.{x}") for x in numbers)
        return [output(effort), *found]

    def told(self, name: str, axes: str) -> list[Expr]:
        """Three components, of which the FMU tells those along the axes."""
        return [output(f"{name}.{x}") if x in axes else sp.S.Zero for x in AXES]

    def given(self, values: Any, name: str, axes: str) -> list[Expr]:
        """The components that a load has: its inputs where none were given."""
        if values is None:
            return self.told(name, axes)
        found = {x: self.number(v, f"{name}.{x}") for x, v in zip(axes, values, strict=True)}
        return [found.get(x, sp.S.Zero) for x in AXES]

    def number(self, value: Any, name: str) -> Expr:
        """By the parameter that it became, or an expression, whose jumps are kept."""
        if isinstance(value, Parameter):
            return value.symbol
        expression = sp.sympify(value)
        if expression.is_number:
            return output(name) if float(expression) else sp.S.Zero
        for node in expression.atoms(sp.Heaviside, sp.sign, sp.floor, sp.ceiling):
            self.jumps.add(in_variables(node.args[0]))
        for node in expression.atoms(sp.core.relational.Relational):
            self.jumps.add(in_variables(node.lhs - node.rhs))
        return in_variables(expression)
