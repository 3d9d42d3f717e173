"""What the user writes: a frozen description of a mechanical system.  No derivatives are taken here.

Two forms are accepted (the lectures' two): a Lagrangian L = T - V with non-conservative generalized
forces Q_nc (ME 6590 eq. 3), or the kinetic energy K with all generalized forces F_q (eq. 2).

Everything that is wrong with a model is reported at once, in one ModelError.
"""

from __future__ import annotations

import keyword
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import sympy as sp
from sympy.core.function import AppliedUndef
from sympy.physics.vector import dynamicsymbols

from .errors import ModelError, UnitError
from .units import ENERGY, POWER, Unit, check_dimension, parse_unit, plain

Expr = Any  # a SymPy expression; SymPy carries no types

NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*\Z")
_NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")  # XML 1.0, sect. 2.2
_NO_NUMBERS = (sp.I, sp.nan, sp.oo, -sp.oo, sp.zoo)
RESERVED: tuple[str, ...] = (
    *("Q", "contact", "count", "departure", "der", "energy", "lambda", "residual", "solver"),
    *("t", "time", "unique", "velocity"),
)


@dataclass(frozen=True)
class Parameter:
    """A constant of the model, settable before initialization.

    `value` is in coherent SI `unit`; `min` and `max` are the bounds that the equations make sense in.
    """

    symbol: Expr
    value: float
    unit: str = "1"
    description: str = ""
    min: float | None = None
    max: float | None = None


@dataclass(frozen=True)
class Input:
    """A quantity that the importer drives: a force, a torque, or a prescribed motion u(t).

    A dynamicsymbol that stands in a holonomic constraint or a contact is a prescribed motion: the
    FMU then has the inputs `u`, `der(u)` and `der(u,2)`, because the constraint's second derivative
    needs them.
    """

    symbol: Expr
    unit: str = "1"
    start: float = 0.0
    description: str = ""


@dataclass(frozen=True)
class Holonomic:
    """f(q, t) = 0.  The multiplier's unit is J/[f]; +lambda grad f is the force of constraint."""

    name: str
    expression: Expr
    description: str = ""
    while_closed: str | None = None


@dataclass(frozen=True)
class Nonholonomic:
    """sum_j a_j(q, t) v_j + a_0(q, t) = 0, affine in the velocities.  [lambda] = W/[expression]."""

    name: str
    expression: Expr
    description: str = ""
    while_closed: str | None = None


@dataclass(frozen=True)
class Contact:
    """f(q, t) >= 0, lambda >= 0, f lambda = 0: a surface that pushes and never pulls.

    `restitution` is Newton's coefficient for landings, a number or an expression of parameters.
    """

    name: str
    expression: Expr
    description: str = ""
    restitution: Expr = 0


Constraint = Holonomic | Nonholonomic | Contact


