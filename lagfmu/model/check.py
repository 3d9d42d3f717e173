"""Everything that is wrong with a Model, in words: numbers, symbols, units, dimensions.

A term of the energy is in J, a generalized force in J/[coordinate]; a constraint is homogeneous.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

import sympy as sp
from sympy.core.function import AppliedUndef

from ..names import MULTIPLIER, read
from .dimensions import check_dimension
from .elements import (
    TIME,
    Contact,
    Expr,
    ModelFields,
    Nonholonomic,
    Peak,
    is_number,
    known_symbols,
    name_of,
    plain,
    symbols_in,
    undeclared,
)
from .frictions import check_frictions
from .kinds import check_energy, check_names, check_types, unusable_surfaces
from .picture import check_page, check_picture
from .reactions import force_of_constraint, multiplier, reaction_units, reactions_in
from .speeds import check_rates, check_speeds
from .spline import Spline, splines_in
from .units import ENERGY, POWER, Unit, declared_unit, parse_unit

HIGHEST = 2  # order of a derivative


def _check_outputs(model: ModelFields, problems: list[str]) -> None:
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


def _check_output_units(
    model: ModelFields, units: Mapping[Expr, Unit], problems: list[str]
) -> None:
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


# of a prescribed motion: inputs too, or from the communication points
RATES = ("given", "estimated")


def problems_of(model: ModelFields) -> list[str]:
    """All problems of a model whose containers are right (`kinds.check_containers`)."""
    problems: list[str] = []
    check_types(model, problems)
    if problems:
        return problems
    check_names(model, problems)
    check_energy(model, problems)
    if problems:
        return problems
    _check_numbers(model, problems)
    _check_symbols(model, problems)
    check_speeds(model, problems)
    problems += unusable_surfaces(model)
    _check_outputs(model, problems)
    check_picture(model, problems)
    check_page(model, problems)
    _check_splines(model, problems)
    units = declared_units(model, problems)
    if not problems:
        _check_dimensions(model, units, problems)
        problems += check_frictions(model, units, reaction_units(model, units))
        _check_output_units(model, units, problems)
    return problems


def _check_numbers(model: ModelFields, problems: list[str]) -> None:
    for p in model.parameters:
        _finite(f"parameter {name_of(p.symbol)!r}", p.value, problems)
        for bound, value in (("min", p.min), ("max", p.max)):
            if value is not None:
                _finite(f"{bound} of parameter {name_of(p.symbol)!r}", value, problems)
        if any(b is not None and not is_number(b) for b in (p.min, p.max)):
            continue
        if p.min is not None and p.max is not None and p.min > p.max:
            problems.append(
                f"parameter {name_of(p.symbol)!r}: min = {p.min!r} is above max = {p.max!r}, so that "
                "no value is allowed: exchange them"
            )
        elif is_number(p.value) and (
            (p.min is not None and p.value < p.min) or (p.max is not None and p.value > p.max)
        ):
            problems.append(
                f"parameter {name_of(p.symbol)!r} = {p.value!r} is outside its own bounds "
                f"[{p.min}, {p.max}]"
            )
        if p.symbol.is_positive and is_number(p.value) and not p.value > 0:
            problems.append(
                f"parameter {name_of(p.symbol)!r} = {p.value!r}, but its symbol was declared "
                "positive: give a positive value or drop the assumption"
            )
    for i in model.inputs:
        _finite(f"start of input {name_of(i.symbol)!r}", i.start, problems)
        _finite(f"rate of input {name_of(i.symbol)!r}", i.rate, problems)
        if i.rates not in RATES:
            problems.append(
                f"rates of input {name_of(i.symbol)!r} is {i.rates!r}, expected one of "
                f"{', '.join(map(repr, RATES))}"
            )
        elif i.rates != "given" and i not in model.prescribed:
            problems.append(
                f"rates of input {name_of(i.symbol)!r} is {i.rates!r}, but only an input that stands in "
                "a constraint (a prescribed motion) has rates: leave it out"
            )
        if is_number(i.rate) and i.rate != 0 and i not in model.prescribed:
            problems.append(
                f"rate of input {name_of(i.symbol)!r} is {i.rate!r}, but only an input that stands in a "
                "constraint (a prescribed motion) has one: leave it out"
            )
    parameters = {p.symbol: p.value for p in model.parameters}
    _check_start("start", model.start, set(model.states), parameters, problems)
    problems += [
        f"rough holds {plain(sp.sympify(s))}, which has no start: give it one, or leave it out of rough"
        for s in model.rough
        if s not in model.start
    ]
    if model.embedding is not None:
        states = {s for q in model.embedding.coordinates for s in (q, q.diff(TIME))}
        _check_start("embedding start", model.embedding.start, states, parameters, problems)
        for q in model.embedding.relations:
            if q not in model.coordinates:
                problems.append(f"embedding gives {plain(q)}, which is no coordinate of the model")


def _check_start(
    what: str,
    start: Mapping[Expr, Expr],
    states: set[Expr],
    parameters: Mapping[Expr, float],
    problems: list[str],
) -> None:
    for state, value in start.items():
        if isinstance(state, str):
            problems.append(
                f"{what} has the text {state!r} as a key, expected a coordinate or its velocity: write "
                f"{read(state).coordinate} without quotes"
                + (", and .diff() behind it" if read(state).order else "")
            )
            continue
        if state not in states:
            problems.append(
                f"{what} names {plain(state)}, which is neither a coordinate nor a speed"
                + (" (it moves by `kinematics`)" if state.is_Derivative else "")
            )
        if isinstance(value, sp.Basic) and value.free_symbols:
            if others := sorted(map(plain, symbols_in(value) - set(parameters))):
                problems.append(
                    f"{what} of {plain(state)} = {plain(value)} holds {', '.join(others)}, expected a number "
                    "or an expression of parameters"
                )
                continue
            if not all(map(is_number, parameters.values())):
                continue  # told there
            found = value.xreplace({s: sp.Float(x) for s, x in parameters.items()}).evalf()
            if not found.is_Float or not found.is_finite:
                problems.append(
                    f"{what} of {plain(state)} = {plain(value)} is {found} at the values of the parameters, "
                    "expected a finite number"
                )
            continue
        _finite(f"{what} of {plain(state)}", value, problems)


def _finite(what: str, value: object, problems: list[str]) -> None:
    if not is_number(value):
        quotes = ", without quotes" if isinstance(value, str) else ""
        problems.append(f"{what} is {value!r}, expected a finite number{quotes}")


def splines_of(model: ModelFields) -> list[Spline]:
    """The tables that stand in a model's expressions, by name."""
    relations = model.embedding.relations.values() if model.embedding else ()
    others = [0 if o.otherwise is None else o.otherwise for o in model.outputs]
    return splines_in(
        [
            *(e for _, e in _expressions(model)),
            *(o.expression for o in model.outputs),
            *others,
            *relations,
        ]
    )


