"""lagfmu linearize: A, B, C, D, poles and modes in coordinates that the constraints leave free."""

from __future__ import annotations

import json
import math
from pathlib import Path

import fmpy
import numpy as np
import pytest
from conftest import MODELS
from fmpy.fmi2 import FMU2Model
from runs import unpacked
from scipy.io import loadmat
from scipy.special import roots_laguerre
from sympy import Matrix, Rational, cos, diff, sin, symbols
from sympy.physics.mechanics import dynamicsymbols
from typer.testing import CliRunner
from zoo import point_mass, whipple
from zoo.pendulums import chain

import lagfmu
from lagfmu import (
    Contact,
    Friction,
    Linearization,
    Model,
    Nonholonomic,
    Parameter,
    Scene,
    linearize,
    multiplier,
)
from lagfmu.errors import SettingError, SimulationError, UsageError
from lagfmu.testing import app

pytestmark = pytest.mark.skipif("not __import__('shutil').which('cc')", reason="no C compiler")

t = dynamicsymbols._t
m, g = symbols("m g", positive=True)
G = 9.81
MASS, GRAVITY = Parameter(m, 2.0, "kg"), Parameter(g, G, "m/s^2")
HANGING = {"x1": 0.1, "y1": -1.0, "x2": 0.1, "y2": -2.0}


def run(*words, code: int = 0) -> str:
    done = CliRunner().invoke(app, [str(w) for w in words])
    assert done.exit_code == code, done.output
    return " ".join(done.output.split())


def frequencies(found: Linearization) -> list[float]:
    """Of the poles that are not zero, the slowest first [rad/s]."""
    return [abs(s) for s in found.poles.values if s.imag >= 0]


def is_close(found: Linearization, expected, rel: float = 1e-9) -> None:
    """The poles that are not zero, whatever their order."""
    have = sorted(found.poles.values, key=lambda s: (round(s.real, 6), s.imag))
    want = sorted(map(complex, expected), key=lambda s: (round(s.real, 6), s.imag))
    scale = max(map(abs, want))
    np.testing.assert_allclose(have, want, rtol=rel, atol=rel * scale)


# ---------------------------------------------------------------------- closed forms


def test_a_double_pendulum_hangs_with_its_normal_modes(native_fmu):
    """In angles M = [[(m1 + m2) L1^2, m2 L1 L2], [m2 L1 L2, m2 L2^2]], K = diag((m1 + m2) g L1, m2 g L2); the
    FMU has Cartesian coordinates and two rods."""
    fmu = native_fmu("DoublePendulum")
    found = linearize(fmu, equilibrium=True, start_values=HANGING)
    m1, m2, gravity, L1, L2 = parameters(fmu, "m1 m2 g L1 L2")
    M = np.array([[(m1 + m2) * L1**2, m2 * L1 * L2], [m2 * L1 * L2, m2 * L2**2]])
    K = np.diag([(m1 + m2) * gravity * L1, m2 * gravity * L2])
    squares, shapes = np.linalg.eig(np.linalg.solve(M, K))
    order = np.argsort(squares)
    assert frequencies(found) == pytest.approx(np.sqrt(squares[order]), rel=1e-11)
    assert sorted(found.states) == ["der(x1)", "der(x2)", "x1", "x2"]
    for k, j in zip((0, 2), order, strict=True):
        ratio = L1 * shapes[0, j] / (L1 * shapes[0, j] + L2 * shapes[1, j])
        shape = dict(zip(found.coordinates, found.shapes[:, k], strict=True))
        assert shape["x1"] / shape["x2"] == pytest.approx(ratio, rel=1e-9)
    assert found.stability.startswith("undamped")


def parameters(fmu: Path, names: str) -> list[float]:
    start = {v.name: v.start for v in fmpy.read_model_description(str(fmu)).modelVariables}
    return [float(start[n]) for n in names.split()]


