"""The rotation matrix of a unit quaternion, whose elements stay closed: one symbol each, not a polynomial.

A point of a body is r + R p.  Were R written out, each derivative of a joint's condition would multiply
polynomials of eight quaternion components; closed, R' = R [w]x keeps a joint's equations as short as on paper
(mechanics/equations.py), and the numeric code writes the polynomials out once (`written_out`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy as sp

from .elements import Expr


class Attitude(sp.Function):  # type: ignore[misc]
    """Element (i, j) of R(e0, e1, e2, e3): takes components in a body's frame to those in space."""

    nargs = 6

    @property
    def place(self) -> tuple[int, int]:
        """The row and the column."""
        return int(self.args[0]), int(self.args[1])

    @property
    def quaternion(self) -> tuple[Expr, ...]:
        """e0, e1, e2, e3."""
        return tuple(self.args[2:])

    def _eval_is_real(self) -> bool:
        return True

    def polynomial(self) -> Expr:
        """The element written out."""
        return element(*self.place, self.quaternion)

    def fdiff(self, argindex: int = 1) -> Expr:
        """The derivative by a component of the quaternion."""
        symbols = sp.symbols("x0:4")
        slope = Attitude(*self.args[:2], *symbols).polynomial().diff(symbols[argindex - 3])
        return slope.xreplace(dict(zip(symbols, self.quaternion, strict=True)))

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        i, j = self.place
        of = printer.doprint(self.quaternion[0])
        text = f"R_{{{i + 1}{j + 1}}}\\left({of}\\right)"
        return f"{text}^{{{exp}}}" if exp else text

    def _sympystr(self, printer: Any) -> str:
        i, j = self.place
        return f"R{i + 1}{j + 1}({printer.doprint(self.quaternion[0])})"


def element(i: int, j: int, quaternion: Sequence[Any]) -> Any:
    """R[i, j] of (e0, e1, e2, e3) (Goldstein, Classical Mechanics, eq. 4.47): R' = R [w]x of whatever
    norm."""
    e0, *e = quaternion
    if i == j:
        return e0**2 + sum(x**2 if k == i else -(x**2) for k, x in enumerate(e))
    k = 3 - i - j
    sign = 1 if (i + 1) % 3 == j else -1
    return 2 * (e[i] * e[j] - sign * e0 * e[k])


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
    """The expression with polynomials for the elements of rotation matrices."""
    found = expression.atoms(Attitude)
    return expression.xreplace({a: a.polynomial() for a in found}) if found else expression
