"""An importer gives the start by joint coordinates, angle.A and der(angle.A), and the rest follows."""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Callable
from ctypes import c_double, c_size_t
from math import acos, asin, cos, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu
from instance import instance
from runs import evenly, simulate_fmu, sources
from sympy import Symbol
from zoo.linkages import SET_OUT, cart_arm, hinged

from lagfmu import Model, Parameter, Scene, fit, sensitivity, sweep, verify
from lagfmu.bodies import (
    Body,
    Cylindrical,
    Gravity,
    Ground,
    Motor,
    Prismatic,
    Revolute,
    mechanism,
)
from lagfmu.testing import load

R, L = 0.2, 0.5  # crank and rod of models/slider_crank_bodies.py [m]
MODELS = Path(__file__).parent.parent / "models"
NAME = "SliderCrankBodies"
Fmu = Callable[[str], Path]
ground = Ground()


def slider_crank(phi: float, w: float) -> dict[str, float]:
    """The joints at an angle [rad] and a rate [rad/s] of the crank."""
    psi = -asin(R * sin(phi) / L)
    rate = -R * cos(phi) * w / (L * cos(psi))
    return {
        "angle.A": phi,
        "der(angle.A)": w,
        "angle.B": psi - phi,
        "der(angle.B)": rate - w,
        "position.D": R * cos(phi) + L * cos(psi),
        "der(position.D)": -R * sin(phi) * w - L * sin(psi) * rate,
    }


def first(fmu: Path, start: dict[str, float], **options: Any) -> dict[str, float]:
    """Everything at the start."""
    row = simulate_fmu(fmu, start_values=start, stop_time=1e-3, **options)[0]
    return {name: float(row[name]) for name in row.dtype.names}


def told(fmu: Path, start: dict[str, float]) -> list[str]:
    """What an FMU that starts there tells, and that it does."""
    with instance(fmu) as one:
        one.start(start)
        return [text for _, _, text in one.log if text.startswith("start value ")]


def refused(fmu: Path, start: dict[str, float]) -> str:
    """Why it does not."""
    with instance(fmu) as one:
        with pytest.raises(FMICallException):
            one.start(start)
        return one.log[-1][2]


@pytest.mark.parametrize("start", [(2.2, -7.0), (-1.9, 4.0), (pi / 4, 0.5)])
def test_a_crank_is_set_by_its_angle_and_its_rate(
    native_fmu: Fmu, start: tuple[float, float]
) -> None:
    """Piston and rod are where the triangle says, and as fast; forces are d'Alembert's from there on."""
    given = dict(zip(("angle.A", "der(angle.A)"), start, strict=True))
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # what only follows is not warned of
        assert verify(native_fmu(NAME), given).passed
    assert told(native_fmu(NAME), given) == []
    found, expected = first(native_fmu(NAME), given), slider_crank(*start)
    assert {name: found[name] for name in expected} == pytest.approx(expected, rel=1e-13, abs=1e-14)


def test_in_every_interface_it_is_the_same_start(native_fmu: Fmu, fmi3_fmu: Fmu) -> None:
    """Co-simulation and model exchange, of FMI 2.0 and 3.0; the described start is one that may be set."""
    given = {"angle.A": 2.2, "der(angle.A)": -7.0}
    rows = []
    for fmu in (native_fmu(NAME), fmi3_fmu(NAME)):
        assert validate_fmu(str(fmu)) == []
        for kind in ("CoSimulation", "ModelExchange"):
            rows.append(first(fmu, given, fmi_type=kind))
    for name in (*slider_crank(1, 1), "force.A.x", "force.C.y", "torque.D.z"):
        assert [row[name] for row in rows] == [rows[0][name]] * 4


