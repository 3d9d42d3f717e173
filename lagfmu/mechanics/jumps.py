"""Forces that jump: where sign, Heaviside, floor or the conditions of a Piecewise change.

A jump in position, time or inputs is an event: within a step the argument h of the function stands at the
value that says on which side of its surface h = 0 the motion is (for floor: between which integers), and
the side changes where h passes the surface.  Each argument is therefore wrapped: held(h, k), with the
number k of its surface, which is h for the reader, and for the numeric code its switch state
(`with_switch_states`).

A jump in a velocity is refused: such a force (dry friction) holds the motion on its surface, which is not
an event but a mode of motion.  A kink without a jump, as in x*sign(x) or a Piecewise that is continuous at
the parameters' values, is left as it is.
"""

from __future__ import annotations

import random
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import sympy as sp
from sympy.core.relational import Relational
from sympy.printing.precedence import precedence

from ..errors import ModelError
from ..model.elements import TIME, Expr
from .equations import EquationsOfMotion
from .formulations import Form

SAMPLES = 6  # points of a surface at which a jump is looked for
TRIALS = 60  # random points from which the surface is sought
SMALL = sp.Float("1e-15")  # part of the force's own size that is no jump
DIGITS = 30


class held(sp.Function):  # type: ignore[misc]  # noqa: N801 - written like the function that it is
    """held(h, k): h for the reader; for numeric code the switch state of surface k: which side of it."""

    nargs = 2
    is_extended_real = True

    def fdiff(self, argindex: int = 1) -> Expr:
        """0: between two events the switch state stands."""
        return sp.S.Zero

    def _eval_derivative(self, s: Expr) -> Expr:
        return sp.S.Zero

    @property
    def precedence(self) -> int:
        """As loosely as h binds."""
        return int(precedence(self.args[0]))

    def _sympystr(self, printer: Any) -> str:
        return str(printer._print(self.args[0]))

    def _latex(self, printer: Any, **_: Any) -> str:
        return str(printer._print(self.args[0]))


@dataclass(frozen=True)
class Surface:
    """h(q, t, u) of a jump at h = 0, or, `at_integers`, wherever h is a whole number."""

    h: Expr
    at_integers: bool


@dataclass(frozen=True)
class Jumps:
    """The surfaces of a system's jumps in order; `states`: the symbols of their switch states."""

    surfaces: tuple[Surface, ...] = ()
    states: tuple[Expr, ...] = ()

    def mapped(self, table: Mapping[Expr, Expr]) -> Jumps:
        """The same in other symbols."""
        return replace(
            self, surfaces=tuple(replace(s, h=s.h.xreplace(dict(table))) for s in self.surfaces)
        )


NONE = Jumps()


def with_jumps(eom: EquationsOfMotion) -> EquationsOfMotion:
    """The equations with the arguments of jumps wrapped.

    Raises ModelError if a force jumps with a velocity, or an energy.
    """
    plain = {e: _rewritten(e) for e in (*eom.F, *eom.gamma)}
    candidates = list(dict.fromkeys(s for e in plain.values() for s in _candidates(e)))
    places = {*eom.q, *eom.v, *eom.u, TIME}
    problems: list[str] = []
    wrapped: dict[Surface, Expr] = {}
    for surface in candidates:
        if not surface.h.free_symbols & places:
            continue  # parameters stay as they are
        across = [e for e in plain.values() if surface in set(_candidates(e))]
        if not any(_jumps(term, surface, eom) for e in across for term in sp.Add.make_args(e)):
            continue
        speeds = sorted(surface.h.free_symbols & set(eom.v), key=str)
        if speeds:
            problems.append(_refusal(eom, surface, speeds, plain))
        wrapped[surface] = held(surface.h, sp.Integer(len(wrapped)))
    if any(e.has(sp.DiracDelta) for e in plain.values()):
        where = [
            q for q, e in zip(eom.directions, eom.F, strict=True) if plain[e].has(sp.DiracDelta)
        ]
        problems.append(
            f"the energy jumps, so that the force on {', '.join(where) or 'a constraint'} is infinite "
            "there: use an energy that is continuous, or a Contact"
        )
    if problems:
        raise ModelError(eom.model.name, problems)
    if not wrapped:
        return eom
    done = {e: _wrapped(p, wrapped) for e, p in plain.items()}
    return replace(eom, F=tuple(done[e] for e in eom.F), gamma=tuple(done[e] for e in eom.gamma))


