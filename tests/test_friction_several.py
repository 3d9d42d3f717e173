"""Friction in two directions, on several feet, in impacts; Painleve's paradox; Model Exchange."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import model_file, scene_of
from fixed_step import euler, rk4
from fixed_step import run as fixed_steps
from fmpy.fmi1 import FMICallException
from instance import instance
from runs import simulate_fmu
from sympy import Rational, cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass

from lagfmu import (
    Contact,
    Friction,
    Holonomic,
    Input,
    Model,
    Nonholonomic,
    Parameter,
    build_fmu,
    multiplier,
    show,
    simulate,
)
from lagfmu.errors import CannotStartError, SimulationError
from lagfmu.testing import Session, targets

Built = Callable[..., Path]
g = 9.81  # m/s^2
x, y, z, theta, phi = dynamicsymbols("x y z theta phi")
m, G = symbols("m g", positive=True)
mu, a, e = symbols("mu a e", nonnegative=True)
rate, speed, clamp, force = symbols("w v N F")
t = dynamicsymbols._t


def ball() -> Model:
    """A solid ball that is thrown onto the floor."""
    return point_mass(
        "Ball",
        "x y",
        [
            Contact("floor", y, restitution=e),
            Nonholonomic("rolling", x.diff() - a * phi.diff()),
            Friction("grip", of=["rolling"], normal=multiplier("floor"), static=mu),
        ],
        angles="phi",
        up=y,
        energy=Rational(1, 5) * m * a**2 * phi.diff() ** 2,
        parameters=[
            Parameter(mu, 0.3, "1"),
            Parameter(a, 0.1, "m"),
            Parameter(e, 0.5, "1", min=0, max=1),
        ],
        start={y: 0.5, x.diff(): 2.0},
    )


def test_two_rows_slide_along_one_curve_and_stop_together(built: Built) -> None:
    """With mu = tan(alpha) the speed down the slope plus the speed itself is constant: from (0, v0) the
    puck approaches v0/2 straight down (the classical problem of the sliding puck)."""
    values = {"mu_s": float(np.tan(0.3)), "mu_k": float(np.tan(0.3)), "der(x)": 0.0}
    run = simulate(
        built(model_file("puck").model),
        stop_time=3.0,
        step_size=0.03,
        tolerance=1e-10,
        start_values=values,
    )
    down, across = run["slip.along"], run["slip.across"]
    assert down + np.hypot(down, across) == pytest.approx(2.0, rel=1e-8)
    lam = np.stack([run["lambda.along"], run["lambda.across"]])
    slip = np.stack([down, across])
    N = run["lambda.table"]
    assert lam == pytest.approx(-np.tan(0.3) * N * slip / np.hypot(*slip), abs=1e-11)


@pytest.mark.parametrize("tolerance", [1e-8, 3.5e-11, 1e-12])
@pytest.mark.parametrize(
    "thrown", [{}, {"mu_s": 1.46, "mu_k": 0.9, "alpha": 0.459, "der(x)": 1.69, "der(y)": -0.018}]
)
def test_a_puck_stops_in_both_directions_at_once(
    built: Built, thrown: dict[str, float], tolerance: float
) -> None:
    """Thrown across, or downhill and a little across: it slides as long as its energy lasts, which becomes
    heat, and stays, held against its weight."""
    run = simulate(
        built(model_file("puck").model),
        stop_time=2.5,
        step_size=0.05,
        tolerance=tolerance,
        start_values=thrown,
    )
    assert run["sticks.grip"][-1]
    assert not run["sticks.grip"][0]
    assert np.hypot(run["slip.along"][-1], run["slip.across"][-1]) < 1e-14
    total = run["energy.total"] + run["energy.dissipated"]
    assert total == pytest.approx(total[0], abs=100 * tolerance)
    at_rest = run[run["sticks.grip"]]
    assert (at_rest["x"] == at_rest["x"][0]).all()
    weight = g * np.sin(thrown.get("alpha", 0.3))
    assert at_rest["lambda.along"] == pytest.approx(-weight, rel=1e-12)


def whirled() -> Model:
    """A point mass on a rough table, under a force that turns round at the rate w."""
    along, aside = m * speed * rate, mu * m * G
    return point_mass(
        "Whirled",
        "x y z",
        [
            Contact("table", z),
            Nonholonomic("along", x.diff()),
            Nonholonomic("across", y.diff()),
            Friction("grip", of=["along", "across"], normal=multiplier("table"), static=mu),
        ],
        up=z,
        parameters=[
            Parameter(mu, 0.3, "1"),
            Parameter(speed, 1.5, "m/s"),
            Parameter(rate, 6.0, "rad/s"),
        ],
        forces={
            x: -along * cos(rate * t) - aside * sin(rate * t),
            y: -along * sin(rate * t) + aside * cos(rate * t),
        },
        start={x: 0.25, x.diff(): 0.0, y.diff(): 1.5},
    )


@pytest.mark.parametrize("method", [None, euler, rk4])
def test_a_slide_that_turns_round_does_not_end(built: Built, library: Any, method: Any) -> None:
    """A force with the part mu m g along the way and m v w across it leads a puck in a circle of v/w, round
    and round at the speed v, in co-simulation and by an importer's fixed steps: no slip stops."""
    angle, turns = 6.0 * 2.0, ["x", "y", "der(x)", "der(y)", "sticks.grip", "sticking.grip.count"]
    path = built(whirled())
    if method is None:
        run = simulate(path, stop_time=2.0, step_size=0.5, tolerance=1e-10)[-1]
        allowed = 1e-7
    else:
        run = fixed_steps(library(path), method, 4000, 2.0, turns)
        allowed = 1e-9 if method is rk4 else 0.02
    assert run["x"] == pytest.approx(0.25 * np.cos(angle), abs=allowed)
    assert run["y"] == pytest.approx(0.25 * np.sin(angle), abs=allowed)
    assert run["der(x)"] == pytest.approx(-1.5 * np.sin(angle), abs=6 * allowed)
    assert run["der(y)"] == pytest.approx(1.5 * np.cos(angle), abs=6 * allowed)
    assert not run["sticks.grip"]
    assert run["sticking.grip.count"] == 0


