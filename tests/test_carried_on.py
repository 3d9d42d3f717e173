"""What goes on from one call to the next: polynomials of inputs, the experiment, the order of events; and the
terms of Lagrange's equations that a plain pendulum does not have."""

from __future__ import annotations

from ctypes import byref, c_double, c_int, c_size_t

import pytest
import sympy as sp
from fmi2 import CO_SIMULATION, EXCHANGE, Library
from single import OK
from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass

from lagfmu import Contact, Holonomic, Input, Model, Parameter, derive

t = dynamicsymbols._t
x, y, F = dynamicsymbols("x y F")
m, k, c = symbols("m k c", positive=True)


@pytest.fixture
def pushed(built, library) -> Library:
    """m x'' = F."""
    model = point_mass("Pushed", "x", mass=2.0, forces={x: F}, inputs=[Input(F, "N")])
    return library(built(model))


@pytest.fixture
def ledges(built, library) -> Library:
    """Two balls over ground at 0, of e = 0 and e = 1: each falls freely and lands at its own time."""
    model = point_mass(
        "Ledges",
        "x y",
        [Contact("first", x), Contact("second", y, restitution=1)],
        up=x + y,
        mass=2.0,
        gravity=10.0,
        start={x: 0.21, y: 0.2},
    )
    return library(built(model))


def run_of_a_cubic(at: float) -> tuple[float, float]:
    """x and x' of 2 x'' = 3 + 4 t + 5 t^2/2 from rest."""
    return (3 * at**2 / 2 + 4 * at**3 / 6 + 5 * at**4 / 24) / 2, (
        3 * at + 2 * at**2 + 5 * at**3 / 6
    ) / 2


@pytest.mark.parametrize("restored", [False, True])
def test_an_input_goes_on_by_both_of_its_derivatives(pushed, restored):
    """F = 3 + 4 t + 5 t^2/2 set once holds over several steps, and through a saved state half-way: the time
    since it was set belongs to the state."""
    one = pushed().start(tolerance=1e-12)
    one.set("F", 3.0)
    one.push("F", 1, 4.0)
    one.push("F", 2, 5.0)
    for step in (0.3, 0.25):
        one.step(step)
    if restored:
        before, one = one, pushed().start(tolerance=1e-9)
        one.step(0.1)
        one.takes_over(before)
    one.step(0.45)
    place, speed = run_of_a_cubic(1.0)
    assert one.get("x") == pytest.approx(place, rel=1e-11)
    assert one.get("der(x)") == pytest.approx(speed, rel=1e-11)
    assert one.get("der(x,2)") == pytest.approx((3 + 4 + 2.5) / 2, rel=1e-11)


def test_a_force_set_anew_forgets_its_derivatives(pushed):
    """F = 3 + 4 t + 5 t^2/2, then F = 1 from t = 0.5 on: from there m x'' = 1."""
    one = pushed().start(tolerance=1e-12)
    one.set("F", 3.0)
    one.push("F", 1, 4.0)
    one.push("F", 2, 5.0)
    one.step(0.5)
    before = one.get("der(x)")
    one.set("F", 1.0)
    one.step(0.5)
    assert one.get("der(x)") - before == pytest.approx(0.25, rel=1e-11)


def test_an_acceleration_grows_with_the_force(pushed):
    """F = 3 + 4 t: fmi2GetRealOutputDerivatives gives F'/m = 2 m/s^3 for the acceleration, and 0 once F is
    set anew."""
    one = pushed().start(tolerance=1e-12)
    one.set("F", 3.0)
    one.push("F", 1, 4.0)
    one.step(0.5)
    found = c_double()
    which = one.references(["der(x,2)"]), c_size_t(1), byref(c_int(1)), byref(found)
    one.does("GetRealOutputDerivatives", *which)
    assert found.value == pytest.approx(2.0, rel=1e-12)
    one.set("F", 1.0)
    one.step(0.5)
    one.does("GetRealOutputDerivatives", *which)
    assert found.value == 0.0


def test_the_stop_time_belongs_to_the_saved_state(pushed):
    """A state saved in an experiment that ends at 1 s is not stepped past it, wherever it is restored; one
    saved in an experiment without an end is."""
    ends, endless = pushed().start(stop=1.0), pushed().start()
    with_end, without = ends.bytes_of(ends.saved()), endless.bytes_of(endless.saved())
    endless.does("SetFMUstate", endless.loaded(with_end))
    ends.does("SetFMUstate", ends.loaded(without))
    assert endless.call("DoStep", c_double(0), c_double(1.5), 1) != OK
    assert "stop time" in endless.log[-1][2]
    ends.does("DoStep", c_double(0), c_double(1.5), 1)


