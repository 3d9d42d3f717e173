"""Ten systems without events.  The equations by hand are in the coordinates that the constraints leave."""

from __future__ import annotations

from collections.abc import Mapping
from math import asin, cos, sin

import sympy as sp
from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols
from system import G, System, integrate

from lagfmu import Holonomic, Model, Nonholonomic, Parameter

t = dynamicsymbols._t
x, y, z, r, s = dynamicsymbols("x y z r s")
theta, phi, psi = dynamicsymbols("theta phi psi")
m, g, R, L, omega = symbols("m g R L omega", positive=True)
MASS, GRAVITY = Parameter(m, 0.4, "kg"), Parameter(g, G, "m/s^2")


def hoop() -> System:
    """A bead on a hoop that is turned about its vertical diameter."""
    m0, R0, w = 0.4, 0.5, 6.0
    model = Model(
        "TurnedHoop",
        coordinates={r: "m", theta: "rad", phi: "rad"},
        lagrangian=m / 2 * (r.diff() ** 2 + (r * theta.diff()) ** 2)
        + m / 2 * (r * sp.sin(theta) * phi.diff()) ** 2
        + m * g * r * sp.cos(theta),
        constraints=[Holonomic("hoop", r - R), Holonomic("drive", phi - omega * t)],
        parameters=[MASS, GRAVITY, Parameter(R, R0, "m"), Parameter(omega, w, "rad/s")],
        start={r: R, theta: 0.5, theta.diff(): 1.0, phi.diff(): omega},
    )

    def expected(stop: float) -> Mapping[str, float]:
        a, v = integrate(
            lambda _, q: (q[1], sin(q[0]) * (w**2 * cos(q[0]) - G / R0)), (0.5, 1.0), stop
        )
        push = -m0 * (R0 * v**2 + R0 * (sin(a) * w) ** 2 + G * cos(a))
        torque = 2 * m0 * R0**2 * sin(a) * cos(a) * v * w
        return {"theta": a, "der(theta)": v, "lambda.hoop": push, "lambda.drive": torque}

    return System(model, 2.0, expected)


def spherical_pendulum() -> System:
    """A bob on a rod that swings all round, in x, y and z."""
    m0, L0 = 0.4, 1.3
    model = Model(
        "SphericalPendulum",
        coordinates={x: "m", y: "m", z: "m"},
        lagrangian=m / 2 * (x.diff() ** 2 + y.diff() ** 2 + z.diff() ** 2) - m * g * z,
        constraints=[Holonomic("rod", x**2 + y**2 + z**2 - L**2)],
        parameters=[MASS, GRAVITY, Parameter(L, L0, "m")],
        start={x: L * sin(1.0), y: 0.0, z: -L * cos(1.0), y.diff(): 2.0},
    )

    def rate(_: float, q: object) -> tuple[float, ...]:
        a, _b, va, vb = q  # type: ignore[misc]
        return va, vb, sin(a) * cos(a) * vb**2 - G / L0 * sin(a), -2 * va * vb * cos(a) / sin(a)

    def expected(stop: float) -> Mapping[str, float]:
        a, b, va, vb = integrate(rate, (1.0, 0.0, 0.0, 2.0 / (L0 * sin(1.0))), stop)
        pull = m0 * (L0 * (va**2 + (sin(a) * vb) ** 2) + G * cos(a))
        at = {"x": L0 * sin(a) * cos(b), "y": L0 * sin(a) * sin(b), "z": -L0 * cos(a)}
        return {**at, "lambda.rod": -pull / (2 * L0)}

    return System(model, 2.0, expected)


