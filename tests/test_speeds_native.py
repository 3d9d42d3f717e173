"""Speeds of a model's own in native FMUs: bodies in space, held by rows, rubbing and struck."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from ctypes import c_double, c_size_t
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from fmpy.fmi1 import FMICallException
from instance import Instance, instance
from runs import simulate_fmu
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from single import DISCARD
from zoo.tops import E, R, W, body, geared, thrown_ball

from lagfmu import (
    Contact,
    Model,
    Parameter,
    Peak,
    Scene,
    rotation_matrix,
)
from lagfmu.errors import DerivationError
from lagfmu.testing import find_compiler, playable, prepare

Built = Callable[..., Path]
MASS, G, ARM = 2.0, 9.81, 0.3  # kg, m/s2, m
SPIN = {E[0]: 1.0, W[0]: 0.1, W[1]: 0.2, W[2]: 5.0}
STATES = ("x", "y", "z", "e0", "e1", "e2", "e3", "der(x)", "der(y)", "der(z)", "wx", "wy", "wz")
RATES = ("der(x)", "der(y)", "der(z)", "der(e0)", "der(e1)", "der(e2)", "der(e3)")
RATES += ("der(x,2)", "der(y,2)", "der(z,2)", "der(wx)", "der(wy)", "der(wz)")
PIN = [f"lambda.pin.{a}" for a in "xyz"]
QUATERNION = ["e0", "e1", "e2", "e3"]


def held() -> Model:
    """A heavy top of free coordinates, whose tip three rows hold."""
    return body("HeldTop", held=ARM, start={**SPIN, R[2]: ARM})


def room(e: Sequence[float] | np.ndarray) -> np.ndarray:
    """R(e), from the frame of the body to that of the room."""
    return np.asarray(Rotation.from_quat([*e[1:4], e[0]]).as_matrix())


def about_the_tip(_: float, y: np.ndarray) -> np.ndarray:
    """Euler's equations about the tip, y = (e, w)."""
    e0, e, w = y[0], y[1:4], y[4:]
    J = np.array([1.0 + MASS * ARM**2, 2.0 + MASS * ARM**2, 3.0])
    weight = room(y).T @ [0, 0, -MASS * G]
    torque = np.cross([0, 0, ARM], weight)
    turn = (e0 * w + np.cross(e, w)) / 2
    return np.concatenate([[-e @ w / 2], turn, (np.cross(J * w, w) + torque) / J])


