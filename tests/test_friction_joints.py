"""The friction of joints, whose normal force is a norm of multipliers of the same instant: a pin, a guide, a
sleeve, and a slider-crank with all joints rubbing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import model_file
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve
from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass

from lagfmu import (
    Contact,
    Friction,
    Holonomic,
    Model,
    Nonholonomic,
    Parameter,
    Result,
    multiplier,
    norm,
    simulate,
)
from lagfmu.bodies import Body, Force, Gravity, Prismatic, Revolute, mechanism
from lagfmu.bodies import Ground as Base
from lagfmu.errors import LagfmuError, ModelError, SimulationError
from lagfmu.testing import StartMovedWarning, find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
MODELS = Path(__file__).parent.parent / "models"
Build = Callable[..., Path]
g = 9.81  # m/s^2
x, y, z, theta, phi = dynamicsymbols("x y z theta phi")
m, G, L, J, r, b, h, P = symbols("m g L J r b h P", positive=True)
mu, mu_s, mu_k = symbols("mu mu_s mu_k", positive=True)


def pendulum(normal: Any, static: Any, kinetic: Any = None, *more: Any) -> Model:
    """A compound pendulum, its pin as two rows: 1 kg, 0.5 m below the pin, 0.05 kg m^2 about its centre."""
    return point_mass(
        "Pin",
        "x y",
        [
            Holonomic("A.x", x - L * sin(theta)),
            Holonomic("A.y", y + L * cos(theta)),
            Nonholonomic("turn", theta.diff()),
            *more,
            Friction("bearing", of=["turn"], normal=normal, static=static, kinetic=kinetic),
        ],
        angles="theta",
        energy=J * theta.diff() ** 2 / 2 - m * G * y,
        parameters=[
            Parameter(G, g, "m/s^2"),
            Parameter(L, 0.5, "m"),
            Parameter(J, 0.05, "kg.m^2"),
            Parameter(r, 0.02, "m"),
            Parameter(mu_s, 0.3, "1"),
            Parameter(mu_k, 0.3, "1"),
        ],
        start={theta: 1.0},
    )


PIN = norm(multiplier("A.x"), multiplier("A.y"))


@pytest.fixture(scope="module")
def pin(built: Build) -> Path:
    return built(pendulum(PIN, mu_s * r, mu_k * r))


def swings(angle: float, limit: float, arm: float) -> list[float]:
    """The angles at which each swing from rest ends [rad], the last of which it keeps.

    With J0 = J + m L^2 the pin's force is (m L (alpha cos theta - omega^2 sin theta),
    m g + m L (alpha sin theta + omega^2 cos theta)), alpha = (-m g L sin theta + tau)/J0, so that
    N = |n0 + n1 tau| with n1 = m L (cos theta, sin theta)/J0, and |tau| = arm N is a quadratic: with
    w = sgn(tau),  (1 - arm^2 n1^2) N^2 - 2 w arm n0.n1 N - n0^2 = 0,  of which one root is positive.
    At rest N = m g, and it stays where L |sin theta| <= limit.
    """
    m, L, J0 = 1.0, 0.5, 0.05 + 0.25
    found = [angle]
    while L * abs(np.sin(angle)) > limit:
        way = -np.sign(angle)  # of omega

        def rates(_: float, state: Any, way: float = way) -> list[float]:
            theta, omega = state
            along = m * L / J0 * np.array([np.cos(theta), np.sin(theta)])
            free = np.array([-m * L * omega**2 * np.sin(theta), m * L * omega**2 * np.cos(theta)])
            free += [0.0, m * g] - along * m * g * L * np.sin(theta)
            a, half = 1 - (arm * along) @ (arm * along), way * arm * free @ along
            N = (np.sqrt(half**2 + a * (free @ free)) - half) / a
            return [omega, (-m * g * L * np.sin(theta) - way * arm * N) / J0]

        def stops(_: float, state: Any, way: float = way) -> float:
            return float(way * state[1])

        stops.terminal, stops.direction = True, -1.0  # type: ignore[attr-defined]
        run = solve_ivp(
            rates, (0, 3), [angle, way * 1e-300], "DOP853", events=stops, rtol=1e-13, atol=1e-15
        )
        angle = float(run.y_events[0][-1][0])
        found.append(angle)
    return found


def test_a_pendulum_in_a_rubbing_pin_stops_where_an_integration_of_its_own_does(pin: Path) -> None:
    """tau = -mu r N sgn(omega), N = |n0 + n1 tau| of the same instant, from 1 rad until
    L |sin theta| <= mu r: the ends of all swings and the angle at which it stays."""
    ends = swings(1.0, 0.3 * 0.02, 0.3 * 0.02)
    assert len(ends) > 25
    run = simulate(pin, stop_time=50.0, step_size=0.01, tolerance=1e-13)
    assert run["sticks.bearing"][-1]
    assert run["theta"][-1] == pytest.approx(ends[-1], abs=1e-9)
    highest = [max(abs(a), abs(b)) for a, b in pairwise(ends)][1:]
    omega, theta = run["der(theta)"], np.abs(run["theta"])
    turned = [k for k in range(1, len(omega)) if omega[k - 1] * omega[k] < 0]
    found = [float(max(theta[k - 1 : k + 1])) for k in turned]
    assert found[: len(highest) - 1] == pytest.approx(highest[:-1], abs=2e-4)  # sampled
    assert run["energy.total"] + run["energy.dissipated"] == pytest.approx(
        run["energy.total"][0], abs=1e-11
    )


@pytest.mark.parametrize(("part", "sticks"), [(0.999, True), (1.001, False)])
def test_a_pin_holds_up_to_its_static_coefficient(pin: Path, part: float, sticks: bool) -> None:
    """At rest tau = m g L sin(theta) and N = m g: it sticks while sin(theta) <= mu_s r/L; the margin is
    mu_s r N - |tau| [N.m]."""
    start = float(np.arcsin(part * 0.5 * 0.02 / 0.5))
    run = simulate(pin, start_values={"theta": start, "mu_s": 0.5}, stop_time=0.2, step_size=0.1)
    assert run["sticks.bearing"].all() == sticks
    assert (run["theta"][-1] == start) == sticks
    if sticks:
        assert run["margin.bearing"][0] == pytest.approx(0.01 * g * (1 - part), rel=1e-9)
        assert run["lambda.turn"][0] == pytest.approx(g * 0.5 * np.sin(start), rel=1e-12)


@pytest.mark.parametrize("friction", [0.3, 20.0, 29.0])
def test_the_torque_is_that_of_the_normal_force_of_its_own_instant(
    pin: Path, friction: float
) -> None:
    """|tau| = mu r |lambda| to rounding, also where mu r |lambda1| = mu r m L/(J + m L^2) is 0.97; slip is an
    angular velocity, and the power tau omega."""
    start = {"der(theta)": 4.0, "theta": 0.0, "mu_s": friction, "mu_k": friction}
    run = simulate(pin, start_values=start, stop_time=0.02, step_size=0.001)
    N = np.hypot(run["lambda.A.x"], run["lambda.A.y"])
    slides = ~run["sticks.bearing"].astype(bool)
    assert slides[0]
    assert run["lambda.turn"][slides] == pytest.approx(-friction * 0.02 * N[slides], rel=1e-12)
    assert run["slip.turn"] == pytest.approx(run["der(theta)"], abs=1e-15)
    assert run["power.bearing"] == pytest.approx(
        (run["lambda.turn"] * run["der(theta)"]) * slides, rel=1e-13
    )


def test_a_pin_that_would_load_itself_is_refused_by_name(pin: Path) -> None:
    """mu r |lambda1| = 31 * 0.02 * 0.5/0.3 = 1.033 > 1: |tau| = mu r |lambda0 + lambda1 tau| has no root of
    the right sign, or two."""
    start = {"der(theta)": 4.0, "mu_s": 31.0, "mu_k": 31.0}
    with pytest.raises(
        SimulationError, match=r"'bearing': sliding has no acceleration, or several.*1\.03"
    ):
        simulate(pin, start_values=start, stop_time=0.02, step_size=0.001)


def test_the_radius_stands_in_the_coefficient_or_in_the_normal_force(
    pin: Path, built: Build
) -> None:
    """mu r times N, or mu times r N: the same torque."""
    other = simulate(built(pendulum(r * PIN, mu_s, mu_k)), stop_time=0.5, step_size=0.1)
    run = simulate(pin, stop_time=0.5, step_size=0.1)
    assert other["lambda.turn"] == pytest.approx(run["lambda.turn"], rel=1e-12)


REFUSED = {
    "no radius": (
        PIN,
        mu_s,
        (),
        r"static of friction 'bearing'.*expected m.*takes the radius with it",
    ),
    "a torque as normal force and a radius": (r * PIN, mu_s * r, (), "static.*expected 1"),
    "an area": (r**2 * PIN, mu_s, (), "normal of friction 'bearing'.*expected N"),
    "a product": (
        multiplier("A.x") * multiplier("A.y") / (m * G),
        mu_s * r,
        (),
        r"neither linear in the multipliers nor a sum of norms.*norm\(multiplier",
    ),
    "a contact": (
        norm(multiplier("A.x"), multiplier("wall")),
        mu_s * r,
        (Contact("wall", x + 1),),
        "is a norm with the contact 'wall'",
    ),
}


@pytest.mark.parametrize("case", sorted(REFUSED))
def test_what_is_no_friction_of_a_joint_is_refused_with_the_remedy(case: str) -> None:
    """A torque is limited by a force times a length; a normal force is linear, or a sum of norms."""
    normal, static, more, words = REFUSED[case]
    with pytest.raises(ModelError, match=words):
        pendulum(normal, static, None, *more)


def test_a_norm_of_shared_multipliers_is_refused_by_name(tmp_path: Path) -> None:
    """Two pins on one axis share the force as one likes: the motion would follow the least norm."""
    twice = (Holonomic("B.x", x - L * sin(theta)), Holonomic("B.y", y + L * cos(theta)))
    with (
        pytest.warns(UserWarning, match="follow from the others"),
        pytest.raises(
            LagfmuError, match=r"'bearing'.*not unique.*leave out what is redundant \(B.x, B.y\)"
        ),
    ):
        simulate(pendulum(PIN, mu_s * r, None, *twice), stop_time=0.1, step_size=0.1)


def test_hinges_that_share_their_forces_do_not_rub() -> None:
    """How a door's two hinges share what is across them is not determined: refused, with the remedy."""
    door = Body("door", mass=20.0, inertia=(1.0, 1.5, 0.6))
    pin = {"friction": 0.1, "radius": 0.01}
    hinges = [
        Revolute(name, Base().at((0, 0, z)), door.at((-0.4, 0, z)), **pin)
        for name, z in (("top", 1), ("low", -1))
    ]
    told = r"'top', 'low'.*not unique.*leave out what is redundant.*or make a hinge Spherical"
    with pytest.warns(UserWarning, match="follow"), pytest.raises(LagfmuError, match=told):
        simulate(mechanism("Door", bodies=[door], joints=hinges), stop_time=0.1)


