"""A body on two rough feet at -a and a along an incline, its centre h above it; it may be dropped onto it."""

from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Contact, Friction, Nonholonomic, Parameter, multiplier
from zoo import point_mass

x, y, theta = dynamicsymbols("x y theta")
a, h, J = symbols("a h J", positive=True)
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


model = point_mass(
    "TwoFeet",
    "x y",
    [*foot("low", 1), *foot("up", -1)],
    angles="theta",
    up=y * cos(alpha) - x * sin(alpha),
    energy=J * theta.diff() ** 2 / 2,
    parameters=[
        Parameter(a, 1.0, "m"),
        Parameter(h, 0.5, "m"),
        Parameter(J, 0.3, "kg.m^2"),
        Parameter(mu, 0.5, "1"),
        Parameter(alpha, 0.4, "rad", max=1.5),
        Parameter(e, 0.0, "1", min=0, max=1),
    ],
    start={y: 0.5},
)
