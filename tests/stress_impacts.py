"""Contacts that are struck together, each set of them that can be: Newton's law with complementarity.

The FMU starts just above a configuration in which the gaps of the set close, at speeds in proportion to them,
so that they close at one instant; just after it, with M, G, e of the model (geometry.py),

  impulses         M (v+ - v-) = G^T Lambda for a Lambda that pushes and is
  complementarity  zero where  s+ + e s- > 0 ,  and s+ + e s- >= 0
  energy           1/2 Lambda^T (s+ + s-) <= 0
  order            the model with its constraints declared in the opposite order has the same v+
  symmetry         a mirror image of the start has the mirror image of v+

within NEAR of the largest speed, after what the forces do between the start, the impact and the look at it
has been taken off to first order: v- = v + vdot t, v+ = v' - vdot' t; the mirror image may be off by as much
as its v-.  With friction, or constraints that act while a contact is closed: that no contact is left
approached, order and symmetry.
"""

from __future__ import annotations

import contextlib
import itertools
import random
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls
from stress_geometry import Collision, Geometry, geometry_of, twin

from lagfmu import names
from lagfmu.testing import Bench, Check, Facts, Finding, Probe, Session

FAMILY = "impacts"
ABOVE, JUST_ABOVE = 1e-6, 1e-12  # height of the start, relative to the gaps' own sizes
NEAR = 1e-4  # of the largest speed
ORDER = 1e-9  # the same for two FMUs of one system
MOST, TURNS = 24, 4  # sets of contacts; starts for each
LARGEST_MIRROR = 6  # coordinates of which all reflections are tried
Vector = NDArray[np.float64]
Values = dict[str, float]


def probes(facts: Facts, quick: bool) -> list[Probe]:
    """One for each set of contacts whose gaps can close together."""
    geometry = geometry_of(facts.path)
    if geometry is None or not geometry.contacts.any():
        return []
    if {*geometry.coordinates} - {s.name for s in facts.starts}:
        return []
    contacts = np.flatnonzero(geometry.contacts).tolist()
    sizes = sorted({1, 2, len(contacts)} if quick else range(1, len(contacts) + 1))
    sets = [s for size in sizes for s in itertools.combinations(contacts, size)]
    found = []
    for chosen in sorted(sets, key=lambda s: s != tuple(contacts))[:MOST]:
        place = _place(facts, geometry, list(chosen))
        if place is not None and _way(facts, geometry, list(chosen), place, 0) is not None:
            names = " and ".join(geometry.names[k] for k in chosen)
            found.append(Probe(FAMILY, names, partial(_strike, geometry, list(chosen), place)))
    return found


def _known(facts: Facts) -> Values:
    described = (*facts.parameters, *facts.inputs, *facts.starts)
    return (
        {"time": 0.0} | dict.fromkeys(facts.estimated, 0.0) | {s.name: s.start for s in described}
    )


def _state(geometry: Geometry, q: Vector, v: Vector) -> Values:
    states = names.motion(geometry.coordinates)
    return dict(zip(states, [*q.tolist(), *v.tolist()], strict=True))


def _sizes(facts: Facts, geometry: Geometry, known: Values, q: Vector) -> Vector:
    least = [facts.same_unit(n, known) or 1.0 for n in geometry.coordinates]
    return np.maximum(np.abs(q), least)


def _acting(geometry: Geometry, chosen: list[int]) -> list[int]:
    return [*chosen, *np.flatnonzero(geometry.bilateral).tolist()]


def _place(facts: Facts, geometry: Geometry, chosen: list[int]) -> Vector | None:
    """q (n) with f = 0 on the chosen contacts and what always acts, the other contacts well open."""
    known, rows = _known(facts), _acting(geometry, chosen)
    q = np.array([known[n] for n in geometry.coordinates])
    others = [k for k in np.flatnonzero(geometry.contacts) if k not in chosen]
    for _ in range(50):
        now = geometry.at(known | _state(geometry, q, 0 * q))
        if not (np.isfinite(now.f).all() and np.isfinite(now.G).all()):
            return None
        size = np.abs(now.G) @ _sizes(facts, geometry, known, q)
        if (np.abs(now.f[rows]) <= 1e-14 * size[rows]).all():
            q = np.where(np.abs(q) < 1e-13 * _sizes(facts, geometry, known, q), 0.0, q)
            return q if (now.f[others] > 1e-3 * size[others]).all() else None
        q = q - np.linalg.lstsq(now.G[rows], now.f[rows], rcond=1e-10)[0]
    return None