def test_a_crane_has_a_trolley_that_may_stand_anywhere(native_fmu):
    """M s'' = -c s' + m g phi, m L (s'' + L phi'')/L = -m g phi: s (M s^3 + c s^2 + (M + m) g/L s + c g/L)
    = 0, one pole zero, of which s is what is indifferent.  The force of the drive reaches s by 1/M, the
    rope's tension is m g whatever F is."""
    fmu = native_fmu("Crane")
    found = linearize(fmu, equilibrium=True, inputs=["F"], outputs=["rope.tension", "load.sway"])
    M, load, gravity, c, L = parameters(fmu, "M m g c l")
    is_close(found, np.roots([M, c, (M + load) * gravity / L, c * gravity / L]))
    assert found.poles.zeros == 1
    assert found.poles.indifferent[0][0] in ("s", "x")
    assert found.B[found.states.index("der(s)"), 0] == pytest.approx(1 / M, rel=1e-12)
    assert found.at_outputs[0] == pytest.approx(load * gravity, rel=1e-12)
    assert np.abs(found.C[0]).max() < 1e-8 * load * gravity
    sway = dict(zip(found.states, found.C[1], strict=True))
    assert [sway["s"], sway["x"]] == pytest.approx([-1, 1], rel=1e-12)


def test_hoisting_moves_the_load_by_the_rope(native_fmu):
    """u = l is a prescribed motion: hanging at rest, the tension is m (g - l''), whatever l is."""
    found = linearize(native_fmu("Crane"), equilibrium=True, outputs=["rope.tension"])
    by = dict(zip(found.inputs, found.D[0], strict=True))
    assert by["der(l,2)"] == pytest.approx(-2000.0, rel=1e-9)
    assert [by["l"], by["der(l)"], by["F"]] == pytest.approx([0, 0, 0], abs=1e-6)


def test_half_a_car_bounces_and_pitches_on_its_wheels(native_fmu):
    """With both wheels on a flat road M z'' and J theta'' on two springs and dampers:
    det(s^2 diag(M, J) + (s c + k) [[2, a - b], [a - b, a^2 + b^2]]) = 0 up to signs."""
    fmu = native_fmu("HalfCar")
    M, J, a_, b_, k, c = parameters(fmu, "M J a b k c")
    start = {"s": 25.0, "zf": -0.01, "zr": -0.01}
    found = linearize(fmu, equilibrium=True, start_values=start)
    S = np.array([[2.0, a_ - b_], [a_ - b_, a_**2 + b_**2]])
    inertia = np.diag([1 / M, 1 / J])
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-k * inertia @ S, -c * inertia @ S]])
    is_close(found, np.linalg.eigvals(A))
    assert sorted(found.states) == ["der(theta)", "der(z)", "theta", "z"]
    assert found.stability == "asymptotically stable"


@pytest.mark.parametrize("n", [2, 5])
def test_a_hanging_chain_has_the_zeros_of_a_laguerre_polynomial(n):
    """n equal beads on n equal massless links: omega^2 = (g/L) x with L_n(x) = 0, for n -> oo the zeros of
    Bessel's J0 (Daniel Bernoulli): omega_1 = j_01/2 sqrt(g/(n L))."""
    model = hanging(n)
    start = {f"x{k}": 0.02 * k for k in range(1, n + 1)}
    found = linearize(model, equilibrium=True, start_values=start)
    x, _ = roots_laguerre(n)
    assert frequencies(found) == pytest.approx(np.sqrt(G / 0.5 * x), rel=1e-9)
    assert not found.poles.zeros


def test_a_rolling_disc_weaves_at_speed():
    """A disc that rolls upright at the rate w: (A + m r^2) s^2 = m g r - C (C + m r^2) w^2/A, whose other
    poles are zero: where it is, where it heads, how far it has rolled, and how fast."""
    found = linearize(disc(), outputs=["lambda.along"])
    r, w = 0.3, 8.0
    A, C = 2.0 * r**2 / 4, 2.0 * r**2 / 2
    square = (2.0 * G * r - C * (C + 2.0 * r**2) * w**2 / A) / (A + 2.0 * r**2)
    assert square < 0
    is_close(found, [1j * math.sqrt(-square), -1j * math.sqrt(-square)])
    assert (len(found.states), found.poles.zeros) == (8, 6)
    assert found.drift < 1e-6