def hung_pulley() -> System:
    """A mass on one side of a pulley, and on the other a second pulley, without mass, with two masses."""
    m1, m2, m3 = symbols("m1 m2 m3", positive=True)
    x1, x2, x3, p = dynamicsymbols("x1 x2 x3 p")
    a, b = symbols("a b", positive=True)
    masses = {x1: (m1, 3.0), x2: (m2, 1.0), x3: (m3, 2.5)}
    model = Model(
        "HungPulley",
        coordinates={x1: "m", x2: "m", x3: "m", p: "m"},
        lagrangian=sum(k * (q.diff() ** 2 / 2 + g * q) for q, (k, _) in masses.items()),
        constraints=[Holonomic("upper", x1 + p - a), Holonomic("lower", x2 + x3 - 2 * p - b)],
        parameters=[GRAVITY, Parameter(a, 3.0, "m"), Parameter(b, 2.0, "m")]
        + [Parameter(k, value, "kg") for k, value in masses.values()],
        start={x1: 1.0, p: 2.0, x2: 3.0, x3: 3.0},
    )

    def expected(stop: float) -> Mapping[str, float]:
        lower = -4 * G / (1 / 1.0 + 1 / 2.5 + 4 / 3.0)
        return {
            "lambda.lower": lower,
            "lambda.upper": 2 * lower,
            "x1": 1.0 + (G + 2 * lower / 3.0) * stop**2 / 2,
            "x2": 3.0 + (G + lower) * stop**2 / 2,
        }

    return System(model, 1.0, expected)


def crank_with_rod() -> System:
    """A slider-crank whose rod has mass, under gravity across the slider's line."""
    J, mr, ms, a, b = symbols("J mr ms a b", positive=True)
    values = {J: 0.02, mr: 0.6, ms: 0.9, a: 0.2, b: 0.7, g: G}
    cx, cy = a * sp.cos(phi) + b / 2 * sp.cos(psi), a * sp.sin(phi) + b / 2 * sp.sin(psi)

    def kinetic(cx: object, cy: object, slider: object, first: object, second: object) -> object:
        d = [sp.sympify(e).diff(t) for e in (cx, cy, slider, first, second)]
        return (
            mr * (d[0] ** 2 + d[1] ** 2) / 2
            + ms * d[2] ** 2 / 2
            + J * d[3] ** 2 / 2
            + mr * b**2 / 12 * d[4] ** 2 / 2
        )

    model = Model(
        "CrankWithRod",
        coordinates={phi: "rad", psi: "rad", x: "m"},
        lagrangian=kinetic(cx, cy, x, phi, psi) - mr * g * cy,
        constraints=[
            Holonomic("along", a * sp.cos(phi) + b * sp.cos(psi) - x),
            Holonomic("across", a * sp.sin(phi) + b * sp.sin(psi)),
        ],
        parameters=[
            *(Parameter(k, values[k], "kg") for k in (mr, ms)),
            *(Parameter(k, values[k], "m") for k in (a, b)),
            Parameter(J, values[J], "kg.m^2"),
            GRAVITY,
        ],
        start={phi: 0.6, psi: -asin(0.2 * sin(0.6) / 0.7), phi.diff(): 9.0},
    )
    f, w = symbols("f w", real=True)  # the crank's angle and its rate: T = I(f) w^2/2
    free = phi
    turn = -sp.asin(a * sp.sin(free) / b)
    slider = a * sp.cos(free) + b * sp.cos(turn)
    middle = (a * sp.cos(free) + b / 2 * sp.cos(turn), a * sp.sin(free) / 2)
    put = {free.diff(): w, free: f}
    energy = kinetic(*middle, slider, free, turn).xreplace({free.diff(): w}).xreplace(put)  # type: ignore[attr-defined]
    inertia = sp.simplify(2 * energy / w**2).subs(values)
    force = -(values[mr] * G * middle[1].xreplace({free: f}).subs(values)).diff(f)
    place = slider.xreplace({free: f}).subs(values)
    accelerated = sp.lambdify((f, w), (force - inertia.diff(f) * w**2 / 2) / inertia)
    first, second = sp.lambdify(f, place.diff(f)), sp.lambdify(f, place.diff(f, 2))
    at = sp.lambdify(f, place)

    def expected(stop: float) -> Mapping[str, float]:
        p, v = integrate(lambda _, q: (q[1], accelerated(*q)), (0.6, 9.0), stop)
        push = -values[ms] * (first(p) * accelerated(p, v) + second(p) * v**2)
        return {"phi": p, "x": at(p), "lambda.along": push}

    return System(model, 1.0, expected)


