"""Particle on a smooth hemisphere (Marion & Thornton, example 7.10), through fmpy on the built FMU."""

from __future__ import annotations

import numpy as np
import pytest
from instance import instance
from runs import simulate_fmu
from scipy.integrate import quad

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


@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_the_motion_does_not_depend_on_the_unit_of_length(native_fmu, factor):
    """A sphere and a gravity 1e6 times as large or small, in metres, are the same motion: same times
    and angles, lengths in proportion, forces too."""
    world = {"m": 1.0, "g": 9.81 * factor, "a": factor}
    here, there = (
        slide(native_fmu("Hemisphere"), w, 0.1, 0.2, 1e-10, 3.0, 20) for w in (EARTH, world)
    )
    for name, unit in (
        ("departure.surface.time", 1.0),
        ("departure.surface.theta", 1.0),
        ("theta", 1.0),
        ("r", factor),
        ("lambda.surface", factor),
        ("energy.total", factor**2),
    ):
        np.testing.assert_allclose(there[name] / unit, here[name], rtol=1e-9, atol=1e-9)


def test_started_ever_nearer_to_the_top_it_leaves_at_two_thirds(native_fmu):
    """As theta0 -> 0 from rest the particle leaves at cos theta = 2/3, and what is missing falls as
    theta0^2/3."""
    for theta0 in (1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8):
        result = slide(native_fmu("Hemisphere"), EARTH, theta0, tolerance=1e-12, stop=35.0)
        short = 2 / 3 - np.cos(result["departure.surface.theta"][-1])
        assert short == pytest.approx(theta0**2 / 3, rel=theta0**2, abs=1e-11)


@pytest.mark.parametrize("theta0", [0.01, 0.5])
def test_the_time_of_departure_does_not_depend_on_the_communication_step(native_fmu, theta0):
    """When the particle leaves is physics: communication steps of 1 ms, 50 ms and a single one over
    the whole run give the same time, which is the integral of d theta/theta'."""
    stop = 2.0
    times = [
        simulate_fmu(
            str(native_fmu("Hemisphere")),
            stop_time=stop,
            output_interval=step,
            step_size=step,
            relative_tolerance=1e-10,
            start_values={"theta": theta0},
        )["departure.surface.time"][-1]
        for step in (1e-3, 0.05, stop)
    ]
    assert max(times) - min(times) < 1e-9
    assert times[0] == pytest.approx(slide_time(theta0, 9.81), abs=1e-9)


def slide_time(theta0, g):
    """Integral of d theta/theta' from theta0 to the departure, a = 1 m; with theta = theta0 + u^2,
    theta'^2 = 4 g sin((theta + theta0)/2) sin((theta - theta0)/2) leaves no singularity."""

    def pace(u):
        half = u**2 / 2
        slow = np.sin(half) / u**2 if u else 0.5
        return 2 / np.sqrt(4 * g * np.sin(theta0 + half) * slow)

    end = np.sqrt(np.arccos(2 / 3 * np.cos(theta0)) - theta0)
    return quad(pace, 0, end, points=[end / 10], epsabs=1e-13, epsrel=1e-13)[0]


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