def hanging(n: int) -> Model:
    """Beads of 2 kg on links of 0.5 m, x to the right, y up."""
    start = {f"x{k}": 0.0 for k in range(1, n + 1)} | {f"y{k}": -0.5 * k for k in range(1, n + 1)}
    at = {dynamicsymbols(name): value for name, value in start.items()}
    return chain(n, "HangingChain", mass=2.0, length=0.5, start=at)


def disc() -> Model:
    """Yaw, lean, roll (z x y), the centre at (x, y, r cos(lean)); the contact rests on the ground."""
    x, y, yaw, lean, roll = dynamicsymbols("x y yaw lean roll")
    r = symbols("r", positive=True)
    along, height = Matrix([cos(yaw), sin(yaw), 0]), r * cos(lean)
    side = Matrix([-sin(yaw), cos(yaw), 0])
    up = Matrix([0, 0, 1])
    axle = side * cos(lean) + up * sin(lean)  # leaning to the left lifts its right end
    down = side * sin(lean) - up * cos(lean)
    omega = up * yaw.diff() + along * lean.diff() + axle * roll.diff()
    centre = Matrix([x, y, height])
    contact = centre.diff(t) + omega.cross(r * down)
    spin = omega.dot(axle)
    across = omega.dot(omega) - spin**2
    kinetic = m * centre.diff(t).dot(centre.diff(t)) / 2 + m * r**2 * (across / 8 + spin**2 / 4)
    return Model(
        "RollingDisc",
        lagrangian=kinetic - m * g * height,
        coordinates={x: "m", y: "m", yaw: "rad", lean: "rad", roll: "rad"},
        constraints=[
            Nonholonomic("along", contact.dot(along)),
            Nonholonomic("sideways", contact.dot(side)),
        ],
        parameters=[MASS, GRAVITY, Parameter(r, 0.3, "m")],
        start={roll.diff(): 8.0, x.diff(): 0.3 * 8.0, lean: 0.0},
    )


def test_a_fast_top_nutates():
    """Steady precession of a symmetric top (A about the pivot across its axis, C along it): the frequency of
    small nutations is that of A^2 w^2 = p_1^2 + A^2 p^2 sin^2 - ..., from the reduced potential
    V(theta) = (p_phi - p_psi cos theta)^2/(2 A sin^2 theta) + m g l cos theta:  w^2 = V''/A."""
    A, C, theta0, rate, arm = 0.016, 0.006, 0.8, 2.5, 0.1
    spin = 2.0 * G * arm / rate + A * rate * math.cos(theta0)  # p_psi
    found = linearize(top(A, C, arm, theta0, rate, spin))
    th = symbols("th")
    p_phi = spin * math.cos(theta0) + A * rate * math.sin(theta0) ** 2
    V = (p_phi - spin * cos(th)) ** 2 / (2 * A * sin(th) ** 2) + 2.0 * G * arm * cos(th)
    assert float(diff(V, th).subs(th, theta0)) == pytest.approx(0, abs=1e-12)
    w = math.sqrt(float(diff(V, th, 2).subs(th, theta0)) / A)
    assert frequencies(found) == pytest.approx([w], rel=1e-9)
    assert found.poles.zeros == 4
    assert found.drift < 1e-6


def top(A: float, C: float, arm: float, theta0: float, rate: float, spin: float) -> Model:
    theta, phi, psi = dynamicsymbols("theta phi psi")
    J, Jz, l = symbols("J Jz l", positive=True)  # noqa: E741
    axial = psi.diff() + phi.diff() * cos(theta)
    kinetic = J * (theta.diff() ** 2 + (phi.diff() * sin(theta)) ** 2) / 2 + Jz * axial**2 / 2
    return Model(
        "Top",
        lagrangian=kinetic - m * g * l * cos(theta),
        coordinates={theta: "rad", phi: "rad", psi: "rad"},
        parameters=[
            MASS,
            GRAVITY,
            *(Parameter(J, A, "kg.m^2"), Parameter(Jz, C, "kg.m^2"), Parameter(l, arm, "m")),
        ],
        start={
            theta: theta0,
            phi.diff(): rate,
            psi.diff(): spin / C - rate * math.cos(theta0),
        },
    )