def test_any_joint_takes_the_rest_along(native_fmu: Fmu) -> None:
    """A slide at x closes with the crank at the angle of the cosine law; what the model gave for that angle
    moves and is told with both numbers."""
    x, fmu = 0.5, native_fmu(NAME)
    phi = acos((R**2 + x**2 - L**2) / (2 * R * x))
    found = first(fmu, {"position.D": x})
    assert found["position.D"] == pytest.approx(x, rel=1e-14)
    assert found["angle.A"] == pytest.approx(phi, rel=1e-13)
    assert found["der(angle.A)"] == pytest.approx(10.0, rel=1e-13)  # it goes together with that
    (moved,) = [text for text in told(fmu, {"position.D": x}) if " angle.A " in text]
    assert [float(n) for n in re.findall(r"= (\S+) misses.*projected to (\S+)", moved)[0]] == [
        pytest.approx(pi / 4, rel=1e-14),
        pytest.approx(phi, rel=1e-13),
    ]
    speed = slider_crank(pi / 4, 1.0)["der(position.D)"]
    found = first(fmu, {"der(position.D)": 0.3})
    assert found["der(angle.A)"] == pytest.approx(0.3 / speed, rel=1e-13)
    assert found["angle.A"] == pytest.approx(pi / 4, rel=1e-14)
    everything = slider_crank(2.0, 3.0)  # where one determines the others
    found = first(fmu, everything)
    assert {n: found[n] for n in everything} == pytest.approx(everything, rel=1e-13)


@pytest.mark.parametrize("start", [(2.2, -7.0), (-1.9, 4.0)])
def test_joints_that_determine_each_other_are_set_together(
    native_fmu: Fmu, start: tuple[float, float]
) -> None:
    """One freedom, and all three joints are given as the triangle has them: what the first leaves of the
    others is rounding, and is not divided by."""
    given = slider_crank(*start)
    found = first(native_fmu(NAME), given)
    assert {name: found[name] for name in given} == pytest.approx(given, rel=1e-12, abs=1e-12)


@pytest.mark.thorough
@pytest.mark.parametrize("ride", [0.01, 0.05, 0.33])
def test_a_wheel_on_its_road_follows(native_fmu: Fmu, ride: float) -> None:
    """A car that its joint lifts stands as one whose height is given: while its wheel reaches the post it
    stays there.  A roll that the joint does not allow is let go, and leaves no speed behind."""
    fmu = native_fmu("DoubleWishbone")
    found = first(fmu, {"position.ride": ride, "car.omega.x": -0.058})
    assert found["position.ride"] == pytest.approx(ride, rel=1e-13)
    assert abs(found["car.omega.x"]) < 1e-20
    assert abs(found["der(car.position.z)"]) < 1e-3
    if ride < 0.3:
        height = first(fmu, {"car.position.z": 0.5 + ride})
        for name in ("upright.position.z", "angle.A", "der(upright.position.z,2)"):
            small = 1e-9 * 9.81 if "2)" in name else 0.0  # accelerations are what is left of g
            assert found[name] == pytest.approx(height[name], rel=1e-9, abs=small), name


@pytest.mark.parametrize(
    ("start", "named", "nearest"),
    [
        ({"position.D": 0.8}, "position.D = 0.8", R + L),
        ({"angle.A": 0.5, "angle.B": 0.3}, "angle.B = 0.3", None),
        ({"der(angle.A)": 1.0, "der(position.D)": 5.0}, "der(position.D) = 5", None),
    ],
)
def test_what_cannot_be_reached_is_refused_by_name(
    native_fmu: Fmu, start: dict[str, float], named: str, nearest: float | None
) -> None:
    """Beyond the dead centre, and two that one freedom cannot have; with the nearest that was found."""
    text = refused(native_fmu(NAME), start)
    assert "the start is refused" in text
    assert f"{named}" in text
    assert "joints and their limits" in text
    if nearest is not None:
        found = re.search(r"nearest that was found is ([-\d.e]+)", text)
        assert found is not None
        assert float(found[1]) == pytest.approx(nearest, abs=1e-3)


def test_what_was_set_is_part_of_a_saved_state(library: Any) -> None:
    """An instance that has only been created takes it over, and a reset forgets it."""
    lib = library(NAME)
    one = lib()
    one.does("SetupExperiment", 0, c_double(0), c_double(0), 0, c_double(0))
    one.set("angle.A", 2.2)
    assert one.get("angle.A") == 2.2
    data = one.bytes_of(one.saved())
    other = lib()
    other.does("SetFMUstate", other.loaded(data))
    for each in (one, other):
        each.does("EnterInitializationMode")
        each.set("der(angle.A)", -7.0)
        each.does("ExitInitializationMode")
        each.step(0.1)
    assert one.outputs() == other.outputs()
    one.does("Reset")
    one.start()
    assert one.get("angle.A") == pytest.approx(pi / 4, rel=1e-14)


