"""Lagrange's equations as statements about what an FMU reports, straight from the model.

    d/dt dL/dv_j - dL/dq_j = Q_nc,j + Q_j                  for each coordinate that is not moved by kinematics
    d/dt dL/dw + w x dL/dw - X L = Q_nc + Q                for each angular velocity w in the frame of a body,
                                                           X the derivative along w (mechanics/kinematics.py)
    d^2 f/dt^2 = 0   or   d/dt (sum a_j v_j + a_0) = 0     for each constraint, while it acts
    Q_cj = lambda_c a_cj ,   residual_c = f   or   sum a_j v_j + a_0
    friction: |lambda| <= mu_s |N| while it sticks, lambda = -mu_k |N| s/|s| while it slips, lambda . s <= 0;
    margin = mu_s |N| - |lambda|, power = lambda . s, 0 while it sticks
    an Output of the model = its expression, of the values that are reported beside it

They hold at each instant, whatever the parameters, the inputs and the tolerance, and together they
determine the accelerations, lambda and Q: nothing of the FMU's own derivation, code and linear algebra stands
in them.  A solution of linear equations that is stable fulfils them to rounding, however badly they
are conditioned (Higham, Accuracy and Stability of Numerical Algorithms, sect. 7.1), in the metric of
M: relative to  sqrt(M_jj) S  and  S sum_j |a_j| / sqrt(M_jj) ,  S = sum_k |terms of equation k| / sqrt(M_kk),
where the terms of Q_j are its shares.  So equation j is held divided by sqrt(M_jj), and S is summed from what
the equations are on the run: written out in each of them it would make them grow with their square.  `scale`
has the shares alone.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import sympy as sp
from sympy.core.function import AppliedUndef
from sympy.core.relational import Relational

from ... import names
from ...files import write_whole
from ...fmu.closed_forms import pack_closed_forms
from ...mechanics.kinematics import angular_velocity
from ...model.attitude import written_out
from ...model.closed_form import ClosedForm, in_variables, output
from ...model.elements import TIME, Constraint, Expr, Tie
from ...model.model import Contact, Friction, Model, Nonholonomic, name_of
from ...model.speeds import quaternions
from ...numeric.functions import across
from ...prepare.steps import Prepared
from .invariants import EQUATION, MASSLESS, RATE, SLOW, magnitude
from .specimen import beside

ROUNDING = 1e-13  # relative to those terms; see closed_forms.LEEWAY
CONE = 1e-12  # of Coulomb's cone
ON = 1e-12  # of the terms of a jump's surface: a motion that stands on it
GAP = 4e-10  # of f, whose level a contact that closes within the gap of touching keeps


def lay_beside(fmu: Path, prepared: Prepared) -> None:
    """Write the equations to where the judge of the FMU looks for them."""
    variables = frozenset(v.name for v in prepared.table.variables)
    forms = lagrange(prepared.model, variables)
    write_whole(beside(fmu), pack_closed_forms(prepared.scene, forms, prepared.table))


def lagrange(model: Model, variables: frozenset[str]) -> list[ClosedForm]:
    """The equations that can be held against an FMU with these variables."""
    sides, masses = _sides(model, variables)
    shares = _shares(sides, model, variables)
    forms, when = [], _beside_jumps(model)
    for q, (inertia, force) in sides.items():
        name, weight = EQUATION + name_of(q), sp.sqrt(masses[q])
        if weight == 0:
            name, weight = MASSLESS + name_of(q), sp.S.One
        left, right, scale = (e / weight for e in (inertia, force, shares[q]))
        forms.append(ClosedForm(name, right, left, scale=scale, when=when, rounding=ROUNDING))
    forms += _of_constraints(model, {q: 1 / sp.sqrt(M) for q, M in masses.items() if M != 0})
    forms += _of_shares(model, variables)
    for law in model.frictions:
        forms += _of_friction(model, law)
    for o in model.outputs:
        forms.append(ClosedForm(o.name, o.expression, rounding=ROUNDING))
    return [form for form in map(_written_out, forms) if _names(form) <= variables]


def _written_out(form: ClosedForm) -> ClosedForm:
    """With polynomials for rotation matrices."""
    parts = {name: getattr(form, name) for name in ("expected", "actual", "scale", "when")}
    return replace(
        form, **{k: written_out(sp.sympify(e)) for k, e in parts.items() if e is not None}
    )


def _beside_jumps(model: Model) -> Expr | None:
    """1 where no force jumps, else 0: on a surface, as far as it is known, either side is right."""
    forces = [sp.sympify(e) for e in model.forces.values()]
    surfaces = {n.args[0] for e in forces for n in e.atoms(sp.sign, sp.Heaviside)}
    surfaces |= {r.lhs - r.rhs for e in forces for r in e.atoms(Relational)}
    surfaces |= {sp.sin(sp.pi * n.args[0]) for e in forces for n in e.atoms(sp.floor)}
    known = [in_variables(h) for h in surfaces]
    beside = [sp.Heaviside(sp.Abs(h) - ON * magnitude(h), 0) for h in known]
    return sp.Mul(*beside) if beside else None


def _sides(model: Model, variables: frozenset[str]) -> tuple[Any, Any]:
    """Of each coordinate or angular velocity: the two sides of its equation, and the mass."""
    L, left, masses = written_out(model.energy_expression), {}, {}
    for q in model.coordinates:
        if q not in model.kinematics:
            left[q] = L.diff(q.diff(TIME)).diff(TIME) - L.diff(q)
            masses[q] = sp.Abs(in_variables(L.diff(q.diff(TIME), 2)))
    rates = {q: written_out(sp.sympify(rate)) for q, rate in model.kinematics.items()}
    slope = {q: L.diff(q) for q in rates}
    for four in quaternions(model):
        turning = angular_velocity(model, four)
        if turning is None:  # of axes that are not the body's
            continue
        momentum = [L.diff(w) for w in turning]
        for w, spin, bend in zip(turning, momentum, across(turning, momentum), strict=True):
            along = sp.Add(*(slope[q] * rate.diff(w) for q, rate in rates.items() if rate.has(w)))
            left[w] = spin.diff(TIME) + bend - along
            masses[w] = sp.Abs(in_variables(L.diff(w, 2)))
    sides = {}
    for q, side in left.items():
        name = names.name(names.FORCE, "", name_of(q))
        force = written_out(sp.sympify(model.forces.get(q, 0)))
        sides[q] = (side, force + (output(name) if name in variables else 0))
    return sides, masses


def _shares(of: Iterable[Expr], model: Model, variables: frozenset[str]) -> dict[Expr, Expr]:
    """The magnitudes of what constraints contribute to Q, whose sum may be far smaller."""
    found = {}
    for q in of:
        known = [names.name(names.FORCE, c.name, name_of(q)) for c in model.constraints]
        found[q] = sp.Add(*(sp.Abs(output(n)) for n in known if n in variables))
    for tie in (c for c in model.constraints if isinstance(c, Tie)):
        rate = written_out(
            tie.rates[0]
        )  # linear in the angular velocities, for which no share is reported
        push = output(names.name(names.MULTIPLIER, tie.name))
        for w in found.keys() & rate.atoms(AppliedUndef):
            found[w] += sp.Abs(push * in_variables(rate.diff(w)))
    return found


def _of_friction(model: Model, law: Friction) -> list[ClosedForm]:
    """Coulomb's law, whichever mode the FMU says that it is in."""
    zero, forms, size = sp.S.Zero, [], sp.S.Zero

    def holds(name: str, expected: Expr, actual: Expr, scale: Expr, **more: Any) -> None:
        form = ClosedForm(name, expected, actual, scale=scale, **{"rounding": ROUNDING} | more)
        forms.append(form)

    sticks = output(names.name(names.STICKS, law.name))
    lam = [output(names.name(names.MULTIPLIER, name)) for name in law.of]
    slip = [output(names.name(names.SLIP, name)) for name in law.of]
    for name, s in zip(law.of, slip, strict=True):
        rate = sp.sympify(model.constraint(name).expression)
        if not isinstance(model.constraint(name), Nonholonomic):
            rate = rate.diff(TIME)
        terms = magnitude(in_variables(rate))
        size += terms
        holds(names.name(names.SLIP, name), rate, s, terms)
        holds(f"{name} while it sticks", zero, s, terms, when=sticks)
    N, force = sp.Abs(in_variables(sp.sympify(law.normal))), sp.sqrt(sum(x**2 for x in lam))
    static, kinetic = in_variables(sp.sympify(law.static)), in_variables(sp.sympify(law.sliding))
    speed = sp.sqrt(sum(s**2 for s in slip))
    slips = (1 - sticks) * sp.Max(0, speed - SLOW * size)
    margin, power = names.name(names.MARGIN, law.name), names.name(names.POWER, law.name)
    work = (1 - sticks) * sp.Add(*(x * s for x, s in zip(lam, slip, strict=True)))
    cone = sp.Max(0, force - static * N)
    holds(f"cone of {law.name}", zero, cone, force + static * N, when=sticks, rounding=CONE)
    holds(f"heat of {law.name}", zero, sp.Max(0, output(power)), force * speed, when=slips)
    holds(margin, static * N - force, output(margin), force + static * N)
    holds(power, work, output(power), (1 - sticks) * force * speed)
    for x, s in zip(lam, slip, strict=True):
        along = sp.sign(s) if len(slip) == 1 else s / speed
        pull = -kinetic * N * along
        holds(f"{x} while it slips", pull, x, kinetic * N, when=slips, rounding=CONE)
    return forms


