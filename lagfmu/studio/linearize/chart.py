"""Coordinates of the states that the constraints allow beside one state, and the linear system in them.

An FMU's states x = (q, v) obey h(x, u) = 0: f of what holds (holonomic rows, closed contacts), its rate
df/dt, the velocity rows (nonholonomic rows, what friction holds), and that a state that is set stays as it
is (a quaternion of norm 1, an angle that follows an attitude: the FMU settles it, x = s(x)).  With

    H = dh/dx ,   H T = 0 ,   E T = 1 ,   H K = -dh/du ,   E K = 0

the displacements are dx = T z + K du for z = E dx: coordinates and velocities that have names.  Which ones,
a QR decomposition with column pivoting (Golub & Van Loan, sect. 5.4.2) of a null space of H says that is
orthonormal in the metric of M: what moves furthest, in its own size, for an energy.  Then

    A = E (dx'/dx) T ,   B = E (dx'/dx K + dx'/du) ,   C = (dy/dx) T ,   D = dy/dx K + dy/du

with no mode of a constraint: on T the FMU's stabilization of its constraints adds nothing.

Where no linear system holds on all sides of a state: frictions that slide, contacts about to change.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr, solve_triangular

from ... import names
from ...errors import SimulationError
from .exchange import Exchange, Floats

Places = NDArray[np.intp]
RANK = 1e-9  # singular value below which rows depend on each other
EMPTY = 1e-14  # part of the largest row of dh/dx, in sizes, that is no row
FLOW = 1e-3  # part of a size that the motion goes on, for how rows turn
MOST = 60  # velocities of which M is asked for
PREFERRED, LAST = 1e2, 1e-2  # of a coordinate that follows an attitude, of one without unit


@dataclass(frozen=True)
class Rows:
    """Names of what acts: positions f, velocities; frictions that hold."""

    places: list[str]
    speeds: list[str]
    stuck: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Chart:
    """z: `names`, the first `places` of them coordinates; T (n, k), K (n, m), E of the docstring; J (f, n)
    of the positions; A and B: dx'/dz (n, k), dx'/du (n, m); `noise` [1/s, 1/s^2]: the largest of dx'/dx in
    sizes, of which A has what rounding leaves."""

    names: list[str]
    places: int
    T: Floats
    K: Floats
    E: Floats
    J: Floats
    A: Floats
    B: Floats
    noise: float

    def matrix(self, size: Floats, least: float) -> Floats:
        """A (k, k) with 0 where it is rounding: below that part of the largest change of a rate of the FMU's
        velocities, or of the row's own."""
        A, scale = self.E @ self.A, np.abs(self.E) @ size
        parts = np.abs(A) * scale / scale[:, None]
        largest = parts.max(axis=1, initial=0.0)
        largest[self.places :] = self.noise
        return np.where(parts < least * largest[:, None], 0.0, A)

    def accelerations(self, ex: Exchange) -> Floats:
        """Rates of the velocities of z where `ex` stands."""
        return np.asarray((self.E @ ex.rate())[self.places :])

    def along(self, a: Floats) -> Floats:
        """Of coordinates a displacement the way of accelerations: of those that have one."""
        of = {names.rate_of(n): k for k, n in enumerate(self.names[: self.places])}
        found = np.zeros(self.places)
        for n, value in zip(self.names[self.places :], a, strict=True):
            if n in of:
                found[of[n]] = value
        return found


def acting(ex: Exchange) -> Rows:
    """What holds at this state: not contacts that are open, nor what goes with them."""
    described = {v.name: v.description or "" for v in ex.description.modelVariables}
    told = [n for n in described if names.read(n).quantity == names.RESIDUAL]
    of = {n: names.read(n).constraint for n in told}
    slips = {n: names.name(names.SLIP, n) for n in of.values()}
    forces = {n: names.name(names.MULTIPLIER, n) for n in of.values()}
    values = dict(zip(forces, ex.read([*forces.values()]), strict=True))
    open_ = _open(ex)
    places, speeds, stuck = [], [], []
    for n in told:
        row = of[n]
        if row in open_ or (open_ and values[row] == 0 and not _responds(ex, forces[row])):
            continue
        if slips[row] in described:
            speeds.append(slips[row])
            stuck.append(row)
        elif described[n].startswith(names.MISSED_VELOCITY):
            speeds.append(n)
        else:
            places.append(n)
    return Rows(places, speeds, stuck)