@dataclass(frozen=True)
class Embedding:
    """Dependent coordinates as functions of independent ones, q = phi(s, t).

    `coordinates` maps each new independent coordinate to its unit, `relations` each coordinate of
    the model that it replaces to its expression; `start` gives s and der(s) at the start.
    """

    coordinates: Mapping[Expr, str]
    relations: Mapping[Expr, Expr]
    start: Mapping[Expr, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Model:
    """A mechanical system.

    Either `lagrangian` (with non-conservative `forces`) or `kinetic_energy` (with all `forces`) is
    given; `forces` maps a coordinate to its generalized force in J/[coordinate].  `coordinates` maps
    each `dynamicsymbols` coordinate to its unit, `start` coordinates and their first derivatives to
    numbers in SI.  `descriptions` may explain coordinates.

    Raises ModelError with every problem at once: names, symbols, units, dimensions, numbers.
    """

    name: str
    coordinates: Mapping[Expr, str]
    lagrangian: Expr | None = None
    kinetic_energy: Expr | None = None
    forces: Mapping[Expr, Expr] = field(default_factory=dict)
    constraints: Sequence[Constraint] = ()
    parameters: Sequence[Parameter] = ()
    inputs: Sequence[Input] = ()
    start: Mapping[Expr, float] = field(default_factory=dict)
    embedding: Embedding | None = None
    description: str = ""
    descriptions: Mapping[Expr, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if isinstance(self.coordinates, list | tuple):  # coordinates without units
            object.__setattr__(self, "coordinates", dict.fromkeys(self.coordinates, ""))
        problems = _check_containers(self)
        if problems:
            raise ModelError(str(self.name), problems)
        for name in ("coordinates", "forces", "start", "descriptions"):
            object.__setattr__(self, name, dict(getattr(self, name)))
        for name in ("constraints", "parameters", "inputs"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        problems = _problems(self)
        if problems:
            raise ModelError(str(self.name), problems)

    @property
    def energy_expression(self) -> Expr:
        """The Lagrangian, or the kinetic energy where forces carry the rest [J]."""
        return sp.sympify(self.lagrangian if self.lagrangian is not None else self.kinetic_energy)

    @cached_property
    def units(self) -> dict[Expr, Unit]:
        """Unit of every symbol that may stand in an expression."""
        return _declared_units(self, [])

    @cached_property
    def prescribed(self) -> tuple[Input, ...]:
        """Inputs whose first and second derivative the equations need."""
        used: set[Expr] = set(self.energy_expression.atoms(AppliedUndef))
        for constraint in self.constraints:
            if not isinstance(constraint, Nonholonomic):
                used |= sp.sympify(constraint.expression).atoms(AppliedUndef)
        for relation in self.embedding.relations.values() if self.embedding else ():
            used |= sp.sympify(relation).atoms(AppliedUndef)
        return tuple(i for i in self.inputs if i.symbol in used)

    def constraint(self, name: str) -> Constraint:
        """The constraint called `name`; KeyError if there is none."""
        return next(c for c in self.constraints if c.name == name)


def name_of(symbol: Expr) -> str:
    """A symbol's or dynamicsymbol's plain name."""
    return str(symbol.func) if isinstance(symbol, AppliedUndef) else str(symbol)


# ----------------------------------------------------------------------------------- checks


def _problems(model: Model) -> list[str]:
    problems: list[str] = []
    _check_types(model, problems)
    if problems:
        return problems
    _check_names(model, problems)
    _check_energy(model, problems)
    if problems:
        return problems
    _check_numbers(model, problems)
    _check_symbols(model, problems)
    units = _declared_units(model, problems)
    if not problems:
        _check_dimensions(model, units, problems)
    return problems


def _check_containers(model: Model) -> list[str]:
    """Fields that are no dict or list, before they are copied."""
    maps: list[tuple[str, object, str]] = [
        ("coordinates", model.coordinates, "{x: 'm'}"),
        ("forces", model.forces, "{x: F}"),
        ("start", model.start, "{x: 1.0}"),
        ("descriptions", model.descriptions, "{x: 'height'}"),
    ]
    problems = []
    if isinstance(model.embedding, Embedding):
        problems += [
            f"embedding {name} = {value!r}, expected a dict, e.g. {example}"
            for name, value, example in (
                ("coordinates", model.embedding.coordinates, "{s: 'm'}"),
                ("relations", model.embedding.relations, "{x: 2*s}"),
                ("start", model.embedding.start, "{s: 1.0}"),
            )
            if not isinstance(value, Mapping)
        ]
    elif model.embedding is not None:
        problems.append(
            f"embedding = {model.embedding!r}, expected Embedding(coordinates, relations)"
        )
    problems += [
        f"{name} = {value!r}, expected a dict, e.g. {name}={example}"
        for name, value, example in maps
        if not isinstance(value, Mapping)
    ]
    return problems + [
        f"{name} = {value!r}, expected a list, e.g. {name}=[{example}(...)]"
        for name, value, example in (
            ("constraints", model.constraints, "Holonomic"),
            ("parameters", model.parameters, "Parameter"),
            ("inputs", model.inputs, "Input"),
        )
        if isinstance(value, str) or not isinstance(value, Iterable)
    ]


def _check_types(model: Model, problems: list[str]) -> None:
    """Things that are not what the fields of a Model hold, before anything is read from them."""
    kinds: tuple[tuple[str, Sequence[object], tuple[type, ...]], ...] = (
        ("parameters", model.parameters, (Parameter,)),
        ("inputs", model.inputs, (Input,)),
        ("constraints", model.constraints, (Holonomic, Nonholonomic, Contact)),
    )
    for field_name, items, types in kinds:
        expected = ", ".join(t.__name__ for t in types)
        problems += [
            f"{field_name} hold {item!r}, expected {expected}: write {types[0].__name__}(...)"
            for item in items
            if not isinstance(item, types)
        ]
    if problems:
        return
    for kind, symbol in [
        *(("parameter", p.symbol) for p in model.parameters),
        *(("input", i.symbol) for i in model.inputs),
    ]:
        if not isinstance(symbol, (sp.Symbol, AppliedUndef)):
            problems.append(f"{kind} {symbol!r} is no SymPy symbol: make one with sympy.symbols")
    expressions = [("lagrangian", model.lagrangian), ("kinetic_energy", model.kinetic_energy)]
    expressions += [(f"force on {plain(sp.sympify(q))}", f) for q, f in model.forces.items()]
    expressions += [(f"constraint {c.name!r}", c.expression) for c in model.constraints]
    relations = model.embedding.relations if model.embedding else {}
    expressions += [(f"embedding of {plain(sp.sympify(q))}", e) for q, e in relations.items()]
    for what, expression in expressions:
        if expression is not None and not _is_expression(expression):
            problems.append(
                f"{what}: {expression} is no SymPy expression with a value (it is a "
                f"{type(expression).__name__}): write sums, products and functions of symbols; "
                "a constraint is the expression that vanishes"
            )
        elif expression is not None and sp.sympify(expression).has(*_NO_NUMBERS):
            problems.append(
                f"{what}: {plain(expression)} holds {_no_number(expression)}, expected real and "
                "finite numbers: correct it"
            )
    _check_texts(model, problems)


def _no_number(expression: Expr) -> str:
    return ", ".join(str(n) for n in _NO_NUMBERS if sp.sympify(expression).has(n))


def _check_texts(model: Model, problems: list[str]) -> None:
    """Descriptions are texts of characters that XML can hold."""
    texts: list[tuple[str, object]] = [("the model", model.description)]
    texts += [(f"parameter {name_of(p.symbol)!r}", p.description) for p in model.parameters]
    texts += [(f"input {name_of(i.symbol)!r}", i.description) for i in model.inputs]
    texts += [(f"constraint {c.name!r}", c.description) for c in model.constraints]
    texts += [(f"{plain(sp.sympify(q))}", text) for q, text in model.descriptions.items()]
    for what, text in texts:
        if not isinstance(text, str):
            problems.append(f"description of {what} is {text!r}, expected a text: put it in quotes")
            continue
        bad = sorted(set(_NO_XML.findall(text)))
        if bad:
            problems.append(
                f"description of {what}: {text!r} holds {', '.join(map(repr, bad))}, which no XML "
                "file can hold: leave it out"
            )


def _is_expression(thing: object) -> bool:
    return not isinstance(thing, str) and isinstance(sp.sympify(thing, strict=False), sp.Expr)


def _check_names(model: Model, problems: list[str]) -> None:
    named = [("model", model.name)]
    extra = model.embedding.coordinates if model.embedding else {}
    for q in (*model.coordinates, *extra):
        if not (isinstance(q, AppliedUndef) and q.args == (dynamicsymbols._t,)):
            problems.append(
                f"coordinate {q} is no function of time: write it as dynamicsymbols('{q}')"
            )
            continue
        named.append(("coordinate", name_of(q)))
    if not model.coordinates:
        problems.append("there is no coordinate: a model needs at least one")
    named += [("parameter", name_of(p.symbol)) for p in model.parameters]
    named += [("input", name_of(i.symbol)) for i in model.inputs]
    seen: dict[str, str] = {}
    for kind, name in named:
        _check_name(kind, name, problems)
        if kind == "model":
            continue
        if name in seen:
            problems.append(
                f"the name {name!r} is used twice, by a {seen[name]} and a {kind}: rename one"
            )
        seen[name] = kind
    contacts = {c.name for c in model.constraints if isinstance(c, Contact)}
    names = set()
    for constraint in model.constraints:
        _check_name("constraint", constraint.name, problems)
        if constraint.name in names:
            problems.append(f"two constraints are called {constraint.name!r}: rename one")
        names.add(constraint.name)
        if constraint.name in seen and seen[constraint.name] == "coordinate":
            problems.append(
                f"constraint {constraint.name!r} has the name of a coordinate, so that "
                f"'Q.{constraint.name}' would be two things: rename one"
            )
        closed = getattr(constraint, "while_closed", None)
        if closed is not None and closed not in contacts:
            known = ", ".join(sorted(contacts)) or "none"
            problems.append(
                f"constraint {constraint.name!r} acts while_closed={closed!r}, which is no contact "
                f"of this model (contacts: {known})"
            )


def _check_name(kind: str, name: object, problems: list[str]) -> None:
    if not isinstance(name, str) or not NAME.match(name):
        problems.append(
            f"{kind} name {name!r} is no FMI name: use letters a-z, A-Z, digits and _, "
            "not beginning with a digit"
        )
    elif kind == "model" and keyword.iskeyword(name):
        problems.append(f"model name {name!r} is a word of the Python language: choose another")
    elif kind != "model" and name in RESERVED:
        problems.append(
            f"{kind} name {name!r} is reserved for the FMU's own variables "
            f"({', '.join(RESERVED)}): choose another"
        )


def _check_energy(model: Model, problems: list[str]) -> None:
    given = [f for f in (model.lagrangian, model.kinetic_energy) if f is not None]
    if len(given) != 1:
        found = "both lagrangian and" if given else "neither lagrangian nor"
        problems.append(
            f"{found} kinetic_energy given: give either a "
            "lagrangian (with non-conservative forces) or a kinetic_energy (with all forces)"
        )


def _check_numbers(model: Model, problems: list[str]) -> None:
    t = dynamicsymbols._t
    for p in model.parameters:
        _finite(f"parameter {name_of(p.symbol)!r}", p.value, problems)
        for bound, value in (("min", p.min), ("max", p.max)):
            if value is not None:
                _finite(f"{bound} of parameter {name_of(p.symbol)!r}", value, problems)
        if p.min is not None and p.max is not None and p.min > p.max:
            problems.append(
                f"parameter {name_of(p.symbol)!r}: min = {p.min!r} is above max = {p.max!r}, so that "
                "no value is allowed: exchange them"
            )
        elif _number(p.value) and (
            (p.min is not None and p.value < p.min) or (p.max is not None and p.value > p.max)
        ):
            problems.append(
                f"parameter {name_of(p.symbol)!r} = {p.value!r} is outside its own bounds "
                f"[{p.min}, {p.max}]"
            )
        if p.symbol.is_positive and _number(p.value) and not p.value > 0:
            problems.append(
                f"parameter {name_of(p.symbol)!r} = {p.value!r}, but its symbol was declared "
                "positive: give a positive value or drop the assumption"
            )
    for i in model.inputs:
        _finite(f"start of input {name_of(i.symbol)!r}", i.start, problems)
    states = {s for q in model.coordinates for s in (q, q.diff(t))}
    _check_start("start", model.start, states, problems)
    if model.embedding is not None:
        states = {s for q in model.embedding.coordinates for s in (q, q.diff(t))}
        _check_start("embedding start", model.embedding.start, states, problems)
        for q in model.embedding.relations:
            if q not in model.coordinates:
                problems.append(f"embedding gives {plain(q)}, which is no coordinate of the model")


def _check_start(
    what: str, start: Mapping[Expr, float], states: set[Expr], problems: list[str]
) -> None:
    for state, value in start.items():
        if state not in states:
            problems.append(
                f"{what} names {plain(state)}, which is neither a coordinate nor the first "
                "derivative of one"
            )
        _finite(f"{what} of {plain(state)}", value, problems)


def _number(value: object) -> bool:
    try:
        return math.isfinite(float(value))  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return False


def _finite(what: str, value: object, problems: list[str]) -> None:
    if not _number(value):
        problems.append(f"{what} is {value!r}, expected a finite number")


def _expressions(model: Model) -> list[tuple[str, Expr]]:
    kind = "lagrangian" if model.lagrangian is not None else "kinetic_energy"
    out = [(kind, model.energy_expression)]
    out += [(f"force on {plain(q)}", sp.sympify(f)) for q, f in model.forces.items()]
    out += [(f"constraint {c.name!r}", sp.sympify(c.expression)) for c in model.constraints]
    for c in model.constraints:
        if isinstance(c, Contact):
            out.append((f"restitution of {c.name!r}", sp.sympify(c.restitution)))
    return out


def _check_symbols(model: Model, problems: list[str]) -> None:
    t = dynamicsymbols._t
    known = {p.symbol for p in model.parameters} | {i.symbol for i in model.inputs} | {t}
    names = {name_of(s) for s in (*known, *model.coordinates)}
    for q in model.forces:
        if q not in model.coordinates:
            problems.append(f"a force is given on {plain(q)}, which is no coordinate of the model")
    for what, expression in _expressions(model):
        unknown = _unknown(expression, known | set(model.coordinates))
        problems += [
            f"{what}: {name} is neither coordinate, parameter nor input: "
            + (
                "one of that name is declared, but as another symbol (other assumptions, or no "
                "function of time): use the same"
                if name in names
                else "declare it, e.g. as a Parameter with value and unit"
            )
            for name in unknown
        ]
        if what.startswith("constraint") and not expression.has(*model.coordinates):
            problems.append(
                f"{what}: {expression} holds no coordinate, expected a condition on the motion: "
                "correct it or leave it out"
            )
        orders = [d.derivative_count for d in expression.atoms(sp.Derivative)]
        limit = 0 if what.startswith("constraint") and not _pfaffian(model, what) else 1
        if any(order > limit for order in orders):
            problems.append(
                f"{what}: holds a derivative of order {max(orders)}, expected at most {limit}"
                + (": a constraint on velocities is Nonholonomic" if limit == 0 else "")
            )
    if model.embedding is not None:
        for q, phi in model.embedding.relations.items():
            unknown = _unknown(sp.sympify(phi), known | set(model.embedding.coordinates))
            problems += [
                f"embedding of {plain(q)}: {name} is neither an independent coordinate nor a "
                "parameter"
                for name in unknown
            ]


def _pfaffian(model: Model, what: str) -> bool:
    return any(
        isinstance(c, Nonholonomic) and what == f"constraint {c.name!r}" for c in model.constraints
    )


def _unknown(expression: Expr, known: set[Expr]) -> list[str]:
    symbols = expression.free_symbols | expression.atoms(AppliedUndef)
    return sorted(str(plain(s)) for s in symbols - known)


def _declared_units(model: Model, problems: list[str]) -> dict[Expr, Unit]:
    t = dynamicsymbols._t
    units: dict[Expr, Unit] = {t: parse_unit("s", "time")}
    extra = model.embedding.coordinates if model.embedding else {}
    declared = [("coordinate", q, u) for q, u in (*model.coordinates.items(), *extra.items())]
    declared += [("parameter", p.symbol, p.unit) for p in model.parameters]
    declared += [("input", i.symbol, i.unit) for i in model.inputs]
    for kind, symbol, text in declared:
        what = f"{kind} {name_of(symbol)!r}"
        if not isinstance(text, str) or not text.strip():
            problems.append(f"{what} has no unit: give one, e.g. 'm', 'rad', or '1' for a number")
            continue
        try:
            units[symbol] = parse_unit(text, what)
        except UnitError as error:
            problems.append(str(error))
            continue
        if isinstance(symbol, AppliedUndef):
            units[symbol.diff(t)] = units[symbol].per_second()
            units[symbol.diff(t, 2)] = units[symbol].per_second().per_second()
    return units


def _check_dimensions(model: Model, units: dict[Expr, Unit], problems: list[str]) -> None:
    def check(expression: Expr, expected: Unit | None, what: str) -> None:
        problems.extend(check_dimension(sp.sympify(expression), expected, units, what))

    kind = "lagrangian" if model.lagrangian is not None else "kinetic_energy"
    check(model.energy_expression, ENERGY, kind)
    for q, force in model.forces.items():
        check(force, ENERGY / units[q], f"force on {plain(q)}")
    for constraint in model.constraints:
        check(constraint.expression, None, f"constraint {constraint.name!r}")
        if isinstance(constraint, Contact):
            one = POWER / POWER
            check(constraint.restitution, one, f"restitution of {constraint.name!r}")
    if model.embedding is not None:
        for q, phi in model.embedding.relations.items():
            check(phi, units[q], f"embedding of {plain(q)}")