def gripped() -> Model:
    """A block between two belts that are clamped onto it and set off at t = 0, the first stands."""
    return point_mass(
        "Gripped",
        "x",
        [
            Nonholonomic("under", x.diff()),
            Nonholonomic("over", x.diff() - rate * t),
            Friction("first", of=["under"], normal=clamp, static=mu),
            Friction("second", of=["over"], normal=clamp, static=mu),
        ],
        parameters=[
            Parameter(mu, 0.5, "1"),
            Parameter(clamp, 2.0, "N"),
            Parameter(force, 0.5, "N"),
            Parameter(rate, 5.0, "m/s^2"),
        ],
        forces={x: force},
    )


@pytest.mark.parametrize("side", [1, -1])
def test_two_belts_are_slipped_on_in_opposite_senses(built: Built, side: int) -> None:
    """mu N = 1 N on either side, F = 0.5 N: the upper belt, at 5 m/s^2, drags the block with 1 N, the lower
    holds it back with 1 N, so that F alone accelerates it.  That is the only motion: with either belt
    dragging it the other way, or held by one of them, the block would not move as its forces say."""
    values = {"F": 0.5 * side, "w": 5.0 * side}
    run = simulate(built(gripped()), stop_time=0.5, step_size=0.1, start_values=values)
    t = run["time"]
    assert run["x"] == pytest.approx(side * 0.25 * t**2, abs=1e-9)
    assert run["lambda.under"][1:] == pytest.approx(-side, rel=1e-12)
    assert run["lambda.over"][1:] == pytest.approx(side, rel=1e-12)
    assert not run["sticks.first"].any()
    assert not run["sticks.second"].any()


@pytest.mark.parametrize("slope", [0.42, 0.4999, 0.5001, 0.7])
def test_two_feet_hold_as_long_as_they_can_together(built: Built, slope: float) -> None:
    """tan(alpha) <= mu: though the least-norm share asks more of the upper foot than it can hold, the pair
    holds; above, both slip with g (sin(alpha) - mu cos(alpha))."""
    angle = float(np.arctan(slope))
    run = simulate(
        built(model_file("two_feet").model),
        stop_time=1.0,
        step_size=0.1,
        start_values={"alpha": angle},
    )
    holds = slope < 0.5
    assert (run["sticks.grip_low"] == holds).all()
    assert (run["sticks.grip_up"] == holds).all()
    expected = 0.0 if holds else g * (np.sin(angle) - 0.5 * np.cos(angle)) / 2
    assert run["x"][-1] == pytest.approx(expected, abs=1e-9)
    for foot in ("low", "up"):
        cone = 0.5 * run[f"lambda.{foot}"] - np.abs(run[f"lambda.{foot}_rests"])
        assert (cone >= -1e-11).all()
    both = run["lambda.low_rests"] + run["lambda.up_rests"]
    needed = np.sin(angle) if holds else 0.5 * np.cos(angle)
    assert both == pytest.approx(-g * needed, rel=1e-11)
    assert run["unique.low_rests"].any() == run["unique.up_rests"].any() == (not holds)


