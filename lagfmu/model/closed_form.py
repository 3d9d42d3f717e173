"""What a model's outputs must equal: SymPy expressions in the model's own symbols.

A closed form may use coordinates and velocities (their values along the run), time, parameters,
inputs, and the symbols that the functions below make.  `verify` evaluates it on what an FMU returns,
with parameters and start values changed or not.

Newton's and Euler's laws of the bodies of a mechanism, in what its FMU tells.

    m r'' = sum F ,   J w' + w x J w = sum (T + (p - r) x F)

What acts is written down as it acts, part by part, from the wrenches, pulls and multipliers that the FMU
tells: nothing of it is what the equations of motion were made from.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import sympy as sp

from .. import names
from .elements import TIME, Expr, name_of


@dataclass(frozen=True, kw_only=True)
class Statement:
    """Where something holds of an FMU's outputs, and how well.

    `while_closed`, `while_open`: only while that contact is so.  `until_departure`: only until that contact,
    closed at the start, departs.  `when`: only where this expression of outputs, parameters,
    initial values and time is not 0 (contacts and counts are numbers in it).  Errors are measured relative to
    `scale` (default: the largest magnitude of `expected` along the run) and allowed up to `within` times the
    solver's tolerance, but at least `rounding`.  `only`: the FMUs that it applies to.
    """

    while_closed: str | None = None
    while_open: str | None = None
    until_departure: str | None = None
    when: Expr | None = None
    scale: Expr | None = None
    within: float = 10.0
    rounding: float = 1e-12
    only: tuple[str, ...] | None = None


@dataclass(frozen=True)
class ClosedForm(Statement):
    """`actual` equals `expected` at every communication point at which it applies.

    `name` is an output's name (then `actual` may be left out) or a label.  `at_departure`: only once, when
    that contact, closed at the start, has first departed; for use with the `departure` symbols.
    """

    name: str
    expected: Expr
    actual: Expr | None = None
    at_departure: str | None = None


@dataclass(frozen=True)
class Conserved(Statement):
    """`expression` keeps the value that it has at the first communication point where it applies."""

    name: str
    expression: Expr


def output(name: str) -> Expr:
    """The FMU's variable of that name, e.g. output('lambda.rod') or output('energy.total')."""
    return sp.Symbol(name, real=True)


def initial(state: Expr) -> Expr:
    """The value of a coordinate or of its derivative at the first communication point."""
    return output(names.initial(variable_name(state)))


def departure(contact: str, state: Expr = None) -> Expr:
    """A coordinate or velocity at the contact's latest departure; its time [s] without `state`.

    A closed form that uses it applies only once the contact has departed.
    """
    if state is None:
        return output(names.name(names.DEPARTURE_TIME, contact))
    order = 1 if isinstance(state, sp.Derivative) else 0
    coordinate = name_of(state.expr if order else state)
    return output(names.name(names.DEPARTURE, contact, coordinate, order))


def variable_name(state: Expr) -> str:
    """The FMU's name of a coordinate, velocity, acceleration or time: theta, der(theta,2), time."""
    if state == TIME:
        return "time"
    if isinstance(state, sp.Derivative):
        return names.derivative(name_of(state.expr), int(state.derivative_count))
    return name_of(state)


def in_variables(expression: Expr) -> Expr:
    """The expression with dynamicsymbols replaced by symbols named as the FMU's variables."""
    expression = sp.sympify(expression)
    rates = expression.atoms(sp.Derivative)
    expression = expression.xreplace({d: output(variable_name(d)) for d in rates})
    functions = expression.atoms(sp.core.function.AppliedUndef)
    table = {f: output(name_of(f)) for f in functions}
    table[TIME] = output("time")
    return expression.xreplace(table)


GROUND = -1  # instead of the number of a body


@dataclass(frozen=True)
class Where:
    """A marker: the number of its body, its `arm` from the centre of mass [m], and its `axes`, three columns
    one behind the other, all in the body's frame."""

    body: int
    arm: Sequence[Expr]
    axes: Sequence[Expr]


@dataclass(frozen=True)
class Act:
    """A force [N] and a torque [N.m] on the body of `on`, at its point, in the axes of `along`; the opposite
    is at the same point on the body `against`.

    `line`: the first component of the force is a pull from `on` towards the point of `along`.  `size`: of the
    terms that the force, or else the torque, was summed from.
    """

    on: Where
    along: Where
    against: int
    line: bool
    force: Sequence[Expr]
    torque: Sequence[Expr]
    size: Expr = 0

    @property
    def bodies(self) -> set[int]:
        """Those on which it acts."""
        return {self.on.body, self.against}

    @property
    def expressions(self) -> Iterator[Expr]:
        """All of them."""
        for where in (self.on, self.along):
            yield from (*where.arm, *where.axes)
        yield from (*self.force, *self.torque, self.size)


@dataclass(frozen=True)
class Laws:
    """Of the bodies `names`, with masses [kg] and inertias [kg.m^2] (one, or xx, yy, zz, xy, xz, yz), in a
    field of gravity [m/s^2]; `jumps`: where one of them is 0 a load jumps; `unknowns`: speeds and rows."""

    planar: bool
    unknowns: int
    names: Sequence[str]
    masses: Sequence[Expr]
    inertias: Sequence[Sequence[Expr]]
    gravity: Sequence[Expr]
    acts: Sequence[Act]
    jumps: Sequence[Expr] = ()

    @property
    def expressions(self) -> Iterator[Expr]:
        """All of them."""
        yield from (*self.masses, *(J for row in self.inertias for J in row))
        yield from (*self.gravity, *self.jumps)
        for act in self.acts:
            yield from act.expressions