def test_derivatives_are_taken_by_states_alone(library: Any) -> None:
    """The angle of a joint is none, settable as it is at the start."""
    one = library(NAME)().start()
    size, reals = c_size_t(1), (c_double * 1)
    arguments = (
        one.references(["force.A.x"]),
        size,
        one.references(["angle.A"]),
        size,
        reals(1.0),
        reals(),
    )
    said = one.refuses("GetDirectionalDerivative", *arguments)
    assert "a change of 'angle.A'" in said


def four_bar(**start: float) -> Any:
    """Of a crank of 0.2 m, a coupler of 0.5 m and a rocker of 0.4 m, 0.45 m from pivot to pivot."""
    names, lengths = ("crank", "coupler", "rocker"), (0.2, 0.5, 0.4)
    bodies = [Body(n, 1.0, 0.01) for n in names]
    ends = [(b.at((-x / 2, 0)), b.at((x / 2, 0))) for b, x in zip(bodies, lengths, strict=True)]
    (a1, a2), (b1, b2), (c1, c2) = ends
    pins = (ground.at((0, 0)), a1), (a2, b1), (b2, c1), (c2, ground.at((0.45, 0)))
    joints = [Revolute(name, *pin) for name, pin in zip("ABCD", pins, strict=True)]
    return mechanism("FourBar", plane="xy", bodies=bodies, joints=joints, start={"angle.A": 1.1})