@pytest.mark.parametrize("friction", [1.30, 1.36, 1.5])
@pytest.mark.parametrize("way", [1, -1])
def test_painleve_is_refused_by_name_and_only_there(
    native_fmu: Built, friction: float, way: int
) -> None:
    """A uniform rod at tan(theta) = 2: from mu = 4/3 on, and in one direction of slip, no acceleration
    agrees with Coulomb's law.  Elsewhere N = m g.../(1 + 3 cos(theta) (cos(theta) - mu sin(theta)))."""
    values = {"theta": float(np.arctan(2)), "y": 2 / 5**0.5, "mu": friction, "der(x)": 2.0 * way}

    def start() -> float:
        run = simulate(
            native_fmu("FallingRod"), stop_time=1e-3, step_size=1e-3, start_values=values
        )
        return float(run["lambda.floor"][0])

    if way < 0 and friction > 4 / 3:
        with pytest.raises(
            SimulationError,
            match=r"'grip': sliding has no acceleration, or several.*never to slip.*\(while_closed\)",
        ):
            start()
    else:
        inner = 1 + 3 / 5 + way * 3 * friction * 2 / 5
        assert start() == pytest.approx(g / inner, rel=1e-10)


def test_a_start_that_its_frictions_forbid_is_not_built(tmp_path, monkeypatch) -> None:
    """The same rod as the model says it, mu = 1.5: the FMU itself refuses its start, so that there is none,
    and `show` says so; where nothing can compile one it says that nobody asked."""
    start = {theta: float(np.arctan(2)), y: 2 / 5**0.5, x.diff(): -2.0}
    rod = scene_of("FallingRod")[0].model
    parameters = [replace(p, value=1.5) if p.symbol == mu else p for p in rod.parameters]
    model = replace(rod, start=start, parameters=parameters)
    for asked in (lambda: build_fmu(model, tmp_path, check=False), lambda: show(model)):
        with pytest.raises(CannotStartError, match="'grip': sliding has no acceleration"):
            asked()
    assert not list(tmp_path.iterdir())
    monkeypatch.setattr(targets, "find_compiler", lambda: None)
    assert "not examined" in (said := " ".join(repr(show(model)).split()))
    assert "pip install ziglang" in said


@pytest.mark.parametrize("way", [1, -1])
def test_painleve_is_looked_for_with_each_foot_in_the_air(built: Built, way: int) -> None:
    """On both feet sliding is well posed for any mu (det B = det K); on the front one alone it is up to
    mu = (1/m + a^2/J) J/(a h) = 2.6, and beyond that there may be two solutions: refused."""
    angle = {"alpha": 0.0, "der(x)": 1.0 * way}

    def start(friction: float) -> np.ndarray:
        run = {"stop_time": 1e-3, "step_size": 1e-3, "start_values": {**angle, "mu": friction}}
        return simulate(built(model_file("two_feet").model), **run)

    assert start(1.9)["der(x,2)"][0] == pytest.approx(-way * 1.9 * g, rel=1e-10)
    assert start(2.59)["contact.low"][0] != start(2.59)["contact.up"][0]  # it tips over
    with pytest.raises(SimulationError, match="has no acceleration, or several"):
        start(2.61)


F, rise = dynamicsymbols("F"), symbols("rise")
push = F + rise * dynamicsymbols._t


