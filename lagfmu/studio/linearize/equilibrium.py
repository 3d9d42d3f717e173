"""Where a mechanism rests: Newton's method on the positions that the constraints allow.

At rest, v = 0 and q' = 0, the accelerations a of the coordinates z that are left free vanish:

    M da/dz dz = -M a   (least squares; of all dz the least) ,   q <- s(q + T dz) ,   f(q) = 0

with M of these coordinates (forces, not accelerations, have no part along what is indifferent), f(q) = 0 by
Gauss and Newton, contacts and frictions as they stand.  A step is as long as the accelerations go on
linearly.  Where M a has a part that no dz takes away, as at the level of a pendulum's pivot, or dz is long
and against the forces, a step goes where these push: from far away what is found is rather stable, from near
what is near.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ... import names
from ...errors import SimulationError
from .chart import MOST, Chart, Rows, chart, mass
from .exchange import Exchange, Floats

ROUNDS, PUSHES = 150, 30  # of Newton's method; of steps along the forces
NEARLY, GROWS, SHORTEST = (
    0.5,
    4.0,
    1e-4,
)  # how linear a step is; how its bound changes; the shortest bound
PUSHED = 0.2  # part of a coordinate's size, along the forces
FARTHEST = 0.4  # part of a coordinate's size, at first
ARRIVED = 1e-13  # likewise
SETTLED = 1e-6  # likewise: where it no longer gets closer
UNMET, LEFT = (
    1e-6,
    0.5,
)  # part of the forces that no displacement takes away: none; one that is pushed along
NO_FORCE = 1e-10  # of a size
LATER = (0.37, 1.1)  # s: forces at rest are those of these times too


def find(ex: Exchange, rows: Rows, inputs: Sequence[str], t: float) -> Chart:
    """Move `ex` to the equilibrium that Newton's method finds; the chart there.

    Raises SimulationError where there is none.
    """
    x = np.where(ex.coordinate, ex.state(), 0.0)
    ex.put(x)
    _check_rest(ex, rows)
    pushes, unmets, last, radius, pushed = 0, 0, np.inf, FARTHEST, PUSHED
    unheld, before = "", np.zeros(0)
    for _ in range(ROUNDS):
        now = chart(ex, rows, inputs)
        a = now.accelerations(ex)
        dz, unmet = _step(ex, now, M := _inertia(ex, now), a)
        far, push = _far(ex, now, dz), now.along(a)
        against = far > FARTHEST and _along(ex, now, push, dz) < 0
        if unmet > LEFT or (against and pushes < PUSHES):
            pushes, unmets = pushes + against, unmets + (unmet > LEFT)
            unheld = unheld or _unheld(ex, now, a)
            if unmets > PUSHES:
                raise SimulationError(unheld)
            way = now.T[:, : now.places] @ push
            if len(before) and (way / ex.size) @ (before / ex.size) < 0:
                pushed /= 2  # to and fro
            before = way
            _move(ex, rows, inputs, now, push * (pushed / max(_far(ex, now, push), 1e-300)))
            continue
        if far <= ARRIVED or (far < SETTLED and far >= last):
            if unmet > UNMET:
                raise SimulationError(_unheld(ex, now, a))
            _check_time(ex, t)
            return now
        last = far
        radius = _trusted(ex, rows, inputs, now, M, dz, radius)
    raise SimulationError(
        f"no equilibrium was found in {ROUNDS} steps of Newton's method from the start: start nearer to it "
        "(--set NAME=VALUE)"
    )


def _far(ex: Exchange, now: Chart, dz: Floats) -> float:
    """How far that moves any coordinate, in its size."""
    moved = now.T[:, : now.places] @ dz
    return float((np.abs(moved) / ex.size)[ex.coordinate].max(initial=0.0))


def _along(ex: Exchange, now: Chart, one: Floats, other: Floats) -> float:
    """Positive where two displacements go the same way, each coordinate in its size."""
    size = _sizes(ex, now)
    return float((one / size) @ (other / size))


def _sizes(ex: Exchange, now: Chart) -> Floats:
    """Of the coordinates of z."""
    size = dict(zip(ex.states, ex.size.tolist(), strict=True))
    return np.array([size[n] for n in now.names[: now.places]])


def _inertia(ex: Exchange, now: Chart) -> Floats:
    """Of the velocities of z, to make forces of accelerations; 1 where the FMU does not tell it."""
    basis = now.T[:, now.places :]
    if names.KINETIC not in ex.rules or basis.shape[1] > MOST:
        return np.eye(basis.shape[1])
    return mass(ex, basis)


def _step(ex: Exchange, now: Chart, M: Floats, a: Floats) -> tuple[Floats, float]:
    """dz of the coordinates, and the part of the forces M a that it does not take away."""
    if not len(a):
        return np.zeros(now.places), 0.0
    size = _sizes(ex, now)
    K, a = M @ (now.E @ now.A)[now.places :, : now.places] * size, M @ a
    weight = np.abs(K).max(axis=1, initial=0.0)
    weight = 1 / np.where(weight > 0, weight, max(float(weight.max(initial=0.0)), 1.0))
    dz, *_ = np.linalg.lstsq(weight[:, None] * K, -weight * a, rcond=1e-9)
    left = weight * (K @ dz + a)
    whole = float(np.abs(weight * a).max())
    return dz * size, float(np.abs(left).max()) / whole if whole > NO_FORCE else 0.0


def _trusted(
    ex: Exchange,
    rows: Rows,
    inputs: Sequence[str],
    now: Chart,
    M: Floats,
    dz: Floats,
    radius: float,
) -> float:
    """A step of at most `radius`, smaller until the next one of the same K is about what is left of this; the
    radius for the next."""
    x, far = ex.state(), _far(ex, now, dz)
    while True:
        part = min(1.0, radius / far)
        _move(ex, rows, inputs, now, part * dz)
        left, _ = _step(ex, now, M, now.accelerations(ex))
        off = _far(ex, now, left - (1 - part) * dz) / (part * far)
        if off < NEARLY or radius < SHORTEST:
            return radius * (GROWS if part < 1 else 1.0)
        if off < 1:
            return radius
        ex.put(x)
        radius = min(radius, far) / GROWS


def _move(ex: Exchange, rows: Rows, inputs: Sequence[str], now: Chart, dz: Floats) -> None:
    """By dz, and back onto f = 0."""
    x = ex.state() + np.where(ex.coordinate, now.T[:, : now.places] @ dz, 0.0)
    place(ex, rows, inputs, now, x)


def place(ex: Exchange, rows: Rows, inputs: Sequence[str], now: Chart, x: Floats) -> None:
    """At x, and onto f = 0 by Gauss and Newton, which begins with the J of a chart nearby."""
    ex.put(x)
    if not rows.places:
        return
    J = now.J * ex.size
    best = np.inf
    for k in range(30):
        f = ex.read(rows.places)
        if not np.abs(f).max() < best:
            break
        best = float(np.abs(f).max())
        if k % 3 == 2:
            J = ex.along(rows.places, inputs, np.eye(len(x))) * ex.size
        back, *_ = np.linalg.lstsq(J, -f, rcond=1e-9)
        ex.put(ex.state() + np.where(ex.coordinate, ex.size * back, 0.0))


def _check_rest(ex: Exchange, rows: Rows) -> None:
    """Raises SimulationError where constraints move what they hold."""
    q, rate = ex.coordinate, ex.rate()
    moving = [n for n, r, s in zip(ex.rates, rate, ex.size, strict=True) if abs(r) > 1e-12 * s]
    moving = [n for n, of in zip(ex.rates, q, strict=True) if of and n in moving]
    told = [*rows.speeds, *(n for n in map(names.derivative, rows.places) if n in ex.rules)]
    driven = [n for n, r in zip(told, ex.read(told), strict=True) if abs(r) > 1e-12]
    if moving or driven:
        raise SimulationError(
            f"there is no equilibrium: with all velocities 0 {', '.join(moving + driven)} "
            "would not be 0, for a constraint moves: stop what moves it (--set 'der(INPUT)=0'), or linearize "
            "at a time of the motion (--at T)"
        )


def _check_time(ex: Exchange, t: float) -> None:
    """Raises SimulationError where the forces at rest are others later."""
    now = ex.rate()
    size = np.abs(now) + ex.size
    for later in LATER:
        ex.at(t + later)
        if (np.abs(ex.rate() - now) > 1e-9 * size).any():
            raise SimulationError(
                "there is no equilibrium: forces or constraints depend on time: linearize at a time of the "
                "motion (--at T)"
            )
    ex.at(t)


def _unheld(ex: Exchange, now: Chart, a: Floats) -> str:
    """What to say of accelerations that no displacement takes away."""
    held = sorted(zip(np.abs(a), now.names[now.places :], a, strict=True), reverse=True)
    told = [
        f"{names.rate_of(n)} = {value:.6g}" for size, n, value in held if size > UNMET * held[0][0]
    ]
    stands = [n for n in ex.rules if names.read(n).quantity == names.CONTACT]
    values = zip(stands, ex.read(stands), strict=True)
    contacts = [f"{names.read(n).constraint} {'closed' if on else 'open'}" for n, on in values]
    stand = f" ({', '.join(contacts)})" if contacts else ""
    return (
        f"there is no equilibrium as contacts and frictions stand{stand}: at rest {', '.join(told[:3])} (SI "
        "units), and no displacement takes that away: add what holds it (a spring, a friction, an input's "
        "value), or linearize at a time of the motion (--at T)"
    )
