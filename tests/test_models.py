"""The models of the lectures: each against its closed forms, and against what they imply."""

from __future__ import annotations

import contextlib
import warnings
from typing import Any

import numpy as np
import pytest
from conftest import EVERY, of_each_kind, scene_of

from lagfmu import simulate, verify
from lagfmu.errors import SimulationError
from lagfmu.testing import carried, check_closed_form, read_description

g = 9.81  # m/s^2

Case = tuple[float, dict[str, float]]  # stop time [s], values
STEPS = {  # communication steps of a run, where ten are too few to meet each statement
    "HalfCar": 150,  # its wheels fly for a few hundredths of a second
    "DoubleWishbone": 100,
    **dict.fromkeys(
        ["Hemisphere", "RollingSphere", "Loop", "Ladder", "BouncingBall", "SlippingSphere"], 40
    ),
    **dict.fromkeys(
        ["FrictionOscillator", "Belt", "InclineFriction", "Bowling", "RoughHemisphere"], 70
    ),
}
CHANGED = {  # far from the defaults, consistent or not: the projection and the closed forms follow
    "Hemisphere": {"m": 2.3, "g": 3.7, "a": 0.6, "r": 0.6, "theta": -0.3, "der(theta)": -0.4},
    "InclineDisk": {"M": 3, "R": 0.4, "g": 1.6, "alpha": 0.2, "y": 0.2, "theta": 0.5, "der(y)": 1},
    "InclineDiskMinimal": {"M": 3, "R": 0.4, "g": 1.6, "alpha": 0.2, "der(theta)": 1},
    "PendulumCartesian": {"m": 0.3, "g": 1.6, "L": 2, "x": 1.7, "y": 0.9, "der(x)": 0.4},
    "PendulumAngle": {"m": 0.3, "g": 1.6, "L": 2, "theta": 2, "der(theta)": 0.2},
    "PendulumNullspace": {"m": 0.3, "g": 1.6, "L": 2, "x": 1.7, "y": 0.9, "der(x)": 0.4},
    "RotatingWire": {"m": 0.3, "omega": -1.5, "r": 0.4, "der(r)": -0.9, "der(phi)": -1.5},
    "Hoop": {"m": 0.3, "g": 3.7, "R": 0.5, "omega": -2.0, "theta": 2.0, "der(theta)": 1.0},
    "SphereInCylinder": {"m": 2.3, "g": 3.7, "R": 0.3, "a": 0.02, "der(phi)": -8.0, "wx": 40.0},
    "Crane": {"M": 500, "m": 900, "g": 1.6, "c": 40, "x": -1.5, "y": -5.5, "l": 6.0, "der(l)": 0.1},
    "CrankWithBearingFriction": {"m1": 3, "J2": 0.05, "a": 0.12, "b": 0.4, "r": 0.02, "mu": 0.15},
    "HalfCar": {"M": 900, "J": 1100, "m": 90, "k": 3e4, "c": 2e3, "der(s)": 15.0},
    "KnifeEdge": {
        "m": 3,
        "J": 0.7,
        "alpha": 0.9,
        "phi": 0.7,
        "der(phi)": -0.6,
        "der(x)": 2,
        "x": 1,
    },
    "Atwood": {"m1": 0.3, "m2": 3, "g": 1.6, "x1": 0.5, "x2": -0.5, "der(x1)": 0.4},
    "CartPendulum": {"M": 0.4, "m": 3, "L": 2, "c": 0.7, "s": 1, "x": 2, "der(s)": 0.3, "F": 2},
    "RollingSphere": {"m": 2.3, "g": 3.7, "a": 0.6, "r": 0.7, "theta": -0.3, "der(theta)": -0.4},
    "SlippingSphere": {
        "m": 2.3,
        "g": 3.7,
        "a": 0.6,
        "r": 0.8,
        "theta": 0.1,
        "mu_s": 0.3,
        "mu_k": 0.2,
    },
    "Ladder": {  # a start that is not at both wall and floor is another motion
        "m": 3,
        "g": 30,
        "l": 3,
        "theta": 1.0,
        "x": 1.5 * np.cos(1.0),
        "y": 1.5 * np.sin(1.0),
        "der(theta)": -0.3,
        "der(x)": 0.45 * np.sin(1.0),
        "der(y)": -0.45 * np.cos(1.0),
    },
    "Loop": {"m": 0.3, "g": 20, "a": 0.5, "y": -0.5, "der(x)": -5.9},
    "Chain": {"m": 2, "g": 1.6, "l": 0.4, "y1": 0.1, "x4": -0.3, "der(x2)": 1.5},
    "SliderCrank": {
        "J": 0.02,
        "m": 3,
        "M": 0.5,
        "k": 1e7,
        "c": 3e4,
        "phi": 1,
        "der(phi)": -20,
        "tau": 0.5,
    },
    "Arm": {"forearm.mass": 5.0, "gravity.z": -3.7, "rate": 3.0},
    "Cat": {"rate": 5.0, "bent": 0.5},
    "Bennett": {"one.mass": 2.0, "two.inertia.yy": 0.05, "gravity.z": 3.7},
    "Gyroscope": {"wheel.mass": 0.5, "wheel.inertia.zz": 0.003, "wheel.omega.x": 1.0},
    "DoubleWishbone": {"speed": 14.0, "strut.stiffness": 5e4, "upright.mass": 40.0},
    "Stewart": {"sway": 0.05, "rate": 5.0, "plate.mass": 20.0, "rod2.mass": 5.0},
    "Door": {"door.mass": 5.0, "gravity.z": -3.7, "door.inertia.zz": 2.0},
    "SliderCrankBodies": {"rod.mass": 2.5, "crank.inertia": 0.02, "gravity.y": -3.7},
    "SliderCrankSpace": {"rod.mass": 2.5, "crank.inertia.zz": 0.02, "gravity.y": -3.7},
    "DoublePendulum": {"m1": 0.3, "m2": 2, "L1": 2, "L2": 0.5, "y1": 0.3, "der(y2)": 1.5},
    "BouncingBall": {"m": 0.3, "g": 3.7, "e": 0.4, "y": 0.5, "der(y)": 1},
    "FrictionOscillator": {"x": -0.3, "k": 40.0, "mu_k": 0.1, "mu_s": 0.1},
    "Belt": {"speed": 0.5, "der(x)": 0.5, "mu_s": 0.8, "k": 50.0},
    "InclineFriction": {"alpha": np.arctan(3 * 0.4) * 0.999},
    "Bowling": {"der(x)": 3.0, "der(phi)": -20.0, "mu": 0.3},
    "RoughHemisphere": {"theta": 0.4, "mu_k": 0.3},
}


