"""Ladder that slides down a smooth wall, through fmpy on the built FMU."""

from __future__ import annotations

import numpy as np
import pytest
from instance import instance
from runs import simulate_fmu
from scipy.integrate import quad, solve_ivp

from lagfmu import verify

G = 9.81
CASES = {  # m [kg], l [m], theta0 [rad], share of the rate at which it would leave the wall at once
    "default": (10.0, 2.0, 1.2, 0.0),
    "steep": (10.0, 2.0, 1.5, 0.0),
    "flat": (0.3, 50.0, 0.2, 0.0),
    "pushed": (10.0, 1e-3, 1.0, 0.5),
    "nearly off": (2.0, 3.0, 0.8, 0.999),
}
EVERY = pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())


def rate0(case):
    """theta' [rad/s] at the start: the wall's force ends where l theta'^2 = (3/2) g sin theta."""
    _, length, theta0, share = case
    return -np.sqrt(share * 1.5 * G / length * np.sin(theta0))


def slide(path, case, tolerance=1e-12, stop=6.0, points=1):
    m, length, theta0, _ = case
    rate, stop = rate0(case), stop * np.sqrt(length / G)
    start = {
        "theta": theta0,
        "x": length / 2 * np.cos(theta0),
        "y": length / 2 * np.sin(theta0),
        "der(theta)": rate,
        "der(x)": -length / 2 * np.sin(theta0) * rate,
        "der(y)": length / 2 * np.cos(theta0) * rate,
    }
    return simulate_fmu(
        str(path),
        stop_time=stop,
        output_interval=stop / points,
        step_size=stop / points,
        relative_tolerance=tolerance,
        start_values={"m": m, "l": length, "g": G, **start},
    )


def highest(case):
    """sin theta at which the wall's force ends."""
    _, length, theta0, _ = case
    return 2 / 3 * np.sin(theta0) + 2 / 9 * length / G * rate0(case) ** 2


@EVERY
@pytest.mark.parametrize(("tolerance", "allowed"), [(None, 1e-7), (1e-12, 1e-11)])
def test_it_leaves_the_wall_at_two_thirds_of_its_height(native_fmu, case, tolerance, allowed):
    """The upper end leaves the wall at sin theta = (2/3) sin theta0 + (2/9)(l/g) theta0'^2, with
    theta'^2 = (3/2)(g/l) sin theta there, once; the lower end never leaves the floor."""
    last = slide(native_fmu("Ladder"), case, tolerance)[-1]
    assert last["departure.wall.count"] == 1
    assert last["departure.floor.count"] == 0
    height = np.sin(last["departure.wall.theta"])
    assert abs(height - highest(case)) < allowed
    square = last["departure.wall.velocity.theta"] ** 2
    assert square * case[1] / G == pytest.approx(1.5 * height, rel=100 * allowed)


@EVERY
def test_the_forces_of_wall_and_floor(native_fmu, case):
    """At the wall, with theta'^2 = theta0'^2 + 3 (g/l)(sin theta0 - sin theta): the wall gives m x''
    and the floor m (g + y'').  Falling off the wall it has m (g - (l/2) sin theta theta'^2)/(1 + 3
    cos(theta)^2) from the floor and nothing from the side.  Lying, half the weight at either end."""
    result = slide(native_fmu("Ladder"), case, stop=4.0, points=400)
    m, length, theta0, _ = case
    s, c = np.sin(result["theta"]), np.cos(result["theta"])
    square = rate0(case) ** 2 + 3 * G / length * (np.sin(theta0) - s)
    wall = m * length / 2 * c * (1.5 * G / length * s - square)
    floor = m * G - m * length / 2 * (1.5 * G / length * c**2 + s * square)
    falling = m * (G - length / 2 * s * result["der(theta)"] ** 2) / (1 + 3 * c**2)
    at_wall, lying = result["contact.wall"], result["contact.top"]
    between = ~at_wall & ~lying
    assert min(at_wall.sum(), between.sum(), lying.sum()) >= 1
    unit = 1e-11 * m * G
    assert np.abs(result["lambda.wall"] - wall)[at_wall].max() < unit
    assert np.abs(result["lambda.floor"] - floor)[at_wall].max() < unit
    assert np.abs(result["lambda.floor"] - falling)[between].max() < unit
    assert (result["lambda.wall"][~at_wall] == 0).all()
    assert (result["lambda.top"][~lying] == 0).all()
    for name in ("lambda.floor", "lambda.top"):
        np.testing.assert_allclose(result[name][lying], m * G / 2, rtol=1e-12)
    assert (result["lambda.floor"] > 0).all()
    assert result["contact.floor"].all()


