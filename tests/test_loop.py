"""Particle on the inside of a vertical loop, through fmpy on the built FMU."""

from __future__ import annotations

import numpy as np
import pytest
from instance import instance
from runs import evenly
from scipy.integrate import quad, solve_ivp
from scipy.special import ellipk

WORLDS = {  # m [kg], g [m/s^2], a [m]
    "earth": {"m": 1.0, "g": 9.81, "a": 1.0},
    "moon": {"m": 3e-3, "g": 1.62, "a": 25.0},
    "tiny": {"m": 1e3, "g": 9.81, "a": 1e-6},
}
EVERY = pytest.mark.parametrize("world", WORLDS.values(), ids=WORLDS.keys())
ACCURACY = pytest.mark.parametrize(("tolerance", "allowed"), [(None, 1e-6), (1e-12, 1e-10)])


def run(path, world, square, tolerance=1e-12, stop=6.0, points=1):
    """From the bottom with v0^2 = square * g a; `stop` in units of sqrt(a/g)."""
    g, a = world["g"], world["a"]
    stop *= np.sqrt(a / g)
    return evenly(
        path,
        stop,
        points,
        tolerance,
        {**world, "x": 0.0, "y": -a, "der(x)": np.sqrt(square * g * a)},
    )


@EVERY
@ACCURACY
@pytest.mark.parametrize("square", [2 + 1e-6, 2.0001, 2.001, 2.01, 2.1])
def test_a_short_departure_is_not_stepped_over(native_fmu, world, square, tolerance, allowed):
    """A little faster than to the height of the centre, the particle pulls at the loop for a moment
    only, where it turns round: it leaves and comes back, however long the steps."""
    a = world["a"]
    last = run(native_fmu("Loop"), world, square, tolerance, 4.0)[-1]
    assert last["departure.loop.count"] == 1
    assert abs(last["departure.loop.y"] - a * (square - 2) / 3) < allowed * a


@pytest.mark.parametrize("square", [5.0 + 1e-9, 5.1, 7.0, 100.0])
def test_fast_enough_it_never_leaves(native_fmu, square):
    """With v0^2 > 5 g a the loop pushes all the way round, six times the weight harder at the bottom
    than at the top, turn after turn."""
    result = run(native_fmu("Loop"), WORLDS["earth"], square, 1e-12, 30.0, 500)
    assert result["contact.loop"].all()
    assert result["departure.loop.count"][-1] == 0
    force = 9.81 * (square - 2 - 3 * result["y"])
    assert np.abs(result["lambda.loop"] - force).max() < 1e-9 * square
    assert np.abs(np.hypot(result["x"], result["y"]) - 1).max() < 1e-15
    assert (np.abs(np.unwrap(np.arctan2(result["x"], -result["y"]))[-1])) > 4 * np.pi


def test_just_fast_enough_either_verdict_is_the_same_motion(native_fmu):
    """With v0^2 = 5 g a the force touches zero at the top: whether the contact is called open or closed
    there, the particle goes on round the loop, and is back at the bottom with v0 after the integral
    of d theta over theta' = sqrt((g/a)(3 + 2 cos theta))."""
    period = 2 * quad(lambda s: 1 / np.sqrt(9.81 * (3 + 2 * np.cos(s))), 0, np.pi)[0]
    for tolerance, allowed in ((1e-8, 1e-6), (1e-12, 1e-7)):
        with instance(native_fmu("Loop")) as one:
            speed = np.sqrt(5 * 9.81)
            one.start({"der(x)": speed}, tolerance=tolerance)
            one.step(period)
            assert one.get("x") == pytest.approx(0, abs=allowed)
            assert one.get("y") == pytest.approx(-1, abs=allowed)
            assert one.get("der(x)") == pytest.approx(speed, rel=allowed)


@pytest.mark.parametrize("square", [0.01, 1.0, 1.999])
def test_too_slow_for_the_upper_half_it_swings(native_fmu, square):
    """With v0^2 < 2 g a it turns round below the centre's height and swings as a pendulum does, with the
    period 4 sqrt(a/g) K(v0/(2 sqrt(g a))) and without ever leaving."""
    period = 4 * ellipk(square / 4)
    result = run(native_fmu("Loop"), WORLDS["earth"], square, 1e-12, 2 * period, 2)
    assert result["contact.loop"].all()
    np.testing.assert_allclose(result["x"], 0, atol=1e-10)
    np.testing.assert_allclose(result["der(x)"], np.sqrt(square * 9.81), rtol=1e-10)


@EVERY
@pytest.mark.parametrize("square", [2.2, 2 + np.sqrt(3), 4.5])
def test_off_the_loop_it_flies_a_parabola_and_meets_it_at_three_times_the_angle(
    native_fmu, world, square
):
    """Leaving at the angle alpha above the horizontal, the particle flies a parabola (models/loop.py) that
    meets the loop again after 4 sqrt(a/g) sqrt(sin alpha) cos alpha, 3 alpha below the horizontal (and
    through the very centre if v0^2 = (2 + sqrt 3) g a); there it loses the speed across the loop and
    slides on with m v^2/a + m g cos theta."""
    result = run(native_fmu("Loop"), world, square, 1e-12, 6.0, 300)
    m, g, a = world["m"], world["g"], world["a"]
    first = result[result["departure.loop.count"] == 1]
    t0 = first["departure.loop.time"][0]
    sine = (square - 2) / 3
    alpha = np.arcsin(sine)
    flight = 4 * np.sqrt(a / g * sine) * np.cos(alpha)
    speed = np.sqrt(g * a * sine)
    tau = first["time"] - t0
    flying = ~first["contact.loop"]
    edge = 1e-9 * np.sqrt(a / g)
    assert (tau[flying] < flight + edge).all()
    assert (tau[~flying] > flight - edge).all()
    assert flying.sum() > 20
    met = first[~flying]
    assert len(met) > 20
    # where it lands, and the speed along the loop that is left of the parabola's
    xl, yl = a * np.cos(3 * alpha), -a * np.sin(3 * alpha)
    vx, vy = -speed * sine, speed * np.cos(alpha) - g * flight
    along = (vx * yl - vy * xl) / a
    energy = m * along**2 / 2 + m * g * yl
    assert np.abs(met["energy.total"] - energy).max() < 1e-9 * m * g * a
    force = 2 * energy / a - 3 * m * g * met["y"] / a
    assert np.abs(met["lambda.loop"] - force).max() < 1e-8 * m * g


def test_the_way_up_takes_as_long_as_the_angle_alone_says(native_fmu):
    """theta'' = -(g/a) sin theta, integrated alone up to the departure, takes the time that the FMU
    reports, whatever its communication step."""
    square = 3.5
    leave = np.arccos((2 - square) / 3)

    def left(_, y):
        return y[0] - leave

    left.terminal = True
    alone = solve_ivp(
        lambda _, y: [y[1], -9.81 * np.sin(y[0])],
        (0, 3),
        [0, np.sqrt(square * 9.81)],
        "DOP853",
        events=left,
        rtol=1e-13,
        atol=1e-13,
    )
    for points in (1, 7, 500):
        result = run(native_fmu("Loop"), WORLDS["earth"], square, 1e-12, 4.0, points)
        first = result[result["departure.loop.count"] == 1]
        assert first["departure.loop.time"][0] == pytest.approx(alone.t_events[0][0], abs=1e-10)
