"""Conversion of a `sympy.physics.mechanics.LagrangesMethod` that a user already has.

SymPy's equations are  d/dt dL/dv - dL/dq - Q_nc + a^T lambda_sympy = 0  (`form_lagranges_equations`), so
that its multiplier is minus ours, while `solve_multipliers` and `rhs` do not agree with each other.  Only
the Lagrangian, the forces and the constraint equations are taken over; lambda gets its sign from
equations.py: +G^T lambda beside the forces.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import sympy as sp
from sympy.physics.mechanics import LagrangesMethod
from sympy.physics.vector import dynamicsymbols

from .errors import ModelError
from .model import Constraint, Holonomic, Input, Model, Nonholonomic, Parameter, name_of

Expr = Any


def from_lagranges_method(
    method: LagrangesMethod,
    name: str,
    coordinates: Mapping[Expr, str],
    parameters: Sequence[Parameter] = (),
    *,
    inputs: Sequence[Input] = (),
    start: Mapping[Expr, float] | None = None,
    constraint_names: Sequence[str] | None = None,
    description: str = "",
) -> Model:
    """The same system as a Model, with our sign of lambda.

    `coordinates` gives the unit of each of the method's coordinates, which SymPy does not know.
    Forces are read from the method's force list.  `constraint_names` name its holonomic constraints,
    then its nonholonomic ones; the default is c1, c2, ...

    Raises ModelError as Model does, and if coordinates or names do not match the method.
    """
    q = list(method.q)
    problems = [
        f"coordinate {name_of(c)!r} of the LagrangesMethod has no unit: add it to `coordinates`"
        for c in q
        if c not in coordinates
    ]
    holonomic, nonholonomic = _constraint_expressions(method)
    count = len(holonomic) + len(nonholonomic)
    names = list(constraint_names or (f"c{k + 1}" for k in range(count)))
    if len(names) != count:
        problems.append(
            f"{len(names)} constraint names were given, expected {count}: {len(holonomic)} for the "
            f"holonomic and {len(nonholonomic)} for the nonholonomic constraints"
        )
    if problems:
        raise ModelError(name, problems)
    constraints: list[Constraint] = [
        Holonomic(n, f) for n, f in zip(names, holonomic, strict=False)
    ]
    constraints += [
        Nonholonomic(n, f) for n, f in zip(names[len(holonomic) :], nonholonomic, strict=True)
    ]
    return Model(
        name=name,
        lagrangian=method._L[0],
        coordinates={c: coordinates[c] for c in q},
        forces=_forces(method, q),
        constraints=constraints,
        parameters=parameters,
        inputs=inputs,
        start=start or {},
        description=description,
    )


def _constraint_expressions(method: LagrangesMethod) -> tuple[list[Expr], list[Expr]]:
    """Holonomic f(q, t), and the nonholonomic expressions that follow their derivatives in coneqs."""
    holonomic = list(method._hol_coneqs)
    return holonomic, list(method.coneqs)[len(holonomic) :]


def _forces(method: LagrangesMethod, q: Sequence[Expr]) -> dict[Expr, Expr]:
    """Generalized forces Q_j = sum F . dv/d(qdot_j) of the method's force list (Kane's formula)."""
    t, frame = dynamicsymbols._t, method.inertial
    forces: dict[Expr, Expr] = {}
    for body, load in method.forcelist or []:
        velocity = body.vel(frame) if hasattr(body, "vel") else body.ang_vel_in(frame)
        for c in q:
            share = velocity.diff(c.diff(t), frame).dot(load)
            forces[c] = forces.get(c, sp.S.Zero) + share
    return {c: f for c, f in forces.items() if f != 0}