@EVERY
def test_off_the_wall_it_slides_evenly_to_the_end_and_beyond(native_fmu, case):
    """Nothing pushes it sideways any more: x' keeps the value of the departure, also when it lies; the
    fall ends flat, theta = 0, without a rebound."""
    result = slide(native_fmu("Ladder"), case, stop=4.0, points=400)
    length, last = case[1], result[-1]
    off, lying = ~result["contact.wall"], result["contact.top"]
    speed = last["departure.wall.velocity.x"]
    assert speed == pytest.approx(
        -length / 2 * highest(case) * last["departure.wall.velocity.theta"], rel=1e-10
    )
    np.testing.assert_allclose(result["der(x)"][off], speed, rtol=1e-12)
    tau = (result["time"] - last["departure.wall.time"])[off]
    path = last["departure.wall.x"] + speed * tau
    np.testing.assert_allclose(result["x"][off], path, rtol=1e-12)
    for name, unit in (("theta", 1.0), ("y", length), ("der(theta)", np.sqrt(G / length))):
        assert np.abs(result[name][lying]).max() < 1e-14 * unit
    energy = result["energy.total"][~lying]
    assert np.abs(energy - energy[0]).max() < 1e-11 * energy[0]
    assert result["energy.total"][-1] == pytest.approx(case[0] * speed**2 / 2, rel=1e-12)


def test_the_times_are_those_of_the_angle_alone(native_fmu):
    """theta'' = -(3/2)(g/l) cos theta at the wall, integrated alone, reaches the departure and (with the
    floor's equation from there) the floor when the FMU says."""
    case = CASES["default"]  # as the FMU starts
    length, theta0 = case[1], case[2]
    square = lambda s: 3 * G / length * (np.sin(theta0) - s)  # noqa: E731
    end = np.sqrt(theta0 - np.arcsin(highest(case)))

    def pace(u):  # theta = theta0 - u^2
        s = np.sin(theta0 - u**2)
        return 2 * u / np.sqrt(square(s))

    time = quad(pace, 0, end, epsabs=1e-12, epsrel=1e-12)[0]

    def fall(_, y):
        theta, rate = y
        s, c = np.sin(theta), np.cos(theta)
        force = (G - length / 2 * s * rate**2) / (1 + 3 * c**2)
        return [rate, -6 * c * force / length]

    def flat(_, y):
        return y[0]

    flat.terminal = True
    s = highest(case)
    y0 = [np.arcsin(s), -np.sqrt(square(s))]
    ended = solve_ivp(fall, (0, 2), y0, "DOP853", events=flat, rtol=1e-13, atol=1e-13)
    landing = time + ended.t_events[0][0]
    with instance(native_fmu("Ladder")) as one:
        one.start(tolerance=1e-12)
        one.step(landing - 1e-9)
        assert one.get("departure.wall.time") == pytest.approx(time, abs=1e-10)
        assert not one.get("contact.top")
        one.step(2e-9)
        assert one.get("contact.top")


def test_upright_it_stands(native_fmu):
    """Exactly upright the ladder balances on the floor, which carries it all, and leans on nothing."""
    result = slide(native_fmu("Ladder"), (10.0, 2.0, np.pi / 2, 0.0), stop=2.0, points=10)
    np.testing.assert_allclose(result["lambda.floor"], 10 * G, rtol=1e-12)
    assert np.abs(result["lambda.wall"]).max() < 1e-12
    np.testing.assert_allclose(result["theta"], np.pi / 2, rtol=1e-14)


@pytest.mark.parametrize(
    "start",
    [{"theta": 1e-8 - np.pi / 2}, {"l": 0.002}, {"theta": 2.0}],
    ids=["on its upper end", "dropped from 465 lengths", "leaning the other way"],
)
def test_its_forces_from_the_state_in_every_mode(native_fmu, start):
    """Standing on either end alone, at the wall or off it, and lying: the closed forms hold."""
    found = verify(native_fmu("Ladder"), start_values=start)
    assert found.passed, [c for c in found.checks if not c.passed]
    points = {c.name: c.points for c in found.checks}
    assert points["lambda.top"] + points["lambda.floor from the state"] > 50
