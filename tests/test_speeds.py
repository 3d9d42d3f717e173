"""Speeds of a model's own, q' = B v + b: Boltzmann's and Hamel's equations are Newton's and Euler's."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.linalg import expm
from sympy.physics.mechanics import dynamicsymbols
from zoo.tops import E, W, chain, reference, top, turning

from lagfmu import (
    Holonomic,
    Input,
    Model,
    Nonholonomic,
    Parameter,
    derive,
    rotation_matrix,
    simulate,
)
from lagfmu.errors import ModelError
from lagfmu.testing import (
    Carried,
    Differential,
    Form,
    lower,
    model_source,
    prepare,
    written_out,
)

X, Y, PHI, R, S, U = dynamicsymbols("x y phi vr vt u")
m, k = sp.symbols("m k", positive=True)
TARGETS = ("native", "python")


def test_a_heavy_top_turns_by_eulers_equations() -> None:
    """J w' = (J w) x w + tau; the quaternion keeps its norm by normalization, without a multiplier."""
    run = simulate(top(), target="python", stop_time=1.0, tolerance=1e-10)
    expected = reference(1.0)
    assert {n: run[n][-1] for n in expected} == pytest.approx(expected, abs=1e-12)
    norm = sum(run[f"e{i}"] ** 2 for i in range(4))
    np.testing.assert_allclose(norm, 1.0, rtol=0, atol=1e-15)
    assert not [n for n in run.units if n.startswith("lambda")]


def particle(**more: Any) -> Model:
    """A mass on a spring in the plane, in Cartesian coordinates."""
    energy = m * (X.diff() ** 2 + Y.diff() ** 2) / 2 - k * (X**2 + Y**2) / 2
    options: dict[str, Any] = {
        "start": {X: 1.0, X.diff(): 0.3, Y.diff(): 0.7},
        "parameters": [Parameter(m, 2.0, "kg"), Parameter(k, 3.0, "N/m")],
    }
    return Model(
        "Particle",
        coordinates={X: "m", Y: "m"},
        lagrangian=energy,
        **{**options, **more},
    )


def radial(turn: Any = 0) -> dict[str, Any]:
    """Its speeds along the radius and across it, in a frame that turns at the rate `turn`."""
    r = sp.sqrt(X**2 + Y**2)
    return {
        "speeds": {R: "m/s", S: "m/s"},
        "kinematics": {X: (X * R - Y * S) / r - turn * Y, Y: (Y * R + X * S) / r + turn * X},
    }


@pytest.mark.parametrize("turn", [0, 1.5], ids=["resting", "turning"])
def test_the_motion_is_that_of_the_rates(turn: float) -> None:
    """Radial and transverse speeds, which are the rates of no coordinates, move a particle as x' and y' do;
    likewise relative to a turning frame, q' = B v + b."""
    plain = simulate(particle(), target="python", stop_time=2.0, tolerance=1e-10)
    w = sp.Symbol("w")
    parameters = [*particle().parameters, Parameter(w, turn, "rad/s")]
    own = particle(start={X: 1.0, R: 0.3, S: 0.7 - turn}, parameters=parameters, **radial(w))
    other = simulate(own, target="python", stop_time=2.0, tolerance=1e-10)
    for name in ("x", "y", "energy.total"):
        if name != "energy.total" or not turn:
            np.testing.assert_allclose(other[name], plain[name], rtol=0, atol=1e-10)


