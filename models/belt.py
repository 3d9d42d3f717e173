"""Block on a spring and a moving belt: stick-slip (Leine & Nijmeijer, Non-Smooth Mechanical Systems, 2004).

x [m] is the spring's extension.  lambda.ride [N] is the friction of the belt on the block along its motion,
lambda.belt [N] the normal force.  The block rides on the belt until the spring breaks the friction.
"""

from sympy import atan, cos, pi, sign, sin, sqrt, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Arrow,
    ClosedForm,
    Contact,
    Disk,
    Friction,
    Line,
    Model,
    Nonholonomic,
    Output,
    Page,
    Parameter,
    Scene,
    Spring,
    initial,
    multiplier,
    output,
)

t = dynamicsymbols._t
x, z = dynamicsymbols("x z")
m, k, g, speed = symbols("m k g speed", positive=True)
mu_s, mu_k = symbols("mu_s mu_k", nonnegative=True)

BLOCK, WALL = 0.05, 0.5  # m, half of the drawn block, and how far the spring's wall is


def box(x, z):
    """The corners of the drawn block about the middle of its lower side, the first again at the end."""
    corners = ((-1, 0), (1, 0), (1, 2), (-1, 2), (-1, 0))
    return [(x + BLOCK * i, z + BLOCK * j) for i, j in corners]


model = Model(
    name="Belt",
    lagrangian=m * (x.diff() ** 2 + z.diff() ** 2) / 2 - k * x**2 / 2 - m * g * z,
    coordinates={x: "m", z: "m"},
    constraints=[
        Contact("belt", z, "the block lies on the belt"),
        Nonholonomic("ride", x.diff() - speed, "the block rides on the belt"),
        Friction("grip", of=["ride"], normal=multiplier("belt"), static=mu_s, kinetic=mu_k),
    ],
    parameters=[
        Parameter(m, 1.0, "kg", "mass of the block", min=0),
        Parameter(k, 100.0, "N/m", "stiffness of the spring", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(speed, 0.2, "m/s", "speed of the belt", min=0),
        Parameter(mu_s, 0.5, "1", "coefficient of static friction", min=0),
        Parameter(mu_k, 0.3, "1", "coefficient of kinetic friction", min=0),
    ],
    outputs=[
        Output(
            "belt.power", multiplier("ride") * speed, "W", "power that the belt gives to the block"
        )
    ],
    start={x: 0.0, x.diff(): 0.2},
    description="Block on a spring that a moving belt drags along",
    descriptions={x: "extension of the spring", z: "height above the belt"},
    picture=[
        Line((-WALL, -2 * BLOCK), (-WALL, 4 * BLOCK)),
        Line((-WALL, 0), (WALL, 0)),
        Line((-WALL, -2 * BLOCK), (WALL, -2 * BLOCK)),
        Disk((-WALL, -BLOCK), radius=BLOCK, angle=-speed * t / BLOCK),
        Disk((WALL, -BLOCK), radius=BLOCK, angle=-speed * t / BLOCK),
        Line(*box(x, z)),
        Spring((-WALL, BLOCK), (x - BLOCK, z + BLOCK)),
        Arrow("belt", at=(x, z)),
        Arrow("ride", at=(x, z)),
    ],
    page=Page(
        sliders=[speed, mu_s, mu_k, k, m],
        curves=["lambda.ride", x, "slip.ride", "sticks.grip", "margin.grip"],
        ranges={speed: (0.05, 0.5), mu_s: (0, 1), mu_k: (0, 1), k: (10, 500)},
    ),
)

scenes = [Scene("Belt", stop_time=3.0, step_size=0.01)]

# It rides from x0 to x_s = mu_s m g/k, then slips: a swing about x_s - d, d = (mu_s - mu_k) m g/k, back to
# x_s - 2 d, where it has the belt's speed again.  It rides for 2 d/v and slips for
# (2/omega)(pi - atan(d omega/v)).
x_s, d, omega = mu_s * m * g / k, (mu_s - mu_k) * m * g / k, sqrt(k / m)
first = (x_s - initial(x)) / speed
ride = 2 * d / speed
slide = 2 * (pi - atan(d * omega / speed)) / omega
slips = output("slipping.grip.count")
tau = t - output("slipping.grip.time")
riding = output("sticks.grip")
rides_first = 1 - sign(initial(x.diff()) - speed) ** 2  # it starts on the belt

closed_forms = [
    ClosedForm(
        "start of the latest slip",
        first + (slips - 1) * (ride + slide),
        actual=output("slipping.grip.time"),
        when=rides_first * slips,
        until_departure="belt",
    ),
    ClosedForm(
        "x while it slips",
        x_s - d + d * cos(omega * tau) + speed / omega * sin(omega * tau),
        actual=x,
        scale=x_s,
        when=slips * (1 - riding),
        until_departure="belt",
    ),
    ClosedForm(
        "x while it rides",
        x_s - speed * (slide + ride - tau),
        actual=x,
        scale=x_s,
        when=slips * riding,
        until_departure="belt",
    ),
    ClosedForm("friction while it rides", k * x, actual=output("lambda.ride"), when=riding),
    ClosedForm(
        "friction while it slips",
        mu_k * m * g * sign(speed - x.diff()),
        actual=output("lambda.ride"),
        when=slips * (1 - riding),
        until_departure="belt",
    ),
    ClosedForm("lambda.belt", m * g, until_departure="belt"),
]