def _way(
    facts: Facts, geometry: Geometry, chosen: list[int], place: Vector, turn: int
) -> Vector | None:
    """A displacement (n), in sizes, that opens the chosen gaps alike; in a `turn` some less than others."""
    known, rows, count = _known(facts), _acting(geometry, chosen), len(chosen)
    size = _sizes(facts, geometry, known, place)
    G = geometry.at(known | _state(geometry, place, 0 * place)).G[rows] * size
    wanted = np.zeros(len(rows))
    wanted[:count] = [0.2 + 0.1 * turn if turn and (i + turn) % 2 else 1.0 for i in range(count)]
    wanted *= float(np.abs(G[:count]).sum(axis=1).max())
    way = np.linalg.lstsq(G, wanted, rcond=1e-10)[0]
    return np.asarray(way) if ((G @ way)[:count] > 0.1 * wanted.max()).all() else None


def _start(
    bench: Bench, geometry: Geometry, chosen: list[int], place: Vector, turn: int
) -> tuple[Vector, Vector, float] | None:
    """q and v (n) from which the gaps close at one instant, and how soon [s].

    In each `turn` but the first: with different speeds of the gaps, and a motion along the contacts.
    """
    way = _way(bench.facts, geometry, chosen, place, turn)
    if way is None:
        return None
    known, rows = _known(bench.facts), _acting(geometry, chosen)
    now = geometry.at(known | _state(geometry, place, 0 * place))
    size = _sizes(bench.facts, geometry, known, place)
    G = now.G[rows] * size
    chance = random.Random(turn)
    along = np.array([chance.uniform(-1, 1) if turn else 0.0 for _ in size])
    along -= np.linalg.lstsq(G, G @ along, rcond=1e-10)[0]
    rate = bench.ordinary_rate
    surfaces = np.linalg.lstsq(G, -now.s[rows], rcond=1e-10)[0]
    v = size * (rate * (along - way) + surfaces)
    own = np.abs(place) + [bench.facts.same_unit(n, known) for n in geometry.coordinates]
    known_sizes = (np.abs(now.G[chosen]) @ own > 1e-3 * (np.abs(now.G[chosen]) @ size)).all()
    above = ABOVE if known_sizes else JUST_ABOVE  # then its size is its height: all is finer
    return place + above * size * way, v, above / rate


def _impact(
    session: Session, geometry: Geometry, q: Vector, v: Vector, time: float
) -> tuple[Vector, Vector]:
    """Velocities (n) just before and just after the impact.  Raises RefusalError."""
    session.begin(_state(geometry, q, v), None)
    before = session.read()
    session.step(2 * time)
    after = session.read()

    def of(seen: Mapping[str, Any], order: int) -> Vector:
        return np.array([seen[names.derivative(n, order)] for n in geometry.coordinates])

    return v + of(before, 2) * time, of(after, 1) - of(after, 2) * time


def _strike(geometry: Geometry, chosen: list[int], place: Vector, bench: Bench) -> Finding:
    checks: list[Check] = []
    with contextlib.ExitStack() as stack:
        other = None
        if twin(bench.facts.path).exists():
            other = stack.enter_context(Bench(twin(bench.facts.path), bench.quick)).session
        for turn in range(TURNS):
            start = _start(bench, geometry, chosen, place, turn)
            if start is not None:
                checks += _struck(bench, geometry, chosen, place, start, other)
    return Finding(tuple(checks))


