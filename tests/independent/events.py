"""Ten systems with events.  Their modes and events are written by hand, one after the other."""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, hypot, pi, sin, sqrt

import numpy as np
import sympy as sp
from scipy.optimize import brentq
from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols
from system import G, System, Vector, integrate, until

from lagfmu import Contact, Friction, Holonomic, Model, Nonholonomic, Parameter, multiplier

t = dynamicsymbols._t
x, y, z, x1, x2, theta = dynamicsymbols("x y z x1 x2 theta")
m, M, g, L, mu, e, c, omega = symbols("m M g L mu e c omega", positive=True)
M0 = 0.4  # kg
MASS, GRAVITY = Parameter(m, M0, "kg"), Parameter(g, G, "m/s^2")


def trampoline() -> System:
    """A ball that bounces on a plate that goes up and down."""
    A, A0, w, e0 = symbols("A", positive=True), 0.05, 8.0, 0.7
    model = Model(
        "MovingPlate",
        coordinates={y: "m"},
        lagrangian=m / 2 * y.diff() ** 2 - m * g * y,
        constraints=[Contact("plate", y - A * sp.sin(omega * t), restitution=e)],
        parameters=[
            MASS,
            GRAVITY,
            Parameter(A, A0, "m"),
            Parameter(omega, w, "rad/s"),
            Parameter(e, e0, "1", min=0),
        ],
        start={y: 0.6},
    )

    def expected(stop: float) -> Mapping[str, float]:
        begun, h, v, count = 0.0, 0.6, 0.0, 0
        while True:

            def gap(s: float, begun: float = begun, h: float = h, v: float = v) -> float:
                return h + v * s - G * s * s / 2 - A0 * sin(w * (begun + s))

            looked = np.linspace(1e-9, stop - begun, 4000)
            below = next((s for s in looked if gap(s) < 0), None)
            if below is None:
                s = stop - begun
                at = {"y": h + v * s - G * s * s / 2, "der(y)": v - G * s}
                return {**at, "closing.plate.count": count}
            s = brentq(gap, below - (looked[1] - looked[0]), below, xtol=1e-15)
            plate = A0 * w * cos(w * (begun + s))
            begun, h = begun + s, h + v * s - G * s * s / 2
            v = plate - e0 * (v - G * s - plate)
            count += 1

    return System(model, 1.5, expected)


def slack_string() -> System:
    """A bob on a string that goes slack, flies, and is caught again: the string takes its radial speed."""
    L0 = 0.9
    model = Model(
        "SlackString",
        coordinates={x: "m", y: "m"},
        lagrangian=m / 2 * (x.diff() ** 2 + y.diff() ** 2) - m * g * y,
        constraints=[Contact("string", L**2 - x**2 - y**2)],
        parameters=[MASS, GRAVITY, Parameter(L, L0, "m")],
        start={x: 0.0, y: -L, x.diff(): sqrt(3.5 * G * L0)},
    )

    def swing(_: float, q: Vector) -> tuple[float, float]:
        return q[1], -G / L0 * sin(q[0])

    def tension(_: float, q: Vector) -> float:
        return L0 * q[1] ** 2 + G * cos(q[0])

    def expected(stop: float) -> Mapping[str, float]:
        begun, (a, v), _ = until(swing, (0.0, sqrt(3.5 * G / L0)), 0.0, stop, tension)
        px, py, vx, vy = L0 * sin(a), -L0 * cos(a), L0 * v * cos(a), L0 * v * sin(a)

        def beyond(s: float) -> float:
            return hypot(px + vx * s, py + vy * s - G * s * s / 2) - L0

        caught = brentq(beyond, 0.05, 1.0, xtol=1e-15)
        px, py, vy = px + vx * caught, py + vy * caught - G * caught**2 / 2, vy - G * caught
        a = float(np.arctan2(px, -py))
        v = (vx * cos(a) + vy * sin(a)) / L0
        a, v = integrate(swing, (a, v), stop, begun + caught)
        pull = M0 * (L0 * v**2 + G * cos(a))
        at = {"x": L0 * sin(a), "y": -L0 * cos(a), "lambda.string": pull / (2 * L0)}
        return {**at, "departure.string.count": 1, "closing.string.count": 1}

    return System(model, 1.6, expected)


