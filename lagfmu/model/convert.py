"""Conversion of a `sympy.physics.mechanics.LagrangesMethod` or `System` that a user already has.

SymPy's equations are  d/dt dL/dv - dL/dq - Q_nc + a^T lambda_sympy = 0  (`form_lagranges_equations`), so
that its multiplier is minus ours, while `solve_multipliers` and `rhs` do not agree with each other.  Only
the Lagrangian, the forces and the constraint equations are taken over; lambda gets its sign from
equations.py: +G^T lambda beside the forces.  The generalized speeds u of a System are written as
velocities q' by its kinematic equations.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy as sp
from sympy.physics.mechanics import LagrangesMethod, Lagrangian, System

from ..errors import ModelError
from .elements import TIME, Expr
from .model import Constraint, Holonomic, Input, Model, Nonholonomic, Parameter, name_of


def from_lagranges_method(
    method: LagrangesMethod | System,
    name: str,
    coordinates: Mapping[Expr, str],
    parameters: Sequence[Parameter] = (),
    *,
    inputs: Sequence[Input] = (),
    start: Mapping[Expr, float] | None = None,
    constraint_names: Sequence[str] | None = None,
    description: str = "",
) -> Model:
    """The same system as a Model, with our sign of lambda; a System is taken as its LagrangesMethod.

    `coordinates` gives the unit of each of the method's coordinates, which SymPy does not know.
    Forces are read from the method's force list.  `constraint_names` name its holonomic constraints,
    then its nonholonomic ones; the default is c1, c2, ...

    Raises ModelError as Model does, and if coordinates or names do not match the method.
    """
    speeds: dict[Expr, Expr] = {}
    kind = type(method).__name__
    if isinstance(method, System):
        speeds = _velocities(method, name)
        method = _method_of(method, speeds)
    q = list(method.q)
    problems = [
        f"coordinate {name_of(c)!r} of the {kind} has no unit: add it to `coordinates`"
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
        forces=_forces(method, q, speeds),
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


def _velocities(system: System, name: str) -> dict[Expr, Expr]:
    """The generalized speeds u as functions of q and q', from the System's kinematic equations."""
    u = list(system.u)
    found = sp.solve(list(system.kdes), u, dict=True) if u and system.kdes else []
    missing = [name_of(s) for s in u if not found or s not in found[0]]
    if missing:
        raise ModelError(
            name,
            [
                f"the kinematic equations of the System do not determine its speeds {', '.join(missing)}, "
                "expected u = f(q, q'): add_kdes(q.diff() - u)"
            ],
        )
    return dict(found[0]) if found else {}


def _method_of(system: System, speeds: Mapping[Expr, Expr]) -> LagrangesMethod:
    """The LagrangesMethod that the System would make, with velocities instead of speeds."""
    actuators = [load for actuator in system.actuators for load in actuator.to_loads()]
    energy = Lagrangian(system.frame, *system.bodies)
    return LagrangesMethod(
        sp.sympify(energy).xreplace(speeds),
        list(system.q),
        forcelist=[*system.loads, *actuators] or None,
        bodies=list(system.bodies),
        frame=system.frame,
        hol_coneqs=list(system.holonomic_constraints),
        nonhol_coneqs=[e.xreplace(speeds) for e in system.nonholonomic_constraints],
    )


def _forces(
    method: LagrangesMethod, q: Sequence[Expr], speeds: Mapping[Expr, Expr]
) -> dict[Expr, Expr]:
    """Generalized forces Q_j = sum F . dv/d(qdot_j) of the method's force list (Kane's formula)."""
    frame = method.inertial
    forces: dict[Expr, Expr] = {}
    for body, load in method.forcelist or []:
        velocity = body.vel(frame) if hasattr(body, "vel") else body.ang_vel_in(frame)
        velocity, load = velocity.xreplace(speeds), load.xreplace(speeds)
        for c in q:
            share = velocity.diff(c.diff(TIME), frame).dot(load)
            forces[c] = forces.get(c, sp.S.Zero) + share
    return {c: f for c, f in forces.items() if f != 0}