def _struck(
    bench: Bench,
    geometry: Geometry,
    chosen: list[int],
    place: Vector,
    start: tuple[Vector, Vector, float],
    other: Session | None,
) -> list[Check]:
    q, v, time = start
    known = _known(bench.facts)
    came, after = _impact(bench.session, geometry, q, v, time)
    there = geometry.at(known | _state(geometry, place, after))
    before = geometry.at(known | _state(geometry, place, came))
    checks = _law(geometry, before, there, came, after, chosen)
    if other is not None:
        _, found = _impact(other, geometry, q, v, time)
        error = _norm(before.M, found - after)
        checks.append(Check("order of declaration", error, ORDER * _norm(before.M, v)))
    for mirror in _mirrors(geometry, known, place):
        reached, image = _impact(bench.session, geometry, mirror * q, mirror * v, time)
        apart = _norm(before.M, reached * mirror - came)  # by forces, which need no symmetry
        error = _norm(before.M, image * mirror - after)
        checks.append(Check("symmetry", error, NEAR * _norm(before.M, v) + apart))
    return checks


def _law(
    geometry: Geometry,
    before: Collision,
    there: Collision,
    v: Vector,
    after: Vector,
    chosen: list[int],
) -> list[Check]:
    fastest = float(np.abs(before.s[chosen]).max())
    energy, gained = float(v @ before.M @ v), float(after @ before.M @ after - v @ before.M @ v)
    inside = max(0.0, -float(there.s[chosen].min()))
    if geometry.rough:  # what acts along a contact is none of its business
        return [Check("complementarity", inside, NEAR * fastest)]
    rows = _acting(geometry, chosen)
    factor = np.linalg.cholesky(before.M)
    W = np.linalg.solve(factor, before.G[rows].T)
    W_rows = np.sqrt((W * W).sum(axis=0))
    w = (there.s + before.e * before.s)[chosen]
    leaves = np.diag(np.maximum(w, 0.0) * (np.abs(w) > NEAR * fastest) / fastest)
    right = np.linalg.solve(factor, before.M @ (after - v))
    signed = W[:, len(chosen) :]
    columns = np.hstack([W[:, : len(chosen)] / W_rows[: len(chosen)], signed, -signed])
    free = np.zeros((len(chosen), 2 * signed.shape[1]))
    A = np.vstack([columns, np.hstack([leaves, free])])
    found, missed = nnls(A, np.concatenate([right, np.zeros(len(chosen))]))
    Lambda = found[: len(chosen)] / W_rows[: len(chosen)]
    gain = float(Lambda @ (there.s + before.s)[chosen]) / 2
    scale = float(np.sqrt(energy))
    checks = [
        Check("impulses", float(missed), NEAR * scale),
        Check("complementarity", max(0.0, -float(w.min())), NEAR * fastest),
        Check("energy", max(0.0, gain), NEAR * energy),
    ]
    if not before.nu.any():
        checks.append(Check("kinetic energy", max(0.0, gained / 2), NEAR * energy))
    return checks


def _norm(M: Vector, v: Vector) -> float:
    return float(np.sqrt(max(float(v @ M @ v), 0.0)))


def _mirrors(geometry: Geometry, known: Values, place: Vector) -> list[Vector]:
    """Reflections of coordinates that leave M and the set of constraints as they are."""
    n = len(place)
    if n > LARGEST_MIRROR:
        return []
    chance = random.Random(n)
    signs = [np.array(s) for s in itertools.product((1.0, -1.0), repeat=n)][1:]
    for _ in range(2):
        q = place + np.array([chance.uniform(-0.1, 0.1) for _ in place])
        v = np.array([chance.uniform(-1, 1) for _ in place])
        here = geometry.at(known | _state(geometry, q, v))
        signs = [
            s
            for s in signs
            if _alike(geometry, here, geometry.at(known | _state(geometry, s * q, s * v)), s)
        ]
    return signs


def _alike(geometry: Geometry, here: Collision, there: Collision, signs: Vector) -> bool:
    if not np.allclose(there.M * signs * signs[:, None], here.M, rtol=1e-9, atol=0):
        return False

    def described(one: Collision, G: Vector) -> Vector:
        table = np.column_stack([geometry.contacts, one.f, one.s, one.e, G])
        turned = np.where(geometry.contacts, 1.0, np.sign(one.s))  # f = 0 is -f = 0
        table[:, [1, 2, *range(4, table.shape[1])]] *= turned[:, None]
        table = np.hstack([table, geometry.gates @ np.column_stack([one.f, G])])
        return table[np.lexsort(np.round(table, 9).T)]

    return np.allclose(described(here, here.G), described(there, there.G * signs), atol=1e-8)
