"""Simple pendulum (ME 6590, example): approach 2 with x and y, approach 1 with theta, and eq. (9).

x [m] to the right, y [m] up, both from the pivot; theta [rad] from the downward vertical.  With
f = x^2 + y^2 - L^2 the force of constraint is 2 lambda (x, y): lambda = -tension/(2 L) [N/m].
All three FMUs report it, also those that integrate theta alone, or eliminate the multiplier.
"""

from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Arrow,
    ClosedForm,
    Conserved,
    Disk,
    Embedding,
    Holonomic,
    Model,
    Output,
    Parameter,
    Rod,
    Scene,
    initial,
    multiplier,
    output,
)

x, y, theta = dynamicsymbols("x y theta")
m, g, L = symbols("m g L", positive=True)

T = m * (x.diff() ** 2 + y.diff() ** 2) / 2
V = m * g * y

model = Model(
    name="Pendulum",
    lagrangian=T - V,
    coordinates={x: "m", y: "m"},
    constraints=[Holonomic("rod", x**2 + y**2 - L**2, "the rod keeps its length")],
    parameters=[
        Parameter(m, 1.0, "kg", "mass of the bob", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(L, 1.0, "m", "length of the rod", min=0),
    ],
    start={x: 0.8414709848078965, y: -0.5403023058681398},  # sin(1), -cos(1)
    embedding=Embedding(
        coordinates={theta: "rad"},
        relations={x: L * sin(theta), y: -L * cos(theta)},
        start={theta: 1.0},
    ),
    description="Simple pendulum: a bob on a massless rod",
    descriptions={
        x: "bob, to the right of the pivot",
        y: "bob, above the pivot",
        theta: "angle from the downward vertical",
    },
    outputs=[
        Output("tension", -2 * L * multiplier("rod"), "N", "pull of the rod on the bob"),
        Output("bob.height", y + L, "m", "bob, above its lowest place"),
    ],
    picture=[
        Rod((0, 0), (x, y)),
        Disk((x, y)),
        Arrow("rod", at=(x, y)),
    ],
)

scenes = [
    Scene("PendulumCartesian", stop_time=10.0, step_size=0.01),
    Scene("PendulumAngle", formulation="minimal", stop_time=10.0, step_size=0.01),
    Scene("PendulumNullspace", formulation="nullspace", stop_time=10.0, step_size=0.01),
]

# Along the rod  tension = m v^2/L - m g y/L,  and the energy gives  v^2 = v0^2 + 2 g (y0 - y).
x0, y0 = initial(x), initial(y)
square = x.diff() ** 2 + y.diff() ** 2
square0 = initial(x.diff()) ** 2 + initial(y.diff()) ** 2
tension_now = m * (square - g * y) / L
tension = m * (square0 + g * (2 * y0 - 3 * y)) / L

# The same with theta, y = -L cos(theta) and v0 = L theta0':
theta0, v0 = initial(theta), L * initial(theta.diff())
tension_of_angle = m * g * (3 * cos(theta) - 2 * cos(theta0)) + m * v0**2 / L
angle = ("PendulumAngle",)

closed_forms = [
    ClosedForm("lambda.rod", -tension / (2 * L)),
    ClosedForm("lambda.rod from the state", -tension_now / (2 * L), actual=output("lambda.rod")),
    ClosedForm("tension", tension),
    ClosedForm("bob.height", L + y),
    ClosedForm("Q.x", -tension * x / L),
    ClosedForm("Q.y", -tension * y / L),
    ClosedForm("rod's length squared", L**2, actual=x**2 + y**2),
    Conserved("energy", output("energy.total"), scale=m * g * L),
    ClosedForm(
        "lambda.rod of theta",
        -tension_of_angle / (2 * L),
        actual=output("lambda.rod"),
        only=angle,
    ),
    ClosedForm("der(theta,2)", -g / L * sin(theta), only=angle),
]
