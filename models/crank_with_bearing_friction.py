"""Slider-crank whose joints all rub, running down: pins A, B and C of radius r, and the guide D.

Crank, rod and slider have their own coordinates: x_i, y_i [m] of the centre of mass from the crank's axis,
phi_i [rad].  The multipliers of A are the force [N] on the crank, those of B and C the force on the crank and
on the rod (the other body receives the opposite), D.y is the force of the guide on the slider, D.phi its
moment [N.m].  A pin rubs by |tau| = mu r sqrt(Fx^2 + Fy^2) [N.m] against its relative angular velocity, the
guide by mu |D.y| [N] against its slip velocity: all of one instant, as the friction of each joint loads the
others.
"""

from sympy import Abs, Heaviside, asin, cos, pi, sign, sin, sqrt, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Arrow,
    ClosedForm,
    Conserved,
    Disk,
    Friction,
    Ground,
    Holonomic,
    Line,
    Model,
    Nonholonomic,
    Page,
    Parameter,
    Rod,
    Scene,
    multiplier,
    norm,
    output,
)

x1, y1, phi1, x2, y2, phi2, x3, y3, phi3 = dynamicsymbols("x1 y1 phi1 x2 y2 phi2 x3 y3 phi3")
m1, m2, m3, J1, J2, J3 = symbols("m1 m2 m3 J1 J2 J3", positive=True)
g, a, b, r, mu = symbols("g a b r mu", positive=True)

BODIES = ((m1, J1, x1, y1, phi1), (m2, J2, x2, y2, phi2), (m3, J3, x3, y3, phi3))
kinetic = sum(
    m * (x.diff() ** 2 + y.diff() ** 2) / 2 + J * p.diff() ** 2 / 2 for m, J, x, y, p in BODIES
)
height = sum(m * y for m, _, _, y, _ in BODIES)

crank_end = x1 + a / 2 * cos(phi1), y1 + a / 2 * sin(phi1)
rod_begin = x2 - b / 2 * cos(phi2), y2 - b / 2 * sin(phi2)
rod_end = x2 + b / 2 * cos(phi2), y2 + b / 2 * sin(phi2)
turning = {"A": phi1.diff(), "B": phi2.diff() - phi1.diff(), "C": phi3.diff() - phi2.diff()}

BLOCK = 0.03  # m, half of the drawn slider


def block(at):
    """The corners of the slider at a place, the first again at the end."""
    corners = ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))
    return [(at + BLOCK * i, BLOCK * j) for i, j in corners]


def force(pin):
    """[N] in a pin."""
    return norm(multiplier(f"{pin}.x"), multiplier(f"{pin}.y"))


begin = pi / 2  # of the crank
slant = -asin(a / b * sin(begin))  # of the rod