def force_at_the_tip(y: np.ndarray) -> np.ndarray:
    """m (a - g) [N] in the frame of the room: what holds the top."""
    w, turning_up, r = y[4:], about_the_tip(0, y)[4:], np.array([0, 0, ARM])
    a = room(y) @ (np.cross(turning_up, r) + np.cross(w, np.cross(w, r)))
    force: np.ndarray = MASS * (a + np.array([0, 0, G]))
    return force


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_rows_hold_a_top_with_the_force_of_newtons_law(built: Built, kind: str) -> None:
    """The multipliers of x - R(e) l = 0 are the force at the tip, m (a - g) [N], with a from Euler's
    equations about it; Q of the speeds is its moment about the centre of mass in the body's frame."""
    torque, end = ["Q.wx", "Q.wy", "Q.wz"], [*QUATERNION, "wx", "wy", "wz"]
    run = simulate_fmu(
        built(held()),
        stop_time=1.0,
        output_interval=0.05,
        relative_tolerance=1e-10,
        fmi_type=kind,
        output=[*end, *PIN, *torque, "energy.total"],
    )
    begin = [1, 0, 0, 0, 0.1, 0.2, 5.0]
    y = solve_ivp(about_the_tip, (0, 1), begin, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    close = 1e-11 if kind == "CoSimulation" else 1e-8
    np.testing.assert_allclose([run[n][-1] for n in end], y, rtol=0, atol=close)
    force = force_at_the_tip(y)
    np.testing.assert_allclose([run[n][-1] for n in PIN], force, rtol=0, atol=10 * close)
    moment = np.cross([0, 0, -ARM], room(y).T @ force)
    np.testing.assert_allclose([run[n][-1] for n in torque], moment, rtol=0, atol=10 * close)
    np.testing.assert_allclose(run["energy.total"], run["energy.total"][0], rtol=close, atol=0)


def times(a: Any, b: Any) -> np.ndarray:
    """Product of quaternions."""
    (a0, a1), (b0, b1) = (a[0], np.array(a[1:])), (b[0], np.array(b[1:]))
    return np.array([a0 * b0 - a1 @ b1, *(a0 * b1 + b0 * a1 + np.cross(a1, b1))])


def about(axis: Any, angle: float) -> np.ndarray:
    """The quaternion of a turn about a unit vector."""
    return np.array([np.cos(angle / 2), *(np.sin(angle / 2) * np.array(axis))])


def test_a_symmetric_top_without_torque_precesses_about_its_angular_momentum(built: Built) -> None:
    """e(t) = (turn by |L| t/A about L) e(0) (turn by (1 - C/A) w3 t about the axis), for 300 turns; the norm
    of e stays 1 to rounding, energy and angular momentum to the tolerance."""
    A, C, w = 1.5, 2.4, np.array([0.8, 0.3, 6.0])
    start = {E[0]: 1.0, **dict(zip(W, w.tolist(), strict=True))}
    run = simulate_fmu(
        built(body("Precessing", (A, A, C), start=start)),
        stop_time=200.0,
        output_interval=0.5,
        relative_tolerance=1e-11,
        output=[*QUATERNION, "wx", "wy", "wz", "energy.kinetic"],
    )
    L = np.array([A, A, C]) * w
    size = np.linalg.norm(L)
    axis = L / size
    e = np.array([run[n] for n in QUATERNION]).T
    expected = [
        times(about(axis, size / A * t), about([0, 0, 1], (1 - C / A) * w[2] * t))
        for t in run["time"]
    ]
    np.testing.assert_allclose(e, expected, rtol=0, atol=2e-8)
    np.testing.assert_allclose((e**2).sum(axis=1), 1.0, rtol=0, atol=4 * 2.3e-16)
    np.testing.assert_allclose(run["energy.kinetic"], run["energy.kinetic"][0], rtol=1e-9)
    own = np.array([A * run["wx"], A * run["wy"], C * run["wz"]]).T
    still = [room(a) @ b for a, b in zip(e, own, strict=True)]
    np.testing.assert_allclose(still, np.tile(L, (len(still), 1)), rtol=0, atol=1e-8)


def stepped(one: Instance, steps: int) -> list[dict[str, Any]]:
    """The outputs after each step of 0.05 s."""
    record = []
    for _ in range(steps):
        one.step(0.05)
        record.append(one.outputs())
    return record


def test_a_saved_top_has_one_future(built: Built) -> None:
    """Put back, or read from bytes by a fresh instance: the same bits."""
    path = built(held())
    with instance(path) as one, instance(path, "fresh") as fresh:
        one.start({}, tolerance=1e-9)
        stepped(one, 7)
        state, moment = one.fmu.getFMUstate(), one.time
        saved = one.fmu.serializeFMUstate(state)
        first = stepped(one, 20)
        one.fmu.setFMUstate(state)
        one.time = moment
        assert stepped(one, 20) == first
        fresh.start()
        fresh.fmu.setFMUstate(fresh.fmu.deSerializeFMUstate(saved))
        fresh.time = moment
        assert stepped(fresh, 20) == first


def test_derivatives_along_the_motion_are_those_of_time(built: Built) -> None:
    """The derivative of every output along (q', v') is what it changes by in time, q' = B v."""
    with instance(built(held())) as one:
        one.start({}, tolerance=1e-12)
        stepped(one, 10)
        known = [one.variables[n].valueReference for n in STATES]
        wanted = [n for n in (*RATES, *PIN, "Q.wx", "Q.wy", "wx", "e2") if n not in STATES[:7]]
        unknown = [one.variables[n].valueReference for n in wanted]
        along = [one.get(n) for n in RATES]
        found = one.fmu.getDirectionalDerivative(unknown, known, along)
        state, moment, h = one.fmu.getFMUstate(), one.time, 1e-3
        values = []
        for steps in range(1, 5):  # forward differences of order 4
            one.fmu.setFMUstate(state)
            one.time = moment
            one.step(steps * h)
            values.append([one.get(n) for n in wanted])
        one.fmu.setFMUstate(state)
        now = np.array([one.get(n) for n in wanted])
        weights = np.array([4, -3, 4 / 3, -1 / 4])
        expected = (weights @ np.array(values) - 25 / 12 * now) / h
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6)


