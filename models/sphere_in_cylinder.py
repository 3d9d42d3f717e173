"""Solid sphere that rolls on the inside of a cylinder, and comes up again (Neimark & Fufaev, ch. 3).

r, z [m] and phi [rad] are the centre's cylindrical coordinates about the cylinder's axis, which leans by tilt
from the vertical: phi = 0 is its lowest line.  wx, wy, wz [rad/s] are the angular velocity along the
cylinder's axes; the quaternion e is the sphere's attitude.  lambda.wall [N] is the normal force, positive
inward; lambda.around and lambda.along [N] are the friction that rolling needs, along phi and z.

Upright, the ball goes round at a constant rate and swings up and down, sqrt(7/2) = 1.87 turns to a swing,
whatever its size and gravity (the golfer's dilemma: M. Gualtieri et al., Am. J. Phys. 74, 497, 2006).  Lying,
tilt = pi/2, it is a pendulum of length (7/5) b (Marion & Thornton, problem 7-3).
"""

from sympy import Abs, Heaviside, Matrix, Rational, cos, pi, sin, sqrt, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Arrow,
    ClosedForm,
    Conserved,
    Contact,
    Disk,
    Frame,
    Model,
    Nonholonomic,
    Output,
    Page,
    Parameter,
    Scene,
    Sphere,
    Track,
    initial,
    output,
    rotation_matrix,
)

t = dynamicsymbols._t
r, phi, z = dynamicsymbols("r phi z")
e0, e1, e2, e3 = e = dynamicsymbols("e0:4")
wx, wy, wz = dynamicsymbols("wx wy wz")
m, g, R, a = symbols("m g R a", positive=True)
tilt = symbols("tilt", real=True)
turn = symbols("turn")  # along the drawn rims
b = R - a

I = Rational(2, 5) * m * a**2  # noqa: E741 - the literature's letter
T = m * (r.diff() ** 2 + r**2 * phi.diff() ** 2 + z.diff() ** 2) / 2
T += I * (wx**2 + wy**2 + wz**2) / 2
V = m * g * (z * cos(tilt) - r * cos(phi) * sin(tilt))

outward = wx * cos(phi) + wy * sin(phi)  # the angular velocity along the normal,
onward = wy * cos(phi) - wx * sin(phi)  # and along the way round

leaning = Matrix([[cos(tilt), 0, sin(tilt)], [0, 1, 0], [-sin(tilt), 0, cos(tilt)]])


def seen(radius, angle, height):
    """A point in cylindrical coordinates, with the vertical upward."""
    return tuple(leaning * Matrix([radius * cos(angle), radius * sin(angle), height]))