def parabola() -> System:
    """A bead on a wire z = k x^2."""
    k, m0, k0 = symbols("k", positive=True), 0.4, 1.5
    model = Model(
        "WireParabola",
        coordinates={x: "m", z: "m"},
        lagrangian=m / 2 * (x.diff() ** 2 + z.diff() ** 2) - m * g * z,
        constraints=[Holonomic("wire", z - k * x**2)],
        parameters=[MASS, GRAVITY, Parameter(k, k0, "1/m")],
        start={x: 0.7, z: k0 * 0.49, x.diff(): 0.5},
    )

    def pull(q: float, v: float) -> float:
        return -(4 * k0**2 * q * v**2 + 2 * G * k0 * q) / (1 + (2 * k0 * q) ** 2)

    def expected(stop: float) -> Mapping[str, float]:
        q, v = integrate(lambda _, y: (y[1], pull(*y)), (0.7, 0.5), stop)
        return {"x": q, "z": k0 * q**2, "lambda.wire": m0 * (G + 2 * k0 * (v**2 + q * pull(q, v)))}

    return System(model, 3.0, expected)


def sleigh() -> System:
    """Chaplygin's sleigh, its centre of mass ahead of the blade."""
    a, J, a0, J0, m0 = symbols("a", positive=True), symbols("J", positive=True), 0.3, 0.05, 0.4
    model = Model(
        "Sleigh",
        coordinates={x: "m", y: "m", phi: "rad"},
        lagrangian=m / 2 * (x.diff() - a * sp.sin(phi) * phi.diff()) ** 2
        + m / 2 * (y.diff() + a * sp.cos(phi) * phi.diff()) ** 2
        + J / 2 * phi.diff() ** 2,
        constraints=[Nonholonomic("blade", y.diff() * sp.cos(phi) - x.diff() * sp.sin(phi))],
        parameters=[MASS, Parameter(a, a0, "m"), Parameter(J, J0, "kg.m^2")],
        start={x.diff(): 0.8, phi.diff(): 3.0},
    )

    def rate(_: float, q: object) -> tuple[float, ...]:
        _x, _y, p, u, w = q  # type: ignore[misc]
        return u * cos(p), u * sin(p), w, a0 * w**2, -m0 * a0 * u * w / (J0 + m0 * a0**2)

    def expected(stop: float) -> Mapping[str, float]:
        q = integrate(rate, (0.0, 0.0, 0.0, 0.8, 3.0), stop)
        blade = m0 * (q[3] * q[4] + a0 * rate(0, q)[4])
        return {"x": q[0], "y": q[1], "phi": q[2], "lambda.blade": blade}

    return System(model, 2.0, expected)


def coin_on_slope() -> System:
    """An upright disk that rolls on a slope and turns at a constant rate: theta' in closed form."""
    J, K, c = symbols("J K c", positive=True)
    J0, m0, R0, c0, w = 0.03, 0.4, 0.25, 0.6, 1.7
    model = Model(
        "CoinOnSlope",
        coordinates={x: "m", y: "m", theta: "rad", phi: "rad"},
        lagrangian=m / 2 * (x.diff() ** 2 + y.diff() ** 2)
        + J / 2 * theta.diff() ** 2
        + K / 2 * phi.diff() ** 2
        + m * g * c * x,
        constraints=[
            Nonholonomic("ahead", x.diff() - R * theta.diff() * sp.cos(phi)),
            Nonholonomic("beside", y.diff() - R * theta.diff() * sp.sin(phi)),
        ],
        parameters=[
            MASS,
            GRAVITY,
            Parameter(R, R0, "m"),
            Parameter(J, J0, "kg.m^2"),
            Parameter(K, 0.02, "kg.m^2"),
            Parameter(c, c0, "1"),
        ],
        start={theta.diff(): 2.0, phi.diff(): w},
    )

    def expected(stop: float) -> Mapping[str, float]:
        drive = m0 * G * c0 * R0 / (J0 + m0 * R0**2)
        turn, speed = drive * cos(w * stop), 2.0 + drive * sin(w * stop) / w
        c1, s1 = cos(w * stop), sin(w * stop)
        ahead = m0 * R0 * (turn * c1 - speed * w * s1) - m0 * G * c0
        beside = m0 * R0 * (turn * s1 + speed * w * c1)
        return {"der(theta)": speed, "lambda.ahead": ahead, "lambda.beside": beside}

    return System(model, 2.0, expected)


