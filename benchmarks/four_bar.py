"""Four-bar linkage of three rigid bars and the ground, in absolute coordinates: one closed loop.

Bar k of length l_k and mass m_k: centre (x_k, y_k) [m], angle phi_k [rad] from the x axis.  Crank 1 turns
about the origin, rocker 3 about (d, 0), coupler 2 joins their ends: four pins, eight constraints
(lambda: the pins' forces [N]), nine coordinates, one degree of freedom.  The crank starts upright,
at a rate omega that carries it round (Grashof: 1 + sqrt(5) < 2 + 2).

`exact` needs no integrator: with one degree of freedom the energy gives the crank's rate,

    J(phi) phi'^2 / 2 + V(phi) = E ,    t(phi) = integral of sqrt(J / (2 (E - V))) ,

a periodic integrand, whose Fourier series converges geometrically.
"""

from __future__ import annotations

from math import pi, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sympy import Rational, cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Conserved, Holonomic, Model, Parameter, Scene, derive, output
from lagfmu.codegen.py.equations import lower
from lagfmu.mechanics.form import Form

OMEGA = 4.0  # [rad/s] the crank's first rate
LENGTHS = (1.0, sqrt(5.0), 2.0)
MASSES = (1.0, 2.0, 2.0)
GROUND, GRAVITY = 2.0, 9.81

x = dynamicsymbols("x1:4")
y = dynamicsymbols("y1:4")
phi = dynamicsymbols("phi1:4")
m = symbols("m1:4", positive=True)
l = symbols("l1:4", positive=True)  # noqa: E741
d, g = symbols("d g", positive=True)
half = Rational(1, 2)

T = sum(
    half * m[k] * (x[k].diff() ** 2 + y[k].diff() ** 2)
    + half * m[k] * l[k] ** 2 / 12 * phi[k].diff() ** 2
    for k in range(3)
)
V = sum(m[k] * g * y[k] for k in range(3))


def end(k: int, side: int) -> tuple[Any, Any]:
    """One end of bar k: -1 the first, +1 the second."""
    return (
        x[k] + side * half * l[k] * cos(phi[k]),
        y[k] + side * half * l[k] * sin(phi[k]),
    )


PINS = {
    "origin": (end(0, -1), (0, 0)),
    "crank": (end(0, +1), end(1, -1)),
    "rocker": (end(1, +1), end(2, +1)),
    "ground": (end(2, -1), (d, 0)),
}

model = Model(
    name="FourBar",
    lagrangian=T - V,
    coordinates={
        s: unit for k in range(3) for s, unit in ((x[k], "m"), (y[k], "m"), (phi[k], "rad"))
    },
    constraints=[
        Holonomic(f"{name}_{axis}", a - b)
        for name, (one, other) in PINS.items()
        for axis, a, b in zip("xy", one, other, strict=True)
    ],
    parameters=[
        *(Parameter(m[k], MASSES[k], "kg") for k in range(3)),
        *(Parameter(l[k], LENGTHS[k], "m") for k in range(3)),
        Parameter(d, GROUND, "m"),
        Parameter(g, GRAVITY, "m/s^2"),
    ],
    # the crank upright, A = (0, 1); the rocker upright, B = (2, 2): A and B move by (-omega, 0)
    start={
        **{x[0]: 0.0, y[0]: 0.5, phi[0]: pi / 2},
        **{x[1]: 1.0, y[1]: 1.5, phi[1]: float(np.arctan2(1, 2))},
        **{x[2]: 2.0, y[2]: 1.0, phi[2]: pi / 2},
        **{x[0].diff(): -OMEGA / 2, phi[0].diff(): OMEGA},
        x[1].diff(): -OMEGA,
        **{x[2].diff(): -OMEGA / 2, phi[2].diff(): OMEGA / 2},
    },
    description="Four-bar linkage in absolute coordinates",
)

scenes = [Scene("FourBar", stop_time=10.0, step_size=0.01)]
closed_forms = [Conserved("energy", output("energy.total"))]


def _pose(angle: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """q(angle of the crank) and dq/dangle, each (samples, 9), on the branch of the start."""
    a, b, c = LENGTHS
    A = a * np.exp(1j * angle)
    to_ground = GROUND - A  # B is where the circles about A (b) and about the ground pin (c) meet
    r = np.abs(to_ground)
    B = A + b * to_ground / r * np.exp(1j * np.arccos((b**2 + r**2 - c**2) / (2 * b * r)))
    dA = 1j * A
    coupler, rocker = B - A, B - GROUND
    # dA + i beta' coupler = i gamma' rocker, for the rates beta', gamma' of coupler and rocker
    area = (np.conj(coupler) * rocker).imag
    rate3 = -(np.conj(coupler) * dA).real / area
    rate2 = -(np.conj(rocker) * dA).real / area
    zeros = np.zeros_like(angle)
    poses, changes = [], []
    for centre, direction, bar, rate in (
        (A / 2, dA / 2, A, zeros + 1),
        (A + coupler / 2, dA + 1j * rate2 * coupler / 2, coupler, rate2),
        (GROUND + rocker / 2, 1j * rate3 * rocker / 2, rocker, rate3),
    ):
        poses += [centre.real, centre.imag, np.angle(bar)]
        changes += [direction.real, direction.imag, rate]
    return np.stack(poses, -1), np.stack(changes, -1)


def exact(t: NDArray[Any], harmonics: int = 512) -> NDArray[Any]:
    """lambda (samples, 8) [N] at the times t [s]."""
    inertia = np.repeat(MASSES, 3) * np.array(
        [1, 1, LENGTHS[0] ** 2 / 12, 1, 1, LENGTHS[1] ** 2 / 12, 1, 1, LENGTHS[2] ** 2 / 12]
    )

    def energies(angle: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        q, dq = _pose(angle)
        return (inertia * dq**2).sum(-1), GRAVITY * (np.array(MASSES) * q[:, 1::3]).sum(-1)

    J0, V0 = energies(np.array([pi / 2]))
    energy = J0 * OMEGA**2 / 2 + V0

    def slowness(angle: NDArray[Any]) -> NDArray[Any]:
        J, height = energies(angle)
        return np.sqrt(J / (2 * (energy - height)))

    nodes = 2 * pi * np.arange(2 * harmonics) / (2 * harmonics)
    series = np.fft.rfft(slowness(nodes))[:harmonics] / (2 * harmonics)
    k = np.arange(1, harmonics)
    mean, terms = series[0].real, series[1:] / (1j * k)

    def clock(angle: NDArray[Any]) -> NDArray[Any]:
        return mean * angle + 2 * (np.exp(1j * np.outer(angle, k)) @ terms).real

    begun = clock(np.array([pi / 2]))
    angle = pi / 2 + t / mean
    for _ in range(50):
        change = (clock(angle) - begun - t) / slowness(angle)
        angle = angle - change
        if np.abs(change).max() < 1e-14 * np.abs(angle).max():
            break
    system = lower(Form(derive(model)))
    p = [float(q.value) for q in model.parameters]
    q, dq = _pose(angle)
    v = dq / slowness(angle)[:, None]
    result = np.empty((len(t), system.m))
    for i in range(len(t)):
        M, F, G, _, gamma = system.assemble(float(t[i]), q[i], v[i], (), p)
        minv = 1 / np.diag(M)
        result[i] = np.linalg.solve((G * minv) @ G.T, gamma - G @ (minv * F))
    return result
