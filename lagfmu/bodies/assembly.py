"""Where a mechanism begins: rough places and joint coordinates -> positions that satisfy every joint.

Newton's method with the least movement in the metric of M, damped by halving,

    minimize  d^T M d   with   f(q) + f_q d = 0 ,   then   minimize  (v - v0)^T M (v - v0)   with   G v = nu ,

at first with all that was given held by rows of its own; if that cannot be closed, given values move too, and
each that does is told with both numbers.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import sympy as sp
from scipy.sparse import csr_array, diags_array, hstack, vstack
from sympy.core.function import AppliedUndef

from ..errors import LagfmuWarning, ModelError
from ..model.elements import Contact, Expr, Holonomic, Nonholonomic, name_of
from ..model.model import Model
from ..names import derivative
from ..numeric.linear import divided, factor, norms, row_sizes
from ..numeric.system import Sparse
from .branches import CLOSED, has_loop, tell_second_branch
from .draft import Draft
from .given import Beginning, given_values, known_names
from .guess import guessed
from .joints import CROSS
from .rows import TIME, Array, Rows, condition, numbers_of

STEPS, HALVINGS = 100, 12
TRIES = 12  # beginnings with other omitted values, where the first leads nowhere
LIGHT = 1e-6  # what resists a parameter of a curve, which has no mass, of that of the body
PARALLEL = 0.99  # cosine of the axes of a universal joint
REDUNDANT = 1e-11  # a singular value, relative to the largest: rows that say the same
DENSE = 200  # speeds up to which dense algebra is as quick
YIELDING, YIELDS = 1e-5, 10  # of a row: its slack; how often at most what is left is done
EPS = float(np.finfo(float).eps)


class GivenStartWarning(LagfmuWarning):
    """A start value that was given, and cannot be."""


@np.errstate(all="ignore")  # what is not finite is told
def assemble(
    draft: Draft, model: Model, parts: Sequence[Any], start: Mapping[str, Any]
) -> tuple[dict[Expr, float], list[Expr], dict[str, tuple[float, bool]]]:
    """The start of each coordinate and velocity, in SI, and those of them that nothing given speaks of; then
    that of each joint coordinate that is free, and of its rate, and whether it is given.

    Raises ModelError if a name is unknown, or the joints cannot be closed.
    """
    known = known_names(draft, model)
    given = given_values(draft, model, known, start)
    places = {n: x for n, x in given.items() if not known[n].of_velocities}
    rates = {n: x for n, x in given.items() if known[n].of_velocities}
    acting = [
        c
        for c in model.constraints
        if not (isinstance(c, Contact) or c.while_closed or c.name in model.limited)
    ]
    closing = [c for c in acting if isinstance(c, Holonomic)]
    rolling = [c for c in acting if isinstance(c, Nonholonomic)]
    f = Rows(model, [condition(model, c) for c in closing])
    held = Rows(model, [known[n][:2] for n in places])
    wanted = np.concatenate([np.zeros(len(closing)), np.array([*places.values()])])
    moving = (_Moving if len(model.directions) <= DENSE else _MovingMuch)(draft, model)
    rough = moving.tied(guessed(draft, model, parts, places), places)
    if problems := list(_parallel([c.name for c in closing], f.values(rough))):
        raise ModelError(model.name, problems)
    size = moving.sized(rough)
    q, missed = moving.closed([f, held], wanted, rough)
    if missed.max(initial=0.0) > CLOSED:
        q, missed = moving.closed([f], np.zeros(len(closing)), q)
    if missed.max(initial=0.0) > CLOSED:
        motors = {name for name, line in model.parts if line.startswith("motor")}
        missing = _open([c.name for c in closing], f.values(q), missed, motors)
        raise ModelError(model.name, list(missing))
    _tell(model, places, held.values(q), size)
    _tell_beyond_limits(model, draft, parts, q)
    if has_loop(draft, parts) and moving.is_determined([f, held], q):
        measures = {n: of.values[0] for n, of in draft.relative.items() if n not in places}

        def closed_from(angles: Mapping[str, float]) -> tuple[Array, Array]:
            put = guessed(draft, model, parts, {**angles, **places})
            return moving.newton([f, held], wanted, moving.tied(put, places), CLOSED)

        tell_second_branch(model, measures, closed_from, rough, q)

    still = [f, Rows(model, [condition(model, c) for c in rolling])]
    driven = Rows(model, [known[n][:2] for n in rates])
    asked = np.concatenate([np.zeros(len(acting)), np.array([*rates.values()])])
    v = moving.velocities([*still, driven], asked, q, np.zeros(len(model.directions)))
    v = moving.velocities(still, np.zeros(len(acting)), q, v)
    if struck := _struck(model, q, v, size):
        still.append(Rows(model, [condition(model, c) for c in struck]))
        v = moving.velocities(still, np.zeros(len(acting) + len(struck)), q, v)
    found = driven.rates(q, v)
    _tell(model, rates, found, float(np.abs(found).max(initial=0.0)))
    fast = float(np.abs(v / moving.scale).max(initial=0.0))
    rounding = 4 * EPS * np.concatenate([np.full(len(q), size), moving.scale * fast])
    begins = {
        s: float(x) if abs(x) > least else 0.0
        for s, x, least in zip(model.states, (*q, *v), rounding, strict=True)
    }
    said = _spoken_of(model, known, given)
    left = [s for s in model.states if s not in said]
    return begins, left, _of_joints(draft, model, given, q, v)


def _of_joints(
    draft: Draft, model: Model, given: Mapping[str, float], q: Array, v: Array
) -> dict[str, tuple[float, bool]]:
    """The start of each joint coordinate that no motor prescribes, and of its rate, and whether it is given:
    then as it is given, but for rounding."""
    free = {n: of.values[:2] for n, of in draft.relative.items() if n not in draft.driven}
    rows = Rows(model, [*free.values()])
    found = dict(zip(free, rows.values(q).tolist(), strict=True))
    found |= dict(zip(map(derivative, free), rows.rates(q, v).tolist(), strict=True))
    as_given = {n: given[n] for n, x in found.items() if n in given and math.isclose(x, given[n])}
    return {n: (as_given.get(n, x), n in given) for n, x in found.items()}


def _spoken_of(model: Model, known: Mapping[str, Beginning], given: Iterable[str]) -> set[Expr]:
    """The coordinates of which given values are made, the velocities of which given rates are."""
    places, found = list(model.coordinates), set()
    for of in map(known.__getitem__, given):
        symbols = (of.rate if of.of_velocities else of.value).atoms(AppliedUndef, sp.Derivative)
        found |= symbols - {*places} if of.of_velocities else symbols
    turned = (model.unwrapped[q].atoms(AppliedUndef) for q in found & model.unwrapped.keys())
    return found.union(*turned)


class _Moving:
    """Movements d (n_v) of a mechanism that are least in d^T W^2 d, and what they do to its coordinates."""

    def __init__(self, draft: Draft, model: Model) -> None:
        masses = {
            d: m
            for b in draft.motions.values()
            for d, m in zip(b.directions, b.masses, strict=True)
        } | {s: LIGHT * of.mass for s, of in draft.curves.items()}
        self.weight = np.sqrt(numbers_of(model, [masses[d] for d in model.directions]))
        self.lengths = np.array([model.coordinates.get(d) == "m" for d in model.directions])
        self.scale = np.ones(len(self.lengths))  # what is much of each speed, in a second
        rates = [model.kinematics.get(q, q.diff(TIME)) for q in model.coordinates]
        self._moved = Rows(model, [(sp.S.Zero, rate) for rate in rates])
        places = {q: j for j, q in enumerate(model.coordinates)}
        heads = [j for q, j in places.items() if name_of(q).endswith(".orientation.w")]
        self._quaternions = [slice(j, j + 4) for j in heads]
        self._angles = {places[q]: name_of(q) for q in model.unwrapped}
        self._turned = Rows(model, [(angle, sp.S.Zero) for angle in model.unwrapped.values()])

    def sized(self, q: Array) -> float:
        """The size of the mechanism at q [m], by which its lengths are judged from now on."""
        straight = np.abs(self._slopes([self._moved], q)) @ self.lengths > 0
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
        return self.tied(q + self._slopes([self._moved], q) @ d)

    def closed(self, rows: Sequence[Rows], wanted: Array, rough: Array) -> tuple[Array, Array]:
        """Coordinates at which the rows have the wanted values, and what each misses, relative to its size.

        A beginning from which Newton's method comes to rest elsewhere, as where all links lie on a line, is
        left for others about it.
        """
        draws = np.random.default_rng(0)
        best, least = rough, np.full(len(wanted), np.inf)
        for k in range(TRIES):
            away = draws.uniform(-0.5, 0.5, len(self.scale)) * self.scale
            q, missed = self.newton(rows, wanted, self.moved(rough, away) if k else rough)
            if missed.max(initial=0.0) < least.max(initial=0.0):
                best, least = q, missed
            if least.max(initial=0.0) <= CLOSED:
                break
        return best, least

    def is_determined(self, rows: Sequence[Rows], q: Array) -> bool:
        """True if the rows leave no motion."""
        slopes = np.vstack([r.slopes(q) for r in rows]) / self.weight
        return bool(np.linalg.matrix_rank(slopes) == len(self.weight))

    def newton(
        self, rows: Sequence[Rows], wanted: Array, q: Array, enough: float = 0.0
    ) -> tuple[Array, Array]:
        """Coordinates near q at which the rows have the wanted values, and what each misses: at most
        `enough`, or as little as can be."""
        r, A, size = self._missed(rows, wanted, q)
        if not (np.isfinite(r).all() and np.isfinite(np.abs(A).sum())):
            return q, np.full(len(r), np.inf)
        for _ in range(STEPS):
            if np.abs(r / size).max(initial=0.0) <= enough:
                break
            step = self._least(A, r, size)
            for halved in range(HALVINGS):
                new = self.moved(q, step * 0.5**halved)
                after = self._missed(rows, wanted, new)
                if np.linalg.norm(after[0] / after[2]) < np.linalg.norm(r / size):
                    break
            else:
                break
            q, (r, A, size) = new, after
        return q, np.abs(r / size)

    def _missed(self, rows: Sequence[Rows], wanted: Array, q: Array) -> tuple[Array, Any, Array]:
        """What is missing (m), the slopes (m, n_v), and how large a change each row sees (m)."""
        values, A = self._values_and_slopes(rows, q)
        return wanted - values, A, self._sizes(A)

    def _values_and_slopes(self, rows: Sequence[Rows], q: Array) -> tuple[Array, Any]:
        values, slopes = zip(*(row.values_and_slopes(q) for row in rows), strict=True)
        return np.concatenate(values), np.vstack(slopes)

    def _slopes(self, rows: Sequence[Rows], q: Array) -> Any:
        return np.vstack([row.slopes(q) for row in rows])

    def _sizes(self, A: Any) -> Array:
        size = np.abs(A * self.scale).max(axis=1, initial=0.0)
        return np.where(size > 0, size, 1.0)

    def _least(self, A: Any, r: Array, size: Array) -> Array:
        """d with A d = r as nearly as can be, each row by its size, and least among those."""
        A, r = A / size[:, None], r / size
        d: Array = np.linalg.lstsq(A / self.weight, r, rcond=REDUNDANT)[0] / self.weight
        return d

    def velocities(self, rows: Sequence[Rows], wanted: Array, q: Array, v: Array) -> Array:
        """The velocities nearest to v at which the rows have the wanted rates."""
        A = self._slopes(rows, q)
        missing = wanted - np.concatenate([r.drifts(q) for r in rows]) - A @ v
        return v + self._least(A, missing, self._sizes(A))


class _MovingMuch(_Moving):
    """Those of a mechanism with many speeds, by sparse algebra."""

    def _values_and_slopes(self, rows: Sequence[Rows], q: Array) -> tuple[Array, Sparse]:
        return np.concatenate([row.values(q) for row in rows]), self._slopes(rows, q)

    def _slopes(self, rows: Sequence[Rows], q: Array) -> Sparse:
        return vstack([row.sparse_slopes(q) for row in rows], format="csr")

    def _sizes(self, A: Sparse) -> Array:
        size = row_sizes(A.tocoo(), self.scale, np.ones(A.shape[0]))
        return np.where(size > 0, size, 1.0)

    def _least(self, A: Sparse, r: Array, size: Array) -> Array:
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


def _parallel(names: Sequence[str], values: Array) -> Iterator[str]:
    """Universal joints whose axes are parallel where they begin: which way they turn apart nobody says."""
    for name, cosine in zip(names, values.tolist(), strict=True):
        joint, _, row = name.partition(".")
        if row == CROSS and abs(cosine) > PARALLEL:
            apart = math.degrees(math.acos(min(abs(cosine), 1.0)))
            yield (
                f"the axes of universal joint {joint!r} begin {apart:.3g} degrees from parallel, expected "
                "square: choose other axes (axis=, second_axis=), turn a marker, or give a body another "
                "start, as its rpy"
            )


def _struck(model: Model, q: Array, v: Array, size: float) -> list[Contact]:
    """The contacts that touch at q and would be run into with v: they begin closed, without a blow."""
    contacts = [c for c in model.constraints if isinstance(c, Contact)]
    gaps = Rows(model, [condition(model, c) for c in contacts])
    found = zip(contacts, gaps.values(q), gaps.rates(q, v), strict=True)
    return [c for c, gap, rate in found if abs(gap) <= CLOSED * size and rate < 0]


def _open(
    names: Sequence[str], values: Array, missed: Array, motors: Collection[str]
) -> Iterator[str]:
    """Which joints miss, and which motors, the worst first."""
    if not np.isfinite(values).all():
        lost = {n.split(".")[0] for n, x in zip(names, values, strict=True) if not np.isfinite(x)}
        for joint in sorted(lost):
            yield f"joint {joint!r} has no finite value where it begins: start it elsewhere"
        return
    worst: dict[str, tuple[float, float]] = {}
    by_name = dict(zip(names, values.tolist(), strict=True))
    for name, value, miss in zip(names, values.tolist(), missed.tolist(), strict=True):
        joint = name.split(".")[0]
        worst[joint] = max(worst.get(joint, (0.0, 0.0)), (miss, abs(value)))
    for joint, (miss, value) in sorted(worst.items(), key=lambda item: -item[1][0]):
        if f"{joint}.{CROSS}" in by_name and miss > CLOSED:
            off = math.degrees(math.asin(min(abs(by_name[f"{joint}.{CROSS}"]), 1.0)))
            yield (
                f"universal joint {joint!r} cannot be closed: at the nearest that was found its axes miss "
                f"being square by {off:.3g} degrees: turn a marker, or choose other axes"
            )
        elif joint in motors and miss > CLOSED:
            yield (
                f"motor {joint!r} prescribes what the joints cannot follow: the nearest that was found "
                f"misses it by {value:.3g} (m or rad): begin elsewhere, by motion= or, of an input, by "
                "Motor(..., start=...)"
            )
        elif miss > CLOSED:
            yield (
                f"joint {joint!r} cannot be closed: the nearest that was found misses it by {value:.3g} "
                "(m or rad): correct a length, or give a start nearer to where it closes"
            )


def _tell_beyond_limits(model: Model, draft: Draft, parts: Sequence[Any], q: Array) -> None:
    """Joints that were assembled beyond a limit, with how to choose another place."""
    for part in parts:
        if getattr(part, "limits", None) is None:
            continue
        name = part.measures[0]
        stops = [model.constraint(f"{part.name}.{end}").expression for end in ("lower", "upper")]
        places = [draft.relative[name].values[0], *stops]
        value, *gaps = Rows(model, [(place, sp.S.Zero) for place in places]).values(q)
        if min(gaps) < -CLOSED:
            warnings.warn(
                f"model {model.name!r}: {name} is assembled at {float(value)!r}, beyond its limits: give "
                f"{name!r} a start within them; without one it is moved to a limit, or the start is refused",
                GivenStartWarning,
                stacklevel=5,
            )


def _tell(model: Model, given: Mapping[str, float], found: Array, size: float) -> None:
    """Given values that had to move, with both numbers."""
    for (name, asked), is_now in zip(given.items(), found.tolist(), strict=True):
        if abs(is_now - asked) > CLOSED * max(abs(asked), size):
            warnings.warn(
                f"model {model.name!r}: start of {name} = {asked!r} is {is_now!r}: the joints cannot be "
                "closed there",
                GivenStartWarning,
                stacklevel=5,
            )
