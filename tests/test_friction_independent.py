"""Systems with friction that stand in no model file, against integrations whose modes and events are written
by hand: a block on a wedge that is shaken, and a clutch."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Contact, Friction, Model, Nonholonomic, Parameter, Scene, multiplier, simulate
from lagfmu.testing import find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
g = 9.81  # m/s^2
t = dynamicsymbols._t
x, y, X, phi, psi = dynamicsymbols("x y X phi psi")
m, M, G, mu, alpha, push, omega = symbols("m M g mu alpha push omega", positive=True)
R, J, K, P, torque = symbols("R J K P torque", positive=True)


@cache
def wedge() -> Model:
    """A block (m) on a wedge (M) of the angle alpha that a force shakes along the smooth floor."""
    return Model(
        name="Wedge",
        lagrangian=M * X.diff() ** 2 / 2 + m * (x.diff() ** 2 + y.diff() ** 2) / 2 - m * G * y,
        coordinates={X: "m", x: "m", y: "m"},
        constraints=[
            Contact("face", (x - X) * sin(alpha) + y * cos(alpha)),
            Nonholonomic("rests", (x.diff() - X.diff()) * cos(alpha) - y.diff() * sin(alpha)),
            Friction("grip", of=["rests"], normal=multiplier("face"), static=mu),
        ],
        forces={X: push * cos(omega * t)},
        parameters=[
            Parameter(M, 2.0, "kg"),
            Parameter(m, 1.0, "kg"),
            Parameter(G, g, "m/s^2"),
            Parameter(alpha, 0.4, "rad"),
            Parameter(mu, 0.5, "1"),
            Parameter(push, 15.0, "N"),
            Parameter(omega, 5.0, "rad/s"),
        ],
    )


@cache
def clutch() -> Model:
    """Two disks, one driven by a swelling torque, pressed together by P at the mean radius R."""
    return Model(
        name="Clutch",
        lagrangian=J * phi.diff() ** 2 / 2 + K * psi.diff() ** 2 / 2,
        coordinates={phi: "rad", psi: "rad"},
        constraints=[
            Nonholonomic("lining", R * (phi.diff() - psi.diff())),
            Friction("clutch", of=["lining"], normal=P, static=1.3 * mu, kinetic=mu),
        ],
        forces={phi: torque * sin(omega * t)},
        parameters=[
            Parameter(J, 0.2, "kg.m^2"),
            Parameter(K, 0.5, "kg.m^2"),
            Parameter(R, 0.1, "m"),
            Parameter(P, 200.0, "N"),
            Parameter(mu, 0.3, "1"),
            Parameter(torque, 12.0, "N.m"),
            Parameter(omega, 3.0, "rad/s"),
        ],
        start={phi.diff(): 30.0},
    )


Mode = int  # 0: sticks; 1, -1: slips with, against the row's direction


def by_hand(
    rates: Callable[[Mode, float, np.ndarray], np.ndarray],
    slip: Callable[[np.ndarray], float],
    reserve: Callable[[float, np.ndarray], float],
    wants: Callable[[float, np.ndarray], float],
    state: np.ndarray,
    times: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """States and modes at `times`.  It sticks as long as `reserve` > 0 (of the sticking solution, to the
    static cone), then slips the way `wants`; it slips until the slip velocity is 0."""
    now, at = 0.0, np.array(state, float)
    still = abs(slip(at)) < 1e-14
    mode = int(np.sign(slip(at))) if not still else 0
    if mode == 0 and reserve(0.0, at) < 0:
        mode = int(np.sign(wants(0.0, at)))
    states, modes = [], []
    left = list(times)

    def rate(time: float, y: np.ndarray) -> np.ndarray:
        return rates(mode, time, y)

    def end(time: float, y: np.ndarray) -> float:
        return reserve(time, y) if mode == 0 else mode * slip(y)

    end.terminal, end.direction = True, -1.0  # type: ignore[attr-defined]
    while left:
        run = solve_ivp(
            rate,
            (now, times[-1]),
            at,
            method="DOP853",
            rtol=1e-12,
            atol=1e-13,
            max_step=0.02,  # what sticks needs no steps, but is watched
            events=end,
            dense_output=True,
        )
        stop = run.t[-1]
        while left and left[0] <= stop:
            states.append(run.sol(left.pop(0)))
            modes.append(mode)
        if not left:
            break
        now, at = float(stop), run.y[:, -1]
        if mode == 0:
            mode = int(np.sign(wants(now, at)))
        else:
            mode = 0 if reserve(now, at) > 0 else int(np.sign(wants(now, at)))
    return np.array(states), np.array(modes)


def wedge_by_hand(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """States X, x, y, X', x', y'; the slip is downhill along the face, friction pushes uphill."""
    W, w, angle, mu0, F0, om = 2.0, 1.0, 0.4, 0.5, 15.0, 5.0
    s, c = np.sin(angle), np.cos(angle)

    def solve(time: float, sticks: bool, way: Mode) -> np.ndarray:
        """X'', x'', y'', N, T (on the block along the face)."""
        F = F0 * np.cos(om * time)
        rows = [
            [W, 0, 0, s, c],
            [0, w, 0, -s, -c],
            [0, 0, w, -c, s],
            [-s, s, c, 0, 0],
            [-c, c, -s, 0, 0] if sticks else [0, 0, 0, way * mu0, 1],
        ]
        return np.linalg.solve(rows, [F, 0, -w * g, 0, 0])

    def rates(mode: Mode, time: float, z: np.ndarray) -> np.ndarray:
        return np.concatenate([z[3:], solve(time, mode == 0, mode)[:3]])

    def held(time: float) -> tuple[float, float]:
        *_, N, T = solve(time, True, 0)
        return float(N), float(T)

    return by_hand(
        rates,
        lambda z: float((z[4] - z[3]) * c - z[5] * s),
        lambda time, z: mu0 * held(time)[0] - abs(held(time)[1]),
        lambda time, z: -held(time)[1],
        np.zeros(6),
        times,
    )


