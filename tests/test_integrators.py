"""Order and error of the integrators, and the dials that choose them, through fmpy on the pendulum's
FMUs.  The reference are Jacobi's elliptic functions: sin(theta/2) = k sn(w t + K)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from runs import simulate_fmu
from scipy.special import ellipj, ellipk
from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass

from lagfmu import Contact, Holonomic, Model, Parameter, simulate
from lagfmu.errors import SimulationError
from lagfmu.methods import NUMBERS

BOTH = pytest.mark.parametrize("name", ["PendulumAngle", "PendulumCartesian"])
THETA0 = 1.0
END = 5.0  # s, two and a half periods


def run(path, stop=END, step=END, tolerance=None, **solver):
    """From rest at THETA0; solver_method='rk4' sets solver.method."""
    start = {n.replace("solver_", "solver."): NUMBERS.get(v, v) for n, v in solver.items()}
    return simulate_fmu(
        str(path),
        stop_time=stop,
        output_interval=step,
        step_size=step,
        relative_tolerance=tolerance,
        start_values=start,
    )


def error(result):
    """Largest distance [m] of the bob from where it should be, L = 1 m."""
    w, k = np.sqrt(9.81), np.sin(THETA0 / 2)
    sn = ellipj(w * result["time"] + ellipk(k**2), k**2)[0]
    theta = 2 * np.arcsin(k * sn)
    return np.hypot(result["x"] - np.sin(theta), result["y"] + np.cos(theta)).max()


def largest_error(path, **settings):
    """The largest of runs, each of one communication step, to times that share no phase of the swing:
    one of them alone may cross zero."""
    return max(error(run(path, t, t, **settings)) for t in (END, 4.57, 4.11))


@BOTH
def test_rk4_has_order_four(native_fmu, name):
    """Halving the step of the classical Runge-Kutta method divides its error by 2^4, with projection
    and without."""
    steps = 0.05 / 2.0 ** np.arange(1, 6)
    errors = [error(run(native_fmu(name), solver_method="rk4", solver_step=h)) for h in steps]
    order = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.abs(order - 4).max() < 0.15


def test_rattle_has_order_six(native_fmu):
    """The error of n equal steps falls as h^6."""
    path, stop, counts = native_fmu("PendulumCartesian"), 1.9, np.array([30, 40, 60, 80])
    settings = [{"solver_method": "rattle", "solver_step": stop / n} for n in counts]
    errors = [error(run(path, stop, stop, **each)) for each in settings]
    assert np.polyfit(np.log(1 / counts), np.log(errors), 1)[0] == pytest.approx(6, abs=0.15)


def test_rattle_meets_an_event_within_its_step():
    """A bob swings against a wall below its pivot, e = 1, and back, each time after a quarter of the period
    more, K(k)/w: half the step divides the error of the times by nearly 2^6, as between events."""
    x, y = dynamicsymbols("x y")
    L = symbols("L", positive=True)
    model = point_mass(
        "Knocker",
        "x y",
        [Holonomic("rod", x**2 + y**2 - L**2), Contact("wall", x, restitution=1)],
        up=y,
        parameters=[Parameter(L, 1, "m")],
        start={x: math.sin(THETA0), y: -math.cos(THETA0)},
    )
    quarter = ellipk(math.sin(THETA0 / 2) ** 2) / math.sqrt(9.81)
    wrong = []
    for step in (0.04, 0.02):
        start = {"solver.method": "rattle", "solver.step": step}
        run = simulate(model, 6 * quarter, quarter / 2, start_values=start)
        assert run["closing.wall.count"][-1] == 3
        times = run["closing.wall.time"][[3, 7, 11]]
        wrong.append(np.abs(times - quarter * np.array([1, 3, 5])).max())
    assert wrong[0] < 1e-7
    assert wrong[0] > 2**5 * wrong[1]


def test_rattle_keeps_a_row_where_it_began_to_act():
    """A disk falls in free flight, lands, and rolls from there: x - R phi stays what it was then."""
    x, y, phi = dynamicsymbols("x y phi")
    m, g, R = symbols("m g R", positive=True)
    rolls = Holonomic("rolls", x - R * phi, while_closed="floor")
    model = Model(
        name="Lander",
        lagrangian=m * (x.diff() ** 2 + y.diff() ** 2 + R**2 * phi.diff() ** 2 / 2) / 2 - m * g * y,
        coordinates={x: "m", y: "m", phi: "rad"},
        constraints=[Contact("floor", y), rolls],
        parameters=[Parameter(m, 2, "kg"), Parameter(g, 9.81, "m/s^2"), Parameter(R, 0.2, "m")],
        start={y: 1.0, x.diff(): 1.5, phi: 0.3},
    )
    run = simulate(model, 1.0, 0.1, start_values={"solver.method": "rattle"})
    t, fall = run["time"], math.sqrt(2 / 9.81)
    rolled = np.maximum(t - fall, 0)  # with 2/3 of the speed
    np.testing.assert_allclose(run["y"], np.maximum(1 - 9.81 * t**2 / 2, 0), atol=1e-12)
    np.testing.assert_allclose(run["x"], 1.5 * np.minimum(t, fall) + rolled, rtol=1e-11)
    np.testing.assert_allclose(run["phi"], 0.3 + rolled / 0.2, rtol=1e-10)


def test_rattle_says_when_a_step_is_too_large(native_fmu):
    """A step in which the rod would turn several times is refused."""
    values = {"solver.method": "rattle", "solver.step": 1.0, "der(x)": 16.0, "der(y)": 25.0}
    with pytest.raises(SimulationError, match=r"cannot be met: reduce solver\.step"):
        simulate(native_fmu("PendulumCartesian"), 1.0, 1.0, start_values=values)


@pytest.mark.parametrize(
    ("step", "taken"),
    [(0.06, 4), (0.05, 4), (0.0501, 4), (0.0499, 5), (0.14, 2), (1.0, 1), (0.002, 100)],
)
def test_fixed_steps_divide_the_communication_step(native_fmu, step, taken):
    """h' = H / ceil(H / h): the steps are equal, at most solver.step long, and end at the
    communication point."""
    H = 0.2
    result = run(native_fmu("PendulumAngle"), 3 * H, H, solver_method="rk4", solver_step=step)
    assert list(result["solver.steps"]) == [0, taken, 2 * taken, 3 * taken]
    equal = run(native_fmu("PendulumAngle"), 3 * H, H, solver_method="rk4", solver_step=H / taken)
    np.testing.assert_array_equal(result["theta"], equal["theta"])


def test_rk4_without_a_step_chooses_one(native_fmu):
    """solver.step = 0 leaves the choice to the FMU: a hundredth of the pendulum's natural time, good
    for six digits."""
    result = run(native_fmu("PendulumAngle"), solver_method="rk4")
    assert 200 < result["solver.steps"][-1] < 5000
    assert error(result) < 1e-6


@BOTH
def test_the_error_of_dop853_falls_with_the_tolerance_over_nine_decades(native_fmu, name):
    """Each tenth of the tolerance makes the error smaller, from 1e-1 to 1e-13, nine decades and more
    in all, and the error stays below twice the tolerance."""
    tolerances = 10.0 ** -np.arange(1, 14)
    errors = np.array([largest_error(native_fmu(name), tolerance=tol) for tol in tolerances])
    assert (errors < 2 * tolerances).all()
    assert (np.diff(errors) < 0).all()
    assert errors[0] / errors[-1] > 1e9
    assert errors[2] / errors[11] > 10**8.5  # from 1e-3 to 1e-12


@BOTH
@pytest.mark.parametrize(("method", "finest"), [("radau", 10)])
def test_the_error_of_the_other_methods_falls_with_the_tolerance(native_fmu, name, method, finest):
    """From 1e-4, where it is 2e-5, a hundredth of the tolerance makes the error of radau at least 10 times
    smaller."""
    errors = [
        largest_error(native_fmu(name), tolerance=10.0**-k, solver_method=method)
        for k in range(4, finest + 1, 2)
    ]
    assert (np.array(errors[:-1]) / errors[1:] > 10).all()
    assert errors[-1] < 100 * 10.0**-finest


def test_steps_are_no_longer_than_the_largest_step(native_fmu):
    """solver.maximum_step bounds the step: 1 s in steps of at most 0.01 s are at least 100."""
    path = native_fmu("PendulumAngle")
    free = run(path, 1.0, 1.0, 1e-3)["solver.steps"][-1]
    bound = run(path, 1.0, 1.0, 1e-3, solver_maximum_step=0.01)["solver.steps"][-1]
    assert free < 20
    assert 100 <= bound <= 110


def test_a_step_that_is_far_too_large_is_refused(native_fmu):
    """rk4 with steps as long as the whole fall knows nothing of the motion: it says so."""
    with pytest.raises(SimulationError, match=r"far too large: reduce solver\.step"):
        simulate(
            native_fmu("Hemisphere"),
            20.0,
            10.0,
            start_values={"theta": 0.1, "solver.method": "rk4", "solver.step": 10.0},
        )


def test_the_error_is_seen_where_a_rate_of_change_is_1e200(native_fmu):
    """A pendulum at g = 1e200 m/s^2 swings within 1e-99 s and keeps its energy as at 9.81: the squares
    in the estimate of the error, of 1e155 and more, are no doubles and must not be formed."""
    for gravity in (9.81, 1e200):
        period = 10 / math.sqrt(gravity)
        run = simulate(
            native_fmu("PendulumAngle"), period, period / 10, start_values={"g": gravity}
        )
        energy = run["energy.total"]
        assert np.abs(energy / energy[0] - 1).max() < 1e-7