def test_a_free_particle_moves_straight_over_a_turntable_that_speeds_up() -> None:
    """q' = v + b(q, t), where B = 1 and the rate w(t) of the table grows: with the components of the velocity
    in the room, along the table's axes, as speeds, x + i y = (x0 + v0 t) exp(-i phi), phi' = w."""
    w, tau = sp.symbols("w tau", positive=True)
    rate = w * (1 + dynamicsymbols._t / tau)
    model = Model(
        "Turntable",
        coordinates={X: "m", Y: "m"},
        speeds={R: "m/s", S: "m/s"},
        kinematics={X: R + rate * Y, Y: S - rate * X},
        kinetic_energy=m * (R**2 + S**2) / 2,
        parameters=[
            Parameter(m, 2.0, "kg"),
            Parameter(w, 1.5, "rad/s"),
            Parameter(tau, 0.7, "s"),
        ],
        start={X: 1.0, R: 0.3, S: 0.7},
    )
    run = simulate(model, target="python", stop_time=2.0, tolerance=1e-11)
    t = run["time"]
    back = np.exp(-1.5j * (t + t**2 / 1.4))
    np.testing.assert_allclose(
        run["x"] + 1j * run["y"], (1 + (0.3 + 0.7j) * t) * back, rtol=0, atol=1e-9
    )
    np.testing.assert_allclose(run["vr"] + 1j * run["vt"], (0.3 + 0.7j) * back, rtol=0, atol=1e-9)


@pytest.mark.parametrize("target", TARGETS)
def test_a_belt_that_an_input_moves_carries_inertia(target: str) -> None:
    """x' = u + w with the speed u of a block relative to a belt at w(t) = a t, that holds it by a rod (y = x)
    to another: T = m (x'^2 + y'^2)/2, so that both go on at their own speed, and the FMU knows w' = a."""
    w = dynamicsymbols("w")
    model = Model(
        "Belted",
        coordinates={X: "m", Y: "m"},
        speeds={U: "m/s"},
        kinematics={X: U + w},
        kinetic_energy=m * (X.diff() ** 2 + Y.diff() ** 2) / 2,
        forces={U: k},
        constraints=[Holonomic("rod", X - Y)],
        inputs=[Input(w, "m/s")],
        parameters=[Parameter(m, 2.0, "kg"), Parameter(k, 3.0, "N")],
    )
    t = np.linspace(0, 1, 11)
    moved = {"time": t, "w": 5.0 * t, "der(w)": np.full(11, 5.0), "der(w,2)": np.zeros(11)}
    table = np.array(
        list(zip(*moved.values(), strict=True)), dtype=[(name, float) for name in moved]
    )
    run = simulate(model, target=target, stop_time=1.0, step_size=0.1, inputs=table)
    np.testing.assert_allclose(run["x"], 3.0 / 4 * run["time"] ** 2 / 2, rtol=0, atol=1e-10)
    np.testing.assert_allclose(run["lambda.rod"], -1.5, rtol=1e-10)
    np.testing.assert_allclose(run["der(u)"], 0.75 - 5.0, rtol=1e-10)


@pytest.mark.parametrize("lever", [1, 2])
def test_a_force_may_lag_behind_the_motion(lever: int) -> None:
    """What no speed moves is no direction of motion: m x'' = -k z with z' = (x - z)/tau, whatever
    the speed x' = lever vr."""
    tau = sp.Symbol("tau", positive=True)
    model = Model(
        "Lagging",
        coordinates={X: "m", Y: "m"},
        speeds={R: "m/s"},
        kinematics={X: lever * R, Y: (X - Y) / tau},
        kinetic_energy=m * X.diff() ** 2 / 2,
        forces={R: -lever * k * Y},
        parameters=[*particle().parameters, Parameter(tau, 0.5, "s")],
        start={X: 1.0},
    )
    run = simulate(model, target="python", stop_time=1.0, tolerance=1e-11)
    end = expm(np.array([[0, 1, 0], [0, 0, -1.5], [2, 0, -2]])) @ [1, 0, 0]
    assert [run["x"][-1], run["y"][-1]] == pytest.approx([end[0], end[2]], abs=1e-9)


