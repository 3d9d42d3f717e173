"""Native FMUs in engines that share no code with fmpy or with each other, and in fmpy itself, held
against closed forms; two of them coupled, against the same system simulated whole."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import fmpy
import numpy as np
import pytest
from coupled_model import absorber
from engines import PACKAGES, EngineError
from importers import run
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk, ellipkinc

from lagfmu.methods import NUMBERS

README = Path(__file__).parent.parent / "docs" / "importers.md"
TIGHT = {"solver.tolerance": 1e-12}
EARTH = {"m": 1.0, "g": 9.81, "a": 1.0}
MOON = {"m": 3.0, "g": 1.62, "a": 2.0}


@pytest.fixture(params=sorted(PACKAGES))
def engine(request) -> str:
    """Each engine."""
    return request.param


# ---------------------------------------------------------------------------- closed forms


def departure(world, theta0):
    """Time [s] and angle [rad] at which the particle leaves the sphere, from rest at theta0: the top is
    an inverted pendulum, cos(theta/2) = k sin(amplitude) with k = cos(theta0/2)."""
    theta = np.arccos(2 * np.cos(theta0) / 3)
    k = np.cos(theta0 / 2)
    fallen = ellipk(k**2) - ellipkinc(np.arcsin(np.cos(theta / 2) / k), k**2)
    return np.sqrt(world["a"] / world["g"]) * fallen, theta


def pendulum_multiplier(world, phi0, t):
    """lambda = -m g (3 cos phi - 2 cos phi0)/(2 L) [N/m], from rest at phi0 at time t:
    sin(phi/2) = k sn(w t + K)."""
    m, g, L = world["m"], world["g"], world["L"]
    k = np.sin(phi0 / 2)
    sn = ellipj(np.sqrt(g / L) * t + ellipk(k**2), k**2)[0]
    cos_phi = 1 - 2 * k**2 * sn**2
    return -m * g * (3 * cos_phi - 2 * np.cos(phi0)) / (2 * L)


def rod_multiplier(world, phi, w, drive):
    """lambda [N/m] of the cart's pendulum at the angle phi, which turns with w, while `drive` [N] acts on the
    cart."""
    M, m, g, L = (world[n] for n in "MmgL")
    inward = -M * g * np.cos(phi) + drive * np.sin(phi) - M * L * w**2
    return m * inward / (2 * L * (M + m * np.sin(phi) ** 2))


def cart(world, forces, H):
    """s [m], x [m] and lambda [N/m] after each of the steps of H [s] in which `forces` act, from rest with
    the bob at 1 rad: SciPy on the equations in s and phi, x = s + L sin(phi), y = -L cos(phi)."""
    M, m, g, L, c = (world[n] for n in "MmgLc")

    def rates(_, state, F):
        _, phi, v, w = state
        mass = [[M + m, m * L * np.cos(phi)], [m * L * np.cos(phi), m * L**2]]
        load = [F - c * v + m * L * w**2 * np.sin(phi), -m * g * L * np.sin(phi)]
        return [v, w, *np.linalg.solve(mass, load)]

    states, state = [], np.array([0.0, 1.0, 0.0, 0.0])
    for F in forces:
        run_of = solve_ivp(rates, (0, H), state, "DOP853", rtol=1e-12, atol=1e-13, args=(F,))
        state = run_of.y[:, -1]
        states.append(state)
    s, phi, v, w = np.array(states).T
    return s, s + L * np.sin(phi), rod_multiplier(world, phi, w, np.asarray(forces) - c * v)


# ---------------------------------------------------------------------------- one FMU in each engine


def test_the_particle_leaves_the_hemisphere_when_and_where_it_must(native_fmu, engine):
    """Two instances with other parameters and starts in one simulation: each leaves at the time of the
    elliptic integral and at cos(theta) = 2/3 cos(theta0), once; lambda is the normal force and then 0."""
    path = native_fmu("Hemisphere")
    worlds = {"earth": (EARTH, 0.1), "moon": (MOON, 0.3)}
    names = ["theta", "lambda.surface", "contact.surface", "departure.surface.count"]
    names += ["departure.surface.time", "departure.surface.theta"]
    values = {
        i: {**world, **TIGHT, "theta": theta0, "r": world["a"]}
        for i, (world, theta0) in worlds.items()
    }
    found = run(
        engine,
        dict.fromkeys(worlds, path),
        [(i, n) for i in worlds for n in names],
        step=0.01,
        steps=250,
        values=values,
    )
    t = 0.01 * np.arange(1, 251)
    for i, (world, theta0) in worlds.items():
        theta, force, closed, count, when, where = (found[i, n] for n in names)
        time, angle = departure(world, theta0)
        on = t < time
        assert 50 < on.sum() < 230
        assert when[-1] == pytest.approx(time, rel=1e-12)
        assert where[-1] == pytest.approx(angle, rel=1e-12)
        weight = world["m"] * world["g"]
        normal = weight * (3 * np.cos(theta) - 2 * np.cos(theta0))
        np.testing.assert_allclose(force[on], normal[on], atol=1e-11 * weight, rtol=0)
        assert (force[~on] == 0).all()
        np.testing.assert_array_equal(closed, on)
        np.testing.assert_array_equal(count, ~on)


def test_a_cart_goes_where_the_force_drives_it(native_fmu, engine):
    """F jumps at each communication point: s, x and lambda are those of the equations in s and phi,
    and the momentum grows by F's impulse, M s' + m x' + c s = sum F_k H, to rounding."""
    world = {"M": 1.5, "m": 0.4, "g": 9.81, "L": 0.8, "c": 0.3}
    start = {"x": world["L"] * np.sin(1.0), "y": -world["L"] * np.cos(1.0)}
    H, steps = 0.05, 60
    force = 5 * np.random.default_rng(1).uniform(-1, 1, steps)
    names = ["s", "x", "der(s)", "der(x)", "lambda.rod", "F"]
    found = run(
        engine,
        {"cart": native_fmu("CartPendulum")},
        [("cart", n) for n in names],
        step=H,
        steps=steps,
        values={"cart": {**world, **TIGHT, **start}},
        drive={"cart": {"F": [float(f) for f in force]}},
    )
    s, x, v, w, multiplier, felt = (found["cart", n] for n in names)
    s_exact, x_exact, lambda_exact = cart(world, force, H)
    np.testing.assert_array_equal(felt, force)
    np.testing.assert_allclose(s, s_exact, atol=1e-10)
    np.testing.assert_allclose(x, x_exact, atol=1e-10)
    np.testing.assert_allclose(multiplier, lambda_exact, atol=1e-9)
    momentum = world["M"] * v + world["m"] * w + world["c"] * s
    np.testing.assert_allclose(momentum, H * np.cumsum(force), atol=1e-13)


