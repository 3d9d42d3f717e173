"""Andrews' squeezer: seven bodies in the plane on ten pins, driven by a motor against a spring.

The data are those of Hairer & Wanner, Solving Ordinary Differential Equations II, sect. VII.7. PUBLISHED
are the angle of the crank and the forces in the point that four bodies share, at 0.03 s, of the test set
for initial value problem solvers (Mazzia & Magherini), which has them in seven angles and six rows, at a
tolerance of 1e-14. They are right to 1.2e-9 rad and 1e-7 of a force: this file, the equations of the test
set integrated in steps of 30 us, and lagfmu agree with one another to 2e-12 rad, and differ from them by
that.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from plane import GROUND, Look, Mechanism, Pin, Vector, unit
from system import System

from lagfmu import Model
from lagfmu.bodies import Body, Ground, Revolute, SpringDamper, Torque, mechanism

STOP = 0.03  # s
A, B, C = -0.06934 - 0.00227j, -0.03635 + 0.03273j, 0.014 + 0.072j  # m
# mass [kg], inertia [kg m2], centre of mass [m] from where the body is hung, angle at the start [rad]
BODIES = (
    (0.04325, 2.194e-6, 0.00092 + 0j, -0.0617138900142764496),
    (0.00365, 4.410e-7, -0.0115 + 0j, -0.0617138900142764496),
    (0.02373, 5.255e-6, 0.01043 - 0.01874j, 0.455279819163070380),
    (0.00706, 5.667e-7, -0.00579j, 0.222668390165885885 + 0.487364979543842550),
    (0.07050, 1.169e-5, 0.02308 + 0.00916j, 0.487364979543842550),
    (0.00706, 5.667e-7, 0.00579 + 0j, -0.222668390165885885 + 1.23054744454982119),
    (0.05498, 1.912e-5, 0.01228 + 0.00449j, 1.23054744454982119),
)
# name, two bodies (0: the ground), and where the pin is on each [m]
PINS = (
    ("O", 0, 0j, 1, 0j),
    ("B", 0, B, 3, 0j),
    ("A5", 0, A, 5, 0j),
    ("A7", 0, A, 7, 0j),
    ("F", 1, 0.007 + 0j, 2, 0j),
    ("H", 5, 0.04 + 0j, 4, 0j),
    ("U", 7, -0.04j, 6, 0j),
    ("P3", 2, -0.028 + 0j, 3, -0.035j),
    ("P4", 2, -0.028 + 0j, 4, -0.02j),
    ("P6", 2, -0.028 + 0j, 6, 0.02 + 0j),
)
# the spring's hook is on body 3
TORQUE, STIFFNESS, FREE, HOOK = 0.033, 4530.0, 0.07785, 0.02 - 0.018j
PUBLISHED = {
    "angle": 15.81077119629904,
    "P3": 199.1753333731910 - 29.75531228015052j,
    "P4": 23.06654119098399 + 31.45271365475927j,
    "P6": 22.64249232082739 + 11.61740700019673j,
}


def by_hand() -> tuple[Mechanism, Vector]:
    """Newton and Euler, and the state at the start."""
    centers = [0j, *(center for _, _, center, _ in BODIES)]
    turns = [1 + 0j, *(np.exp(1j * angle) for *_, angle in BODIES)]
    hung = {0: 0j}
    for _, first, s1, second, s2 in PINS:
        hung.setdefault(second, hung[first] + turns[first] * s1 - turns[second] * s2)
    q = []
    for k, (*_, center, angle) in enumerate(BODIES, 1):
        z = hung[k] + turns[k] * center
        q += [z.real, z.imag, angle]

    def load(look: Look) -> Vector:
        found = np.zeros((7, 3))
        found[0, 2] = TORQUE
        s = HOOK - centers[3]
        d = look.point(2, s) - C
        pull = -STIFFNESS * (abs(d) - FREE) * d / abs(d)
        found[2] = unit(pull, look.turn[2] * s)
        return found

    pins = [
        Pin(
            GROUND if first == 0 else first - 1,
            s1 - centers[first],
            second - 1,
            s2 - centers[second],
        )
        for _, first, s1, second, s2 in PINS
    ]
    return Mechanism([(m, J) for m, J, *_ in BODIES], pins, load), np.array([*q, *[0.0] * 21])


def forces(stop: float) -> tuple[Vector, dict[str, complex]]:
    """The state, and the force [N] on the second body of each pin, x + iy in the ground's axes."""
    mechanism_, y = by_hand()
    y = mechanism_.moved(y, stop, 1e-4)
    _, lam = mechanism_.solve(y)
    pairs = lam.reshape(-1, 2)
    return y, {name: complex(*pair) for (name, *_), pair in zip(PINS, pairs, strict=True)}


def model() -> Model:
    """Its bodies and joints."""
    bodies: list[Body | Ground] = [Ground()]
    for k, (m, J, center, _) in enumerate(BODIES, 1):
        bodies.append(Body(f"K{k}", m, J, center=(center.real, center.imag)))
    joints = [
        Revolute(name, bodies[i].at((s1.real, s1.imag)), bodies[k].at((s2.real, s2.imag)))
        for name, i, s1, k, s2 in PINS
    ]
    spring = SpringDamper(
        "spring",
        bodies[0].at((C.real, C.imag)),
        bodies[3].at((HOOK.real, HOOK.imag)),
        stiffness=STIFFNESS,
        length=FREE,
    )
    return mechanism(
        "Andrews",
        plane="xy",
        bodies=bodies[1:],
        joints=joints,
        loads=[spring, Torque("motor", bodies[1], TORQUE)],
        start={f"K{k}.orientation.z": angle for k, (*_, angle) in enumerate(BODIES, 1)},
    )


def squeezer() -> System:
    """The force of each pin, in the axes of its first body, and the crank's angle."""

    def expected(stop: float) -> Mapping[str, float]:
        y, received = forces(stop)
        look = Look(y)
        found = {"angle.O": float(y[2])}
        for name, first, *_ in PINS:
            own = received[name] / look.turn[first - 1]  # -1: the ground
            found |= {f"force.{name}.x": own.real, f"force.{name}.y": own.imag}
        return found

    return System(model(), STOP, expected)


SYSTEMS = [squeezer]
