"""A slider-crank of bodies and joints in the plane, with the force in each joint.

The crank turns about A on the ground, the rod joins it to the piston at B and C, the piston slides along x
at D.  All else follows from the crank's angle by geometry; Newton's law for each body, beginning with the
piston, then gives every force, without a multiplier: that is d'Alembert's way.
"""

from math import pi

from sympy import asin, cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import ClosedForm, Conserved, Page, Scene, output
from lagfmu.bodies import Body, Gravity, Ground, Prismatic, Revolute, mechanism

ground = Ground()
crank = Body("crank", mass=2.0, inertia=0.01)
rod = Body("rod", mass=1.0, inertia=0.02)
piston = Body("piston", mass=0.5, inertia=0.001)
model = mechanism(
    "SliderCrankBodies",
    plane="xy",
    bodies=[crank, rod, piston],
    joints=[
        Revolute("A", ground.at((0, 0)), crank.at((-0.1, 0))),
        Revolute("B", crank.at((0.1, 0)), rod.at((-0.25, 0))),
        Revolute("C", rod.at((0.25, 0)), piston.at((0, 0))),
        Prismatic("D", ground.at((0, 0)), piston.at((0, 0)), axis="x"),
    ],
    loads=[Gravity((0, -9.81))],
    start={"angle.A": pi / 4, "der(angle.A)": 10.0},
    description="Slider-crank of bodies and joints, with the force in each joint",
    page=Page(
        sliders=["crank.mass", "rod.mass", "piston.mass", "der(crank.orientation.z)"],
        curves=["force.A.norm", "force.B.norm", "force.C.norm", "force.D.norm", "torque.D.z"],
    ),
)

scenes = [Scene("SliderCrankBodies", stop_time=2.0, step_size=0.01)]

# The parameters of the FMU, and distances: from A to the crank's centre, from B to the rod's.
m_c, m_r, m_p, J_c, J_r, g = symbols(
    "crank.mass rod.mass piston.mass crank.inertia rod.inertia gravity.y", real=True
)
a, e = -output("A.second.x"), -output("B.second.x")
r, l = a + output("B.first.x"), e + output("C.first.x")  # noqa: E741 - the literature's

phi = dynamicsymbols("crank.orientation.z")
psi = -asin(r * sin(phi) / l)  # of the rod: the piston is on the x axis, on the right
centers = {
    "crank": (a * cos(phi), a * sin(phi)),
    "rod": (r * cos(phi) + e * cos(psi), r * sin(phi) + e * sin(psi)),
    "piston": (r * cos(phi) + l * cos(psi), 0),
}
masses = {"crank": m_c, "rod": m_r, "piston": m_p}

# One freedom: I(phi) phi'' + I'(phi) phi'^2/2 = -V'(phi), with the energy I phi'^2/2 + V.
slopes = {name: [x.diff(phi) if x else 0 for x in at] for name, at in centers.items()}
inertia = J_c + J_r * psi.diff(phi) ** 2
inertia += sum(m * (slopes[n][0] ** 2 + slopes[n][1] ** 2) for n, m in masses.items())
weight = sum(m * g * slopes[n][1] for n, m in masses.items())
turning = (weight - inertia.diff(phi) * phi.diff() ** 2 / 2) / inertia

# Newton: what a body's mass needs besides gravity, m (r'' - g), comes from its joints.
t = dynamicsymbols._t
needed = {
    n: tuple(m * (x.diff(t, 2) if x else 0) for m, x in ((masses[n], x) for x in at))
    for n, at in centers.items()
}
needed = {n: (x, y - masses[n] * g) for n, (x, y) in needed.items()}
C_x = needed["piston"][0]  # on the piston; about B, the rod's moments give the other component
moment = J_r * psi.diff(t, 2) + e * (cos(psi) * needed["rod"][1] - sin(psi) * needed["rod"][0])
C_y = (l * sin(psi) * C_x - moment) / (l * cos(psi))
B_x, B_y = needed["rod"][0] + C_x, needed["rod"][1] + C_y
A_x, A_y = needed["crank"][0] + B_x, needed["crank"][1] + B_y


def turned(x, y, angle):
    """The components of a vector along axes that are turned by an angle."""
    return x * cos(angle) + y * sin(angle), y * cos(angle) - x * sin(angle)


forces = {
    "A": (A_x, A_y),
    "B": turned(B_x, B_y, phi),
    "C": turned(C_x, C_y, psi),
    "D": (0, needed["piston"][1] - C_y),
}

rod = dynamicsymbols("rod.orientation.z")
right = cos(rod) > 0  # of the crank's pin is the piston

closed_forms = [
    Conserved("energy", output("energy.total")),
    ClosedForm("rod's inclination", sin(psi), actual=sin(rod), when=right),
    ClosedForm("position.D", centers["piston"][0], when=right),
    ClosedForm("der(angle.A,2)", turning, when=right),
    *(
        ClosedForm(f"force.{joint}.{x}", force, scale=output(f"force.{joint}.norm"), when=right)
        for joint, components in forces.items()
        for x, force in zip("xy", components, strict=True)
    ),
    ClosedForm("torque.D.z", 0, scale=output("force.D.norm") * r),
]
