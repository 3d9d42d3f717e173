"""Problems A01 to A05 of the IFToMM library of computational benchmark problems, with the forces in joints.

    A01 simple pendulum: 1 kg on a rod of 1 m without mass, from rest, horizontal
    A02 N-four-bar mechanism: 2 N + 1 links of 1 m and 1 kg, upright, the upper pins at 1 m/s
    A03 Andrews' squeezer (andrews.py)
    A04 Bricard's mechanism: five bars of 1 m and 1 kg, 0.1 m square, from rest
    A05 stiff flyball governor: springs of 8e5 N/m with dampers of 4e4 N s/m, at 2 pi rad/s

(M. Gonzalez, D. Dopico, U. Lugris, J. Cuadrado, A benchmarking system for MBS simulation software, Multibody
System Dynamics 16, 2006.)  The library states motions; forces are found here from equations in as few
coordinates as there are freedoms, in A03 and A04 by Newton's and Euler's equations of each body.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, pi, sin, sqrt

import andrews
import numpy as np
from linkage import Linkage, Tie
from mechanisms import bar
from system import G, System, Vector, integrate

from lagfmu.bodies import (
    Body,
    Distance,
    Gravity,
    Ground,
    Prismatic,
    Revolute,
    SpringDamper,
    mechanism,
)

WINDOWS = 2  # N of A02
ROD, BASE, BALL, SIDE, HALF = 0.3, 3.0, 5.0, 0.05, 0.5  # of A05: kg, kg, kg, m, m
STIFFNESS, DAMPING, FREE = 8e5, 4e4, 0.5  # N/m, N s/m, m
SHAFT = ROD * (1 + 0.01**2) / 12, ROD * 0.01**2 / 6  # kg m2, across and along a rod 0.01 m square
CUBE = BASE * 0.1**2 / 6  # of the base
ARM = ROD + BALL  # kg, a rod and its ball
MIDDLE = HALF * (ROD + 2 * BALL) / ARM  # of these, from the hinge
ACROSS = SHAFT[0] + ROD * (MIDDLE - HALF) ** 2 + BALL * (2 * HALF - MIDDLE) ** 2


def pendulum() -> System:
    """A01: phi'' = -(g/l) cos(phi) from the horizontal; the rod pulls with m (l phi'^2 - g sin(phi))."""
    bob = Body("bob", 1.0, 0.01)
    model = mechanism(
        "A01",
        plane="xy",
        bodies=[bob],
        joints=[Distance("rod", Ground().at((0, 0)), bob.at((0, 0)), 1.0)],
        loads=[Gravity((0, -G))],
        start={"bob.position": (1.0, 0.0)},
    )

    def expected(stop: float) -> Mapping[str, float]:
        phi, w = integrate(lambda _, y: (y[1], -G * cos(y[0])), (0.0, 0.0), stop)
        pull = w**2 - G * sin(phi)
        return {"bob.position.x": cos(phi), "bob.position.y": sin(phi), "lambda.rod": -pull}

    return System(model, 10.0, expected)


def windows() -> System:
    """A02: links turn by phi from the vertical alike, and the rods between them only move along circles."""
    n = WINDOWS
    ground, J = Ground(), 1 / 12
    links = [Body(f"link{k}", 1.0, J, center=(0, 0.5)) for k in range(n + 1)]
    rods = [Body(f"rod{k}", 1.0, J, center=(0.5, 0)) for k in range(1, n + 1)]
    foot, top, left, right = (0, 0), (0, 1), (0, 0), (1, 0)
    joints = [Revolute(f"A{k}", ground.at((k, 0)), link.at(foot)) for k, link in enumerate(links)]
    for k, rod in enumerate(rods, 1):
        joints.append(Revolute(f"B{k}", links[k - 1].at(top), rod.at(left)))
        joints.append(Revolute(f"C{k}", rod.at(right), links[k].at(top)))
    start: dict[str, float] = {"der(angle.A0)": -1.0}
    model = mechanism(
        "A02",
        plane="xy",
        bodies=[*links, *rods],
        joints=joints,
        loads=[Gravity((0, -G))],
        start=start,
    )
    inertia, weight = (n + 1) / 3 + n, ((n + 1) / 2 + n) * G

    def expected(stop: float) -> Mapping[str, float]:
        """What turns a link besides its weight, tau, is alike for all: the rods' forces at its top."""
        phi, w = integrate(lambda _, y: (y[1], weight / inertia * sin(y[0])), (0.0, 1.0), stop)
        dw = weight / inertia * sin(phi)
        ax, ay = dw * cos(phi) - w**2 * sin(phi), -dw * sin(phi) - w**2 * cos(phi)
        tau = dw / 3 - G / 2 * sin(phi)
        up = (ay + G) / 2  # at each end of a rod, which does not turn
        found, before = {"angle.A0": -phi}, np.zeros(2)
        for k in range(n + 1):
            # about its foot link k is turned by what it gives the rods: top x (before + after) = tau
            after_y = up if k < n else 0.0
            after_x = (sin(phi) * (before[1] + after_y) - tau) / cos(phi) - before[0]
            after = np.array([after_x if k < n else 0.0, after_y])
            own = np.array([ax / 2, ay / 2 + G]) + before + after
            found |= {f"force.A{k}.x": own[0], f"force.A{k}.y": own[1]}
            before = np.array([ax, ay + G]) - after
            if k < n:  # the rods do not turn
                found |= {f"force.C{k + 1}.x": -before[0], f"force.C{k + 1}.y": -before[1]}
        return found

    return System(model, 2.5, expected)


def squeezer() -> System:
    """A03: half as long again as in andrews.py."""
    return System(andrews.model(), 0.05, andrews.squeezer().expected)


def bars() -> Linkage:
    """A04, with z upward."""
    ends = np.array(
        [[0, 0, 0], [1, 0, 0], [1, 0, -1], [1, -1, -1], [0, -1, -1], [0, -1, 0]], dtype=float
    )
    ways = np.roll(ends, -1, axis=0) - ends
    names = ["ground", "bar1", "bar2", "bar3", "bar4", "bar5", "ground"]
    bodies = {f"bar{k + 1}": bar(1.0, ends[k], ends[k + 1], 0.1 / sqrt(3)) for k in range(5)}
    ties = {
        f"J{k}": Tie("hinge", names[k], names[k + 1], ends[k].tolist(), axis.tolist())
        for k, axis in enumerate(np.abs(np.cross(np.roll(ways, 1, axis=0), ways)))
    }
    return Linkage("A04", bodies, ties, {"bar1": (0.0, 0.0, 0.0)}, G)


def bricard() -> System:
    """A04."""
    return bars().system(2.0)


def governor() -> System:
    """A05: the shaft turns by psi, both rods hang theta below the horizontal, the base is at s; they stay
    in a plane through the shaft, alike.  Lagrange's equations of psi, theta, s."""
    ground = Ground()
    shaft = Body("shaft", ROD, (SHAFT[0], *SHAFT), center=(0, 0, HALF))
    base = Body("base", BASE, (CUBE,) * 3)
    joints = [
        Revolute("bearing", ground.at((0, 0, 0)), shaft.at((0, 0, 0))),
        Prismatic("guide", shaft.at((0, 0, 0)), base.at((0, 0, 0))),
    ]
    bodies, loads = [shaft, base], [Gravity((0, 0, -G))]
    for name, side in (("right", 1), ("left", -1)):
        rod = Body(name, ARM, (SHAFT[1], ACROSS, ACROSS), center=(side * MIDDLE, 0, 0))
        hung = shaft.at((side * SIDE, 0, 2 * HALF))
        joints.append(Revolute(f"{name}_hinge", hung, rod.at((0, 0, 0)), axis="y"))
        ends = rod.at((side * HALF, 0, 0)), base.at((side * SIDE, 0, 0))
        loads.append(SpringDamper(f"{name}_spring", *ends, STIFFNESS, FREE, DAMPING))
        bodies.append(rod)
    start = {
        "angle.right_hinge": pi / 6,
        "angle.left_hinge": -pi / 6,
        "position.guide": HALF,
        "shaft.omega": (0.0, 0.0, 2 * pi),
    }
    model = mechanism("A05", bodies=bodies, joints=joints, loads=loads, start=start)

    def expected(stop: float) -> Mapping[str, float]:
        """The right rod's hinge in the axes of the shaft."""
        theta, s, w, dtheta, ds, _ = y = integrate(flyballs, FLYBALLS, stop)
        pull, _, _ = _spring(theta, dtheta, s, ds)
        way = np.array([-HALF * cos(theta), 0, s - 2 * HALF + HALF * sin(theta)])
        force = ARM * (swing(y) + np.array([0, 0, G])) - pull * way / np.linalg.norm(way)
        named = {f"force.right_hinge.{x}": f for x, f in zip("xyz", force.tolist(), strict=True)}
        return named | {"position.guide": s, "shaft.omega.z": w, "angle.right_hinge": theta}

    return System(model, 2.0, expected)


FLYBALLS = (
    pi / 6,
    HALF,
    2 * pi,
    0.0,
    0.0,
    0.0,
)  # theta, s, psi', theta', s', psi of A05 at the start


def flyballs(_: float, y: Vector) -> tuple[float, ...]:
    """y' of A05."""
    theta, s, w, dtheta, ds, _ = y
    r = SIDE + MIDDLE * cos(theta)
    held = SHAFT[1] + CUBE
    held += 2 * (ARM * r**2 + ACROSS * cos(theta) ** 2 + SHAFT[1] * sin(theta) ** 2)
    slope = 2 * sin(theta) * (-2 * ARM * r * MIDDLE + 2 * (SHAFT[1] - ACROSS) * cos(theta))
    pull, by_theta, by_s = _spring(theta, dtheta, s, ds)
    bend = slope * w**2 / 4 + ARM * G * MIDDLE * cos(theta) - pull * by_theta
    return (
        dtheta,
        ds,
        -slope * dtheta * w / held,
        bend / (ACROSS + ARM * MIDDLE**2),
        -G - 2 * pull * by_s / BASE,
        w,
    )


def swing(y: Vector) -> Vector:
    """The acceleration of A05's right rod with its ball, in the axes of the shaft."""
    theta, _, w, dtheta, _, _ = y
    _, _, dw, bend, _, _ = flyballs(0.0, y)
    c, d = MIDDLE * cos(theta), MIDDLE * sin(theta)
    r = SIDE + c
    return np.array(
        [
            -c * dtheta**2 - d * bend - r * w**2,
            r * dw - 2 * d * dtheta * w,
            d * dtheta**2 - c * bend,
        ]
    )


def _spring(theta: float, dtheta: float, s: float, ds: float) -> tuple[float, float, float]:
    """Its pull, and how its length grows with theta and with s."""
    x, z = HALF * cos(theta), 2 * HALF - HALF * sin(theta) - s
    d = sqrt(x * x + z * z)
    by_theta = (-x * HALF * sin(theta) - z * HALF * cos(theta)) / d
    by_s = -z / d
    return STIFFNESS * (d - FREE) + DAMPING * (by_theta * dtheta + by_s * ds), by_theta, by_s


SYSTEMS = [pendulum, windows, squeezer, bricard, governor]
