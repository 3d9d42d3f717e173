"""The rotation matrix of a unit quaternion, and vectors that are fixed on a body, which stay closed.

A point of a body is r + R s.  Were R written out, each derivative of a joint's condition would multiply
polynomials of eight quaternion components; closed, R' = R [w]x keeps a joint's equations as short as on paper
(mechanics/equations.py), and joints of a kind have the same expressions, whatever s is.  The numeric code
computes each matrix and each vector once; `written_out` gives the polynomials.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import sympy as sp

from ..numeric.closed import across, rotation
from .elements import Expr

Change = Callable[[Expr], Expr]


class ClosedFunction(sp.Function):  # type: ignore[misc]
    """What numeric code computes by itself: a component of a matrix or a vector, by its arguments."""

    is_real = True
    is_commutative = True

    @property
    def vector(self) -> tuple[Expr, ...]:
        """What of its arguments is data, whatever the motion: none, or three."""
        return ()

    @property
    def quaternion(self) -> tuple[Expr, ...]:
        """e0, e1, e2, e3."""
        return tuple(self.args[2:6])

    def __new__(cls, *args: Any) -> ClosedFunction:
        """Of those arguments: nothing is evaluated."""
        made: ClosedFunction = sp.Expr.__new__(cls, *map(sp.sympify, args))
        return made

    @property
    def free_symbols(self) -> set[Expr]:
        """Found once."""
        return set(_symbols(self))

    def _xreplace(self, rule: Any) -> tuple[Expr, bool]:
        """Most rules hold nothing of what it is of."""
        if self in rule:
            return rule[self], True
        return super()._xreplace(rule) if any(e in rule for e in _inside(self)) else (self, False)

    @abstractmethod
    def opened(self) -> Expr:
        """One level further down: in elements of rotation matrices, or as a polynomial."""

    @abstractmethod
    def changed(self, d: Change) -> Expr:
        """Its change for those of its arguments."""

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        text = rf"\left({printer.doprint(self.opened())}\right)"
        return f"{text}^{{{exp}}}" if exp else text

    def _eval_derivative(self, s: Expr) -> Expr:
        along = self.changed(lambda x: x.diff(s))
        return self.opened().diff(s) if along.has(AttitudeChange, CarriedChange) else along


@lru_cache(maxsize=65536)
def _inside(e: Expr) -> frozenset[Expr]:
    """All expressions in its arguments."""
    return frozenset().union(*map(sp.preorder_traversal, e.args))


@lru_cache(maxsize=65536)
def _symbols(e: Expr) -> frozenset[Expr]:
    return frozenset().union(*(a.free_symbols for a in e.args))


class Attitude(ClosedFunction):
    """Element (i, j) of R(e0, e1, e2, e3): takes components in a body's frame to those in space."""

    nargs = 6

    @property
    def place(self) -> tuple[int, int]:
        """The row and the column."""
        return int(self.args[0]), int(self.args[1])

    def changed(self, d: Change) -> Expr:
        """For a change of the quaternion."""
        de = [d(x) for x in self.quaternion]
        return AttitudeChange(*self.args, *de) if any(x != 0 for x in de) else sp.S.Zero

    def opened(self) -> Expr:
        """The element written out: R' = R [w]x of whatever norm."""
        i, j = self.place
        return _written(self.quaternion)[3 * i + j]

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        i, j = self.place
        of = printer.doprint(self.quaternion[0])
        text = f"R_{{{i + 1}{j + 1}}}\\left({of}\\right)"
        return f"{text}^{{{exp}}}" if exp else text

    def _sympystr(self, printer: Any) -> str:
        i, j = self.place
        return f"R{i + 1}{j + 1}({printer.doprint(self.quaternion[0])})"


@lru_cache(maxsize=1024)
def _written(quaternion: tuple[Expr, ...]) -> list[Expr]:
    return rotation(quaternion)


class AttitudeChange(ClosedFunction):
    """The change of element (i, j) of R(e) for the change de of the quaternion."""

    nargs = 10

    def changed(self, d: Change) -> Expr:
        """Of changes no changes are asked for."""
        raise NotImplementedError

    def _eval_derivative(self, s: Expr) -> Expr:
        return self.opened().diff(s)

    def opened(self) -> Expr:
        """2 of R's terms for each that is a square, and both orders of each that is a product."""
        symbols = sp.symbols("e0:4", real=True)
        turned = Attitude(*self.args[:2], *symbols).opened()
        slope = sum(turned.diff(s) * de for s, de in zip(symbols, self.args[6:], strict=True))
        return slope.xreplace(dict(zip(symbols, self.args[2:6], strict=True)))


