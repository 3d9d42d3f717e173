"""What is wrong with the outputs of a model's own, in words: symbols, units, missing values."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

import sympy as sp
from sympy.core.function import AppliedUndef

from ..names import MULTIPLIER, read
from .dimensions import check_dimension
from .elements import TIME, Contact, Expr, ModelFields, Nonholonomic, Peak, name_of
from .reactions import force_of_constraint, multiplier, reaction_units, reactions_in
from .symbols import known_symbols, plain, undeclared
from .units import Unit, declared_unit

HIGHEST = 2  # order of a derivative


def check_outputs(model: ModelFields, problems: list[str]) -> None:
    """Symbols that are none of the model's, quotients without a value."""
    problems += [
        f"{peak!r}, expected the name of an output of the FMU, as Peak('lambda.rod')"
        for peak in model.peaks
        if not isinstance(peak, Peak) or not isinstance(peak.of, str) or not peak.of
    ]
    constraints = {c.name for c in model.constraints}
    reactions = {multiplier(name) for name in constraints}
    reactions |= {force_of_constraint(q) for q in model.directions}
    known = known_symbols(model)
    for o in model.outputs:
        what = f"output {o.name!r}"
        if o.unique and o.name in constraints:
            problems.append(
                f"{what} has the name of a constraint, so that 'unique.{o.name}' would be two things: "
                "rename one"
            )
        for expression in (o.expression, 0 if o.otherwise is None else o.otherwise):
            problems += undeclared(model, what, expression, reactions_in(expression), known)
            problems += _unknown(model, what, sp.sympify(expression), reactions)
        if o.otherwise is None:
            problems += _undefined(model, what, sp.sympify(o.expression))


def check_output_units(model: ModelFields, units: Mapping[Expr, Unit], problems: list[str]) -> None:
    """Each term has the dimension of the output's unit; `otherwise` may be a plain number."""
    known = {**units, **(reaction_units(model, units) if model.outputs else {})}
    for o in model.outputs:
        what = f"output {o.name!r}"
        unit = declared_unit(o.unit, what, problems)
        if unit is None or any(r not in known for r in reactions_in(o.expression)):
            continue  # or of a constraint without a unit of its own, which is told there
        problems += check_dimension(sp.sympify(o.expression), unit, known, what)
        if o.otherwise is not None and not sp.sympify(o.otherwise).is_number:
            problems += check_dimension(sp.sympify(o.otherwise), unit, known, f"{what}, otherwise")


def _unknown(
    model: ModelFields, what: str, expression: Expr, reactions: Collection[Expr]
) -> Iterator[str]:
    for symbol in reactions_in(expression):
        if symbol not in reactions:
            constraints = [c.name for c in model.constraints]
            kind = "constraint" if read(str(symbol)).quantity == MULTIPLIER else "coordinate"
            known_names = constraints if kind == "constraint" else map(name_of, model.directions)
            yield (
                f"{what}: {symbol} is of no {kind} of this model, expected one of "
                f"{', '.join(known_names) or 'none: there are no constraints'}"
            )
    yield from _derivatives(model, what, expression)


def _derivatives(model: ModelFields, what: str, expression: Expr) -> Iterator[str]:
    found = sorted(expression.atoms(sp.Derivative), key=str)
    prescribed = {i.symbol for i in model.prescribed} if found else set()
    for d in found:
        highest = HIGHEST - (d.expr in model.speeds)
        if d.derivative_count > highest:
            yield (
                f"{what}: holds {plain(d)}, a derivative of order {d.derivative_count}, expected at "
                f"most {highest}"
            )
        elif d.expr in {i.symbol for i in model.inputs} - prescribed:
            yield (
                f"{what}: holds {plain(d)}, but only an input that stands in a constraint or in "
                "kinematics (a prescribed motion) has derivatives: make the rate an Input of its own"
            )


def _undefined(model: ModelFields, what: str, expression: Expr) -> Iterator[str]:
    """Quotients and logarithms without a value while a contact is open."""
    below = [e.base for e in expression.atoms(sp.Pow) if e.exp.could_extract_minus_sign()]
    below += [e.args[0] for e in expression.atoms(sp.log)]
    below = sorted((e for e in map(sp.sympify, below) if reactions_in(e)), key=str)
    for contact in (c.name for c in model.constraints if below and isinstance(c, Contact)):
        nothing = _nothing_in_the_open(model, contact)
        for e in below:
            if e.xreplace(nothing).expand() == 0:
                yield (
                    f"{what}: divides by {plain(e)}, which is 0 while the contact {contact!r} is open, "
                    "so that it has no value there: say which with otherwise=..., e.g. otherwise=0"
                )


def _nothing_in_the_open(model: ModelFields, contact: str) -> dict[Expr, Expr]:
    """The multipliers and forces of constraint that are 0 while a contact is open."""
    gone, left = {}, set()
    for c in model.constraints:
        if c.name == contact or getattr(c, "while_closed", None) == contact:
            gone[multiplier(c.name)] = sp.S.Zero
        elif hasattr(c, "expression"):
            held = sp.sympify(c.expression).atoms(AppliedUndef, sp.Derivative)
            rate = isinstance(c, Nonholonomic)
            left |= {q for q in model.coordinates if (q.diff(TIME) if rate else q) in held}
            left |= held & model.speeds.keys()
    for q in left & model.kinematics.keys():
        left |= sp.sympify(model.kinematics[q]).atoms(AppliedUndef) & model.speeds.keys()
    return gone | {force_of_constraint(q): sp.S.Zero for q in model.directions if q not in left}
