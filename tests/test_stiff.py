"""`solver.method` = auto: dop853, and radau where stiffness holds dop853 back; on native FMUs."""

from __future__ import annotations

import re

import numpy as np
import pytest
from conftest import FILES, of_each_kind
from instance import instance
from sympy import cos, sin, sqrt, symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass

from lagfmu import Contact, Holonomic, Model, Parameter
from lagfmu.testing import Session

G = 9.81
x, y = dynamicsymbols("x y")
m, g, k, c, a, w = symbols("m g k c a w", positive=True)
t = dynamicsymbols._t
LINE = re.compile(
    r"stiff at t = (\S+) s: .* h rho = (\S+), and not by the motion(.*): going on with"
)


def rail():
    """A bead on the rail y = x in a viscous fluid, held by a spring: it falls fast to the speed at which
    the fluid carries it (m/c) and creeps to rest (c/k)."""
    return Model(
        name="Rail",
        kinetic_energy=m * (x.diff() ** 2 + y.diff() ** 2) / 2,
        forces={x: -c * x.diff() - k * x, y: -m * g - c * y.diff() - k * y},
        coordinates={x: "m", y: "m"},
        constraints=[Holonomic("rail", y - x)],
        parameters=[
            Parameter(m, 1.0, "kg"),
            Parameter(g, G, "m/s^2"),
            Parameter(c, 1e6, "N.s/m"),
            Parameter(k, 1e6, "N/m"),
        ],
        start={x: 1.0, y: 1.0},
    )


def relaxation():
    """Van der Pol's oscillator: it creeps for mu, jumps within 1/mu, creeps back."""
    mu = symbols("mu", positive=True)
    return Model(
        name="Relaxation",
        kinetic_energy=m * x.diff() ** 2 / 2,
        forces={x: mu * (1 - x**2 / a**2) * x.diff() - k * x},
        coordinates={x: "m"},
        parameters=[
            Parameter(m, 1.0, "kg"),
            Parameter(a, 1.0, "m"),
            Parameter(k, 1.0, "N/m"),
            Parameter(mu, 10.0, "N.s/m"),
        ],
        start={x: 2.0},
    )


def elastic():
    """A pendulum on a spring that is stretched at the start and rings at sqrt(k/m), ten times as fast as
    it swings."""
    r = sqrt(x**2 + y**2)
    return point_mass(
        "Elastic",
        "x y",
        up=y,
        energy=-k * (r - a) ** 2 / 2,
        gravity=G,
        parameters=[Parameter(k, 1e3, "N/m"), Parameter(a, 1.0, "m")],
        start={x: 0.8, y: -0.7},
    )


def dragged():
    """A bead in a viscous fluid that swings at the speed a cos(w t), with the force for that."""
    return Model(
        name="Dragged",
        kinetic_energy=m * x.diff() ** 2 / 2,
        forces={x: -c * (x.diff() - a * cos(w * t)) - m * a * w * sin(w * t)},
        coordinates={x: "m"},
        parameters=[
            Parameter(m, 1.0, "kg"),
            Parameter(c, 1e6, "N.s/m"),
            Parameter(a, 1.0, "m/s"),
            Parameter(w, 1.0, "rad/s"),
        ],
        start={x.diff(): 1.0},
    )


def dropped():
    """A bead in a fluid that is thick until it has fallen onto the floor y = 0, off which it slides on
    a level line."""
    return Model(
        name="Dropped",
        kinetic_energy=m * (x.diff() ** 2 + y.diff() ** 2) / 2,
        forces={x: -k * x, y: -m * g - c * y.diff()},
        coordinates={x: "m", y: "m"},
        constraints=[Contact("floor", y)],
        parameters=[
            Parameter(m, 1.0, "kg"),
            Parameter(g, G, "m/s^2"),
            Parameter(c, 1e5, "N.s/m"),
            Parameter(k, 1.0, "N/m"),
        ],
        start={x: 1.0, y: 1e-5},
    )


def lines(one):
    told = [text for status, category, text in one.log if (status, category) == (0, "logEvents")]
    return [text for text in told if text.startswith("stiff at")]


def creep(t, damping):
    """x(t) on the rail, from 2 m x'' + 2 c x' + 2 k x = -m g with x(0) = 1, x'(0) = 0 and k = c/s."""
    rest = -G / (2 * damping)
    root = np.sqrt(1 - 4 / damping)
    fast, slow = -damping * (1 + root) / 2, -2 / (1 + root)
    share = fast / (fast - slow)
    return rest + (1 - rest) * (share * np.exp(slow * t) + (1 - share) * np.exp(fast * t))


# --------------------------------------------------------------------------- stiff


