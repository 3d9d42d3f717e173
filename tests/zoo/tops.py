"""Rigid bodies about a fixed point by a unit quaternion and the angular velocity in their own frame."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Contact,
    Friction,
    Holonomic,
    Model,
    Nonholonomic,
    Parameter,
    multiplier,
    rotation_matrix,
)

E = dynamicsymbols("e0 e1 e2 e3")
W = dynamicsymbols("wx wy wz")
R = dynamicsymbols("x y z")
INERTIA = (1.0, 2.0, 3.0)  # kg m2
WEIGHT, LEVER = 9.81, 0.3  # N, m


def turning() -> dict[Any, Any]:
    """e0' = -e.w/2, e' = (e0 w + e x w)/2: the rates of a quaternion, w in the frame of the body."""
    e0, e1, e2, e3 = E
    wx, wy, wz = W
    return {
        e0: -(e1 * wx + e2 * wy + e3 * wz) / 2,
        e1: (e0 * wx + e2 * wz - e3 * wy) / 2,
        e2: (e0 * wy + e3 * wx - e1 * wz) / 2,
        e3: (e0 * wz + e1 * wy - e2 * wx) / 2,
    }


def body(name: str, inertia: tuple[float, float, float] = INERTIA, **more: Any) -> Model:
    """A rigid body of 2 kg in space: position of the centre of mass and unit quaternion; in weight where
    `held` is a point of its third axis [m] that rows hold at the origin."""
    A, B, C, m, g, arm = sp.symbols("A B C m g l", positive=True)
    held = more.pop("held", 0.0)
    kinetic = m * sum(x.diff() ** 2 for x in R) / 2
    kinetic += sum(J * w**2 / 2 for J, w in zip((A, B, C), W, strict=True))
    parameters = [Parameter(J, x, "kg.m2") for J, x in zip((A, B, C), inertia, strict=True)]
    parameters.append(Parameter(m, 2.0, "kg"))
    options: dict[str, Any] = {"lagrangian": kinetic}
    if held:
        point = sp.Matrix(R) - arm * rotation_matrix(E)[:, 2]
        options["constraints"] = [
            Holonomic(f"pin.{a}", f) for a, f in zip("xyz", point, strict=True)
        ]
        options["lagrangian"] = kinetic - m * g * R[2]
        parameters += [Parameter(g, 9.81, "m/s2"), Parameter(arm, held, "m")]
    return Model(
        name,
        coordinates={**dict.fromkeys(R, "m"), **dict.fromkeys(E, "1")},
        speeds=dict.fromkeys(W, "rad/s"),
        kinematics=turning(),
        parameters=parameters,
        **{**options, **more},
    )


def door(**more: Any) -> Model:
    """A body in weight that swings about the vertical on two hinges, each of which holds a point: one of the
    six rows follows from the others."""
    a, m, g = sp.symbols("a m g", positive=True)
    plain = body("Door", start={E[0]: 1.0, W[2]: 2.0, R[0]: 0.3, R[1].diff(): 0.6})
    rows = []
    for hinge, up in (("upper", a), ("lower", -a)):
        arm = sp.Matrix([-a, 0, up])
        gap = sp.Matrix(R) + rotation_matrix(E) * arm - sp.Matrix([0, 0, up])
        rows += [Holonomic(f"{hinge}.{x}", f) for x, f in zip("xyz", gap, strict=True)]
    return replace(
        plain,
        lagrangian=plain.lagrangian - m * g * R[2],
        constraints=rows,
        parameters=[*plain.parameters, Parameter(g, 9.81, "m/s2"), Parameter(a, 0.3, "m")],
        **more,
    )


def top(name: str = "HeavyTop", **more: Any) -> Model:
    """A heavy top: the centre of mass is on its third axis, `l` above the point about which it turns."""
    A, B, C, P, arm = sp.symbols("A B C P l", positive=True)
    e1, e2 = E[1], E[2]
    kinetic = sum(J * w**2 / 2 for J, w in zip((A, B, C), W, strict=True))
    options: dict[str, Any] = {
        "lagrangian": kinetic - P * arm * (1 - 2 * (e1**2 + e2**2)),
        "start": {E[0]: 1.0, W[0]: 0.1, W[1]: 0.2, W[2]: 5.0},
    }
    return Model(
        name,
        coordinates=dict.fromkeys(E, "1"),
        speeds=dict.fromkeys(W, "rad/s"),
        kinematics=turning(),
        parameters=[
            *(Parameter(J, x, "kg.m2") for J, x in zip((A, B, C), INERTIA, strict=True)),
            Parameter(P, WEIGHT, "N"),
            Parameter(arm, LEVER, "m"),
        ],
        **{**options, **more},
    )


def rate(_: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Newton's and Euler's equations of the heavy top, written by hand: y = (e, w)."""
    (e0, e1, e2, e3), w = y[:4], y[4:]
    e = np.array([e1, e2, e3])
    up = np.array([2 * (e1 * e3 - e0 * e2), 2 * (e2 * e3 + e0 * e1), 1 - 2 * (e1**2 + e2**2)])
    spin = np.array(INERTIA) * w
    torque = np.cross([0, 0, LEVER], -WEIGHT * up)
    return np.concatenate(
        [[-e @ w / 2], (e0 * w + np.cross(e, w)) / 2, (np.cross(spin, w) + torque) / INERTIA]
    )


