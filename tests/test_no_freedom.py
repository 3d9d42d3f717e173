"""Mechanisms whose motors prescribe every motion: nothing is integrated, and forces are exact to rounding."""

from __future__ import annotations

import re
from collections.abc import Sequence
from math import acos, atan2, ceil, cos, hypot, pi, remainder, sin, sqrt
from typing import Any

import numpy as np
import pytest
from conftest import model_file
from instance import Instance, instance
from sympy import Piecewise, symbols
from sympy import cos as cosine
from sympy import sin as sine
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Holonomic, Model, Parameter, Peak, Scene, simulate
from lagfmu.bodies import Body, Distance, Gravity, Ground, Motor, Prismatic, Revolute, mechanism
from lagfmu.errors import SimulationError
from lagfmu.testing import TIME, prepare, sources_of

R, L, PISTON, W = 0.2, 0.5, 0.7, 11.0
w, begin = symbols("w begin", positive=True)
RATE = Parameter(w, W, "rad/s")
ground = Ground()
crank = Body("crank", 2.0, 0.01)
rod = Body("rod", 1.0, 0.02)
piston = Body("piston", PISTON, 0.001)
STEPS = pytest.mark.parametrize("step", [0.005, 0.1])


def slider_crank(
    motion: Any = w * TIME,
    long: float = L,
    start: dict[str, float] | None = None,
    parameters: Sequence[Parameter] = (RATE,),
    rates: str = "given",
    twice: bool = False,
) -> Model:
    """A crank of 0.2 m whose motor moves it, a rod, a piston on the x axis; `twice`: a second
    rod without mass."""
    more = [Distance("again", crank.at((R / 2, 0)), piston.at((0, 0)), long)] if twice else []
    return mechanism(
        "Driven",
        plane="xy",
        bodies=[crank, rod, piston],
        joints=[
            Revolute("A", ground.at((0, 0)), crank.at((-R / 2, 0))),
            Revolute("B", crank.at((R / 2, 0)), rod.at((-long / 2, 0))),
            Revolute("C", piston.at((0, 0)), rod.at((long / 2, 0))),
            Prismatic("D", ground.at((0, 0)), piston.at((0, 0)), axis="x"),
            *more,
        ],
        loads=[Gravity((0, -9.81)), Motor("motor", "A", motion=motion, rates=rates)],
        parameters=parameters,
        start={"angle.A": 0.0, "der(angle.A)": W} if start is None else start,
    )


def place(a: float) -> tuple[float, float, float]:
    """x(a) of the piston, with its first two derivatives."""
    root = sqrt(L**2 - (R * sin(a)) ** 2)
    bend = R**2 * sin(a) * cos(a)
    second = (R**2 * cos(2 * a) + (bend / root) ** 2) / root
    return R * cos(a) + root, -R * sin(a) - bend / root, -R * cos(a) - second


def walked(one: Instance, step: float, stop: float) -> list[dict[str, Any]]:
    seen = []
    for _ in range(round(stop / step)):
        one.step(step)
        seen.append(one.outputs() | {"time": one.time})
    return seen


def events(one: Instance) -> list[str]:
    return [text for _, category, text in one.log if "freedom" in text]


@STEPS
def test_a_driven_piston_takes_its_mass_times_its_acceleration(built: Any, step: float) -> None:
    """A crank at constant speed: the piston is at x(a), and the rod feels -m x'' w^2 along the guide, to
    rounding at any communication step and tolerance, one step to each point."""
    for tolerance in (1e-4, 1e-10):
        with instance(built(slider_crank())) as one:
            one.start(tolerance=tolerance)
            seen = walked(one, step, 1.0)
            (told,) = events(one)
            assert one.get("solver.steps") <= ceil(1.05 * max(len(seen), 30))
        assert "leave no freedom, so that nothing is integrated, and auto is not needed" in told
        most = max(PISTON * abs(place(a)[2]) * W**2 for a in np.linspace(0, pi, 50))
        for at in seen:
            x, _, bend = place(W * at["time"])
            assert at["position.D"] == pytest.approx(x, abs=1e-13)
            assert at["force.C.x"] == pytest.approx(-PISTON * bend * W**2, abs=1e-12 * most)
            assert at["angle.A"] == pytest.approx(W * at["time"], rel=1e-13)