def _of_shares(model: Model, variables: frozenset[str]) -> list[ClosedForm]:
    found = []
    for c in model.constraints:
        f, lam = sp.sympify(c.expression), output(names.name(names.MULTIPLIER, c.name))
        contact = c.name if isinstance(c, Contact) else c.while_closed
        for q in model.coordinates:
            share = names.name(names.FORCE, c.name, name_of(q))
            if share in variables:
                expected = lam * _along(c, q)
                found.append(ClosedForm(share, expected, output(share), rounding=ROUNDING))
        rounding, residual = (
            ROUNDING if contact is None else GAP,
            names.name(names.RESIDUAL, c.name),
        )
        if c.name in model.limited and not isinstance(c, Nonholonomic):
            f = f.diff(TIME)  # what is reported is the missed velocity
        found.append(ClosedForm(residual, f, output(residual), rounding=rounding))
    return found


def _along(constraint: Constraint, q: Expr) -> Expr:
    """a_cq, of which lambda makes the constraint's share in Q.q."""
    f = sp.sympify(constraint.expression)
    return f.diff(q.diff(TIME)) if isinstance(constraint, Nonholonomic) else f.diff(q)


def _of_constraints(model: Model, accelerations: dict[Expr, Expr]) -> list[ClosedForm]:
    """Where S makes these accelerations.  Without those in attitudes, of which formulas of two derivatives
    would take a page each."""
    found = []
    for c in model.constraints:
        rate, along = sp.sympify(c.expression), accelerations
        if rate.has(*model.kinematics, *model.speeds):
            continue
        if isinstance(c, Nonholonomic):
            along = {q.diff(TIME): a for q, a in accelerations.items()}
        scale = sp.Add(*(sp.Abs(in_variables(rate.diff(x))) * a for x, a in along.items()))
        for _ in range(1 if isinstance(c, Nonholonomic) else 2):
            rate = rate.diff(TIME)
        contact = c.name if isinstance(c, Contact) else c.while_closed
        friction = model.limited.get(c.name)
        found.append(
            ClosedForm(
                RATE + c.name,
                sp.S.Zero,
                rate,
                while_closed=contact,
                when=None if friction is None else output(names.name(names.STICKS, friction.name)),
                scale=scale,
                rounding=ROUNDING,
            )
        )
    return found


def _names(form: ClosedForm) -> set[str]:
    actual = output(form.name) if form.actual is None else form.actual
    parts = [actual, form.expected, *(e for e in (form.scale, form.when) if e is not None)]
    used = set().union(*(in_variables(sp.sympify(e)).free_symbols for e in parts))
    return {str(s) for s in used} - {"time"}