model = Model(
    name="CrankWithBearingFriction",
    lagrangian=kinetic - g * height,
    coordinates={
        s: "rad" if s in (phi1, phi2, phi3) else "m" for _, _, x, y, p in BODIES for s in (x, y, p)
    },
    constraints=[
        Holonomic("A.x", x1 - a / 2 * cos(phi1), "the crank on its axis"),
        Holonomic("A.y", y1 - a / 2 * sin(phi1), "the crank on its axis"),
        Holonomic("B.x", crank_end[0] - rod_begin[0], "the rod on the crank"),
        Holonomic("B.y", crank_end[1] - rod_begin[1], "the rod on the crank"),
        Holonomic("C.x", rod_end[0] - x3, "the rod on the slider"),
        Holonomic("C.y", rod_end[1] - y3, "the rod on the slider"),
        Holonomic("D.y", y3, "the slider in its guide"),
        Holonomic("D.phi", phi3, "the slider in its guide"),
        *(Nonholonomic(f"{pin}.turn", omega) for pin, omega in turning.items()),
        Nonholonomic("D.slide", x3.diff()),
        *(Friction(pin, [f"{pin}.turn"], force(pin), mu * r) for pin in turning),
        Friction("D", ["D.slide"], multiplier("D.y"), mu),
    ],
    parameters=[
        Parameter(m1, 2.0, "kg", "mass of the crank", min=0),
        Parameter(m2, 1.0, "kg", "mass of the rod", min=0),
        Parameter(m3, 0.5, "kg", "mass of the slider", min=0),
        Parameter(J1, 0.01, "kg.m^2", "moment of inertia of the crank about its centre", min=0),
        Parameter(J2, 0.02, "kg.m^2", "moment of inertia of the rod about its centre", min=0),
        Parameter(J3, 0.001, "kg.m^2", "moment of inertia of the slider", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(a, 0.1, "m", "length of the crank", min=0),
        Parameter(b, 0.3, "m", "length of the rod", min=0),
        Parameter(r, 0.01, "m", "radius of the pins", min=0),
        Parameter(mu, 0.1, "1", "coefficient of friction of pins and guide", min=0),
    ],
    start={
        phi1: begin,
        x1: a / 2 * cos(begin),
        y1: a / 2 * sin(begin),
        phi2: slant,
        x2: a * cos(begin) + b / 2 * cos(slant),
        y2: a * sin(begin) + b / 2 * sin(slant),
        x3: a * cos(begin) + b * cos(slant),
        y3: 0,
        phi3: 0,
        phi1.diff(): 20.0,
    },
    description="Slider-crank whose joints all rub",
    descriptions={
        phi1: "angle of the crank from the guide's line",
        phi2: "angle of the rod from the guide's line",
        x3: "slider, from the crank's axis",
    },
    picture=[
        Ground((0, -BLOCK), (a + b + 2 * BLOCK, -BLOCK)),
        Disk((0, 0), radius=a, angle=phi1),
        Rod((0, 0), crank_end),
        Rod(crank_end, (x3, y3)),
        Line(*block(x3)),
        *(
            Arrow(pin, at, force=(multiplier(f"{pin}.x"), multiplier(f"{pin}.y")))
            for pin, at in (("A", (0, 0)), ("B", crank_end))
        ),
        Arrow("D.y", (x3, y3)),
    ],
    page=Page(curves=["lambda.A.turn", "lambda.D.slide", "der(phi1)", "energy.dissipated"]),
)

scenes = [Scene("CrankWithBearingFriction", stop_time=1.0, step_size=0.005)]


def length(pin):
    """The same force from the outputs."""
    return sqrt(output(f"lambda.{pin}.x") ** 2 + output(f"lambda.{pin}.y") ** 2)


def faster(slip):
    """1 where rounding does not decide on the sign of a slip [rad/s, m/s], else 0."""
    return Heaviside(Abs(slip) - 1e-9, 0)


closed_forms = [
    *(
        ClosedForm(
            f"torque of pin {pin}",
            -mu * r * length(pin) * sign(output(f"slip.{pin}.turn")),
            actual=output(f"lambda.{pin}.turn"),
            when=(1 - output(f"sticks.{pin}")) * faster(output(f"slip.{pin}.turn")),
        )
        for pin in turning
    ),
    ClosedForm(
        "friction of the guide",
        -mu * Abs(output("lambda.D.y")) * sign(output("slip.D.slide")),
        actual=output("lambda.D.slide"),
        when=(1 - output("sticks.D")) * faster(output("slip.D.slide")),
    ),
    # Newton's law of the slider: the pin C pushes it with (-C.x, -C.y), its guide with (slide, D.y).
    ClosedForm(
        "slider along its guide",
        m3 * x3.diff().diff(),
        actual=output("lambda.D.slide") - output("lambda.C.x"),
    ),
    ClosedForm(
        "slider across its guide", m3 * g, actual=output("lambda.D.y") - output("lambda.C.y")
    ),
    Conserved("energy and heat", output("energy.total") + output("energy.dissipated"), within=100),
]