model = Model(
    name="SphereInCylinder",
    lagrangian=T - V,
    coordinates={r: "m", phi: "rad", z: "m", **dict.fromkeys(e, "1")},
    speeds=dict.fromkeys((wx, wy, wz), "rad/s"),
    kinematics={
        e0: -(e1 * wx + e2 * wy + e3 * wz) / 2,
        e1: (e0 * wx + wy * e3 - wz * e2) / 2,
        e2: (e0 * wy + wz * e1 - wx * e3) / 2,
        e3: (e0 * wz + wx * e2 - wy * e1) / 2,
    },
    constraints=[
        Contact("wall", b - r, "the sphere touches the cylinder or is inside of it"),
        Nonholonomic(
            "around",
            r * phi.diff() + a * wz,
            "the point of contact does not slide around",
            while_closed="wall",
        ),
        Nonholonomic("along", z.diff() - a * onward, "nor along the cylinder", while_closed="wall"),
    ],
    parameters=[
        Parameter(m, 1.0, "kg", "mass of the sphere", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(R, 0.5, "m", "radius of the cylinder", min=0),
        Parameter(a, 0.1, "m", "radius of the sphere", min=0),
        Parameter(tilt, 0.0, "rad", "angle of the cylinder's axis from the vertical"),
    ],
    start={r: b, phi: 0.0, z: 0.0, phi.diff(): 10.0, e0: 1.0},
    description="Solid sphere that rolls inside a cylinder, and comes up again",
    descriptions={
        r: "distance of the centre from the axis",
        phi: "angle of the centre about the axis, from the lowest line",
        z: "way of the centre along the axis",
        wx: "angular velocity across the axis, outward at phi = 0",
        wy: "angular velocity across the axis, outward at phi = pi/2",
        wz: "angular velocity along the axis",
    },
    outputs=[Output("spin", outward, "rad/s", "angular velocity about the normal, outward")],
    picture=[
        *(Track(seen(R, turn, h * R), turn, 0, 2 * pi) for h in (0, -1, -2)),
        Sphere(seen(r, phi, z), a),
        Disk(seen(r, phi, z), trace=True),
        Frame(seen(r, phi, z), leaning * rotation_matrix(e)),
        Arrow("wall", at=seen(r, phi, z), along=seen(-1, phi, 0)),
        Arrow("around", at=seen(r + a, phi, z), along=seen(1, phi + pi / 2, 0)),
        Arrow("along", at=seen(r + a, phi, z), along=seen(0, 0, 1)),
    ],
    page=Page(
        sliders=[phi.diff(), wx, z.diff(), tilt, a],
        curves=[z, "lambda.along", "lambda.wall", "spin", "energy.*"],
        ranges={phi.diff(): (5, 20), wx: (-300, 300), tilt: (0, pi / 2), a: (0.02, 0.2)},
    ),
)

scenes = [Scene("SphereInCylinder", stop_time=3.0, step_size=0.01)]

# The sphere turns about the moving normal, along the way round and along the axis at the rates n, -b phi'/a
# and, along the way round, z'/a:  n' = phi' z'/a  (no moment about the normal),
#     (7/5) b phi'' = -g sin(tilt) sin(phi) ,   (7/5) z'' = -g cos(tilt) - (2/5) a n phi' .
# Both have an energy of their own, and the forces are
#     wall = m (b phi'^2 + g sin(tilt) cos(phi)) ,   along = m (z'' + g cos(tilt)) ,
#     around = m (b phi'' + g sin(tilt) sin(phi)) .
across, axial = g * sin(tilt), g * cos(tilt)
phi0, rate0, z0, fall0 = (initial(s) for s in (phi, phi.diff(), z, z.diff()))
wall = m * (b * rate0**2 + across * (17 * cos(phi) - 10 * cos(phi0)) / 7)

# Upright  phi' = rate0,  n = n0 + rate0 (z - z0)/a,  and  z'' = -(2/7) rate0^2 (z - middle).
n0 = initial(wx) * cos(phi0) + initial(wy) * sin(phi0)
k = sqrt(Rational(2, 7)) * rate0
middle = z0 - a * n0 / rate0 - 5 * axial / (2 * rate0**2)
swing = middle + (z0 - middle) * cos(k * t) + fall0 / k * sin(k * t)
upright = 1 - Heaviside(Abs(sin(tilt)) - 1e-14, 1)  # and not upside down: axial has its sign
held = {"until_departure": "wall"}

closed_forms = [
    ClosedForm("lambda.wall", wall, **held),
    ClosedForm("lambda.around", 2 * m * across * sin(phi) / 7, scale=m * g, **held),
    ClosedForm(
        "lambda.along", 2 * m * (axial - a * output("spin") * phi.diff()) / 7, scale=m * g, **held
    ),
    ClosedForm(
        "z of the upright cylinder",
        swing,
        actual=z,
        scale=b + 5 * g / (2 * rate0**2),
        when=upright,
        **held,
    ),
    ClosedForm("phi of the upright cylinder", phi0 + rate0 * t, actual=phi, when=upright, **held),
    Conserved(
        "energy around",
        Rational(7, 10) * (b * phi.diff()) ** 2 - b * across * cos(phi),
        scale=g * b,
        **held,
    ),
    Conserved(
        "energy along",
        Rational(7, 10) * z.diff() ** 2 + (a * output("spin")) ** 2 / 5 + axial * z,
        scale=g * b,
        **held,
    ),
]
