"""Half a car on a road of points: two wheels that push on the road and never pull, and may leave it.

z [m] is the body's centre and theta [rad] its pitch (nose up), zf and zr [m] the wheels, all from where
the car stands on the flat; the input s [m] drives it along the road (connect der(s) and der(s,2) too; left
alone it rolls at a constant speed).  lambda.front and lambda.rear [N] are the wheels' loads: over the far
side of the bump the wheels lose touch, fly, and land.  (Gillespie, Fundamentals of Vehicle Dynamics, ch. 5.)
"""

from sympy import Rational, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Arrow,
    ClosedForm,
    Contact,
    Disk,
    Input,
    Model,
    Output,
    Parameter,
    Rod,
    Scene,
    Spline,
    Spring,
    Track,
    multiplier,
    output,
)

t = dynamicsymbols._t
z, theta, zf, zr, s = dynamicsymbols("z theta zf zr s")
w = symbols("w", real=True)  # m, along the drawn road
M, J, m, g, a, b, k = symbols("M J m g a b k", positive=True)
c = symbols("c", nonnegative=True)

WAY = [0, 1, 2, 3, 4, 5, 6, 7, 7.5, 8, 8.5, 9, 10, 11, 12, 13, 14, 15, 20, 30]
HEIGHT = [0, 0, 0, 0, 0, 0, 0, 0, 0.04, 0.09, 0.04, 0, 0, 0, 0, 0, 0, 0, 0, 0]
SPEED = 14.0  # [m/s]
road = Spline("road", WAY, HEIGHT, "m", "m")

# the springs' compression beyond that of the car at rest
df, dr = zf - z - a * theta, zr - z + b * theta
load_f, load_r = M * g * b / (a + b), M * g * a / (a + b)  # of the springs at rest
push_f = load_f + k * df + c * df.diff(t)
push_r = load_r + k * dr + c * dr.diff(t)

T = (M * z.diff() ** 2 + J * theta.diff() ** 2 + m * (zf.diff() ** 2 + zr.diff() ** 2)) / 2
V = M * g * z + m * g * (zf + zr) + load_f * df + load_r * dr + k * (df**2 + dr**2) / 2

WHEEL, HIGH = 0.3, 0.9  # m, radius of the drawn wheels, and height of the drawn body

model = Model(
    name="HalfCar",
    lagrangian=T - V,
    forces={
        z: c * (df.diff(t) + dr.diff(t)),
        theta: c * (a * df.diff(t) - b * dr.diff(t)),
        zf: -c * df.diff(t),
        zr: -c * dr.diff(t),
    },
    coordinates={z: "m", theta: "rad", zf: "m", zr: "m"},
    constraints=[
        Contact("front", zf - road(s + a), "front wheel on the road"),
        Contact("rear", zr - road(s - b), "rear wheel on the road"),
    ],
    parameters=[
        Parameter(M, 1200.0, "kg", "mass of the body", min=0),
        Parameter(J, 1500.0, "kg.m^2", "moment of inertia of the body", min=0),
        Parameter(m, 80.0, "kg", "mass of an axle with its wheels", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(a, 1.2, "m", "front axle, ahead of the body's centre", min=0),
        Parameter(b, 1.5, "m", "rear axle, behind the body's centre", min=0),
        Parameter(k, 4e4, "N/m", "stiffness of the springs of an axle", min=0),
        Parameter(c, 3e3, "N.s/m", "damping of an axle", min=0),
    ],
    inputs=[Input(s, "m", 2.0, "way of the body's centre along the road", rate=SPEED)],
    start={  # both wheels on the road, which is flat to a millimetre here
        z: 0.0,
        theta: 0.0,
        zf: float(road(3.2)),
        zr: float(road(0.5)),
        zf.diff(): SPEED * float(road.derivative(1)(3.2)),
        zr.diff(): SPEED * float(road.derivative(1)(0.5)),
    },
    description="Half a car on a bumpy road, whose wheels may leave it",
    descriptions={
        z: "centre of the body, above its place at rest",
        theta: "pitch of the body, nose up",
        zf: "front wheel, above its place at rest",
        zr: "rear wheel, above its place at rest",
    },
    outputs=[
        Output("way", s, "m", "of the body's centre along the road, as it is driven"),
        Output("body.acceleration", z.diff(t, 2), "m/s^2", "what the passenger feels"),
        Output("front.travel", df, "m", "compression of the front spring"),
        Output("rear.travel", dr, "m", "compression of the rear spring"),
        Output(
            "front.share",
            multiplier("front") / (multiplier("front") + multiplier("rear")),
            "1",
            "part of the load that the front wheel carries",
            otherwise=Rational(1, 2),
        ),
        Output(
            "road.drag",
            multiplier("front") * road(s + a).diff(s) + multiplier("rear") * road(s - b).diff(s),
            "N",
            "force that the slope of the road sets against the drive",
        ),
    ],
    picture=[
        Rod((a, z + a * theta + HIGH), (-b, z - b * theta + HIGH)),
        Spring((a, zf + WHEEL), (a, z + a * theta + HIGH), coils=5),
        Spring((-b, zr + WHEEL), (-b, z - b * theta + HIGH), coils=5),
        Disk((a, zf + WHEEL), radius=WHEEL),
        Disk((-b, zr + WHEEL), radius=WHEEL),
        Track((w, road(output("way") + w)), w, -3, 3),
        Arrow("front", at=(a, zf)),
        Arrow("rear", at=(-b, zr)),
    ],
)

scenes = [Scene("HalfCar", stop_time=1.5, step_size=0.005)]

# A wheel on the road moves as the road does under it:
closed_forms = []
for wheel, place, push in ((zf, s + a, push_f), (zr, s - b, push_r)):
    name = "front" if wheel == zf else "rear"
    height = road(place)
    spring = {"while_closed": name, "scale": M * g}
    closed_forms += [
        ClosedForm(f"{wheel.func} on the road", height, actual=wheel, while_closed=name, scale=a),
        ClosedForm(f"lambda.{name}", m * g + push + m * height.diff(t, 2), **spring),
        ClosedForm(
            f"der({wheel.func},2) in flight",
            -g - push / m,
            actual=wheel.diff(t, 2),
            while_open=name,
            scale=g + k * a / m,
        ),
    ]

# The road does work on the wheels, the dampers take it: at each instant, whichever wheels touch.
growth = M * z.diff() * z.diff(t, 2) + J * theta.diff() * theta.diff(t, 2) + V.diff(t)
growth += m * (zf.diff() * zf.diff(t, 2) + zr.diff() * zr.diff(t, 2))
loss = c * (df.diff(t) ** 2 + dr.diff(t) ** 2)
closed_forms += [
    ClosedForm(
        "power",
        growth + loss,
        actual=output("road.drag") * s.diff(),
        scale=M * g * s.diff() + c * s.diff() ** 2,
    ),
    ClosedForm(
        "weight and loads",
        M * z.diff(t, 2) + m * (zf.diff(t, 2) + zr.diff(t, 2)) + (M + 2 * m) * g,
        actual=output("lambda.front") + output("lambda.rear"),
        # the springs' pushes cancel to rounding of their own ends
        scale=M * g + c * s.diff() + k * (abs(z) + abs(zf) + abs(zr) + (a + b) * abs(theta)),
    ),
]
