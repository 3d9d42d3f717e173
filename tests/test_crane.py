"""Hoisting by a prescribed motion: the rope's tension and the winch's power."""

from __future__ import annotations

import numpy as np
from instance import instance

from lagfmu import simulate

M, m, g = 800.0, 2000.0, 9.81


def hoisted(path, h, rates=True):
    """A smooth hoist by 4 m in 8 s from rest, the trolley pulled at 500 N; held between the points."""
    times = np.arange(0.0, 8.0 + h / 2, h)
    w = np.pi / 8.0
    table = np.zeros(len(times), [(n, float) for n in ("time", "F", "l", "der(l)", "der(l,2)")])
    table["time"], table["F"] = times, 500.0
    table["l"] = 7.8125 - 2.0 * (1 - np.cos(w * times))
    table["der(l)"] = -2.0 * w * np.sin(w * times)
    table["der(l,2)"] = -2.0 * w**2 * np.cos(w * times)
    start = {"der(l)": 0.0, "der(x)": 0.0, "der(y)": 0.0}
    given = table if rates else table[["time", "F", "l"]]
    besides = [n for n in ("l", "der(l)", "der(l,2)") if rates or n == "l"]
    return simulate(path, 8.0, h, 1e-10, start, given, besides=besides)


def test_the_tension_is_that_of_the_hoisted_load(native_fmu):
    """lambda = m (M g y + F d - M (d'^2 + y'^2 - l'^2 - l l''))/(2 (M l^2 + m d^2)), driven: to rounding.

    Of what the FMU holds for l, l' and l'': at the end of a step l'' is that of its beginning.
    """
    run = hoisted(native_fmu("Crane"), 0.02)
    rope, rate, bend = run["l"], run["der(l)"], run["der(l,2)"]
    d, speed = run["x"] - run["s"], run["der(x)"] - run["der(s)"]
    square = speed**2 + run["der(y)"] ** 2 - rate**2 - rope * bend
    drive = 500.0 - 150.0 * run["der(s)"]
    pull = m * (M * g * run["y"] + drive * d - M * square) / (2 * (M * rope**2 + m * d**2))
    np.testing.assert_allclose(run["lambda.rope"], pull, rtol=1e-12)
    np.testing.assert_allclose(run["rope.tension"], -2 * rope * pull, rtol=1e-12)
    np.testing.assert_allclose(run["winch.power"], 2 * rope * pull * rate, rtol=1e-12, atol=1e-9)


def test_the_drives_supply_what_the_load_gains(native_fmu):
    """The integral of both powers less the friction's loss is the growth of the energy, over the hoist."""
    run = hoisted(native_fmu("Crane"), 0.01)
    t = run["time"]
    power = run["winch.power"] + run["trolley.power"] - 150.0 * run["der(s)"] ** 2
    work = np.sum((power[1:] + power[:-1]) / 2 * np.diff(t))
    gain = run["energy.total"][-1] - run["energy.total"][0]
    assert gain > 2000.0 * 9.81 * 3.5
    np.testing.assert_allclose(work, gain, rtol=2e-4)


def test_the_rope_keeps_its_length_where_nothing_pulls(native_fmu):
    """With g = 1e-300 m/s^2 the trolley, which starts at 0, is hardly pushed: its natural distance is that of
    the others and not 1e299 m, beside which no error of the rope was seen once the winch had passed l = 0."""
    with instance(native_fmu("Crane")) as one:
        one.start({"g": 1e-300})
        for _ in range(4):
            one.step(94.0)
            l = one.get("l")  # noqa: E741 - the literature's letter
            d, y = one.get("x") - one.get("s"), one.get("y")
            assert abs(d * d + y * y - l * l) < 1e-13 * (one.get("x") ** 2 + y * y + 1)
