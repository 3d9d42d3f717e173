"""A door on two hinges, which carry it together: what each carries alone no rigid body can tell.

Ten rows hold six speeds, and their rank is five.  The FMU says of each component that it is not unique
(unique.lower.z, ...) and shares it by least norm; the sums of both hinges are determined, and held here: the
door turns at a constant rate, so that its hinges give it the centripetal force and its weight.
"""

from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import ClosedForm, Conserved, Scene, output
from lagfmu.bodies import Body, Gravity, Ground, Revolute, mechanism

ground = Ground()
door = Body("door", mass=20.0, inertia=(6.7, 7.8, 1.1))  # 0.8 m wide, 2 m high
model = mechanism(
    "Door",
    bodies=[door],
    joints=[
        Revolute("lower", ground.at((0, 0, 0.3)), door.at((-0.4, 0, -0.7))),
        Revolute("upper", ground.at((0, 0, 1.7)), door.at((-0.4, 0, 0.7))),
    ],
    loads=[Gravity((0, 0, -9.81))],
    start={"angle.lower": 0.2, "der(angle.lower)": 1.5},
    description="Door on two hinges, of whose forces the sums alone are determined",
)

scenes = [Scene("Door", stop_time=2.0, step_size=0.02)]

m, g = symbols("door.mass gravity.z", real=True)
width, low, high = (output(n) for n in ("lower.second.x", "lower.second.z", "upper.second.z"))
angle = dynamicsymbols("angle.lower")
radius, rate = -width, output("der(angle.lower)")

pull = -m * rate**2 * radius  # towards the hinges
sums = {"x": pull * cos(angle), "y": pull * sin(angle), "z": -m * g}
weight = output("force.lower.norm") + output("force.upper.norm")
# Moments about the lower hinge: of both hinges, and of what the mass needs at its centre, -low above it.
# the upper hinge's force acts at the height high - low
across = [output(f"torque.lower.{x}") + output(f"torque.upper.{x}") for x in ("x", "y")]
height = high - low
moments = {
    "x": across[0] - height * output("force.upper.y"),
    "y": across[1] + height * output("force.upper.x"),
}
needed = {
    "x": radius * sin(angle) * sums["z"] + low * sums["y"],
    "y": -low * sums["x"] - radius * cos(angle) * sums["z"],
}

closed_forms = [
    Conserved("rate", rate),
    *(
        ClosedForm(
            f"both, force {x}",
            expected,
            actual=output(f"force.lower.{x}") + output(f"force.upper.{x}"),
            scale=weight,
        )
        for x, expected in sums.items()
    ),
    *(
        ClosedForm(f"both, moment {x}", needed[x], actual=moments[x], scale=weight * height)
        for x in needed
    ),
]