def trapeze() -> System:
    """A bar on two parallel strings of one length: it swings without turning, both pull alike."""
    d, J = symbols("d J", positive=True)
    m0, l0 = 0.4, 1.1

    def string(side: int) -> object:
        px = x + side * d * sp.cos(phi) - side * d
        return px**2 + (y + side * d * sp.sin(phi)) ** 2 - L**2

    model = Model(
        "Trapeze",
        coordinates={x: "m", y: "m", phi: "rad"},
        lagrangian=m / 2 * (x.diff() ** 2 + y.diff() ** 2) + J / 2 * phi.diff() ** 2 - m * g * y,
        constraints=[Holonomic("left", string(-1)), Holonomic("right", string(1))],
        parameters=[
            MASS,
            GRAVITY,
            Parameter(L, l0, "m"),
            Parameter(d, 0.4, "m"),
            Parameter(J, 0.02, "kg.m^2"),
        ],
        start={x: L * sin(0.9), y: -L * cos(0.9), phi: 0.0},
    )

    def expected(stop: float) -> Mapping[str, float]:
        a, v = integrate(lambda _, q: (q[1], -G / l0 * sin(q[0])), (0.9, 0.0), stop)
        pull = -m0 * (G * cos(a) + l0 * v**2) / (4 * l0)
        return {"x": l0 * sin(a), "phi": 0.0, "lambda.left": pull, "lambda.right": pull}

    return System(model, 2.0, expected)


def gears() -> System:
    """Two wheels that mesh, one driven by a torque that grows."""
    J1, J2, R1, R2, c = symbols("J1 J2 R1 R2 c", positive=True)
    values = {
        J1: (0.02, "kg.m^2"),
        J2: (0.3, "kg.m^2"),
        R1: (0.1, "m"),
        R2: (0.4, "m"),
        c: (2.0, "W/rad"),
    }
    model = Model(
        "Gears",
        coordinates={phi: "rad", psi: "rad"},
        lagrangian=J1 / 2 * phi.diff() ** 2 + J2 / 2 * psi.diff() ** 2,
        forces={phi: c * t},
        constraints=[Holonomic("mesh", R1 * phi - R2 * psi)],
        parameters=[Parameter(k, value, unit) for k, (value, unit) in values.items()],
    )

    def expected(stop: float) -> Mapping[str, float]:
        mesh = -2.0 * stop * (0.1 / 0.02) / (0.1**2 / 0.02 + 0.4**2 / 0.3)
        turned = 0.4 * -mesh / stop / 0.3 * stop**3 / 6
        return {"psi": turned, "lambda.mesh": mesh}

    return System(model, 2.0, expected)


def shaken_pivot() -> System:
    """A pendulum whose pivot goes to and fro."""
    A, A0, w, L0, m0 = symbols("A", positive=True), 0.2, 5.0, 0.8, 0.4
    model = Model(
        "ShakenPivot",
        coordinates={x: "m", y: "m"},
        lagrangian=m / 2 * (x.diff() ** 2 + y.diff() ** 2) - m * g * y,
        constraints=[Holonomic("rod", (x - A * sp.sin(omega * t)) ** 2 + y**2 - L**2)],
        parameters=[
            MASS,
            GRAVITY,
            Parameter(L, L0, "m"),
            Parameter(A, A0, "m"),
            Parameter(omega, w, "rad/s"),
        ],
        start={x: L * sin(0.3), y: -L * cos(0.3), x.diff(): A * omega},
    )

    def rate(time: float, q: object) -> tuple[float, float]:
        a, v = q  # type: ignore[misc]
        return v, (-G * sin(a) + A0 * w**2 * sin(w * time) * cos(a)) / L0

    def expected(stop: float) -> Mapping[str, float]:
        a, v = integrate(rate, (0.3, 0.0), stop)
        pull = m0 * (L0 * v**2 + A0 * w**2 * sin(w * stop) * sin(a) + G * cos(a))
        return {"x": A0 * sin(w * stop) + L0 * sin(a), "lambda.rod": -pull / (2 * L0)}

    return System(model, 2.0, expected)


SYSTEMS = (
    *(hoop, spherical_pendulum, hung_pulley, crank_with_rod, parabola),
    *(sleigh, coin_on_slope, trapeze, gears, shaken_pivot),
)
