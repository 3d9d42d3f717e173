"""Movements of a mechanism that are least in the metric of M, and the coordinates to which they lead.

Newton's method, damped by halving,

    minimize  d^T M d   with   f(q) + f_q d = 0 .

A second way in which the joints of a loop close: an elbow up, or down.

It is looked for from other angles of the joints, drawn at random, and about a beginning from which no step
leads anywhere, as where all links lie on a line.  What a motion that is left may change tells no branches
apart: it may lead from one to the other.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import sympy as sp
from scipy.sparse import csr_array, diags_array, hstack, vstack

from ..errors import LagfmuWarning
from ..model.elements import TIME, Contact, Expr, Tie, name_of
from ..model.model import Model
from ..numeric.linear import divided, factor, norms, row_sizes
from ..numeric.system import Sparse
from .draft import Draft
from .rows import Array, Rows, numbers_of

CLOSED = 1e-9  # of the size of the mechanism: what a row may miss, and a given value be another
DRAWS, MOST = 8, 60  # beginnings; speeds of a mechanism beyond which it is not looked for
# times as far as the branch that is taken; what makes another one, of its way
NEAR, ANOTHER = 2.0, 1e-3


class SecondBranchWarning(LagfmuWarning):
    """A mechanism closes in two ways, and nothing says which is meant."""


def has_loop(draft: Draft, parts: Sequence[Any]) -> bool:
    """True if there are more ties than bodies."""
    ties = sum(hasattr(part, "relative_pose") for part in parts)
    return ties > len(draft.motions) - 1


def is_small(draft: Draft) -> bool:
    """True if there are not too many bodies to look for other branches."""
    return 6 * (len(draft.motions) - 1) <= MOST


def other_angles(measures: Iterable[str]) -> Iterator[dict[str, float]]:
    """Angles of joints, drawn at random, to begin from."""
    draws, names = np.random.default_rng(0), [n for n in measures if n.startswith("angle")]
    for _ in range(DRAWS):
        yield {n: draws.uniform(-math.pi, math.pi) for n in names}


def tell_second_branch(
    model: Model,
    measures: Mapping[str, Expr],
    closed: Iterable[tuple[Array, Array]],
    rough: Array,
    q: Array,
) -> None:
    """Warns of a branch besides q that is about as near to the rough place, by the angle or position (of
    `measures`, which are not given) that tells them apart most.  `closed` are places found from elsewhere:
    coordinates, and what each row then misses."""
    if not measures:
        return
    rows = Rows(model, [(e, sp.S.Zero) for e in measures.values()])
    stops = [c.expression for c in model.constraints if isinstance(c, Contact)]
    gaps = Rows(model, [(e, sp.S.Zero) for e in stops])
    way = float(np.linalg.norm(q - rough))
    here, nearest, apart = rows.values(q), NEAR * way, None
    for there, missed in closed:
        far = float(np.linalg.norm(there - rough))
        difference = _turned(measures, rows.values(there) - here)
        another = np.abs(difference).max() > ANOTHER * way
        if gaps.values(there).min(initial=0.0) < -CLOSED:
            continue  # beyond a limit
        if missed.max(initial=0.0) <= CLOSED and another and far < nearest:
            nearest, apart = far, difference
    if apart is None:
        return
    k = int(np.argmax(np.abs(apart)))
    name, taken = list(measures)[k], here[k].item()
    other = _turned(measures, here + apart)[k].item()
    warnings.warn(
        f"model {model.name!r}: the joints close in two ways that are about as near: taken is the one with "
        f"{name} = {taken!r}; for the other start {name!r} at {other!r}",
        SecondBranchWarning,
        stacklevel=6,
    )


def _turned(measures: Mapping[str, Expr], values: Array) -> Array:
    """Angles within half a turn."""
    angles = [n.startswith("angle") for n in measures]
    return np.where(angles, np.remainder(values + math.pi, 2 * math.pi) - math.pi, values)


STEPS, HALVINGS, RETURNS = 100, 12, 20
TRIES = 12  # beginnings with other omitted values, where the first leads nowhere, ...
FEW = 4  # ... until so many close
STILL = 1e-6  # relative: rows that close to CLOSED leave such a motion
LEAST = 1e-6  # of the way back: a gain that is none
LIGHT = 1e-6  # what resists what has no mass: a curve's parameter, of its body's; a body, of the heaviest's
REDUNDANT = 1e-11  # a singular value, relative to the largest: rows that say the same
DENSE = 200  # speeds up to which dense algebra is as quick
YIELDING, YIELDS = 1e-5, 10  # of a row: its slack; how often at most what is left is done
EPS = float(np.finfo(float).eps)


def moving_of(draft: Draft, model: Model) -> Moving:
    """Of a mechanism with many speeds by sparse algebra."""
    return (Moving if len(model.directions) <= DENSE else _MovingMuch)(draft, model)


class Moving:
    """Movements d (n_v) of a mechanism that are least in d^T W^2 d, and what they do to its coordinates."""

    def __init__(self, draft: Draft, model: Model) -> None:
        masses = {
            d: m
            for b in draft.motions.values()
            for d, m in zip(b.directions, b.masses, strict=True)
        } | {s: LIGHT * of.mass for s, of in draft.curves.items()}
        self.lengths = np.array([model.coordinates.get(d) == "m" for d in model.directions])
        own = numbers_of(model, [masses[d] for d in model.directions])
        for alike in (self.lengths, ~self.lengths):
            own[alike & (own == 0)] = LIGHT * own[alike].max(initial=0.0) or 1.0
        self.weight = np.sqrt(own)
        self.scale = np.ones(len(self.lengths))  # what is much of each speed, in a second
        rates = [model.kinematics.get(q, q.diff(TIME)) for q in model.coordinates]
        self._moved = Rows(model, [(sp.S.Zero, rate) for rate in rates])
        places = {q: j for j, q in enumerate(model.coordinates)}
        heads = [j for q, j in places.items() if name_of(q).endswith(".orientation.w")]
        self._quaternions = [slice(j, j + 4) for j in heads]
        self._angles = {places[q]: name_of(q) for q in model.unwrapped}
        self._turned = Rows(model, [(angle, sp.S.Zero) for angle in model.unwrapped.values()])
        ties = [c for c in model.constraints if isinstance(c, Tie) and c.side != 1]
        self._sided = [c.name.partition(".")[0] for c in ties]
        self._sides = Rows(model, [(c.side, sp.S.Zero) for c in ties])

    def turned_over(self, q: Array) -> list[str]:
        """The joints that are turned over by half a turn: their rows vanish there, too."""
        over = zip(self._sided, self._sides.values(q).tolist(), strict=True)
        return list(dict.fromkeys(joint for joint, side in over if not side > 0))

    def sized(self, q: Array) -> float:
        """The size of the mechanism at q [m], by which its lengths are judged from now on."""
        straight = np.abs(self.slopes([self._moved], q)) @ self.lengths > 0
        size = float(np.abs(q[straight]).max(initial=0.0)) or 1.0
        self.scale = np.where(self.lengths, size, 1.0)
        return size

    def tied(self, q: Array, near: Mapping[str, float] | None = None) -> Array:
        """q with unit quaternions, and with each angle that goes on over turns at its attitude, nearest to
        where it was, or to a value that is given."""
        q = q.copy()
        for place in self._quaternions:
            q[place] /= np.linalg.norm(q[place])
        for (j, name), angle in zip(self._angles.items(), self._turned.values(q), strict=True):
            before = q[j] if near is None else near.get(name, q[j])
            q[j] = angle + 2 * np.pi * np.round((before - angle) / (2 * np.pi))
        return q

    def moved(self, q: Array, d: Array) -> Array:
        """The coordinates after a movement."""
        return self.tied(q + self.slopes([self._moved], q) @ d)

    def closed(self, rows: Sequence[Rows], wanted: Array, rough: Array) -> tuple[Array, Array]:
        """Coordinates at which the rows have the wanted values, and what each misses, relative to its size.

        A beginning from which Newton's method comes to rest elsewhere, as where all links lie on a line, is
        left for others about it: of these the one that leads nearest to it.
        """
        q, missed = self.newton(rows, wanted, rough)
        if missed.max(initial=0.0) <= CLOSED:
            return q, missed
        found = [(q, missed), *self.closed_about(rows, wanted, rough)]
        there = [f for f in found if f[1].max() <= CLOSED]
        if there:
            return min(there, key=lambda f: self.far(f[0], rough))
        return min(found, key=lambda f: float(f[1].max()))

    def closed_about(
        self, rows: Sequence[Rows], wanted: Array, rough: Array
    ) -> Iterator[tuple[Array, Array]]:
        """The same from other beginnings, drawn at random, each led back to the rough one as far as the rows
        allow; not more than FEW that close."""
        draws, few = np.random.default_rng(0), 0
        for _ in range(TRIES):
            away = draws.uniform(-0.5, 0.5, len(self.scale)) * self.scale
            q, missed = self.newton(rows, wanted, self.moved(rough, away))
            if missed.max() <= CLOSED:
                q, missed = self._back(rows, wanted, rough, q, missed)
                few += 1
            yield q, missed
            if few == FEW:
                return

    def _back(
        self, rows: Sequence[Rows], wanted: Array, rough: Array, q: Array, missed: Array
    ) -> tuple[Array, Array]:
        """From q on along the rows to where the movement from the rough place is least."""
        for _ in range(RETURNS):
            way = self._way(q, rough)
            A = self.slopes(rows, q)
            along = way + self.least(A, -(A @ way), self.sizes(A))
            new, left = self.newton(rows, wanted, self.moved(q, along))
            if left.max() > CLOSED or self.far(new, rough) > (1 - LEAST) * self.far(q, rough):
                break
            q, missed = new, left
        return q, missed

    def _way(self, q: Array, to: Array) -> Array:
        """The movement d that leads from q to another place, as far as a movement is linear."""
        to = to.copy()
        for place in self._quaternions:
            to[place] *= 1 if q[place] @ to[place] >= 0 else -1
        B = self.slopes([self._moved], q)
        d: Array = np.linalg.lstsq(np.asarray(B @ np.eye(B.shape[1])), to - q, rcond=None)[0]
        return d

    def far(self, q: Array, rough: Array) -> float:
        """How far a place is, in the metric of M."""
        return float(np.linalg.norm(self.weight * self._way(q, rough)))

    def determines(self, rows: Sequence[Rows], q: Array, measure: Rows) -> bool:
        """True if no motion that the rows leave changes the measure."""
        held, wanted = (self.slopes(r, q) / self.weight for r in (rows, [measure]))
        made = np.linalg.lstsq(held.T, wanted.T, rcond=STILL)[0]
        return bool(np.linalg.norm(wanted - made.T @ held) <= STILL * np.linalg.norm(wanted))

    def newton(
        self, rows: Sequence[Rows], wanted: Array, q: Array, enough: float = 0.0
    ) -> tuple[Array, Array]:
        """Coordinates near q at which the rows have the wanted values, and what each misses: at most
        `enough`, or as little as can be; all where a joint is turned over."""
        r, A, size = self._missed(rows, wanted, q)
        if not (np.isfinite(r).all() and np.isfinite(np.abs(A).sum())):
            return q, np.full(len(r), np.inf)
        for _ in range(STEPS):
            if np.abs(r / size).max(initial=0.0) <= enough:
                break
            step = self.least(A, r, size)
            for halved in range(HALVINGS):
                new = self.moved(q, step * 0.5**halved)
                after = self._missed(rows, wanted, new)
                if np.linalg.norm(after[0] / after[2]) < np.linalg.norm(r / size):
                    break
            else:
                break
            q, (r, A, size) = new, after
        missed = np.abs(r / size)
        if missed.max(initial=0.0) <= CLOSED and self.turned_over(q):
            missed = np.ones(len(r))
        return q, missed

    def _missed(self, rows: Sequence[Rows], wanted: Array, q: Array) -> tuple[Array, Any, Array]:
        """What is missing (m), the slopes (m, n_v), and how large a change each row sees (m)."""
        values, A = self._values_and_slopes(rows, q)
        return wanted - values, A, self.sizes(A)

    def _values_and_slopes(self, rows: Sequence[Rows], q: Array) -> tuple[Array, Any]:
        values, slopes = zip(*(row.values_and_slopes(q) for row in rows), strict=True)
        return np.concatenate(values), np.vstack(slopes)

    def slopes(self, rows: Sequence[Rows], q: Array) -> Any:
        """(m, n_v), of several rows."""
        return np.vstack([row.slopes(q) for row in rows])

    def sizes(self, A: Any) -> Array:
        """How large a change each row sees (m)."""
        size = np.abs(A * self.scale).max(axis=1, initial=0.0)
        return np.where(size > 0, size, 1.0)

    def least(self, A: Any, r: Array, size: Array) -> Array:
        """d with A d = r as nearly as can be, each row by its size, and least among those."""
        A, r = A / size[:, None], r / size
        d: Array = np.linalg.lstsq(A / self.weight, r, rcond=REDUNDANT)[0] / self.weight
        return d

    def velocities(self, rows: Sequence[Rows], wanted: Array, q: Array, v: Array) -> Array:
        """The velocities nearest to v at which the rows have the wanted rates."""
        A = self.slopes(rows, q)
        missing = wanted - np.concatenate([r.drifts(q) for r in rows]) - A @ v
        return v + self.least(A, missing, self.sizes(A))


class _MovingMuch(Moving):
    """Those of a mechanism with many speeds, by sparse algebra."""

    def _values_and_slopes(self, rows: Sequence[Rows], q: Array) -> tuple[Array, Sparse]:
        return np.concatenate([row.values(q) for row in rows]), self.slopes(rows, q)

    def slopes(self, rows: Sequence[Rows], q: Array) -> Sparse:
        return vstack([row.sparse_slopes(q) for row in rows], format="csr")

    def sizes(self, A: Sparse) -> Array:
        size = row_sizes(A.tocoo(), self.scale, np.ones(A.shape[0]))
        return np.where(size > 0, size, 1.0)

    def least(self, A: Sparse, r: Array, size: Array) -> Array:
        """Rows may depend on each other: each may be missed by a slack s, least in d^2 + s^2 with
        A d + YIELDING |row| s = r, over and over for what is left (iterated Tikhonov regularization; Hansen,
        Rank-Deficient and Discrete Ill-Posed Problems, sect. 5.1)."""
        A, r, (m, n) = divided(A, size, self.weight), r / size, A.shape
        slack = diags_array(YIELDING * np.maximum(norms(A), np.finfo(float).tiny))
        one = csr_array(diags_array(np.ones(n + m)))
        factored = factor(one, hstack([A, slack], format="csr"))
        if factored is None:
            return np.zeros(n)
        d = np.zeros(n)
        for _ in range(YIELDS):
            more = factored.solve(np.zeros(n + m), r - A @ d)[0][:n]
            d += more
            if np.abs(more).max() <= EPS * np.abs(d).max():
                break
        found: Array = d / self.weight
        return found