def test_states_do_not_depend_on_the_way_that_led_to_them(built: Any) -> None:
    """Points that are far from each other, near each other, or reached from a saved state tell the same."""
    ends = []
    with instance(built(slider_crank())) as one:
        one.start()
        for step in (0.003, 0.3):
            one.start() if one.time else None
            ends.append(walked(one, step, 0.9)[-1])
            one.repeated(0.07, 5)
            one.fmu.reset()
    for name in ("position.D", "force.C.x", "lambda.motor", "force.A.y"):
        assert ends[0][name] == pytest.approx(ends[1][name], rel=1e-11)


def test_a_crossing_of_branches_is_passed_and_told(built: Any) -> None:
    """Crank and rod alike: where they lie on each other the piston may stay in the origin, or go on as
    x = 2 r cos(a); it goes on, at every communication step, and the passage is told with its time."""
    model = slider_crank(long=R, start={"angle.A": 0.0, "der(angle.A)": W, "position.D": 2 * R})
    for step in (0.011, 0.1):
        with instance(built(model)) as one:
            one.start()
            seen = walked(one, step, 1.1)
            told = " ".join(text for _, category, text in one.log if "passes, smoothly" in text)
        for at in seen:
            assert at["position.D"] == pytest.approx(2 * R * cos(W * at["time"]), abs=1e-9)
        passed = [float(t) for t in re.findall(r"at t = (\S+) s the motion passes", told)]
        assert passed == pytest.approx([(k + 0.5) * pi / W for k in range(4)], abs=1e-7)


def test_what_the_rod_cannot_reach_is_refused(built: Any) -> None:
    """A rod shorter than the crank: at asin(l / r) the mechanism stands, and cannot be driven on."""
    model = slider_crank(long=R / 2)
    with pytest.raises(SimulationError, match=r"stops at t = 0\.0[45]|cannot be projected"):
        simulate(built(model), 0.2, 0.01)
    assert simulate(built(model), 0.04, 0.01)["angle.A"][-1] == pytest.approx(0.04 * W)


@pytest.mark.parametrize("rates", ["given", "estimated"])
def test_an_input_may_have_kinks(built: Any, rates: str) -> None:
    """The crank's angle as an importer sets it, with a rate that jumps at each point: the piston is where the
    angle says, and has the speed that its rate says."""
    fmu = built(slider_crank(motion=True, start={}, parameters=(), rates=rates))
    given = rates == "given"
    angle, h = 0.0, 0.05
    with instance(fmu) as one:
        one.start({"motor.angle": 0.0, "der(motor.angle)": 3.0} if given else {})
        for speed in (3.0, -2.0, 7.0, 0.0, 5.0):
            one.set("motor.angle", angle)
            if given:
                one.set("der(motor.angle)", speed)
            x, slope, bend = place(angle)
            assert one.get("position.D") == pytest.approx(x, abs=1e-13)
            if given:
                assert one.get("der(position.D)") == pytest.approx(slope * speed, abs=1e-12)
                assert one.get("force.C.x") == pytest.approx(-PISTON * bend * speed**2, abs=1e-10)
            one.step(h)
            angle += speed * h
            x, slope, bend = place(angle)
            if given:
                assert one.get("position.D") == pytest.approx(x, abs=1e-13)
                assert one.get("der(position.D)") == pytest.approx(slope * speed, abs=1e-11)
        assert one.get("solver.steps") == 5 or not given
        one.repeated(h, 3)


@STEPS
def test_extremes_between_points_are_found(built: Any, step: float) -> None:
    """A bar that swings as a sin(w t) in front of gravity: the motor's torque is J a'' + m g r cos(a), with
    its largest value where a' = 0, and its extremes do not depend on the communication step."""
    a, rate = 0.8, 6.0
    bar = Body("bar", 2.0, 0.1)
    model = mechanism(
        "Swing",
        plane="xy",
        bodies=[bar],
        joints=[Revolute("A", ground.at((0, 0)), bar.at((-0.5, 0)))],
        loads=[Gravity((0, -9.81)), Motor("motor", "A", motion=a * sine(w * TIME))],
        parameters=[Parameter(w, rate, "rad/s")],
        outputs=[Peak("lambda.motor")],
    )

    def torque(t: Any) -> Any:
        return -(0.1 + 0.5) * a * rate**2 * np.sin(rate * t) + 9.81 * np.cos(a * np.sin(rate * t))

    fine = torque(np.linspace(0, 2.0, 2_000_001))
    with instance(built(model)) as one:
        one.start(tolerance=1e-8, stop_time=2.0)
        walked(one, step, 2.0)
        found = [one.get(f"peak.lambda.motor.{part}") for part in ("max", "min")]
        assert events(one)
    assert found == pytest.approx([fine.max(), fine.min()], rel=1e-9)


