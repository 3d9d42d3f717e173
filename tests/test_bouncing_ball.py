"""Ball that bounces to rest, through fmpy on the built FMU."""

from __future__ import annotations

import numpy as np
import pytest
from instance import instance
from runs import evenly

G = 9.81
CASES = {  # m [kg], e, h [m], v0 [m/s]
    "dropped": (1.0, 0.7, 1.0, 0.0),
    "thrown up": (0.2, 0.5, 0.3, 2.0),
    "thrown down": (5.0, 0.3, 2.0, -3.0),
    "lively": (1.0, 0.95, 1.0, 0.0),
    "clay": (1.0, 0.0, 1.0, 0.0),
    "from the floor": (1.0, 0.6, 0.0, 3.0),
    "tiny": (1.0, 0.7, 1e-6, 0.0),
    "vast": (1.0, 0.7, 1e6, 0.0),
}
EVERY = pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())


@EVERY
def test_it_rests_when_the_bounces_have_accumulated(native_fmu, case):
    """All the bounces are over at t1 + 2 e w/(g (1 - e)), for a drop sqrt(2 h/g)(1 + e)/(1 - e); just
    before the ball is still bouncing, just after it lies with lambda = m g, and so ever after."""
    m, e, h, v0 = case
    w = np.sqrt(v0**2 + 2 * G * h)
    end = (v0 + w) / G + 2 * w * e / (G * (1 - e))
    if v0 == 0:
        assert end == pytest.approx(np.sqrt(2 * h / G) * (1 + e) / (1 - e), rel=1e-12)
    # it rests once v^2/(2 g) is 1e-9 of the highest that it has been; the other bounces would have taken
    size = w**2 / (2 * G)
    early = 2 * np.sqrt(2e-9 * size / G) / (1 - e) + 1e-8 * end
    with instance(native_fmu("BouncingBall")) as one:
        one.start({"m": m, "g": G, "e": e, "y": h, "der(y)": v0}, tolerance=1e-10)
        one.step(end - 1.01 * early)
        assert not one.get("contact.floor")
        assert one.get("lambda.floor") == 0
        one.step(1.02 * early)
        for _ in range(3):
            assert one.get("contact.floor")
            assert one.get("lambda.floor") == pytest.approx(m * G, rel=1e-14)
            assert abs(one.get("y")) < 1e-15 * size
            assert abs(one.get("der(y)")) < 1e-15 * size
            one.step(end)


@pytest.mark.parametrize("points", [1, 30, 1000])
def test_infinitely_many_bounces_fit_into_one_communication_step(native_fmu, points):
    """Rest is reached whether the whole run is one communication step or a thousand."""
    result = evenly(native_fmu("BouncingBall"), 5.0, points, None, {})
    assert result["contact.floor"][-1]
    assert result["y"][-1] == 0
    assert result["lambda.floor"][-1] == pytest.approx(9.81, rel=1e-14)


def test_each_bounce_keeps_e_squared_of_the_energy(native_fmu):
    """Between the bounces the energy is m g h e^2k, falling in steps that all have the ratio e^2."""
    e = 0.8
    result = evenly(native_fmu("BouncingBall"), 3.0, 300, 1e-12, {"e": e})
    levels = np.round(np.log(result["energy.total"] / G) / np.log(e**2), 8)
    found = np.unique(levels)
    np.testing.assert_array_equal(found, np.arange(len(found)))
    assert len(found) >= 7
    assert (np.diff(levels) >= 0).all()


def test_an_elastic_ball_bounces_for_ever(native_fmu):
    """With e = 1 the bounces never end: after a hundred of them the ball is at the height it fell from."""
    period = 2 * np.sqrt(2 / G)
    with instance(native_fmu("BouncingBall")) as one:
        one.start({"e": 1.0}, tolerance=1e-12)
        one.step(100 * period)
        assert one.get("y") == pytest.approx(1.0, abs=1e-8)
        assert not one.get("contact.floor")


@pytest.mark.parametrize("step", [1e-2, 1.0, 3.0])
def test_no_bounce_is_stepped_over_however_low(native_fmu, step):
    """With e = 1/2 the twelfth bounce rises by 2^-24 of the first height, in 5e-4 s: at its top the ball
    is there, whether the step before it was longer than the bounce or not."""
    first, count = np.sqrt(2 / G), 12
    top = first * (1 + 2 * sum(0.5**k for k in range(1, count)) + 0.5**count)
    with instance(native_fmu("BouncingBall")) as one:
        one.start({"e": 0.5}, tolerance=1e-8)
        while one.time < top:
            one.step(min(step, top - one.time))
        assert one.get("y") == pytest.approx(0.25**count, rel=1e-6)
        assert one.get("der(y)") == pytest.approx(0, abs=1e-10)