WITHOUT_ENUMERATIONS = ("ecos", "libcosim")  # solver.method is not there in them


def test_the_solver_is_chosen_by_its_parameters(native_fmu, engine):
    """A number of the menu and a step through the engine: rk4 of 0.0025 s takes 4 steps in each 0.01 s."""
    if engine in WITHOUT_ENUMERATIONS:
        pytest.skip("this engine ignores Enumerations")
    key = ("bob", "solver.steps")
    found = run(
        engine,
        {"bob": native_fmu("PendulumCartesian")},
        [key],
        step=0.01,
        steps=5,
        values={"bob": {"solver.method": NUMBERS["rk4"], "solver.step": 0.0025}},
    )[key]
    np.testing.assert_array_equal(found, [4, 8, 12, 16, 20])


REFUSED = {
    "a parameter out of bounds": ("PendulumCartesian", {"m": -1.0}, {}, "'m' = -1.0 is outside"),
    "an unknown method": (
        "PendulumCartesian",
        {"solver.method": 9},
        {},
        "expected one of 1 (auto), 2 (dop853)",
    ),
    "a start far off": ("PendulumCartesian", {"x": 0.0, "y": 0.0}, {}, "cannot be projected"),
    "an input that is none": ("CartPendulum", {}, {"F": [1.0, float("nan")]}, "'F' = nan"),
    "a hopeless step": (
        "PendulumCartesian",
        {"solver.method": NUMBERS["rk4"], "solver.step": 100.0, "g": 1e9},
        {},
        "reduce solver.step",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_is_an_error_in_the_engine_with_its_reason(native_fmu, engine, case):
    """Bounds, methods, starts, NaN and steps: the engine stops, or tells it in its log (ecos goes on)."""
    name, values, drive, reason = REFUSED[case]
    if engine in WITHOUT_ENUMERATIONS and "solver.method" in values:
        pytest.skip("this engine ignores Enumerations")
    with pytest.raises(EngineError) as stopped:
        run(
            engine,
            {"one": native_fmu(name)},
            [("one", "x")],
            step=1.0,
            steps=2,
            values={"one": values},
            drive={"one": drive},
        )
    assert reason in str(stopped.value)


def test_the_readmes_example_prints_the_time_of_departure(native_fmu, tmp_path):
    """The README's lines for libcosim, as they stand, with the FMU of either target where they look."""
    pytest.importorskip("libcosimpy", reason="the engine libcosimpy is not installed")
    blocks = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    (block,) = [b for b in blocks if "libcosimpy" in b]
    (path,) = re.findall(r'fmu_path="(.*?)"', block)
    (tmp_path / path).parent.mkdir(parents=True)
    shutil.copy(native_fmu("Hemisphere"), tmp_path / path)
    command = [sys.executable, "-c", block]
    ended = subprocess.run(
        command,
        cwd=tmp_path,
        env={**os.environ, "TMPDIR": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr[-2000:]
    (printed,) = re.findall(r"^\[([\d.]+)\]$", ended.stdout, re.MULTILINE)
    assert float(printed) == pytest.approx(departure(EARTH, 0.01)[0], rel=1e-8)


# ---------------------------------------------------------------------------- two FMUs coupled

EXCHANGED = [
    ("absorber", "lambda.tie", "cart", "F"),
    ("cart", "s", "absorber", "u"),
    ("cart", "der(s)", "absorber", "der(u)"),
    ("cart", "der(s,2)", "absorber", "der(u,2)"),
]
SEEN = [("cart", "s"), ("cart", "x"), ("absorber", "z"), ("cart", "lambda.rod")]
STOP, COARSE, HALVINGS = 2.0, 0.01, 2


def whole():
    """s, x, z and lambda of the rod at the coarse points: SciPy on the whole system in s, phi and z."""
    world = {"M": 2.0, "m": 1.0, "g": 9.81, "L": 1.0}
    M, m, g, L = world.values()
    c, n, k, d = 0.1, 0.5, 20.0, 0.5

    def rates(_, state):
        s, phi, z, v, w, v_z = state
        pull = k * (z - s) + d * (v_z - v)
        mass = [[M + m, m * L * np.cos(phi)], [m * L * np.cos(phi), m * L**2]]
        forces = [pull - c * v + m * L * w**2 * np.sin(phi), -m * g * L * np.sin(phi)]
        return [v, w, v_z, *np.linalg.solve(mass, forces), -pull / n]

    times = COARSE * np.arange(1, round(STOP / COARSE) + 1)
    start = [0.0, 1.0, 0.3, 0.0, 0.0, 0.0]
    found = solve_ivp(rates, (0, STOP), start, "DOP853", times, rtol=1e-12, atol=1e-13)
    s, phi, z, v, w, v_z = found.y
    drive = k * (z - s) + d * (v_z - v) - c * v
    return s, s + L * np.sin(phi), z, rod_multiplier(world, phi, w, drive)


@pytest.fixture(scope="session")
def coupled(native_fmu, built):
    """FMUs of the cart and of its absorber, and the trajectory of the whole."""
    return {"cart": native_fmu("CartPendulum"), "absorber": built(absorber)}, whole()


def errors(engine, fmus, exact, rates=False):
    """(halvings + 1, variables) largest error, relative to the largest value, for ever finer steps."""
    rows = []
    for halving in range(HALVINGS + 1):
        finer = 2**halving
        found = run(
            engine,
            fmus,
            SEEN,
            step=COARSE / finer,
            steps=round(STOP / COARSE) * finer,
            values=dict.fromkeys(fmus, TIGHT),
            connections=EXCHANGED,
            rates=rates,
        )
        rows.append(
            [
                abs(found[key][finer - 1 :: finer] - right).max() / abs(right).max()
                for key, right in zip(SEEN, exact, strict=True)
            ]
        )
    return np.array(rows)


def test_coupled_they_are_the_whole_to_first_order(coupled, engine):
    """lambda of the absorber's tie drives the cart, whose motion drives the absorber.  Held between the
    communication points the force costs an error that halves with the step (observed orders
    0.99 to 1.01): 3.7 % in s at 10 ms, 0.93 % at 2.5 ms."""
    fmus, exact = coupled
    found = errors(engine, fmus, exact)
    orders = np.log2(found[:-1] / found[1:])
    assert abs(orders - 1).max() < 0.03, orders
    assert 0.03 < found[0, 0] < 0.045
    assert found.max() < 0.045


def test_with_derivatives_exchanged_they_are_the_whole_to_second_order(coupled):
    """fmi2GetRealOutputDerivatives of one is fmi2SetRealInputDerivatives of the other: the force goes
    on along its slope, and the error falls with the square of the step (observed
    orders 1.95 to 2.03): 0.015 % in s at 10 ms."""
    fmus, exact = coupled
    found = errors("fmuloader", fmus, exact, rates=True)
    orders = np.log2(found[:-1] / found[1:])
    assert abs(orders - 2).max() < 0.1, orders
    assert found[0].max() < 6e-4
    assert found[-1].max() < 3.2e-5


# ---------------------------------------------------------------------------- fmpy's CVODE


ALLOWED = 2e-7  # relative: its local errors of 1e-10 add up, and lambda depends on the state


def exchanged(path, stop, interval, start, **more):
    """CVODE on the FMU's model exchange."""
    return fmpy.simulate_fmu(
        str(path),
        fmi_type="ModelExchange",
        solver="CVode",
        stop_time=stop,
        output_interval=interval,
        start_values=start,
        relative_tolerance=1e-10,
        **more,
    )


def test_cvode_finds_the_departure(native_fmu):
    """When and where the particle leaves, and lambda until then and afterwards: an event of CVODE, and the
    trajectory has a point there."""
    theta0 = 0.3
    start = {**MOON, "theta": theta0, "r": MOON["a"]}
    found = exchanged(native_fmu("Hemisphere"), 2.5, 0.05, start)
    t, theta = found["time"], found["theta"]
    time, angle = departure(MOON, theta0)
    assert found["departure.surface.time"][-1] == pytest.approx(time, rel=ALLOWED)
    assert found["departure.surface.theta"][-1] == pytest.approx(angle, rel=ALLOWED)
    assert found["departure.surface.count"][-1] == 1
    normal = 3 * np.cos(theta) - 2 * np.cos(theta0)
    force = found["lambda.surface"] / (MOON["m"] * MOON["g"])
    on = t < time - 1e-6
    np.testing.assert_allclose(force[on], normal[on], atol=ALLOWED, rtol=0)
    assert (force[t > time + 1e-6] == 0).all()
    assert abs(t - time).min() < 1e-7


def test_cvode_finds_the_multiplier_of_the_pendulum(native_fmu):
    """Jacobi's elliptic functions over 10 s."""
    world, phi0 = {"m": 0.7, "g": 3.7, "L": 2.0}, 2.0
    start = {**world, "x": world["L"] * np.sin(phi0), "y": -world["L"] * np.cos(phi0)}
    found = exchanged(native_fmu("PendulumCartesian"), 10.0, 0.1, start)
    assert len(found) == 101
    expected = pendulum_multiplier(world, phi0, found["time"])
    scale = abs(expected).max()
    np.testing.assert_allclose(found["lambda.rod"], expected, atol=ALLOWED * scale, rtol=0)


def test_cvode_drives_the_cart(native_fmu):
    """F jumps at 1 s and 2 s, where fmpy has an event: the cart goes where SciPy's goes."""
    world = {"M": 1.5, "m": 0.4, "g": 9.81, "L": 0.8, "c": 0.3}
    start = {**world, "x": world["L"] * np.sin(1.0), "y": -world["L"] * np.cos(1.0)}
    rows = [(0.0, 5.0), (1.0, 5.0), (1.0, -4.0), (2.0, -4.0), (2.0, 2.0), (3.0, 2.0)]
    table = np.array(rows, dtype=[("time", float), ("F", float)])
    found = exchanged(native_fmu("CartPendulum"), 3.0, 0.1, start, input=table)
    t = found["time"]
    between = (t % 1 > 0.01) & (t % 1 < 0.99)  # at a jump lambda has two values
    assert between.sum() == 27
    at = np.rint(10 * t[between]).astype(int) - 1
    for name, exact in zip(
        ("s", "x", "lambda.rod"), cart(world, np.repeat([5.0, -4.0, 2.0], 10), 0.1), strict=True
    ):
        scale = abs(exact).max()
        np.testing.assert_allclose(found[name][between], exact[at], atol=ALLOWED * scale, rtol=0)
