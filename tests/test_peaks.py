"""Extremes of the motion: found between communication points, on both sides of events and inputs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import model_file, scene_of
from instance import Instance, instance
from runs import simulate_fmu
from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass

from lagfmu import Input, Model, Output, Parameter, Peak
from lagfmu.errors import BuildError, ModelError
from lagfmu.testing import prepare, write

Peaked = Callable[..., Path]
G = 9.81
STEPS = pytest.mark.parametrize("step", [0.5, 0.005])


@pytest.fixture
def peaked(built: Any) -> Peaked:
    """peaked(NAME, outputs): the native FMU of a scene of models/ whose model has these outputs besides."""

    def get(name: str, *outputs: Output | Peak, **scene: Any) -> Path:
        file, asked = scene_of(name)
        model = replace(file.model, outputs=(*file.model.outputs, *outputs))
        return built(model, replace(asked, **scene))

    return get


def peaks(one: Instance, name: str) -> list[float]:
    """Largest and smallest value so far, and when."""
    return [one.get(f"peak.{name}.{part}") for part in ("max", "min", "max_time", "min_time")]


def run(one: Instance, stop: float, step: float) -> Instance:
    for _ in range(round(stop / step)):
        one.step(step)
    return one


@STEPS
@pytest.mark.parametrize("tolerance", [1e-5, 1e-7, 1e-10])
def test_the_tension_is_largest_at_the_bottom(
    peaked: Peaked, step: float, tolerance: float
) -> None:
    """From rest at 1 rad the tension grows from m g cos(theta0) to m g (3 - 2 cos(theta0)) a quarter of a
    period later, the speed to sqrt(2 g L (1 - cos(theta0))), whatever the communication step."""
    fmu = peaked("PendulumCartesian", Peak("tension"), Peak("der(x)"))
    with instance(fmu) as one:
        run(one.start(tolerance=tolerance, stop_time=2.0), 2.0, step)
        found, speed = peaks(one, "tension"), peaks(one, "velocity.x")
    least, most = G * np.cos(1), G * (3 - 2 * np.cos(1))
    quarter = 0.53478439992  # s: K(sin(1/2)) sqrt(L/g)
    assert found[:2] == pytest.approx([most, least], rel=5 * tolerance)
    assert found[2] == pytest.approx(quarter, abs=0.3 * np.sqrt(tolerance))  # the top is flat
    assert found[3] == 0
    fastest = np.sqrt(2 * G * (1 - np.cos(1)))
    assert speed[:2] == pytest.approx([fastest, -fastest], rel=5 * tolerance)


def test_nothing_that_lies_ahead_is_told(peaked: Peaked) -> None:
    """On the way to the bottom the tension just read is the largest so far, though internal steps are longer
    than communication steps; after it the largest stays."""
    with instance(peaked("PendulumCartesian", Peak("tension"), Peak("der(x)"))) as one:
        one.start(tolerance=1e-6, stop_time=2.0)
        assert peaks(one, "tension") == [one.get("tension")] * 2 + [0, 0]
        before = -np.inf
        for _ in range(100):
            one.step(0.01)
            most, _, when, _ = peaks(one, "tension")
            assert most >= max(before, one.get("tension"))
            assert when <= one.time + 1e-12
            if one.time < 0.53:
                assert (most, when) == (one.get("tension"), pytest.approx(one.time))
            before = most


def test_a_cranks_bearing_force_does_not_depend_on_the_communication_step(peaked: Peaked) -> None:
    """The thrust of the rod, which the bearing takes: points 5 ms apart miss more of its extremes than
    the tolerance allows, and tell it as steps of 0.1 ms do, among whose points it lies."""
    fmu = peaked("SliderCrank", Peak("rod.thrust"))
    found, seen = {}, {}
    for step in (0.02, 0.005, 0.0001):
        with instance(fmu) as one:
            one.start({"der(phi)": 30.0}, tolerance=1e-9, stop_time=0.5)
            values = []
            for _ in range(round(0.5 / step)):
                one.step(step)
                values.append(one.get("rod.thrust"))
            found[step], seen[step] = np.array(peaks(one, "rod.thrust")), np.array(values)
    most, least = seen[0.0001].max(), seen[0.0001].min()
    size = max(abs(most), abs(least))
    for step in (0.02, 0.005):
        assert found[step][:2] == pytest.approx(found[0.0001][:2], rel=1e-8)
        assert found[step][2:] == pytest.approx(found[0.0001][2:], abs=1e-5)
        assert max(most - seen[step].max(), seen[step].min() - least) > 1e-4 * size
    assert most <= found[0.02][0] * (1 + 1e-9) < most + 1e-4 * size
    assert least >= found[0.02][1] * (1 + 1e-9) > least - 1e-4 * size


@STEPS
def test_both_sides_of_an_event_count(peaked: Peaked, step: float) -> None:
    """A ball is fastest just before its first impact, and rises fastest just after it."""
    fmu = peaked("BouncingBall", Peak("der(y)"), Peak("y"))
    with instance(fmu) as one:
        run(one.start(stop_time=1.5), 1.5, step)
        most, least, up, down = peaks(one, "velocity.y")
        assert [most, least] == pytest.approx([0.7 * np.sqrt(2 * G), -np.sqrt(2 * G)], rel=1e-9)
        assert up == down == one.get("closing.floor.time") or up == pytest.approx(
            np.sqrt(2 / G), rel=1e-9
        )
        assert peaks(one, "y")[0] == 1
        assert abs(peaks(one, "y")[1]) < 1e-12


def test_friction_is_largest_just_before_the_block_slips(peaked: Peaked) -> None:
    """|lambda| reaches mu_s m g, and is mu_k m g right after: the first is on the left side of the event."""
    with instance(peaked("Belt", Peak("lambda.ride"), Peak("energy.dissipated"))) as one:
        run(one.start(stop_time=0.5), 0.5, 0.25)
        least = peaks(one, "lambda.ride")
        assert max(map(abs, least[:2])) == pytest.approx(0.5 * G, rel=1e-9)
        assert peaks(one, "energy.dissipated")[0] == one.get("energy.dissipated") > 0


def test_a_slide_in_two_directions_ends_without_a_peak_of_its_direction(built: Any) -> None:
    """A puck slides straight on: the components of its friction stay what they are until it stands, although
    the direction of its velocity is but rounding's just before."""
    fmu = built(replace(model_file("puck").model, outputs=[Peak("lambda.a*")]))
    level = {"alpha": 0.0, "mu_s": 0.2, "mu_k": 0.2}
    with instance(fmu) as one:
        for speed in (0.7, 1.0, 1.5, 2.0, 3.0):
            for angle in (0.1, 0.3, 0.5235987, 0.9, 1.2):
                way = speed * np.array([np.cos(angle), np.sin(angle)])
                one.start({**level, "der(x)": way[0], "der(y)": way[1]})
                run(one, 2.0, 0.01)
                least = [peaks(one, "lambda.along")[1], peaks(one, "lambda.across")[1]]
                assert least == pytest.approx(list(-0.2 * G * way / speed), rel=1e-8)
                one.fmu.reset()


