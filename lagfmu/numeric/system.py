"""The numeric form of a model: callables and index patterns, no symbols.

    M(q,t) vdot = F(q,v,t,u) + G^T lambda ,   G v = nu(q,t,u) ,   G vdot = gamma(q,v,t,u) ,   f(q,t) = 0
    q' = B(q,t,u) v + b(q,t,u), or q' = v

The callables return flat lists of the structurally non-zero values; `assemble` puts them into place.
That memory layout is decided here and in the code printer, and nowhere else.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from ..names import read

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Sparse: TypeAlias = csr_array

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
    each component of each norm of which the normal force is the sum, and whether these are contacts alone:
    without them there is none."""

    name: str
    rows: tuple[int, ...]
    norms: tuple[tuple[tuple[int, ...], ...], ...]
    gated: bool

    @property
    def normal(self) -> tuple[int, ...]:
        """The rows of all components."""
        return tuple(k for norm in self.norms for part in norm for k in part)


@dataclass(frozen=True)
class Own:
    """An output of the model's own: value(t, q, v, vdot, u, p, lam, Q) -> [value].

    `otherwise`, of the same arguments, gives the value where that is not finite; `unique`: it is asked
    whether the multipliers leave it one value.
    """

    name: str
    value: Callable[..., Any]
    otherwise: Callable[..., Any] | None = None
    unique: bool = False


@dataclass(frozen=True)
class Lookups:
    """Where tables are looked up: places(t, q, v, u, p) -> x, and (name, first x, last x) of each."""

    places: Callable[..., Any]
    reach: tuple[tuple[str, float, float], ...]