@pytest.mark.thorough
def test_whipples_bicycle_weaves_and_capsizes(built):
    """The eigenvalues of Meijaard et al. 2007, Table 2, to their 14 digits: at rest and at 2 m/s it falls,
    at 5 m/s it balances itself, at 8 m/s it capsizes.  The other poles are zero: where it is, where it heads,
    how fast it rolls."""
    fmu = built(whipple.bicycle())
    for v, expected in whipple.PUBLISHED.items():
        found = linearize(fmu, start_values=whipple.speeds(v), outputs=[])
        is_close(found, expected, 1e-12)
        assert (len(found.states), found.poles.zeros) == (10, 6)
        assert found.stability.startswith("stable" if v == 5.0 else "unstable")


def test_a_pendulum_upside_down_falls(native_fmu):
    """+-sqrt(g/L) = +-sqrt(9.81/1) at y = +L, of the Cartesian pendulum; the same in its angle."""
    fmu = native_fmu("PendulumCartesian")
    (L,) = parameters(fmu, "L")
    found = linearize(fmu, equilibrium=True, start_values={"x": 0.05, "y": L})
    w = math.sqrt(parameters(fmu, "g")[0] / L)
    is_close(found, [w, -w], 1e-11)
    assert found.states == ("x", "der(x)")
    assert found.stability.startswith("unstable")
    assert found.point["y"] == pytest.approx(L, rel=1e-14)


# ---------------------------------------------------------------------- what it shares with others


def test_an_importer_finds_the_same_poles(native_fmu):
    """Directional derivatives of all states, as any importer asks for them: their eigenvalues hold those of
    the mechanism, beside those of the constraints."""
    fmu = native_fmu("Crane")
    found = linearize(fmu, equilibrium=True)
    folder, description = unpacked(fmu)
    one = FMU2Model(
        guid=description.guid,
        unzipDirectory=folder,
        modelIdentifier=description.modelExchange.modelIdentifier,
        instanceName="importer",
    )
    one.instantiate()
    one.setupExperiment()
    reference = {v.name: v.valueReference for v in description.modelVariables}
    start = {**found.point, **dict(zip(found.inputs, found.at_inputs, strict=True))}
    one.setReal([reference[n] for n in start], list(start.values()))
    one.enterInitializationMode()
    one.exitInitializationMode()
    while one.newDiscreteStates()[0]:
        pass
    one.enterContinuousTimeMode()
    rates = [u.variable.valueReference for u in description.derivatives]
    states = [reference[u.variable.derivative.name] for u in description.derivatives]
    A = np.array([one.getDirectionalDerivative(rates, [s], [1.0]) for s in states]).T
    one.freeInstance()
    every = np.linalg.eigvals(A)
    assert len(every) == len(found.states) + 2
    for s in found.poles.values:
        assert np.abs(every - s).min() < 1e-9 * abs(found.poles.values).max()


def test_runs_beside_the_point_are_what_the_matrices_say(native_fmu):
    """x(T) after small displacements and a small force, by central differences of runs of the FMU, is
    exp(A T) and its integral times B; so is lambda with C and D."""
    from scipy.linalg import expm

    fmu, T, h = native_fmu("CartPendulum"), 0.7, 1e-4
    found = linearize(fmu, equilibrium=True, outputs=["lambda.rod", "Q.x"])
    k, n = len(found.states), len(found.inputs)
    both = expm(T * np.block([[found.A, found.B], [np.zeros((n, k + n))]]))
    names = [*found.states, *found.outputs]
    rest = dict(found.point)

    def end(**changed) -> np.ndarray:
        values = rest | dict(zip(found.inputs, found.at_inputs, strict=True)) | changed
        ran = lagfmu.simulate(fmu, T, step_size=T, tolerance=1e-12, start_values=values)
        return np.array([ran[name][-1] for name in names])

    T_x = {n: tangent(found, n) for n in found.states}
    for j, name in enumerate([*found.states, *found.inputs]):
        if name in found.inputs:
            low, high = (end(**{name: s * h}) for s in (-1, 1))
        else:
            low, high = (
                end(**{n: rest[n] + s * h * d for n, d in T_x[name].items()}) for s in (-1, 1)
            )
        seen, u = (high - low) / (2 * h), np.zeros(n)
        if name in found.inputs:
            u[found.inputs.index(name)] = 1
        x = both[:k, j]
        expected = np.concatenate([x, found.C @ x + found.D @ u])
        np.testing.assert_allclose(seen, expected, atol=2e-6 * max(1, np.abs(expected).max()))


