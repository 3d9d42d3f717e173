"""A block that rubs on a belt, and the belt's drive: one model, or two that exchange motion and force.

A spring k holds the block m; the belt, of inertia M, hangs on a spring K that is drawn at the speed v:

    m x'' = -k x + lambda.ride ,   M s'' = -K (s - v t) + F ,   F = -lambda.ride .

Apart, the block's belt is moved as the input u says (u = s, with u' and u''), and the multiplier of u - s = 0
is the friction F on what moves it.
"""

from __future__ import annotations

from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Friction, Holonomic, Input, Model, Nonholonomic, Parameter

TIME = dynamicsymbols._t
x, s, u, F = dynamicsymbols("x s u F")
m, k, g, mu_s, mu_k, M, K, v = symbols("m k g mu_s mu_k M K v", positive=True)
SPEED = 0.1  # m/s
STOP = 0.7  # s: the block slips at 0.198 s, and sticks again at 0.590 s

BLOCK = m * x.diff() ** 2 / 2 - k * x**2 / 2
DRIVE = M * s.diff() ** 2 / 2 - K * (s - v * TIME) ** 2 / 2
OF_BLOCK = [
    Parameter(m, 1.0, "kg", "mass of the block"),
    Parameter(k, 100.0, "N/m", "stiffness of its spring"),
    Parameter(g, 9.81, "m/s^2", "acceleration of gravity"),
    Parameter(mu_s, 0.5, "1", "coefficient of static friction"),
    Parameter(mu_k, 0.2, "1", "coefficient of kinetic friction"),
]
OF_DRIVE = [
    Parameter(M, 4.0, "kg", "inertia of the belt and what drives it"),
    Parameter(K, 1600.0, "N/m", "stiffness of the belt's spring"),
    Parameter(v, SPEED, "m/s", "speed at which that spring is drawn"),
]

RIDE = [
    Nonholonomic("ride", x.diff() - s.diff(), "the block rides on the belt"),
    Friction("grip", of=["ride"], normal=m * g, static=mu_s, kinetic=mu_k),
]
RIDING = {x: 0.03, x.diff(): SPEED, s: -0.001875, s.diff(): SPEED}  # without a swing: K s = -k x

whole = Model(
    name="BlockAndDrive",
    lagrangian=BLOCK + DRIVE,
    coordinates={x: "m", s: "m"},
    constraints=RIDE,
    parameters=[*OF_BLOCK, *OF_DRIVE],
    start=RIDING,
)
block = Model(
    name="RubbingBlock",
    lagrangian=BLOCK,
    coordinates={x: "m", s: "m"},
    constraints=[Holonomic("belt", u - s, "the belt is where it is moved to"), *RIDE],
    parameters=OF_BLOCK,
    inputs=[Input(u, "m", RIDING[s], rate=SPEED, description="place of the belt")],
    start=RIDING,
)
drive = Model(
    name="BeltDrive",
    lagrangian=DRIVE,
    coordinates={s: "m"},
    parameters=OF_DRIVE,
    inputs=[Input(F, "N", description="friction on the belt")],
    forces={s: F},
    start={q: RIDING[q] for q in (s, s.diff())},
)
