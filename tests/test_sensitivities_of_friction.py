"""Derivatives of a run while frictions slip, against closed forms, to the accuracy of the run itself."""

from __future__ import annotations

import numpy as np
from runs import evenly
from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass

from lagfmu import (
    Contact,
    Friction,
    Holonomic,
    Nonholonomic,
    Parameter,
    Scene,
    multiplier,
    norm,
)

x, y, theta = dynamicsymbols("x y theta")
m, L, r, mu, omega0, G, alpha, u, w = symbols("m L r mu omega0 G alpha u w", positive=True)


def test_a_rod_spins_down_in_a_rubbing_pin(built):
    """A point mass on a rod, no gravity: its pin bears N = m L sqrt(omega^4 + omega'^2) and brakes by mu r N,
    so that omega' = -k omega^2 with k = s/sqrt(1 - s^2), s = mu r/L, and omega = omega0/(1 + k omega0 t)."""
    rod = point_mass(
        "Spin",
        "x y",
        [
            Holonomic("A.x", x - L * cos(theta)),
            Holonomic("A.y", y - L * sin(theta)),
            Nonholonomic("turn", theta.diff()),
            Friction(
                "pin", ["turn"], norm(multiplier("A.x"), multiplier("A.y")), 2 * mu * r, mu * r
            ),
        ],
        angles="theta",
        mass=2.0,
        parameters=[
            Parameter(L, 0.5, "m"),
            Parameter(r, 0.1, "m"),
            Parameter(mu, 0.8, "1"),
            Parameter(omega0, 3.0, "rad/s"),
        ],
        start={x: L, y: 0.0, theta: 0.0, theta.diff(): omega0},
    )
    asked = "der(theta),power.pin,margin.pin,lambda.turn:mu,m,L,omega0"
    found = evenly(built(rod, Scene("Spin", sensitivities=(asked,))), 2.0, 20, 1e-12, {})
    t, s, w0 = found["time"], 0.8 * 0.1 / 0.5, 3.0
    k, by_s = s / np.sqrt(1 - s * s), (1 - s * s) ** -1.5  # k, and dk/ds
    omega = w0 / (1 + k * w0 * t)
    normal = 2.0 * 0.5 * omega**2 * np.sqrt(1 + k * k)
    of = {  # d omega, d log N
        "mu": (-(omega**2) * t * by_s * s / 0.8, k * by_s * s / 0.8 / (1 + k * k)),
        "m": (0 * t, 1 / 2.0),
        "L": (omega**2 * t * by_s * s / 0.5, 1 / 0.5 - k * by_s * s / 0.5 / (1 + k * k)),
        "omega0": ((omega / w0) ** 2, 0),
    }
    assert found["sensitivity.valid"].all()
    for by, (change, rest) in of.items():
        share = 2 * change / omega + rest + (by == "mu") / 0.8  # of mu N
        expected = {
            "velocity.theta": change,
            "lambda.turn": -0.08 * normal * share,
            "power.pin": -0.08 * normal * omega * (share + change / omega),
            "margin.pin": 0.08 * normal * share,  # 2 mu r N - mu r N
        }
        for name, value in expected.items():
            mine = found[f"sensitivity.{name}.by.{by}"]
            np.testing.assert_allclose(
                mine, value, rtol=1e-11, atol=1e-12, err_msg=f"{name} by {by}"
            )


def test_a_puck_that_turns_downhill(built):
    """On a plane of slope tan(alpha) = mu friction takes from the speed what gravity gives downhill: |v| + x'
    stays, however the path bends (x downhill)."""
    z = dynamicsymbols("z")
    puck = point_mass(
        "Downhill",
        "x y z",
        [
            Contact("table", z),
            Nonholonomic("along", x.diff()),
            Nonholonomic("across", y.diff()),
            Friction("grip", ["along", "across"], multiplier("table"), sin(alpha) / cos(alpha)),
        ],
        energy=-m * G * (z * cos(alpha) - x * sin(alpha)),
        parameters=[
            Parameter(G, 9.81, "m/s^2"),
            Parameter(alpha, 0.3, "rad"),
            Parameter(u, 0.5, "m/s"),
            Parameter(w, 2.0, "m/s"),
        ],
        start={x.diff(): u, y.diff(): w},
    )
    asked = "der(x),der(y),power.grip:alpha,u,w"
    found = evenly(built(puck, Scene("Downhill", sensitivities=(asked,))), 1.5, 15, 1e-12, {})
    speed = np.hypot(found["der(x)"], found["der(y)"])
    assert found["sensitivity.valid"].all()
    assert found["der(y)"][-1] < 0.5
    for by, kept in {
        "alpha": 0.0,
        "u": 1 + 0.5 / np.hypot(0.5, 2),
        "w": 2 / np.hypot(0.5, 2),
    }.items():
        dx, dy = (found[f"sensitivity.velocity.{q}.by.{by}"] for q in "xy")
        faster = (found["der(x)"] * dx + found["der(y)"] * dy) / speed
        np.testing.assert_allclose(faster + dx, kept, rtol=1e-11, atol=1e-11, err_msg=by)
        pushed = -9.81 * (np.sin(0.3) * faster + (by == "alpha") * np.cos(0.3) * speed)
        np.testing.assert_allclose(found[f"sensitivity.power.grip.by.{by}"], pushed, rtol=1e-11)