def test_a_force_of_constraint_is_conjugate_to_its_speed() -> None:
    """A bead on a circle in radial speed: lambda = -m v^2/r is the force along the radius, and Q of the
    radial speed is lambda too (W per m/s), in newtons."""
    a = sp.Symbol("a", positive=True)
    circle = Holonomic("circle", sp.sqrt(X**2 + Y**2) - a)
    parameters = [*particle().parameters, Parameter(a, 1.0, "m")]
    start = {X: 1.0, S: 0.7}
    own = particle(constraints=[circle], start=start, parameters=parameters, **radial())
    run = simulate(own, target="python", stop_time=2.0)
    v, lam = run["vt"], run["lambda.circle"]
    np.testing.assert_allclose(lam, 3.0 - 2.0 * v**2, rtol=0, atol=1e-9)
    np.testing.assert_allclose(run["Q.vr"], lam, rtol=0, atol=1e-12)
    np.testing.assert_allclose(run["Q.vt"], 0.0, rtol=0, atol=1e-12)
    assert run.units["Q.vr"] == "N"


def test_speeds_may_stand_in_a_rolling_condition() -> None:
    """A knife edge whose speeds are forward and lateral: lateral = 0 is its constraint, and lambda [N] the
    force m u w across, which the curved path needs."""
    J = sp.Symbol("J", positive=True)
    w = dynamicsymbols("w")
    model = Model(
        "Blade",
        coordinates={X: "m", Y: "m", PHI: "rad"},
        speeds={U: "m/s", S: "m/s", w: "rad/s"},
        kinematics={
            X: U * sp.cos(PHI) - S * sp.sin(PHI),
            Y: U * sp.sin(PHI) + S * sp.cos(PHI),
            PHI: w,
        },
        kinetic_energy=m * (U**2 + S**2) / 2 + J * w**2 / 2,
        constraints=[Nonholonomic("blade", S)],
        parameters=[Parameter(m, 2.0, "kg"), Parameter(J, 0.1, "kg.m2")],
        start={U: 1.5, w: 2.0},
    )
    run = simulate(model, target="python", stop_time=1.0)
    np.testing.assert_allclose(run["lambda.blade"], 2.0 * 1.5 * 2.0, rtol=1e-9)
    np.testing.assert_allclose(run["y"], 0.75 * (1 - np.cos(2.0 * run["time"])), rtol=0, atol=1e-9)


def test_an_angle_goes_on_through_many_turns() -> None:
    """An angle that equals an arctangent modulo 2 pi, with a rate of its own, counts the turns."""
    e0, e3 = E[0], E[3]
    model = Model(
        "Turns",
        coordinates={**dict.fromkeys(E, "1"), PHI: "rad"},
        speeds=dict.fromkeys(W, "rad/s"),
        kinematics={**turning(), PHI: W[2]},
        unwrapped={PHI: 2 * sp.atan2(e3, e0)},
        kinetic_energy=k * sum(w**2 for w in W) / 2,
        parameters=[Parameter(k, 1.0, "kg.m2")],
        start={e0: 1.0, W[2]: 20.0},
    )
    run = simulate(model, target="python", stop_time=3.0)
    np.testing.assert_allclose(run["phi"], 20.0 * run["time"], rtol=0, atol=1e-6)
    half = 2 * np.arctan2(run["e3"], run["e0"])
    np.testing.assert_allclose(np.cos(run["phi"] - half), 1.0, rtol=0, atol=1e-14)


def test_a_quaternion_that_is_set_in_part_is_normalized() -> None:
    """The nearest unit quaternion is taken, and each value that it moves is told."""
    given = {"e0": 1.0, "e1": 1.0, "e3": 0.0}
    with pytest.warns(UserWarning, match="e0 = 1.0 misses the constraints: projected to 0.7071"):
        run = simulate(top(), target="python", stop_time=0.1, start_values=given)
    assert [run["e0"][0], run["e1"][0]] == pytest.approx([0.5**0.5] * 2, abs=1e-15)


WRONG = {
    "of nothing": ({"kinematics": {X: R, PHI: R}}, "phi, which is no coordinate"),
    "quadratic": ({"kinematics": {X: R * S, Y: S}}, "not affine in the speeds"),
    "idle": ({"kinematics": {X: R}}, "speed vt moves nothing"),
    "unit": ({"kinematics": {X: R, Y: S * k}}, "kinematics of y"),
    "inertia of what lags": (
        {"kinematics": {X: R + S, Y: -X * k}},
        "the rate of y, which no speed",
    ),
    "too many": ({"kinematics": {X: R + S}}, "no more speeds"),
}


