"""Forces that jump in position, time or inputs are events; jumps in a velocity are refused."""

from __future__ import annotations

import pytest
from instance import instance
from runs import simulate_fmu
from sympy import (
    Abs,
    Heaviside,
    Max,
    Mod,
    Piecewise,
    cos,
    exp,
    floor,
    pi,
    sign,
    sqrt,
    symbols,
)
from sympy.physics.mechanics import dynamicsymbols
from zoo.forces import JUMPS, F, G, L, T, cart, k, m, t, u, v, x

from lagfmu import Model, Parameter, derive, simulate
from lagfmu.errors import ModelError
from lagfmu.testing import Form, jumps_of, prepare, with_jumps


@pytest.fixture
def own(built):
    """own(NAME): the FMU of one of the models above."""
    return lambda name: built(JUMPS[name]())


@pytest.mark.parametrize("step", [0.13, 4.0])
def test_a_valley_of_two_slopes_swings_with_its_period(own, step):
    """V = F |x| from rest at x0: parabola after parabola, period 4 sqrt(2 m x0/F) = 4 s; the force jumps
    at each passage of x = 0, which costs one event and no accuracy, in any communication step."""
    with instance(own("Valley")) as one:
        one.start(tolerance=1e-8)
        while one.time < 8.0:
            one.step(min(step, 8.0 - one.time))
            turn = one.time % 4.0
            s = min(turn, 4.0 - turn)
            expected = 1 - s**2 if s < 1 else (2 - s) ** 2 - 1
            assert one.get("x") == pytest.approx(expected, abs=1e-11)
            speed = 2 * s if s < 1 else 2 * (2 - s)
            assert abs(one.get("der(x)")) == pytest.approx(speed, abs=1e-10)
        assert one.get("energy.total") == pytest.approx(2.0, abs=1e-11)
        assert one.get("solver.steps") < 8 * 8.0 / step + 40


def test_at_the_bottom_of_the_valley_a_cart_rests(own):
    """At x = 0 with no velocity the force is 0 (sign(0) = 0), and nothing moves."""
    with instance(own("Valley")) as one:
        one.start({"x": 0.0})
        one.step(5.0)
        assert one.get("x") == one.get("der(x)") == 0
        one.set("u", 3.0)  # more than F: it leaves, with 3 N - 2 N
        one.step(1.0)
        assert one.get("x") == pytest.approx(0.5, abs=1e-12)
        assert one.get("der(x)") == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("step", [0.1, 2.0])
def test_a_pulse_in_time_gives_its_impulse(own, step):
    """2 N from 0.25 s to 0.5 s on 1 kg: 0.5 m/s, exactly, in steps that see it and in one that could
    step over it."""
    with instance(own("Pulse")) as one:
        one.start(tolerance=1e-6)
        while one.time < 2.0 - 1e-9:
            one.step(step)
        assert one.get("der(x)") == pytest.approx(0.5, abs=1e-13)
        assert one.get("x") == pytest.approx(0.5 * 2.0 - 0.5 * 0.375, abs=1e-12)


def test_stairs_of_a_force_are_climbed_one_by_one(own):
    """F floor(2 t/T): 0, 2, 4, 6 N for half a second each: 0 + 1 + 2 + 3 = 6 m/s after 2 s."""
    with instance(own("Stairs")) as one:
        one.start(tolerance=1e-6)
        one.step(2.0)
        assert one.get("der(x)") == pytest.approx(6.0, abs=1e-12)
        one.step(0.25)
        assert one.get("der(x,2)") == pytest.approx(8.0, abs=1e-12)


def test_a_force_that_an_input_switches_follows_it_at_once(own):
    """F sign(u): +2 N, 0 N, -2 N as soon as u is set, read before any step, and kept by a saved state."""
    with instance(own("Switched")) as one:
        one.start({"u": 0.3})
        one.step(0.5)
        assert one.get("der(x)") == pytest.approx(1.0, abs=1e-13)
        one.set("u", 0.0)
        one.step(0.5)
        assert one.get("der(x)") == pytest.approx(1.0, abs=1e-13)
        one.set("u", -1e-9)
        saved = one.fmu.getFMUstate()
        one.step(0.5)
        assert one.get("der(x)") == pytest.approx(0.0, abs=1e-13)
        one.fmu.setFMUstate(saved)
        one.time -= 0.5
        one.step(0.25)
        assert one.get("der(x)") == pytest.approx(0.5, abs=1e-13)