def test_a_rate_of_a_coordinate_has_a_bar_and_a_peak(built: Built) -> None:
    """Error bars cover q' = B v, and its extremes are those of the motion between the points."""
    bars = Scene("HeldBars", error_bars=True)
    names = {"der(e0)": "velocity.e0", "e1": "e1", "wx": "wx", PIN[0]: PIN[0]}
    options: dict[str, Any] = {"stop_time": 1.0, "output_interval": 0.1}
    coarse = simulate_fmu(
        built(held(), bars),
        relative_tolerance=1e-6,
        output=[*names, *(f"error.{n}" for n in names.values())],
        **options,
    )
    fine = simulate_fmu(built(held()), relative_tolerance=1e-12, output=[*names], **options)
    for n, shown in names.items():
        assert (np.abs(coarse[n] - fine[n]) <= coarse[f"error.{shown}"]).all(), n
    spinning = body("SpinPeak", start={E[0]: 1.0, W[2]: 5.0}, peaks=[Peak("der(e0)")])
    with instance(built(spinning)) as one:
        one.start({}, tolerance=1e-10)
        one.step(2.0)
        found = [one.get(f"peak.velocity.e0.{part}") for part in ("max", "min", "min_time")]
    assert found == pytest.approx([2.5, -2.5, np.pi / 5], abs=1e-6)  # e0' = -5/2 sin(5 t/2)


def test_a_scene_may_ask_for_one_coordinate(built: Built) -> None:
    """Nothing is eliminated where rates are no speeds, also if no multiplier is read."""
    alone = Scene("HeldAlone", outputs=["e0"])
    run = simulate_fmu(built(held(), alone), stop_time=0.2, output=["e0"])
    whole = simulate_fmu(built(held()), stop_time=0.2, output=["e0"])
    np.testing.assert_allclose(run["e0"], whole["e0"], rtol=0, atol=1e-9)
    with pytest.raises(DerivationError, match="which are no speeds where `kinematics` stand"):
        prepare(held(), Scene("HeldLess", formulation="minimal"))


@pytest.mark.parametrize("method", ["dop853", "radau", "rk4"])
def test_every_method_turns_the_top_alike(built: Built, method: str) -> None:
    """The Jacobian of radau holds that of q' = B v, and fixed steps are projected too."""
    with instance(built(held())) as one:
        one.start({"solver.method": method}, tolerance=1e-8)
        stepped(one, 20)
        found = [one.get(n) for n in ("e0", "wx", PIN[0])]
        steps = one.get("solver.steps")
    assert found == pytest.approx([-0.801964870513, -0.043649387022, -0.909505336980], abs=1e-7)
    assert steps < 600


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_a_ball_thrown_without_spin_rolls_after_its_time(built: Built, kind: str) -> None:
    """It rolls after 2 v0/(7 mu g), at 5/7 of its velocity, whatever its attitude; what friction takes is
    missing in the energy."""
    names = ["der(x)", "der(y)", "sticking.grip.time", "energy.total", "energy.dissipated"]
    run = simulate_fmu(
        built(thrown_ball()),
        stop_time=1.0,
        output_interval=0.05,
        relative_tolerance=1e-9,
        fmi_type=kind,
        output=names,
    )
    rolls = 2 * 5.0 / (7 * 0.3 * G)
    found = [run[n][-1] for n in names[:3]]
    assert found == pytest.approx([3 * 5 / 7, 4 * 5 / 7, rolls], rel=1e-8)
    total = run["energy.total"] + run["energy.dissipated"]
    np.testing.assert_allclose(total, total[0], rtol=1e-10)