def test_a_guide_rubs_by_the_norm_of_its_two_radial_forces(built: Build) -> None:
    """A block thrown up a guide at alpha = 0.5, pressed sideways by P: N = sqrt((m g cos alpha)^2 + P^2); it
    stops after v0/(g sin alpha + mu N/m), slides back by a = g sin alpha - mu N/m, or stays."""
    alpha, m_, P_ = 0.5, 2.0, 7.0
    model = point_mass(
        "Guide",
        "x y z",
        [
            Holonomic("D.y", y),
            Holonomic("D.z", z),
            Nonholonomic("slide", x.diff()),
            Friction("guide", ["slide"], norm(multiplier("D.y"), multiplier("D.z")), mu),
        ],
        energy=-m * G * (x * np.sin(alpha) + y * np.cos(alpha)),
        mass=m_,
        parameters=[Parameter(G, g, "m/s^2"), Parameter(P, P_, "N"), Parameter(mu, 0.3, "1")],
        forces={z: P},
        start={x.diff(): 3.0},
    )
    N = np.hypot(m_ * g * np.cos(alpha), P_)
    for friction in (0.3, 0.6):
        up, down = (g * np.sin(alpha) + s * friction * N / m_ for s in (1, -1))
        run = simulate(built(model), start_values={"mu": friction}, stop_time=2.0, step_size=0.1)
        t = run["time"]
        back = np.where(t > 3 / up, max(down, 0.0) * (t - 3 / up) ** 2 / 2, 0)
        rising = np.minimum(t, 3 / up)
        assert run["x"] == pytest.approx(3 * rising - up * rising**2 / 2 - back, abs=1e-10)
        assert run["sticks.guide"][-1] == (down < 0)
        assert run["sticking.guide.count"][-1] == (down < 0)


