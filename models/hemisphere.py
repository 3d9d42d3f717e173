"""Particle on a smooth hemisphere (Marion & Thornton, example 7.10).

r [m] from the centre, theta [rad] from the vertical; the surface pushes, it never pulls.
"""

from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Contact, Model, Parameter

r, theta = dynamicsymbols("r theta")
m, g, a = symbols("m g a", positive=True)

T = m * (r.diff() ** 2 + r**2 * theta.diff() ** 2) / 2
V = m * g * r * cos(theta)

model = Model(
    name="Hemisphere",
    lagrangian=T - V,
    coordinates={r: "m", theta: "rad"},
    constraints=[Contact("surface", r - a)],
    parameters=[Parameter(m, 1.0, "kg"), Parameter(g, 9.81, "m/s^2"), Parameter(a, 1.0, "m")],
    start={r: 1.0, theta: 0.01},
)