class Carried(ClosedFunction):
    """Component i along the ground's axes of a vector s that is fixed on a body, and of what w makes of it.

    Of the order 0: R s; 1: R (w x s), its rate where w is the angular velocity; 2: R (w x (w x s)).  s and w
    (0 in the order 0) are components in the body's frame.
    """

    nargs = 12

    def __new__(cls, *args: Any) -> Expr:
        """0 where the vector is or, in the higher orders, w is 0 or, if it moves, the vector."""
        s, w = args[6:9], args[9:]
        nothing = args[0] != 0 and (not any(w) or (s == w and any(sp.sympify(s).free_symbols)))
        return sp.S.Zero if nothing or not any(s) else super().__new__(cls, *args)

    @property
    def vector(self) -> tuple[Expr, ...]:
        """s."""
        return tuple(self.args[6:9])

    @property
    def parts(self) -> tuple[int, int, tuple[Expr, ...], tuple[Expr, ...], tuple[Expr, ...]]:
        """The order, the component, the quaternion, s, w."""
        order, i, *rest = self.args
        return int(order), int(i), tuple(rest[:4]), tuple(rest[4:7]), tuple(rest[7:])

    def opened(self) -> Expr:
        """In elements of R."""
        order, i, e, s, w = self.parts
        for _ in range(order):
            s = tuple(across(w, s))
        return sp.Add(*(Attitude(i, j, *e) * x for j, x in enumerate(s) if x != 0))

    def changed(self, d: Change) -> Expr:
        """For changes of the quaternion and of w together, and of s, by which it is linear."""
        order, i, e, s, w = self.parts
        de, ds, dw = ([d(x) for x in part] for part in (e, s, w))
        found = []
        if any(x != 0 for x in de) or (order == 2 and any(x != 0 for x in dw)):
            found.append(CarriedChange(*self.args, *de, *dw))
        elif any(x != 0 for x in dw):
            found.append(Carried(order, i, *e, *s, *dw))
        if any(x != 0 for x in ds):
            found.append(Carried(order, i, *e, *ds, *w))
        return sp.Add(*found)

    def _sympystr(self, printer: Any) -> str:
        order, i, e, s, _ = self.parts
        of = ", ".join(map(printer.doprint, (e[0], *s)))
        return f"fixed{i + 1}{'_' * bool(order)}{'t' * order}({of})"


def carried(
    order: int, e: Sequence[Expr], s: Sequence[Expr], w: Sequence[Expr]
) -> tuple[Expr, Expr, Expr]:
    """The three components."""
    by = w if order else (0, 0, 0)
    x, y, z = (Carried(order, i, *e, *s, *by) for i in range(3))
    return x, y, z


class CarriedChange(ClosedFunction):
    """The change of Carried(order, i, e, s, w) for the changes de and dw."""

    nargs = 19

    @property
    def vector(self) -> tuple[Expr, ...]:
        """s."""
        return tuple(self.args[6:9])

    def changed(self, d: Change) -> Expr:
        """Of changes no changes are asked for."""
        raise NotImplementedError

    def _eval_derivative(self, s: Expr) -> Expr:
        return self.opened().diff(s)

    def opened(self) -> Expr:
        """In elements of R and of its change, by the product rule."""
        of = Carried(*self.args[:12])
        order, i, e, s, w = of.parts
        de, dw = self.args[12:16], tuple(self.args[16:])
        change = sp.S.Zero
        if order == 1:
            change = Carried(1, i, *e, *s, *dw).opened()
        if order == 2:
            twice = [
                a + b
                for a, b in zip(across(dw, across(w, s)), across(w, across(dw, s)), strict=True)
            ]
            change = Carried(0, i, *e, *twice, 0, 0, 0).opened()
        turned = of.opened()
        rates = {a: AttitudeChange(*a.args, *de) for a in turned.atoms(Attitude)}
        return turned.xreplace(rates) + change


def quaternion_rates(e: Sequence[Expr], w: Sequence[Expr]) -> tuple[Expr, ...]:
    """e' (4) = e (0, w) / 2 of a unit quaternion; w (3): the angular velocity in the frame of the body."""
    e0, x, y, z = e
    across = y * w[2] - z * w[1], z * w[0] - x * w[2], x * w[1] - y * w[0]
    rest = ((e0 * along + turn) / 2 for along, turn in zip(w, across, strict=True))
    return (-(x * w[0] + y * w[1] + z * w[2]) / 2, *rest)


def rotation_matrix(quaternion: Sequence[Expr]) -> Expr:
    """R (3, 3) of the unit quaternion (e0, e1, e2, e3): components in a body's frame become those in
    space."""
    return sp.Matrix(3, 3, lambda i, j: Attitude(i, j, *quaternion))


def written_out(expression: Expr) -> Expr:
    """The expression with polynomials for all that is closed."""
    while found := expression.atoms(ClosedFunction):
        expression = expression.xreplace({a: a.opened() for a in found})
    return expression
