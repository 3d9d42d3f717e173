"""What a model is made of: its fields, parameters, inputs, constraints and embedding, as frozen data.

The symbols of a model, and what to say of those in an expression that are none of them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from functools import cached_property
from typing import Any

import sympy as sp
from sympy.core.function import AppliedUndef
from sympy.physics.vector import dynamicsymbols

TIME = dynamicsymbols._t
Expr = Any  # a SymPy expression: SymPy 1.14 ships no types, so that a stricter name would check nothing

NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*\Z")


@dataclass(frozen=True)
class Parameter:
    """A constant of the model, settable before initialization.

    `value` and its bounds `min` and `max` are in `unit`, which may be a multiple of an SI unit (g, mm, deg).
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

    A dynamicsymbol that stands in a constraint, a contact or `kinematics` is a prescribed motion: the FMU
    then has the inputs `u`, `der(u)` and `der(u,2)`, because the constraint on accelerations needs them (of
    one on velocities x' = w the first).  `start` and `rate` [unit/s] are its value and its velocity until the
    importer sets them.  With `rates` = 'estimated' the FMU has the input `u` alone, and takes the
    derivatives from its values at the communication points.
    """

    symbol: Expr
    unit: str = "1"
    start: float = 0.0
    description: str = ""
    rate: float = 0.0
    rates: str = "given"


@dataclass(frozen=True)
class Holonomic:
    """f(q, t) = 0.  The multiplier's unit is J/[f]; +lambda grad f is the force of constraint."""

    name: str
    expression: Expr
    description: str = ""
    while_closed: str | None = None


@dataclass(frozen=True)
class Tie(Holonomic):
    """A row of a joint, f(q) = 0, that brings its derivatives, shorter than the chain rule finds them:
    `rates`, f' and the part of f'' that is there while the speeds do not change.

    `side` is positive where the row is met as it is meant: a product of axes vanishes at half a turn, too.
    """

    rates: tuple[Expr, Expr] = (0, 0)
    side: Expr = 1


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
class Friction:
    """Coulomb friction: the constraints `of`, one or two, hold while |lambda| <= static * |normal|.

    Beyond that they slip, and lambda = -kinetic * |normal| * s/|s| with the slip velocity s = G v - nu
    (two constraints: orthogonal velocities).  `normal` [N] is linear in `multiplier(NAME)`s, or a sum of
    `norm`s of such; `static` and `kinetic` (the same as `static` if None) are numbers or expressions without
    dimension.  Where `of` is one angle, lambda is a torque [N.m], and the radius stands in the normal force
    or in the coefficients.  `limit` [N] or [N.m] in place of `normal` and `static` limits lambda itself: an
    expression of parameters, coordinates, inputs and time; what slips does so with kinetic * |limit|.
    """

    name: str
    of: Sequence[str]
    normal: Expr = None
    static: Expr = None
    kinetic: Expr = None
    description: str = ""
    limit: Expr = None

    def __post_init__(self) -> None:
        """A limit is a normal force with the coefficient 1."""
        if self.limit is not None and self.normal is self.static is None:
            object.__setattr__(self, "normal", self.limit)
            object.__setattr__(self, "static", sp.S.One)

    @property
    def sliding(self) -> Expr:
        """The coefficient of kinetic friction."""
        return self.static if self.kinetic is None else self.kinetic


@dataclass(frozen=True)
class Output:
    """A quantity of the model's own that the FMU reports: a tension, a height, a power.

    `expression` may hold coordinates, their first and second derivatives, inputs, parameters, time,
    `multiplier(constraint)` and `force_of_constraint(coordinate)`; each of its terms has the dimension
    of `unit`.  The name may be structured, as bob.height.  `otherwise` (a number, or an expression) is
    its value where the expression has none, as a quotient by the lambda of an open contact.  `unique`: the
    FMU says in `unique.NAME` whether redundant constraints leave it one value, as each lambda's own does.
    """

    name: str
    expression: Expr
    unit: str = "1"
    description: str = ""
    otherwise: Expr | None = None
    unique: bool = False


@dataclass(frozen=True)
class Peak:
    """The extremes of a quantity over the continuous motion so far, between communication points too.

    `of` is the name of a Real output of the FMU, or a pattern: `lambda.rod`, `Q.*`, `der(x)`, one of the
    model's own.  A native FMU then reports `peak.NAME.max`, `.min`, `.max_time` and `.min_time` [s].
    """

    of: str


@dataclass(frozen=True)
class Embedding:
    """Dependent coordinates as functions of independent ones, q = phi(s, t).

    `coordinates` maps each new independent coordinate to its unit, `relations` each coordinate of
    the model that it replaces to its expression; `start` gives s and der(s) at the start.
    """

    coordinates: Mapping[Expr, str]
    relations: Mapping[Expr, Expr]
    start: Mapping[Expr, Expr] = field(default_factory=dict)


@dataclass(frozen=True)
class ModelFields:
    """The fields of a model, right or wrong; `model.py` checks them."""

    name: str
    coordinates: Mapping[Expr, str]
    lagrangian: Expr | None = None
    kinetic_energy: Expr | None = None
    forces: Mapping[Expr, Expr] = field(default_factory=dict)
    constraints: Sequence[Constraint] = ()
    parameters: Sequence[Parameter] = ()
    inputs: Sequence[Input] = ()
    start: Mapping[Expr, Expr] = field(default_factory=dict)
    rough: Sequence[Expr] = ()
    joint_starts: Mapping[str, tuple[float, bool]] = field(default_factory=dict)
    embedding: Embedding | None = None
    description: str = ""
    descriptions: Mapping[Expr, str] = field(default_factory=dict)
    frictions: Sequence[Friction] = ()
    peaks: Sequence[Peak] = ()
    outputs: Sequence[Output] = ()
    author: str = ""
    version: str = ""
    license: str = ""
    copyright: str = ""
    picture: Sequence[Any] = ()  # of the shapes in picture.py
    page: Any = None  # the Page of picture.py
    display_units: Mapping[str, str] = field(default_factory=dict)
    speeds: Mapping[Expr, str] = field(default_factory=dict)
    kinematics: Mapping[Expr, Expr] = field(default_factory=dict)
    unwrapped: Mapping[Expr, Expr] = field(default_factory=dict)
    parts: Sequence[
        tuple[str, str]
    ] = ()  # what it is made of, each with a line that says what it is
    laws: Any = None  # the Laws of closed_form.py, of the bodies of a mechanism

    @property
    def directions(self) -> tuple[Expr, ...]:
        """What generalized forces belong to: the coordinates whose rates are speeds, then the speeds."""
        return (*(q for q in self.coordinates if q not in self.kinematics), *self.speeds)

    @property
    def states(self) -> tuple[Expr, ...]:
        """What can start somewhere: coordinates, and the speeds in the order of `directions`."""
        return (
            *self.coordinates,
            *(s if s in self.speeds else s.diff(TIME) for s in self.directions),
        )

    @property
    def energy_expression(self) -> Expr:
        """The Lagrangian, or the kinetic energy where forces carry the rest [J]."""
        return sp.sympify(self.lagrangian if self.lagrangian is not None else self.kinetic_energy)

    @cached_property
    def prescribed(self) -> tuple[Input, ...]:
        """Inputs whose first and second derivative the equations need."""
        used: set[Expr] = set(self.energy_expression.atoms(AppliedUndef))
        for expression in (*self.kinematics.values(), *(c.expression for c in self.constraints)):
            used |= sp.sympify(expression).atoms(AppliedUndef)
        for relation in self.embedding.relations.values() if self.embedding else ():
            used |= sp.sympify(relation).atoms(AppliedUndef)
        return tuple(i for i in self.inputs if i.symbol in used)


def is_number(value: object) -> bool:
    """True for a finite number; a text that reads like one is none, nor is a truth value."""
    if isinstance(value, (str, bytes, bool, sp.logic.boolalg.Boolean)):
        return False  # float("0.4") is 0.4, float(True) is 1.0
    try:
        return math.isfinite(float(value))  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return False


def is_name(text: object) -> bool:
    """True for a word, or words with a dot between each two: theta, crank.mass."""
    return isinstance(text, str) and all(map(NAME.match, text.split(".")))


def name_of(symbol: Expr) -> str:
    """A symbol's or dynamicsymbol's plain name."""
    return str(symbol.func) if isinstance(symbol, AppliedUndef) else str(symbol)


def known_symbols(model: ModelFields) -> set[Expr]:
    """Coordinates, speeds, parameters, inputs and time."""
    declared = {p.symbol for p in model.parameters} | {i.symbol for i in model.inputs}
    return {*model.coordinates, *model.speeds, *declared, TIME}


def unused(model: ModelFields) -> list[str]:
    """The parameters that stand nowhere in the model."""
    told = [getattr(model, f.name) for f in fields(model) if f.name != "parameters"]
    said = _standing_in([*told, *(p.value for p in model.parameters)])
    return [name_of(p.symbol) for p in model.parameters if p.symbol not in said]


def _standing_in(part: Any) -> set[Expr]:
    """The free symbols of all expressions in what a model is made of."""
    if isinstance(part, sp.Basic | sp.MatrixBase):
        return set(part.free_symbols)
    if isinstance(part, Mapping):
        return _standing_in([*part.keys(), *part.values()])
    if isinstance(part, list | tuple | set | frozenset):
        return set().union(*map(_standing_in, part))
    if is_dataclass(part) and not isinstance(part, type):
        return _standing_in([getattr(part, f.name) for f in fields(part)])
    return set()


def undeclared(
    model: ModelFields,
    what: str,
    expression: Expr,
    also: Collection[Expr] = (),
    known: Collection[Expr] = (),
) -> list[str]:
    """The symbols of an expression that are none of the model's, nor `also`, each with the remedy.  `known`:
    those of the model, where many expressions are asked about."""
    known = known or known_symbols(model)
    others = symbols_in(expression).difference(known, also)
    names = {name_of(s) for s in known} if others else set()
    problems = []
    for symbol in sorted(others, key=lambda s: str(plain(s))):
        remedy = "declare it, e.g. as a Parameter with value and unit"
        if model.embedding and symbol in model.embedding.coordinates:
            remedy = "it is one of the embedding: write it by the model's own coordinates"
        elif plain(symbol) in names:
            remedy = (
                "one of that name is declared, but as another symbol (other assumptions, or no "
                "function of time): use the same"
            )
        problems.append(
            f"{what}: {plain(symbol)} is neither coordinate, parameter nor input: {remedy}"
        )
    return problems


def symbols_in(expression: Expr) -> set[Expr]:
    """Symbols, and functions of time."""
    e = sp.sympify(expression)
    found: set[Expr] = e.free_symbols | e.atoms(AppliedUndef)
    return found


def plain(expr: Expr) -> str:
    """The expression as text: r for r(t), der(r) and der(r,2) for its derivatives."""
    expr = sp.sympify(expr)
    names: dict[Expr, Expr] = {}
    for node in expr.atoms(sp.Derivative):
        order = sum(int(count) for _, count in node.variable_count)
        wrt = [plain(v) for v, _ in node.variable_count if v != TIME]
        tail = [plain(node.expr), *wrt, *([str(order)] if order > 1 else [])]
        names[node] = sp.Symbol(f"der({','.join(tail)})")
    for node in expr.atoms(AppliedUndef):
        if len(node.args) == 1 and node.args[0].is_Symbol:
            names[node] = sp.Symbol(node.func.__name__)
    return str(expr.xreplace(names))
