"""A body on two rough feet at -a and a along an incline, its centre h above it; it may be dropped onto it."""

from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Contact, Friction, Model, Nonholonomic, Parameter, multiplier

x, y, theta = dynamicsymbols("x y theta")
m, g, a, h, J = symbols("m g a h J", positive=True)
mu, alpha, e = symbols("mu alpha e", nonnegative=True)


def foot(name, side):
    """Its contact, the velocity of its point, the friction."""
    at = side * a
    height = y + at * sin(theta) - h * cos(theta)
    along = x.diff() + (h * cos(theta) - at * sin(theta)) * theta.diff()
    return [
        Contact(name, height, restitution=e),
        Nonholonomic(f"{name}_rests", along),
        Friction(f"grip_{name}", of=[f"{name}_rests"], normal=multiplier(name), static=mu),
    ]


model = Model(
    name="TwoFeet",
    lagrangian=m * (x.diff() ** 2 + y.diff() ** 2) / 2
    + J * theta.diff() ** 2 / 2
    - m * g * (y * cos(alpha) - x * sin(alpha)),
    coordinates={x: "m", y: "m", theta: "rad"},
    constraints=[*foot("low", 1), *foot("up", -1)],
    parameters=[
        Parameter(m, 1.0, "kg"),
        Parameter(g, 9.81, "m/s^2"),
        Parameter(a, 1.0, "m"),
        Parameter(h, 0.5, "m"),
        Parameter(J, 0.3, "kg.m^2"),
        Parameter(mu, 0.5, "1"),
        Parameter(alpha, 0.4, "rad", max=1.5),
        Parameter(e, 0.0, "1", min=0, max=1),
    ],
    start={y: 0.5},
)