def test_a_bouncing_ball_takes_spin_from_the_floor(built: Built) -> None:
    """At each impact the floor's friction gives an impulse in speeds: from v0 = 5 m/s sliding impulses
    mu times the normal ones take 5/2 of their part of the velocity as spin; energy is balanced."""
    names = ["der(x)", "der(y)", "wx", "wy", "wz", *QUATERNION]
    names += ["closing.floor.count", "closing.floor.impulse", "energy.total", "energy.dissipated"]
    with instance(built(thrown_ball())) as one:
        one.start({"z": 0.6, "e": 0.5}, tolerance=1e-10)
        one.step(0.4)
        found = {n: one.get(n) for n in names}
        one.step(1.0)
        end = one.get("energy.total") + one.get("energy.dissipated")
    assert found["closing.floor.count"] == 1
    impulse = 1.5 * MASS * np.sqrt(2 * G * 0.5)
    assert found["closing.floor.impulse"] == pytest.approx(impulse, rel=1e-9)
    slower = 0.3 * impulse / MASS
    assert np.hypot(found["der(x)"], found["der(y)"]) == pytest.approx(5 - slower, rel=1e-9)
    spin = room([found[n] for n in QUATERNION]) @ [found[f"w{a}"] for a in "xyz"]
    gained = 2.5 * slower / 0.1  # J w = r mu Lambda
    np.testing.assert_allclose(spin, [-0.8 * gained, 0.6 * gained, 0], rtol=1e-9, atol=1e-9)
    begin = MASS * (25 / 2 + G * 0.6)
    assert end == pytest.approx(begin, rel=1e-10)


def test_a_gear_goes_through_a_thousand_turns(built: Built) -> None:
    """The wheel's angle equals 2 atan2(e3, e0) modulo 2 pi and counts 1,000 turns, with which the shaft
    keeps pace; also from a state that was saved on the way."""
    with instance(built(geared())) as one:
        one.start({}, tolerance=1e-10)
        for _ in range(100):
            one.step(1.0)
        saved = one.fmu.serializeFMUstate(one.fmu.getFMUstate())
    with instance(built(geared()), "later") as one:
        one.start({}, tolerance=1e-10)
        one.fmu.setFMUstate(one.fmu.deSerializeFMUstate(saved))
        one.time = 100.0
        for _ in range(110):
            one.step(1.0)
        end = {n: one.get(n) for n in ("phi", "psi", "e0", "e3", "wz", "residual.gear")}
    assert end["wz"] == pytest.approx(30.0, rel=1e-12)
    assert end["phi"] == pytest.approx(30.0 * 210, rel=1e-9)
    assert end["psi"] == pytest.approx(70.0 * 210, rel=1e-9)
    assert abs(end["residual.gear"]) <= 1e-15 * 7 * end["phi"] * 4
    apart = (end["phi"] - 2 * np.arctan2(end["e3"], end["e0"])) / (2 * np.pi)
    assert apart == pytest.approx(round(apart), abs=1e-12)


def told(path: Path, values: dict[str, float]) -> tuple[bool, Sequence[str]]:
    """Whether it starts with these values, and what it says."""
    with instance(path) as one:
        try:
            one.start(values)
        except FMICallException:
            return False, [text for *_, text in one.log]
        return True, [text for *_, text in one.log]


def test_a_quaternion_set_in_part_is_normalized_and_none_of_norm_0_starts(built: Built) -> None:
    """Each value that is moved is told with both numbers, those of speeds by their names; (0, 0, 0, 0) turns
    nothing and is refused by name."""
    started, said = told(built(held()), {"e0": 0.9, "e1": 0.3})
    assert started
    assert any(
        "start value e1 = 0.3 misses the constraints: projected to 0.3162277" in s for s in said
    )
    assert any("were left out follow" in s and "der(x) = 0.0" in s for s in said), said
    started, said = told(built(held()), {"e0": 0.0})
    assert not started
    assert any("the quaternion e0, e1, e2, e3 is (0, 0, 0, 0)" in s for s in said)


