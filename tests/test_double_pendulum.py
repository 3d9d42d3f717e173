"""Double pendulum in Cartesian coordinates, through fmpy on the built FMU."""

from __future__ import annotations

import numpy as np
import pytest
from runs import simulate_fmu
from scipy.integrate import solve_ivp

G = 9.81
CASES = {  # m1, m2 [kg], L1, L2 [m], both angles [rad] and their rates [rad/s]
    "default": (1.0, 0.5, 1.0, 0.8, 1.0, 1.5, 0.0, 0.0),
    "heavy end": (0.01, 5.0, 0.4, 1.5, -0.6, 0.3, 1.0, -2.0),
    "turning over": (1.0, 1.0, 1.0, 1.0, 2.5, 3.0, 0.0, 3.0),
}
EVERY = pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())


def bobs(case, a, b, adot, bdot):
    """x1, y1, x2, y2 and their rates from the angles from the downward vertical."""
    L1, L2 = case[2:4]
    x1, y1 = L1 * np.sin(a), -L1 * np.cos(a)
    v1, w1 = L1 * np.cos(a) * adot, L1 * np.sin(a) * adot
    x2, y2 = x1 + L2 * np.sin(b), y1 - L2 * np.cos(b)
    v2, w2 = v1 + L2 * np.cos(b) * bdot, w1 + L2 * np.sin(b) * bdot
    return x1, y1, x2, y2, v1, w1, v2, w2


NAMES = ("x1", "y1", "x2", "y2", "der(x1)", "der(y1)", "der(x2)", "der(y2)")


def swing(path, case, tolerance=1e-12, stop=3.0, points=30):
    start = dict(zip(NAMES, map(float, bobs(case, *case[4:])), strict=True))
    values = dict(zip(("m1", "m2", "L1", "L2"), case, strict=False))
    return simulate_fmu(
        str(path),
        stop_time=stop,
        output_interval=stop / points,
        step_size=stop / points,
        relative_tolerance=tolerance,
        start_values={**values, "g": G, **start},
    )


def alone(case, times):
    """Angles and rates by the textbook's equations in the two angles (Landau & Lifshitz, sect. 5)."""
    m1, m2, L1, L2 = case[:4]

    def rhs(_, s):
        a, b, adot, bdot = s
        c, sine = np.cos(a - b), np.sin(a - b)
        M = [[(m1 + m2) * L1, m2 * L2 * c], [L1 * c, L2]]
        right = [
            -m2 * L2 * bdot**2 * sine - (m1 + m2) * G * np.sin(a),
            L1 * adot**2 * sine - G * np.sin(b),
        ]
        return [adot, bdot, *np.linalg.solve(M, right)]

    found = solve_ivp(rhs, (0, times[-1]), case[4:], "DOP853", t_eval=times, rtol=1e-13, atol=1e-13)
    return found.y


@EVERY
def test_the_bobs_are_where_the_two_angles_say(native_fmu, case):
    """The motion in x and y with two rods is the motion in two angles without any."""
    result = swing(native_fmu("DoublePendulum"), case)
    expected = bobs(case, *alone(case, result["time"]))
    for name, right in zip(NAMES, expected, strict=True):
        scale = np.abs(right).max()
        assert np.abs(result[name] - right).max() < 1e-8 * scale, name


@pytest.mark.parametrize("sign", [1, -1])
def test_the_small_oscillations_are_two_modes(native_fmu, sign):
    """Equal masses on equal rods hang in modes with w^2 = (2 -+ sqrt 2) g/l, in which the lower angle is
    +-sqrt 2 times the upper: after a period the bobs are where they were."""
    a = 1e-5
    case = (1.0, 1.0, 0.7, 0.7, a, sign * np.sqrt(2) * a, 0.0, 0.0)
    period = 2 * np.pi / np.sqrt((2 - sign * np.sqrt(2)) * G / 0.7)
    result = swing(native_fmu("DoublePendulum"), case, stop=2 * period, points=4)
    for name in ("x1", "x2"):
        start = result[name][0]
        np.testing.assert_allclose(result[name] / start, [1, -1, 1, -1, 1], atol=1e-7)


def test_at_rest_the_upper_rod_carries_both_and_the_lower_one(native_fmu):
    """Hanging at rest T1 = (m1 + m2) g and T2 = m2 g; together they carry m1 g at the upper bob."""
    result = swing(native_fmu("DoublePendulum"), (3.0, 0.2, 1.5, 0.6, 0, 0, 0, 0), points=3)
    np.testing.assert_allclose(result["lambda.upper"], -3.2 * G / (2 * 1.5), rtol=1e-14)
    np.testing.assert_allclose(result["lambda.lower"], -0.2 * G / (2 * 0.6), rtol=1e-14)
    np.testing.assert_allclose(result["Q.y1"], 3.0 * G, rtol=1e-13)
