"""Particle on a smooth hemisphere (Marion & Thornton, example 7.10), through fmpy on the built FMU."""

from __future__ import annotations

import numpy as np
import pytest
from instance import instance
from runs import simulate_fmu


def slide(path, theta0, tolerance=None, stop=10.0, points=1):
    """The motion from rest at theta0; `stop` in units of sqrt(a/g)."""
    stop *= np.sqrt(1 / 9.81)
    return simulate_fmu(
        path,
        stop_time=stop,
        output_interval=stop / points,
        step_size=stop / points,
        relative_tolerance=tolerance,
        start_values={"theta": theta0},
    )


def test_started_ever_nearer_to_the_top_it_leaves_at_two_thirds(native_fmu):
    """As theta0 -> 0 from rest the particle leaves at cos theta = 2/3, and what is missing falls as
    theta0^2/3."""
    for theta0 in (1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8):
        result = slide(native_fmu("Hemisphere"), theta0, 1e-12, stop=35.0)
        short = 2 / 3 - np.cos(result["departure.surface.theta"][-1])
        assert short == pytest.approx(theta0**2 / 3, rel=theta0**2, abs=1e-11)


def test_no_departure_no_departure_state(native_fmu):
    """Exactly on the top the particle balances: lambda = m g, and the departure is a finite zero."""
    result = slide(native_fmu("Hemisphere"), 0.0, points=5)
    assert (result["contact.surface"]).all()
    np.testing.assert_allclose(result["lambda.surface"], 9.81, rtol=1e-14)
    for name in ("count", "time", "r", "theta", "velocity.r", "velocity.theta"):
        assert (result[f"departure.surface.{name}"] == 0).all()


@pytest.mark.parametrize(
    ("a", "r", "theta", "speed"),
    [
        (0.5, 1.25, 1.4, 0.25),
        *((1.0, 1.0, 0.3, np.sqrt(share * 9.81 * np.cos(0.3))) for share in (1 + 1e-6, 1.1, 4.0)),
    ],
)
def test_above_the_sphere_or_too_fast_for_it_the_particle_flies(native_fmu, a, r, theta, speed):
    """r = 1.25 over a sphere of a = 0.5, or v0^2 > g a cos theta0: free flight from the start, a parabola;
    nothing is moved, lambda is 0, and no departure is counted."""
    start = {"a": a, "r": r, "theta": theta, "der(theta)": speed / r}
    with instance(native_fmu("Hemisphere")) as one:
        one.start(start, tolerance=1e-12)
        assert one.get("r") == r
        assert one.get("residual.surface") == r - a
        assert one.log == []
    run = simulate_fmu(
        native_fmu("Hemisphere"),
        stop_time=0.3,
        output_interval=0.01,
        relative_tolerance=1e-12,
        start_values=start,
    )
    assert not run["contact.surface"].any()
    assert (run["lambda.surface"] == 0).all()
    assert (run["departure.surface.count"] == 0).all()
    t = run["time"]
    x = r * np.sin(theta) + speed * np.cos(theta) * t
    z = r * np.cos(theta) - speed * np.sin(theta) * t - 9.81 * t**2 / 2
    np.testing.assert_allclose(run["r"] * np.sin(run["theta"]), x, rtol=0, atol=1e-11)
    np.testing.assert_allclose(run["r"] * np.cos(run["theta"]), z, rtol=0, atol=1e-11)


@pytest.mark.parametrize(("rise", "rests"), [(1e-15, True), (1e-13, False), (1e-6, False)])
def test_what_parts_too_slowly_to_be_seen_rests(native_fmu, rise, rests):
    """At the top it would rise by v^2/(2 g): by less than 64 roundings (2.2e-16) of the radius it
    rests as after an impact, lambda = m g, instead of a flight that ends at no certain time; by more, it
    flies, and lands to rest."""
    with instance(native_fmu("Hemisphere")) as one:
        one.start({"theta": 0.0, "der(r)": np.sqrt(2 * 9.81 * rise)})
        assert bool(one.get("contact.surface")) == rests
        assert one.get("lambda.surface") == pytest.approx(9.81 if rests else 0.0, rel=1e-12)
        one.step(0.01)
        assert one.get("contact.surface")
        assert one.get("lambda.surface") == pytest.approx(9.81, rel=1e-9)