def _refusal(
    eom: EquationsOfMotion, surface: Surface, speeds: Sequence[Expr], plain: Mapping[Expr, Expr]
) -> str:
    on = [
        str(q) for q, e in zip(eom.q, eom.F, strict=True) if surface in set(_candidates(plain[e]))
    ]
    where = f"where {surface.h} {'is a whole number' if surface.at_integers else '= 0'}"
    return (
        f"the force on {', '.join(on) or 'the constraints'} jumps with the velocity "
        f"{', '.join(map(str, speeds))}, {where}: a motion would stay there, in no direction of the jump; "
        "for dry friction use Friction(...) in `constraints`, else a continuous law such as "
        "tanh(velocity/small)"
    )


def _rewritten(e: Expr) -> Expr:
    """Mod and frac in terms of floor; nothing else is touched."""
    e = sp.sympify(e)
    if e.has(sp.Mod):
        e = e.replace(sp.Mod, lambda x, y: x - y * sp.floor(x / y))
    return e.replace(sp.frac, lambda x: x - sp.floor(x)) if e.has(sp.frac) else e


def _candidates(e: Expr) -> Iterator[Surface]:
    """The surfaces at which functions in the expression jump, in the order in which they stand in it."""
    for node in sp.preorder_traversal(e):
        surface = _surface(node)
        if surface is not None:
            yield surface


def _surface(node: Expr) -> Surface | None:
    if isinstance(node, (sp.sign, sp.Heaviside)):
        return Surface(_oriented(node.args[0]), False)
    if isinstance(node, (sp.floor, sp.ceiling)):
        return Surface(node.args[0], True)
    if isinstance(node, Relational):
        return Surface(_oriented(node.lhs - node.rhs), False)
    if isinstance(node, sp.Abs):
        return Surface(_oriented(node.args[0]), False)
    if isinstance(node, (sp.Min, sp.Max)) and len(node.args) == 2:
        return Surface(_oriented(node.args[0] - node.args[1]), False)
    return None


def _oriented(h: Expr) -> Expr:
    """h or -h: both have one surface."""
    return -h if h.could_extract_minus_sign() else h


def _at(node: Expr, table: Mapping[Surface, Expr]) -> Expr:
    """The node with the argument of its surface replaced."""
    surface = _surface(node)
    if surface is None or surface not in table:
        return node
    new = table[surface]
    if isinstance(node, Relational):
        return node.func(new if node.lhs - node.rhs == surface.h else -new, 0)
    if isinstance(node, (sp.Min, sp.Max)):
        a, b = node.args if (node.args[0] - node.args[1] == surface.h) else node.args[::-1]
        over, under = (a, b) if isinstance(node, sp.Max) else (b, a)
        return sp.Piecewise((over, new > 0), (under, True))
    argument = new if surface.at_integers or node.args[0] == surface.h else -new
    if isinstance(node, sp.Abs):
        return node.args[0] * sp.sign(argument)
    return node.func(argument, *node.args[1:])


def _wrapped(e: Expr, table: Mapping[Surface, Expr]) -> Expr:
    """The expression with every argument of a jump replaced by its entry in the table."""
    return e.replace(lambda x: _surface(x) in table, lambda x: _at(x, table))


def _jumps(e: Expr, surface: Surface, eom: EquationsOfMotion) -> bool:
    """True if the expression differs on the two sides of the surface, at the parameters' values."""
    if surface not in set(_candidates(e)):
        return False
    values = {p.symbol: _exact(float(p.value) or 1.0) for p in eom.parameters}
    generator = random.Random(3)
    integers = (sp.Integer(generator.randint(-3, 3)) for _ in range(SAMPLES))
    for integer in integers if surface.at_integers else (sp.S.Zero,) * SAMPLES:
        h = (surface.h - integer).xreplace(values)
        point = _on(h, generator)
        if point is None:
            continue
        everything = {**_scattered(e.xreplace(values).free_symbols, generator), **values, **point}
        half = sp.Rational(1, 2) if surface.at_integers else sp.S.One
        over, under = (
            _number(_wrapped(e, {surface: integer + s * half}), everything) for s in (1, -1)
        )
        if over is None or under is None:
            continue
        moved = {s: x + sp.Rational(1, 3) for s, x in everything.items() if s not in values}
        nearby = _number(e, values | moved)
        if abs(over - under) > SMALL * (abs(over) + abs(under) + abs(nearby or 0)):
            return True
    return False


