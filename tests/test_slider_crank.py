"""Slider-crank with a stiff, damped spring, through fmpy on the built FMU."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from instance import instance
from runs import evenly
from scipy.integrate import simpson, solve_ivp

DEFAULT = {"J": 0.1, "m": 1.0, "M": 1.0, "r": 0.1, "l": 0.3, "s": 0.2, "k": 1e6, "c": 1e4}


def turn(path, stop=1.0, points=100, tolerance=1e-8, **values):
    return evenly(path, stop, points, tolerance, values)


def alone(times, tau=0.0):
    """phi, y and their rates by the crank's own equation, without x and without a multiplier."""
    J, m, M, r, length, s, k, c = DEFAULT.values()

    def geometry(phi):
        """x, dx/dphi, d2x/dphi2."""
        sine, cosine = r * np.sin(phi), r * np.cos(phi)
        rod = np.sqrt(length**2 - sine**2)
        slope = -sine * cosine / rod
        bend = -(cosine**2 - sine**2) / rod - (sine * cosine) ** 2 / rod**3
        return cosine + rod, -sine + slope, -cosine + bend

    def rhs(_, state):
        phi, y, rate, speed = state
        x, first, second = geometry(phi)
        pull = k * (y - x - s) + c * (speed - first * rate)
        inertia = J + m * first**2
        return [
            rate,
            speed,
            (tau + first * (pull - m * second * rate**2)) / inertia,
            -pull / M,
        ]

    y0 = [0.0, 0.6, 10.0, 0.0]
    found = solve_ivp(rhs, (0, times[-1]), y0, "Radau", t_eval=times, rtol=1e-11, atol=1e-13)
    phi, y, rate, speed = found.y
    x, first, _ = geometry(phi)
    return phi, x, y, rate, first * rate, speed


@pytest.mark.parametrize("tau", [0.0, 2.0])
def test_it_moves_as_the_crank_and_the_load_alone(native_fmu, tau):
    """With x put in as r cos phi + sqrt(l^2 - r^2 sin^2 phi) there are two coordinates and no rod: the
    same motion, free and driven."""
    result = turn(native_fmu("SliderCrank"), points=20, tau=tau)
    names = ("phi", "x", "y", "der(phi)", "der(x)", "der(y)")
    for name, right in zip(names, alone(result["time"], tau), strict=True):
        assert np.abs(result[name] - right).max() < 1e-6 * np.abs(right).max(), name


@pytest.mark.parametrize("tau", [0.0, 2.0])
def test_what_the_energy_loses_heats_the_damper(native_fmu, tau):
    """E(0) - E(t) is the integral of c (y' - x')^2 less the torque's work, tau (phi - phi0): seen with a
    softer spring, which gives way enough to be heated."""
    result = turn(native_fmu("SliderCrank"), points=2000, tau=tau, k=1e4, c=1e2)
    heat = simpson(1e2 * (result["der(y)"] - result["der(x)"]) ** 2, x=result["time"])
    work = tau * (result["phi"][-1] - result["phi"][0])
    lost = result["energy.total"][0] - result["energy.total"][-1]
    assert heat > 0.01
    assert lost + work == pytest.approx(heat, rel=1e-4)


def test_the_load_follows_as_if_the_spring_were_rigid(native_fmu):
    """The stiffer the spring (with its damper in proportion), the nearer is the motion to that of one
    slider of mass m + M, which keeps (J + (m + M) (dx/dphi)^2) phi'^2: the miss falls as 1/k."""
    misses = []
    for k in (1e5, 1e6, 1e7):
        result = turn(native_fmu("SliderCrank"), k=k, c=k / 100)
        phi = result["phi"]
        rod = np.sqrt(0.09 - 0.01 * np.sin(phi) ** 2)
        slope = -0.1 * np.sin(phi) * (1 + 0.1 * np.cos(phi) / rod)
        rigid = 10 * np.sqrt(0.1 / (0.1 + 2 * slope**2))
        misses.append(np.abs(result["der(phi)"] - rigid).max())
    assert misses[2] < 1e-2
    for softer, stiffer in pairwise(misses):
        assert softer / stiffer == pytest.approx(10, rel=0.3)


@pytest.mark.parametrize("phi", [0.0, 0.1, 2.0])
def test_at_rest_it_stays_at_rest_and_costs_nothing(native_fmu, phi):
    """Without a torque slider and load rest anywhere, the spring at its length to the last bit or the bits
    beside it: what k = 1e6 N/m makes of a rounding, 1e-10 N, is nothing to be resolved."""
    slider = 0.1 * np.cos(phi) + np.sqrt(0.09 - 0.01 * np.sin(phi) ** 2)
    for method in ("radau", "auto"):
        for bits in (-1, 0, 1):
            with instance(native_fmu("SliderCrank")) as one:
                load = (slider + 0.2) * (1 + bits * np.finfo(float).eps)
                values = {"phi": phi, "x": slider, "y": load, "der(phi)": 0.0}
                one.start({**values, "solver.method": method})
                one.step(1.0)
                assert abs(one.get("phi") - phi) < 1e-14
                assert abs(one.get("der(x)")) < 1e-13
                assert abs(one.get("lambda.rod")) < 1e-9
                assert one.get("solver.steps") < 60, (method, bits)


@pytest.mark.parametrize("speed", [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6])
def test_however_slowly_it_turns_the_spring_costs_nothing(native_fmu, speed):
    """At 1e-4 rad/s the load's inertia bends the spring by 1e-15 m, less than y can tell: what rounding makes
    of it, 1e-10 N, is not resolved, and phi = omega t, but for the slider's share of the energy."""
    with instance(native_fmu("SliderCrank")) as one:
        one.start({"der(phi)": speed})
        for _ in range(10):
            one.step(0.1)
        assert one.get("solver.steps") < 200
        turned = one.get("phi") / speed
        assert turned == pytest.approx(1.0, rel=speed**2 / 10 + 1e-9)
        sway = 0.1 * one.get("der(phi)") * (0.1 / 0.3 + 1) * np.sin(one.get("phi"))
        assert one.get("der(y)") == pytest.approx(-sway, rel=speed**2 + 1e-6)
