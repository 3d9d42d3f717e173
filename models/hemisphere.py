"""Particle on a smooth hemisphere (Marion & Thornton, example 7.10).

r [m] from the centre, theta [rad] from the vertical.  The surface pushes and never pulls:
lambda [N] is the normal force, positive outward, and the particle leaves where it reaches zero.
"""

from sympy import cos, pi, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Arrow,
    ClosedForm,
    Conserved,
    Contact,
    Disk,
    Ground,
    Model,
    Page,
    Parameter,
    Scene,
    Track,
    departure,
    initial,
    output,
)

t = dynamicsymbols._t
r, theta = dynamicsymbols("r theta")
m, g, a = symbols("m g a", positive=True)
turn = symbols("turn")  # along the drawn surface

T = m * (r.diff() ** 2 + r**2 * theta.diff() ** 2) / 2
V = m * g * r * cos(theta)

model = Model(
    name="Hemisphere",
    lagrangian=T - V,
    coordinates={r: "m", theta: "rad"},
    constraints=[Contact("surface", r - a, "the particle is on the sphere or above it")],
    parameters=[
        Parameter(m, 1.0, "kg", "mass of the particle", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(a, 1.0, "m", "radius of the hemisphere", min=0),
    ],
    start={r: a, theta: 0.01},
    description="Particle that slides down a smooth hemisphere and leaves it",
    descriptions={r: "distance from the centre", theta: "angle from the vertical"},
    picture=[
        Ground((-2 * a, 0), (2 * a, 0)),
        Track((a * sin(turn), a * cos(turn)), turn, -pi / 2, pi / 2),
        Disk((r * sin(theta), r * cos(theta)), trace=True),
        Arrow("surface", at=(r * sin(theta), r * cos(theta))),
    ],
    page=Page(
        sliders=[theta, theta.diff(), a, m],
        curves=["lambda.surface", theta, "energy.kinetic", "energy.potential", "energy.total"],
        ranges={theta: (0.0, 1.2), theta.diff(): (-4, 4), a: (0.2, 2)},
    ),
)

scenes = [Scene("Hemisphere", stop_time=2.0, step_size=0.01)]

# On the sphere  0 = m a theta'^2 - m g cos(theta) + lambda,  and the energy gives
# a^2 theta'^2 = v0^2 + 2 g a (cos(theta0) - cos(theta)).
theta0 = initial(theta)
v0 = a * initial(theta.diff())
normal_force = m * g * (3 * cos(theta) - 2 * cos(theta0)) - m * v0**2 / a

# Afterwards it flies: a parabola in x = r sin(theta), z = r cos(theta), from the departure's state.
rd, angle = departure("surface", r), departure("surface", theta)
rate, spin = departure("surface", r.diff()), departure("surface", theta.diff())
tau = t - departure("surface")
x = rd * sin(angle) + (rate * sin(angle) + rd * spin * cos(angle)) * tau
z = rd * cos(angle) + (rate * cos(angle) - rd * spin * sin(angle)) * tau - g * tau**2 / 2

closed_forms = [
    ClosedForm("lambda.surface", normal_force, until_departure="surface"),
    ClosedForm(
        "lambda.surface in flight",
        actual=output("lambda.surface"),
        expected=0,
        while_open="surface",
    ),
    ClosedForm("r", a, while_closed="surface"),
    ClosedForm(
        "cos(theta) at the departure",
        actual=cos(angle),
        expected=2 * cos(theta0) / 3 + v0**2 / (3 * g * a),
        at_departure="surface",
    ),
    ClosedForm("r sin(theta) in flight", x, actual=r * sin(theta), while_open="surface"),
    ClosedForm("r cos(theta) in flight", z, actual=r * cos(theta), while_open="surface", scale=a),
    Conserved("energy", output("energy.total"), scale=m * g * a),
]
