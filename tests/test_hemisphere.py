"""Particle on a smooth hemisphere (Marion & Thornton, example 7.10), through fmpy on the built FMU."""

from __future__ import annotations

import numpy as np
import pytest
from instance import instance
from runs import simulate_fmu

# m [kg], g [m/s^2], a [m]
EARTH = {"m": 1.0, "g": 9.81, "a": 1.0}


def slide(path, world, theta0, share=0.0, tolerance=None, stop=14.0, points=1):
    """The motion from theta0 with v0^2 = share * g a cos(theta0); `stop` in units of sqrt(a/g)."""
    m, g, a = world["m"], world["g"], world["a"]
    rate = np.sqrt(share * g / a * np.cos(theta0))
    stop *= np.sqrt(a / g)
    return simulate_fmu(
        str(path),
        stop_time=stop,
        output_interval=stop / points,
        step_size=stop / points,
        relative_tolerance=tolerance,
        start_values={"m": m, "g": g, "a": a, "r": a, "theta": theta0, "der(theta)": rate},
    )


def test_started_ever_nearer_to_the_top_it_leaves_at_two_thirds(native_fmu):
    """As theta0 -> 0 from rest the particle leaves at cos theta = 2/3, and what is missing falls as
    theta0^2/3."""
    for theta0 in (1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8):
        result = slide(native_fmu("Hemisphere"), EARTH, theta0, tolerance=1e-12, stop=35.0)
        short = 2 / 3 - np.cos(result["departure.surface.theta"][-1])
        assert short == pytest.approx(theta0**2 / 3, rel=theta0**2, abs=1e-11)


def test_no_departure_no_departure_state(native_fmu):
    """Exactly on the top the particle balances: lambda = m g, and the departure is a finite zero."""
    result = slide(native_fmu("Hemisphere"), EARTH, 0.0, stop=10.0, points=5)
    assert (result["contact.surface"]).all()
    np.testing.assert_allclose(result["lambda.surface"], 9.81, rtol=1e-14)
    for name in ("count", "time", "r", "theta", "velocity.r", "velocity.theta"):
        assert (result[f"departure.surface.{name}"] == 0).all()


# ------------------------------------------------------------------------------------ the start


def parabola(t, radius, theta0, speed, g):
    """x and z of a particle thrown along the tangent from (radius, theta0) with `speed`."""
    x = radius * np.sin(theta0) + speed * np.cos(theta0) * t
    z = radius * np.cos(theta0) - speed * np.sin(theta0) * t - g * t**2 / 2
    return x, z


def check_parabola(result, radius, theta0, speed, g=9.81):
    x, z = parabola(result["time"], radius, theta0, speed, g)
    r, theta = result["r"], result["theta"]
    assert np.abs(r * np.sin(theta) - x).max() < 1e-11
    assert np.abs(r * np.cos(theta) - z).max() < 1e-11


def test_a_start_above_the_sphere_is_in_flight(native_fmu):
    """r = 1.25 over a sphere of a = 0.5: the particle is in free flight from the start, nothing is moved,
    lambda is 0, and no departure is counted."""
    with instance(native_fmu("Hemisphere")) as one:
        one.start({"a": 0.5, "r": 1.25, "theta": 1.4}, tolerance=1e-12)
        assert one.get("r") == 1.25
        assert not one.get("contact.surface")
        assert one.get("lambda.surface") == 0
        assert one.get("residual.surface") == 0.75
        assert one.log == []
    result = simulate_fmu(
        str(native_fmu("Hemisphere")),
        stop_time=0.3,
        output_interval=0.01,
        relative_tolerance=1e-12,
        start_values={"a": 0.5, "r": 1.25, "theta": 1.4, "der(theta)": 0.2},
    )
    assert not result["contact.surface"].any()
    assert (result["lambda.surface"] == 0).all()
    assert (result["departure.surface.count"] == 0).all()
    check_parabola(result, 1.25, 1.4, 1.25 * 0.2)


@pytest.mark.parametrize("share", [1 + 1e-6, 1.1, 4.0])
def test_too_fast_for_the_sphere_it_flies_at_once(native_fmu, share):
    """With v0^2 > g a cos theta0 gravity cannot hold the particle on the sphere: it starts open and
    flies a parabola, and since it was never on the surface no departure is counted."""
    theta0 = 0.3
    result = slide(native_fmu("Hemisphere"), EARTH, theta0, share, 1e-12, 1.0, 20)
    assert not result["contact.surface"].any()
    assert (result["lambda.surface"] == 0).all()
    assert (result["departure.surface.count"] == 0).all()
    assert (result["residual.surface"] >= 0).all()
    check_parabola(result, 1.0, theta0, np.sqrt(share * 9.81 * np.cos(theta0)))


@pytest.mark.parametrize(("rise", "rests"), [(1e-13, True), (1e-6, False)])
def test_what_parts_too_slowly_to_be_seen_rests(native_fmu, rise, rests):
    """At the top it would rise by v^2/(2 g): by less than the gap within which contacts touch, 1e-9 of the
    radius, it rests as after an impact, lambda = m g, instead of a flight that ends at no certain time;
    by more, it flies."""
    with instance(native_fmu("Hemisphere")) as one:
        one.start({"theta": 0.0, "der(r)": np.sqrt(2 * 9.81 * rise)})
        assert bool(one.get("contact.surface")) == rests
        assert one.get("lambda.surface") == pytest.approx(9.81 if rests else 0.0, rel=1e-12)