def pushed() -> Model:
    """A uniform rod of half length a that stands on its lower end, where F + rise t pushes it along x."""
    return point_mass(
        "Pushed",
        "x y",
        [
            Contact("floor", y - a * sin(theta)),
            Nonholonomic("foot", x.diff() + a * sin(theta) * theta.diff()),
            Friction("grip", of=["foot"], normal=multiplier("floor"), static=mu),
        ],
        angles="theta",
        up=y,
        energy=m * a**2 / 6 * theta.diff() ** 2,
        parameters=[
            Parameter(mu, 0.5, "1"),
            Parameter(a, 1.0, "m"),
            Parameter(rise, 0.0, "N/s"),
        ],
        forces={x: push, theta: push * a * sin(theta)},
        inputs=[Input(F, "N")],
        start={y: 2 / 5**0.5, theta: float(np.arctan(2))},
    )


def accelerations(slope: float, force: float, friction: float) -> list[tuple[bool, float, float]]:
    """All that Coulomb's and Signorini's laws allow the foot of the rod (m = a = 1) that stands still at
    tan(theta) = slope: (does it part?, N, T)."""
    s, c = slope / np.hypot(1, slope), 1 / np.hypot(1, slope)
    nn, tt, nt = 1 + 3 * c * c, 1 + 3 * s * s, -3 * s * c  # G M^-1 G^T of normal and tangent
    n, t = -g + nt * force, tt * force  # accelerations of the foot without the floor
    found = [(True, 0.0, 0.0)] if n >= 0 else []
    N, T = np.linalg.solve([[nn, nt], [nt, tt]], [-n, -t])
    if N >= 0 and abs(T) <= friction * N:
        found.append((False, N, T))
    for way in (1, -1):
        N = -n / (nn - way * friction * nt)
        if N >= 0 and way * (t + (nt - way * friction * tt) * N) >= 0:
            found.append((False, N, -way * friction * N))
    return found


def test_painleve_is_looked_for_both_ways_at_rest(built: Built) -> None:
    """A rod at rest that is pushed at its foot: what has one acceleration is told as it is, however large
    the friction; what has several (it sticks, slips into the floor, or is thrown off it) is refused."""
    random, count = np.random.default_rng(1), {1: 0, 3: 0}
    cases = [(2.0, 1.0 * g, 1.5), (2.0, 1.4 * g, 1.5), (2.0, -1.0 * g, 1.5), (2.0, 1.0 * g, 1.3)]
    cases += [
        (float(slope), float(weight) * g, float(friction))
        for slope, weight, friction in random.uniform((0.3, -2, 0.2), (5, 2, 3), (60, 3))
    ]
    with Session(built(pushed())) as session:
        for slope, force, friction in cases:
            expected = accelerations(slope, force, friction)
            theta0 = float(np.arctan(slope))
            values = {"theta": theta0, "y": float(np.sin(theta0)), "mu": friction}
            run = session.run([0.0, 1e-6], values, inputs={"F": [force, force]})
            count[len(expected)] += 1
            if len(expected) > 1:
                assert "'grip': at rest it has several" in run.refusal.message
                continue
            ((parts, N, T),) = expected
            first = run.rows[0]
            assert first["contact.floor"] != parts, (slope, force, friction)
            assert first["lambda.floor"] == pytest.approx(N, rel=1e-9, abs=1e-9)
            assert first["lambda.foot"] == pytest.approx(T, rel=1e-9, abs=1e-9)
    assert min(count.values()) > 0


@pytest.mark.parametrize("grows", [True, False])
def test_what_leaves_its_cone_into_painleve_is_refused(built: Built, grows: bool) -> None:
    """A rod that begins to tip about its foot, tan(theta) = 2, needs 3/10 m g of friction there and has
    N = 17/20 m g: pushed outwards it holds until that is mu N, mu = 1.5, less the former, and has not slipped
    once.  There it would have to slip the way in which the normal force drives itself."""
    edge = -(1.5 * 17 / 20 - 3 / 10) * g
    with instance(built(pushed())) as one:
        one.start({"mu": 1.5, "rise": edge / 1e-3 if grows else 0.0})
        for part in range(9):
            one.set("F", 0.0 if grows else 0.1 * part * edge)
            one.step(1e-4)
            assert one.get("sticks.grip")
        assert one.get("slipping.grip.count") == 0
        one.set("F", 0.0 if grows else 1.1 * edge)
        with pytest.raises(FMICallException):
            one.step(2e-4)
        assert any("sliding has no acceleration, or several" in text for *_, text in one.log)