@pytest.mark.parametrize("case", WRONG)
def test_kinematics_that_are_wrong_are_named(case: str) -> None:
    """What moves nothing, is no rate, or leaves no equation, is refused by name."""
    given, told = WRONG[case]
    options = {"speeds": {R: "m/s", S: "m/s"}, "start": {}, **given}
    with pytest.raises(ModelError, match=told):
        particle(**options)


def test_kinematics_that_restrict_the_motion_are_refused() -> None:
    """A blade's speeds without the lateral one: their commutator leads sideways, so that the kinematics are a
    nonholonomic constraint without its force."""
    w = dynamicsymbols("w")
    model = Model(
        "Blade",
        coordinates={X: "m", Y: "m", PHI: "rad"},
        speeds={U: "m/s", w: "rad/s"},
        kinematics={X: U * sp.cos(PHI), Y: U * sp.sin(PHI), PHI: w},
        kinetic_energy=m * U**2 / 2 + m * k * w**2 / 2,
        parameters=[Parameter(m, 2.0, "kg"), Parameter(k, 1.0, "m2")],
    )
    with pytest.raises(ModelError, match="which so restrict the motion"):
        simulate(model, target="python", stop_time=0.1)


def test_a_free_particle_is_not_pushed_by_a_scale_that_is_prescribed() -> None:
    """x' = a(t) u with a = 1 + t/2: p = m a^2 u turns by a', and x = 0.3 t."""
    a = dynamicsymbols("a")
    model = Model(
        "Scale",
        coordinates={X: "m"},
        speeds={U: "m/s"},
        kinematics={X: a * U},
        kinetic_energy=m * (a * U) ** 2 / 2,
        inputs=[Input(a, "1", start=1.0, rate=0.5, rates="given")],
        parameters=[Parameter(m, 2.0, "kg")],
        start={U: 0.3},
    )
    run = simulate(model, target="python", stop_time=1.0, tolerance=1e-10)
    np.testing.assert_allclose(run["x"], 0.3 * run["time"], rtol=0, atol=1e-9)
    np.testing.assert_allclose(run["u"], 0.3 / (1 + run["time"] / 2), rtol=0, atol=1e-9)


def test_rotation_matrices_closed_or_written_out_are_the_same_equations() -> None:
    """R' = R [w]x is the derivative of R's polynomials, of whatever norm: G, nu, gamma and F of a body
    that turns about a point of its own, with its weight, are the same numbers either way."""
    R, g = rotation_matrix(E), sp.Symbol("g")
    place = sp.Matrix(dynamicsymbols("x y z"))
    pin = place + R * sp.Matrix([0, 0, -k])
    turn = (R.T * sp.Matrix([0, 1, 0]))[0]

    def model(change: Any) -> Model:
        """With its conditions and its energy as they come, or changed."""
        kinetic = sum(c.diff() ** 2 for c in place) * m / 2 + m * k**2 * sum(w**2 for w in W) / 2
        return Model(
            "Pinned",
            coordinates={**dict.fromkeys(place, "m"), **dict.fromkeys(E, "1")},
            speeds=dict.fromkeys(W, "rad/s"),
            kinematics=turning(),
            lagrangian=kinetic - m * g * change((pin + R * sp.Matrix([k, 0, k]))[2]),
            constraints=[
                *(Holonomic(f"pin_{c}", change(f)) for c, f in zip("xyz", pin, strict=True)),
                Holonomic("turn", change(turn)),
            ],
            parameters=[
                Parameter(m, 2.0, "kg"),
                Parameter(k, 0.3, "m"),
                Parameter(sp.Symbol("g"), 9.81, "m/s2"),
            ],
        )

    generator = np.random.default_rng(3)
    q = generator.normal(size=7)
    v, p = generator.normal(size=6), [2.0, 0.3, 9.81]
    found = [
        lower(Form(derive(model(change)))).assemble(0.0, q, v, [], p)
        for change in (lambda x: x, written_out)
    ]
    for closed, written in zip(*found, strict=True):
        np.testing.assert_allclose(closed, written, rtol=0, atol=1e-13)