def test_a_drawer_jams_by_the_norms_at_both_edges(built: Build) -> None:
    """A drawer of length b in its guide, pulled by P at h from the centre line: the edges bear P h/b each,
    the friction is 2 mu P h/b, and it comes with a = P (1 - 2 mu h/b)/m, or jams where 2 mu h >= b."""
    edges = [multiplier("D.y") / 2 + s * multiplier("D.phi") / b for s in (1, -1)]
    model = point_mass(
        "Drawer",
        "x y",
        [
            Holonomic("D.y", y),
            Holonomic("D.phi", phi),
            Nonholonomic("slide", x.diff()),
            Friction("guide", ["slide"], norm(edges[0]) + norm(edges[1]), mu),
        ],
        angles="phi",
        energy=J * phi.diff() ** 2 / 2,
        mass=2.0,
        parameters=[
            Parameter(J, 0.1, "kg.m^2"),
            Parameter(P, 10.0, "N"),
            Parameter(h, 0.3, "m"),
            Parameter(b, 0.4, "m"),
            Parameter(mu, 0.5, "1"),
        ],
        forces={x: P, phi: -P * h},
    )
    run = simulate(built(model), stop_time=1.0, step_size=0.5)
    assert run["x"][-1] == pytest.approx(10.0 * (1 - 2 * 0.5 * 0.3 / 0.4) / 2.0 / 2, rel=1e-12)
    run = simulate(built(model), start_values={"mu": 0.67}, stop_time=1.0, step_size=0.5)
    assert run["sticks.guide"].all()
    assert run["x"][-1] == 0