def tangent(found: Linearization, name: str) -> dict[str, float]:
    """What is set: the state itself, the others of its kind as they are (the start is then projected)."""
    return {n: float(n == name) for n in found.states}


def test_fmi_3_tells_the_same(fmi3_fmu, native_fmu):
    """The FMU of FMI 3.0 has the same A, B, C, D, bit for bit or nearly."""
    two, three = (linearize(f("Crane"), equilibrium=True) for f in (native_fmu, fmi3_fmu))
    assert two.states == three.states
    for name in "ABCD":
        np.testing.assert_allclose(getattr(two, name), getattr(three, name), rtol=1e-10, atol=1e-12)


# ---------------------------------------------------------------------- what is indifferent, redundant, stuck


def test_a_door_on_two_hinges_is_redundant(native_fmu):
    """One state pair for its angle; the multipliers that the hinges share are no outputs."""
    found = linearize(native_fmu("Door"), equilibrium=True)
    assert found.states == ("angle.lower", "der(angle.lower)")
    assert found.redundant
    assert not any(n in found.outputs for n in found.redundant)


def test_a_skate_rests_anywhere():
    """At rest on level ice each place and heading is an equilibrium, and it glides on: five zero poles."""
    x, y, phi = dynamicsymbols("x y phi")
    J = symbols("J", positive=True)
    model = point_mass(
        "Skate",
        "x y",
        [Nonholonomic("edge", x.diff() * sin(phi) - y.diff() * cos(phi))],
        angles="phi",
        energy=J * phi.diff() ** 2 / 2,
        parameters=[MASS, Parameter(J, 0.1, "kg.m^2")],
        start={phi: 0.4},
    )
    found = linearize(model, equilibrium=True)
    assert (len(found.states), found.poles.zeros) == (5, 5)
    assert set(found.poles.indifferent[0]) == {"x", "y", "phi"}
    assert set(found.poles.indifferent[1]) == {n for n in found.states if n.startswith("der(")}


def block(**more) -> Model:
    """A block that friction holds on an incline; x down it, z off it."""
    x, z = dynamicsymbols("x z")
    mu = symbols("mu", positive=True)
    return point_mass(
        "Block",
        "x z",
        [
            Contact("floor", z),
            Nonholonomic("slide", x.diff(), while_closed="floor"),
            Friction("grip", of=["slide"], normal=multiplier("floor"), static=mu, kinetic=mu),
        ],
        up=Rational(4, 5) * z - Rational(3, 5) * x,
        parameters=[MASS, GRAVITY, Parameter(mu, more.pop("mu", 1.0), "1")],
        start=more,
    )


def test_what_friction_holds_stays_where_it_stuck():
    """tan = 3/4 < mu = 1: one zero pole, the place down the incline; differences, with their error."""
    found = linearize(block(), equilibrium=True)
    assert (found.states, found.poles.indifferent) == (("x",), (("x",),))
    assert found.stuck == ("slide",)
    assert found.error is not None
    assert found.error < 1e-9
    assert "held by friction" in " ".join(found.remarks())