def test_vectors_on_a_body_are_differentiated_as_their_polynomials_are() -> None:
    """R s, R (w x s) and R (w x (w x s)) change with the attitude, with w and with s as their polynomials do,
    for the numbers of a tangent and for SymPy's derivative by a symbol."""
    s = sp.symbols("s:3", real=True)
    symbols = (*E, *W, *s)
    table = {a: sp.Symbol(f"a{i}", real=True) for i, a in enumerate(symbols)}
    change = {a: sp.Symbol(f"da{i}", real=True) for i, a in enumerate(table.values())}
    generator = np.random.default_rng(7)
    at = {a: generator.normal() for a in (*table.values(), *change.values())}
    for order in range(3):
        vector = Carried(order, 1, *E, *s, *(W if order else (0, 0, 0))).xreplace(table)
        whole = sum(written_out(vector).diff(a) * da for a, da in change.items())
        found = written_out(Differential(change)(vector))
        assert float(found.xreplace(at)) == pytest.approx(float(whole.xreplace(at)), rel=1e-12)
        for a in table.values():
            slope = float(written_out(vector.diff(a)).xreplace(at))
            assert slope == pytest.approx(
                float(written_out(vector).diff(a).xreplace(at)), abs=1e-12
            )


def test_joints_of_a_kind_share_their_code() -> None:
    """Three rods in space, hinged on each other: the native FMU, which loops over tables of joints,
    reports the multipliers of the python one, whose equations are written out; a further rod costs places in
    tables and what is its own, always as much."""
    three = prepare(chain(3))
    runs = [simulate(three, target=t, stop_time=0.2, tolerance=1e-10) for t in TARGETS]
    for name in ("lambda.A0.y", "lambda.A2.x", "lambda.A1.b", "wz2", "Q.wx1"):
        size = np.abs(runs[0][name]).max()
        np.testing.assert_allclose(runs[1][name], runs[0][name], rtol=0, atol=1e-8 * max(size, 1.0))
    texts = [model_source(Form(derive(chain(n)))) for n in (3, 4, 5)]
    lines = [text.count(" = ") for text in texts]
    assert lines[2] - lines[1] == lines[1] - lines[0] < 0.2 * lines[0]


@pytest.mark.parametrize("target", TARGETS)
def test_a_free_body_flies_straight_in_the_velocities_of_its_own_frame(target: str) -> None:
    """Velocities along a body's axes, as of an aircraft, turn with it: m (u' + w x u) = 0, so that in space
    its centre goes straight on however it tumbles."""
    place, u = dynamicsymbols("x y z"), dynamicsymbols("u v w")
    R = rotation_matrix(E)
    moving = dict(zip(place, R * sp.Matrix(u), strict=True))
    energy = m * sum(s**2 for s in u) / 2 + k * (W[0] ** 2 + 2 * W[1] ** 2 + 3 * W[2] ** 2) / 2
    model = Model(
        "Aircraft",
        coordinates={**dict.fromkeys(place, "m"), **dict.fromkeys(E, "1")},
        speeds={**dict.fromkeys(u, "m/s"), **dict.fromkeys(W, "rad/s")},
        kinematics={**moving, **turning()},
        kinetic_energy=energy,
        parameters=[Parameter(m, 2.0, "kg"), Parameter(k, 0.1, "kg.m2")],
        start={E[0]: 1.0, u[0]: 3.0, u[1]: -1.0, W[0]: 0.5, W[1]: 2.0, W[2]: -1.0},
    )
    run = simulate(model, target=target, stop_time=3.0, tolerance=1e-11)
    for name, velocity in (("x", 3.0), ("y", -1.0), ("z", 0.0)):
        np.testing.assert_allclose(run[name], velocity * run["time"], rtol=0, atol=1e-8)