@pytest.mark.parametrize(
    ("restitution", "friction"), [(0.0, 0.3), (0.5, 0.3), (0.0, 0.1), (1.0, 0.05)]
)
def test_oblique_impact_obeys_newton_and_coulomb(
    built: Built, restitution: float, friction: float
) -> None:
    """A ball without spin: Lambda_t = min(mu Lambda_n, (2/7) m v) and Lambda_n = (1 + e) m v_n, and what
    the motion loses is the heat."""
    fall = float(np.sqrt(2 * g * 0.5))
    values = {"e": restitution, "mu": friction}
    end = fall / g + 1e-6
    run = simulate(built(ball()), stop_time=end, step_size=end, start_values=values)[-1]
    push = min(friction * (1 + restitution) * fall, 2.0 * 2 / 7)
    assert run["der(x)"] == pytest.approx(2.0 - push, abs=1e-5)
    assert 0.1 * run["der(phi)"] == pytest.approx(2.5 * push, abs=1e-5)
    assert run["der(y)"] == pytest.approx(restitution * fall, abs=2e-5)
    total = run["energy.total"] + run["energy.dissipated"]
    assert total == pytest.approx(g * 0.5 + 2.0, rel=1e-9)
    assert run["energy.dissipated"] >= 0


def thrown() -> Model:
    """A uniform rod of length 2 a that is thrown onto the floor with its lower end first."""
    return point_mass(
        "Thrown",
        "x y",
        [
            Contact("floor", y - a * sin(theta), restitution=e),
            Nonholonomic("rub", x.diff() + a * sin(theta) * theta.diff()),
            Friction("grip", of=["rub"], normal=multiplier("floor"), static=mu),
        ],
        angles="theta",
        up=y,
        energy=m * a**2 * theta.diff() ** 2 / 6,
        parameters=[
            Parameter(mu, 0.52, "1"),
            Parameter(a, 1.0, "m"),
            Parameter(e, 0.998, "1", min=0, max=1),
        ],
        start={y: 1.0, theta: 0.5},
    )


def test_friction_in_a_bounce_makes_no_energy(built: Built) -> None:
    """Newton's law of restitution with Coulomb's cone would throw a slanting rod higher than it fell (Kane
    and Levinson 1985): the energy stays what it was where it would rise, and heat is never negative."""
    kept = 0
    with Session(built(thrown())) as session:
        for angle, speed in itertools.product((0.3, 0.7, 1.1), (-3.0, -1.0, 0.5, 2.0)):
            height = float(np.sin(angle)) + 0.01
            values = {"theta": angle, "der(x)": speed, "der(y)": -1.0, "y": height}
            run = session.run([0.0, 0.02], values).rows[-1]
            before = 0.5 * (speed**2 + 1.0) + g * height
            assert run["closing.floor.count"] == 1
            assert run["energy.dissipated"] >= -1e-12
            assert run["energy.total"] + run["energy.dissipated"] == pytest.approx(before, rel=1e-9)
            kept += bool(run["energy.dissipated"] < 1e-9)
    assert kept > 0


@pytest.mark.parametrize("name", ["Belt", "FrictionOscillator", "RoughHemisphere"])
def test_model_exchange_tells_the_same_motion(native_fmu: Built, name: str) -> None:
    """An importer's own integrator, stopped by the indicators of every mode."""
    path = str(native_fmu(name))
    run = {"stop_time": 1.5, "output_interval": 0.05, "relative_tolerance": 1e-9}
    outputs = ["x" if name != "RoughHemisphere" else "theta", "sticks.grip", "slipping.grip.count"]
    ours = simulate_fmu(path, fmi_type="CoSimulation", output=outputs, **run)
    theirs = simulate_fmu(path, fmi_type="ModelExchange", output=outputs, **run)
    at = {round(float(t), 9): k for k, t in enumerate(theirs["time"])}  # the last at an event
    pairs = [(k, at[round(float(t), 9)]) for k, t in enumerate(ours["time"])]
    for column in outputs:
        a, b = (np.asarray(r[column], dtype=float) for r in (ours, theirs))
        for k, j in pairs:
            assert a[k] == pytest.approx(b[j], abs=2e-5), (column, ours["time"][k])


def carried() -> Model:
    """A block on a belt whose speed an importer sets."""
    return point_mass(
        "Carried",
        "x z",
        [
            Contact("belt", z),
            Nonholonomic("ride", x.diff() - F),
            Friction("grip", of=["ride"], normal=multiplier("belt"), static=mu),
        ],
        up=z,
        parameters=[Parameter(mu, 0.5, "1")],
        inputs=[Input(F, "m/s")],
    )