def ramp() -> System:
    """A particle that is blown over the brow of a hill z = -k x^2 and leaves it when it is fast enough."""
    k, F, k0, F0, v0 = symbols("k", positive=True), symbols("F", positive=True), 0.8, 2.5, 0.5
    model = Model(
        "Hill",
        coordinates={x: "m", z: "m"},
        lagrangian=m / 2 * (x.diff() ** 2 + z.diff() ** 2) - m * g * z,
        forces={x: F},
        constraints=[Contact("hill", z + k * x**2)],
        parameters=[MASS, GRAVITY, Parameter(k, k0, "1/m"), Parameter(F, F0, "N")],
        start={x: -0.2, z: -k0 * 0.04, x.diff(): v0},
    )

    def on(_: float, q: Vector) -> tuple[float, float]:
        slope, bend = -2 * k0 * q[0], -2 * k0
        return q[1], (F0 / M0 - slope * (G + bend * q[1] ** 2)) / (1 + slope**2)

    def push(_: float, q: Vector) -> float:
        return G - 2 * k0 * q[1] ** 2 - 2 * k0 * q[0] * on(0, q)[1]

    def expected(stop: float) -> Mapping[str, float]:
        begun, (q, v), _ = until(on, (-0.2, v0), 0.0, stop, push)
        s = stop - begun
        height = -k0 * q**2 - 2 * k0 * q * v * s - G * s * s / 2
        at = {"x": q + v * s + F0 / M0 * s * s / 2, "z": height, "departure.hill.time": begun}
        return {**at, "departure.hill.count": 1}

    return System(model, 0.6, expected)


def shaken_block() -> System:
    """A block on a rough floor that a force shakes: it sticks where the force is too small."""
    F, F0, w, mu0 = symbols("F", positive=True), 3.0, 4.0, 0.5
    limit = mu0 * M0 * G
    model = Model(
        "ShakenBlock",
        coordinates={x: "m", z: "m"},
        lagrangian=m / 2 * (x.diff() ** 2 + z.diff() ** 2) - m * g * z,
        forces={x: F * sp.sin(omega * t)},
        constraints=[
            Contact("floor", z),
            Nonholonomic("hold", x.diff()),
            Friction("grip", of=["hold"], normal=multiplier("floor"), static=mu),
        ],
        parameters=[
            MASS,
            GRAVITY,
            Parameter(F, F0, "N"),
            Parameter(omega, w, "rad/s"),
            Parameter(mu, mu0, "1", min=0),
        ],
    )

    def expected(stop: float) -> Mapping[str, float]:
        time, place, slips, rested = 0.0, 0.0, 0, 0
        while True:  # it begins to slide where the force reaches the limit, against the force's way
            angle, way = np.arcsin(limit / F0), 1
            turns = [(k * pi + angle) / w for k in range(50)]
            begin = next((s for s in turns if s > time + 1e-9), stop)
            way = 1 if turns.index(begin) % 2 == 0 else -1
            if begin >= stop:
                counts = {"slipping.grip.count": slips, "sticking.grip.count": rested}
                return {"x": place, "lambda.hold": -F0 * sin(w * stop), **counts}
            slips += 1

            def speed(s: float, begin: float = begin, way: int = way) -> float:
                push = F0 / w * (cos(w * begin) - cos(w * s))
                return (push - way * limit * (s - begin)) / M0

            def way_gone(s: float, begin: float = begin, way: int = way) -> float:
                push = F0 / w * (cos(w * begin) * (s - begin) - (sin(w * s) - sin(w * begin)) / w)
                return (push - way * limit * (s - begin) ** 2 / 2) / M0

            rests = brentq(speed, begin + 0.2 / w, begin + 2 * pi / w, xtol=1e-15)
            if rests >= stop:
                counts = {"slipping.grip.count": slips, "sticking.grip.count": rested}
                return {"x": place + way_gone(stop), "lambda.hold": -way * limit, **counts}
            rested += 1
            time, place = rests, place + way_gone(rests)

    return System(model, 2.9, expected)


def stacked() -> System:
    """A block on a plank that is pulled ever harder: the block slips from (m + M) mu g on."""
    c0, mu0, plank = 3.0, 0.3, 1.5
    model = Model(
        "Stacked",
        coordinates={x1: "m", x2: "m", z: "m"},
        lagrangian=M / 2 * x1.diff() ** 2 + m / 2 * (x2.diff() ** 2 + z.diff() ** 2) - m * g * z,
        forces={x1: c * t},
        constraints=[
            Holonomic("rest", z),
            Nonholonomic("carried", x2.diff() - x1.diff()),
            Friction("grip", of=["carried"], normal=multiplier("rest"), static=mu),
        ],
        parameters=[
            MASS,
            GRAVITY,
            Parameter(M, plank, "kg"),
            Parameter(c, c0, "N/s"),
            Parameter(mu, mu0, "1", min=0),
        ],
    )

    def expected(stop: float) -> Mapping[str, float]:
        both = plank + M0
        slips = mu0 * G * both / c0
        v, q, s = c0 * slips**2 / 2 / both, c0 * slips**3 / 6 / both, stop - slips
        upper = q + v * s + mu0 * G * s * s / 2
        push = c0 * slips - mu0 * M0 * G
        lower = q + v * s + (push * s * s / 2 + c0 * s**3 / 6) / plank
        at = {"x1": lower, "x2": upper, "slipping.grip.time": slips}
        return {**at, "lambda.carried": mu0 * M0 * G, "slipping.grip.count": 1}

    return System(model, 2.5, expected)