def test_a_gate_of_a_millimetre_is_not_flown_through(own):
    """2 N over 1 mm of the track at 100 m/s is 2 mJ: v^2 = 100^2 + 2 * 0.002, in one step of 1 s, of
    which the passage takes 1e-5."""
    with instance(own("Gate")) as one:
        one.start(tolerance=1e-8)
        one.step(1.0)
        assert one.get("der(x)") ** 2 - 100**2 == pytest.approx(2 * 0.002, rel=1e-6)


@pytest.mark.parametrize("begin", [0.0, 0.4])
def test_a_gate_that_an_input_moves_is_not_flown_through(own, begin):
    """x = t flies ahead of u = b t + a t^2/2 by up to (1 - b)^2/2 a at t = (1 - b)/a = 0.625 s; L is a part
    0.004 less: for 2 sqrt(0.004) 0.625 s, between two quarters of one step of 1 s, it feels 2 N."""
    with instance(own("Chased")) as one:
        rise = 1 - begin
        a = rise / 0.625
        one.start({"der(x)": 1.0, "L": rise**2 / (2 * a) * 0.996}, tolerance=1e-8)
        u = [one.variables["u"].valueReference]
        one.fmu.setRealInputDerivatives(u * 2, [1, 2], [begin, a])
        one.step(1.0)
        assert one.get("der(y)") == pytest.approx(4 * 0.625 * 0.004**0.5, rel=1e-6)


def test_what_a_departure_switches_on_is_read_with_it(own):
    """20 N are set on the first block: it lifts off, which pulls the second one up with 2 m g; read at once,
    both floors carry nothing, and both blocks accelerate."""
    with instance(own("Hung")) as one:
        one.start({"u": 0.0}, tolerance=1e-8)
        one.step(0.1)
        one.set("u", 20.0)
        assert one.get("der(x,2)") == pytest.approx(20 - G, rel=1e-12)
        assert one.get("der(y,2)") == pytest.approx(G, rel=1e-12)
        for floor_ in ("first", "second"):
            assert one.get(f"lambda.{floor_}") == 0
            assert not one.get(f"contact.{floor_}")


def test_a_force_that_jumps_lifts_a_block_at_once(own):
    """lambda = m g up to t = T/2, when the pull of 3 m g comes: the contact opens there, and the block
    goes up with 2 g."""
    with instance(own("Lifted")) as one:
        one.start(tolerance=1e-8)
        one.step(0.3)
        assert one.get("lambda.floor") == pytest.approx(G, rel=1e-12)
        one.step(0.7)
        assert one.get("departure.floor.count") == 1
        assert one.get("departure.floor.time") == pytest.approx(0.5, abs=1e-15)
        assert one.get("y") == pytest.approx(G * 0.5**2, rel=1e-12)


@pytest.mark.parametrize(
    ("name", "stop", "velocity"), [("Pulse", 2.0, 0.5), ("Stairs", 1.9, 5.4), ("Valley", 3.0, 2.0)]
)
def test_model_exchange_stops_at_the_jumps(own, name, stop, velocity):
    """fmpy's CVODE is told of each jump by an event indicator: the impulse of the pulse, the steps of the
    stairs, and x' = +2 m/s at the bottom of the valley on the way back."""
    run = simulate_fmu(
        str(own(name)),
        fmi_type="ModelExchange",
        stop_time=stop,
        output_interval=0.1,
        relative_tolerance=1e-9,
        output=["der(x)"],
    )
    assert abs(run["der(x)"][-1]) == pytest.approx(velocity, abs=1e-6)


# --------------------------------------------------------------------------- at build time


DRY = ("force on x", "velocity der(x)", "Friction", "tanh")


@pytest.mark.parametrize(
    ("force", "lagrangian", "parts"),
    [
        (-F * sign(v), 0, DRY),
        (Piecewise((-F, v > 0), (F, v < 0), (0, True)), 0, DRY),
        (-F * (2 * Heaviside(v) - 1) * Heaviside(x), 0, DRY),
        (-F * sign(v - L / T), 0, DRY),
        (F * floor(v * T / L), 0, DRY),
        (0, -F * L * Heaviside(x), ("energy jumps", "force on x is infinite", "Contact")),
    ],
)
def test_a_jump_in_a_velocity_or_an_energy_is_refused_by_name(force, lagrangian, parts):
    """Dry friction written as a force; V = F L H(x), which would give an infinite force at x = 0: the message
    names the force, the velocity and the remedy."""
    with pytest.raises(ModelError) as caught:
        prepare(cart("Refused", force, lagrangian))
    for part in parts:
        assert part in str(caught.value)