def on_a_sphere(m: float, g: float, a: float, theta: float, share: float) -> Case:
    """From theta with v0^2 = share g a cos(theta), until it has flown for a while."""
    rate = np.sqrt(share * g / a * np.cos(theta))
    stop = (25 if theta < 1e-3 else 6) * np.sqrt(a / g)
    return stop, {"m": m, "g": g, "a": a, "r": a, "theta": theta, "der(theta)": rate}


def rolling(m: float, g: float, a: float, R: float, theta: float, share: float) -> Case:
    """From theta with v0^2 = share g b cos(theta), b = a + R."""
    b = a + R
    rate = np.sqrt(share * g / b * np.cos(theta))
    start = {"r": b, "theta": theta, "der(theta)": rate, "der(phi)": b / R * rate}
    return 6 * np.sqrt(b / g), {"m": m, "g": g, "a": a, "R": R, **start}


def in_the_loop(m: float, g: float, a: float, square: float) -> Case:
    """From the bottom with v0^2 = square g a."""
    start = {"x": 0.0, "y": -a, "der(x)": np.sqrt(square * g * a)}
    return 5 * np.sqrt(a / g), {"m": m, "g": g, "a": a, **start}


def at_the_wall(m: float, length: float, theta: float, share: float) -> Case:
    """With `share` of the rate at which it would leave the wall at once, l theta'^2 = 3/2 g sin(theta)."""
    rate, s, c = -np.sqrt(share * 1.5 * g / length * np.sin(theta)), np.sin(theta), np.cos(theta)
    place = {"theta": theta, "x": length / 2 * c, "y": length / 2 * s, "der(theta)": rate}
    speed = {"der(x)": -length / 2 * s * rate, "der(y)": length / 2 * c * rate}
    return 4 * np.sqrt(length / g), {"m": m, "l": length, "g": g, **place, **speed}


def disk(M: float, R: float, g: float, alpha: float) -> Case:
    """Rolled uphill first."""
    return 1.0, {"M": M, "R": R, "g": g, "alpha": alpha, "theta": 3.0, "der(theta)": -2.0}


def bead(m: float, omega: float, r: float, rate: float) -> Case:
    start = {"r": r, "der(r)": rate, "der(phi)": omega}
    return 4 / abs(omega), {"m": m, "omega": omega, **start}


def blade(m: float, J: float, g: float, alpha: float, omega: float, phi: float, u: float) -> Case:
    """At phi, turning with omega, sliding along itself with u."""
    start = {"phi": phi, "der(phi)": omega, "der(x)": u * np.cos(phi), "der(y)": u * np.sin(phi)}
    return 6.0, {"m": m, "J": J, "g": g, "alpha": alpha, **start}


def ball(m: float, e: float, y: float, rate: float) -> Case:
    """Until it has bounced its last."""
    w = np.sqrt(rate**2 + 2 * g * y)
    stop = 1.2 * ((rate + w) / g + 2 * w * e / (g * (1 - e)))
    return stop, {"m": m, "e": e, "y": y, "der(y)": rate}