def test_both_sides_of_an_inputs_jump_count(built: Any) -> None:
    """A force that pushes for one communication step: its acceleration has been there when the step began,
    though no point shows it; the one before it was none."""
    k = symbols("k", positive=True)
    x, F = dynamicsymbols("x F")
    model = point_mass(
        "Pushed",
        "x",
        energy=-k * x**2 / 2,
        parameters=[Parameter(k, 1e4, "N/m")],
        forces={x: F},
        inputs=[Input(F, "N")],
        outputs=[Peak("der(x,2)"), Peak("x")],
    )
    with instance(built(model)) as one:
        one.start()
        one.step(0.01)
        assert peaks(one, "acceleration.x")[:2] == [0, 0]
        one.set("F", 5.0)
        assert peaks(one, "acceleration.x")[:2] == [0, 0]
        one.step(0.0157)
        one.set("F", 0.0)
        most, _, when, _ = peaks(one, "acceleration.x")
        assert (most, when) == (pytest.approx(5, rel=1e-12), 0.01)
        assert peaks(one, "x")[0] == pytest.approx(5e-4 * (1 - np.cos(1.57)), rel=1e-6)
        run(one, 0.2, 0.1)
        top = 5e-4 * np.sqrt((1 - np.cos(1.57)) ** 2 + np.sin(1.57) ** 2)
        assert peaks(one, "x")[0] == pytest.approx(top, rel=1e-6)


def test_model_exchange_asks_for_an_event_after_an_extreme(peaked: Peaked) -> None:
    """An importer's solver passes the bottom: the tension's largest value is told from the event after that
    step on, as exactly as its steps are; while the tension grows there is no event."""
    fmu = peaked("PendulumCartesian", Peak("tension"), Peak("der(x)"))
    names = ["peak.tension.max", "peak.tension.max_time", "peak.velocity.x.min", "tension"]
    run = simulate_fmu(
        str(fmu),
        fmi_type="ModelExchange",
        stop_time=2.0,
        output_interval=0.01,
        relative_tolerance=1e-9,
        output=names,
    )
    most, quarter = G * (3 - 2 * np.cos(1)), 0.53478439992
    peak, time = run["peak.tension.max"], run["time"]
    assert peak[-1] == pytest.approx(most, rel=1e-5)
    assert run["peak.tension.max_time"][-1] == pytest.approx(quarter, abs=1e-3)
    assert run["peak.velocity.x.min"][-1] == pytest.approx(
        -np.sqrt(2 * G * (1 - np.cos(1))), rel=1e-5
    )
    assert (peak[time < 0.53] == peak[0]).all()
    assert peak[0] == run["tension"][0]