def _open(ex: Exchange) -> set[str]:
    """Contacts that are."""
    told = [n for n in ex.rules if names.read(n).quantity == names.CONTACT]
    return {names.read(n).constraint for n, on in zip(told, ex.read(told), strict=True) if not on}


def _responds(ex: Exchange, force: str) -> bool:
    """Whether a multiplier changes with the state."""
    return bool(ex.along([force], [], np.eye(len(ex.states))).any())


def chart(ex: Exchange, rows: Rows, inputs: Sequence[str]) -> Chart:
    """Of the state at which `ex` stands."""
    n, q = len(ex.states), ex.coordinate
    every, none = np.eye(n), np.zeros((n, len(inputs)))
    by = np.eye(len(inputs))
    settled, moved = np.split(ex.along([*ex.states, *ex.rates], inputs, every), 2)
    moved_u = ex.along(ex.rates, inputs, none, by)
    held, count = [*rows.places, *rows.speeds], len(rows.places)
    J, G = np.split(ex.along(held, inputs, every), [count])
    J_u, G_u = np.split(ex.along(held, inputs, none, by), [count])
    turned, turned_u = _turning(ex, rows.places, inputs)
    J_rate = J[:, q] @ moved[q] + turned
    u_rate = J[:, q] @ moved_u[q] + turned_u + J_u @ _shifted(inputs)
    bound = every - settled
    loose = np.abs(bound * ex.size).max(axis=1) > RANK * ex.size
    H = np.vstack([bound[loose], J, J_rate, G])
    H_u = np.vstack([none[loose], J_u, u_rate, G_u])
    N, solve = _null_space(H, ex.size)
    E, found, places = _chosen(ex, N, moved, settled)
    T = N @ np.linalg.inv(E @ N)
    K = -solve(H_u)
    K -= T @ (E @ K)
    A = ex.along(ex.rates, inputs, T)
    B = ex.along(ex.rates, inputs, K, by)
    noise = float((np.abs(moved) * ex.size / ex.size[:, None])[~q].max(initial=0.0))
    return Chart(found, places, T, K, E, J, A, B, noise)


def _shifted(inputs: Sequence[str]) -> Floats:
    """(m, m): 1 where the column is the derivative of the row: df/dt holds df/du u'."""
    found = np.zeros((len(inputs), len(inputs)))
    for i, n in enumerate(inputs):
        if (rate := names.rate_of(n)) in inputs:
            found[i, list(inputs).index(rate)] = 1.0
    return found


def _turning(ex: Exchange, places: Sequence[str], inputs: Sequence[str]) -> tuple[Floats, Floats]:
    """d/dt of df/dx (f, n) and of df/du (f, m) along the motion, by differences of fourth order."""
    n, m = len(ex.states), len(inputs)
    x, rate, u = ex.state(), np.where(ex.coordinate, ex.rate(), 0.0), ex.read(inputs)
    speed = _shifted(inputs) @ u
    quick = max(
        float((np.abs(rate) / ex.size).max(initial=0.0)),
        float((np.abs(speed) / np.where(u == 0, 1.0, np.abs(u))).max(initial=0.0)),
    )
    if not places or quick == 0:
        return np.zeros((len(places), n)), np.zeros((len(places), m))
    h = FLOW / quick

    def at(steps: float) -> Floats:
        ex.go(x, rate, inputs, u, speed, steps * h)
        by_x = ex.along(places, inputs, np.eye(n))
        return np.hstack([by_x, ex.along(places, inputs, np.zeros((n, m)), np.eye(m))])

    found = (8 * (at(1) - at(-1)) - (at(2) - at(-2))) / (12 * h)
    at(0)
    return found[:, :n], found[:, n:]


def _null_space(H: Floats, size: Floats) -> tuple[Floats, Callable[[Floats], Floats]]:
    """N (n, k) with H N = 0, orthonormal in the sizes; and X of the least norm with H X = right."""
    scaled = H * size
    largest = np.abs(scaled).max(axis=1, initial=0.0)
    kept = largest > EMPTY * largest.max(initial=0.0)
    rows = scaled[kept] / largest[kept, None]
    U, s, Vt = np.linalg.svd(rows, full_matrices=True)
    rank = int((s > RANK * s.max(initial=1.0)).sum())
    N = size[:, None] * Vt[rank:].T

    def solve(right: Floats) -> Floats:
        y = (U[:, :rank].T @ (right[kept] / largest[kept, None])) / s[:rank, None]
        return np.asarray(size[:, None] * (Vt[:rank].T @ y))

    return N, solve