def test_a_sleeve_rubs_against_its_slip_vector(built: Build) -> None:
    """A tube of radius r slides and turns on a rod: lambda = -mu N (v, r omega)/|(v, r omega)|.  With
    J = m r^2 both decay alike, (v, r omega) by mu N/m along itself, and stop at |s|/(mu N/m)."""
    model = point_mass(
        "Sleeve",
        "x y z",
        [
            Holonomic("C.y", y),
            Holonomic("C.z", z),
            Nonholonomic("slide", x.diff()),
            Nonholonomic("turn", r * phi.diff()),
            Friction("sleeve", ["slide", "turn"], norm(multiplier("C.y"), multiplier("C.z")), mu),
        ],
        angles="phi",
        energy=m * r**2 * phi.diff() ** 2 / 2 - m * G * z,
        mass=1.5,
        parameters=[
            Parameter(r, 0.05, "m"),
            Parameter(G, g, "m/s^2"),
            Parameter(P, 5.0, "N"),
            Parameter(mu, 0.2, "1"),
        ],
        forces={y: P},
        start={x.diff(): 0.3, phi.diff(): 8.0},
    )
    run = simulate(built(model), stop_time=0.4, step_size=0.01)
    a = 0.2 * np.hypot(1.5 * g, 5.0) / 1.5
    left = np.maximum(0.5 - a * run["time"], 0)
    assert run["slip.slide"] == pytest.approx(0.6 * left, abs=1e-9)
    assert run["slip.turn"] == pytest.approx(0.8 * left, abs=1e-9)
    assert run["sticking.sleeve.time"][-1] == pytest.approx(0.5 / a, rel=1e-9)


# ------------------------------------------------------------------ several joints


@pytest.fixture(scope="module")
def crank(native_fmu: Callable[[str], Path]) -> Path:
    return native_fmu("CrankWithBearingFriction")


JOINTS = {"A": "A.turn", "B": "B.turn", "C": "C.turn"}


def norms(run: Result) -> dict[str, Any]:
    return {j: np.hypot(run[f"lambda.{j}.x"], run[f"lambda.{j}.y"]) for j in JOINTS}