def test_tolerance_and_mode_belong_to_a_state_saved_before_the_start(library):
    """A state of the initialization with 1e-4, taken over by an instance that runs from 5 s to 6 s at 1e-12:
    it initializes, runs from 0 s at 1e-4 past a second, with the bits of the one that it was saved in."""
    pendulum = library("PendulumCartesian")
    one, other = pendulum(), pendulum()
    one.initializing(tolerance=1e-4)
    other.start(tolerance=1e-12, begin=5.0, stop=6.0)
    other.takes_over(one)
    for each in (one, other):
        each.does("ExitInitializationMode")
        each.step(2.0)
    assert other.outputs() == one.outputs()


def test_of_several_events_in_a_step_the_earliest_is_met_first(ledges):
    """x falls 0.21 m to rest; y, declared last, falls 0.2 m, lands first, at 0.2 s with -2 m/s, and goes up
    with 2 m/s: in one step over both landings."""
    one = ledges().start(tolerance=1e-10)
    one.step(0.5)
    assert one.reals(["x", "der(x)", "lambda.first"]) == pytest.approx([0, 0, 20], abs=1e-9)
    assert one.get("y") == pytest.approx(2 * 0.3 - 5 * 0.3**2, abs=1e-8)
    assert one.get("der(y)") == pytest.approx(2 - 10 * 0.3, abs=1e-8)


@pytest.mark.parametrize("kind", [CO_SIMULATION, EXCHANGE])
def test_what_was_read_in_initialization_does_not_outlive_what_is_set(pushed, ledges, kind):
    """lambda and the energy are read, the start is moved, and they are read again: those of the new start."""
    one = ledges(kind=kind)
    one.initializing()
    assert one.get("energy.potential") == pytest.approx(2 * 10 * 0.41)
    one.set("y", 0.7)
    assert one.get("energy.potential") == pytest.approx(2 * 10 * 0.91)
    one.set("x", 0.0)
    assert one.get("lambda.first") == pytest.approx(20.0)
    one.set("m", 3.0)
    assert one.get("lambda.first") == pytest.approx(30.0)
    one.does("ExitInitializationMode")
    assert one.reals(["x", "y", "lambda.first"]) == pytest.approx([0, 0.7, 30.0])


def test_the_pull_of_a_rod_changes_as_its_closed_form_does(library):
    """lambda = -m (v^2 - g y)/(2 (x^2 + y^2)) of the pendulum (y upwards: + g y in the bracket), also beside
    the circle: its derivatives by x, y and the velocities."""
    one = library("PendulumCartesian")().start(tolerance=1e-10)
    one.step(0.4)
    names = ["x", "y", "der(x)", "der(y)"]
    state = dict(zip(sp.symbols("X Y U V"), one.reals(names), strict=True))
    X, Y, U, V = state
    mass, gravity = one.get("m"), one.get("g")
    own = one.get("lambda.rod")
    formulas = [
        -mass * (U**2 + V**2 + sign * gravity * Y) / (2 * (X**2 + Y**2)) for sign in (1, -1)
    ]
    formula = min(formulas, key=lambda f: abs(float(f.subs(state)) - own))
    assert float(formula.subs(state)) == pytest.approx(own, rel=1e-9)
    for name, symbol in zip(names, state, strict=True):
        (found,) = one.directional(["lambda.rod"], [name], [1.0])
        assert found == pytest.approx(float(formula.diff(symbol).subs(state)), rel=1e-8, abs=1e-9)


# ------------------------------------------------------------------ model exchange


def test_drift_dies_out_as_fast_as_it_can_without_ringing(library):
    """f'' = -2 alpha f' - alpha^2 f of f = x^2 + y^2 - L^2: critically damped, (f''/f')^2 = 4 (-f''/f)."""
    one = library("PendulumCartesian").continuous()
    px, vx, py, vy = one.array("GetContinuousStates", 4)

    def bend(*state: float) -> float:
        """f'' from the derivatives that the importer gets."""
        one.states(state)
        _, ax, _, ay = one.array("GetDerivatives", 4)
        return 2 * (state[0] * ax + state[2] * ay + state[1] ** 2 + state[3] ** 2)

    length = px**2 + py**2
    slipping = bend(px, vx + 1e-3 * px, py, vy + 1e-3 * py) / (2e-3 * length)
    grown = bend(1.001 * px, vx, 1.001 * py, vy) / ((1.001**2 - 1) * length)
    assert slipping < 0
    assert slipping**2 == pytest.approx(-4 * grown, rel=1e-6)


def test_a_body_that_touches_has_not_passed_its_ground(ledges):
    """The indicator of an open contact is positive where f = 0 to rounding, and negative a nanometre of
    its drop below: the importer finds the landing behind the touch, never before."""
    one = ledges.continuous()
    for height, sign in ((0.1, 1), (0.0, 1), (-1e-6, -1)):
        one.states((height, -1.0, 0.2, 0.0))
        first, second = one.array("GetEventIndicators", 2)
        assert first * sign > 0
        assert second == pytest.approx(0.2, abs=1e-6)


