"""Block on two edges that rocks on a smooth floor, shaken by a prescribed motion (after Housner, 1963).

z [m] is the block's centre, theta [rad] its lean, u [m] the floor. The feet at half width b and half
height h below the centre push and do not pull. On a smooth floor nothing moves the centre sideways. The
sum of both pushes carries and accelerates the block: lambda_left + lambda_right = m (z'' + g).
"""

from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import ClosedForm, Contact, Input, Model, Parameter, Scene, output

t = dynamicsymbols._t
z, theta, u = dynamicsymbols("z theta u")
m, J, g, b, h = symbols("m J g b h", positive=True)
e = symbols("e", nonnegative=True)

feet = {
    "left": z - h * cos(theta) - b * sin(theta) - u,
    "right": z - h * cos(theta) + b * sin(theta) - u,
}
LEAN = (0.96, 0.28)  # cos, sin

model = Model(
    name="RockingBlock",
    lagrangian=m * z.diff() ** 2 / 2 + J * theta.diff() ** 2 / 2 - m * g * z,
    coordinates={z: "m", theta: "rad"},
    constraints=[
        Contact(name, f, f"the {name} foot stands on the floor", restitution=e)
        for name, f in feet.items()
    ],
    parameters=[
        Parameter(m, 40.0, "kg", "mass", min=0),
        Parameter(J, 6.0, "kg.m^2", "moment of inertia about the centre", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(b, 0.3, "m", "half of the width", min=0),
        Parameter(h, 0.5, "m", "half of the height", min=0),
        Parameter(e, 0.25, "1", "coefficient of restitution", min=0, max=1),
    ],
    inputs=[Input(u, "m", 0.0, "height of the floor")],
    start={z: 0.5 * LEAN[0] + 0.3 * LEAN[1], theta: 0.2837941092083279},  # on the left foot
    description="Block that rocks on two feet on a shaken, smooth floor",
)

scenes = [Scene("RockingBlock", stop_time=1.5, step_size=0.005)]

push = output("lambda.left") + output("lambda.right")
closed_forms = [
    ClosedForm("weight", m * (z.diff(t, 2) + g), actual=push, scale=m * g + push),
    ClosedForm(
        "torque",
        J * theta.diff(t, 2),
        actual=h * sin(theta) * push
        + b * cos(theta) * (output("lambda.right") - output("lambda.left")),
        scale=(b + h) * (m * g + push),
    ),
]