def test_both_sides_of_an_event_count_in_model_exchange(peaked: Peaked) -> None:
    """The ball is fastest just before its first impact, and rises fastest just after it."""
    run = simulate_fmu(
        str(peaked("BouncingBall", Peak("der(y)"), Peak("y"))),
        fmi_type="ModelExchange",
        stop_time=1.0,
        output_interval=0.1,
        relative_tolerance=1e-9,
        output=["peak.velocity.y.max", "peak.velocity.y.min", "peak.y.min"],
    )
    assert run["peak.velocity.y.max"][-1] == pytest.approx(0.7 * np.sqrt(2 * G), rel=1e-6)
    assert run["peak.velocity.y.min"][-1] == pytest.approx(-np.sqrt(2 * G), rel=1e-6)


def test_a_saved_state_holds_the_peaks(peaked: Peaked) -> None:
    """Saved just before the bottom, restored after it, also from bytes: the same bits."""
    with instance(peaked("PendulumCartesian", Peak("tension"), Peak("der(x)"))) as one:
        one.start(tolerance=1e-7, stop_time=3.0)
        run(one, 0.5, 0.1)
        state = one.fmu.getFMUState()
        content = one.fmu.serializeFMUstate(state)
        before = peaks(one, "tension")
        run(one, 1.0, 0.1)
        after = peaks(one, "tension") + peaks(one, "velocity.x")
        assert after[0] > before[0]
        for back in (state, one.fmu.deSerializeFMUstate(content)):
            one.fmu.setFMUState(back)
            one.time = 0.5
            assert peaks(one, "tension") == before
            run(one, 1.0, 0.1)
            assert peaks(one, "tension") + peaks(one, "velocity.x") == after


def test_the_motion_is_the_same_with_and_without(peaked: Peaked) -> None:
    """Looking changes nothing: every other output has the same bits."""
    found = []
    for outputs in ((), (Peak("y"),)):
        with instance(peaked("BouncingBall", *outputs)) as one:
            one.start(stop_time=2.0)
            rows = []
            for _ in range(40):
                one.step(0.05)
                rows.append({n: x for n, x in one.outputs().items() if not n.startswith("peak.")})
            found.append(rows)
    assert found[0] == found[1]


def test_a_scene_may_ask_for_a_peak_alone(peaked: Peaked) -> None:
    """peak.tension.max is right where the tension itself is not among the variables."""
    fmu = peaked("PendulumCartesian", Peak("tension"), outputs=["peak.tension.max"])
    with instance(fmu) as one:
        assert "tension" not in one.variables
        assert "peak.tension.min" not in one.variables
        run(one.start(tolerance=1e-9), 1.0, 0.5)
        assert one.get("peak.tension.max") == pytest.approx(G * (3 - 2 * np.cos(1)), rel=1e-8)


m, L = symbols("m L", positive=True)
x = dynamicsymbols("x")


def oscillator(outputs: Sequence[Output | Peak]) -> Model:
    return point_mass(
        "Oscillator",
        "x",
        energy=-m * x**2 / (2 * L),
        parameters=[Parameter(L, 1.0, "s^2")],
        outputs=outputs,
        start={x: 1.0},
    )


def test_patterns_and_units() -> None:
    """Each output that a pattern means has its extremes, in its own unit; the times are in seconds."""
    table = prepare(oscillator([Peak("energy.*"), Peak("x"), Peak("x")])).table
    found = {v.name: v.unit.name for v in table.variables if v.of.head == "peak"}
    assert set(found) == {
        f"peak.{n}.{part}"
        for n in ("x", "energy.kinetic", "energy.potential", "energy.total")
        for part in ("max", "min", "max_time", "min_time")
    }
    assert found["peak.x.max"] == "m"
    assert found["peak.energy.total.min"] == "J"
    assert found["peak.x.min_time"] == "s"


@pytest.mark.parametrize(
    ("outputs", "words"),
    [
        ([Peak("energy.kinetc")], ("energy.kinetc", "did you mean 'energy.kinetic'")),
        ([Peak("solver.steps")], ("solver.steps", "unknown")),
        ([Peak(3)], ("Peak(of=3)", "expected the name")),
        ([Peak("x"), Output("peak.x.max", x, "m")], ("peak.x.max", "rename")),
    ],
)
def test_peaks_of_nothing_are_refused(outputs: Sequence[Any], words: Sequence[str]) -> None:
    """By the name, with what is near; a name that collides only where it does."""
    with pytest.raises(ModelError) as refused:
        prepare(oscillator(outputs))
    assert all(word in str(refused.value) for word in words)
    assert str(refused.value).count("'energy.kinetic'") <= 1  # what is near is told once
    assert prepare(oscillator([Output("peak.height", x, "m")]))


def test_python_fmus_tell_no_peaks(tmp_path: Path) -> None:
    """Refused by name when one is built, with the remedy."""
    with pytest.raises(BuildError, match=r"peak\.x.*--target native"):
        write(prepare(oscillator([Peak("x")])), tmp_path, target="python")
