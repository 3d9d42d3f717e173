"""Uniform bar thrown in a vertical plane, said by three points: one constraint more than there are.

Two end points carry a mass m each, the middle one M. The middle lies half way between the ends (two
constraints), the ends keep their distance l, and so do an end and the middle: which follows, so that the
lambda of `span` and of `half` is not unique while every Q is. The centre flies a parabola, and the bar
turns at the constant rate w: an end is pulled towards the middle by m w^2 l/2.
"""

from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import ClosedForm, Conserved, Holonomic, Model, Parameter, Scene, initial, output

t = dynamicsymbols._t
x1, y1, x2, y2, x3, y3 = dynamicsymbols("x1 y1 x2 y2 x3 y3")
m, M, g, l = symbols("m M g l", positive=True)  # noqa: E741 - the literature's letter


def speed(x, y):
    """Its square."""
    return x.diff() ** 2 + y.diff() ** 2


model = Model(
    name="BarOfPoints",
    lagrangian=m * (speed(x1, y1) + speed(x3, y3)) / 2
    + M * speed(x2, y2) / 2
    - g * (m * (y1 + y3) + M * y2),
    coordinates=dict.fromkeys((x1, y1, x2, y2, x3, y3), "m"),
    constraints=[
        Holonomic("middlex", x2 - (x1 + x3) / 2, "the middle is half way"),
        Holonomic("middley", y2 - (y1 + y3) / 2, "the middle is half way"),
        Holonomic("span", (x3 - x1) ** 2 + (y3 - y1) ** 2 - l**2, "from end to end"),
        Holonomic("half", (x2 - x1) ** 2 + (y2 - y1) ** 2 - l**2 / 4, "from an end to the middle"),
    ],
    parameters=[
        Parameter(m, 0.4, "kg", "mass of an end", min=0),
        Parameter(M, 1.1, "kg", "mass of the middle", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(l, 1.25, "m", "length", min=0),
    ],
    start={  # along (0.6, 0.8), turning at 4 rad/s, thrown at (2, 5) m/s
        x1: -0.375, y1: -0.5, x3: 0.375, y3: 0.5, x2: 0.0, y2: 0.0,
        x1.diff(): 4.0, y1.diff(): 3.5, x3.diff(): 0.0, y3.diff(): 6.5, x2.diff(): 2.0, y2.diff(): 5.0,
    },
    description="Bar thrown in a vertical plane, as three points and four constraints",
)  # fmt: skip

scenes = [Scene("BarOfPoints", stop_time=2.0, step_size=0.01)]

# The ends seen from the middle turn at w:  m r'' = -m w^2 r  besides gravity.
w2 = (speed(x3 - x1, y3 - y1)) / l**2
forces = m * (g + w2 * l)
closed_forms = [
    ClosedForm("Q.x1", -m * w2 * (x1 - x2), scale=forces),
    ClosedForm("Q.y1", -m * w2 * (y1 - y2), scale=forces),
    ClosedForm("Q.x2", 0, scale=forces),
    ClosedForm("x2", initial(x2) + initial(x2.diff()) * t),
    ClosedForm("y2", initial(y2) + initial(y2.diff()) * t - g * t**2 / 2, scale=g * t**2 + l),
    Conserved("energy", output("energy.total")),
    Conserved(
        "angular momentum about the middle",
        (x3 - x1) * (y3 - y1).diff(t) - (y3 - y1) * (x3 - x1).diff(t),
    ),
]