def between_walls() -> System:
    """A ball that goes to and fro between two walls and loses a part of its speed at each."""
    e0, width, v0 = 0.8, 1.3, 2.0
    model = Model(
        "BetweenWalls",
        coordinates={x: "m"},
        lagrangian=m / 2 * x.diff() ** 2,
        constraints=[Contact("left", x, restitution=e), Contact("right", L - x, restitution=e)],
        parameters=[MASS, Parameter(L, width, "m"), Parameter(e, e0, "1", min=0)],
        start={x: 0.4, x.diff(): v0},
    )

    def expected(stop: float) -> Mapping[str, float]:
        time, place, v, hits = 0.0, 0.4, v0, []
        left = 0
        while True:
            next_hit = time + ((width - place) if v > 0 else -place) / v
            if next_hit > stop:
                lost = M0 / 2 * (v0**2 - v**2)
                counts = {"closing.right.count": len(hits), "closing.left.count": left}
                at = {"x": place + v * (stop - time), "closing.right.time": hits[-1]}
                return {**at, "energy.dissipated": lost, **counts}
            time, place = next_hit, width if v > 0 else 0.0
            if v > 0:
                hits.append(time)
            else:
                left += 1
            v = -e0 * v

    return System(model, 3.0, expected)


def stopped_pendulum() -> System:
    """A physical pendulum that strikes a stop on its way back."""
    J, J0, a0, e0 = symbols("J", positive=True), 0.15, 0.5, 0.6
    a = symbols("a", positive=True)
    model = Model(
        "StoppedPendulum",
        coordinates={theta: "rad"},
        lagrangian=J / 2 * theta.diff() ** 2 + m * g * a * sp.cos(theta),
        constraints=[Contact("stop", theta + c, restitution=e)],
        parameters=[
            MASS,
            GRAVITY,
            Parameter(J, J0, "kg.m^2"),
            Parameter(a, a0, "m"),
            Parameter(c, 0.2, "rad"),
            Parameter(e, e0, "1", min=0),
        ],
        start={theta: 1.2},
    )

    def swing(_: float, q: Vector) -> tuple[float, float]:
        return q[1], -M0 * G * a0 / J0 * sin(q[0])

    def expected(stop: float) -> Mapping[str, float]:
        time, state, count = 0.0, np.array([1.2, 0.0]), 0
        while True:
            time, state, struck = until(swing, state, time, stop, lambda _, q: q[0] + 0.2)
            if not struck:
                at = {"theta": state[0], "der(theta)": state[1]}
                return {**at, "closing.stop.count": count}
            state, count = np.array([-0.2, -e0 * state[1]]), count + 1

    return System(model, 2.0, expected)


def driven_wheel() -> System:
    """A disk on a floor that a growing torque drives: it rolls, then spins."""
    J, T, R, R0, c0, mu0 = (
        symbols("J", positive=True),
        c,
        symbols("R", positive=True),
        0.3,
        4.0,
        0.4,
    )
    J0 = M0 * R0**2 / 2
    model = Model(
        "DrivenWheel",
        coordinates={x: "m", z: "m", theta: "rad"},
        lagrangian=m / 2 * (x.diff() ** 2 + z.diff() ** 2) + J / 2 * theta.diff() ** 2 - m * g * z,
        forces={theta: T * t},
        constraints=[
            Contact("floor", z),
            Nonholonomic("rolling", x.diff() - R * theta.diff()),
            Friction("grip", of=["rolling"], normal=multiplier("floor"), static=mu),
        ],
        parameters=[
            MASS,
            GRAVITY,
            Parameter(J, J0, "kg.m^2"),
            Parameter(R, R0, "m"),
            Parameter(T, c0, "N.m/s"),
            Parameter(mu, mu0, "1", min=0),
        ],
    )

    def expected(stop: float) -> Mapping[str, float]:
        spins = 1.5 * mu0 * M0 * G * R0 / c0
        v = c0 / (1.5 * M0 * R0) * spins**2 / 2
        q, s = v * spins / 3, stop - spins
        w = v / R0 + ((c0 * spins - mu0 * M0 * G * R0) * s + c0 * s * s / 2) / J0
        at = {"x": q + v * s + mu0 * G * s * s / 2, "der(theta)": w}
        known = {"slipping.grip.time": spins, "slipping.grip.count": 1}
        return {**at, **known, "lambda.rolling": mu0 * M0 * G}

    return System(model, 0.6, expected)


