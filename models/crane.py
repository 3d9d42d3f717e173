"""Overhead crane: a trolley on a rail, and a load on a rope that a winch hoists by a prescribed motion.

s [m] is the trolley along the rail, x [m] the load, both to the right from a fixed point; y [m] is the
load's height above the rail, negative while it hangs.  The input l [m] is the length of the rope, which
the winch changes (connect der(l) and der(l,2) too), F [N] the drive of the trolley.  With
f = (x - s)^2 + y^2 - l^2 the rope's force on the load is 2 lambda (x - s, y): lambda = -tension/(2 l) [N/m],
and the winch takes up the rope with the power -tension l'.
"""

from sympy import sqrt, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Arrow,
    ClosedForm,
    Disk,
    Holonomic,
    Input,
    Line,
    Model,
    Output,
    Parameter,
    Rod,
    Scene,
    multiplier,
    output,
)

t = dynamicsymbols._t
s, x, y, F, l = dynamicsymbols("s x y F l")  # noqa: E741 - the literature's letter
M, m, g = symbols("M m g", positive=True)
c = symbols("c", nonnegative=True)

tension = -2 * l * multiplier("rope")

model = Model(
    name="Crane",
    lagrangian=M * s.diff() ** 2 / 2 + m * (x.diff() ** 2 + y.diff() ** 2) / 2 - m * g * y,
    forces={s: F - c * s.diff()},
    coordinates={s: "m", x: "m", y: "m"},
    constraints=[
        Holonomic("rope", (x - s) ** 2 + y**2 - l**2, "the rope as long as it is let out")
    ],
    parameters=[
        Parameter(M, 800.0, "kg", "mass of the trolley", min=0),
        Parameter(m, 2000.0, "kg", "mass of the load", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(c, 150.0, "N.s/m", "viscous friction of the trolley", min=0),
    ],
    inputs=[
        Input(F, "N", 0.0, "drive of the trolley, to the right"),
        Input(l, "m", 7.8125, "length of the rope", rate=-0.1953125),
    ],
    start={
        s: 0.0,
        x: 2.1875,  # (x, y) = l (7, -24)/25, exact in binary
        y: -7.5,
        x.diff(): -0.0546875,  # along the rope: l' (x, y)/l
        y.diff(): 0.1875,
    },
    description="Overhead crane that hoists its load",
    descriptions={
        s: "trolley, to the right",
        x: "load, to the right",
        y: "load, above the rail",
    },
    outputs=[
        Output("rope.tension", tension, "N", "pull of the rope on the load"),
        Output("winch.power", -tension * l.diff(), "W", "power of the winch"),
        Output("load.sway", x - s, "m", "load, to the right of the trolley"),
        Output("trolley.power", F * s.diff(), "W", "power of the trolley's drive"),
    ],
    picture=[
        Line((-10, 0), (20, 0)),
        Rod((s - 1, 0), (s + 1, 0)),
        Line((s, 0), (x, y)),
        Disk((x, y), trace=True),
        Arrow("rope", at=(x, y)),
    ],
)

scenes = [Scene("Crane", stop_time=20.0, step_size=0.02)]

# With d = x - s:  M s'' = F - c s' - 2 d lambda ,  m x'' = 2 d lambda ,  m y'' = -m g + 2 y lambda ,  and
# f'' = 0 reads  d (x'' - s'') + y y'' + d'^2 + y'^2 = l l'' + l'^2.  Solved for lambda:
d = x - s
square = d.diff() ** 2 + y.diff() ** 2 - l.diff() ** 2 - l * l.diff(t, 2)
drive = F - c * s.diff()
pull = m * (M * g * y + drive * d - M * square) / (2 * (M * l**2 + m * d**2))  # lambda.rope

# What the drives supply is the growth of the energy, and the loss in the trolley's friction.
growth = M * s.diff() * s.diff(t, 2) + m * (x.diff() * x.diff(t, 2) + y.diff() * y.diff(t, 2))
growth += m * g * y.diff() + c * s.diff() ** 2
throughput = m * g * sqrt(g * l)

closed_forms = [
    ClosedForm("lambda.rope", pull),
    ClosedForm("rope.tension", -2 * l * pull),
    ClosedForm("rope's length squared", l**2, actual=d**2 + y**2),
    ClosedForm(
        "power of both drives",
        growth,
        actual=output("winch.power") + output("trolley.power"),
        scale=throughput,
    ),
    ClosedForm("winch.power", 2 * l * pull * l.diff()),
]
