"""Slider-crank that drags a load by a stiff, damped spring: a stiff system, solved by radau.

phi [rad] is the crank's angle, x and y [m] the slider and the load along its line, from the crank's
axis; gravity does not act.  With f = (x - r cos phi)^2 + (r sin phi)^2 - l^2 the rod, which has no mass,
pushes the slider with 2 lambda (x - r cos phi): lambda = thrust/(2 l) [N/m].  The input tau [N.m] drives
the crank.  Once the slider has set out, the spring's own motion dies within m c^-1 = 0.1 ms, against
0.6 s for a turn of the crank: that is what no explicit method can step over.
"""

from sympy import Piecewise, cos, sin, sqrt, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Arrow,
    ClosedForm,
    Disk,
    Ground,
    Holonomic,
    Input,
    Line,
    Model,
    Output,
    Page,
    Parameter,
    Rod,
    Scene,
    Spring,
    multiplier,
    output,
)

phi, x, y, tau = dynamicsymbols("phi x y tau")
J, m, M, r, l, s, k, c = symbols("J m M r l s k c", positive=True)  # noqa: E741 - the literature's

stretch, slip = y - x - s, y.diff() - x.diff()
pull = k * stretch + c * slip  # of the spring and its damper, on the slider

BLOCK = 0.03  # m, half of the drawn slider


def block(at):
    """The corners of a slider at a place, the first again at the end."""
    corners = ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))
    return [(at + BLOCK * i, BLOCK * j) for i, j in corners]


model = Model(
    name="SliderCrank",
    lagrangian=J * phi.diff() ** 2 / 2
    + m * x.diff() ** 2 / 2
    + M * y.diff() ** 2 / 2
    - k * stretch**2 / 2,
    forces={phi: tau, x: c * slip, y: -c * slip},
    coordinates={phi: "rad", x: "m", y: "m"},
    constraints=[
        Holonomic(
            "rod",
            (x - r * cos(phi)) ** 2 + (r * sin(phi)) ** 2 - l**2,
            "the rod keeps its length",
        )
    ],
    parameters=[
        Parameter(J, 0.1, "kg.m^2", "moment of inertia of the crank and its flywheel", min=0),
        Parameter(m, 1.0, "kg", "mass of the slider", min=0),
        Parameter(M, 1.0, "kg", "mass of the load", min=0),
        Parameter(r, 0.1, "m", "length of the crank", min=0),
        Parameter(l, 0.3, "m", "length of the rod", min=0),
        Parameter(s, 0.2, "m", "length of the spring without force", min=0),
        Parameter(k, 1e6, "N/m", "stiffness of the spring", min=0),
        Parameter(c, 1e4, "N.s/m", "viscous damping beside the spring", min=0),
    ],
    inputs=[Input(tau, "N.m", 0.0, "torque on the crank")],
    start={phi: 0.0, x: r + l, y: r + l + s, phi.diff(): 10.0},
    description="Slider-crank that drags a load by a stiff, damped spring",
    descriptions={
        phi: "angle of the crank from the slider's line",
        x: "slider, from the crank's axis",
        y: "load, from the crank's axis",
    },
    outputs=[
        Output("rod.thrust", 2 * l * multiplier("rod"), "N", "push of the rod on the slider"),
        Output("crank.power", tau * phi.diff(), "W", "power of the torque on the crank"),
        Output("spring.pull", pull, "N", "pull of the spring and its damper on the slider"),
    ],
    picture=[
        Ground((0, -BLOCK), (2 * (r + l), -BLOCK)),
        Disk((0, 0), radius=r, angle=phi),
        Rod((0, 0), (r * cos(phi), r * sin(phi))),
        Rod((r * cos(phi), r * sin(phi)), (x, 0)),
        Spring((x + BLOCK, 0), (y - BLOCK, 0)),
        Line(*block(x)),
        Line(*block(y)),
        Arrow("rod", at=(x, 0), along=(2 * (x - r * cos(phi)), -2 * r * sin(phi))),
    ],
    page=Page(
        sliders=[phi.diff(), tau, r, k, c],
        curves=["rod.thrust", "spring.pull", x, y, "crank.power"],
        ranges={phi.diff(): (-30, 30), tau: (-5, 5), r: (0.05, 0.25), k: (1e3, 2e6)},
    ),
)

scenes = [Scene("SliderCrank", method="radau", stop_time=1.0, step_size=0.01)]

# Geometry: the slider's place and speed are those of the crank's angle, on either side of the crank's
# pin: it changes sides only where the rod stands across, at |sin(phi)| = l/r.
rod = Piecewise((1, x > r * cos(phi)), (-1, True)) * sqrt(l**2 - r**2 * sin(phi) ** 2)
place = r * cos(phi) + rod
speed = -r * sin(phi) * (1 + r * cos(phi) / rod) * phi.diff()

# J phi'' = tau + lambda f_phi  and  m x'' = pull + lambda f_x  in  f_phi phi'' + f_x x'' + bend = 0,
# the second derivative of  f = x^2 - 2 r x cos(phi) + r^2 - l^2:
f_phi, f_x = 2 * r * x * sin(phi), 2 * (x - r * cos(phi))
bend = 2 * x.diff() ** 2 + 2 * r * phi.diff() * (
    2 * x.diff() * sin(phi) + x * phi.diff() * cos(phi)
)
push = -(bend + f_phi * tau / J + f_x * pull / m) / (f_phi**2 / J + f_x**2 / m)

# The rod does no work: what the energy changes by is the torque's work less the damper's.
power = J * phi.diff() * phi.diff().diff() + m * x.diff() * x.diff().diff()
power += M * y.diff() * y.diff().diff() + k * stretch * slip
work = tau * phi.diff() - c * slip**2
turnover = output("energy.kinetic") * phi.diff()

closed_forms = [
    ClosedForm("x", place),
    ClosedForm("der(x)", speed),
    ClosedForm("lambda.rod", push),
    ClosedForm("rod.thrust", 2 * l * push),
    ClosedForm("Q.phi", f_phi * push),
    ClosedForm("power", work, actual=power, scale=turnover),
]
