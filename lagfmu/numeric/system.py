"""The numeric form of a model: callables and index patterns, no symbols.

    M(q,t) vdot = F(q,v,t,u) + G^T lambda ,   G v = nu(q,t,u) ,   G vdot = gamma(q,v,t,u) ,   f(q,t) = 0

The callables return flat lists of the structurally non-zero values; `assemble` puts them into place.
That memory layout is decided here and in the code printer, and nowhere else.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

HOLONOMIC, NONHOLONOMIC, CONTACT = "holonomic", "nonholonomic", "contact"


@dataclass(frozen=True)
class Row:
    """One constraint: its name, kind, if it acts only while a contact is closed, that row, and if it
    holds by friction alone, which friction."""

    name: str
    kind: str
    while_closed: int | None = None
    friction: int | None = None


@dataclass(frozen=True)
class Friction:
    """Coulomb friction: its name, the rows that it limits (one or two), those whose multipliers make up
    the normal force, and whether these are contacts alone: without them there is none."""

    name: str
    rows: tuple[int, ...]
    normal: tuple[int, ...]
    gated: bool


@dataclass(frozen=True)
class Own:
    """An output of the model's own: value(t, q, v, vdot, u, p, lam, Q) -> [value].

    `otherwise`, of the same arguments, gives the value where that is not finite.
    """

    name: str
    value: Callable[..., Any]
    otherwise: Callable[..., Any] | None = None


@dataclass(frozen=True)
class Lookups:
    """Where tables are looked up: places(t, q, v, u, p) -> x, and (name, first x, last x) of each."""

    places: Callable[..., Any]
    reach: tuple[tuple[str, float, float], ...]


@dataclass(frozen=True)
class System:
    """M, F, G, nu, gamma, f and the energies of n coordinates under m constraint rows.

    dynamics(t, q, v, u, p) -> (M values, F, G values, nu, gamma);  residual(t, q, u, p) -> f (m), 0
    for a nonholonomic row;  energies(t, q, v, u, p) -> (kinetic, potential) [J];  restitution(p) ->
    one coefficient a row.  `mass` and `jacobian` are the (row, column) indices of the values; M's
    are those of the lower triangle.  `prescribed` are the positions in u where a prescribed motion
    and its two derivatives begin.  `like` (n) lists for each coordinate those of its dimension,
    `extent` (n) the positions in p whose values have it, `folded` (n) the largest magnitude of it among
    the parameters that are numbers in the code; `angles` are those without dimension.

    coulomb(t, q, v, u, p) -> (coefficients, load, normal) of the `frictions`: the static and the kinetic one
    of each in turn, and N = load + sum_k normal_k lambda_k [N] over each friction's rows `normal`.

    surfaces(t, q, u, p) -> h of each surface at which forces jump (instant.py); `switches`: which of them
    jump wherever h is a whole number; `driven`: length of u, the inputs and the switch states behind them.

    starts(p) -> the start values that are expressions of parameters, at the positions `started` of (q, v).

    `estimated` are those of `prescribed` that are followed by a third derivative.  `outputs` are those of
    the model's own.  `energies` is None where they are not read.  The full
    system of an embedding may hold coordinates that are only read: then `dynamics`, `residual` and
    `restitution` are None too.
    """

    coordinates: tuple[str, ...]
    rows: tuple[Row, ...]
    mass: tuple[Sequence[int], Sequence[int]]
    jacobian: tuple[Sequence[int], Sequence[int]]
    dynamics: Callable[..., Any] | None
    residual: Callable[..., Any] | None
    energies: Callable[..., Any] | None
    restitution: Callable[..., Any] | None
    prescribed: tuple[int, ...] = ()
    like: tuple[tuple[int, ...], ...] = ()
    extent: tuple[tuple[int, ...], ...] = ()
    folded: tuple[float, ...] = ()
    angles: tuple[int, ...] = ()
    embedding: Embedding | None = None
    formulation: str = "multipliers"
    parameters: tuple[str, ...] = field(default=())
    outputs: tuple[Own, ...] = ()
    frictions: tuple[Friction, ...] = ()
    coulomb: Callable[..., Any] | None = None
    lookups: Lookups | None = None
    estimated: tuple[int, ...] = ()
    surfaces: Callable[..., Any] | None = None
    switches: tuple[bool, ...] = ()
    driven: int = 0
    started: tuple[int, ...] = ()
    starts: Callable[..., Any] | None = None

    @cached_property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates)

    @cached_property
    def m(self) -> int:
        """Number of constraint rows."""
        return len(self.rows)

    @cached_property
    def contacts(self) -> tuple[int, ...]:
        """The rows that are contacts."""
        return tuple(k for k, row in enumerate(self.rows) if row.kind == CONTACT)

    @property
    def is_watched(self) -> bool:
        """True if there are events to watch for: contacts, jumps of forces, frictions."""
        return bool(self.contacts or self.switches or self.frictions)

    @property
    def is_constrained(self) -> bool:
        """True if accelerations are solved for together with multipliers, stepped or recovered."""
        full = None if self.embedding is None else self.embedding.full
        return self.m > 0 or (full is not None and full.dynamics is not None and full.m > 0)

    @cached_property
    def permanent(self) -> tuple[int, ...]:
        """The rows that always act."""
        return tuple(
            k
            for k, row in enumerate(self.rows)
            if row.kind != CONTACT and row.while_closed is None and row.friction is None
        )

    @cached_property
    def _mass(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        i, j = (np.asarray(a, dtype=np.intp) for a in self.mass)
        return i, j

    @cached_property
    def _jacobian(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        k, j = (np.asarray(a, dtype=np.intp) for a in self.jacobian)
        return k, j

    def active(self, closed: Sequence[bool]) -> list[int]:
        """Rows that act while the contacts stand as in `closed` (one entry a contact); those that stick
        by friction come to them."""
        shut = {k for k, c in zip(self.contacts, closed, strict=True) if c}
        return [
            k
            for k, row in enumerate(self.rows)
            if (k in shut if row.kind == CONTACT else row.while_closed in shut | {None})
            and row.friction is None
        ]

    def assemble(
        self, t: float, q: Vector, v: Vector, u: Sequence[float], p: Sequence[float]
    ) -> tuple[Matrix, Vector, Matrix, Vector, Vector]:
        """M (n, n), F (n), G (m, n), nu (m), gamma (m) at a state; all constraint rows."""
        assert self.dynamics is not None
        mass, F, jacobian, nu, gamma = self.dynamics(t, q.tolist(), v.tolist(), u, p)
        M = np.zeros((self.n, self.n))
        i, j = self._mass
        M[i, j] = mass
        M[j, i] = mass
        G = np.zeros((self.m, self.n))
        G[self._jacobian] = jacobian
        return M, np.array(F, dtype=float), G, np.array(nu, dtype=float), np.array(gamma, float)

    def inputs_at(self, u: Sequence[float], elapsed: float) -> list[float]:
        """Inputs `elapsed` seconds after they were set: held, prescribed motions by Taylor's rule."""
        if not self.prescribed:
            return list(u)
        w = list(u)
        for k in self.prescribed:
            w[k] = u[k] + elapsed * (u[k + 1] + elapsed * u[k + 2] / 2)
            w[k + 1] = u[k + 1] + elapsed * u[k + 2]
        for k in self.estimated:
            third = elapsed * u[k + 3]
            w[k] += elapsed * elapsed * third / 6
            w[k + 1] += elapsed * third / 2
            w[k + 2] += third
        return w


@dataclass(frozen=True)
class Embedding:
    """q = phi(s, t), v = J sdot + dphi/dt, and the full system that lambda is recovered from."""

    embed: Callable[..., Any]
    full: System