@pytest.mark.parametrize("tolerance", [1e-4, 1e-8])
@pytest.mark.parametrize("damping", [1e4, 1e6, 1e9])
def test_a_bead_creeps_however_thick_the_fluid(built, damping, tolerance):
    """x = A exp(-t/1 s) within the tolerance, and lambda = m g/2, whether what has died out had a rate of
    1e4 or 1e9 times that of the motion; radau takes over within 200 of the fast times, which is told
    once."""
    with instance(built(rail())) as one:
        one.start({"c": damping, "k": damping}, tolerance=tolerance)
        for t in (0.25, 0.5, 1.0):
            one.step(t - one.time)
            assert one.get("x") == pytest.approx(creep(t, damping), abs=5 * tolerance)
            assert one.get("lambda.rail") == pytest.approx(G / 2, abs=1e-14 * damping)
        assert one.get("solver.steps") < 600
        [line] = lines(one)
        time, product, _ = LINE.match(line).groups()
        assert 0 < float(time) < 200 / damping
        assert 0.1 < float(product) < 10
        assert "solver.method = radau" in line


def test_who_asks_for_dop853_gets_nothing_else(built):
    """dop853 is stable for h < 6.4 m/c and takes no longer steps, however smooth the motion is; where
    that is 1e8 steps the communication step is refused, and with auto it is not."""
    with instance(built(rail())) as one:
        one.start({"c": 1e4, "k": 1e4, "solver.method": "dop853"}, tolerance=1e-4)
        one.step(0.25)
        assert one.get("solver.steps") > 0.25 * 1e4 / 6.5
        assert lines(one) == []
    with instance(built(rail())) as one:
        one.start({"c": 1e9, "k": 1e9, "solver.method": "dop853"}, tolerance=1e-4)
        with pytest.raises(Exception, match=r"fmi2DoStep|status|2"):
            one.step(1.0)
        assert (
            "would need more than 1e+07 internal steps, 200 took it from t = 0 s" in one.log[-1][2]
        )
        assert one.log[-1][2].endswith("take a shorter one")


def test_a_cart_in_ever_thicker_oil_becomes_a_fixed_pivot(native_fmu):
    """The cart of the pendulum moves as its friction lets it, so that the distance from where it was
    falls as 1/c, to 1e8 N s/m."""
    moved = []
    for damping in (1e4, 1e6, 1e8):
        with instance(native_fmu("CartPendulum")) as one:
            one.start({"c": damping}, tolerance=1e-8)
            one.step(1.0)
            moved.append(abs(one.get("s")))
            assert one.get("solver.steps") < 1500
            assert len(lines(one)) == 1
    assert moved[0] / moved[1] == pytest.approx(100, rel=1e-2)
    assert moved[1] / moved[2] == pytest.approx(100, rel=1e-2)


def test_each_phase_of_a_relaxation_has_its_method(built):
    """Creeping, van der Pol's oscillator is stiff, jumping it is not: with the method of each phase it
    takes a quarter of the steps of dop853 and, though those in the jumps are shorter, hardly more than radau,
    to the same place."""
    steps, ends = {}, {}
    for method in ("dop853", "radau", "auto"):
        with instance(built(relaxation())) as one:
            one.start({"mu": 30.0, "solver.method": method}, tolerance=1e-7)
            one.step(60.0)
            steps[method], ends[method] = one.get("solver.steps"), one.get("x")
            assert len(lines(one)) == (method == "auto")
    assert steps["auto"] < min(steps["dop853"] / 4, 1.5 * steps["radau"])
    assert ends["auto"] == pytest.approx(ends["dop853"], abs=1e-5)


def test_after_the_landing_nothing_is_stiff_any_more(built):
    """The bead sinks through 0.01 mm at the speed m g/c and then swings along the floor: x = cos t, in
    as few steps as dop853 takes for it."""
    steps = {}
    for method in ("auto", "dop853"):
        with instance(built(dropped())) as one:
            one.start({"solver.method": method}, tolerance=1e-9)
            one.step(1.0)
            assert one.get("contact.floor")
            back = [text for _, _, text in one.log if "going on with dop853 again" in text]
            assert len(back) == (method == "auto")  # the log says so
            landed = one.get("solver.steps")
            one.step(9.0)
            steps[method] = one.get("solver.steps") - landed
            assert one.get("x") == pytest.approx(np.cos(10.0), abs=1e-6)
            assert one.get("lambda.floor") == pytest.approx(G, rel=1e-9)
    assert steps["auto"] <= steps["dop853"] + 2