def _chosen(
    ex: Exchange, N: Floats, moved: Floats, settled: Floats
) -> tuple[Floats, list[str], int]:
    """E (k, n), names and how many are coordinates."""
    q, n = np.flatnonzero(ex.coordinate), len(ex.states)
    weight = 1 / ex.size
    follows = np.abs(settled.diagonal()) < RANK
    weight[follows] *= PREFERRED
    weight[[ex.unit.get(s) in (None, "1") for s in ex.states]] *= LAST
    of_q = _measured(ex, N, q)
    picks = q[_pivots(of_q * weight[q, None])]
    places = [ex.states[j] for j in picks]
    E_q = np.eye(n)[picks]
    rest = N @ _kernel(E_q @ N)
    rates = {ex.states[j]: ex.rates[j] for j in q}
    at_rest = not np.abs(ex.rate()[q] / ex.size[q]).max(initial=0.0) > 0
    own = [j for j in picks if at_rest or rates[ex.states[j]] in ex.states]
    candidates = [(rates[ex.states[j]], moved[j]) for j in own]
    speeds, E_v = _independent(candidates, rest, ex.size)
    if len(speeds) < rest.shape[1]:  # speeds of its own, or rates that no coordinate has
        v = [j for j in range(n) if not ex.coordinate[j] and ex.states[j] not in speeds]
        more = [(ex.states[j], np.eye(n)[j]) for j in v]
        left = rest @ _kernel(E_v @ rest) if speeds else rest
        added, E_w = _independent(more, left, ex.size)
        speeds, E_v = speeds + added, np.vstack([E_v, E_w])
    if len(places) + len(speeds) != N.shape[1]:
        raise SimulationError(
            "the states that the constraints allow have no names among coordinates and velocities: the "
            "configuration is singular: choose another"
        )
    return np.vstack([E_q, E_v]), [*places, *speeds], len(places)


def _independent(
    candidates: list[tuple[str, Floats]], basis: Floats, size: Floats
) -> tuple[list[str], Floats]:
    """Of linear functions of the state those that are independent on a basis (n, k)."""
    if not candidates or not basis.shape[1]:
        return [], np.zeros((0, len(size)))
    rows = np.array([row for _, row in candidates])
    on = rows @ basis
    largest = np.abs(on).max(axis=1)
    on /= np.where(largest > RANK * largest.max(), largest, np.inf)[:, None]
    found = sorted(_pivots(on))
    return [candidates[k][0] for k in found], rows[found]


def _pivots(rows: Floats) -> list[int]:
    """Places of as many independent rows as there are, the longest first."""
    if not rows.size:
        return []
    R, order = qr(rows.T, mode="r", pivoting=True)
    sizes = np.abs(R.diagonal())
    return [int(k) for k in order[: int((sizes > RANK * sizes.max(initial=0.0)).sum())]]


def _kernel(rows: Floats) -> Floats:
    _, s, Vt = np.linalg.svd(rows, full_matrices=True)
    return np.asarray(Vt[int((s > RANK * s.max(initial=0.0)).sum()) :].T)


def _measured(ex: Exchange, N: Floats, q: Places) -> Floats:
    """(q, k): how far coordinates go in motions of the energy 1/2 that are orthogonal in the metric of M.

    Where the FMU tells no energy, or positions have more freedom than velocities, in their sizes alone.
    """
    of_q = N[q] @ _range(N[q] / ex.size[q, None])
    rest = N @ _kernel(N[q])
    if names.KINETIC not in ex.rules or rest.shape[1] != of_q.shape[1] or rest.shape[1] > MOST:
        return np.asarray(of_q)
    M = mass(ex, rest)
    try:
        L = np.linalg.cholesky(M)
    except np.linalg.LinAlgError:
        return np.asarray(of_q)
    way = ex.along([ex.rates[j] for j in q], [], rest)
    return np.asarray(solve_triangular(L, way.T, lower=True).T)


