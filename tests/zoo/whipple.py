"""Whipple's bicycle as a Model: four rigid bodies, two wheels that roll on knife edges, no rider's control.

x points forward, y to the right, z down; the rear wheel's centre is at (x, y, z).  The rear frame turns by
yaw, lean, pitch; the front frame by steer about an axis that is tilted back; the wheels spin in their frames.
The benchmark: J. P. Meijaard, J. M. Papadopoulos, A. Ruina, A. L. Schwab, Linearized dynamics equations for
the balance and steer of a bicycle: a benchmark and review, Proc. R. Soc. A 463 (2007), 1955-1982,
doi:10.1098/rspa.2007.1857.  Table 1 has the parameters, Table 2 the eigenvalues.
"""

from __future__ import annotations

import math
from typing import Any

from sympy import Expr, Matrix, cos, eye, sin, sqrt, symbols, zeros
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Holonomic, Model, Nonholonomic, Parameter

VALUES = {
    "m": {"wheelbase": 1.02, "trail": 0.08, "rR": 0.3, "rF": 0.35},
    "m ": {"xB": 0.3, "zB": -0.9, "xH": 0.9, "zH": -0.7},
    "kg": {"mR": 2.0, "mB": 85.0, "mH": 4.0, "mF": 3.0},
    "kg.m^2": {"Rxx": 0.0603, "Ryy": 0.12, "Fxx": 0.1405, "Fyy": 0.28},
    "kg.m^2 ": {"Bxx": 9.2, "Bxz": 2.4, "Byy": 11.0, "Bzz": 2.8},
    " kg.m^2": {"Hxx": 0.05892, "Hxz": -0.00756, "Hyy": 0.06, "Hzz": 0.00708},
    "rad": {"tilt": math.pi / 10},
    "m/s^2": {"g": 9.81},
}
GIVEN = {name: (value, unit.strip()) for unit, of in VALUES.items() for name, value in of.items()}
t = dynamicsymbols._t
E1, E2, E3 = (eye(3)[:, k] for k in range(3))


def pair(real: float, imag: float) -> tuple[complex, complex]:
    return complex(real, imag), complex(real, -imag)


# eigenvalues [1/s] of upright motion at v [m/s]: castering, capsize, weave (at rest four real ones)
PUBLISHED = {
    0.0: [-5.53094371765393, -3.13164324790656, 3.13164324790656, 5.53094371765393],
    2.0: [-8.67387984831735, -3.07158645641514, *pair(2.68234517512745, 1.68066296590675)],
    5.0: [-14.07838969279822, -0.32286642900409, *pair(-0.77534188219585, 4.46486771378823)],
    8.0: [-20.27940894394569, 0.14327879765713, *pair(-2.69348683581097, 8.46037971396931)],
}


def speeds(v: float) -> dict[str, float]:
    """Start values of upright motion at v [m/s]."""
    return {"der(x)": v, "der(rear)": -v / 0.3, "der(front)": -v / 0.35}


def turn(axis: int, angle: Expr) -> Any:
    c, s = cos(angle), sin(angle)
    i, j = [k for k in range(3) if k != axis]
    R = eye(3)
    R[i, i] = R[j, j] = c
    R[i, j], R[j, i] = (s, -s) if axis == 1 else (-s, s)
    return R


def touching(velocity: Any, omega: Any, axle: Any, radius: Expr) -> tuple[Any, Expr]:
    """Of a wheel's lowest point: its velocity, and how far it is below the centre."""
    level = sqrt(1 - axle[2] ** 2)
    return velocity + omega.cross(radius * (E3 - axle[2] * axle) / level), radius * level


def bicycle() -> Model:
    """Upright, at 5 m/s."""
    x, y, z = dynamicsymbols("x y z")
    angles = yaw, lean, pitch, steer, rear, front = dynamicsymbols(
        "yaw lean pitch steer rear front"
    )
    p = {n: symbols(n, real=True) for n in GIVEN}

    def inertia(n: str) -> Any:
        J = Matrix.diag(p[f"{n}xx"], p[f"{n}yy"], p.get(f"{n}zz", p[f"{n}xx"]))
        J[0, 2] = J[2, 0] = p.get(f"{n}xz", 0)
        return J

    R = turn(2, yaw) * turn(0, lean) * turn(1, pitch)
    relative = turn(1, p["tilt"]) * turn(2, steer) * turn(1, p["tilt"]).T
    w_B = turn(1, pitch).T * (turn(0, lean).T * E3 * yaw.diff() + E1 * lean.diff())
    w_B += E2 * pitch.diff()
    w_H = relative.T * w_B + Matrix([sin(p["tilt"]), 0, cos(p["tilt"])]) * steer.diff()
    w_R, w_F = w_B + E2 * rear.diff(), w_H + E2 * front.diff()
    centre = Matrix([x, y, z])
    v = centre.diff(t)
    head = Matrix([p["wheelbase"] + p["trail"], 0, p["rR"]])
    r_B = Matrix([p["xB"], 0, p["zB"] + p["rR"]])
    r_H = Matrix([p["xH"], 0, p["zH"]]) - Matrix([p["wheelbase"] + p["trail"], 0, 0])
    r_F = Matrix([-p["trail"], 0, -p["rF"]])

    def ahead(r: Any) -> tuple[Any, Any]:
        """A point of the front frame, and its velocity from the rear centre's, in the rear frame."""
        return head + relative * r, w_B.cross(head) + relative * w_H.cross(r)

    lagrangian = 0
    for n, (place, u), w in (
        ("R", (zeros(3, 1), zeros(3, 1)), w_R),
        ("B", (r_B, w_B.cross(r_B)), w_B),
        ("H", ahead(r_H), w_H),
        ("F", ahead(r_F), w_F),
    ):
        mass = p[f"m{n}"]
        lagrangian += mass * (v.dot(v) / 2 + v.dot(R * u) + u.dot(u) / 2)
        lagrangian += w.dot(inertia(n) * w) / 2 + mass * p["g"] * (z + (R * place)[2])
    at_F, u_F = ahead(r_F)
    slip_R, low_R = touching(v, R * w_R, R * E2, p["rR"])
    slip_F, low_F = touching(v + R * u_F, R * relative * w_F, R * relative * E2, p["rF"])
    return Model(
        "Bicycle",
        lagrangian=lagrangian,
        coordinates={x: "m", y: "m", z: "m", **dict.fromkeys(angles, "rad")},
        constraints=[
            Holonomic("rear.height", z + low_R),
            Holonomic("front.height", z + (R * at_F)[2] + low_F),
            *(Nonholonomic(f"rear.{a}", slip_R[k]) for k, a in enumerate("xy")),
            *(Nonholonomic(f"front.{a}", slip_F[k]) for k, a in enumerate("xy")),
        ],
        parameters=[Parameter(p[n], value, unit) for n, (value, unit) in GIVEN.items()],
        start={x.diff(): 5.0, z: -0.3, rear.diff(): -5 / 0.3, front.diff(): -5 / 0.35},
    )
