"""Vibrating conveyor: a part on a trough that is shaken along and up at once, and slides, sticks and hops.

x, z [m] the part, u [m] the trough's way along, a prescribed motion, and its height n u : the trough
moves along a line that rises. The part rests on the trough, z - n u >= 0, and Coulomb's friction holds it
back while it touches. m (z'' + g) = lambda.trough, m x'' = lambda.grip, which is no more than mu_s of
that while it sticks and mu_k of it while it slips.
"""

from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    ClosedForm,
    Contact,
    Friction,
    Holonomic,
    Input,
    Model,
    Parameter,
    Scene,
    multiplier,
    output,
)

t = dynamicsymbols._t
x, z, u = dynamicsymbols("x z u")
m, g = symbols("m g", positive=True)
n, mu_s, mu_k = symbols("n mu_s mu_k", nonnegative=True)

model = Model(
    name="Conveyor",
    lagrangian=m * (x.diff() ** 2 + z.diff() ** 2) / 2 - m * g * z,
    coordinates={x: "m", z: "m"},
    constraints=[
        Contact("trough", z - n * u, "the part lies on the trough"),
        Holonomic("ride", x - u, "the part rides on the trough"),
        Friction("grip", of=["ride"], normal=multiplier("trough"), static=mu_s, kinetic=mu_k),
    ],
    parameters=[
        Parameter(m, 0.05, "kg", "mass of the part", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(n, 0.4, "1", "slope of the trough's motion", min=0),
        Parameter(mu_s, 0.5, "1", "coefficient of static friction", min=0),
        Parameter(mu_k, 0.4, "1", "coefficient of kinetic friction", min=0),
    ],
    inputs=[Input(u, "m", 0.0, "way of the trough", rate=0.3)],
    start={x: 0.0, z: 0.0, x.diff(): 0.3, z.diff(): 0.12},
    description="Part on a vibrating conveyor",
)

scenes = [Scene("Conveyor", stop_time=1.0, step_size=0.005)]

closed_forms = [
    ClosedForm("lambda.trough", m * (z.diff(t, 2) + g), scale=m * g),
    ClosedForm("lambda.ride", m * x.diff(t, 2), actual=output("lambda.ride"), scale=m * g),
]
