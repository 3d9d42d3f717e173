"""Disk that rolls down an incline without slipping (Marion & Thornton, example 7.9).

y [m] down the incline and theta [rad], the disk's rotation, are tied by y = R theta.  lambda [N] is
the friction force on the disk, positive down the incline, so that it comes out negative.
The second FMU has theta alone (y eliminated) and reports the same lambda.
"""

from math import pi

from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Arrow,
    ClosedForm,
    Conserved,
    Disk,
    Ground,
    Holonomic,
    Model,
    Parameter,
    Scene,
    initial,
    output,
)

t = dynamicsymbols._t
y, theta = dynamicsymbols("y theta")
M, R, g = symbols("M R g", positive=True)
alpha = symbols("alpha", real=True)

I = M * R**2 / 2  # noqa: E741 - the literature's letter
T = M * y.diff() ** 2 / 2 + I * theta.diff() ** 2 / 2
V = -M * g * y * sin(alpha)


def along(way, height=0):
    """The point a way down the incline and a height above it."""
    return (
        way * cos(alpha) + height * sin(alpha),
        -way * sin(alpha) + height * cos(alpha),
    )


model = Model(
    name="InclineDisk",
    lagrangian=T - V,
    coordinates={y: "m", theta: "rad"},
    constraints=[Holonomic("rolling", y - R * theta, "the disk rolls without slipping")],
    parameters=[
        Parameter(M, 1.0, "kg", "mass of the disk", min=0),
        Parameter(R, 0.1, "m", "radius of the disk", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(alpha, pi / 6, "rad", "angle of the incline", min=0, max=pi / 2),
    ],
    start={y: 0.0, theta: 0.0},
    description="Disk rolling down an incline without slipping",
    descriptions={y: "distance down the incline", theta: "rotation of the disk"},
    picture=[
        Ground(along(0), along(2)),
        Disk(along(y, R), radius=R, angle=-theta),
        Arrow("rolling", at=along(y), along=(cos(alpha), -sin(alpha))),
    ],
)

scenes = [
    Scene("InclineDisk", stop_time=1.0, step_size=0.01),
    Scene("InclineDiskMinimal", formulation="minimal", stop_time=1.0, step_size=0.01),
]

# M y'' = M g sin(alpha) + lambda  and  I theta'' = -R lambda  with  y'' = R theta'':
acceleration = 2 * g * sin(alpha) / 3
friction = -M * g * sin(alpha) / 3

closed_forms = [
    ClosedForm("lambda.rolling", friction),
    ClosedForm("Q.y", friction),
    ClosedForm("Q.theta", -R * friction),
    ClosedForm("der(y,2)", acceleration),
    ClosedForm("der(theta,2)", acceleration / R),
    ClosedForm("y", initial(y) + initial(y.diff()) * t + acceleration * t**2 / 2),
    ClosedForm("theta", initial(theta) + initial(theta.diff()) * t + acceleration * t**2 / (2 * R)),
    Conserved("energy", output("energy.total"), scale=output("energy.kinetic")),
]