def test_a_motion_with_a_kink_is_followed(built: Any) -> None:
    """A prescribed angle that begins to turn at 0.33 s: until then the piston stands, then it is at x(a)."""
    angle = Piecewise((0, begin > TIME), (w * (TIME - begin), True))
    model = slider_crank(angle, start={}, parameters=(RATE, Parameter(begin, 0.33, "s")))
    run = simulate(built(model), 0.6, 0.1)
    turned = [max(0.0, W * (t - 0.33)) for t in run["time"]]
    assert run["position.D"] == pytest.approx([place(a)[0] for a in turned], abs=1e-12)


def test_rows_that_repeat_others_take_no_freedom_twice(built: Any) -> None:
    """A second rod of the same length beside the first: two multipliers share its force, and the piston is
    driven as before."""
    with pytest.warns(UserWarning, match="follow"):
        fmu = built(slider_crank(twice=True))
    with instance(fmu) as one:
        seen = walked(one.start(), 0.05, 1.0)
        assert events(one)
        assert one.get("solver.steps") < 150
    for at in seen:
        x, _, bend = place(W * at["time"])
        assert at["position.D"] == pytest.approx(x, abs=1e-13)
        assert at["der(position.D,2)"] == pytest.approx(bend * W**2, abs=1e-9)


def test_what_has_a_freedom_is_integrated(built: Any) -> None:
    """A driven crank on which a rod hangs: a freedom is left, and its FMU does not carry the file."""
    free = mechanism(
        "Partly",
        plane="xy",
        bodies=[crank, rod],
        joints=[
            Revolute("A", ground.at((0, 0)), crank.at((-R / 2, 0))),
            Revolute("B", crank.at((R / 2, 0)), rod.at((-L / 2, 0))),
        ],
        loads=[Gravity((0, -9.81)), Motor("motor", "A", motion=w * TIME)],
        parameters=[RATE],
    )
    for model, carried in ((slider_crank(), True), (free, False)):
        files = sources_of(prepare(model)).runtime
        assert ("inverse.c" in files) == ("square.c" in files) == carried
    with instance(built(free)) as one:
        walked(one.start(), 0.1, 1.0)
        assert not events(one)
        assert one.get("solver.steps") > 20


def test_an_arm_of_fmi3_moves_as_that_of_fmi2(built: Any) -> None:
    """Six motors: the wrench in the first joint has the same bits by both versions of the interface."""
    model = model_file("arm").model
    runs = [
        simulate(built(model, Scene("Arm", stop_time=0.5, step_size=0.05), fmi=fmi), 0.5)
        for fmi in (2, 3)
    ]
    for name in runs[0].dtype.names:
        if name.startswith(("force.", "torque.", "angle.")):
            assert (runs[0][name] == runs[1][name]).all()


def rocker(a: float) -> tuple[float, float]:
    """Angles of coupler and rocker of an open four-bar (0.2, 0.5, 0.4, base 0.5 m) at the crank's a."""
    x, y = 0.5 - 0.2 * cos(a), -0.2 * sin(a)
    far = hypot(x, y)
    b = atan2(y, x) + acos((0.5**2 + far**2 - 0.4**2) / (far))
    return b, atan2(0.2 * sin(a) + 0.5 * sin(b), 0.2 * cos(a) + 0.5 * cos(b) - 0.5)


