"""A puck that slides on an inclined table in both directions, x downhill; it may be thrown onto it."""

from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Contact, Friction, Nonholonomic, Parameter, multiplier
from zoo import point_mass

x, y, z = dynamicsymbols("x y z")
mu_s, mu_k, alpha, e = symbols("mu_s mu_k alpha e", nonnegative=True)

model = point_mass(
    "Puck",
    "x y z",
    [
        Contact("table", z, restitution=e),
        Nonholonomic("along", x.diff()),
        Nonholonomic("across", y.diff()),
        Friction(
            "grip", of=["along", "across"], normal=multiplier("table"), static=mu_s, kinetic=mu_k
        ),
    ],
    up=z * cos(alpha) - x * sin(alpha),
    parameters=[
        Parameter(mu_s, 0.5, "1"),
        Parameter(mu_k, 0.4, "1"),
        Parameter(alpha, 0.3, "rad", max=1.5),
        Parameter(e, 0.0, "1", min=0, max=1),
    ],
    start={x.diff(): 0.5, y.diff(): 2.0},
)
