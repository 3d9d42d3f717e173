"""Bennett's linkage: four hinges in space that are neither parallel nor meet, and yet a mechanism that moves.

Opposite links have the same length and twist, and sin(alpha)/a = sin(beta)/b.  Counting freedoms, 18 speeds
less 20 rows, it should be a structure: it moves because three rows follow from the others.  Its angles obey

    tan(A/2) tan(B/2) = sin((beta + alpha)/2)/sin((beta - alpha)/2) ,   C = -A ,   D = B

(G. T. Bennett, A new mechanism, Engineering 76, 1903), modulo 2 pi.  What each hinge carries is not unique;
what the ground's two hinges give together is.
"""

from math import asin, cos, pi, sin

from sympy import cos as cosine
from sympy import sin as sine

from lagfmu import ClosedForm, Conserved, Scene, output
from lagfmu.bodies import Body, Gravity, Ground, Revolute, mechanism

SHORT, LONG, ALPHA = 0.3, 0.5, pi / 6  # m, m, rad
BETA = pi - asin(LONG / SHORT * sin(ALPHA))


def link(name, length):
    """A slender link of 2 kg a metre, from its own origin along x."""
    m = 2 * length
    J = m * length**2 / 12
    return Body(name, m, (J / 50, J, J), center=(length / 2, 0, 0))


def end(part, length, twist):
    """The hinge at the far end of a link, whose axis is turned about the link."""
    return part.at((length, 0, 0), rotation=("rpy", twist, 0, 0))


ground = Ground()
one, two, three = link("one", SHORT), link("two", LONG), link("three", SHORT)
model = mechanism(
    "Bennett",
    bodies=[one, two, three],
    joints=[
        Revolute("A", end(ground, LONG, BETA), one.at((0, 0, 0))),
        Revolute("B", end(one, SHORT, ALPHA), two.at((0, 0, 0))),
        Revolute("C", end(two, LONG, BETA), three.at((0, 0, 0))),
        Revolute("D", ground.at((0, 0, 0)), end(three, SHORT, ALPHA)),
    ],
    loads=[Gravity((0, 0, -9.81))],
    start={"angle.A": 1.0, "der(angle.A)": 6.0},
    description="Bennett's linkage: four hinges in space that move, though a count of freedoms denies it",
)

scenes = [Scene("Bennett", stop_time=0.5, step_size=0.01)]

A, B, C, D = (output(f"angle.{j}") for j in "ABCD")
ratio = sin((BETA + ALPHA) / 2) / sin((BETA - ALPHA) / 2)

# What the hinges A and D give, along the ground's axes, changes the momentum of the links, with gravity.
c, s = cos(BETA), sin(BETA)
y, z = output("force.A.y"), output("force.A.z")
given = {
    "x": output("force.A.x") + output("force.D.x"),
    "y": c * y - s * z + output("force.D.y"),
    "z": s * y + c * z + output("force.D.z"),
}
size = output("force.A.norm") + output("force.D.norm")
links = [(output(f"{b.name}.mass"), b.name) for b in (one, two, three)]
changed = {x: sum(m * output(f"der({n}.position.{x},2)") for m, n in links) for x in "xyz"}
changed["z"] -= output("gravity.z") * sum(m for m, _ in links)

closed_forms = [
    Conserved("energy", output("energy.total")),
    ClosedForm(
        "A and B", ratio * cosine(A / 2) * cosine(B / 2), actual=sine(A / 2) * sine(B / 2), scale=1
    ),
    ClosedForm("C and A", 0, actual=sine((C + A) / 2), scale=1),
    ClosedForm("D and B", 0, actual=sine((D - B) / 2), scale=1),
    *(
        ClosedForm(f"both hinges, {x}", changed[x], actual=force, scale=size)
        for x, force in given.items()
    ),
]