def reference(stop: float) -> dict[str, float]:
    """The state of the heavy top at `stop` [s]."""
    begin = [1.0, 0.0, 0.0, 0.0, 0.1, 0.2, 5.0]
    y = solve_ivp(rate, (0, stop), begin, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    names = ("e0", "e1", "e2", "e3", "wx", "wy", "wz")
    return dict(zip(names, y.tolist(), strict=True))


def chain(n: int) -> Model:
    """n rods in space, one hung on the other by a hinge about their third axes: three conditions on the place
    and two on the direction each, with the multipliers lambda.A0.x [N], ..., lambda.A0.c [N m]."""
    m, J, a, g = sp.symbols("m J a g", positive=True)
    coordinates: dict[Any, str] = {}
    speeds: dict[Any, str] = {}
    kinematics: dict[Any, Any] = {}
    start: dict[Any, float] = {}
    rows: list[Holonomic] = []
    energy, end, before = sp.S.Zero, sp.zeros(3, 1), sp.eye(3)
    for i in range(n):
        r = sp.Matrix(dynamicsymbols(f"x{i} y{i} z{i}"))
        e = dynamicsymbols(f"e0_{i} e1_{i} e2_{i} e3_{i}")
        w = dynamicsymbols(f"wx{i} wy{i} wz{i}")
        R = rotation_matrix(e)
        coordinates |= dict.fromkeys(r, "m") | dict.fromkeys(e, "1")
        speeds |= dict.fromkeys(w, "rad/s")
        named = dict(zip((*E, *W), (*e, *w), strict=True))
        kinematics |= {named[s]: rate.xreplace(named) for s, rate in turning().items()}
        energy += m * sum(c.diff() ** 2 for c in r) / 2 - m * g * r[1]
        energy += J * (w[0] ** 2 / 5 + w[1] ** 2 + w[2] ** 2) / 2
        gap = before.T * (r - R * sp.Matrix([a, 0, 0]) - end)
        turn = [(R[:, 2].T * before[:, k])[0] for k in (0, 1)]
        rows += [
            Holonomic(f"A{i}.{name}", f) for name, f in zip("xyzbc", [*gap, *turn], strict=True)
        ]
        end, before = r + R * sp.Matrix([a, 0, 0]), R
        start |= {r[0]: 0.5 + i, e[0]: 1.0}
    return Model(
        f"Chain{n}",
        coordinates=coordinates,
        speeds=speeds,
        kinematics=kinematics,
        lagrangian=energy,
        constraints=rows,
        parameters=[
            *(Parameter(m, 1.0, "kg"), Parameter(J, 0.1, "kg.m2")),
            *(Parameter(a, 0.5, "m"), Parameter(g, 9.81, "m/s2")),
        ],
        start=start,
    )


def thrown_ball() -> Model:
    """A solid ball over a rough floor."""
    m, g, mu, r = sp.symbols("m g mu r", positive=True)
    e = sp.Symbol("e", nonnegative=True)
    x, y, z = R
    spin = rotation_matrix(E) * sp.Matrix(W)
    kinetic = m * sum(s.diff() ** 2 for s in R) / 2 + m * r**2 * sum(w**2 for w in W) / 5
    return Model(
        "Thrown",
        lagrangian=kinetic - m * g * z,
        coordinates={**dict.fromkeys(R, "m"), **dict.fromkeys(E, "1")},
        speeds=dict.fromkeys(W, "rad/s"),
        kinematics=turning(),
        constraints=[
            Contact("floor", z - r, restitution=e),
            Nonholonomic("ahead", x.diff() - r * spin[1], while_closed="floor"),
            Nonholonomic("aside", y.diff() + r * spin[0], while_closed="floor"),
            Friction("grip", of=["ahead", "aside"], normal=multiplier("floor"), static=mu),
        ],
        parameters=[
            Parameter(m, 2.0, "kg"),
            Parameter(r, 0.1, "m"),
            Parameter(g, 9.81, "m/s2"),
            Parameter(mu, 0.3, "1"),
            Parameter(e, 0.0, "1"),
        ],
        start={x.diff(): 3.0, y.diff(): 4.0, z: 0.1, E[0]: 0.8, E[1]: 0.6},
    )


def geared() -> Model:
    """A wheel about its third axis and a shaft that it drives 7 : 3 by its angle."""
    phi, psi = dynamicsymbols("phi psi")
    k = sp.Symbol("k", positive=True)
    return Model(
        "Geared",
        coordinates={**dict.fromkeys(E, "1"), phi: "rad", psi: "rad"},
        speeds=dict.fromkeys(W, "rad/s"),
        kinematics={**turning(), phi: W[2]},
        unwrapped={phi: 2 * sp.atan2(E[3], E[0])},
        kinetic_energy=k * (sum(w**2 for w in W) + psi.diff() ** 2) / 2,
        constraints=[Holonomic("gear", 7 * phi - 3 * psi)],
        parameters=[Parameter(k, 1.0, "kg.m2")],
        start={E[0]: 1.0, W[2]: 30.0, psi.diff(): 70.0},
    )
