"""The equations between two settings of the inputs: M vdot = F + G^T lambda, G vdot = gamma, f = 0, G v = nu.

What Python's functions cannot compute (a division by zero, a root of a negative number), or what is not
finite, is a StepFailureError: the integrator takes it for a step that was too long.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..numeric.failure import MasslessError, StepFailureError, evaluated
from ..numeric.instant import Instant
from ..numeric.system import NONHOLONOMIC, Matrix, System, Vector
from .linear import Rows, rows_of, solve


class Terms(NamedTuple):
    """M (nv, nv), F (nv), and of the rows that act G (m, nv), nu (m), gamma (m) at one state."""

    M: Matrix
    F: Vector
    G: Matrix
    nu: Vector
    gamma: Vector

    def of(self, rows: Sequence[int]) -> Terms:
        """With these rows alone."""
        some = list(rows)
        return Terms(self.M, self.F, self.G[some], self.nu[some], self.gamma[some])


class Ranks(NamedTuple):
    """How many of the holonomic rows that act are independent, and how many of all that act.

    Taken where the rows hold, and kept until the next such point: off the constraints, by the error of a
    step, redundant rows seem independent, and their multipliers would be noise.
    """

    positions: int
    all: int


class Motion:
    """A system with its parameters p, and its inputs u as they were set at the time `since` [s]."""

    def __init__(
        self, system: System, u: Sequence[float], p: Sequence[float], since: float
    ) -> None:
        self.system, self.u, self.p, self.since = system, u, p, since
        self.eliminate = system.formulation == "nullspace"

    def inputs(self, t: float) -> list[float]:
        """The inputs at t [s]: held, prescribed motions by their rates."""
        return self.system.inputs_at(self.u, t - self.since)

    def terms(self, t: float, q: Vector, v: Vector) -> Terms:
        """Of all rows.  Raises StepFailureError."""
        arguments = t, q, v, self.inputs(t), self.p
        terms = Terms(*evaluated("the equations", t, self.system.assemble, *arguments))
        for name, value in zip(("M", "F", "G", "nu", "gamma"), terms, strict=True):
            if not np.isfinite(value).all():
                raise StepFailureError(f"{name} is not finite at t = {t!r} s")
        return terms

    def residual(self, t: float, q: Vector) -> Vector:
        """f of each row (m), 0 of nonholonomic ones.  Raises StepFailureError."""
        assert self.system.residual is not None
        arguments = t, q.tolist(), self.inputs(t), self.p
        f = np.array(evaluated("the constraints", t, self.system.residual, *arguments), dtype=float)
        if not np.isfinite(f).all():
            raise StepFailureError(f"a constraint is not finite at t = {t!r} s")
        return f

    def magnitudes(self, t: float, q: Vector) -> Vector:
        """(m): the largest magnitude among the terms of each f, of which f is rounding."""
        found: Vector = Instant(self.system, t, self.inputs(t), self.p).terms(q)
        return found

    def accelerations(self, terms: Terms, rank: int | None = None) -> tuple[Vector, Vector, Rows]:
        """vdot (nv), lambda (m) of the rows in `terms`, and these rows decomposed."""
        rows = rows_of(terms.M, terms.G, rank)
        try:
            vdot, lam = solve(terms.M, terms.F, rows, terms.gamma, self.eliminate)
        except MasslessError as error:
            raise error.named(self.system.directions) from None
        return vdot, lam, rows

    def rate(self, t: float, q: Vector, v: Vector) -> Vector:
        """q' (nq).  Raises StepFailureError."""
        arguments = t, q, v, self.inputs(t), self.p
        found: Vector = evaluated("the kinematics", t, self.system.rate, *arguments)
        return found

    def moved(self, t: float, q: Vector, w: Vector) -> Vector:
        """q (nq) after a displacement w (nv) in speeds: with unit quaternions of norm 1, and unwrapped angles
        where they belong.  Raises StepFailureError."""
        arguments = t, q, w, self.inputs(t), self.p
        found: Vector = evaluated("the kinematics", t, self.system.moved, *arguments)
        return found

    def holonomic(self, rows: Sequence[int]) -> list[int]:
        """Those of the rows that tie positions."""
        return [k for k in rows if self.system.rows[k].kind != NONHOLONOMIC]

    def ranks(self, terms: Terms, rows: Sequence[int]) -> Ranks:
        """Of `rows`, at a state on the constraints with the `terms` of all rows."""
        tied = self.holonomic(rows)
        total = rows_of(terms.M, terms.G[list(rows)]).rank
        some = total if len(tied) == len(rows) else rows_of(terms.M, terms.G[tied]).rank
        return Ranks(some, total)

    def whole(self, t: float, q: Vector, v: Vector) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Coordinates and velocities of the model: of an embedding q = phi(s, t), v = J sdot + dphi/dt."""
        embedding = self.system.embedding
        if embedding is None:
            return tuple(q.tolist()), tuple(v.tolist())
        arguments = t, q.tolist(), v.tolist(), self.inputs(t), self.p
        places, rates = evaluated("the embedding", t, embedding.embed, *arguments)
        return tuple(map(float, places)), tuple(map(float, rates))