def test_a_mass_swings_on_a_block_that_sticks():
    """A spring of 50 N/m between the block and 2 kg beside it: sqrt(k/m), by differences."""
    s = dynamicsymbols("s")
    k = symbols("k", positive=True)
    still = block()
    (x, _) = still.coordinates
    model = Model(
        "Swinging",
        lagrangian=still.lagrangian + m * s.diff() ** 2 / 2 - k * (s - x) ** 2 / 2,
        coordinates={**still.coordinates, s: "m"},
        constraints=[*still.constraints, *still.frictions],
        parameters=[*still.parameters, Parameter(k, 50.0, "N/m")],
        start={s: 0.01},
    )
    found = linearize(model, equilibrium=True)
    is_close(found, [5j, -5j])
    assert found.poles.indifferent in ((("x",),), (("s",),))  # both go together
    assert found.error < 1e-9


# ---------------------------------------------------------------------- what is refused


def test_a_sliding_block_is_refused():
    """tan = 3/4 > mu = 0.5: it slides, at rest and in motion."""
    for how in ({"equilibrium": True}, {"at": 0.1}):
        with pytest.raises(SimulationError, match=r"grip slid|grip.*slides|slipping.grip"):
            linearize(block(mu=0.5), **how)


def test_there_is_no_equilibrium_of_a_skate_on_an_incline(native_fmu):
    """It accelerates wherever it stands."""
    with pytest.raises(SimulationError, match=r"there is no equilibrium.*der\(x,2\).*--at T"):
        linearize(native_fmu("KnifeEdge"), equilibrium=True)


def test_a_wire_that_a_motor_turns_has_no_equilibrium(native_fmu):
    """Its angle is that of the time."""
    with pytest.raises(SimulationError, match="there is no equilibrium"):
        linearize(native_fmu("RotatingWire"), equilibrium=True)


def test_a_contact_that_grazes_is_refused():
    """A block that lies on the floor without weight."""
    z = dynamicsymbols("z")
    model = point_mass("Weightless", "z", [Contact("floor", z)], parameters=[MASS], start={z: 0.0})
    with pytest.raises(SimulationError, match="contact 'floor' grazes"):
        linearize(model)


def tied(pull: float) -> Model:
    """A block of 2 kg on a floor with friction 0.5; a force pulls a carriage on a spring up, and a tenth
    of it one sideways."""
    z, w, x, s = dynamicsymbols("z w x s")
    k, P, mu = symbols("k P mu", positive=True)
    masses = [q.diff() ** 2 for q in (z, w, x, s)]
    return Model(
        "Tied",
        lagrangian=m * sum(masses) / 2 - m * g * z - k * ((w - z) ** 2 + (s - x) ** 2) / 2,
        forces={w: P, s: P / 10},
        coordinates=dict.fromkeys((z, w, x, s), "m"),
        constraints=[
            Contact("floor", z),
            Nonholonomic("slide", x.diff(), while_closed="floor"),
            Friction("grip", of=["slide"], normal=multiplier("floor"), static=mu, kinetic=mu),
        ],
        parameters=[
            *(MASS, GRAVITY, Parameter(k, 50.0, "N/m"), Parameter(P, pull, "N")),
            Parameter(mu, 0.5, "1"),
        ],
        start={w: -0.1},
    )


def hung() -> Model:
    """A ball of 2 kg above the floor on a spring of 100 N/m, which pulls it to the floor's level."""
    z = dynamicsymbols("z")
    k = symbols("k", positive=True)
    return Model(
        "Hung",
        lagrangian=m * z.diff() ** 2 / 2 - m * g * z - k * z**2 / 2,
        coordinates={z: "m"},
        constraints=[Contact("floor", z)],
        parameters=[MASS, GRAVITY, Parameter(k, 100.0, "N/m")],
        start={z: 0.1},
    )


@pytest.mark.parametrize(
    ("model", "told"),
    [
        (tied(30.0), r"contact 'floor' would have to pull \(lambda.floor = -10.38"),
        (tied(18.0), r"friction 'grip' would slip \(margin.grip = -0.99"),
        (hung(), r"contact 'floor' would be passed through \(residual.floor = -0.1962"),
    ],
)
def test_a_rest_that_contacts_and_frictions_do_not_allow_is_refused(model, told):
    """As they stand at the start: a block of 19.62 N that comes to be pulled up by 30 N; one that presses
    with 1.62 N and is pulled sideways by 1.8 N; a ball that its weight takes below the floor by m g/k."""
    with pytest.raises(SimulationError, match=told):
        linearize(model, equilibrium=True)


