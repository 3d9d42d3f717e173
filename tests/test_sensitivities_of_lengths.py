"""Derivatives of a run in which a length or a speed, sqrt(x^2 + y^2), passes through 0 or near it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from instance import instance
from runs import evenly
from sympy import Abs, sqrt, symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass

from lagfmu import Model, Output, Parameter, Scene

x, y = dynamicsymbols("x y")
m, k, L, c = symbols("m k L c", positive=True)
K, LENGTH, START = 40.0, 0.5, 1.2
RATE = math.sqrt(K)
STENCIL = ((-2, 1 / 12), (-1, -8 / 12), (1, 8 / 12), (2, -1 / 12))  # central, of fourth order
NUMBERS = [Parameter(m, 1.0, "kg"), Parameter(k, K, "N/m"), Parameter(L, LENGTH, "m")]


def on_a_spring(name: str, *, plane: bool, speed: float = 0.0) -> Model:
    """A mass on a spring to the origin, drawn out to x = 1.2 m, with a speed across."""
    kinetic = m * (x.diff() ** 2 + (y.diff() ** 2 if plane else 0)) / 2
    length = sqrt(x**2 + y**2) if plane else Abs(x)
    return Model(
        name=name,
        lagrangian=kinetic - k * (length - L) ** 2 / 2,
        coordinates={x: "m", y: "m"} if plane else {x: "m"},
        parameters=NUMBERS,
        start={x: START, **({y.diff(): speed} if plane else {})},
    )


def along(t: float, stiffness: float, length: float, start: float) -> float:
    """Where it is on the line: x = L + (x0 - L) cos(w t) up to the origin, there with the speed u, and behind
    it x = -L + L cos(w s) + (u/w) sin(w s), s being the time since."""
    w = math.sqrt(stiffness)
    there = math.acos(-length / (start - length)) / w
    if t < there:
        return length + (start - length) * math.cos(w * t)
    s, u = t - there, -(start - length) * w * math.sin(w * there)
    return -length + length * math.cos(w * s) + u / w * math.sin(w * s)


def test_along_a_line_the_force_turns_round_at_an_event(built: Any) -> None:
    """There the length is |x|, and its force k (|x| - L) sign(x) jumps at a place that is watched, on both of
    whose sides the length is known: derivatives go on behind it."""
    scene = Scene("SpringLine", sensitivities=("x:k,L,x",))
    found = evenly(built(on_a_spring("SpringLine", plane=False), scene), 0.8, 8, 1e-11, {})
    assert found["sensitivity.valid"].all()
    values = (K, LENGTH, START)
    for j, by in enumerate(("k", "L", "x")):
        step = 1e-4 * values[j]
        expected = np.zeros(len(found))
        for part, weight in STENCIL:
            beside = [v + part * step * (i == j) for i, v in enumerate(values)]
            expected += [weight * along(t, *beside) / step for t in found["time"]]
        np.testing.assert_allclose(found[f"sensitivity.x.by.{by}"], expected, atol=1e-10)


@pytest.mark.parametrize("speed", [0.0, 1e-14])
@pytest.mark.parametrize("tolerance", [1e-4, 1e-11])
def test_in_the_plane_it_ends_them(built: Any, speed: float, tolerance: float) -> None:
    """At the origin the force has every direction: what passes it a little to the left goes another way than
    to the right.  Before it dx/dL = 1 - cos(w t); behind it nothing is given, and the log says where."""
    with instance(plane(built)) as one:
        one.start({"der(y)": speed}, tolerance=tolerance)
        there = math.acos(-LENGTH / (START - LENGTH)) / RATE
        one.step(0.9 * there)
        assert one.get("sensitivity.valid")
        expected = 1 - math.cos(RATE * one.time)
        assert abs(one.get("sensitivity.x.by.L") - expected) < 10 * tolerance
        one.step(0.2 * there)
        assert not one.get("sensitivity.valid")
        assert one.get("sensitivity.x.by.L") == 0
        (told,) = [text for _, _, text in one.log if "sensitivity" in text]
    assert ",2) jumps from" in told
    assert float(told.partition(" at t = ")[2].partition(" s")[0]) == pytest.approx(there, abs=1e-4)


def plane(built: Any) -> Any:
    scene = Scene("SpringPlane", sensitivities=("x:k,L",))
    return built(on_a_spring("SpringPlane", plane=True), scene)


@pytest.mark.parametrize("speed", [1e-6, 1e-2])
def test_past_the_origin_they_go_on(built: Any, speed: float) -> None:
    """At 1e-7 m from it, or 1e-3 m, the force turns round quickly, in steps as short as that takes."""
    found = evenly(plane(built), 0.8, 8, 1e-11, {"der(y)": speed})
    assert found["sensitivity.valid"].all()
    expected = np.zeros(len(found))
    for part, weight in STENCIL:
        beside = {"der(y)": speed, "L": LENGTH * (1 + 1e-4 * part)}
        expected += weight * evenly(plane(built), 0.8, 8, 1e-13, beside)["x"] / (1e-4 * LENGTH)
    np.testing.assert_allclose(found["sensitivity.x.by.L"], expected, atol=1e-8)


def test_drag_begins_at_rest(built: Any) -> None:
    """Of sqrt(x'^2 + y'^2) (x', y') there are derivatives at rest, 0, though the root has none.  A fall with
    it has y = -(m/c) ln cosh(t sqrt(c g/m)), and no jump is seen in it; the speed itself has none at rest."""
    speed = sqrt(x.diff() ** 2 + y.diff() ** 2)
    model = point_mass(
        "Falling",
        "x y",
        up=y,
        parameters=[NUMBERS[0], Parameter(c, 0.3, "kg/m")],
        forces={x: -c * speed * x.diff(), y: -c * speed * y.diff()},
        outputs=[Output("speed", speed, "m/s")],
    )
    fmu = built(model, Scene("Falling", sensitivities=("y,speed:c,g",)))
    found = evenly(fmu, 2.0, 8, 1e-11, {})
    t, w = found["time"], math.sqrt(0.3 * 9.81)
    assert found["sensitivity.valid"].all()
    y_by_c = np.log(np.cosh(w * t)) / 0.3**2 - t * np.tanh(w * t) * w / (2 * 0.3**2)
    np.testing.assert_allclose(found["sensitivity.y.by.c"], y_by_c, atol=1e-10)
    by_g = -t * np.tanh(w * t) * w / (2 * 9.81 * 0.3)
    np.testing.assert_allclose(found["sensitivity.y.by.g"], by_g, atol=1e-10)
    assert found["sensitivity.speed.by.c"][0] == 0