def _exact(x: float) -> Expr:
    return sp.Rational(repr(x))


def _scattered(symbols: set[Expr], generator: random.Random) -> dict[Expr, Expr]:
    return {s: sp.Rational(generator.randint(-1999, 1999), 997) for s in sorted(symbols, key=str)}


def _on(h: Expr, generator: random.Random) -> dict[Expr, Expr] | None:
    """A point of h = 0: values of the symbols in it; None if none is found."""
    symbols = sorted(h.free_symbols, key=str)
    for s in symbols:
        a = h.diff(s)
        if not a.has(s) and a != 0:
            rest = _scattered({*symbols} - {s}, generator)
            slope = a.xreplace(rest)
            if slope != 0:
                return {**rest, s: -h.xreplace({s: sp.S.Zero}).xreplace(rest) / slope}
    f = sp.lambdify(symbols, h, "math")
    for _ in range(TRIALS):
        # two points on different sides, then bisection along the line between them
        a, b = (_scattered({*symbols}, generator) for _ in range(2))
        try:
            at = [float(f(*(float(x) for x in p.values()))) for p in (a, b)]
        except (ArithmeticError, ValueError, TypeError):
            continue
        if at[0] * at[1] >= 0:
            continue
        x = sp.Symbol("x", real=True)
        line = h.xreplace({s: a[s] + x * (b[s] - a[s]) for s in symbols})
        try:
            root = sp.nsolve(line, x, (0, 1), solver="bisect", prec=DIGITS, verify=False)
        except (ArithmeticError, ValueError, TypeError):
            continue
        return {s: a[s] + root * (b[s] - a[s]) for s in symbols}
    return None


def _number(e: Expr, values: Mapping[Expr, Expr]) -> Expr | None:
    """The value to many digits; None where there is no real one."""
    try:
        found = sp.N(e.xreplace(dict(values)), DIGITS)
    except (ArithmeticError, ValueError, TypeError, RecursionError):
        return None
    return found if found.is_Number and found.is_finite else None


def jumps_of(form: Form) -> Jumps:
    """The jumps that are left in the equations, with their surfaces in the coordinates that are stepped."""
    eom, reduction = form.equations, form.reduction
    found: dict[Expr, Surface] = {}
    inside = {}
    if reduction is not None:
        _collect(reduction.reduced, {}, found)
        speeds = zip(eom.v, reduction.vel, strict=True)
        inside = dict(zip(eom.q, reduction.phi, strict=True)) | dict(speeds)
    _collect(eom, inside, found)
    if not found:
        return NONE
    numbers = sorted(found, key=int)
    states = tuple(switch_state(k) for k in numbers)
    return Jumps(tuple(found[k] for k in numbers), states)


def _collect(
    eom: EquationsOfMotion, inside: Mapping[Expr, Expr], found: dict[Expr, Surface]
) -> None:
    for e in (*eom.F, *eom.gamma):
        floors = {x.args[0] for x in e.atoms(sp.floor, sp.ceiling)}
        for x in sorted(e.atoms(held), key=lambda x: int(x.args[1])):
            found.setdefault(x.args[1], Surface(x.args[0].xreplace(dict(inside)), x in floors))


def switch_state(number: Expr) -> Expr:
    """The symbol of a surface's switch state; no name in a model is written like this."""
    return sp.Symbol(f"switch({int(number) + 1})", real=True)


def with_switch_states(form: Form) -> tuple[Form, Jumps]:
    """The same for numeric code: what is held is the symbol of its switch state, behind the inputs."""
    jumps, reduction = jumps_of(form), form.reduction
    if not jumps.states:
        return form, jumps
    if reduction is not None:
        reduction = replace(reduction, reduced=_in_switch_states(reduction.reduced, jumps))
    equations = _in_switch_states(form.equations, jumps)
    return replace(form, equations=equations, reduction=reduction), jumps


def _in_switch_states(eom: EquationsOfMotion, jumps: Jumps) -> EquationsOfMotion:

    def put(e: Expr) -> Expr:
        table = {x: switch_state(x.args[1]) for x in e.atoms(held)}
        return e.xreplace(table) if table else e

    F, gamma = tuple(map(put, eom.F)), tuple(map(put, eom.gamma))
    return replace(eom, F=F, gamma=gamma, switch_states=jumps.states)
