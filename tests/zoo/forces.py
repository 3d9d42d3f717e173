"""Forces that jump in position, time or inputs, and one that ends."""

from __future__ import annotations

from typing import Any

from sympy import Abs, Heaviside, Piecewise, floor, sign, sqrt, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Contact, Holonomic, Input, Model, Parameter

from . import g, m, point_mass

G = 9.81
x, y, u = dynamicsymbols("x y u")
F, k, L, T = symbols("F k L T", positive=True)
t = dynamicsymbols._t
v = x.diff()


def cart(name: str, force: Any, lagrangian: Any = 0, **start: float) -> Model:
    """A cart of 1 kg on a straight track, F = 2 N, k = 10 N/m, L = 1 m, T = 1 s, and an input u [N]."""
    return point_mass(
        name,
        "x",
        energy=lagrangian,
        parameters=[
            *(Parameter(F, 2.0, "N"), Parameter(k, 10.0, "N/m")),
            *(Parameter(L, 1.0, "m"), Parameter(T, 1.0, "s")),
        ],
        forces={x: force},
        inputs=[Input(u, "N")],
        start={x: start.get("x", 0.0), v: start.get("v", 0.0)},
    )


def lifted() -> Model:
    """A block on a floor that a force of three times its weight begins to pull up at t = T/2."""
    return point_mass(
        "Lifted",
        "y",
        [Contact("floor", y)],
        up=y,
        gravity=G,
        parameters=[Parameter(T, 1.0, "s")],
        forces={y: 3 * m * g * Heaviside(t - T / 2)},
        start={y: 0.0},
    )


def chased() -> Model:
    """A free body, and a gate u that gives it 2 N sideways while it is ahead of the gate by L."""
    return point_mass(
        "Chased",
        "x y",
        parameters=[Parameter(F, 2.0, "N"), Parameter(L, 1.0, "m")],
        forces={y: F * Heaviside(x - u - L)},
        inputs=[Input(u, "m")],
        start={x: 0.0},
    )


def hung() -> Model:
    """Two blocks on a floor, the second pulled up with 2 m g as soon as the first is off the ground."""
    return point_mass(
        "Hung",
        "x y",
        [Contact("first", x), Contact("second", y)],
        up=x + y,
        gravity=G,
        forces={x: u, y: 2 * m * g * Heaviside(x)},
        inputs=[Input(u, "N")],
        start={x: 0.0, y: 0.0},
    )


JUMPS = {
    "Chased": chased,
    "Hung": hung,
    "Valley": lambda: cart("Valley", u, -F * Abs(x), x=1.0),
    "Pulse": lambda: cart("Pulse", Piecewise((F, (t > T / 4) & (t < T / 2)), (0, True)) + 0 * u),
    "Stairs": lambda: cart("Stairs", F * floor(2 * t / T)),
    "Switched": lambda: cart("Switched", F * sign(u)),
    "Gate": lambda: cart("Gate", F * Heaviside(x - L) * Heaviside(L + L / 1000 - x), v=100.0),
    "Lifted": lifted,
}


def candle() -> Model:
    """A bead on a line, driven by a force that ends with a root: nothing is defined after t = T."""
    t = dynamicsymbols._t
    x, y = dynamicsymbols("x y")
    P, T = symbols("P T", positive=True)
    return point_mass(
        "Candle",
        "x y",
        [Holonomic("line", y - x)],
        parameters=[Parameter(P, 3.0, "N"), Parameter(T, 1.0, "s")],
        forces={x: P * sqrt(1 - t / T)},
        start={x: 1.0, y: 1.0},
    )
