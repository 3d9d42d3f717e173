"""A gyroscope on a ball joint: it spins, precesses steadily under gravity, and its pivot carries it.

The wheel's axis is inclined by theta, its centre of mass at a distance l from the pivot.  With the moments of
inertia A about the pivot across the axis and C about it, steady precession at the rate p needs the spin
omega_z = (m g l/p + A p cos(theta))/C.  The force of the pivot is m (r'' - g), with r'' of Euler's equations
about the pivot, without a multiplier.
"""

from math import cos, sin

from sympy import Matrix, Symbol, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import ClosedForm, Conserved, Parameter, Scene, initial, output
from lagfmu.bodies import Body, Gravity, Ground, Spherical, mechanism

MASS, ACROSS, ALONG, ARM, G = 1.2, 0.004, 0.006, 0.1, 9.81  # kg, kg m^2, m, m/s^2
THETA, PRECESSION = 0.8, 2.5  # rad, rad/s
SPIN = MASS * G * ARM / PRECESSION + (ACROSS + MASS * ARM**2) * PRECESSION * cos(THETA)
TURNING = 0, PRECESSION * sin(THETA), SPIN / ALONG  # of the wheel, in its own axes [rad/s]

ground = Ground()
across = Symbol("across", positive=True)
both = Parameter(across, ACROSS, "kg.m^2", "moments of inertia of the wheel across its axis")
wheel = Body("wheel", mass=MASS, inertia=(both, both, ALONG))
model = mechanism(
    "Gyroscope",
    bodies=[wheel],
    joints=[Spherical("pivot", ground.at((0, 0, 0)), wheel.at((0, 0, -ARM)))],
    loads=[Gravity((0, 0, -G))],
    start={
        "wheel.orientation": (cos(THETA / 2), sin(THETA / 2), 0, 0),
        "wheel.omega": TURNING,
    },
    description="Gyroscope on a ball joint that precesses steadily",
)

scenes = [Scene("Gyroscope", stop_time=2.0, step_size=0.01)]

J = across
m, C, g = symbols("wheel.mass wheel.inertia.zz gravity.z", real=True)
arm = -output("pivot.second.z")
A = J + m * arm**2

w, x, y, z = dynamicsymbols(" ".join(f"wheel.orientation.{q}" for q in "wxyz"))
omega = Matrix(dynamicsymbols(" ".join(f"wheel.omega.{q}" for q in "xyz")))
R = Matrix(
    [
        [w**2 + x**2 - y**2 - z**2, 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), w**2 - x**2 + y**2 - z**2, 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), w**2 - x**2 - y**2 + z**2],
    ]
)
up = R.T * Matrix([0, 0, 1])
lever = Matrix([0, 0, arm])

# Euler about the pivot, in the frame of the wheel: I omega' = (I omega) x omega + lever x weight.
inertia = Matrix.diag(A, A, C)
turning = inertia.inv() * ((inertia * omega).cross(omega) + lever.cross(m * g * up))
acceleration = R * (turning.cross(lever) + omega.cross(omega.cross(lever)))
force = m * (acceleration - Matrix([0, 0, g]))

# The precession is steady at the model's own values and start.
own = {m: MASS, J: ACROSS, C: ALONG, g: -G, arm: ARM}
begun = {w: cos(THETA / 2), x: sin(THETA / 2), **dict(zip(omega, TURNING, strict=True))}
steady = sum(abs(s - value) for s, value in own.items())
steady += sum(abs(initial(s) - value) for s, value in begun.items())
height = dynamicsymbols("wheel.position.z")

closed_forms = [
    Conserved("energy", output("energy.total")),
    Conserved("spin", omega[2]),
    Conserved("vertical angular momentum", up.dot(inertia * omega)),
    *(
        ClosedForm(f"force.pivot.{q}", f, scale=output("force.pivot.norm"))
        for q, f in zip("xyz", force, strict=True)
    ),
    ClosedForm(
        "height",  # steady: the axis keeps its inclination
        initial(height),
        actual=height,
        when=steady < 1e-12,
    ),
]