def _check_splines(model: ModelFields, problems: list[str]) -> None:
    """Two tables of one name could not be told apart in the FMU's code and closed forms."""
    splines = splines_of(model)
    taken = [s.name + ("_" + "x" * order if order else "") for s in splines for order in range(4)]
    for s in splines:
        if taken.count(s.name) > 1:
            problems.append(
                f"two tables are called {s.name!r}, or one as the other's slope: rename one"
            )


def _expressions(model: ModelFields) -> list[tuple[str, Expr]]:
    kind = "lagrangian" if model.lagrangian is not None else "kinetic_energy"
    out = [(kind, model.energy_expression)]
    out += [(f"force on {plain(q)}", sp.sympify(f)) for q, f in model.forces.items()]
    out += [(f"kinematics of {plain(q)}", sp.sympify(e)) for q, e in model.kinematics.items()]
    out += [(f"unwrapped {plain(q)}", sp.sympify(e)) for q, e in model.unwrapped.items()]
    out += [(f"constraint {c.name!r}", sp.sympify(c.expression)) for c in model.constraints]
    for c in model.constraints:
        if isinstance(c, Contact):
            out.append((f"restitution of {c.name!r}", sp.sympify(c.restitution)))
    return out


def _check_symbols(model: ModelFields, problems: list[str]) -> None:
    moving, directions = {*model.coordinates, *model.speeds}, {*model.directions}
    pfaffian = {f"constraint {c.name!r}" for c in model.constraints if isinstance(c, Nonholonomic)}
    known = known_symbols(model)
    for q in model.forces:
        if q in model.kinematics:
            problems.append(
                f"a force is given on {plain(q)}, which moves by `kinematics`: give it on the speeds"
            )
        elif q not in directions:
            problems.append(f"a force is given on {plain(q)}, which is no coordinate of the model")
    for what, expression in _expressions(model):
        problems += _solved_for(what, expression)
        problems += undeclared(model, what, expression, reactions_in(expression), known)
        if what.startswith("constraint") and symbols_in(expression).isdisjoint(moving):
            problems.append(
                f"{what}: {expression} holds no coordinate, expected a condition on the motion: "
                "correct it or leave it out"
            )
        orders = [
            d.derivative_count + (d.expr in model.speeds) for d in expression.atoms(sp.Derivative)
        ]
        orders += [1 for w in expression.atoms(AppliedUndef) if w in model.speeds]
        limit = 0 if what.startswith("constraint") and what not in pfaffian else 1
        if any(order > limit for order in orders):
            problems.append(
                f"{what}: holds a derivative of order {max(orders)}, expected at most {limit}"
                + (": a constraint on velocities is Nonholonomic" if limit == 0 else "")
            )
    if model.embedding is not None:
        for q, phi in model.embedding.relations.items():
            independent = known - moving | set(model.embedding.coordinates)
            problems += [
                f"embedding of {plain(q)}: {name} is neither an independent coordinate nor a "
                "parameter"
                for name in sorted(map(plain, symbols_in(phi) - independent))
            ]