DISKS = [
    disk(1.3e3, 0.7, 9.81, 0.02),
    disk(2e-3, 4e-3, 1.62, 1.5),
    disk(3.0, 0.25, 9.81, np.pi / 2),
    disk(1e-6, 1e4, 9.81, 0.7),
]
# masses, lengths, times and starts of any size: seconds to run, values
WORLDS: dict[str, list[Case]] = {
    "Hemisphere": [
        on_a_sphere(1.0, 9.81, 1.0, 1e-6, 0.0),
        on_a_sphere(1.0, 9.81, 1.0, 0.01, 0.1),
        on_a_sphere(1.0, 9.81, 1.0, 0.3, 0.999),
        on_a_sphere(1.0, 9.81, 1.0, 1.2, 0.9),
        on_a_sphere(3e-3, 1.62, 25.0, 0.01, 0.3),
        on_a_sphere(1e3, 9.81, 1e-3, 0.1, 0.1),
        on_a_sphere(1.0, 9.81, 1e6, 1.2, 0.9),
        on_a_sphere(1.0, 9.81, 1e-6, 0.3, 0.5),
        on_a_sphere(1.0, 9.81e12, 1.0, 0.01, 0.0),
    ],
    "RollingSphere": [
        rolling(m, grav, a, R, theta, share)
        for m, grav, a, R in (
            (1.0, 9.81, 1.0, 0.2),
            (3e-3, 1.62, 2.0, 25.0),
            (1e3, 9.81, 1e-6, 1e-7),
            (1.0, 9.81, 1.0, 1e-3),
        )
        for theta, share in ((0.01, 0.0), (0.3, 0.5), (0.9, 0.99))
    ],
    "Loop": [
        in_the_loop(m, grav, a, square)
        for m, grav, a in ((1.0, 9.81, 1.0), (3e-3, 1.62, 25.0), (1e3, 9.81, 1e-6))
        for square in (2.1, 3.732, 4.999)
    ],
    "Ladder": [
        at_the_wall(10.0, 2.0, 1.5, 0.0),
        at_the_wall(0.3, 50.0, 0.2, 0.0),
        at_the_wall(10.0, 1e-3, 1.0, 0.5),
        at_the_wall(2.0, 3.0, 0.8, 0.999),
        *((1.5, start) for start in ({"theta": 1e-8 - np.pi / 2}, {"l": 0.002}, {"theta": 2.0})),
    ],
    "InclineDisk": [(t, values | {"y": 3.0 * values["R"]}) for t, values in DISKS],
    "InclineDiskMinimal": DISKS,
    "RotatingWire": [bead(0.03, 0.7, 2.0, -1.5), bead(20.0, -3.0, 1e-3, 0.0)],
    "KnifeEdge": [
        blade(70.0, 2.5, 3.7, 0.1, -0.8, 2.0, 3.0),
        blade(1e-3, 1e-7, 9.81, 1.2, 9.0, -1.0, -0.2),
    ],
    "Atwood": [
        (1.0, {"m1": m1, "m2": m2, "g": grav, "der(x1)": -0.5, "der(x2)": 0.5})
        for m1, m2, grav in ((3.0, 3.0, 9.81), (1e3, 1e-3, 9.81), (1e-6, 1e9, 1.62))
    ],
    "BouncingBall": [
        ball(*row)
        for row in (
            (0.2, 0.5, 0.3, 2.0),
            (5.0, 0.3, 2.0, -3.0),
            (1.0, 0.95, 1.0, 0.0),
            (1.0, 0.0, 1.0, 0.0),
            (1.0, 0.6, 0.0, 3.0),
            (1.0, 0.7, 1e-6, 0.0),
            (1.0, 0.7, 1e6, 0.0),
        )
    ],
    "SliderCrank": [(1.0, {"x": -0.2, "y": 0.0})],  # the slider behind the crank
    "InclineFriction": [
        (3.0, values)
        for values in (
            {"alpha": np.arctan(3 * 0.4) * 1.001},
            {"alpha": np.arctan(3.5 * 0.4) * 1.001, "kappa": 0.4},
            {"alpha": np.arctan(3.5 * 0.4) * 0.999, "kappa": 0.4},
            {"alpha": 0.2, "der(y)": 1.5},
            {"alpha": 0.2, "der(theta)": 20.0},
            {"alpha": 0.2, "der(y)": -1.0, "der(theta)": 3.0, "kappa": 1.0},
        )
    ],
    "RoughHemisphere": [(2.0, {"theta": 0.2}), (2.0, {"der(theta)": 0.9})],
    "Hoop": [  # too slow to leave the bottom; through the bottom; about the top; at rest beside it
        (3.0, {"omega": 5.0}),
        (3.0, {"theta": -0.5, "der(theta)": 3.0, "omega": 5.0}),
        (1.0, {"theta": 3.1, "der(theta)": 20.0}),
        (3.0, {"theta": float(np.arccos(g / (0.2 * 10.0**2)))}),
    ],
    "SphereInCylinder": [  # lying: a pendulum, which rolls along too; leaning; over the top; it stays up
        (3.0, {"tilt": np.pi / 2, "phi": 1.0, "der(phi)": 0.0, "der(z)": 0.3, "wx": 20.0}),
        (3.0, {"tilt": 0.7, "phi": 1.0, "der(phi)": 3.0}),
        (3.0, {"tilt": 1.2, "phi": 2.5, "der(phi)": 1.0}),
        (3.0, {"wx": -5 * g / (2 * 0.1 * 10.0)}),
    ],
    "SlippingSphere": [
        (2.0, {"mu_s": 1.2, "mu_k": 0.9}),
        (2.0, {"theta": 0.3, "mu_k": 0.05}),
    ],
    "FrictionOscillator": [(3.0, {"x": 0.02})],
}