def on_moved_belt() -> Model:
    """A block on a belt of which an importer sets the place, with its rates."""
    return Model(
        name="OnMovedBelt",
        lagrangian=m * (x.diff() ** 2 + z.diff() ** 2) / 2 - m * G * z,
        coordinates={x: "m", y: "m", z: "m"},
        constraints=[
            Contact("floor", z),
            Holonomic("belt", F - y),
            Nonholonomic("ride", x.diff() - y.diff()),
            Friction("grip", of=["ride"], normal=multiplier("floor"), static=mu),
        ],
        parameters=[Parameter(m, 1.0, "kg"), Parameter(G, g, "m/s^2"), Parameter(mu, 0.5, "1")],
        inputs=[Input(F, "m")],
    )


@pytest.mark.parametrize("jump", [0.03, 0.3, 3.0])
@pytest.mark.parametrize(("model", "velocity"), [(carried, "F"), (on_moved_belt, "der(F)")])
def test_what_sticks_to_a_motion_that_jumps_slips(
    built: Built, model: Callable[[], Model], velocity: str, jump: float
) -> None:
    """However small the jump v of a belt's speed, the block slips for v/(mu g), which takes half of m v^2."""
    with instance(built(model())) as one:
        one.start({})
        one.step(0.1)
        one.set(velocity, jump)
        one.step(1.0)
        assert one.get("slipping.grip.count") == 1
        assert one.get("sticks.grip") == 1
        assert one.get("sticking.grip.time") - 0.1 == pytest.approx(jump / (0.5 * g), rel=1e-8)
        assert one.get("energy.dissipated") == pytest.approx(jump**2 / 2, rel=1e-7)


@pytest.mark.parametrize(("model", "velocity"), [(carried, "F"), (on_moved_belt, "der(F)")])
def test_in_model_exchange_it_slips_at_the_event_of_the_jump(
    built: Built, model: Callable[[], Model], velocity: str
) -> None:
    """The belt runs at v = 0.3 m/s from 0.1 s on, an event in time: the block lags by v^2/(2 mu g)."""
    v, rows = 0.3, [(0.0, 0.0, 0.0, 0.0), (0.1, 0.0, 0.0, 0.0)]
    rows += [(0.1, v, 0.0, 0.0), (1.0, v, 0.0, 0.0)]
    if velocity == "der(F)":
        rows[2:] = [(0.1, 0.0, v, 0.0), (1.0, 0.9 * v, v, 0.0)]
    columns = [(name, float) for name in ("time", "F", "der(F)", "der(F,2)")]
    run = simulate_fmu(
        str(built(model())),
        fmi_type="ModelExchange",
        stop_time=1.0,
        input=np.array(rows, dtype=columns),
        relative_tolerance=1e-9,
        output=["x", "slipping.grip.count", "sticking.grip.time"],
    )
    last = run[-1]
    assert last["slipping.grip.count"] == 1
    assert last["sticking.grip.time"] - 0.1 == pytest.approx(v / (0.5 * g), rel=1e-7)
    assert last["x"] == pytest.approx(0.9 * v - v**2 / (2 * 0.5 * g), rel=1e-8)


def test_a_belt_that_jumps_away_is_slipped_on_until_the_block_has_its_speed(built: Built) -> None:
    """The belt is set from rest to v = 1 m/s at once: one start of slipping, which lasts v/(mu g), and gives
    half of the work of the belt to the block."""
    with instance(built(carried())) as one:
        one.start({})
        one.step(0.1)
        assert one.get("sticks.grip")
        one.set("F", 1.0)
        one.step(0.1)
        assert not one.get("sticks.grip")
        assert one.get("slipping.grip.count") == 1
        assert one.get("slipping.grip.time") == pytest.approx(0.1, abs=1e-15)
        assert one.get("der(x)") == pytest.approx(0.05 * g, rel=1e-9)
        one.step(0.2)
        assert one.get("sticks.grip")
        assert one.get("slipping.grip.count") == 1
        assert one.get("x") == pytest.approx(0.3 - 1 / (2 * 0.5 * g), rel=1e-8)
        assert one.get("energy.dissipated") == pytest.approx(0.5, rel=1e-8)