@pytest.mark.parametrize("step", [0.2, 1.0])
def test_a_four_bar_stays_open_however_far_its_crank_has_turned(step: float, built: Any) -> None:
    """80 turns on, coupler and rocker stand where the crank says, to rounding of its angle.  An angle's size
    is 1 rad, not how far it has gone: beside that the crossed linkage was near enough after 50 turns."""
    a, b, c = dynamicsymbols("a b c")
    coupler, rocks = rocker(0.0)
    model = Model(
        name="OpenFourBar",
        lagrangian=sum(0.01 * x.diff() ** 2 for x in (a, b, c)) * symbols("J", positive=True),
        coordinates={a: "rad", b: "rad", c: "rad"},
        constraints=[
            Holonomic("x", 0.2 * cosine(a) + 0.5 * cosine(b) - 0.4 * cosine(c) - 0.5),
            Holonomic("y", 0.2 * sine(a) + 0.5 * sine(b) - 0.4 * sine(c)),
            Holonomic("motor", a - w * TIME),
        ],
        parameters=[
            Parameter(w, 10.0, "rad/s"),
            Parameter(symbols("J", positive=True), 1, "kg.m^2"),
        ],
        start={a: 0, b: coupler, c: rocks, a.diff(): 10.0},
    )
    with instance(built(model)) as one:
        one.start()
        for seen in walked(one, step, 50.0):
            expected = rocker(10.0 * seen["time"])
            for name, angle in zip("bc", expected, strict=True):
                assert abs(remainder(seen[name] - angle, 2 * pi)) < 1e-9


@pytest.mark.parametrize("longer", [1e-3, 1e-6])
@pytest.mark.parametrize("twice", [False, True])
def test_a_rod_nearly_as_long_as_the_crank_turns_the_piston_round(
    longer: float, twice: bool, built: Any
) -> None:
    """It comes within 0.4 sqrt(longer) m of the branch on which the piston stays in the origin, and does not
    take it, whatever the communication step; with a second rod no determinant tells."""
    long = R * (1 + longer)
    model = slider_crank(
        long=long,
        twice=twice,
        parameters=[Parameter(w, 2 * pi, "rad/s")],
        start={"angle.A": 0.0, "der(angle.A)": 2 * pi},
    )
    with instance(built(model)) as one:
        one.start()
        for seen in walked(one, 0.37 if longer > 1e-4 else 0.1, 2.22):
            a = 2 * pi * seen["time"]
            x = R * cos(a) + sqrt(long**2 - (R * sin(a)) ** 2)
            assert seen["position.D"] == pytest.approx(x, abs=1e-8 / sqrt(longer))


def test_a_peak_is_seen_where_a_step_is_many_turns(built: Any) -> None:
    """A pendulum that a motor turns eight times a second asks it for m g r at most, and for as much the other
    way, also where it is looked at once a second and the cubic is the motion."""
    a = dynamicsymbols("a")
    m, g, r = symbols("m g r", positive=True)
    model = Model(
        name="TurnedPendulum",
        lagrangian=m * r**2 * a.diff() ** 2 / 2 - m * g * r * sine(a),
        coordinates={a: "rad"},
        constraints=[Holonomic("motor", a - w * TIME)],
        parameters=[
            Parameter(m, 1.0, "kg"),
            Parameter(g, 9.81, "m/s^2"),
            Parameter(r, 0.5, "m"),
            Parameter(w, 16 * pi, "rad/s"),
        ],
        start={a: 0, a.diff(): 16 * pi},
        outputs=[Peak("lambda.motor")],
    )
    with instance(built(model)) as one:
        one.start()
        one.step(1.0)
        seen = one.outputs()
    assert seen["peak.lambda.motor.max"] == pytest.approx(4.905, rel=1e-9)
    assert seen["peak.lambda.motor.min"] == pytest.approx(-4.905, rel=1e-9)


def test_a_communication_point_on_a_crossing_costs_no_steps(built: Any) -> None:
    """Crank and rod of one length, a point at each quarter of a turn: the steps after it are as long as those
    after any other, and the passage is told once."""
    model = slider_crank(
        long=R,
        parameters=[Parameter(w, 2 * pi, "rad/s")],
        start={"angle.A": 0.0, "der(angle.A)": 2 * pi},
    )
    with instance(built(model)) as one:
        one.start()
        walked(one, 0.25, 0.5)
        passages = [text for _, _, text in one.log if "singular" in text]
        steps = one.get("solver.steps")
    assert len(passages) == 1
    assert steps < 100