def clutch_by_hand(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    J1, J2, r, press, mu_k, T0, om = 0.2, 0.5, 0.1, 200.0, 0.3, 12.0, 3.0

    def rates(mode: Mode, time: float, z: np.ndarray) -> np.ndarray:
        T = T0 * np.sin(om * time)
        if mode == 0:
            both = T / (J1 + J2)
            return np.array([z[2], z[3], both, both])
        friction = mode * mu_k * press * r
        return np.array([z[2], z[3], (T - friction) / J1, friction / J2])

    def carried(time: float) -> float:
        """Force on the lining that keeps the disks together, along the slip."""
        return -T0 * np.sin(om * time) * J2 / (J1 + J2) / r

    return by_hand(
        rates,
        lambda z: float(r * (z[2] - z[3])),
        lambda time, z: 1.3 * mu_k * press - abs(carried(time)),
        lambda time, z: -carried(time),
        np.array([0.0, 0.0, 30.0, 0.0]),
        times,
    )


TIMES = np.linspace(0, 3, 31)
SYSTEMS: dict[str, Any] = {
    "wedge": (wedge, wedge_by_hand, ("X", "x", "y", "der(X)", "der(x)", "der(y)"), "grip"),
    "clutch": (clutch, clutch_by_hand, ("phi", "psi", "der(phi)", "der(psi)"), "clutch"),
}


@pytest.mark.parametrize("name", sorted(SYSTEMS))
def test_motion_is_that_of_modes_and_events_written_by_hand(name: str) -> None:
    """Every coordinate and velocity, and when it sticks, at 30 instants through all its transitions."""
    model, by_hands, columns, grip = SYSTEMS[name]
    states, modes = by_hands(TIMES)
    assert {*modes} >= {0, 1}  # it sticks and slips
    assert (np.diff(modes) != 0).sum() >= 3
    options = {"stop_time": 3.0, "step_size": 0.1, "tolerance": 1e-10}
    scene = Scene(name.title())
    run = simulate(model(), scene=scene, **options)
    for column, expected in zip(columns, states.T, strict=True):
        assert run[column] == pytest.approx(expected, abs=2e-8 * max(1.0, np.abs(expected).max()))
    assert (run[f"sticks.{grip}"] == (modes == 0)).all()
    assert (run[f"margin.{grip}"] >= -1e-10).all()
    assert (np.diff(run["energy.dissipated"]) >= -1e-12).all()