def test_a_body_that_lies_below_its_ground_is_lifted(ledges):
    """An importer's step ends at rest under the ground: the event lifts it to f >= 0, where it stays."""
    one = ledges.continuous()
    one.states((-1e-6, 0.0, 0.2, 0.0))
    assert one.meets_event().values
    height, speed, *_ = one.array("GetContinuousStates", 4)
    assert height == pytest.approx(0, abs=1e-12)
    assert speed == 0
    assert one.get("lambda.first") == pytest.approx(20.0)


# ------------------------------------------------------------------ Lagrange's equations, in symbols


MOVING = {
    "kinetic_energy": m * (x.diff() ** 2 + y.diff() ** 2) / 2,
    "coordinates": {x: "m", y: "m"},
}
ALONE = {"kinetic_energy": m * x.diff() ** 2 / 2}
TERMS = {  # the model, the units of its parameters, and what is zero in its equations
    # d/dt (m + c t) x' = 0: the momentum is kept, so that (m + c t) x'' = -c x'
    "mass that grows slows what moves": (
        {"lagrangian": (m + c * t) * x.diff() ** 2 / 2, "coordinates": {x: "m"}},
        {m: "kg", c: "kg/s"},
        lambda e: [e.F[0] + c * e.v[0], e.M[0, 0] - (m + c * t)],
    ),
    # T = m (x' + y')^2/2 = (m x'^2 + 2 m x' y' + m y'^2)/2, whatever part of M is stored
    "kinetic energy counts a coupling once": (
        {"lagrangian": m * (x.diff() + y.diff()) ** 2 / 2, "coordinates": {x: "m", y: "m"}},
        {m: "kg"},
        lambda e: [e.kinetic - m * (e.v[0] + e.v[1]) ** 2 / 2],
    ),
    # L = m (x'^2 + y'^2)/2 + m cos(x - y) x' y': F_x = -m sin(x - y) y'^2, F_y = m sin(x - y) x'^2
    "Coriolis terms of a coupling stand in both equations": (
        {
            "lagrangian": m * (x.diff() ** 2 + y.diff() ** 2) / 2
            + m * cos(x - y) * x.diff() * y.diff(),
            "coordinates": {x: "rad", y: "rad"},
        },
        {m: "kg*m^2"},
        lambda e: [
            e.F[0] + m * sin(e.q[0] - e.q[1]) * e.v[1] ** 2,
            e.F[1] - m * sin(e.q[0] - e.q[1]) * e.v[0] ** 2,
        ],
    ),
    # (-k x - k y, -k x) is the gradient of k (x^2/2 + x y)
    "forces without a curl have a potential": (
        {**MOVING, "forces": {x: -k * x - k * y, y: -k * x}},
        {m: "kg", k: "N/m"},
        lambda e: [e.potential - k * (e.q[0] ** 2 / 2 + e.q[0] * e.q[1])],
    ),
    # -k x - c x' has the potential k x^2/2, the damper none
    "a force that depends on the velocity stores nothing": (
        {**ALONE, "coordinates": {x: "m"}, "forces": {x: -k * x - c * x.diff()}},
        {m: "kg", k: "N/m", c: "N*s/m"},
        lambda e: [e.potential - k * e.q[0] ** 2 / 2],
    ),
    # f = x - y c t^2/2: f'' = x'' - c (t^2 y''/2 + 2 t y' + y), hence gamma = c (2 t y' + y)
    "a moving constraint accelerates by all of its terms": (
        {**MOVING, "constraints": [Holonomic("wedge", x - y * c * t**2 / 2)]},
        {m: "kg", c: "1/s^2"},
        lambda e: [e.gamma[0] - c * (2 * t * e.v[1] + e.q[1]), e.nu[0] - c * t * e.q[1]],
    ),
}


def equations(fields, units):
    parameters = [Parameter(s, 1.0, u) for s, u in units.items()]
    return derive(Model(name="Terms", parameters=parameters, **fields))


@pytest.mark.parametrize("fact", TERMS)
def test_lagranges_equations_hold_every_term(fact):
    """Time, couplings and velocities in L, in forces and in a constraint, each by its own derivative."""
    fields, units, zero = TERMS[fact]
    for e in zero(equations(fields, units)):
        assert sp.simplify(e) == 0


@pytest.mark.parametrize(
    ("fields", "units"),
    [
        # (-k y, k x) does work on the way round
        ({**MOVING, "forces": {x: -k * y, y: k * x}}, {m: "kg", k: "N/m"}),
        # -k exp(sin x) has an integral, but none that can be written down
        (
            {**ALONE, "coordinates": {x: "rad"}, "forces": {x: -k * sp.exp(sin(x))}},
            {m: "kg*m^2", k: "N*m"},
        ),
    ],
    ids=["a curl", "no formula"],
)
def test_a_force_without_a_potential_has_none(fields, units):
    """No energy is reported that a force does not store."""
    assert equations(fields, units).potential is None