@dataclass(frozen=True)
class System:
    """M, F, G, nu, gamma, f and the energies of nq coordinates with nv speeds under m constraint rows.

    dynamics(t, q, v, u, p) -> (M values, F, G values, nu, gamma);  residual(t, q, u, p) -> f (m), 0
    for a nonholonomic row;  energies(t, q, v, u, p) -> (kinetic, potential) [J];  restitution(p) ->
    one coefficient a row.  `mass` and `jacobian` are the (row, column) indices of the values; M's
    are those of the lower triangle.  `prescribed` are the positions in u where a prescribed motion
    and its two derivatives begin.  `dimension` (nq), `speed_dimension` (nv) and `extent_dimension` (p) number
    the dimensions of coordinates, of speeds times a second and of parameters (-1: of none of these),
    `angle_dimension` is that of angles (-1: there are none); `extents` (nq): the parameters of a coordinate's
    dimension in its rows; `folded` (nq) and `speed_folded` (nv) are the largest magnitudes among those, and
    among all of the dimension, that are numbers in the code.

    kinematics(t, q, u, p) -> (B values, b) of q' = B v + b, None where q' = v; `rates` are the (row,
    column) indices of B.  `quaternions`: the places in q of e0, e1, e2, e3, whose norm is 1;
    unwrapped_angles(t, q, u, p) -> what the coordinates at `unwrapped` equal modulo 2 pi.

    coulomb(t, q, v, u, p) -> (coefficients, load, normal) of the `frictions`: the static and the kinetic one
    of each in turn, and load + sum_k normal_k lambda_k over the rows of each component of its norms.

    surfaces(t, q, u, p) -> h of each surface at which forces jump (instant.py); `switches`: which of them
    jump wherever h is a whole number; `driven`: length of u, the inputs and the switch states behind them.

    sides(t, q, u, p) -> what is positive where the joint of each row of `sided` is not turned over.

    terms(t, q, u, p) -> the largest magnitude among the terms of each f (m); None where there is no f.

    starts(p) -> the start values that are expressions of parameters, at the positions `started` of (q, v).

    `estimated` are those of `prescribed` that are followed by a third derivative.  `outputs` are those of
    the model's own.  `energies` is None where they are not read.  The full
    system of an embedding may hold coordinates that are only read: then `dynamics`, `residual` and
    `restitution` are None too.
    """

    coordinates: tuple[str, ...]
    speeds: tuple[str, ...]
    rows: tuple[Row, ...]
    mass: tuple[Sequence[int], Sequence[int]]
    jacobian: tuple[Sequence[int], Sequence[int]]
    dynamics: Callable[..., Any] | None
    residual: Callable[..., Any] | None
    energies: Callable[..., Any] | None
    restitution: Callable[..., Any] | None
    prescribed: tuple[int, ...] = ()
    dimension: tuple[int, ...] = ()
    speed_dimension: tuple[int, ...] = ()
    extent_dimension: tuple[int, ...] = ()
    angle_dimension: int = -1
    folded: tuple[float, ...] = ()
    extents: tuple[tuple[int, ...], ...] = ()
    speed_folded: tuple[float, ...] = ()
    kinematics: Callable[..., Any] | None = None
    rates: tuple[Sequence[int], Sequence[int]] = ((), ())
    quaternions: tuple[tuple[int, int, int, int], ...] = ()
    unwrapped: tuple[int, ...] = ()
    unwrapped_angles: Callable[..., Any] | None = None
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
    sided: tuple[int, ...] = ()
    sides: Callable[..., Any] | None = None
    terms: Callable[..., Any] | None = None

    @cached_property
    def nq(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates)

    @cached_property
    def nv(self) -> int:
        """Number of speeds."""
        return len(self.speeds)

    @cached_property
    def states(self) -> tuple[str, ...]:
        """The names of q, then those of v."""
        return (*self.coordinates, *self.speeds)

    @cached_property
    def directions(self) -> tuple[str, ...]:
        """What masses and forces belong to (nv): a coordinate whose rate is the speed, else the speed."""
        return tuple(read(s).coordinate for s in self.speeds)

    @cached_property
    def angles(self) -> tuple[int, ...]:
        """The coordinates without dimension."""
        found = self.angle_dimension
        return tuple(j for j, d in enumerate(self.dimension) if d == found)

    @cached_property
    def moved_by(self) -> tuple[tuple[int, ...], ...]:
        """The coordinates (each of nv) that a speed moves: those of its column of B."""
        if self.kinematics is None:
            return tuple((j,) for j in range(self.nv))
        found: list[list[int]] = [[] for _ in self.speeds]
        for j, i in zip(*self.rates, strict=True):
            found[i].append(j)
        return tuple(map(tuple, found))

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

    def across(self, size: Vector, alone: Vector) -> Vector:
        """Sizes (nq) of coordinates as those of displacements in speeds (nv): the largest of the
        coordinates of its own dimension that a speed moves; `alone` (nv) where it moves none."""
        if self.kinematics is None:
            return size
        found = alone.copy()
        for i, places in enumerate(self.moved_by):
            own = [j for j in places if self.dimension[j] == self.speed_dimension[i]]
            if own:
                found[i] = size[own].max()
        return found

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
        """M (nv, nv), F (nv), G (m, nv), nu (m), gamma (m) at a state; all constraint rows."""
        assert self.dynamics is not None
        mass, F, jacobian, nu, gamma = self.dynamics(t, q.tolist(), v.tolist(), u, p)
        M = np.zeros((self.nv, self.nv))
        i, j = self._mass
        M[i, j] = mass
        M[j, i] = mass
        G = np.zeros((self.m, self.nv))
        G[self._jacobian] = jacobian
        return M, np.array(F, dtype=float), G, np.array(nu, dtype=float), np.array(gamma, float)

    def assemble_sparse(
        self, t: float, q: Vector, v: Vector, u: Sequence[float], p: Sequence[float]
    ) -> tuple[Sparse, Vector, Sparse, Vector, Vector]:
        """The same, M and G sparse."""
        assert self.dynamics is not None
        mass, F, jacobian, nu, gamma = self.dynamics(t, q.tolist(), v.tolist(), u, p)
        (i, j), lower = self._mass, np.array(mass, dtype=float)
        off = i != j
        places = np.concatenate([i, j[off]]), np.concatenate([j, i[off]])
        M = csr_array((np.concatenate([lower, lower[off]]), places), (self.nv, self.nv))
        G = csr_array((np.array(jacobian, float), self._jacobian), (self.m, self.nv))
        return M, np.array(F, dtype=float), G, np.array(nu, dtype=float), np.array(gamma, float)

    def rate(
        self, t: float, q: Vector, v: Vector, u: Sequence[float], p: Sequence[float]
    ) -> Vector:
        """q' = B v + b (nq)."""
        if self.kinematics is None:
            return v
        B, b = self.kinematics(t, q.tolist(), u, p)
        found: Vector = self._times(B, v) + np.array(b, dtype=float)
        return found

    def shift(
        self, t: float, q: Vector, w: Vector, u: Sequence[float], p: Sequence[float]
    ) -> Vector:
        """B w (nq): how the coordinates move by a displacement w (nv) in speeds."""
        return (
            w
            if self.kinematics is None
            else self._times(self.kinematics(t, q.tolist(), u, p)[0], w)
        )

    def _times(self, B: Sequence[float], w: Vector) -> Vector:
        rows, columns = (np.asarray(a, dtype=np.intp) for a in self.rates)
        moved: Vector = np.bincount(rows, np.asarray(B) * w[columns], self.nq).astype(float)
        return moved

    def moved(
        self, t: float, q: Vector, w: Vector, u: Sequence[float], p: Sequence[float]
    ) -> Vector:
        """q (nq) after a displacement w (nv) in speeds: with unit quaternions of norm 1, and unwrapped angles
        where they equal their angle.

        Raises ArithmeticError for a quaternion without a direction.
        """
        return self._settled(t, q + self.shift(t, q, w, u, p), u, p)

    def _settled(self, t: float, q: Vector, u: Sequence[float], p: Sequence[float]) -> Vector:
        if not self.quaternions and not self.unwrapped:
            return q
        for places in map(list, self.quaternions):
            norm = np.linalg.norm(q[places])
            if not 0 < norm < np.inf:
                names = ", ".join(self.coordinates[j] for j in places)
                raise ArithmeticError(f"the quaternion {names} has the norm {norm:g}, expected 1")
            q[places] /= norm
        if self.unwrapped_angles is not None:
            for j, angle in zip(
                self.unwrapped, self.unwrapped_angles(t, q.tolist(), u, p), strict=True
            ):
                q[j] = angle + 2 * np.pi * np.round((q[j] - angle) / (2 * np.pi))
        return q

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
