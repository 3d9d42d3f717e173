"""Mass on a spring that rubs on the floor: Coulomb damping (Rao, Mechanical Vibrations, sect. 2.7).

x [m] is the spring's extension, z [m] the height above the floor.  lambda.floor [N] is the normal force,
lambda.rest [N] the friction on the mass along x.  The mass is led along the floor, which can push and pull.
"""

from sympy import Abs, Max, Min, ceiling, cos, floor, pi, sign, sqrt, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Arrow,
    ClosedForm,
    Conserved,
    Friction,
    Ground,
    Holonomic,
    Line,
    Model,
    Nonholonomic,
    Output,
    Parameter,
    Scene,
    Spring,
    initial,
    multiplier,
    output,
)

t = dynamicsymbols._t
x, z = dynamicsymbols("x z")
m, k, g = symbols("m k g", positive=True)
mu_s, mu_k = symbols("mu_s mu_k", nonnegative=True)

BLOCK, WALL = 0.05, 0.5  # m, half of the drawn block, and how far the spring's wall is


def box(x, z):
    """The corners of the drawn block about the middle of its lower side, the first again at the end."""
    corners = ((-1, 0), (1, 0), (1, 2), (-1, 2), (-1, 0))
    return [(x + BLOCK * i, z + BLOCK * j) for i, j in corners]


model = Model(
    name="FrictionOscillator",
    lagrangian=m * (x.diff() ** 2 + z.diff() ** 2) / 2 - k * x**2 / 2 - m * g * z,
    coordinates={x: "m", z: "m"},
    constraints=[
        Holonomic("floor", z, "the mass is led along the floor"),
        Nonholonomic("rest", x.diff(), "the mass rests on the floor"),
        Friction("grip", of=["rest"], normal=multiplier("floor"), static=mu_s, kinetic=mu_k),
    ],
    parameters=[
        Parameter(m, 1.0, "kg", "mass", min=0),
        Parameter(k, 100.0, "N/m", "stiffness of the spring", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(mu_s, 0.3, "1", "coefficient of static friction", min=0),
        Parameter(mu_k, 0.2, "1", "coefficient of kinetic friction", min=0),
    ],
    outputs=[Output("spring.force", -k * x, "N", "force of the spring on the mass")],
    start={x: 0.2},
    description="Mass on a spring with Coulomb friction",
    descriptions={x: "extension of the spring", z: "height above the floor"},
    picture=[
        Ground((-WALL, 0), (WALL, 0)),
        Ground((-WALL, 4 * BLOCK), (-WALL, 0)),
        Line(*box(x, z)),
        Spring((-WALL, BLOCK), (x - BLOCK, z + BLOCK)),
        Arrow("floor", at=(x, z)),
        Arrow("rest", at=(x, z)),
    ],
)

scenes = [Scene("FrictionOscillator", stop_time=3.0, step_size=0.01)]

# Released from rest at x0: each half swing is one of a free oscillation about d = mu_k m g/k, on the side
# from which it comes, so that the amplitude loses 4 d a period; after `last` half swings it stays, within
# mu_s m g/k.
d, edge, omega = mu_k * m * g / k, mu_s * m * g / k, sqrt(k / m)
begin = Abs(initial(x))
last = Max(0, ceiling((begin - edge) / (2 * d)))
swing = Min(floor(omega * t / pi), last)
side = sign(initial(x)) * (1 - 2 * (swing - 2 * floor(swing / 2)))
released = 1 - sign(Abs(initial(x.diff())))
swinging = released * sign(last - swing)
at_rest = released * (1 - sign(last - swing))

closed_forms = [
    ClosedForm(
        "x while it swings",
        side * (d + (begin - (2 * swing + 1) * d) * cos(omega * t - swing * pi)),
        actual=x,
        scale=begin,
        when=swinging,
    ),
    ClosedForm(
        "friction while it swings", side * mu_k * m * g, actual=output("lambda.rest"), when=swinging
    ),
    ClosedForm("x at rest", side * (begin - 2 * swing * d), actual=x, scale=begin, when=at_rest),
    ClosedForm(
        "friction at rest", k * x, actual=output("lambda.rest"), when=at_rest, scale=k * begin
    ),
    ClosedForm("it rests", 1, actual=output("sticks.grip"), when=at_rest),
    ClosedForm("spring.force", -k * x, scale=k * begin),
    Conserved("energy and heat", output("energy.total") + output("energy.dissipated")),
]