def dumbbell() -> Model:
    """A body in weight over a floor, on which two points of its third axis rebound."""
    m, g, arm = sp.symbols("m g l", positive=True)
    e = sp.Symbol("e", nonnegative=True)
    plain = body("Dumbbell", start={E[0]: 0.8, E[1]: 0.6, R[2]: 1.0, W[0]: 0.7, W[2]: 2.0})
    tips = [R[2] + s * arm * rotation_matrix(E)[2, 2] for s in (1, -1)]
    more = (Parameter(g, G, "m/s2"), Parameter(arm, 0.5, "m"), Parameter(e, 1.0, "1"))
    return replace(
        plain,
        lagrangian=plain.lagrangian - m * g * R[2],
        constraints=[Contact(f"tip{k}", f, restitution=e) for k, f in enumerate(tips)],
        parameters=[*plain.parameters, *more],
    )


def test_a_dumbbell_that_rebounds_keeps_its_energy_and_lies_in_the_end(built: Built) -> None:
    """Fifteen elastic impacts of its ends keep the energy and the angular momentum about the vertical;
    with e = 0.5 both ends come to lie on the floor."""
    names = [*QUATERNION, "wx", "wy", "wz", "energy.total", "z"]
    names += [f"closing.tip{k}.count" for k in (0, 1)] + [f"contact.tip{k}" for k in (0, 1)]
    options: dict[str, Any] = {
        "output_interval": 0.05,
        "relative_tolerance": 1e-10,
        "output": names,
    }
    run = simulate_fmu(built(dumbbell()), stop_time=10.0, **options)
    assert run["closing.tip0.count"][-1] + run["closing.tip1.count"][-1] >= 15
    np.testing.assert_allclose(run["energy.total"], run["energy.total"][0], rtol=1e-9)
    own = zip(*(J * run[f"w{a}"] for J, a in zip((1, 2, 3), "xyz", strict=True)), strict=True)
    e = np.array([run[n] for n in QUATERNION]).T
    upright = [(room(a) @ b)[2] for a, b in zip(e, own, strict=True)]
    np.testing.assert_allclose(upright, upright[0], rtol=1e-8)
    rest = simulate_fmu(built(dumbbell()), stop_time=20.0, start_values={"e": 0.5}, **options)
    assert rest["contact.tip0"][-1]
    assert rest["contact.tip1"][-1]
    assert abs(rest["z"][-1]) < 1e-12


def test_a_page_runs_the_top_as_the_binary_does(built: Built) -> None:
    """In wasmtime each value is that of the FMU, but for rounding in the C library."""
    compiler = find_compiler()
    if compiler is None or not compiler.cross:
        pytest.skip("no ziglang: pip install -e '.[native]'")
    wasm = pytest.importorskip("wasm", reason="pip install -e '.[test]'")
    page = playable(built(held(), whole=True))
    found = wasm.Module(page.module, page.facts).simulate(np.linspace(0, 1, 21))
    names = [n for n in found.dtype.names if n.startswith(("e", "w", "lambda", "der", "Q"))]
    run = simulate_fmu(built(held()), stop_time=1.0, output_interval=0.05, output=names)
    for n in names:
        np.testing.assert_allclose(found[n], run[n], rtol=0, atol=1e-9)


def test_a_solver_of_model_exchange_may_leave_the_norm_but_not_the_rotations(
    built: Built, library: Any
) -> None:
    """A quaternion of another norm is read as its rotation, with the derivatives of that; of norm 0 it is
    discarded, and the cause is told."""
    one = library(built(held())).continuous()
    states = [0.0, 0.0, ARM, 1.0, 0.0, 0.0, 0.0, 0.06, -0.03, 0.0, 0.1, 0.2, 5.0]
    one.states(states)
    expected = one.array("GetDerivatives", 13)
    one.states([*states[:3], 1.001, *states[4:]])
    np.testing.assert_allclose(one.array("GetDerivatives", 13), expected, rtol=0, atol=1e-13)
    nothing = (c_double * 13)(*states[:3], *[0.0] * 4, *states[7:])
    reason = one.refuses("SetContinuousStates", nothing, c_size_t(13), status=DISCARD)
    assert "the quaternion e0, e1, e2, e3 is (0, 0, 0, 0)" in reason
