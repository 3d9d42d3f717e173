"""Derivatives of a run by parameters and start values, along the motion and through its events."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import fmi2
import fmpy
import numpy as np
import pytest
from conftest import model_file, scene_of
from instance import instance
from runs import evenly
from scipy.special import ellipj, ellipk
from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols
from typer.testing import CliRunner
from zoo import point_mass

from lagfmu import Contact, Holonomic, Model, Parameter, Scene, fit
from lagfmu.errors import BuildError, RequestError
from lagfmu.testing import app, prepare

TIGHT = 1e-11  # tolerance of a run whose derivatives are held against closed forms
STENCIL = ((-2, 1 / 12), (-1, -8 / 12), (1, 8 / 12), (2, -1 / 12))  # central, of fourth order

Varied = Callable[..., Path]


@pytest.fixture
def varied(built: Any) -> Varied:
    """varied(NAME, "lambda.rod:L", ...): an FMU of models/ with these derivatives, other starts if given."""

    def get(name: str, *sensitivities: str, start: Any = None, **scene: Any) -> Path:
        file, asked = scene_of(name)
        model = file.model if start is None else replace(file.model, start=start)
        return built(model, replace(asked, sensitivities=sensitivities, **scene))

    return get


def run(
    fmu: Path, stop: float, points: int, start: Any = None, tolerance: float = TIGHT, **more: Any
) -> Any:
    """All outputs at the communication points."""
    return evenly(fmu, stop, points, tolerance, start or {}, **more)


def by_differences(
    fmu: Path, stop: float, points: int, by: str, at: float, step: float, outputs: Sequence[str]
) -> dict[str, np.ndarray]:
    """The same derivatives by runs at 1e-13, with `by` a little beside its value."""
    runs = [(w, run(fmu, stop, points, {by: at + k * step}, 1e-13)) for k, w in STENCIL]
    return {name: sum(w * found[name] for w, found in runs) / step for name in outputs}


# ------------------------------------------------------------------------------- smooth motion


@pytest.mark.parametrize("name", ["PendulumCartesian", "PendulumNullspace"])
def test_the_force_in_a_rod_changes_with_its_length(varied, name):
    """theta(t) = Theta(t sqrt(g/L)) from rest at 1 rad, so that d theta/dL = -t theta'/(2 L), and the
    multiplier of x^2 + y^2 = L^2, -m g (3 cos theta - 2 cos 1)/(2 L), follows."""
    found = run(varied(name, "lambda.rod:L,g"), 2.0, 20)
    t, k = found["time"], math.sin(0.5)
    sn, cn, _, _ = ellipj(math.sqrt(9.81) * t + ellipk(k**2), k**2)
    angle = 2 * np.arcsin(k * sn)
    rate = 2 * k * cn * math.sqrt(9.81)
    force = 9.81 * (3 * np.cos(angle) - 2 * math.cos(1))
    per_angle = 3 * 9.81 * np.sin(angle) / 2
    by_length = per_angle * -t * rate / 2 + force / 2
    by_gravity = per_angle * t * rate / (2 * 9.81) - force / (2 * 9.81)
    assert found["sensitivity.valid"].all()
    np.testing.assert_allclose(found["sensitivity.lambda.rod.by.L"], by_length, atol=1e-9)
    np.testing.assert_allclose(found["sensitivity.lambda.rod.by.g"], by_gravity, atol=1e-10)


def test_a_circle_stays_one_and_energy_is_what_it_was(varied):
    """On x^2 + y^2 = L^2: x x_L + y y_L = L at every time, however coarse the run. From rest at 1 rad the
    energy is -m g L cos 1."""
    fmu = varied("PendulumCartesian", "x:L", "y:L", "energy.total:L,m")
    found = run(fmu, 3.0, 30, tolerance=1e-5)
    along = sum(found[q] * found[f"sensitivity.{q}.by.L"] for q in "xy")
    np.testing.assert_allclose(along, 1.0, atol=1e-14)
    found = run(fmu, 3.0, 30)
    for by in "Lm":
        np.testing.assert_allclose(
            found[f"sensitivity.energy.total.by.{by}"], -9.81 * math.cos(1), rtol=1e-10
        )


@pytest.mark.parametrize("name", ["PendulumCartesian", "Hemisphere", "HalfCar", "KnifeEdge"])
def test_the_run_beside_which_they_go_is_the_same(varied, built, name):
    """Derivatives look on: with them every value has the bits that it has without."""
    file, asked = scene_of(name)
    number = file.model.parameters[0].symbol
    plain = built(file.model, replace(asked, method="dop853"))
    both = [run(fmu, 1.0, 20, None, 1e-8) for fmu in (plain, varied(name, f"*:{number}"))]
    for output in both[0].dtype.names:
        assert both[0][output].tobytes() == both[1][output].tobytes(), output


def test_reduced_coordinates_give_the_derivatives_of_all(varied):
    """The disk of example 7.9 rolls with y'' = (2/3) g sin alpha and lambda = -M g sin(alpha)/3."""
    fmu = varied("InclineDiskMinimal", "*:g,alpha,R")
    found = run(fmu, 1.0, 10)
    t, alpha = found["time"], math.pi / 6
    y = t**2 / 3
    np.testing.assert_allclose(found["sensitivity.y.by.g"], y * math.sin(alpha), atol=1e-13)
    np.testing.assert_allclose(found["sensitivity.y.by.alpha"], y * 9.81 * math.cos(alpha))
    np.testing.assert_allclose(found["sensitivity.lambda.rolling.by.g"], -math.sin(alpha) / 3)
    of_angle = -(found["theta"] / 0.1)  # theta = y/R
    np.testing.assert_allclose(found["sensitivity.theta.by.R"], of_angle, atol=1e-11)


def test_a_stiff_damper_by_the_implicit_method(built):
    """m x'' + c x' + k x = 0 from rest, m = 1, c = 1e6, k = 1e4: with r = (-c +- sqrt(c^2 - 4 m k))/(2 m),
    x = x0 (r2 e^(r1 t) - r1 e^(r2 t))/(r2 - r1), slow by r1 = -0.01/s and quick by r2 = -1e6/s. radau has
    the derivatives in steps of the slow motion, and the run keeps the bits that it has without them."""
    x = dynamicsymbols("x")
    c, k, x0 = symbols("c k x0", positive=True)
    model = point_mass(
        "Damper",
        "x",
        energy=-k * x**2 / 2,
        parameters=[Parameter(c, 1e6, "N.s/m"), Parameter(k, 1e4, "N/m"), Parameter(x0, 0.5, "m")],
        forces={x: -c * x.diff()},
        start={x: x0},
    )
    plain = built(model, Scene("Damper", method="radau", methods=("radau",)))
    asked = Scene("Damper", method="radau", methods=("radau",), sensitivities=("x,der(x):c,k,x0",))
    both = [run(fmu, 100.0, 10, None, 1e-8) for fmu in (plain, built(model, asked))]
    for output in both[0].dtype.names:
        assert both[0][output].tobytes() == both[1][output].tobytes(), output
    found = both[1]
    assert found["solver.steps"][-1] < 200
    slow = -2e4 / (1e6 + math.sqrt(1e12 - 4e4))
    expected = 0.5 * np.exp(slow * found["time"])  # e^(r2 t) is 0, and r1/r2 1e-8
    slower = {"c": -slow / 1e6, "k": slow / 1e4, "x0": 0.0}  # d r1, to 1e-8
    for by, change in slower.items():
        moved = expected * (change * found["time"] + (by == "x0") / 0.5)
        np.testing.assert_allclose(found[f"sensitivity.x.by.{by}"], moved, rtol=1e-6, atol=1e-12)


def test_where_a_reduced_disk_strikes_follows_its_radius(built):
    """A disk that rolls, y = R theta by theta alone, strikes a wall at y = b: there y knows no radius, and
    theta = b/R goes with -b/R^2."""
    y, theta = dynamicsymbols("y theta")
    M, R, F, b = symbols("M R F b", positive=True)
    model = Model(
        name="Struck",
        lagrangian=M * y.diff() ** 2 / 2 + M * R**2 * theta.diff() ** 2 / 4,
        forces={y: F},
        coordinates={y: "m", theta: "rad"},
        constraints=[
            Holonomic("rolling", y - R * theta),
            Contact("wall", b - y, restitution=0.5),
        ],
        parameters=[
            Parameter(M, 1.0, "kg"),
            Parameter(R, 0.1, "m"),
            Parameter(F, 2.0, "N"),
            Parameter(b, 0.3, "m"),
        ],
        start={y: 0.0, theta: 0.0},
    )
    asked = ("closing.wall.y:R,b", "closing.wall.theta:R,b", "closing.wall.velocity.theta:R")
    found = run(built(model, Scene("Struck", formulation="minimal", sensitivities=asked)), 1.0, 4)[
        -1
    ]
    assert found["closing.wall.count"] >= 1
    assert found["closing.wall.y"] == pytest.approx(0.3)
    expected = {"y.by.R": 0.0, "y.by.b": 1.0, "theta.by.R": -0.3 / 0.1**2, "theta.by.b": 1 / 0.1}
    expected["velocity.theta.by.R"] = -found["closing.wall.velocity.theta"] / 0.1
    for name, value in expected.items():
        assert found[f"sensitivity.closing.wall.{name}"] == pytest.approx(value, abs=1e-8), name


# ------------------------------------------------------------------------------- contacts


@pytest.mark.parametrize(("method", "close"), [("dop853", 1e-10), ("radau", 1e-8)])
def test_when_the_particle_leaves_the_hemisphere(varied, method, close):
    """Times go with sqrt(a/g): dT/da = T/(2 a), dT/dg = -T/(2 g), dT/dm = 0; and dT/dtheta0 =
    -1.01696078397883 at theta0 = 0.3 (the quadrature of the energy integral, differentiated)."""
    only = {} if method == "dop853" else {"method": method, "methods": (method,)}
    fmu = varied("Hemisphere", "departure.surface.time:a,g,m,theta", **only)
    found = run(fmu, 1.0, 4, {"theta": 0.3})[-1]
    time = found["departure.surface.time"]
    expected = {"a": time / 2, "g": -time / 2 / 9.81, "m": 0.0, "theta": -1.01696078397883}
    for by, value in expected.items():
        assert abs(found[f"sensitivity.departure.surface.time.by.{by}"] - value) < close, by


@pytest.mark.parametrize("stops", [False, True])
def test_they_come_through_an_fmu_of_fmi_3(built, stops):
    """The same, whether its importer stops at the event, with early return and event mode, or not."""
    file, scene = scene_of("Hemisphere")
    asked = replace(scene, sensitivities=("departure.surface.time:a,theta",))
    fmu = built(file.model, asked, fmi=3)
    how = {"early_return_allowed": stops, "use_event_mode": stops}
    found = run(fmu, 1.0, 4, {"theta": 0.3}, **how)[-1]
    time = "departure.surface.time"
    assert found["sensitivity.valid"]
    assert abs(found[f"sensitivity.{time}.by.a"] - found[time] / 2) < 1e-10
    assert abs(found[f"sensitivity.{time}.by.theta"] + 1.01696078397883) < 1e-10


def test_the_flight_after_the_departure(varied):
    """It leaves at cos theta = (2/3) cos theta0, whatever a and g are, with v^2 = g a cos theta; then it
    flies, and r^2 = a^2 + v^2 tau^2 - a g cos(theta) tau^2 + v g sin(theta) tau^3 + g^2 tau^4/4 at tau
    after it."""
    names = ("departure.surface.theta", "departure.surface.velocity.theta", "r")
    found = run(varied("Hemisphere", *(f"{n}:a" for n in names)), 1.0, 4, {"theta": 0.3})[-1]
    spin = found["departure.surface.velocity.theta"]
    assert abs(found["sensitivity.departure.surface.theta.by.a"]) < 1e-10
    # spin = sqrt(g cos(theta)/a)
    of_spin = found["sensitivity.departure.surface.velocity.theta.by.a"]
    assert abs(of_spin + spin / 2) < 1e-10

    def height(a: float) -> float:  # r at t = 1, in units of a a function of t sqrt(g/a)
        tau = 1 - found["departure.surface.time"] * math.sqrt(a)
        c = 2 / 3 * math.cos(0.3)
        s, v = math.sqrt(1 - c**2), math.sqrt(9.81 * a * c)
        x, z = a * s + v * c * tau, a * c - v * s * tau - 9.81 * tau**2 / 2
        return math.hypot(x, z)

    by_a = sum(w * height(1 + k * 1e-3) for k, w in STENCIL) / 1e-3
    assert abs(found["sensitivity.r.by.a"] - by_a) < 1e-9


def test_a_bouncing_ball_after_several_impacts(varied):
    """From rest at h with restitution e: impact n comes at sqrt(2 h/g) (1 + 2 (e + ... + e^(n-1))), with
    the impulse (1 + e) m v e^(n-1), v = sqrt(2 g h); between impacts dE = m g dh e^(2n)."""
    fmu = varied(
        "BouncingBall", "closing.floor.time:*", "closing.floor.impulse:*", "energy.total:y,e"
    )
    h, g, e, n = 1.0, 9.81, 0.7, 4
    found = run(fmu, 2.0, 4)[-1]
    assert found["closing.floor.count"] == n
    fall, v = math.sqrt(2 * h / g), math.sqrt(2 * g * h)
    powers = 1 + 2 * sum(e**k for k in range(1, n))
    slope = 2 * sum(k * e ** (k - 1) for k in range(1, n))
    times = {"e": fall * slope, "g": -fall * powers / 2 / g, "y": fall * powers / 2, "m": 0.0}
    blow = (1 + e) * v * e ** (n - 1)
    impulses = {
        "e": v * (e ** (n - 1) + (1 + e) * (n - 1) * e ** (n - 2)),
        "g": blow / 2 / g,
        "y": blow / 2,
        "m": blow,
    }
    for by in times:
        assert abs(found[f"sensitivity.closing.floor.time.by.{by}"] - times[by]) < 1e-10, by
        assert abs(found[f"sensitivity.closing.floor.impulse.by.{by}"] - impulses[by]) < 1e-9, by
    assert abs(found["sensitivity.energy.total.by.y"] - g * e ** (2 * n)) < 1e-9
    assert abs(found["sensitivity.energy.total.by.e"] - g * h * 2 * n * e ** (2 * n - 1)) < 1e-9


def test_a_ball_that_has_all_but_come_to_rest(built):
    """From rest h above a floor at z = b, restitution e: impact n comes after T = sqrt(2 h/g) (1 + 2 (e +
    ... + e^(n-1))), dT/db = -T/(2 h), with the impulse (1 + e) e^(n-1) m sqrt(2 g h).  At the 29th it falls
    with 1e-4 m/s, of which differences at heights of 1 m know four digits."""
    z = dynamicsymbols("z")
    b, e = symbols("b e", positive=True)
    model = point_mass(
        "Tired",
        "z",
        [Contact("floor", z - b, restitution=e)],
        up=z,
        gravity=2.0,
        parameters=[Parameter(b, 1.0, "m"), Parameter(e, 0.7, "1")],
        start={z: 2.0},
    )
    fmu = built(model, Scene("Tired", sensitivities=("closing.floor.*:e,b,z",)))
    for n in (10, 20, 29):
        time = 1 + 2 * sum(0.7**k for k in range(1, n))
        found = run(fmu, time + 0.7**n, 1)[-1]
        slope = 2 * sum(k * 0.7 ** (k - 1) for k in range(1, n))
        blow = 1.7 * 0.7 ** (n - 1)
        by_e = 2 * (0.7 ** (n - 1) + 1.7 * (n - 1) * 0.7 ** (n - 2))
        assert found["closing.floor.count"] == n
        for name, right in {"e": slope, "b": -time / 2, "z": time / 2}.items():
            assert found[f"sensitivity.closing.floor.time.by.{name}"] == pytest.approx(right, 1e-9)
        for name, right in {"e": by_e, "b": -blow, "z": blow}.items():
            mine = found[f"sensitivity.closing.floor.impulse.by.{name}"]
            assert mine == pytest.approx(right, 1e-7), (n, name)


def test_half_a_car_that_leaves_its_road(varied, built):
    """Two departures and two landings on a tabulated road: as central differences of tight runs, at the
    events and after them."""
    file, asked = scene_of("HalfCar")
    fmu = varied("HalfCar", "z:k,c", "lambda.*:k,c", "departure.*:k,c", "closing.*:k,c")
    plain = built(file.model, replace(asked, method="dop853"))
    outputs = [
        name.partition(".")[2].rpartition(".by.")[0]
        for name in fmpy_names(fmu)
        if name.startswith("sensitivity.") and name.endswith(".by.k")
    ]
    outputs = [name for name in outputs if "velocity" not in name]
    found = run(fmu, 1.5, 15)
    for by, at in (("k", 4e4), ("c", 3e3)):
        other = by_differences(plain, 1.5, 15, by, at, 1e-4 * at, outputs)
        for name in outputs:
            mine, size = found[f"sensitivity.{name}.by.{by}"], np.abs(other[name]).max()
            assert np.abs(mine - other[name]).max() <= 1e-7 * size + 1e-13, (name, by)


def fmpy_names(fmu: Path) -> list[str]:
    return [v.name for v in fmpy.read_model_description(fmu).modelVariables]


# ------------------------------------------------------------------------------- friction


def test_a_ball_thrown_without_spin(varied):
    """It rolls after T = 2 v0/(7 mu g), at (5/7) v0 and 12 v0^2/(49 mu g) on; from there x = 12 v0^2/(49
    mu g) + (5/7) v0 (t - T)."""
    fmu = varied("Bowling", "sticking.grip.time:der(x),mu,g,m,R", "x:der(x),mu", "der(x):der(x),mu")
    found = run(fmu, 3.0, 6)
    v0, mu, g = 8.0, 0.12, 9.81
    time = 2 * v0 / (7 * mu * g)
    last = found[-1]
    expected = {"velocity.x": time / v0, "mu": -time / mu, "g": -time / g, "m": 0.0, "R": 0.0}
    for by, value in expected.items():
        mine = last[f"sensitivity.sticking.grip.time.by.{by}"]
        assert abs(mine - value) < 1e-7 * max(abs(value), 1), by
    way = 12 * v0 / (49 * mu * g)  # of x, times v0; and (5/7) v0 T = 10 v0 way / 12
    by_speed = 2 * way + 5 / 7 * 3 - 2 * 10 / 12 * way
    by_friction = -way * v0 / mu + 10 / 12 * way * v0 / mu
    assert abs(last["sensitivity.x.by.velocity.x"] - by_speed) < 1e-7
    assert abs(last["sensitivity.x.by.mu"] - by_friction) < 1e-6
    assert abs(last["sensitivity.velocity.x.by.velocity.x"] - 5 / 7) < 1e-9
    assert abs(last["sensitivity.velocity.x.by.mu"]) < 1e-7


def test_a_block_that_sticks_and_slips_on_a_belt(varied):
    """With d = (mu_s - mu_k) m g/k and omega = sqrt(k/m) it slips for (2/omega)(pi - arctan(d omega/v))
    and sticks for 2 d/v, at first until the spring holds mu_s m g; and each of these times has its
    derivatives."""
    speed = symbols("speed", positive=True)
    x = dynamicsymbols("x")
    by = "speed,k,mu_s,mu_k,m"
    fmu = varied(
        "Belt",
        f"slipping.grip.time:{by}",
        f"sticking.grip.time:{by}",
        start={x: 0.0, x.diff(): speed},
    )
    found = run(fmu, 3.0, 12)
    at = {"speed": 0.2, "k": 100.0, "mu_s": 0.5, "mu_k": 0.3, "m": 1.0}

    def times(values: dict[str, float], count: int) -> tuple[float, float]:
        v, k, m = values["speed"], values["k"], values["m"]
        d = (values["mu_s"] - values["mu_k"]) * m * 9.81 / k
        omega = math.sqrt(k / m)
        slip = 2 / omega * (math.pi - math.atan(d * omega / v))
        first = values["mu_s"] * m * 9.81 / k / v
        begun = first + (count - 1) * (slip + 2 * d / v)
        return begun, begun + slip

    for row in found:
        count = row["slipping.grip.count"]
        if count == 0 or row["sticking.grip.count"] != count:
            continue
        for name, value in at.items():
            step = 1e-3 * value
            for k, event in enumerate(("slipping", "sticking")):
                expected = sum(
                    w * times({**at, name: value + j * step}, int(count))[k] for j, w in STENCIL
                )
                mine = row[f"sensitivity.{event}.grip.time.by.{name}"]
                assert abs(mine - expected / step) < 1e-6 * max(1, abs(mine)), (name, event)
    assert found["sensitivity.valid"].all()


# ------------------------------------------------------------------------------- where there is none


def test_a_start_that_another_radius_would_open(varied):
    """At r = a the particle rests on the sphere; where r is a plain number, a smaller sphere leaves it in
    the air."""
    r, theta = dynamicsymbols("r theta")
    fmu = varied("Hemisphere", "lambda.surface:a,g", start={r: 1.0, theta: 0.3})
    with instance(fmu) as one:
        one.start()
        assert not one.get("sensitivity.valid")
        one.step(0.1)
        assert one.get("sensitivity.lambda.surface.by.g") == 0
        told = [text for _, _, text in one.log if "sensitivity" in text]
    assert len(told) == 1
    assert "the start: with a little more or less of a" in told[0]


def thrown(slope: float) -> Model:
    """A ball that falls beside a wall at x = 1 onto a floor, both of which may be reached at one instant."""
    x, z = dynamicsymbols("x z")
    v, b = symbols("v b", positive=True)
    return point_mass(
        "Corner",
        "x z",
        [
            Contact("floor", z + slope * x, "on the floor", restitution=0.5),
            Contact("wall", b - x, "at the wall", restitution=0.5),
        ],
        up=z,
        gravity=2.0,
        parameters=[Parameter(v, 1.0, "m/s"), Parameter(b, 1.0, "m")],
        start={x: 0.0, z: b - slope * b, x.diff(): v},
    )


def test_two_contacts_that_are_met_at_one_instant(built):
    """A ball with x = v t and z = 1 - 0.2 b - t^2 meets the floor z + 0.2 x = 0 and the wall x = b at t =
    1 if v = 1; with a little more speed the wall comes first, and on a floor that leans that matters."""
    fmu = built(thrown(0.2), Scene("Corner", stop_time=2.0, sensitivities=("x:v",)))
    with instance(fmu) as one:
        one.start()
        for _ in range(15):
            one.step(0.1)
        assert one.get("closing.floor.count") == one.get("closing.wall.count") == 1
        assert not one.get("sensitivity.valid")
        assert one.get("sensitivity.x.by.v") == 0
        told = [text for _, _, text in one.log if "sensitivity" in text]
    assert len(told) == 1
    assert "contact 'floor', contact 'wall'" in told[0]
    assert "with another v they would not come at one instant" in told[0]
    assert run(fmu, 1.4, 2, {"v": 0.9})["sensitivity.valid"].all()  # there the floor comes first
    slower = run(fmu, 1.1, 11, {"v": 0.99})
    found = fit(fmu, {name: np.array(slower[name]) for name in ("time", "x")}, {"v": (0.97, 1.1)})
    assert abs(found.values["v"] - 0.99) < 1e-6
    assert any("derivatives of the FMU end within a run" in text for text in found.remarks())


def in_the_corner(v: complex, b: complex, until: float, slope: float = 0.2) -> list[complex]:
    """x, z, x', z' of the ball of thrown() from (0, 0.8): one parabola after another."""
    x, z, vx, vz, left = 0j, 0.8 + 0j, v, 0j, until + 0j
    for _ in range(4):
        half = (vz + slope * vx) / 2
        floor = half + (half**2 + z + slope * x) ** 0.5
        wall = (b - x) / vx if vx.real > 0 else 10.0 + 0j
        step = min(floor, wall, left, key=lambda t: t.real)
        x, z, vz, left = x + vx * step, z + vz * step - step**2, vz - 2 * step, left - step
        if step == wall:
            vx = -vx / 2
        elif step == floor:
            blow = 1.5 * (vz + slope * vx) / (1 + slope**2)
            vx, vz, z = vx - slope * blow, vz - blow, -slope * x
    assert left == 0
    return [x, z, vx, vz]


@pytest.mark.parametrize("later", [1e-2, 1e-5, 1e-8, -1e-5, -1e-8])
def test_two_contacts_that_are_met_one_right_after_the_other(built, later):
    """The ball meets the wall `later` seconds after the floor, or before it: its derivatives are those of the
    parabolas in that order (a complex step of theirs)."""
    model = thrown(0.2)
    model = replace(model, start={**model.start, dynamicsymbols("z"): 0.8})
    fmu = built(model, Scene("Corner", sensitivities=("x,z,der(x),der(z):v,b",)))
    at = {"v": 1.0, "b": 1.0 + later}
    found = run(fmu, 1.4, 2, {"b": at["b"]})[-1]
    assert found["sensitivity.valid"]
    for by, value in at.items():
        right = in_the_corner(**{**at, by: value + 1e-30j}, until=1.4)
        for name, number in zip(("x", "z", "velocity.x", "velocity.z"), right, strict=True):
            mine = found[f"sensitivity.{name}.by.{by}"]
            assert mine == pytest.approx(number.imag / 1e-30, abs=1e-9), (name, by)


def above_and_below(order: int, part: float) -> Model:
    """A ball falls on a floor at T, another comes up against a ceiling at T0 + part (T - T0), and T is T0."""
    y, z = dynamicsymbols("y z")
    g, w, c, T, T0 = symbols("g w c T T0", positive=True)
    then = part * T + (1 - part) * T0
    return point_mass(
        "AboveAndBelow",
        "y z",
        [
            Contact("floor", y, restitution=0.5),
            Contact("ceiling", c - z, restitution=0.5),
        ][::order],
        up=y + z,
        gravity=2.0,
        parameters=[
            Parameter(w, 2e-4, "m/s"),
            Parameter(c, 1.0, "m"),
            Parameter(T, 1.0, "s"),
            Parameter(T0, 1.0, "s"),
        ],
        start={y: g * T**2 / 2, z: c - w * then - g * then**2 / 2, z.diff(): w + g * then},
    )


@pytest.mark.parametrize("order", [1, -1])
def test_two_contacts_of_which_one_is_hardly_touched(built, order):
    """Two balls apart, one of which falls with 2 m/s on a floor at the instant, T, at which the other comes
    up against a ceiling with w = 2e-4 m/s: y = e g T tau - g tau^2/2, z = c - e w tau - g tau^2/2 at tau
    after it.  Where the second comes 1.05 dT later for dT, no derivative is told."""
    both = "y,z,closing.*.time,closing.*.impulse:T,w,g"
    alike, other = (
        built(above_and_below(order, part), Scene("AboveAndBelow", sensitivities=(both,)))
        for part in (1, 1.05)
    )
    found, tau = run(alike, 1.4, 2)[-1], 0.4
    assert found["sensitivity.valid"]
    expected = {"y.by.T": 3 * tau - 1, "y.by.w": 0.0, "y.by.g": (tau - tau**2) / 2}
    expected |= {"z.by.T": 1e-4 + 2 * tau, "z.by.w": -tau / 2, "z.by.g": -(tau**2) / 2}
    expected |= {f"closing.{name}.time.by.T": 1.0 for name in ("floor", "ceiling")}
    expected |= {f"closing.{name}.time.by.w": 0.0 for name in ("floor", "ceiling")}
    expected |= {"closing.floor.impulse.by.T": 3.0, "closing.floor.impulse.by.w": 0.0}
    expected |= {"closing.ceiling.impulse.by.T": 0.0, "closing.ceiling.impulse.by.w": 1.5}
    for name, value in expected.items():
        assert found[f"sensitivity.{name}"] == pytest.approx(value, abs=1e-6), name
    assert not run(other, 1.4, 2)["sensitivity.valid"][-1]


def test_a_contact_that_is_only_touched(built):
    """A ball thrown up from z = h - b with the speed that takes it to h + 1 touches a ceiling at z = b = 1
    m with the speed s = 2 sqrt(h), h = 1e-8 m, g = 2 m/s^2: to a tolerance of 1e-8 it may not touch it
    at all. To one of 1e-13 it does, dt_e/db = 2/s, ds/db = -4/s, and z = b - e s tau - tau^2 at tau
    after it goes with them."""
    z = dynamicsymbols("z")
    b, h = symbols("b h", positive=True)
    model = point_mass(
        "Touch",
        "z",
        [Contact("ceiling", b - z, "below the ceiling", restitution=0.5)],
        up=z,
        gravity=2.0,
        parameters=[Parameter(b, 1.0, "m"), Parameter(h, 1e-8, "m")],
        start={z: h - b, z.diff(): math.sqrt(8)},
    )
    fmu = built(model, Scene("Touch", stop_time=2.0, sensitivities=("z:b",)))
    found = run(fmu, 2.0, 10, tolerance=1e-8)
    assert found["closing.ceiling.count"][-1] == 1
    assert found["sensitivity.valid"][0]
    assert not found["sensitivity.valid"][-1]
    fine = run(fmu, 2.0, 10, tolerance=1e-13)[-1]
    s, tau = 2 * math.sqrt(1e-8), 2.0 - fine["closing.ceiling.time"]
    assert fine["sensitivity.valid"]
    assert abs(fine["sensitivity.z.by.b"] / (1 + 2 * tau / s + 1 + 4 * tau / s) - 1) < 1e-5


# ------------------------------------------------------------------------------- the FMU


def test_a_restored_state_repeats_them_bit_for_bit(varied):
    """Columns, and what is known of events, belong to the saved state."""
    fmu = varied("Hemisphere", "*:a,theta")
    with instance(fmu) as one:
        one.start({"theta": 0.3})
        one.step(0.4)
        assert one.repeated(0.1, 5)["sensitivity.departure.surface.time.by.a"] != 0


def test_error_bars_stand_beside_them(varied):
    """A scene may ask for both: the finer run takes no derivatives, and the delivered run is the same."""
    alone = varied("Hemisphere", "lambda.surface:a")
    both = varied("Hemisphere", "lambda.surface:a", error_bars=True)
    one, other = (run(fmu, 1.0, 10, {"theta": 0.3}, 1e-8) for fmu in (alone, both))
    for name in one.dtype.names:
        assert one[name].tobytes() == other[name].tobytes(), name
    assert (other["error.lambda.surface"] > 0).any()


def test_names_units_and_descriptions(varied):
    """sensitivity.OUTPUT.by.PARAMETER, in the unit of the one over that of the other."""
    fmu = varied(
        "Hemisphere",
        "departure.surface.time:theta,a",
        "der(theta,2):m",
        "lambda.surface:der(theta)",
    )
    described = {v.name: v for v in fmpy.read_model_description(fmu).modelVariables}
    found = {name: v.unit for name, v in described.items() if name.startswith("sensitivity.")}
    assert found == {
        "sensitivity.departure.surface.time.by.a": "s/m",
        "sensitivity.departure.surface.time.by.theta": "s/rad",
        "sensitivity.acceleration.theta.by.m": "rad/(kg.s2)",
        "sensitivity.lambda.surface.by.velocity.theta": "N.s/rad",
        "sensitivity.valid": None,
    }
    text = described["sensitivity.departure.surface.time.by.theta"].description
    assert text.startswith("derivative of departure.surface.time by the start of theta")


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ("lambda.surfac:a", "'lambda.surfac' is unknown; did you mean 'lambda.surface'"),
        ("lambda.surface:b", "parameter or start value 'b' is unknown; did you mean"),
        ("lambda.surface", "expected OUTPUT:PARAMETER,..."),
        ("departure.surface.count:a", "'departure.surface.count' is not differentiated"),
    ],
)
def test_what_is_not_there_is_named(asked, said):
    """Names that mean nothing are told with those that are near."""
    with pytest.raises(RequestError, match=r"(?s).*") as error:
        prepare(model_file("hemisphere").model, Scene("Bad", sensitivities=(asked,)))
    assert said in str(error.value)


def test_a_number_that_is_fixed_has_no_derivative():
    """What the scene makes a number in the code cannot be another."""
    with pytest.raises(RequestError, match="'a', which the scene fixes"):
        prepare(model_file("hemisphere").model, Scene("Bad", fixed=("a",), sensitivities=("r:a",)))


def test_methods_whose_steps_are_not_differentiated():
    """rattle is refused by name; auto is dop853, and radau is there where it is asked for."""
    with pytest.raises(RequestError, match="sensitivities with the method 'rattle'"):
        Scene("Bad", method="rattle", sensitivities=("r:a",))
    stiff = Scene("Stiff", method="radau", sensitivities=("r:a",))
    assert stiff.selectable == ("dop853", "rk4", "radau")
    assert Scene("Good", sensitivities=("r:a",)).method == "dop853"


def test_the_python_target_refuses_them(built):
    """It takes no derivatives of a run, and says so when it is built."""
    with pytest.raises(BuildError, match="it has no derivatives of a run"):
        built(
            model_file("hemisphere").model,
            Scene("Hemisphere", sensitivities=("r:a",)),
            target="python",
        )


def test_they_are_asked_for_on_the_command_line(tmp_path):
    """lagfmu build --sensitivities OUTPUT:PARAMETER,..., repeatable."""
    model = Path(__file__).parent.parent / "models" / "hemisphere.py"
    asked = ["--sensitivities", "departure.surface.time:theta,a", "--sensitivities", "r:a"]
    done = CliRunner().invoke(
        app, ["build", str(model), "--out", str(tmp_path), "--no-check", *asked]
    )
    assert done.exit_code == 0, done.output
    names = fmpy_names(tmp_path / "native" / "Hemisphere.fmu")
    assert {n for n in names if ".by." in n} == {
        "sensitivity.departure.surface.time.by.a",
        "sensitivity.departure.surface.time.by.theta",
        "sensitivity.r.by.a",
    }


@pytest.mark.parametrize("name", ["PendulumCartesian", "Hemisphere", "BouncingBall"])
@pytest.mark.parametrize("g", [2.2e-308, 1e-310, 5e-324])
def test_where_hardly_anything_pulls_derivatives_are_numbers(
    varied: Varied, name: str, g: float, tmp_path: Path
) -> None:
    """g t^2 / 2 for 1e154 s moves a body by 1 m, and its derivative by g is beyond a double: the solver, that
    steps ahead so far, tells that it ended, all outputs are finite, and its state can be taken back."""
    path = varied(name, "*:g")
    library = fmi2.Library(path, tmp_path)
    one = library().start({"g": g})
    for _ in range(3):
        one.step(0.1)
        assert np.isfinite(one.outputs()).all()
        saved = one.bytes_of(one.saved())
        other = library().start()
        other.does("SetFMUstate", other.loaded(saved))
        assert other.outputs() == one.outputs()