def tossed_block() -> System:
    """A block on a platform that hangs on a spring: it is thrown off, and lands again without a bounce."""
    k, k0, M1 = symbols("k", positive=True), 80.0, 1.0
    model = Model(
        "TossedBlock",
        coordinates={x: "m", y: "m"},
        lagrangian=m / 2 * y.diff() ** 2
        + M / 2 * x.diff() ** 2
        - k / 2 * x**2
        - g * (m * y + M * x),
        constraints=[Contact("platform", y - x)],
        parameters=[MASS, GRAVITY, Parameter(M, M1, "kg"), Parameter(k, k0, "N/m")],
        start={x: -0.45, y: -0.45},
    )

    def oscillation(mass: float, q: float, v: float, s: float) -> tuple[float, float]:
        w, rest = sqrt(k0 / mass), -mass * G / k0
        a = q - rest
        return rest + a * cos(w * s) + v / w * sin(w * s), v * cos(w * s) - a * w * sin(w * s)

    def expected(stop: float) -> Mapping[str, float]:
        both = M0 + M1
        leaves = brentq(lambda s: oscillation(both, -0.45, 0.0, s)[0], 0.01, pi / sqrt(k0 / both))
        q, v = oscillation(both, -0.45, 0.0, leaves)  # it leaves where the spring is without force

        def gap(s: float) -> float:
            return q + v * s - G * s * s / 2 - oscillation(M1, q, v, s)[0]

        looked = np.linspace(0.02, 1.0, 4000)
        below = next(s for s in looked if gap(s) < 0)
        lands = brentq(gap, below - (looked[1] - looked[0]), below, xtol=1e-15)
        place, speed = oscillation(M1, q, v, lands)
        speed = (M1 * speed + M0 * (v - G * lands)) / both
        end = oscillation(both, place, speed, stop - leaves - lands)
        push = M0 * (G - (k0 * end[0] + both * G) / both)
        at = {"x": end[0], "lambda.platform": push, "closing.platform.time": leaves + lands}
        return {**at, "departure.platform.count": 1, "closing.platform.count": 1}

    return System(model, 1.1, expected)


def two_carts() -> System:
    """A cart runs into another, which runs into a wall and comes back."""
    e0, width = 0.7, 0.1
    heavy = 1.0
    model = Model(
        "TwoCarts",
        coordinates={x1: "m", x2: "m"},
        lagrangian=m / 2 * x1.diff() ** 2 + M / 2 * x2.diff() ** 2,
        constraints=[
            Contact("bumper", x2 - x1 - c, restitution=e),
            Contact("wall", L - x2, restitution=e),
        ],
        parameters=[
            MASS,
            Parameter(M, heavy, "kg"),
            Parameter(c, width, "m"),
            Parameter(L, 2.0, "m"),
            Parameter(e, e0, "1", min=0),
        ],
        start={x1: 0.0, x2: 1.0, x1.diff(): 3.0},
    )

    def expected(stop: float) -> Mapping[str, float]:
        time, q1, q2, v1, v2 = 0.0, 0.0, 1.0, 3.0, 0.0
        counts = {"closing.bumper.count": 0, "closing.wall.count": 0}
        while True:
            meet = (q2 - q1 - width) / (v1 - v2) if v1 > v2 else np.inf
            wall = (2.0 - q2) / v2 if v2 > 0 else np.inf
            step = min(meet, wall, stop - time)
            q1, q2 = q1 + v1 * step, q2 + v2 * step
            if step == stop - time:
                lost = M0 / 2 * (9.0 - v1**2) - heavy / 2 * v2**2
                return {"x1": q1, "x2": q2, "energy.dissipated": lost, **counts}
            time += step
            counts[f"closing.{'bumper' if meet < wall else 'wall'}.count"] += 1
            if meet < wall:
                push = (1 + e0) * (v1 - v2) / (1 / M0 + 1 / heavy)
                v1, v2 = v1 - push / M0, v2 + push / heavy
            else:
                v2 = -e0 * v2

    return System(model, 2.2, expected)


SYSTEMS = (
    *(trampoline, slack_string, ramp, shaken_block, stacked),
    *(between_walls, stopped_pendulum, driven_wheel, tossed_block, two_carts),
)