@pytest.mark.parametrize("stiffness", [1e3, 1e5, 1e7])
def test_what_is_dragged_along_is_as_exact_as_the_tolerance_says(built, stiffness):
    """A bead in a viscous fluid that swings (Prothero and Robinson): x = sin t solves
    m x'' = -c (x' - cos t) - m sin t whatever c is.  Where h c/m is neither small nor large radau has but the
    order of its stages: place and speed are right to ten times the tolerance, and the acceleration to what c
    makes of an error of the speed."""
    errors = []
    with instance(built(dragged())) as one:
        one.start({"c": stiffness, "solver.method": "radau"}, tolerance=1e-9)
        for t in np.linspace(0.1, 6.0, 60):
            one.step(0.1)
            errors.append(
                [
                    one.get("x") - np.sin(t),
                    one.get("der(x)") - np.cos(t),
                    one.get("der(x,2)") + np.sin(t),
                ]
            )
    place, speed, acceleration = np.abs(errors).max(axis=0)
    assert max(place, speed) < 1e-8
    assert acceleration < 1e-9 * stiffness


# --------------------------------------------------------------------------- not stiff


def same_as_dop853(path, times, tolerance):
    """All outputs at the points are the same to the last bit; nothing is told."""
    with Session(path, log=True) as session:
        auto, dop853 = (
            session.run(times, {"solver.method": method}, tolerance)
            for method in ("auto", "dop853")
        )
        assert not [text for _, text in session.messages if LINE.match(text)]
    assert auto.refusal is dop853.refusal is None
    assert auto.rows.tobytes() == dop853.rows.tobytes()


@pytest.mark.parametrize("name", of_each_kind(sorted(set(FILES) - {"SliderCrank"})))
def test_where_nothing_is_stiff_auto_is_dop853(native_fmu, name):
    """The models move at the rates of their equations: the same steps, the same bits."""
    for tolerance in (1e-3, 1e-8, 1e-12):
        same_as_dop853(native_fmu(name), np.arange(8) / 7, tolerance)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-5, 1e-10])
def test_an_oscillation_that_has_to_be_resolved_is_not_stiffness(built, tolerance):
    """A spring that rings ten times while it swings once bounds the step by accuracy, which radau does
    not cure."""
    same_as_dop853(built(elastic()), [0.0, 2.0], tolerance)


def test_communication_steps_shorter_than_the_stable_step_need_no_radau(native_fmu):
    """Every 0.1 ms the slider-crank's input may change: that is within dop853's reach."""
    same_as_dop853(native_fmu("SliderCrank"), np.linspace(0, 0.01, 101), 1e-8)


# --------------------------------------------------------------------------- states, points


def future(one, until, width):
    rows = []
    while one.time < until:
        one.step(width)
        rows.append(one.outputs())
    return rows


def test_the_choice_belongs_to_the_saved_state(built):
    """Before the change of method, between two of the steps that are counted, and after it: from each
    saved state and from its bytes in a fresh instance there is one future, bit for bit."""
    width = 2.0**-13  # a few steps of dop853
    with instance(built(rail())) as one, instance(built(rail()), "fresh") as fresh:
        one.start({"c": 1e5, "k": 1e5}, tolerance=1e-6)
        fresh.start({"c": 1e5, "k": 1e5}, tolerance=1e-6)
        saved = []
        for _ in range(24):
            state = one.fmu.getFMUState()
            saved.append((one.time, state, one.fmu.serializeFMUState(state), len(lines(one))))
            one.step(width)
        told = [count for *_, count in saved]
        assert told.count(0) > 3
        assert told.count(1) > 3
        right = future(one, 0.25, 2.0**-9)
        for moment, state, data, count in saved[::3]:
            one.fmu.setFMUState(state)
            fresh.fmu.setFMUState(fresh.fmu.deSerializeFMUstate(data))
            for again in (one, fresh):
                again.time = moment
                again.log.clear()
                while again.time < 24 * width:
                    again.step(width)
                assert future(again, 0.25, 2.0**-9) == right
                assert len(lines(again)) == 1 - count


def test_the_communication_step_does_not_change_the_choice(built, library):
    """Without inputs a native FMU steps past the communication points: from 1 s to 0.1 ms the method
    changes at the same step, and all outputs are the same to the last bit.  The bead starts with the
    speed of its creeping, 1 m/s."""
    creeping = {"c": 1e5, "k": 1e5, "der(x)": -1.0, "der(y)": -1.0}
    found = library(built(rail()))
    ends = []
    for width in [2.0**-n for n in (0, 3, 8, 13)]:
        one = found().start(creeping, 1e-6)
        while one.time < 1:
            one.step(width)
        ends.append((one.outputs(), [text for *_, text in one.log]))
        one.free()
    assert all(end == ends[0] for end in ends)
    assert len(ends[0][1]) == 1