def test_of_two_branches_it_is_the_one_that_leads_on(built: Any) -> None:
    """A four-bar linkage closes with its elbow on either side: wherever its crank is put, all the way round,
    the elbow stays on the side of the start, and its angle is that of the cosine law."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the other branch
        fmu = built(four_bar())
    side = math.copysign(1, sin(first(fmu, {})["angle.C"]))
    for phi in (-2.9, -1.0, 0.1, 2.5, 5.0):
        found = first(fmu, {"angle.A": phi})
        square = R**2 + 0.45**2 - 2 * R * 0.45 * cos(phi)
        elbow = pi - acos((0.5**2 + 0.4**2 - square) / (2 * 0.5 * 0.4))
        assert found["angle.A"] == pytest.approx(phi, rel=1e-13)
        assert math.remainder(found["angle.C"] - side * elbow, 2 * pi) == pytest.approx(
            0, abs=1e-13
        )


def test_what_is_not_asked_for_stays_where_it_can(built: Any) -> None:
    """Of a pendulum on a cart that nothing holds: the other angle that the model gives, and a coordinate that
    the importer sets, to the digit; the rest moves least, so that the centre of mass does not."""
    fmu = built(cart_arm())
    before = first(fmu, {})
    found = first(fmu, {"angle.B": 7.0, "der(angle.B)": 3.0})
    for name, value in {**SET_OUT, "angle.B": 7.0, "der(angle.B)": 3.0}.items():
        assert found[name] == pytest.approx(value, rel=1e-13)  # the second turn of B too
    for x in "xyz":
        places = [f"{body}.position.{x}" for body in ("cart", "upper", "lower")]
        assert sum(found[n] for n in places) == pytest.approx(
            sum(before[n] for n in places), abs=1e-12
        )
    found = first(fmu, {"angle.B": -1.0, "cart.position.x": 0.7, "der(lower.position.z)": 0.2})
    assert found["angle.B"] == pytest.approx(-1.0, rel=1e-13)
    assert (found["cart.position.x"], found["der(lower.position.z)"]) == pytest.approx(
        (0.7, 0.2), rel=1e-15
    )
    assert found["angle.A"] == pytest.approx(0.3, rel=1e-13)


def test_a_chain_is_set_by_all_its_angles_at_once(built: Any) -> None:
    """Ends and rates of ten links of 1 m are sums over the angles and rates above; that of 4 rad is one of
    4 - 2 pi, the nearer way round."""
    n, fmu = 10, built(hinged(10, "y"))
    angles, rates = (
        [0.3, -0.5, 4.0, 0.1, 0.2, -1.2, 0.4, 0.6, -0.3, 0.7],
        [k - 2.5 for k in range(n)],
    )
    given = {f"angle.J{k}": a for k, a in enumerate(angles)}
    found = first(fmu, given | {f"der(angle.J{k})": w for k, w in enumerate(rates)})
    assert found["angle.J2"] == pytest.approx(4.0 - 2 * pi, rel=1e-12)
    x = z = vx = vz = a = w = 0.0
    for k in range(n):
        a, w = a + angles[k], w + rates[k]
        half = [-sin(a) / 2, -cos(a) / 2, -cos(a) * w / 2, sin(a) * w / 2]
        at = [x + half[0], z + half[1], vx + half[2], vz + half[3]]
        names = (form.format(f"b{k}.position.{c}") for form in ("{}", "der({})") for c in "xz")
        assert [found[name] for name in names] == pytest.approx(at, rel=1e-12, abs=1e-12)
        x, z, vx, vz = (2 * end - begin for end, begin in zip(at, (x, z, vx, vz), strict=True))


def test_a_flap_that_rests_on_its_stop_is_set_away_from_it(built: Any) -> None:
    """At -0.5 rad the stop carries it; at 0.3 rad it is let go, where nothing does."""
    flap = Body("flap", 2.0, 0.05)
    hinge = Revolute("A", ground.at((0, 0)), flap.at((-0.3, 0)), limits=(-0.5, 2.0))
    parts = {"plane": "xy", "bodies": [flap], "joints": [hinge], "start": {"angle.A": -0.5}}
    fmu = built(mechanism("Flap", **parts, loads=[Gravity((0, -9.81))]))
    resting, let_go = first(fmu, {}), first(fmu, {"angle.A": 0.3})
    assert resting["contact.A.lower"]
    assert resting["torque.A.z"] == pytest.approx(2.0 * 9.81 * 0.3 * cos(0.5), rel=1e-12)
    assert let_go["angle.A"] == pytest.approx(0.3, rel=1e-14)
    assert not let_go["contact.A.lower"]
    assert let_go["torque.A.z"] == 0


def test_an_angle_that_a_motor_prescribes_is_no_start(built: Any, native_fmu: Fmu) -> None:
    """Nor are they where no joint is: such FMUs do not carry what only these need."""
    arm = Body("arm", 1.0, 0.02)
    pin = Revolute("A", ground.at((0, 0)), arm.at((-0.2, 0)))
    parts = {"plane": "xy", "bodies": [arm], "joints": [pin]}
    motor = Motor("M", "A", motion=True)
    driven = built(mechanism("Driven", **parts, loads=[motor]), whole=True)
    assert "'angle.A' is calculated and cannot be set" in refused(driven, {"angle.A": 1.0})
    for fmu in (driven, native_fmu("PendulumCartesian")):
        assert not {"joint_start.c", "joint_coordinates.c"} & sources(fmu).keys()
    assert {"joint_start.c", "joint_coordinates.c"} <= sources(native_fmu(NAME)).keys()


def test_derivatives_and_error_bars_by_such_a_start(built: Any) -> None:
    """At the start those of the triangle; later those of runs beside; what an error bar says holds."""
    names = "angle.B,position.D,der(position.D),force.A.x"
    scene = Scene(NAME, sensitivities=(f"{names}:angle.A,der(angle.A)",), error_bars=True)
    file = load(MODELS / "slider_crank_bodies.py")
    fmu, at, h = built(file.model, scene), {"angle.A": 2.2, "der(angle.A)": -7.0}, 1e-4

    def run(tolerance: float = 1e-11, **off: float) -> Any:
        start = {n: x + off.get(n[:3], 0.0) for n, x in at.items()}
        return evenly(fmu, 0.2, 4, tolerance, start)

    rows = run()
    assert rows["sensitivity.valid"].all()
    exact = slider_crank(*at.values())
    for by, step in (("ang", (h, 0.0)), ("der", (0.0, h))):
        name = {"ang": "angle.A", "der": "velocity.angle.A"}[by]
        ends = [
            slider_crank(at["angle.A"] + s * step[0], at["der(angle.A)"] + s * step[1])
            for s in (-1, 1)
        ]
        beside = [run(**{by: s * h}) for s in (-1, 1)]
        for of in names.split(","):
            called = {"der(position.D)": "velocity.position.D"}.get(of, of)
            found = rows[f"sensitivity.{called}.by.{name}"]
            if of in exact:
                expected = (ends[1][of] - ends[0][of]) / (2 * h)
                assert found[0] == pytest.approx(expected, rel=1e-7, abs=1e-9)
            expected = (beside[1][of] - beside[0][of]) / (2 * h)
            np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6 * abs(expected).max())
    loose = run(1e-5)
    off = abs(loose["angle.B"] - rows["angle.B"])
    assert off.max() > 0
    assert (off <= loose["error.angle.B"] + 1e-12).all()


def hinges(kind: Any, start: dict[str, float], *, plane: bool = True, motor: Any = None) -> Model:
    """Three bodies behind each other on joints of a kind."""
    before: Any = ground
    bodies, joints = [], []
    zero = (0, 0) if plane else (0, 0, 0)
    for k in range(3):
        aside = (0.1, 0.02) if plane else (0.1, 0.02, 0.03)
        body = Body(f"b{k}", 1.0, 0.04 if plane else (0.02, 0.03, 0.04), center=aside)
        joints.append(kind(f"j{k}", before.at((0.2 if k else 0.0, *zero[1:])), body.at(zero)))
        bodies.append(body)
        before = body
    loads: list[Any] = [Gravity((0, -9.81) if plane else (0, -9.81, 0))]
    if motor is not None:
        loads.append(Motor("M", joints[0], motion=motor))
    space: dict[str, Any] = {"plane": "xy"} if plane else {}
    return mechanism("Open", bodies=bodies, joints=joints, loads=loads, start=start, **space)


OPEN = (
    (Revolute, ("angle",), True),
    (Revolute, ("angle",), False),
    (Prismatic, ("position",), True),
    (Cylindrical, ("angle", "position"), False),
)


@pytest.mark.parametrize(
    ("kind", "measures", "plane", "given"),
    [
        pytest.param(*case, given, marks=() if k % 2 == (given is None) else pytest.mark.thorough)
        for k, case in enumerate(OPEN)
        for given in (0.1, None)
    ],
)
def test_setting_one_joint_of_an_open_chain_moves_no_other(
    built: Any, kind: Any, measures: tuple[str, ...], plane: bool, given: float | None
) -> None:
    """Places and attitudes of bodies, which nobody gave, follow: the other joints stay where they begin,
    whether the model gives them or not, and so do their rates."""
    names = [f"{m}.j{k}" for k in range(3) for m in measures]
    fmu = built(hinges(kind, {} if given is None else dict.fromkeys(names, given), plane=plane))
    begins = first(fmu, {})
    for k in range(3):
        for measure in measures:
            moved = f"{measure}.j{k}"
            for start in ({moved: 1.0}, dict.fromkeys(names, given or 0.0) | {moved: 1.0}):
                found = first(fmu, start)
                expected = {n: begins[n] for n in names} | {moved: 1.0}
                assert {n: found[n] for n in names} == pytest.approx(expected, abs=1e-12)
                assert told(fmu, start) == []
            rates = {f"der({n})": 0.0 for n in names} | {f"der({moved})": 2.0}
            found = first(fmu, {f"der({moved})": 2.0})
            assert {n: found[n] for n in rates} == pytest.approx(rates, abs=1e-12)
            assert {n: found[n] for n in names} == pytest.approx(
                {n: begins[n] for n in names}, abs=1e-12
            )


def test_a_motors_own_parameter_moves_no_joint_that_is_given(built: Any) -> None:
    """Its angle goes from 0.1 to 1 rad, the joints behind it stay at theirs."""
    amp = Parameter(Symbol("amp"), 0.1, "rad")
    fmu = built(hinges(Revolute, {"angle.j1": 0.1, "angle.j2": -0.3}, motor=amp))
    found = first(fmu, {"amp": 1.0})
    assert [found[f"angle.j{k}"] for k in range(3)] == pytest.approx([1.0, 0.1, -0.3], abs=1e-12)
    assert told(fmu, {"amp": 1.0}) == []


def test_a_joint_that_cannot_stay_is_told_wherever_it_is_set(built: Any) -> None:
    """In a loop of one freedom the slide takes the given crank along: a sweep counts it in a column, and
    sensitivities and fits warn as a run does."""
    fmu = built(load(MODELS / "slider_crank_bodies.py").model)
    runs = sweep(fmu, {"position.D": [0.62, 0.65]}, keep=["force.C.norm:last"], stop_time=0.01)
    for text in runs["moved"].values:
        assert re.search(r"start value angle\.A = 0\.785\S* misses", text)
    with pytest.warns(UserWarning, match=r"start value angle\.A"):
        sensitivity(
            fmu,
            ["force.C.norm"],
            ["crank.mass"],
            start_values={"position.D": 0.62},
            stop_time=0.01,
        )
    measured = {"time": [0.0, 0.01], "force.C.norm": [1.0, 1.1]}
    with pytest.warns(UserWarning, match=r"start value angle\.A"):
        fit(
            fmu,
            measured,
            {"crank.mass": (0.1, 10.0)},
            ["force.C.norm"],
            start_values={"position.D": 0.62},
        )