def test_a_time_after_a_departure_is_refused(native_fmu):
    """The particle leaves the hemisphere: before, it is linearized beside its motion; after, not."""
    fmu = native_fmu("Hemisphere")
    found = linearize(fmu, at=0.5)
    assert (found.states, found.time) == (("theta", "der(theta)"), 0.5)
    angle = found.at_states[0]
    assert found.A[1, 0] == pytest.approx(
        parameters(fmu, "g")[0] / parameters(fmu, "a")[0] * math.cos(angle)
    )
    with pytest.raises(SimulationError, match=r"departure.surface is at .* earlier time"):
        linearize(fmu, at=5.0)


def test_names_are_told_together(native_fmu):
    """Unknown inputs, outputs and start values, with what was meant."""
    with pytest.raises(SettingError) as told:
        linearize(native_fmu("Crane"), inputs=["G"], outputs=["rope.tensio"], start_values={"h": 1})
    for text in ("input 'G'", "did you mean 'rope.tension'", "'h'"):
        assert text in str(told.value)
    with pytest.raises(UsageError, match="an equilibrium has no time"):
        linearize(native_fmu("Crane"), at=1.0, equilibrium=True)


def test_an_fmu_must_tell_its_constraints(native_fmu, python_fmu, built):
    """One for chosen outputs, and one without model exchange, are refused with the remedy."""
    scene = Scene("Bare", outputs=["lambda.rope"])
    crane = lagfmu.testing.load(MODELS / "crane.py").model
    with pytest.raises(SimulationError, match=r"chosen outputs.*give the model file"):
        linearize(built(crane, scene))
    with pytest.raises(SimulationError, match=r"no model exchange.*give the model file"):
        linearize(python_fmu("PendulumCartesian"))


# ---------------------------------------------------------------------- the command, and what it writes


def test_the_command_writes_json_and_mat(native_fmu, tmp_path):
    """The same matrices in both, and in SciPy's StateSpace."""
    fmu, out = native_fmu("Crane"), [tmp_path / "x.json", tmp_path / "x.mat"]
    words = [
        "linearize",
        fmu,
        "--equilibrium",
        "--inputs",
        "F",
        "--outputs",
        "rope.tension,load.sway",
    ]
    text = run(*words, "--output", out[0], "--output", out[1])
    assert "Crane: equilibrium, 4 states, 4 poles, 1 of them 0" in text
    assert "indifferent" in text
    data, mat = json.loads(out[0].read_text()), loadmat(out[1])
    for name in "ABCD":
        np.testing.assert_array_equal(data[name], mat[name])
    assert [s["name"] for s in data["states"]] == [str(s[0]) for s in mat["states"].ravel()]
    found = linearize(fmu, equilibrium=True, inputs=["F"], outputs=["rope.tension", "load.sway"])
    np.testing.assert_allclose(found.to_scipy().A, data["A"], atol=1e-12)
    assert "ends in" in run(*words, "--output", tmp_path / "x.csv", code=2)


def test_python_control_takes_it_with_its_names(native_fmu):
    """Its poles are the same."""
    pytest.importorskip("control")
    found = linearize(native_fmu("Crane"), equilibrium=True, inputs=["F"])
    system = found.to_control()
    assert system.input_labels == ["F"]
    assert sorted(abs(system.poles())) == pytest.approx(
        sorted([0, *np.abs(found.poles.values)]), rel=1e-6, abs=1e-8
    )


def test_nothing_moves_where_nothing_is_free(native_fmu):
    """Six legs hold a Stewart platform: no state, and the loads of the legs stand in D alone."""
    found = linearize(native_fmu("Stewart"))
    assert (found.states, found.stability) == ((), "nothing moves")
    with pytest.raises(UsageError, match="nothing moves"):
        found.to_scipy()
