"""Derivatives of extremes: of their values and of their times, by parameters and start values."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import fmpy
import pytest
from conftest import scene_of
from instance import instance
from runs import evenly
from sympy import Abs, symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass

from lagfmu import Model, Output, Parameter, Peak, Scene

TIGHT, G = 1e-11, 9.81
x, m, k = dynamicsymbols("x"), *symbols("m k", positive=True)
A, B = symbols("a b", real=True)
STENCIL = ((-2, 1 / 12), (-1, -8 / 12), (1, 8 / 12), (2, -1 / 12))  # central, of fourth order

Varied = Callable[..., Path]


@pytest.fixture
def varied(built: Any) -> Varied:
    """varied(NAME, peaks, "peak.lambda.rod.max:L", ...): an FMU of models/ that keeps these extremes."""

    def get(name: str, peaks: Any, *sensitivities: str, start: Any = None, **scene: Any) -> Path:
        file, asked = scene_of(name)
        model = replace(file.model, outputs=(*file.model.outputs, *map(Peak, peaks)))
        model = model if start is None else replace(model, start=start)
        return built(model, replace(asked, sensitivities=sensitivities, **scene))

    return get


def last(fmu: Path, stop: float, points: int, start: Any = None, tolerance: float = TIGHT) -> Any:
    """Everything at the end of a run."""
    return evenly(fmu, stop, points, tolerance, start or {})[-1]


def of(row: Any, name: str, by: str) -> float:
    return float(row[f"sensitivity.{name}.by.{by}"])


@pytest.mark.parametrize("points", [7, 200])
def test_the_greatest_pull_of_a_pendulum(varied: Varied, points: int) -> None:
    """From rest at 1 rad the rod pulls with m g (3 - 2 cos 1) at most, a quarter of a period T
    sqrt(L/g) later, and at the start with m g cos 1 at least; the bob's speed is sqrt(2 g L (1 - cos
    1)) at most. These change by g, L and m as they stand here, whatever the communication step."""
    fmu = varied(
        "PendulumCartesian",
        ["tension", "der(x)"],
        "peak.tension.*:g,L,m",
        "peak.velocity.x.*:g,L",
    )
    row = last(fmu, 2.0, points)
    assert row["sensitivity.valid"]
    most, quarter = G * (3 - 2 * math.cos(1)), 0.53478439992
    fastest = math.sqrt(2 * G * (1 - math.cos(1)))
    expected = {
        ("tension.max", "g"): most / G,
        ("tension.max", "L"): 0.0,
        ("tension.max", "m"): most,
        ("tension.max_time", "g"): -quarter / (2 * G),
        ("tension.max_time", "L"): quarter / 2,
        ("tension.max_time", "m"): 0.0,
        ("tension.min", "g"): math.cos(1),
        ("tension.min", "L"): 0.0,
        ("tension.min_time", "L"): 0.0,
        ("velocity.x.max", "g"): fastest / (2 * G),
        ("velocity.x.max", "L"): fastest / 2,
        ("velocity.x.max_time", "L"): 3 * quarter / 2,
        ("velocity.x.min", "L"): -fastest / 2,
    }
    for (name, by), value in expected.items():
        tolerance = 1e-8 if name.endswith("time") else 1e-10
        assert abs(of(row, f"peak.{name}", by) - value) < tolerance, (name, by)


def test_a_bearing_force_against_runs_beside_it(varied: Varied) -> None:
    """The greatest and smallest force in a crank's bearing, and when: as central differences of tight
    runs."""
    fmu = varied(
        "SliderCrankBodies", ["force.A.norm"], "peak.force.A.norm.*:piston.mass,rod.inertia"
    )
    plain = varied("SliderCrankBodies", ["force.A.norm"])
    row = last(fmu, 0.4, 4)
    names = [f"peak.force.A.norm.{part}" for part in ("max", "min", "max_time", "min_time")]
    for by, at in (("piston.mass", 0.5), ("rod.inertia", 0.02)):
        step = 1e-3 * at
        runs = [(w, last(plain, 0.4, 4, {by: at + k * step}, 1e-13)) for k, w in STENCIL]
        for name in names:
            other = sum(w * r[name] for w, r in runs) / step
            doubt = 1e-8 / step if name.endswith("time") else 0.0  # [s] how well a time is found
            assert of(row, name, by) == pytest.approx(other, rel=1e-6, abs=doubt), (name, by)


def test_extremes_on_both_sides_of_an_impact(varied: Varied) -> None:
    """A ball from rest at h meets the floor at T = sqrt(2 h/g) with the speed v = sqrt(2 g h), and
    leaves it with e v: the smallest and the largest velocity of the run, at that time. The height is
    largest at the start."""
    fmu = varied("BouncingBall", ["der(y)", "y"], "peak.velocity.y.*:y,g,e", "peak.y.max*:y,g")
    row = last(fmu, 2.0, 9)
    h, e = 1.0, 0.7
    v, fall = math.sqrt(2 * G * h), math.sqrt(2 * h / G)
    expected = {
        ("velocity.y.min", "y"): -v / 2,
        ("velocity.y.min", "g"): -v / 2 / G,
        ("velocity.y.min", "e"): 0.0,
        ("velocity.y.min_time", "y"): fall / 2,
        ("velocity.y.min_time", "g"): -fall / 2 / G,
        ("velocity.y.max", "y"): e * v / 2,
        ("velocity.y.max", "e"): v,
        ("velocity.y.max_time", "y"): fall / 2,
        ("velocity.y.max_time", "e"): 0.0,
        ("y.max", "y"): 1.0,
        ("y.max", "g"): 0.0,
        ("y.max_time", "y"): 0.0,
    }
    assert row["sensitivity.valid"]
    for (name, by), value in expected.items():
        assert abs(of(row, f"peak.{name}", by) - value) < 1e-9, (name, by)


def test_extremes_of_a_friction(varied: Varied) -> None:
    """A block rides on a belt until the spring pulls with mu_s m g: the largest friction, at T = mu_s m
    g/(k speed) when it starts at x = 0; its smallest while it slips is -mu_k m g."""
    start = {x: 0.0, x.diff(): symbols("speed", positive=True)}
    fmu = varied("Belt", ["lambda.ride"], "peak.lambda.ride.*:x,speed,k,mu_s,mu_k", start=start)
    row = last(fmu, 0.8, 7)
    held = row["peak.lambda.ride.max_time"]
    assert row["slipping.grip.count"] == 1
    assert row["sensitivity.valid"]
    assert held == pytest.approx(0.5 * G / 100 / 0.2, rel=1e-10)
    expected = {
        ("max", "mu_s"): G,
        ("max", "mu_k"): 0.0,
        ("max", "speed"): 0.0,
        ("max_time", "mu_s"): held / 0.5,
        ("max_time", "speed"): -held / 0.2,
        ("max_time", "x"): -1 / 0.2,
        ("max_time", "k"): -held / 100,
        ("min", "x"): 100.0,
        ("min_time", "x"): 0.0,
    }
    for (name, by), value in expected.items():
        assert of(row, f"peak.lambda.ride.{name}", by) == pytest.approx(value, abs=1e-7), (name, by)


def swing(*outputs: Any) -> Model:
    """m x'' = -k x with m = 1 kg, k = 1 N/m, from x = 1 m at rest; and a = 0, b = 2 m, for outputs."""
    return point_mass(
        "Swing",
        "x",
        energy=-k * x**2 / 2,
        parameters=[Parameter(k, 1.0, "N/m"), Parameter(A, 0.0, "m"), Parameter(B, 2.0, "m")],
        outputs=outputs,
        start={x: 1.0},
    )


def told_after(fmu: Path, stop: float, start: Any = None) -> tuple[bool, list[str]]:
    """Whether derivatives exist at the end of a run, and why not."""
    with instance(fmu) as one:
        one.start(start or {}, stop_time=stop)
        while one.time < stop - 1e-9:
            one.step(stop / 8)
        text = [text for _, _, text in one.log if "sensitivity" in text]
        return one.get("sensitivity.valid"), text


def test_an_extreme_at_the_start_that_would_come_later(built: Any) -> None:
    """From rest at x = 1 the start is the largest; with some speed v it is sqrt(1 + v^2), after v
    seconds if v > 0, and at the start if v < 0: the value has a derivative, 0, the time has none. After
    it has begun to fall, the time stays 0 beside it, whatever v is a little less or more."""
    model = swing(Peak("x"))
    asked = ("peak.x.max:x,der(x)", "peak.x.max_time:der(x)")
    fmu = built(model, Scene("Swing", stop_time=1.0, sensitivities=asked))
    valid, (told,) = told_after(fmu, 1.0)
    assert not valid
    assert "peak.x.max_time at t = 0.0 s: it is the start" in told
    falling = last(fmu, 1.0, 5, {"der(x)": -0.1})
    assert falling["sensitivity.valid"]
    assert of(falling, "peak.x.max_time", "velocity.x") == 0
    assert of(falling, "peak.x.max", "x") == pytest.approx(1)
    rising = last(fmu, 1.0, 5, {"der(x)": 0.1})
    assert of(rising, "peak.x.max", "velocity.x") == pytest.approx(0.1 / math.sqrt(1.01))
    assert of(rising, "peak.x.max_time", "velocity.x") == pytest.approx(1 / 1.01)
    values = built(model, Scene("Swing", stop_time=1.0, sensitivities=("peak.x.max:x,der(x)",)))
    row = last(values, 1.0, 5)
    assert row["sensitivity.valid"]
    assert of(row, "peak.x.max", "x") == pytest.approx(1)
    assert of(row, "peak.x.max", "velocity.x") == pytest.approx(0, abs=1e-12)


def test_two_extremes_that_are_the_same(built: Any) -> None:
    """Of x = cos t, (x - 2 + a)^2 is 9 at t = pi and at 3 pi, whatever a is. x^2 is 1 at t = pi and 2
    pi, and (x + a)^2 too for a = 0: with a little more the first is less, the second more."""
    slid = [Output("one", (x - B + A) ** 2, "m^2"), Output("both", (x + A) ** 2, "m^2")]
    start = {"x": 0.9, "der(x)": -math.sqrt(0.19)}  # cos(t + t0)
    alike = built(swing(*slid, Peak("one")), Scene("Swing", sensitivities=("peak.one.max:a,k",)))
    row = last(alike, 12.0, 8, start)
    assert row["sensitivity.valid"]
    assert of(row, "peak.one.max", "a") == pytest.approx(-6)
    unlike = built(swing(*slid, Peak("both")), Scene("Swing", sensitivities=("peak.both.max:a",)))
    assert told_after(unlike, 5.0, start) == (True, [])
    valid, (told,) = told_after(unlike, 7.0, start)
    assert not valid
    assert "peak.both.max at t = 5.8" in told
    assert "it is as large as one before" in told


def test_an_extreme_at_a_kink_and_one_that_is_flat(built: Any) -> None:
    """|x| is smallest, 0, where it has a kink; the energy is the same at all times, and largest at any."""
    model = swing(Output("size", Abs(x), "m"), Peak("size"), Peak("energy.total"))
    start = {"x": 0.9, "der(x)": -math.sqrt(0.19)}
    kink = built(model, Scene("Swing", sensitivities=("peak.size.min:k",)))
    assert told_after(kink, 1.0, start) == (True, [])
    valid, (told,) = told_after(kink, 3.0, start)
    assert not valid
    assert "peak.size.min" in told
    assert "has a kink" in told
    flat = built(model, Scene("Swing", sensitivities=("peak.energy.total.max:k,x",)))
    row = last(flat, 3.0, 8, start)
    assert row["sensitivity.valid"]
    assert of(row, "peak.energy.total.max", "k") == pytest.approx(0.405, abs=1e-10)
    assert of(row, "peak.energy.total.max", "x") == pytest.approx(0.9, abs=1e-10)


def test_a_restored_state_repeats_them_bit_for_bit(varied: Varied) -> None:
    """What an extreme changes by belongs to the saved state, and so does whether it may still grow."""
    fmu = varied("PendulumCartesian", ["tension"], "peak.tension.*:g,L")
    with instance(fmu) as one:
        one.start()
        one.step(0.3)
        assert one.repeated(0.1, 4)["sensitivity.peak.tension.max_time.by.g"] < -0.01


def test_which_of_them_a_pattern_means(varied: Varied) -> None:
    """A pattern of everything takes values of extremes, not times; one of extremes takes both."""
    for asked, parts in (("*", 2), ("peak.*", 4), ("peak.tension.max_time", 1)):
        fmu = varied("PendulumCartesian", ["tension"], f"{asked}:L")
        names = [v.name for v in fmpy.read_model_description(fmu).modelVariables]
        assert len([n for n in names if n.startswith("sensitivity.peak")]) == parts, asked


def test_what_a_derivative_is_of_stands_beside_it(varied: Varied) -> None:
    """An output of which the scene asks for the derivative alone is delivered too."""
    fmu = varied("PendulumCartesian", ["tension"], "peak.tension.max:L", outputs=("x",))
    found = fmpy.read_model_description(fmu).modelVariables
    assert [v.name for v in found if v.causality == "output"] == [
        "x",
        "peak.tension.max",
        "sensitivity.peak.tension.max.by.L",
        "sensitivity.valid",
    ]