@pytest.mark.parametrize(
    ("force", "lagrangian"),
    [
        (Max(0, -k * x), 0),
        (-F * (v * T / L) * Abs(v * T / L), 0),
        (-F * (v * T / L) ** 2 * sign(v), 0),
        (Piecewise((k * (x - L), x > L), (0, True)), 0),
        (Piecewise((-F * v * T / L, v < L / T), (-F * (v * T / L) ** 2, True)), 0),
        (F * sign(1 + (v * T / L) ** 2), 0),
        (0, -k * Max(0, x - L) ** 2 / 2),
        (F * sign(k), 0),
    ],
)
def test_a_kink_is_no_jump(force, lagrangian):
    """Springs with play, drag in |v| v, a law in two pieces that meet: nothing is refused or watched."""
    prepared = prepare(cart("Kink", force, lagrangian))
    assert prepared.system.switches == ()


@pytest.mark.parametrize(
    ("force", "surfaces"),
    [
        (F * sign(x), {x}),
        (F * x / Abs(x), {x}),
        (F * Heaviside(x - L) * Heaviside(2 * L - x), {x - L, x - 2 * L}),
        (F * sign(cos(2 * pi * t / T)), {cos(2 * pi * t / T)}),
        (F * sign(u) + F * Heaviside(x * sign(x) - L), {u, x * sign(x) - L}),
        (F * Mod(t / T, 1), {t / T}),
    ],
)
def test_surfaces_of_jumps_are_found(force, surfaces):
    """h of each jump, up to its sign, in position, time and inputs."""
    eom = with_jumps(derive(cart("Jumps", force)))
    found = {s.h for s in jumps_of(Form(eom)).surfaces}
    expected = {s.xreplace(eom.symbols) for s in surfaces}
    assert {h if h in expected else -h for h in found} == expected


def test_the_equations_are_shown_as_they_were_written():
    """The page says sign(x), not what stands for it in the code."""
    [force] = prepare(cart("Signs", F * sign(x))).equations.F
    assert str(force) == "F*sign(x)"


def test_a_pulse_shorter_than_a_step_needs_a_word(built):
    """A smooth pulse of w = 1e-4 s gives a cart at rest F w sqrt(pi)/m, with solver.maximum_step = w as
    docs/events.md says; one that begins and ends by jumps arrives in full by itself."""
    w = symbols("w", positive=True)
    smooth = F * exp(-(((t - T / 3) / w) ** 2))
    square = F * (Heaviside(t - T / 3) - Heaviside(t - T / 3 - w))
    for force, step, expected in ((smooth, 1e-4, sqrt(pi)), (square, 0.0, 1)):
        model = Model(
            name="Pulse",
            lagrangian=m * v**2 / 2,
            coordinates={x: "m"},
            forces={x: force},
            parameters=[
                *(Parameter(m, 1.0, "kg"), Parameter(F, 2.0, "N"), Parameter(T, 1.0, "s")),
                Parameter(w, 1e-4, "s"),
            ],
            start={x: 0.0},
        )
        with instance(built(model)) as one:
            one.start({"solver.maximum_step": step})
            one.step(1.0)
            assert one.get("der(x)") == pytest.approx(2.0 * 1e-4 * float(expected), rel=1e-6)


def test_a_symbol_without_assumptions_may_say_when(built):
    """symbols("T") says nothing of T: the force F from T on moves the mass by F (t - T)^2/(2 m)."""
    x, (m, F, T) = dynamicsymbols("x"), symbols("m F T")
    model = Model(
        "Late",
        coordinates={x: "m"},
        lagrangian=m * x.diff() ** 2 / 2,
        forces={x: F * Heaviside(dynamicsymbols._t - T)},
        parameters=[Parameter(m, 1.0, "kg"), Parameter(F, 2.0, "N"), Parameter(T, 0.5, "s")],
    )
    assert simulate(built(model), 1.0)["x"][-1] == pytest.approx(0.25, rel=1e-12)
