"""Ball dropped on a block that lies on a floor: the floor takes part in every impact.

The block stays; the ball leaves it at e times the speed with which it comes, so that after a fall from H it
rises to e^2 H.  The floor takes the impulse of the ball, (1 + e) m sqrt(2 g H) at first, and carries the
block's weight, and in the end the ball's too.
"""

from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import ClosedForm, Contact, Model, Parameter, Scene

b, z = dynamicsymbols("b z")
M, m, g, h, e = symbols("M m g h e", positive=True)

model = Model(
    name="BallOnBlock",
    lagrangian=(M * b.diff() ** 2 + m * z.diff() ** 2) / 2 - M * g * b - m * g * z,
    coordinates={b: "m", z: "m"},
    constraints=[
        Contact("floor", b, "the block lies on the floor"),
        Contact("top", z - b - h, "the ball is on the block", restitution=e),
    ],
    parameters=[
        Parameter(M, 3.0, "kg", "mass of the block", min=0),
        Parameter(m, 0.4, "kg", "mass of the ball", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(h, 0.2, "m", "height of the block", min=0),
        Parameter(e, 0.6, "1", "coefficient of restitution", min=0, max=1),
    ],
    start={b: 0.0, z: 1.2},
    description="Ball dropped on a block that lies on the floor",
)

scenes = [Scene("BallOnBlock", stop_time=2.5, step_size=0.01)]

closed_forms = [ClosedForm("b", 0, scale=h)]
