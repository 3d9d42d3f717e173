"""Knife edge sliding on an incline (nonholonomic), through fmpy on the built FMU."""

from __future__ import annotations

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from instance import instance
from runs import simulate_fmu
from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Contact, Model, Nonholonomic, Parameter, build_fmu, simulate
from lagfmu.errors import SimulationError

DEFAULT = {"m": 1.0, "J": 0.1, "g": 9.81, "alpha": np.pi / 6}
OTHER = {"m": 70.0, "J": 2.5, "g": 3.7, "alpha": 0.1}
TINY = {"m": 1e-3, "J": 1e-7, "g": 9.81, "alpha": 1.2}

# world, omega [rad/s], phi0 [rad], u0 [m/s]
CASES = {
    "from rest": (DEFAULT, 1.0, 0.0, 0.0),
    "skating": (OTHER, -0.8, 2.0, 3.0),
    "spinning": (TINY, 9.0, -1.0, -0.2),
}
EVERY = pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())


def skate(path, case, stop=6.0, tolerance=1e-12):
    world, omega, phi0, u0 = case
    return simulate_fmu(
        str(path),
        stop_time=stop,
        output_interval=stop / 120,
        step_size=stop / 120,
        relative_tolerance=tolerance,
        start_values={
            **world,
            "phi": phi0,
            "der(phi)": omega,
            "der(x)": u0 * np.cos(phi0),
            "der(y)": u0 * np.sin(phi0),
        },
    )


@EVERY
@pytest.mark.parametrize(("tolerance", "allowed"), [(None, 1e-6), (1e-12, 1e-11)])
def test_the_blade_drifts_across_the_slope(native_fmu, case, tolerance, allowed):
    """phi = phi0 + w t; the speed along the blade is u = u0 + (G/w)(sin phi - sin phi0) with
    G = g sin alpha; from rest x = (G/2w^2) sin^2 wt and y = (G/2w)(t - sin(2wt)/(2w)): a cycloid."""
    (world, w, phi0, u0) = case
    result = skate(native_fmu("KnifeEdge"), case, tolerance=tolerance)
    t = result["time"]
    G = world["g"] * np.sin(world["alpha"])
    phi = phi0 + w * t
    b = u0 - G / w * np.sin(phi0)
    u = b + G / w * np.sin(phi)
    # x' = u cos phi and y' = u sin phi, integrated over phi
    x = (b * np.sin(phi) + G / (2 * w) * np.sin(phi) ** 2) / w
    y = (-b * np.cos(phi) + G / (2 * w) * (phi - np.sin(2 * phi) / 2)) / w
    speed = abs(b) + G / abs(w)
    far = max(np.ptp(x), np.ptp(y))
    assert np.abs(result["phi"] - phi).max() <= 1e-13 * np.abs(phi).max()
    assert np.abs(result["x"] - (x - x[0])).max() < allowed * far
    assert np.abs(result["y"] - (y - y[0])).max() < allowed * far
    along = result["der(x)"] * np.cos(phi) + result["der(y)"] * np.sin(phi)
    assert np.abs(along - u).max() < allowed * speed
    if case is CASES["from rest"]:
        np.testing.assert_allclose(x - x[0], G / 2 * np.sin(t) ** 2, atol=1e-14)
        np.testing.assert_allclose(y - y[0], G / 2 * (t - np.sin(2 * t) / 2), atol=1e-14)


@EVERY
def test_lambda_is_the_sideways_force_on_the_blade(native_fmu, case):
    """lambda = -m (w u0 + G (2 sin phi - sin phi0)) [N]: from rest -2 m g sin(alpha) sin wt, twice
    the component of the weight, because the blade also turns the motion."""
    (world, w, phi0, u0) = case
    result = skate(native_fmu("KnifeEdge"), case)
    G = world["g"] * np.sin(world["alpha"])
    phi = phi0 + w * result["time"]
    expected = -world["m"] * (w * u0 + G * (2 * np.sin(phi) - np.sin(phi0)))
    top = np.abs(expected).max()
    assert np.abs(result["lambda.edge"] - expected).max() < 1e-11 * top
    assert np.abs(result["Q.x"] - expected * np.sin(phi)).max() < 1e-11 * top
    assert np.abs(result["Q.y"] + expected * np.cos(phi)).max() < 1e-11 * top
    assert (result["Q.phi"] == 0).all()


@EVERY
def test_the_blade_never_slides_sideways_and_the_force_does_no_work(native_fmu, case):
    """x' sin phi - y' cos phi = 0 at rounding level, Q is at right angles to the motion, and the
    energy is constant: the constraint holds velocities, not places."""
    result = skate(native_fmu("KnifeEdge"), case)
    speed = np.hypot(result["der(x)"], result["der(y)"]).max()
    assert np.abs(result["residual.edge"]).max() <= 4e-16 * speed
    power = result["Q.x"] * result["der(x)"] + result["Q.y"] * result["der(y)"]
    assert np.abs(power).max() <= 1e-15 * np.abs(result["lambda.edge"]).max() * speed
    energy = result["energy.total"]
    assert np.abs(energy - energy[0]).max() < 1e-11 * result["energy.kinetic"].max()


def test_a_sideways_velocity_is_taken_away(native_fmu):
    """Thrown across the blade at the start, it keeps only the part along the blade."""
    result = simulate_fmu(
        str(native_fmu("KnifeEdge")),
        stop_time=0.1,
        output_interval=0.1,
        start_values={"phi": 0.5, "der(x)": 1.0, "der(y)": 2.0},
    )
    along = np.cos(0.5) + 2 * np.sin(0.5)
    assert result["der(x)"][0] == pytest.approx(along * np.cos(0.5), rel=1e-14)
    assert result["der(y)"][0] == pytest.approx(along * np.sin(0.5), rel=1e-14)


def test_a_blade_parallel_to_its_wall_is_named(tmp_path):
    """On the wall y = 0 a blade at phi != 0 holds x too, and lambda.blade = -F / sin(phi) grows without bound
    as it turns; where it is parallel, blade and wall are one row that asks for two accelerations."""
    x, y, phi = dynamicsymbols("x y phi")
    m, g, J, F = symbols("m g J F", positive=True)
    model = Model(
        name="Blade",
        lagrangian=m * (x.diff() ** 2 + y.diff() ** 2) / 2
        + J * phi.diff() ** 2 / 2
        - m * g * y
        + F * x,
        coordinates={x: "m", y: "m", phi: "rad"},
        constraints=[
            Nonholonomic("blade", x.diff() * sin(phi) - y.diff() * cos(phi)),
            Contact("wall", y),
        ],
        parameters=[
            Parameter(m, 1.0, "kg"),
            Parameter(g, 9.81, "m/s^2"),
            Parameter(J, 0.05, "kg.m^2"),
            Parameter(F, 1.0, "N"),
        ],
        start={phi: -0.5, phi.diff(): 0.5},
    )
    path = build_fmu(model, tmp_path, target="native", check=False)
    named = "'blade', 'wall' depend on each other"
    with instance(path) as one:
        with pytest.raises(FMICallException):
            one.start({"phi": 0.0, "der(x)": 1.0})
        assert named in one.log[-1][2]
        assert "the configuration is singular" in one.log[-1][2]
    with pytest.raises(SimulationError, match=named):
        simulate(path, start_values={"solver.method": "rk4"}, stop_time=1.7, step_size=0.1)
