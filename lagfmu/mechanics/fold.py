"""Parameters that stay as they are, and inputs that nothing drives, as numbers in the equations."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import sympy as sp

from ..errors import RequestError, UnitError
from ..model.elements import TIME, Expr
from ..model.model import Contact, Model, Parameter, name_of
from ..model.rule import Rule
from ..model.scene import Scene
from ..model.selection import select
from ..model.units import Unit, parse_quantity
from .equations import EquationsOfMotion
from .form import Form


def numbers_of(eom: EquationsOfMotion, scene: Scene, problems: list[str]) -> dict[Expr, Expr]:
    """The parameters that the scene fixes and the inputs that nothing drives, with their values."""
    values: dict[Expr, float] = {}
    parameters = {name_of(p.symbol): p for p in eom.parameters}
    for text in scene.fixed:
        name, given, number = (part.strip() for part in text.partition("="))
        for found in select([name], list(parameters), "fixed parameter", problems):
            p = parameters[found]
            unit = eom.units[found]
            value = _value(p, unit, number, problems) if given else float(p.value)
            if value is not None:
                values[p.symbol] = value
    inputs = {name_of(i.symbol): i for i in eom.model.inputs}
    driven = select(scene.inputs, list(inputs), "input", problems)
    for name, i in inputs.items():
        if name not in driven and not i.rate:  # one that moves by itself stays an input
            u = eom.symbols.get(i.symbol, i.symbol)
            rate = eom.rates.get(u)
            if u in eom.estimated:
                values[eom.u[eom.u.index(u) + 3]] = 0.0
            values |= {u: float(i.start)} | ({rate: 0.0, eom.rates[rate]: 0.0} if rate else {})
    return {symbol: _number(value) for symbol, value in values.items()}


def _value(p: Parameter, unit: Unit, text: str, problems: list[str]) -> float | None:
    name = name_of(p.symbol)
    try:
        value = parse_quantity(text, unit, f"fixed parameter {name!r}")
    except UnitError as error:
        problems.append(str(error))
        return None
    rule = Rule(name, minimum=p.min, maximum=p.max, positive=bool(p.symbol.is_positive))
    if problem := rule.problem(value):
        problems.append(f"fixed parameter {problem}")
        return None
    return value


def _number(value: float) -> Expr:
    """An integer as such, so that a factor 1 and a term 0 vanish."""
    return sp.Integer(int(value)) if value.is_integer() and abs(value) < 2**53 else sp.Float(value)


def folded(eom: EquationsOfMotion, numbers: Mapping[Expr, Expr]) -> EquationsOfMotion:
    """The equations with the numbers put in.  Raises RequestError if they divide by zero."""
    if not numbers:
        return eom

    made = replace(
        eom.mapped(lambda e: _settled(e.xreplace(numbers))),
        u=tuple(s for s in eom.u if s not in numbers),
        p=tuple(s for s in eom.p if s not in numbers),
        rates={s: r for s, r in eom.rates.items() if s not in numbers},
        numbers={**eom.numbers, **numbers},
        told=eom.standing,
    )
    flat = made.solved + [o.expression for o in made.outputs if o.otherwise is None]
    if any(e.has(sp.zoo, sp.oo, sp.nan) for e in flat):
        given = ", ".join(f"{s} = {float(n)!r}" for s, n in numbers.items())
        raise RequestError(
            eom.model.name, [f"the equations divide by zero with the fixed values {given}"]
        )
    return made


def _settled(e: Expr) -> Expr:
    """cos(2) and sqrt(2) as numbers: what holds no symbol is evaluated here, not at run time."""
    return e.replace(
        lambda x: x.is_number and not x.is_Atom and not x.is_Rational, lambda x: x.evalf(17)
    )


def folded_form(form: Form, numbers: Mapping[Expr, Expr]) -> Form:
    """The same of a form."""
    if not numbers:
        return form
    equations, reduction = folded(form.equations, numbers), form.reduction
    if reduction is None:
        return replace(form, equations=equations)
    reduction = replace(
        reduction,
        phi=tuple(_settled(e.xreplace(numbers)) for e in reduction.phi),
        vel=tuple(_settled(e.xreplace(numbers)) for e in reduction.vel),
        reduced=folded(reduction.reduced, numbers),
    )
    return replace(form, equations=equations, reduction=reduction)


def values(symbols: Iterable[Expr], model: Model) -> dict[Expr, Expr]:
    """The model's values of some of its parameters."""
    wanted = set(symbols)
    return {p.symbol: _number(float(p.value)) for p in model.parameters if p.symbol in wanted}


def idle(form: Form) -> list[Expr]:
    """Parameters on which nothing that is left depends."""
    eom, reduction = form.equations, form.reduction
    flat = _expressions(eom)
    if reduction is not None:
        flat += [*reduction.phi, *reduction.vel, *_expressions(reduction.reduced)]
    used = set().union(*(e.free_symbols for e in flat)) if flat else set()
    return [p for p in eom.p if p not in used]


def _expressions(eom: EquationsOfMotion) -> list[Expr]:
    flat = [*eom.solved, *eom.f, eom.kinetic, eom.potential]
    flat += [e for o in eom.outputs for e in (o.expression, o.otherwise)]
    flat += [eom.plain(c.restitution) for c in eom.constraints if isinstance(c, Contact)]
    flat += [e for law in eom.frictions for e in law.expressions]
    flat += [*eom.starts().values(), *eom.sides.values()]
    return [sp.sympify(e) for e in flat if e is not None]


def damped(eom: EquationsOfMotion, numbers: Mapping[Expr, Expr]) -> bool:
    """True if a force that the user gives holds a velocity.

    What the Lagrangian gives conserves Jacobi's integral: without damping no part of the motion decays
    fast, which is the stiffness that an implicit method cures.
    """
    speeds = {eom.symbols[q.diff(TIME)] for q in eom.model.coordinates}
    forces = [sp.sympify(f).xreplace(eom.symbols) for f in eom.model.forces.values()]
    return any(f.xreplace(numbers).free_symbols & speeds for f in forces)
