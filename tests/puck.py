"""A puck that slides on an inclined table in both directions, x downhill; it may be thrown onto it."""

from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Contact, Friction, Model, Nonholonomic, Parameter, multiplier

x, y, z = dynamicsymbols("x y z")
m, g = symbols("m g", positive=True)
mu_s, mu_k, alpha, e = symbols("mu_s mu_k alpha e", nonnegative=True)

model = Model(
    name="Puck",
    lagrangian=m * (x.diff() ** 2 + y.diff() ** 2 + z.diff() ** 2) / 2
    - m * g * (z * cos(alpha) - x * sin(alpha)),
    coordinates={x: "m", y: "m", z: "m"},
    constraints=[
        Contact("table", z, restitution=e),
        Nonholonomic("along", x.diff()),
        Nonholonomic("across", y.diff()),
        Friction(
            "grip", of=["along", "across"], normal=multiplier("table"), static=mu_s, kinetic=mu_k
        ),
    ],
    parameters=[
        Parameter(m, 1.0, "kg"),
        Parameter(g, 9.81, "m/s^2"),
        Parameter(mu_s, 0.5, "1"),
        Parameter(mu_k, 0.4, "1"),
        Parameter(alpha, 0.3, "rad", max=1.5),
        Parameter(e, 0.0, "1", min=0, max=1),
    ],
    start={x.diff(): 0.5, y.diff(): 2.0},
)