def _range(rows: Floats) -> Floats:
    _, s, Vt = np.linalg.svd(rows, full_matrices=True)
    return np.asarray(Vt[: int((s > RANK * s.max(initial=0.0)).sum())].T)


def mass(ex: Exchange, basis: Floats) -> Floats:
    """(k, k): M in a basis (n, k) of velocities, of the kinetic energy, which is quadratic in them."""
    x, k = ex.state(), basis.shape[1]
    M = np.zeros((k, k))

    def energy(w: Floats) -> float:
        ex.put(x + w)
        return float(ex.read([names.KINETIC])[0])

    for i in range(k):
        for j in range(i + 1):
            plus, minus = basis[:, i] + basis[:, j], basis[:, i] - basis[:, j]
            M[i, j] = M[j, i] = (energy(plus) + energy(-plus) - energy(minus) - energy(-minus)) / 4
    ex.put(x)
    return M


GRAZES = 1e-9  # part of what a multiplier or a gap may be, that is none
TOUCHES = 1e-9  # m/s: a slip that is none


def check_sliding(ex: Exchange) -> None:
    """Raises SimulationError where a friction slides."""
    slips = [n for n in ex.rules if names.read(n).quantity == names.SLIP]
    forces = [names.name(names.MULTIPLIER, names.read(n).constraint) for n in slips]
    forces = [n if n in ex.rules else "" for n in forces]
    sticks = [n for n in ex.rules if names.read(n).quantity == names.STICKS]
    loose = [
        names.read(n).constraint for n, on in zip(sticks, ex.read(sticks), strict=True) if not on
    ]
    if not loose:
        return
    contacts = [n for n in ex.rules if names.read(n).quantity == names.CONTACT]
    alone = len(loose) == len(sticks) or bool(ex.read(contacts).all())  # no other row can be meant
    for n, force, slip in zip(slips, forces, ex.read(slips), strict=True):
        if force and (alone or abs(slip) > TOUCHES) and ex.read([force])[0] != 0:
            raise SimulationError(
                f"friction {' or '.join(loose)} slides ({n} = {slip:.6g}): its force has a kink where the "
                "slip stops, and no linear system holds across it: linearize where it sticks, or a scene in "
                "which it does (--frictions '')"
            )


def check_contacts(ex: Exchange) -> None:
    """Raises SimulationError where a contact would open or close, or is about to."""
    told = [n for n in ex.rules if names.read(n).quantity == names.CONTACT]
    closed = ex.read(told)
    of = [names.read(n).constraint for n in told]
    forces = [names.name(names.MULTIPLIER, n) for n in of]
    gaps = [names.name(names.RESIDUAL, n) for n in of]
    known = [n for n in ex.rules if names.read(n).quantity == names.MULTIPLIER]
    largest = float(np.abs(ex.read(known)).max(initial=0.0))
    wide = float(ex.size[ex.coordinate].max(initial=1.0))
    told_of = zip(of, closed, forces, ex.read(forces), gaps, ex.read(gaps), strict=True)
    for n, on, named, force, gap_named, gap in told_of:
        if on and force < -GRAZES * largest:
            raise SimulationError(
                f"contact {n!r} would have to pull ({named} = {force:.6g}): there is no such state with "
                "it closed: start where it is open, or press it on"
            )
        if (on and force <= GRAZES * largest) or (not on and abs(gap) <= GRAZES * wide):
            what = f"{named} = {force:.6g}" if on else f"{gap_named} = {gap:.6g}"
            raise SimulationError(
                f"contact {n!r} grazes ({what}): a little displacement opens or closes it, and no linear "
                "system holds on both sides: choose a state where it presses, or is apart"
            )
        if not on and gap < 0:
            raise SimulationError(
                f"contact {n!r} would be passed through ({gap_named} = {gap:.6g}): there is no such "
                "state with it open: start where it is closed"
            )
    sticks = [n for n in ex.rules if names.read(n).quantity == names.STICKS]
    for n, on in zip(sticks, ex.read(sticks), strict=True):
        margin = names.name(names.MARGIN, names.read(n).constraint)
        if on and margin in ex.rules and (left := ex.read([margin])[0]) < 0:
            raise SimulationError(
                f"friction {names.read(n).constraint!r} would slip ({margin} = {left:.6g}): there is no such "
                "state in which it sticks: start nearer to one, or raise its coefficient"
            )
