"""Half a car on a tabulated road: wheels that leave the road over a bump, and land."""

from __future__ import annotations

import fmpy
import numpy as np
import pytest
from conftest import model_file
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass

from lagfmu import Holonomic, Input, simulate

M, J, m, g, a, b, k, c, v = 1200.0, 1500.0, 80.0, 9.81, 1.2, 1.5, 4e4, 3e3, 14.0


def first_departure() -> float:
    """The front wheel's, from the body's own equations on two moving feet: independent of lagfmu."""
    road = next(s for s in model_file("half_car").model.splines)
    y = CubicSpline(road.x, road.y, bc_type="natural")
    load_f, load_r = M * g * b / (a + b), M * g * a / (a + b)

    def forces(t, state):
        z, th, dz, dth = state
        s = 2.0 + v * t
        df = y(s + a) - z - a * th
        dr = y(s - b) - z + b * th
        rf = y(s + a, 1) * v - dz - a * dth
        rr = y(s - b, 1) * v - dz + b * dth
        return load_f + k * df + c * rf, load_r + k * dr + c * rr

    def rate(t, state):
        f, r = forces(t, state)
        return [state[2], state[3], (f + r) / M - g, (a * f - b * r) / J]

    def load_of_front(t, state):
        return m * (g + y(2.0 + v * t + a, 2) * v**2) + forces(t, state)[0]

    load_of_front.terminal, load_of_front.direction = True, -1
    found = solve_ivp(
        rate,
        (0, 1),
        [0, 0, 0, 0],
        "DOP853",
        rtol=1e-12,
        atol=1e-14,
        events=load_of_front,
        max_step=1e-3,
    )
    return float(found.t_events[0][0])


def test_the_front_wheel_leaves_where_its_load_vanishes(native_fmu):
    """The departure is that of an independent integration; both wheels leave, and land again."""
    run = simulate(native_fmu("HalfCar"), tolerance=1e-10)
    assert run["departure.front.time"][-1] == pytest.approx(first_departure(), abs=1e-9)
    for wheel in ("front", "rear"):
        shut = run[f"contact.{wheel}"]
        assert run[f"departure.{wheel}.count"][-1] >= 1
        assert shut[0]
        assert shut[-1]
        assert not shut.all()
        assert (run[f"lambda.{wheel}"][~shut] == 0).all()
    assert ((run["front.share"] >= 0) & (run["front.share"] <= 1)).all()


def test_the_wheels_carry_the_car(native_fmu):
    """Rolling on the flat again they share the weight by their levers; the travel settles to nothing."""
    run = simulate(native_fmu("HalfCar"), 2.0, start_values={"s": 12.0})
    share = (M * g * b / (a + b) + m * g) / ((M + 2 * m) * g)
    assert run["front.share"][-1] == pytest.approx(share, rel=1e-3)
    assert abs(run["front.travel"][-1]) < 1e-3


def in_model_exchange(path, **more):
    """fmpy's CVODE, over the bump."""
    return fmpy.simulate_fmu(
        str(path),
        fmi_type="ModelExchange",
        stop_time=0.8,
        output_interval=0.01,
        relative_tolerance=1e-9,
        output=["way", "theta", "lambda.front"],
        **more,
    )


def test_left_alone_it_rolls_on_in_model_exchange_too(native_fmu):
    """Nobody drives s: at 14 m/s the car has gone 11.2 m after 0.8 s, and pitches as in co-simulation."""
    path = native_fmu("HalfCar")
    run, other = simulate(path, 0.8, 0.01, tolerance=1e-10), in_model_exchange(path)
    np.testing.assert_allclose(other["way"], 2.0 + v * other["time"], rtol=1e-13)
    pitch = np.interp(run["time"], other["time"], other["theta"])
    assert abs(run["theta"]).max() > 0.02
    np.testing.assert_allclose(pitch, run["theta"], atol=1e-7)


def test_driven_it_goes_where_it_is_driven(native_fmu):
    """The importer's s, der(s) and der(s,2) stand from the first time that they are set: a car that is
    held stands still."""
    names = ["time", "s", "der(s)", "der(s,2)"]
    held = np.array([(0.0, 2.0, 0.0, 0.0), (0.8, 2.0, 0.0, 0.0)], [(n, float) for n in names])
    found = in_model_exchange(native_fmu("HalfCar"), input=held)
    np.testing.assert_array_equal(found["way"], 2.0)


def test_a_force_that_is_driven_holds_up_no_motion(built):
    """A block that u carries at 3 m/s and F pushes sideways, in model exchange: F = 2 N alone is connected,
    u goes on by its rate, and y'' = F/m."""
    x, y, u, F = dynamicsymbols("x y u F")
    model = point_mass(
        "Carried",
        "x y",
        [Holonomic("belt", x - u)],
        mass=2.0,
        forces={y: F},
        inputs=[Input(u, "m", rate=3.0), Input(F, "N")],
        start={x: 0.0, x.diff(): 3.0},
    )
    pushed = np.array([(0.0, 2.0), (0.8, 2.0)], [("time", float), ("F", float)])
    found = fmpy.simulate_fmu(
        str(built(model)), fmi_type="ModelExchange", stop_time=0.8, input=pushed, output=["x", "y"]
    )
    np.testing.assert_allclose(found["x"], 3.0 * found["time"], atol=1e-9)
    np.testing.assert_allclose(found["y"], found["time"] ** 2 / 2, atol=1e-4)