QUICK = CHANGED.keys() - {
    "Arm",
    "Cat",
    "DoubleWishbone",
    "Stewart",
}  # test_rigid_bodies.py has their like


@pytest.mark.parametrize(
    ("name", "tolerance"),
    [
        *of_each_kind(sorted(CHANGED), 1e-8, label="1e-08", kinds=QUICK),
        *of_each_kind(sorted(CHANGED), 1e-12, label="1e-12"),
    ],
)
def test_outputs_equal_the_closed_forms(name: str, tolerance: float, native_fmu: Any) -> None:
    """As it is built, changed, and in each of its worlds; over long steps, so that it is the integrator's
    tolerance that counts."""
    file, scene = scene_of(name)
    closed_forms = carried(scene, file.closed_forms)
    forces = ("lambda.", "force.")
    assert any(v.startswith(forces) for c in closed_forms for v in c.variables)
    moving = [f"{i.symbol.func}" for i in file.model.prescribed]  # inputs that go on by themselves
    besides = [form.format(n) for n in moving for form in ("{}", "der({})", "der({},2)")]
    inputs = {str(i.symbol.func): i.start for i in file.model.inputs}
    built = {str(p.symbol): p.value for p in file.model.parameters} | inputs
    held: set[str] = set()
    for stop, values in (
        (scene.stop_time, {}),
        (scene.stop_time, CHANGED[name]),
        *WORLDS.get(name, ()),
    ):
        step = stop / STEPS.get(name, 10)
        options = {"tolerance": tolerance, "besides": besides, "start_values": values}
        result = simulate(native_fmu(name), stop, step, **options)
        for closed_form in closed_forms:
            check = check_closed_form(closed_form, result, built | values, max(tolerance, 1e-12))
            assert check.error <= check.allowed, (closed_form.name, values)
            held |= {closed_form.name} if check.points else set()
    assert held == {c.name for c in closed_forms}


def test_the_table_above_names_every_scene() -> None:
    """But the falling rod, which has a file of its own."""
    assert set(CHANGED) == set(EVERY) - {"FallingRod"}


OVERCONSTRAINED = ("Bennett", "Door")  # which close with these lengths, and with no others


@pytest.mark.thorough
@pytest.mark.parametrize("name", EVERY)
def test_statements_hold_with_parameters_and_starts_drawn_at_random(name: str, native_fmu) -> None:
    """Each parameter, then each start value too, times e^-0.4 to e^0.4: whatever a model states of its FMU,
    with what it says of its own validity, is missed by none that the FMU accepts."""
    path, rng, accepted = native_fmu(name), np.random.default_rng(7), 0
    known = read_description(path).modelVariables
    numbers = [v for v in known if v.type == "Real" and float(v.start or 0)]
    if name in OVERCONSTRAINED:
        numbers = [v for v in numbers if ".first." not in v.name and ".second." not in v.name]
    parameters = [v for v in numbers if v.causality == "parameter" and "solver." not in v.name]
    starts = [v for v in numbers if v.initial in ("exact", "approx") and v.causality == "output"]
    for drawn in (parameters, [*parameters, *starts], [*parameters, *starts]):
        values = {}
        for v in drawn:
            value = float(v.start) * np.exp(rng.uniform(-0.4, 0.4))
            values[v.name] = np.clip(value, float(v.min or -np.inf), float(v.max or np.inf))
        with warnings.catch_warnings(), contextlib.suppress(SimulationError):
            warnings.simplefilter("ignore")  # starts that are moved onto the constraints
            found = verify(path, values)
            accepted += 1
            assert found.passed, [str(c) for c in found.checks if c.failed]
    assert accepted