def test_each_joint_of_a_slider_crank_rubs_by_its_own_force(crank: Path) -> None:
    """tau_i = -mu r N_i sgn(omega_i) and F = -mu |N_D| sgn(v) with all N of the same instant, to rounding.
    The rod begins at rest, where omega_C is rounding: sgn is that of its acceleration."""
    run = simulate(crank, stop_time=0.5, step_size=0.01, tolerance=1e-9)
    for joint, N in norms(run).items():
        way = np.sign(run[f"slip.{JOINTS[joint]}"])
        if joint == "C":
            way[0] = -np.sign(run["der(phi2,2)"][0])
        torque = -0.1 * 0.01 * N * way
        assert run[f"lambda.{JOINTS[joint]}"] == pytest.approx(torque, rel=1e-11)
    assert run["lambda.D.slide"] == pytest.approx(
        -0.1 * np.abs(run["lambda.D.y"]) * np.sign(run["slip.D.slide"]), rel=1e-11
    )


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize(("rod", "sets_off"), [(0.0, 1.0), (np.pi, -1.0)])
def test_at_a_dead_centre_the_guide_rubs_against_the_way_that_the_slider_takes(
    crank: Path, rod: float, sets_off: float, way: float
) -> None:
    """At the dead centre the slip is 0, or 5e-16 m/s of either sign by rounding: the guide's friction at the
    start is the limit of what follows, against the acceleration, whichever way the crank turns."""
    with pytest.warns(StartMovedWarning):
        run = simulate(
            crank, start_values={"phi2": rod, "der(phi1)": 20 * way}, stop_time=1e-6, step_size=1e-7
        )
    assert abs(run["slip.D.slide"][0]) < 1e-14
    assert np.sign(run["der(x3,2)"]) == pytest.approx(sets_off)
    assert run["lambda.D.slide"] == pytest.approx(
        -sets_off * 0.1 * np.abs(run["lambda.D.y"]), rel=1e-12
    )


@pytest.mark.parametrize("tolerance", [1e-6, 1e-10])
def test_the_powers_of_all_joints_balance(crank: Path, tolerance: float) -> None:
    """energy.total + energy.dissipated is constant, to the tolerance of the energy."""
    run = simulate(crank, stop_time=1.0, step_size=0.01, tolerance=tolerance)
    balance = run["energy.total"] + run["energy.dissipated"]
    assert run["energy.dissipated"][-1] > 3
    assert np.ptp(balance) < 100 * tolerance * np.abs(run["energy.total"]).max()


@pytest.mark.parametrize("order", [(3, 2, 1, 0), (1, 3, 0, 2)])
def test_the_order_of_the_joints_changes_nothing(
    crank: Path, built: Build, order: Sequence[int]
) -> None:
    """Frictions and constraints declared in another order: the same motion and the same forces."""
    model = model_file("crank_with_bearing_friction").model
    frictions = [model.frictions[k] for k in order]
    other = Model(
        **{
            name: getattr(model, name)
            for name in ("name", "coordinates", "lagrangian", "parameters", "start")
        },
        constraints=[*reversed(model.constraints), *frictions],
    )
    runs = [
        simulate(fmu, stop_time=0.5, step_size=0.05, tolerance=1e-10)
        for fmu in (crank, built(other))
    ]
    for name in ("phi1", "lambda.A.x", "lambda.C.y", "lambda.D.slide", "energy.dissipated"):
        size = np.abs(runs[0][name]).max()
        assert runs[1][name] == pytest.approx(runs[0][name], abs=1e-8 * size)


def pushed(order: Sequence[int] = (0, 1, 2, 3)) -> Model:
    """The slider-crank at rest, under the torque `torque` + 0.5 N.m/s t, its static coefficients 0.6."""
    model = model_file("crank_with_bearing_friction").model
    torque = symbols("torque")
    phi1 = next(q for q in model.coordinates if str(q.func) == "phi1")
    frictions = [model.frictions[k] for k in order]
    return replace(
        model,
        forces={phi1: torque + symbols("rate") * dynamicsymbols._t},
        parameters=[
            *model.parameters,
            Parameter(torque, 0.5, "N.m"),
            Parameter(symbols("rate"), 0.5, "N.m/s"),
        ],
        start={s: e for s, e in model.start.items() if s != phi1.diff()},
        frictions=[replace(f, static=6 * f.static, kinetic=3 * f.static) for f in frictions],
    )