def _solved_for(what: str, expression: Expr) -> list[str]:
    """Multipliers where only what they are solved from can stand."""
    return [
        f"{what}: {symbol} is solved for together with the accelerations, so that it cannot stand in "
        "the equations: a force that a normal force limits is a Friction in `constraints`, a quantity "
        "to read is an Output in `outputs`"
        for symbol in reactions_in(expression)
    ]


def declared_units(model: ModelFields, problems: list[str]) -> dict[Expr, Unit]:
    """Unit of each symbol that may stand in an expression; what cannot be read joins `problems`."""
    units: dict[Expr, Unit] = {TIME: parse_unit("s", "time")}
    extra = model.embedding.coordinates if model.embedding else {}
    declared = [("coordinate", q, u) for q, u in (*model.coordinates.items(), *extra.items())]
    declared += [("speed", w, u) for w, u in model.speeds.items()]
    declared += [("parameter", p.symbol, p.unit) for p in model.parameters]
    declared += [("input", i.symbol, i.unit) for i in model.inputs]
    for kind, symbol, text in declared:
        unit = declared_unit(text, f"{kind} {name_of(symbol)!r}", problems)
        if unit is None:
            continue
        units[symbol] = unit
        if isinstance(symbol, AppliedUndef):
            units[symbol.diff(TIME)] = unit.per_second()
            units[symbol.diff(TIME, 2)] = unit.per_second().per_second()
    return units


def _check_dimensions(model: ModelFields, units: dict[Expr, Unit], problems: list[str]) -> None:
    def check(expression: Expr, expected: Unit | None, what: str) -> None:
        problems.extend(check_dimension(sp.sympify(expression), expected, units, what))

    kind = "lagrangian" if model.lagrangian is not None else "kinetic_energy"
    check(model.energy_expression, ENERGY, kind)
    for q, force in model.forces.items():
        unit = POWER / units[q] if q in model.speeds else ENERGY / units[q]
        check(force, unit, f"force on {plain(q)}")
    check_rates(model, units, problems)
    for constraint in model.constraints:
        check(constraint.expression, None, f"constraint {constraint.name!r}")
        if isinstance(constraint, Contact):
            one = POWER / POWER
            check(constraint.restitution, one, f"restitution of {constraint.name!r}")
    starts = list(model.start.items())
    if model.embedding is not None:
        starts += model.embedding.start.items()
        for q, phi in model.embedding.relations.items():
            check(phi, units[q], f"embedding of {plain(q)}")
    for state, value in starts:
        if sp.sympify(value).free_symbols:
            check(value, units[state], f"start of {plain(state)}")
