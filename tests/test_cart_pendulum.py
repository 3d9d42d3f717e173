"""Pendulum on a cart (K and F_q form, friction and an input force), through fmpy on the built FMU."""

from __future__ import annotations

import numpy as np
import pytest
from instance import instance
from runs import simulate_fmu
from scipy.integrate import romb

DEFAULT = {"M": 2.0, "m": 1.0, "g": 9.81, "L": 1.0}
LIGHT = {"M": 0.05, "m": 0.7, "g": 3.7, "L": 0.3}
HEAVY = {"M": 20.0, "m": 3.0, "g": 9.81, "L": 2.0}
WORLDS = pytest.mark.parametrize("world", [DEFAULT, LIGHT], ids=["default", "light cart"])
HOLD, STEP = 32, 0.005  # communication steps that a force is held for, and their size [s]


def start(world, angle=1.0, v=0.0, spin=0.0):
    """The bob at `angle` from below the cart, the cart moving at v, the rod turning at spin."""
    L = world["L"]
    return {
        **world,
        "x": L * np.sin(angle),
        "y": -L * np.cos(angle),
        "der(s)": v,
        "der(x)": v + L * spin * np.cos(angle),
        "der(y)": L * spin * np.sin(angle),
    }


def run(path, values, force=None, count=12 * HOLD, tolerance=1e-12):
    """fmpy's result; `force` (count) [N] is set at each communication point and held."""
    signals = None
    if force is not None:
        signals = np.zeros(count + 1, dtype=[("time", float), ("F", float)])
        signals["time"] = STEP * np.arange(count + 1)
        signals["F"][:count] = force
    return simulate_fmu(
        str(path),
        stop_time=STEP * count,
        output_interval=STEP,
        step_size=STEP,
        relative_tolerance=tolerance,
        start_values=values,
        input=signals,
    )


def energy(result, world):
    return result["energy.kinetic"] + world["m"] * world["g"] * result["y"]


def varying_force(count, scale):
    """A force that jumps to another value every HOLD communication steps."""
    levels = scale * np.random.default_rng(3).uniform(-1, 1, count // HOLD)
    return np.repeat(levels, HOLD)


@pytest.mark.parametrize(
    ("world", "friction"), [(DEFAULT, 0.0), (LIGHT, 0.0), (DEFAULT, 0.4), (HEAVY, 5.0)]
)
def test_energy_changes_by_the_work_of_the_force_and_of_friction(native_fmu, world, friction):
    """E(t) - E(0) = sum F_k (s_k+1 - s_k) - integral of c s'^2 while the force jumps at communication
    points: the rod's force does no work."""
    count = 12 * HOLD
    force = varying_force(count, 3 * world["m"] * world["g"])
    result = run(native_fmu("CartPendulum"), {**start(world), "c": friction}, force, count)
    work = np.concatenate([[0.0], np.cumsum(force * np.diff(result["s"]))])[::HOLD]
    rate = result["der(s)"] ** 2  # smooth while the force is held: Romberg's rule
    lost = [romb(rate[k : k + HOLD + 1], dx=STEP) for k in range(0, count, HOLD)]
    lost = friction * np.concatenate([[0.0], np.cumsum(lost)])
    gained = (energy(result, world) - energy(result, world)[0])[::HOLD]
    size = np.abs(force * np.diff(result["s"])).sum()
    assert size > 0.5 * world["m"] * world["g"] * world["L"]
    assert friction == 0 or lost[-1] > 0.01 * size
    assert np.abs(gained - (work - lost)).max() < 1e-12 * size


@WORLDS
def test_force_and_friction_change_the_momentum(native_fmu, world):
    """d/dt (M s' + m x' + c s) = F: the impulse of the force arrives in full, whatever the rod does."""
    count = 12 * HOLD
    force = varying_force(count, world["m"] * world["g"])
    result = run(native_fmu("CartPendulum"), {**start(world), "c": 0.4}, force, count)
    p = world["M"] * result["der(s)"] + world["m"] * result["der(x)"] + 0.4 * result["s"]
    impulse = STEP * np.concatenate([[0.0], np.cumsum(force)])
    assert np.abs(p - p[0] - impulse).max() < 1e-11 * np.abs(p).max()


def expected_multiplier(result, world, force, friction):
    """lambda = m (M g y + (F - c s') d - M w^2) / (2 (M L^2 + m d^2)) with d = x - s [N/m]."""
    M, m, g, L = world.values()
    d = result["x"] - result["s"]
    square = (result["der(x)"] - result["der(s)"]) ** 2 + result["der(y)"] ** 2
    drive = force - friction * result["der(s)"]
    return m * (M * g * result["y"] + drive * d - M * square) / (2 * (M * L**2 + m * d**2))


def test_a_new_force_is_felt_before_the_next_step(native_fmu):
    """Accelerations, lambda and Q belong to the force that is set now: a push of F on the cart changes
    them at once, with no step in between, while positions and velocities stay."""
    world, friction = DEFAULT, 0.1
    with instance(native_fmu("CartPendulum")) as one:
        one.start({**start(world, 0.8, v=0.5, spin=1.0), "c": friction})
        one.step(0.3)
        still = ("s", "x", "y", "der(s)", "der(x)", "der(y)", "energy.kinetic")
        before = one.outputs()
        for force in (0.0, 12.5, -40.0, 0.0):
            one.set("F", force)
            s2, x2, y2 = (one.get(f"der({q},2)") for q in "sxy")
            now = one.outputs()
            lam = expected_multiplier(now, world, force, friction)
            d, y = now["x"] - now["s"], now["y"]
            assert now["lambda.rod"] == pytest.approx(lam, rel=1e-12)
            assert now["Q.x"] == pytest.approx(2 * d * lam, rel=1e-12)
            assert now["Q.y"] == pytest.approx(2 * y * lam, rel=1e-12)
            pull = force - friction * now["der(s)"] - 2 * d * lam
            assert s2 == pytest.approx(pull / world["M"], rel=1e-12)
            assert x2 == pytest.approx(2 * d * lam / world["m"], rel=1e-12)
            assert y2 == pytest.approx(2 * y * lam / world["m"] - world["g"], rel=1e-12)
            assert [now[name] for name in still] == [before[name] for name in still]
        assert one.outputs() == before


def test_a_force_before_the_start_is_felt_at_the_start(native_fmu):
    """At rest with the rod hanging down, a force F gives the cart F/M at once and the bob nothing."""
    with instance(native_fmu("CartPendulum")) as one:
        one.start({**start(DEFAULT, 0.0), "F": 6.0})
        assert one.get("der(s,2)") == pytest.approx(3.0, rel=1e-14)
        assert one.get("der(x,2)") == pytest.approx(0.0, abs=1e-14)
        assert one.get("lambda.rod") == pytest.approx(-9.81 / 2, rel=1e-14)