def breakaway(phi1: float, way: float) -> float:
    """The torque [N.m] at which the crank at rest begins to turn (`way` = 1: forward): the nine equations of
    equilibrium for eight forces and the torque, all four joints at their static limits."""
    a, b, r, mu, (m1, m2, m3) = 0.1, 0.3, 0.01, 0.6, (2.0, 1.0, 0.5)
    phi2 = -np.arcsin(a / b * np.sin(phi1))
    s1, c1, s2, c2 = np.sin(phi1), np.cos(phi1), np.sin(phi2), np.cos(phi2)
    omega1 = way
    omega2 = -a / b * c1 / c2 * omega1
    speed = -a * s1 * omega1 - b * s2 * omega2

    def unbalanced(forces: Any) -> list[float]:
        ax, ay, bx, by, cx, cy, d, moment, torque = forces
        tau_a = -mu * r * np.hypot(ax, ay) * np.sign(omega1)
        tau_b = -mu * r * np.hypot(bx, by) * np.sign(omega2 - omega1)
        tau_c = -mu * r * np.hypot(cx, cy) * np.sign(-omega2)
        return [
            ax + bx,
            ay + by - m1 * g,
            a / 2 * (s1 * (ax - bx) - c1 * (ay - by)) + torque + tau_a - tau_b,
            cx - bx,
            cy - by - m2 * g,
            b / 2 * (c2 * (by + cy) - s2 * (bx + cx)) + tau_b - tau_c,
            -cx - mu * abs(d) * np.sign(speed),
            d - cy - m3 * g,
            moment + tau_c,
        ]

    found, _, status, words = fsolve(
        unbalanced, [0, 30, 0, -10, 0, 5, 10, 0, 0.5], xtol=1e-14, full_output=True
    )
    assert status == 1, words
    return float(found[-1])


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_mechanism_at_rest_sets_out_when_no_joint_holds_it(built: Build, way: float) -> None:
    """All joints stick until all stand at their static limits at once, in the direction of the motion:
    statics gives the torque, whatever of it each joint bears before."""
    values = {"phi1": 1.0, "torque": 0.5, "rate": way}
    with pytest.warns(StartMovedWarning):
        run = simulate(built(pushed()), start_values=values, stop_time=2.0, step_size=0.05)
    sets_out = run["slipping.A.time"][-1]
    assert 0.5 + way * sets_out == pytest.approx(breakaway(1.0, way), rel=1e-8)
    stands = run["time"] < sets_out
    assert 2 < np.count_nonzero(stands) < len(stands)
    for joint in "ABCD":
        assert run[f"sticks.{joint}"][stands].all()
        assert run[f"slipping.{joint}.count"][-1] >= 1
        assert (run[f"margin.{joint}"][stands] > -1e-9).all()
    assert np.abs(run["der(phi1)"][stands]).max() < 1e-14


def test_a_crank_runs_down_and_stands_on_all_joints(crank: Path, built: Build) -> None:
    """When the crank stops, its four joints do at one instant, and hold it with forces inside their cones."""
    run = simulate(crank, start_values={"mu": 0.3, "der(phi1)": 5.0}, stop_time=4.0, step_size=0.05)
    for joint in "ABCD":
        assert run[f"sticks.{joint}"][-1]
        assert run[f"sticking.{joint}.time"][-1] == run["sticking.A.time"][-1]
        assert run[f"margin.{joint}"][-1] > -1e-12
    assert run["der(phi1)"][-1] == pytest.approx(0, abs=1e-14)


def test_joints_that_would_load_each_other_are_refused_by_name(crank: Path) -> None:
    """With bearings as large as the crank no bound shows that the friction of one, by way of the others, does
    not load itself: nothing is resolved by luck."""
    with pytest.raises(
        SimulationError, match=r"'A', 'B', 'C'.*cannot be shown unique.*spectral radius"
    ):
        simulate(crank, start_values={"r": 0.1, "mu": 1.0}, stop_time=0.1, step_size=0.01)


