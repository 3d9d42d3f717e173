"""The equations without multipliers: lambda drops out, the motion does not change."""

from __future__ import annotations

import random
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from conftest import scene_of
from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import EquationsOfMotion, Holonomic, Model, Nonholonomic, Parameter, derive
from lagfmu.testing import lambda_free, null_space

x, y, z, r, theta, phi, psi = dynamicsymbols("x y z r theta phi psi")
m, g, L, a, R, J = symbols("m g L a R J", positive=True)
STANDARD = [Parameter(m, 1.3, "kg"), Parameter(g, 9.81, "m/s^2")]

coin = Model(  # upright rolling disk: two nonholonomic constraints, four coordinates
    name="Coin",
    kinetic_energy=m * (x.diff() ** 2 + y.diff() ** 2) / 2
    + J * (phi.diff() ** 2 + 2 * psi.diff() ** 2) / 2,
    forces={x: m * g / 10},
    coordinates={x: "m", y: "m", phi: "rad", psi: "rad"},
    constraints=[
        Nonholonomic("along", x.diff() - R * cos(psi) * phi.diff()),
        Nonholonomic("across", y.diff() - R * sin(psi) * phi.diff()),
    ],
    parameters=[*STANDARD, Parameter(R, 0.7, "m"), Parameter(J, 0.4, "kg.m2")],
)
two_links = Model(  # two particles on rods in space, tied one to the other: three rows, six columns
    name="TwoLinks",
    lagrangian=m * (x.diff() ** 2 + y.diff() ** 2 + z.diff() ** 2) / 2
    + 2 * m * (r.diff() ** 2 + a * a * theta.diff() ** 2) / 2
    - m * g * (y + z)
    + m * g * r * cos(theta),
    coordinates={x: "m", y: "m", z: "m", r: "m", theta: "rad"},
    constraints=[
        Holonomic("rod", x**2 + y**2 + z**2 - L**2),
        Holonomic("slot", x - r * sin(theta)),
    ],
    parameters=[*STANDARD, Parameter(L, 1.0, "m"), Parameter(a, 0.5, "m")],
)
pendulum, hemisphere = (scene_of(n)[0].model for n in ("PendulumCartesian", "Hemisphere"))
MODELS = [pendulum, hemisphere, coin, two_links]


def numbers(eom: EquationsOfMotion, seed: int) -> dict[sp.Symbol, float]:
    """A random state, with the parameters' values."""
    generator = random.Random(seed)
    point = {s: generator.uniform(-2, 2) for s in (*eom.q, *eom.v)}
    return point | {p.symbol: float(p.value) for p in eom.model.parameters}


def array(expressions: object, point: dict[sp.Symbol, float]) -> np.ndarray:
    return np.array(sp.Matrix(expressions).subs(point).tolist(), dtype=float)


def test_pendulum_obeys_equation_9_of_the_lecture():
    """y x'' - x y'' - g x = 0 and x x'' + y y'' + x'^2 + y'^2 = 0 (ME 6590, eq. 9)."""
    eom = derive(pendulum)
    (X, Y), (vx, vy), (ax, ay) = eom.q, eom.v, eom.vdot
    expected = [Y * ax - X * ay - g * X, X * ax + Y * ay + vx**2 + vy**2]
    assert [sp.expand(e) for e in lambda_free(eom)] == expected


def test_particle_on_the_hemisphere_falls_along_theta_alone():
    """r theta'' + 2 r' theta' - g sin theta = 0 while r'' = 0: the surface does no work."""
    eom = derive(hemisphere)
    (rr, th), (vr, vt), (ar, at) = eom.q, eom.v, eom.vdot
    along, across = lambda_free(eom)
    assert sp.expand(along - (rr * at + 2 * vr * vt - g * sin(th))) == 0
    assert across == ar


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
def test_virtual_velocities_meet_the_constraints(model):
    """Each column of S is a virtual velocity: G S = 0, and N = n - m of them are independent."""
    eom = derive(model)
    S = null_space(eom)
    assert S.shape == (eom.nv, eom.nv - eom.m)
    for seed in range(5):
        point = numbers(eom, seed)
        G, s = array(eom.G, point), array(S, point)
        assert np.abs(G @ s).max() <= 1e-13 * np.abs(G).max() * np.abs(s).max()
        assert np.linalg.matrix_rank(s) == eom.nv - eom.m


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
def test_motion_is_the_one_with_multipliers(model):
    """The accelerations without lambda are those of M v' - G^T lambda = F, G v' = gamma."""
    eom = derive(model)
    vdot = eom.vdot
    left, right = sp.linear_eq_to_matrix(lambda_free(eom), vdot)
    for seed in range(5):
        point = numbers(eom, seed)
        M, G = array(eom.M, point), array(eom.G, point)
        kkt = np.block([[M, -G.T], [G, np.zeros((eom.m, eom.m))]])
        expected = np.linalg.solve(kkt, array([*eom.F, *eom.gamma], point))[: eom.nv]
        found = np.linalg.solve(array(left, point), array(right, point))
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


def test_doubled_rod_is_one_rod():
    """A constraint that is given twice takes away one degree of freedom, not two."""
    again = Holonomic("again", 2 * (x**2 + y**2 - L**2))
    doubled = replace(pendulum, constraints=[*pendulum.constraints, again])
    assert null_space(derive(doubled)) == null_space(derive(pendulum))