@pytest.mark.parametrize(("arm", "share"), [(0.15, 0.4), (0.3, 0.0)])
def test_a_drawer_jams_where_it_is_pushed_too_far_from_its_guide(arm: float, share: float) -> None:
    """A sleeve of length b on a rod is pushed by P at a distance h: each edge carries P h/b, so that
    m a = P (1 - 2 mu h/b); from h = b/(2 mu) on no push moves it."""
    sleeve = Body("sleeve", mass=2.0, inertia=0.01)
    guide = Prismatic("D", Base().at((0, 0)), sleeve.at((0, 0)), axis="x", friction=0.2, length=0.1)
    push = Force("push", sleeve.at((0, arm)), (6.0, 0))
    model = mechanism("Drawer", plane="xy", bodies=[sleeve], joints=[guide], loads=[push])
    run = simulate(model, 1.0, 0.5, 1e-10)
    assert run["position.D"][-1] == pytest.approx(3.0 * share / 2, rel=1e-9, abs=1e-15)
    assert run["sticks.D"][-1] == (share == 0)
    assert run["power.D"][-1] == pytest.approx(
        -6.0 * (1 - share) * 3.0 * share, rel=1e-9, abs=1e-15
    )


def test_an_overhung_wheel_is_braked_by_the_edges_of_its_bearing_and_by_its_shoulder() -> None:
    """The weight of a wheel, 12 N across its axis and 16 N along it, hangs c = 3 b beside the middle of a
    bearing: its edges carry 3.5 and 2.5 times 12 N, its shoulder 16 N; J w' = -mu r (the sum of them)."""
    wheel = Body("wheel", mass=2.0, inertia=(0.01, 0.01, 0.02))
    pin = {"friction": 0.2, "radius": 0.01, "length": 0.1}
    joint = Revolute("A", Base().at((0, 0, 0)), wheel.at((0, 0, -0.3)), **pin)
    weight, start = [Gravity((3.6, -4.8, -8.0))], {"der(angle.A)": 5.0}
    model = mechanism("Wheel", bodies=[wheel], joints=[joint], loads=weight, start=start)
    run = simulate(model, 0.2, 0.1, 1e-10)
    slowing = 0.2 * 0.01 * (6.0 * 12.0 + 16.0) / 0.02
    assert run["der(angle.A)"] == pytest.approx(5.0 - slowing * run["time"], rel=1e-10)


def test_a_slide_that_rebounds_at_its_stop_sticks_there_in_the_end() -> None:
    """A block slides down a rough incline of 0.8 rad onto a stop with e = 0.5: its rebounds follow each other
    ever faster, T = e T, until it rests; the end of its last slide counts.  Guide and stop bear its weight
    together, m g sin 0.8 [N]."""
    ground, block = Base(), Body("block", 1.0, 0.01)
    first, second = (on.at((0, 0), rotation=0.8) for on in (ground, block))
    slide = Prismatic("K", first, second, friction=0.2, limits=(-0.2, 0.2), restitution=0.5)
    model = mechanism(
        "Stopped",
        plane="xy",
        bodies=[block],
        joints=[slide],
        loads=[Gravity((0, -9.81))],
        start={"position.K": 0.1},
    )
    end = simulate(model, 2.0, 0.5)[-1]
    assert end["closing.K.lower.count"] > 5
    assert [end["sticks.K"], end["sticking.K.count"]] == [1, 1]
    assert end["force.K.x"] == pytest.approx(9.81 * np.sin(0.8), rel=1e-9)


def test_a_length_without_a_moment_to_take_is_refused() -> None:
    """In the plane a pin takes no moment; without friction no bearing is asked for."""
    crank = Body("crank", mass=1.0, inertia=0.1)
    places = Base().at((0, 0)), crank.at((0.1, 0))
    for told, given in (
        ("takes no moment", {"friction": 0.2, "radius": 0.01, "length": 0.1}),
        ("no friction: give friction", {"length": 0.1}),
    ):
        with pytest.raises(ModelError, match=told):
            mechanism("Pin", plane="xy", bodies=[crank], joints=[Revolute("A", *places, **given)])
