"""Bad input: one clear message that names the thing, its value, what was expected and the remedy."""

from __future__ import annotations

import contextlib
import io
import math
import os
import subprocess
import sys
import warnings
import zipfile
from pathlib import Path

import fmpy
import pytest
from fmpy.fmi1 import FMICallException
from instance import instance
from pythonfmu.builder import FmuBuilder
from rich.console import Console
from sympy import Abs, Eq, I, Matrix, Max, Piecewise, cos, exp, oo, sin, sqrt, symbols
from sympy.physics.mechanics import ReferenceFrame, dynamicsymbols

from lagfmu import (
    Contact,
    Embedding,
    Holonomic,
    Input,
    LagfmuError,
    Model,
    Nonholonomic,
    Output,
    Parameter,
    Scene,
    build_fmu,
    derive,
    multiplier,
    simulate,
    verify,
)
from lagfmu.errors import BuildError, DerivationError, ModelError, VerificationError
from lagfmu.testing import RedundantConstraintWarning, load, prepare
from lagfmu.testing import show_in as show

DISCARD, ERROR, FATAL = 2, 3, 4

t = dynamicsymbols._t
x, y, z, theta = dynamicsymbols("x y z theta")
m, g, L = symbols("m g L", positive=True)
K = m * (x.diff() ** 2 + y.diff() ** 2) / 2
ROD = Holonomic("rod", x**2 + y**2 - L**2)
CONSTANTS = (Parameter(m, 1.0, "kg"), Parameter(g, 9.81, "m/s^2"), Parameter(L, 1.0, "m"))


def pendulum(**changes) -> Model:
    """A good pendulum, with one thing changed."""
    fields = {
        "name": "Pendulum",
        "lagrangian": K - m * g * y,
        "coordinates": {x: "m", y: "m"},
        "parameters": CONSTANTS,
        "constraints": [ROD],
        "start": {x: 0.6, y: -0.8},
    }
    return Model(**(fields | changes))


def refusal(call, kind=LagfmuError) -> str:
    """The message with which `call` is refused."""
    with pytest.raises(kind) as caught:
        call()
    return str(caught.value)


def says(message: str, *parts: str) -> None:
    """Every part stands in the message."""
    for part in parts:
        assert part in message, f"{part!r} is missing in {message!r}"


# ---------------------------------------------------------------------------- expressions


@pytest.mark.parametrize(
    ("changes", "parts"),
    [
        ({"lagrangian": K - m * g * y**2}, ("lagrangian", "g*m*y**2", "kg.m3/s2", "J", "factor")),
        ({"forces": {x: m * g * x}}, ("force on x", "g*m*x", "J/m", "factor")),
        (
            {"constraints": [Holonomic("rod", x**2 + y - L**2)]},
            ("constraint 'rod'", "'y' (unit m)", "m2", "factor"),
        ),
        (
            {"constraints": [Holonomic("wave", sin(x) - y / L)]},
            ("constraint 'wave'", "sin(x)", "has unit m", "dimensionless", "divide"),
        ),
    ],
)
def test_a_term_of_the_wrong_dimension_is_named(changes, parts):
    """The term, its unit, the unit that was expected and what to do stand in the message."""
    says(refusal(lambda: pendulum(**changes), ModelError), *parts)


def test_an_undeclared_symbol_is_named():
    """A spring constant that nobody declared, and a coordinate that is none."""
    k = symbols("k_spring", positive=True)
    message = refusal(lambda: pendulum(lagrangian=K - m * g * y - k * z**2 / 2), ModelError)
    says(
        message, "2 problems", "k_spring", "z is neither coordinate, parameter nor input", "declare"
    )


def test_a_symbol_with_other_assumptions_is_told_from_an_undeclared_one():
    """symbols('g') is not symbols('g', positive=True), though both print as g."""
    says(refusal(lambda: pendulum(lagrangian=K - m * symbols("g") * y)), "g is", "use the same")


N = ReferenceFrame("N")


@pytest.mark.parametrize(
    ("changes", "parts"),
    [
        (  # no else
            {"lagrangian": K - m * g * Piecewise((y, y > 0))},
            ("lagrangian", "Piecewise", "(value, True)"),
        ),
        (  # |x| has no second derivative at 0
            {"constraints": [Holonomic("rod", Abs(x) - L)]},
            ("constraint 'rod'", "Abs(x)", "kink", "Contact for each side"),
        ),
        ({"constraints": [Contact("wall", Max(x, y) - L)]}, ("constraint 'wall'", "Max(x, y)")),
        (  # its gradient is 2 f grad f
            {"constraints": [Holonomic("rod", (x**2 + y**2 - L**2) ** 2)]},
            ("constraint 'rod'", "gradient", "squared"),
        ),
        ({"start": {"x": 0.6, y: -0.8}}, ("start", "text 'x'", "write x without quotes")),
        ({"start": {"der(x)": 0.6, y: -0.8}}, ("text 'der(x)'", "write x without", ".diff()")),
        (
            {"constraints": [Holonomic("pin", Matrix([x - L, y]))]},
            ("constraint 'pin' is a matrix", "each of its components"),
        ),
        (
            {"constraints": [Holonomic("pin", (x - L) * N.x + y * N.y)]},
            ("constraint 'pin' is a vector", "r.dot(N.x)"),
        ),
        (
            {"parameters": (Parameter(m, True, "kg"), *CONSTANTS[1:])},
            ("parameter 'm' is True", "finite number"),
        ),
        (  # a text, though it reads like a number
            {"parameters": (Parameter(m, "1.0", "kg"), *CONSTANTS[1:])},
            ("parameter 'm' is '1.0'", "finite number, without quotes"),
        ),
        (
            {"parameters": (Parameter(m, 1.0, "kg", min="0", max=3), *CONSTANTS[1:])},
            ("min of parameter 'm' is '0'", "without quotes"),
        ),
        ({"start": {x: "0.6", y: -0.8}}, ("start of x is '0.6'", "without quotes")),
    ],
)
def test_what_cannot_be_used_is_told_with_what_to_write_instead(changes, parts):
    """No value somewhere, no second derivative, a gradient that vanishes, a text for a symbol: in words."""
    says(refusal(lambda: prepare(pendulum(**changes))), *parts)


def test_a_kink_that_does_not_move_is_no_kink():
    """|L| of a parameter is a number; x^2 (y - L) is a product, and vanishes with a gradient at y = L."""
    for f in (x**2 + y**2 - Abs(L) ** 2, (x**2 + L**2) * (y + L * sqrt(1) * 4 / 5)):
        prepare(pendulum(constraints=[Holonomic("rod", f)]))


@pytest.mark.parametrize("coordinates", [[x, y], {x: "", y: "  "}, {x: None, y: 3}])
def test_coordinates_without_a_unit_are_refused(coordinates):
    """A list, empty texts and things that are no text: each coordinate is named."""
    message = refusal(lambda: pendulum(coordinates=coordinates), ModelError)
    says(message, "coordinate 'x' has no unit", "coordinate 'y' has no unit", "give one, e.g. 'm'")


@pytest.mark.parametrize(
    ("unit", "parts"),
    [
        ("deg", ("lagrangian", "must have unit")),
        ("furlongs/fort", ("'x'", "not a unit", "'m'", "correct")),
        ("degC", ("'x'", "offset", "'K'")),
    ],
)
def test_a_unit_that_does_not_fit_is_refused(unit, parts):
    """An angle for a length, a word that is no unit, a scale with an offset."""
    says(refusal(lambda: pendulum(coordinates={x: unit, y: "m"}), ModelError), *parts)


@pytest.mark.parametrize(
    ("changes", "parts"),
    [
        ({"lagrangian": "K - V("}, ("lagrangian", "K - V(", "no SymPy expression", "str")),
        ({"lagrangian": None}, ("neither lagrangian nor kinetic_energy",)),
        ({"kinetic_energy": K}, ("both lagrangian and kinetic_energy",)),
        ({"constraints": [x**2 - L**2]}, ("constraints hold", "expected Holonomic", "write")),
        ({"constraints": [Holonomic("c", Eq(x, L))]}, ("constraint 'c'", "Eq(", "vanishes")),
        ({"constraints": [Contact("c", x >= L)]}, ("constraint 'c'", ">=", "vanishes")),
        ({"constraints": [Holonomic("c", L)]}, ("constraint 'c'", "L holds no coordinate")),
        ({"parameters": {m: 1.0}}, ("parameters hold m", "expected Parameter")),
        ({"parameters": [Parameter("m", 1.0, "kg")]}, ("parameter 'm'", "sympy.symbols")),
        ({"coordinates": {symbols("x"): "m"}}, ("coordinate x", "dynamicsymbols('x')")),
        ({"coordinates": {}}, ("no coordinate",)),
        ({"start": {z: 1.0, x.diff(t, 2): 3.0}}, ("start names z", "start names der(x,2)")),
        ({"forces": {z: m * g}}, ("force is given on z", "no coordinate")),
        ({"lagrangian": K + m * x * x.diff(t, 2)}, ("lagrangian", "order 2", "at most 1")),
        ({"constraints": [Holonomic("c", x.diff())]}, ("'c'", "order 1", "Nonholonomic")),
        (
            {"constraints": [Holonomic("rod", ROD.expression, while_closed="floor")]},
            ("'rod'", "while_closed='floor'", "contacts: none"),
        ),
        ({"forces": [m * g]}, ("forces = [g*m]", "expected a dict", "forces={x: F}")),
        ({"start": [1.0]}, ("start = [1.0]", "expected a dict")),
        ({"constraints": ROD}, ("constraints = Holonomic", "expected a list", "[Holonomic(...)]")),
        ({"parameters": None}, ("parameters = None", "expected a list")),
        ({"embedding": {x: L * sin(theta)}}, ("embedding = {", "expected Embedding(")),
        ({"embedding": Embedding([theta], {x: L})}, ("embedding coordinates", "expected a dict")),
        ({"lagrangian": K - I * m * g * y}, ("lagrangian", "holds I", "real and finite")),
        ({"forces": {x: m * g * oo}}, ("force on x", "holds oo", "real and finite")),
        ({"description": 5}, ("description of the model is 5", "expected a text")),
        (
            {"constraints": [Contact("floor", y, restitution=symbols("e"))]},
            ("restitution of 'floor'", "e is neither"),
        ),
    ],
)
def test_a_thing_in_the_wrong_place_is_named(changes, parts):
    """No traceback from the depths of SymPy: the field, what stands in it, what belongs there."""
    says(refusal(lambda: pendulum(**changes), ModelError), *parts)


def test_a_constraint_that_is_nonlinear_in_the_velocities_is_refused():
    """A prescribed speed v^2 = g L is no Pfaffian form."""
    model = pendulum(constraints=[Nonholonomic("speed", x.diff() ** 2 + y.diff() ** 2 - g * L)])
    says(refusal(lambda: derive(model)), "'speed'", "nonlinear in the velocities", "a_j(q, t) v_j")
    model = pendulum(constraints=[Nonholonomic("place", x - L)])
    says(refusal(lambda: derive(model)), "'place'", "no velocity", "Holonomic")


def test_an_energy_that_is_not_quadratic_in_the_velocities_is_refused():
    """The term is named."""
    model = pendulum(lagrangian=K - m * g * y + m * x.diff() ** 3 / sqrt(g * L))
    says(refusal(lambda: derive(model)), "der(x)**3", "not quadratic", "forces")


# ---------------------------------------------------------------------------- constraints


def test_a_constraint_that_no_configuration_satisfies_is_refused():
    """x^2 + y^2 + L^2 = 0 has no real solution, whatever the start values are."""
    rod = Holonomic("rod", x**2 + y**2 + L**2)
    model = pendulum(constraints=[rod], start={x: 0.6, y: -0.8})
    message = refusal(lambda: prepare(model), ModelError)
    says(message, "'rod'", "no configuration", "expected 0", "correct its expression")


def test_start_values_that_cannot_be_projected_are_refused_with_an_example_that_can():
    """At x = y = 0 the rod's gradient is zero: no direction leads to the circle.  Where nobody gave these
    zeros, they are asked for."""
    message = refusal(lambda: prepare(pendulum(start={x: 0.0, y: 0.0})), ModelError)
    says(message, "x = 0.0, y = 0.0", "cannot be projected", "'rod' by -1", "for example x = ")
    message = refusal(lambda: prepare(pendulum(start={})), ModelError)
    says(message, "'rod', missed by -1", "give x and y a start value")


def test_contradictory_constraints_are_refused():
    """x = 0.5 and x = 1 cannot both hold; the third, innocent constraint is not named."""
    a, b = symbols("a b", real=True)
    places = (Parameter(a, 0.5, "m"), Parameter(b, 1.0, "m"))
    model = pendulum(
        constraints=[Holonomic("one", x - a), Holonomic("level", y), Holonomic("two", x - b)],
        parameters=(*CONSTANTS, *places),
    )
    message = refusal(lambda: prepare(model), ModelError)
    says(message, "'one', 'two'", "contradict each other", "leave one out")
    assert "level" not in message


def test_contradictory_velocities_are_refused():
    """x' = 0.5 and x' = 1 cannot both hold."""
    a, b = symbols("a b", real=True)
    speeds = (Parameter(a, 0.5, "m/s"), Parameter(b, 1.0, "m/s"))
    model = pendulum(
        constraints=[Nonholonomic("one", x.diff() - a), Nonholonomic("two", x.diff() - b)],
        parameters=(*CONSTANTS, *speeds),
    )
    says(
        refusal(lambda: prepare(model), ModelError),
        "'one', 'two'",
        "no velocities",
        "leave one out",
    )


def test_contradictory_accelerations_are_refused():
    """x = 0 and x = g t^2/2 agree in place and speed at the start, and part at once."""
    model = pendulum(
        constraints=[
            Holonomic("one", x),
            Holonomic("level", y),
            Holonomic("two", x - g * t**2 / 2),
        ],
        start={},
    )
    message = refusal(lambda: prepare(model), ModelError)
    says(message, "'one', 'two'", "no accelerations", "leave one out")
    assert "level" not in message


def test_a_redundant_constraint_warns_and_its_multipliers_share_the_force(tmp_path):
    """Two equal rods carry half the tension each; that split is flagged, Q is right."""
    again = Holonomic("again", ROD.expression)
    with pytest.warns(RedundantConstraintWarning, match="'again' follows from the others"):
        path = build_fmu(pendulum(constraints=[ROD, again]), tmp_path, check=False)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        one = simulate(prepare(pendulum()), stop_time=0.5)
    two = simulate(path, stop_time=0.5)
    assert two["lambda.rod"] == pytest.approx(one["lambda.rod"] / 2, rel=1e-6)
    assert two["lambda.again"] == pytest.approx(two["lambda.rod"], rel=1e-12)
    assert not two["unique.rod"].any()
    assert not two["unique.again"].any()
    assert one["unique.rod"].all()
    for name in ("Q.x", "Q.y", "x", "y"):
        assert two[name] == pytest.approx(one[name], rel=1e-6, abs=1e-7)


def test_walls_that_cannot_be_touched_at_once_are_not_redundant():
    """A bob between two walls, and in the angle of three: each wall's normal follows from the others', and
    none is touched with those, so that no lambda is ever shared.  A second floor at the same height is."""
    walls = [Contact("left", x + L), Contact("right", 2 * L - x), Contact("floor", y + 2 * L)]
    walls.append(Contact("roof", 5 * L - x - y))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        structure = prepare(pendulum(constraints=walls)).structure
    assert structure.redundant == structure.shared == ()
    assert structure.rank == 2
    below = Contact("below", 2 * y + 4 * L)
    with pytest.warns(RedundantConstraintWarning, match="'below' follows from the others"):
        structure = prepare(pendulum(constraints=[*walls, below])).structure
    assert structure.shared == ("floor", "below")


def test_the_multipliers_that_are_not_unique_are_named_and_no_others():
    """Of two equal rods and a plane only the rods' lambda is shared, though one alone is redundant; `show`
    says so, and which norm is the least."""
    rods = [ROD, Holonomic("again", ROD.expression), Holonomic("plane", z)]
    with pytest.warns(RedundantConstraintWarning, match="lambda of 'rod', 'again' is shared"):
        made = prepare(
            pendulum(
                lagrangian=K + m * z.diff() ** 2 / 2 - m * g * y,
                coordinates={x: "m", y: "m", z: "m"},
                constraints=rods,
            )
        )
    assert made.structure.redundant == ("again",)
    assert made.structure.shared == ("rod", "again")
    console = Console(file=io.StringIO(), width=100)
    show(made, console)
    says(
        console.file.getvalue(), "redundant: again; λ is not unique for rod, again", "g M⁻¹ gᵀ = 1"
    )


def test_a_coordinate_without_mass_is_refused():
    """Nothing determines y'': the coordinate is named."""
    slider = {"lagrangian": m * x.diff() ** 2 / 2 - m * g * y, "constraints": []}
    message = refusal(lambda: prepare(pendulum(**slider)), ModelError)
    says(message, "mass matrix is singular", "'y'", "give it a mass")


def test_negative_kinetic_energy_is_refused():
    """L = V - T gives every coordinate a negative mass: pushed to the right, it would go to the left."""
    message = refusal(lambda: prepare(pendulum(lagrangian=-K - m * g * y)), ModelError)
    says(message, "kinetic energy is negative", "'x' is -1", "'y' is -1", "sign of T in L = T - V")
    one = m * (x.diff() ** 2 - y.diff() ** 2) / 2 - m * g * y
    message = refusal(lambda: prepare(pendulum(lagrangian=one)), ModelError)
    says(message, "the mass of 'y' is -1 ")
    assert "'x' is" not in message


@pytest.mark.parametrize("coupling", [1.5, -1.5])
def test_indefinite_kinetic_energy_is_refused(coupling):
    """T = m (x'^2 + y'^2)/2 + c m x' y' is negative along x' = -y' (or x' = y') where |c| > 1."""
    lagrangian = K + coupling * m * x.diff() * y.diff() - m * g * y
    message = refusal(lambda: prepare(pendulum(lagrangian=lagrangian)), ModelError)
    says(message, "negative where 'x', 'y' move together", "eigenvalue -0.5 ", "L = T - V")


def test_the_value_of_a_parameter_decides_whether_kinetic_energy_is_negative():
    """With |c| < 1 the same T is positive; with |c| = 1 there is a motion without mass, no negative one."""
    c = symbols("c")
    lagrangian = K + c * m * x.diff() * y.diff() - m * g * y

    def model(value):
        return pendulum(lagrangian=lagrangian, parameters=(*CONSTANTS, Parameter(c, value)))

    for value in (0.5, 1.0):
        assert prepare(model(value)).structure.degrees_of_freedom == 1
    says(refusal(lambda: prepare(model(2.0)), ModelError), "eigenvalue -1 ")


def test_mass_that_vanishes_at_the_start_is_no_negative_one():
    """A folded linkage: m L^2 (0.3 + 3 c cos(theta)) is 0 at theta = pi, and -6e-17 kg m^2 in doubles."""
    c = symbols("c")
    assert 0.3 + 3 * 0.1 * math.cos(math.pi) < 0
    folded = m * L**2 * (0.3 + 3 * c * cos(theta)) * theta.diff() ** 2 + m * x.diff() ** 2 / 2
    made = Model(
        name="Folded",
        lagrangian=folded - m * g * x,
        coordinates={x: "m", theta: "rad"},
        parameters=(*CONSTANTS, Parameter(c, 0.1)),
        constraints=[Holonomic("band", x - L * theta)],
        start={x: math.pi, theta: math.pi},
    )
    assert prepare(made).structure.degrees_of_freedom == 1


def test_a_massless_coordinate_that_a_constraint_determines_is_fine():
    """M = diag(m, 0) with x = y: the motion is free fall, and lambda_x is the whole weight."""
    link = {"lagrangian": m * x.diff() ** 2 / 2 - m * g * x, "constraints": [Holonomic("c", x - y)]}
    run = simulate(prepare(pendulum(**link, start={})), stop_time=1.0)
    assert run["y"][-1] == pytest.approx(-9.81 / 2, rel=1e-9)
    assert run["lambda.c"] == pytest.approx(0.0, abs=1e-12)


def test_an_embedding_that_violates_the_constraint_is_refused():
    """x = L sin(theta), y = 2 L cos(theta) is an ellipse, not the rod's circle."""
    ellipse = Embedding({theta: "rad"}, {x: L * sin(theta), y: 2 * L * cos(theta)})
    scene = Scene("P", formulation="minimal")
    message = refusal(lambda: prepare(pendulum(embedding=ellipse), scene), DerivationError)
    says(message, "embedding", "'rod' becomes", "expected 0", "correct")


def test_an_embedding_with_dependent_coordinates_is_refused():
    """theta and z only turn by their sum."""
    z_and_theta = Embedding(
        {theta: "rad", z: "rad"}, {x: L * sin(theta + z), y: L * cos(theta + z)}
    )
    scene = Scene("P", formulation="minimal")
    message = refusal(lambda: prepare(pendulum(embedding=z_and_theta), scene), DerivationError)
    says(message, "theta, z", "not independent")


def test_all_that_is_wrong_with_an_embedding_is_listed():
    """Unknown symbols, units, coordinates and numbers that are none."""
    wrong = Embedding({theta: "rad"}, {x: symbols("k") * L, z: L}, {theta: math.nan, y: 1.0})
    message = refusal(lambda: pendulum(embedding=wrong), ModelError)
    says(message, "4 problems", "embedding of x: k is", "gives z", "start names y", "theta is nan")


def test_a_minimal_formulation_that_does_not_exist_is_refused():
    """x^2 + y^2 - L^2 is linear in no coordinate, and no embedding is given."""
    message = refusal(lambda: prepare(pendulum(), Scene("P", formulation="minimal")))
    says(message, "scene 'P'", "no minimal formulation", "Embedding", "'multipliers'")


def test_a_multiplier_of_a_constraint_without_a_unit_is_not_blamed():
    """Where the terms of a constraint disagree, that alone is told, not that its lambda has no unit."""
    mixed = Holonomic("rod", x**2 + y - L)
    push = Output("push", multiplier("rod"), "N")
    message = refusal(lambda: pendulum(constraints=[mixed], outputs=[push]), ModelError)
    says(message, "1 problem:", "constraint 'rod'", "unit m2")
    assert "'push'" not in message


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        ({"formulation": "maximal"}, ("'maximal'", "multipliers, nullspace, minimal")),
        ({"method": "euler"}, ("'euler'", "dop853, rk4, radau5")),
        ({"stop_time": math.nan}, ("stop_time = nan", "positive")),
        ({"step_size": 0.0}, ("step_size = 0.0", "positive")),
        ({"tolerance": -1e-8}, ("tolerance = -1e-08", "positive")),
        ({"tolerance": 1000.0}, ("tolerance = 1000.0", "at most 0.1")),
        ({"tolerance": "1e-6"}, ("tolerance = '1e-6'", "positive number")),
        ({"stop_time": "4"}, ("stop_time = '4'", "positive number")),
        ({"step": "0.1"}, ("step = '0.1'", "positive number")),
        ({"name": "my scene"}, ("'my scene'", "not a name that FMI allows")),
    ],
)
def test_a_scene_that_cannot_be_is_refused(change, parts):
    """The field, its value and what is known."""
    says(refusal(lambda: Scene(**({"name": "P"} | change)), ModelError), *parts)


# ---------------------------------------------------------------------------- names and numbers


def test_names_that_collide_are_refused():
    """A parameter called as a coordinate, a constraint called as one, two of one name."""
    message = refusal(
        lambda: pendulum(
            parameters=(*CONSTANTS, Parameter(symbols("x"), 1.0, "m")),
            constraints=[Holonomic("y", ROD.expression), ROD, ROD],
        ),
        ModelError,
    )
    says(message, "'x' is used twice, by a coordinate and a parameter", "constraint 'y'", "'Q.y'")
    says(message, "two constraints are called 'rod'", "rename")


@pytest.mark.parametrize(
    ("coordinate", "parameter", "parts"),
    [
        ("angle.A", "m", ("'angle.A' has 2 words", "three", "'crank.position.x'")),
        ("bob.position.x", "bob", ("'bob' is a parameter", "'bob.position.x'", "group", "rename")),
        ("Q.position.x", "m", ("'Q.position.x' is reserved", "choose another")),
        ("bob..x", "m", ("'bob..x' is not a name that FMI allows", "'crank.mass'")),
    ],
)
def test_names_of_several_words_stay_of_one_meaning(coordinate, parameter, parts):
    """Q.A.B is the share of a constraint A in the force on B, bob no variable beside bob.mass."""
    c, mass = dynamicsymbols(coordinate), symbols(parameter, positive=True)
    message = refusal(
        lambda: Model(
            name="P",
            lagrangian=mass * c.diff() ** 2 / 2,
            coordinates={c: "m"},
            parameters=[Parameter(mass, 1.0, "kg")],
        ),
        ModelError,
    )
    says(message, *parts)


@pytest.mark.parametrize("name", ["velocity", "time", "t", "der", "count", "solver", "lambda"])
def test_names_of_the_fmus_own_variables_are_refused(name):
    """departure.surface.velocity.theta must stay one thing."""
    c = dynamicsymbols(name)
    message = refusal(
        lambda: Model(
            name="P",
            lagrangian=m * c.diff() ** 2 / 2,
            coordinates={c: "m"},
            parameters=[CONSTANTS[0]],
        ),
        ModelError,
    )
    says(message, f"{name!r} is reserved", "choose another")


@pytest.mark.parametrize(
    "name", ["", "my model", 'the "rod"', "a<b", "θ", "1st", "a..b", "a\n", None]
)
def test_names_that_are_no_fmi_names_are_refused(name):
    """Of a model and of a constraint; the allowed characters are told."""
    message = refusal(
        lambda: pendulum(name=name, constraints=[Holonomic(name, ROD.expression)]), ModelError
    )
    says(message, f"model name {name!r}", f"constraint name {name!r}", "use letters a-z")


def test_symbols_that_are_no_fmi_names_are_refused():
    """LaTeX and Greek symbols are fine in SymPy, not in an FMU."""
    angle, tau = dynamicsymbols("θ"), symbols(r"\tau")
    message = refusal(
        lambda: Model(
            name="P",
            lagrangian=tau * angle.diff() ** 2 / 2,
            coordinates={angle: "rad"},
            parameters=[Parameter(tau, 1.0, "kg.m^2")],
        ),
        ModelError,
    )
    says(message, "coordinate name 'θ'", repr(r"\tau"))


def test_names_that_mean_something_in_python_are_fine(tmp_path):
    """Parameters called q, p, sqrt, def and lambda_ do not disturb the generated code."""
    names = [symbols(n, positive=True) for n in ("q", "p", "sqrt", "def", "lambda_", "u")]
    factor = names[0] * names[1] * names[2] * names[3] * names[4] * names[5]
    model = pendulum(
        lagrangian=K - m * g * y * factor,
        parameters=(*CONSTANTS, *(Parameter(n, 1.0, "1") for n in names)),
    )
    run = simulate(build_fmu(model, tmp_path, check=False), stop_time=0.2)
    assert run["x"] == pytest.approx(simulate(pendulum(), stop_time=0.2)["x"], rel=1e-9)


@pytest.mark.parametrize("sign", ["\x00", "\x1b", "\ufffe", "\ud800"])
def test_descriptions_that_no_xml_file_can_hold_are_refused(sign):
    """Control characters and halves of surrogate pairs, wherever they stand."""
    text = f"the{sign}rod"
    message = refusal(
        lambda: pendulum(
            description=text,
            descriptions={x: text},
            parameters=(Parameter(m, 1.0, "kg", text), *CONSTANTS[1:]),
            constraints=[Holonomic("rod", ROD.expression, text)],
        ),
        ModelError,
    )
    says(message, "4 problems", "parameter 'm'", "constraint 'rod'", repr(sign), "leave it out")


def test_descriptions_with_markup_survive(tmp_path):
    """What XML and HTML would take for markup comes back as it was written."""
    text = "<b>\"bob\" & 'rod'</b> ]]> \\ {curly} θ é 100 %"
    path = build_fmu(
        pendulum(
            description=text,
            descriptions={x: text},
            parameters=(Parameter(m, 1.0, "kg", text), *CONSTANTS[1:]),
            constraints=[Holonomic("rod", ROD.expression, text)],
        ),
        tmp_path,
        check=False,
    )
    description = fmpy.read_model_description(str(path))
    described = {v.name: v.description for v in description.modelVariables}
    assert description.description == text
    assert described["m"] == described["x"] == text
    assert text in described["lambda.rod"]
    with zipfile.ZipFile(path) as archive:
        page = archive.read("documentation/index.html").decode()
    assert '<b>"bob"' not in page
    assert not page or page.count("<b>&quot;bob") == page.count("</b> ]]>") == 0
    assert simulate(path, stop_time=0.02)["x"][0] == 0.6


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, "long", None, 1 + 2j])
def test_numbers_that_are_not_finite_are_refused(bad):
    """Parameters, bounds, inputs and start values, all in one message."""
    force = symbols("F", real=True)
    message = refusal(
        lambda: pendulum(
            parameters=(Parameter(m, bad, "kg"), *CONSTANTS[1:]),
            inputs=[Input(force, "N", bad)],
            start={x: bad, y.diff(): bad},
        ),
        ModelError,
    )
    says(message, "4 problems", "parameter 'm' is", "input 'F' is", "start of x is", "of der(y) is")
    assert message.count(f"is {bad!r}, expected a finite number") == 4


def test_parameters_outside_their_bounds_are_refused():
    """The value and its bounds; also bounds that exclude everything."""
    message = refusal(
        lambda: pendulum(
            parameters=[
                Parameter(m, -1.0, "kg", min=0),
                Parameter(g, 9.81, "m/s^2", max=5),
                Parameter(L, 1.0, "m", min=3, max=2),
            ]
        ),
        ModelError,
    )
    says(message, "'m' = -1.0 is outside its own bounds [0, None]", "declared positive")
    says(message, "'g' = 9.81 is outside", "'L': min = 3 is above max = 2")


def test_start_values_at_a_singularity_of_the_equations_are_refused():
    """A potential that is infinite, or not real, at the start: the values are named."""
    for bad in (m * g * L**2 / y, m * g * sqrt(L) * sqrt(y)):
        model = pendulum(lagrangian=K - bad, start={x: 1.0, y: 0.0 if bad.has(1 / y) else -0.1})
        message = refusal(lambda model=model: prepare(model), ModelError)
        says(message, "cannot be evaluated", "x = 1.0", "choose others")


# ---------------------------------------------------------------------------- files


GOOD = """
from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols
from lagfmu import Model, Parameter
x = dynamicsymbols("x")
m = symbols("m", positive=True)
model = Model(name="Free", lagrangian=m * x.diff() ** 2 / 2, coordinates={x: "m"},
              parameters=[Parameter(m, 1.0, "kg")])
"""


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        (GOOD + "\n1 / 0\n", ("line 10", "1 / 0", "ZeroDivisionError")),
        (GOOD + "\nfrom nowhere import nothing\n", ("line 10", "ModuleNotFoundError", "nowhere")),
        (GOOD + "\nraise SystemExit(3)\n", ("line 10", "SystemExit: 3")),
        (GOOD + "\ndef f(:\n", ("line 10", "syntax error")),
        ("x = 1\n", ("0 models", "none", "model = Model(...)")),
        (
            GOOD + "\nother = Model(name='Other', lagrangian=m * x.diff() ** 2 / 2,"
            " coordinates={x: 'm'}, parameters=[Parameter(m, 1.0, 'kg')])\n",
            ("2 models (model, other)", "expected one"),
        ),
        (GOOD + "\nscenes = ['Free']\n", ("scenes", "'Free'", "Scene(")),
        (GOOD + "\nscenes = 3\n", ("scenes", "3", "Scene(")),
        (GOOD + "\nclosed_forms = [x]\n", ("closed_forms", "x(t)", "ClosedForm(")),
        (
            GOOD + "\nfrom lagfmu import Scene\nscenes = [Scene('A'), Scene('A')]\n",
            ("scenes", "'A'", "twice"),
        ),
        ("\0", ("null bytes",)),
        (b"\xff\xfe", ("utf-8",)),
    ],
)
def test_a_model_file_that_is_no_good_is_refused(tmp_path, text, parts):
    """The file, the line and what it raised, or what it defines and what it should."""
    file = tmp_path / "mine.py"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    message = refusal(lambda: load(file), ModelError)
    says(message, str(file), *parts)


def test_the_line_is_named_however_the_file_is_called(tmp_path, monkeypatch):
    """Called by a path relative to the folder, too."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(GOOD + "\n1 / 0\n")
    for name in ("mine.py", f"../{tmp_path.name}/mine.py"):
        says(refusal(lambda name=name: load(name), ModelError), name, "line 10 (1 / 0)")


def test_scenes_that_differ_by_capitals_alone_are_refused(tmp_path):
    """Bead.fmu and BEAD.fmu are one file on Windows and macOS."""
    file = tmp_path / "two.py"
    file.write_text(GOOD + "from lagfmu import Scene\nscenes = [Scene('Bead'), Scene('BEAD')]\n")
    says(refusal(lambda: load(file), ModelError), "BEAD, Bead", "capitals", "rename one")


def test_a_temporary_folder_that_cannot_be_written_is_told(tmp_path):
    """The disk of temporary files is full, or not there: one line, and no traceback."""
    model = Path(__file__).parent.parent / "models" / "pendulum.py"
    done = subprocess.run(
        [sys.executable, "-c", NO_ROOM, "build", str(model), "--out", str(tmp_path)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 3
    says(done.stderr, "No space left on device", "TMPDIR")
    assert "Traceback" not in done.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="no limits of files there")
@pytest.mark.parametrize(
    ("command", "kept"),
    [
        ("build MODEL --target python --out KEPT", "Atwood.fmu"),
        ("sweep FMU --vary m1=1,2 --out KEPT", "runs.csv"),
        *(
            pytest.param(words, kept, marks=pytest.mark.thorough)
            for words, kept in (
                ("simulate FMU --csv KEPT", "runs.csv"),
                ("verify FMU --json KEPT", "all.json"),
                ("tradeoff FMU --json KEPT", "all.json"),
                ("stress FMU --quick --json KEPT", "all.json"),
            )
        ),
    ],
)
def test_a_full_disk_is_told_with_its_folder_and_the_remedy(native_fmu, tmp_path, command, kept):
    """Where no temporary file may grow beyond 20 kB: one line of stderr, nothing is left in the folder, and
    what a good run had written is there still, or newer and whole."""
    temporary, good = tmp_path / "temporary", tmp_path / kept
    temporary.mkdir()
    good.write_text("good")
    words = command.replace("FMU", str(native_fmu("Atwood"))).replace("KEPT", str(good))
    words = words.replace("MODEL", str(Path(__file__).parent.parent / "models" / "atwood.py"))
    done = subprocess.run(
        [sys.executable, "-c", SMALL_FILES, *words.split()],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
        env=os.environ | {"TMPDIR": str(temporary)},
    )
    assert done.returncode == 3, done.stderr
    (line,) = [text for text in done.stderr.splitlines() if text.startswith("error:")]
    says(line, str(temporary), "TMPDIR", "is the disk full?")
    assert "Traceback" not in done.stderr + done.stdout
    assert list(temporary.iterdir()) == []
    assert good.read_text() == "good" or "is the disk full" in good.read_text()


SMALL_FILES = """
import resource, signal, sys
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
from lagfmu.testing import app
app(sys.argv[1:])
"""
NO_ROOM = """
import errno, sys, tempfile
from lagfmu.testing import app
def full(*arguments, **options):
    raise OSError(errno.ENOSPC, "No space left on device")
tempfile.mkdtemp = full
app(sys.argv[1:])
"""


def test_a_file_that_is_missing_or_no_python_file_is_refused(tmp_path):
    """A missing file, a folder, a text file."""
    says(refusal(lambda: load(tmp_path / "none.py"), ModelError), "none.py", "no such file")
    says(refusal(lambda: load(tmp_path), ModelError), str(tmp_path), "this is a folder")
    (tmp_path / "model.txt").write_text(GOOD)
    says(refusal(lambda: load(tmp_path / "model.txt"), ModelError), "model.txt", "NAME.py")


def test_two_names_for_one_model_are_one_model(tmp_path):
    """model = pendulum = Model(...) defines one."""
    file = tmp_path / "mine.py"
    file.write_text(GOOD + "\nsame = model\n")
    assert load(file).model.name == "Free"


def test_a_folder_that_cannot_be_written_is_refused(tmp_path):
    """A path below a regular file: its name and the remedy; the file is untouched."""
    (tmp_path / "file").write_text("keep me")
    message = refusal(
        lambda: build_fmu(pendulum(), tmp_path / "file" / "out", check=False), BuildError
    )
    says(message, str(tmp_path / "file" / "out"), "Not a directory", "another output folder")
    assert (tmp_path / "file").read_text() == "keep me"
    (tmp_path / "Pendulum.fmu").mkdir()
    says(
        refusal(lambda: build_fmu(pendulum(), tmp_path, check=False), BuildError), "Is a directory"
    )
    assert sorted(p.name for p in tmp_path.iterdir()) == ["Pendulum.fmu", "file"]


def test_a_good_fmu_stays_when_a_build_fails(tmp_path, monkeypatch):
    """A model that is refused, and a disk that is full, leave the old file and nothing beside it."""
    path = build_fmu(pendulum(), tmp_path, check=False)
    old = path.read_bytes()
    with pytest.raises(ModelError):
        build_fmu(pendulum(start={}), tmp_path, check=False)

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    says(refusal(lambda: build_fmu(pendulum(), tmp_path, check=False), BuildError), "No space left")
    assert path.read_bytes() == old
    assert list(tmp_path.iterdir()) == [path]


# ---------------------------------------------------------------------------- FMUs given to verify


FOREIGN = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Real
class Foreign(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.y = 1.0
        self.register_variable(Real("y", causality=Fmi2Causality.output))
    def do_step(self, t, h):
        return True
"""


def test_a_foreign_fmu_is_not_verified(tmp_path):
    """An FMU of plain pythonfmu carries no closed forms."""
    script = tmp_path / "foreign.py"
    script.write_text(FOREIGN)
    path = FmuBuilder.build_FMU(script, dest=tmp_path)
    says(refusal(lambda: verify(path), VerificationError), "Foreign.fmu", "no closed forms")


def test_an_fmu_whose_record_is_missing_or_damaged_is_not_verified(fmu, tmp_path):
    """resources/lagfmu.json left out, and filled with something else."""
    for record in (None, b"", b"{", b"[]", b'{"format": 99}', b'{"format": 1}'):
        path = rewritten(fmu("Atwood"), tmp_path / "X.fmu", "resources/lagfmu.json", record)
        says(refusal(lambda path=path: verify(path), VerificationError), "X.fmu", "lagfmu")


def rewritten(source, target, name, content):
    """A copy of an archive with one entry replaced, or left out."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for entry in old.namelist():
            if entry != name:
                new.writestr(entry, old.read(entry))
            elif content is not None:
                new.writestr(entry, content)
    return target


def damaged(whole: bytes):
    yield "empty", b""
    yield "text", b"this is no zip archive"
    yield "random", bytes((17 * k * k + 3) % 251 for k in range(4000))
    yield "truncated", whole[: len(whole) // 2]
    yield "flipped", whole[:2000] + bytes(b ^ 0x55 for b in whole[2000:4000]) + whole[4000:]


def test_a_corrupt_file_is_not_verified(fmu, tmp_path):
    """Random bytes, half an archive, an archive with damaged content: one message each."""
    for what, content in damaged(fmu("Atwood").read_bytes()):
        path = tmp_path / f"{what}.fmu"
        path.write_bytes(content)
        says(refusal(lambda path=path: verify(path)), f"{what}.fmu")
    says(refusal(lambda: verify(tmp_path / "none.fmu"), VerificationError), "no such file")
    says(refusal(lambda: verify(tmp_path), VerificationError), str(tmp_path))


@pytest.mark.parametrize("description", [b"", b"<xml", b"<a/>", b"\xff\xfe", None])
def test_an_fmu_with_a_bad_model_description_is_not_verified(fmu, tmp_path, description):
    """The archive is good, modelDescription.xml is not."""
    path = rewritten(fmu("Atwood"), tmp_path / "X.fmu", "modelDescription.xml", description)
    says(refusal(lambda: verify(path), VerificationError), "X.fmu", "modelDescription.xml")


def test_an_fmu_whose_binary_is_missing_or_damaged_is_not_verified(fmu, tmp_path):
    """The process lives on, says what is wrong, and stands in the folder that it stood in."""
    here = Path.cwd()
    for content in (None, b"no ELF"):
        name = "binaries/linux64/Atwood.so"
        path = rewritten(fmu("Atwood"), tmp_path / "X.fmu", name, content)
        says(refusal(lambda path=path: verify(path)), "X.fmu")
    assert Path.cwd() == here


def test_an_fmu_whose_script_raises_is_not_verified(python_fmu, tmp_path):
    """The script inside the archive is damaged: one message, no crash."""
    with zipfile.ZipFile(python_fmu("Atwood")) as archive:
        script = archive.read("resources/slavemodule.txt").decode().strip()
    path = rewritten(
        python_fmu("Atwood"),
        tmp_path / "X.fmu",
        f"resources/{script}.py",
        b"raise RuntimeError('x')",
    )
    says(refusal(lambda: verify(path)), "X.fmu")


def test_verify_refuses_values_that_cannot_be(fmu):
    """An unknown variable, a text for a number, a stop time that is none."""
    path = fmu("Atwood")
    says(refusal(lambda: verify(path, {"mass": 1.0})), "mass", "Atwood")
    says(refusal(lambda: verify(path, {"m1": "heavy"})), "m1", "'heavy'")
    says(refusal(lambda: verify(path, stop_time=-1.0)), "stop_time", "-1.0")
    says(refusal(lambda: verify(path, step_size=0.0)), "step_size", "0.0")
    says(refusal(lambda: verify(path, step_size=1e-12)), "step_size = 1e-12", "at most 1e+07")
    says(refusal(lambda: verify(path, tolerance=0.0)), "tolerance = 0.0", "positive")
    says(refusal(lambda: verify(path, tolerance=1e3)), "tolerance = 1000.0", "at most 0.1")


def test_what_the_fmu_refuses_is_told_by_verify(fmu):
    """The FMU's own message reaches the caller."""
    says(refusal(lambda: verify(fmu("Atwood"), {"m1": math.nan})), "'m1' = nan", "finite")
    says(refusal(lambda: verify(fmu("Atwood"), tolerance=math.nan)), "tolerance = nan")
    message = refusal(lambda: simulate(fmu("Atwood"), start_values={"m1": 0.0}))
    says(message, "fmi2SetReal", "'m1' = 0.0, expected a positive number")
    assert "Fatal py" not in message


def test_a_run_that_stops_early_is_no_success(fmu):
    """A step that the FMU discards: the cause, not a short trajectory that verify finds in order."""
    crawl = {"solver.maximum_step": 1e-12}
    says(refusal(lambda: simulate(fmu("Atwood"), start_values=crawl)), "t = 0.0 s", "step")
    says(refusal(lambda: verify(fmu("Atwood"), crawl)), "t = 0.0 s", "step")


def test_a_step_without_headway_ends(fmu):
    """100 steps of 1e-9 of the natural time are refused where 50 are allowed, with the setting that allows
    more; where as many as needed are allowed they are taken, and as a hundred calls they always were."""
    crawl = {"solver.maximum_step": 1e-9, "solver.maximum_steps": 50}
    with instance(fmu("PendulumCartesian")) as one:
        one.start(crawl)
        with refused(one, DISCARD, "no headway", "solver.maximum_steps", "more than 50"):
            one.step(1e-7)
    for setting, steps in ((0, 1), (50, 100)):
        with instance(fmu("PendulumCartesian")) as one:
            one.start(crawl | {"solver.maximum_steps": setting})
            for _ in range(steps):
                one.step(1e-7 / steps)
            assert one.get("solver.steps") == pytest.approx(106, abs=8)


def test_simulate_refuses_values_that_cannot_be():
    """The same for a model in this process."""
    model = prepare(pendulum())
    says(refusal(lambda: simulate(model, start_values={"mass": 1.0})), "mass", "m, g, L")
    says(refusal(lambda: simulate(model, start_values={"m": "heavy"})), "m", "'heavy'")
    says(refusal(lambda: simulate(model, start_values={"m": math.nan})), "m", "nan")
    says(refusal(lambda: simulate(model, start_values={"solver.method": "euler"})), "euler", "rk4")
    says(refusal(lambda: simulate(model, stop_time=-1.0)), "stop_time", "-1.0")
    says(refusal(lambda: simulate(model, step_size=math.inf)), "step_size", "inf")
    says(refusal(lambda: simulate(model, step_size=1e-12)), "step_size = 1e-12", "larger step_size")
    says(refusal(lambda: simulate(model, tolerance=-1e-8)), "tolerance = -1e-08", "positive")
    says(refusal(lambda: simulate(model, tolerance=1e3)), "tolerance = 1000.0", "at most 0.1")


# ---------------------------------------------------------------------------- calls of the FMU


@contextlib.contextmanager
def refused(one, status, *parts):
    """The call inside returns `status`, and the log says why."""
    count = len(one.log)
    with pytest.raises(FMICallException) as caught:
        yield
    assert caught.value.status == (one.refusal if status == FATAL else status)
    text = " | ".join(message for _, _, message in one.log[count:])
    says(text, *parts)
    assert "Traceback" not in text


@pytest.mark.parametrize(
    ("step", "parts"),
    [
        (0.0, ("0.0 s", "expected a positive number")),
        (-0.1, ("-0.1 s", "expected a positive number")),
        (math.nan, ("nan s", "expected a positive number")),
        (math.inf, ("inf s", "expected a positive number")),
        (1e300, ("communication step",)),
        (1e-300, ("communication step",)),
    ],
)
@pytest.mark.parametrize("method", ["dop853", "radau5", "rk4"])
def test_a_communication_step_that_cannot_be_done_is_refused(fmu, step, parts, method):
    """fmi2Discard (fmi2Error where it can be returned and the call is illegal), with the reason in the
    log; nothing has changed, and the next step is done."""
    with instance(fmu("PendulumCartesian")) as one, instance(fmu("PendulumCartesian")) as calm:
        if method == "rk4" and not one.native:
            pytest.skip("the python target has no rk4")
        for each in (one, calm):
            each.start({"solver.method": method})
            each.step(0.1)
        before = one.outputs()
        for _ in range(2):
            illegal = one.native and not 0 < step < math.inf
            with refused(one, ERROR if illegal else DISCARD, *parts):
                one.fmu.doStep(one.time, step)
        assert one.outputs() == before
        for each in (one, calm):
            for _ in range(5):
                each.step(0.1)
        assert one.outputs() == calm.outputs()


def test_a_wrong_communication_point_is_refused(fmu):
    """The FMU stands at 0.1 s and says so."""
    with instance(fmu("Hemisphere")) as one:
        one.start()
        one.step(0.1)
        for point in (0.0, 0.2, math.nan, math.inf):
            with refused(one, one.illegal_step, f"{point!r} s", "stands at 0.1 s"):
                one.fmu.doStep(point, 0.1)
        one.step(0.1)
        assert one.get("theta") > 0.01


def test_a_step_past_the_stop_time_is_refused(fmu):
    """Only rounding is allowed past the end, and a step after it is refused."""
    with instance(fmu("Hemisphere")) as one:
        one.start(stop_time=0.3)
        one.step(0.1)
        with refused(one, one.illegal_step, "stop time 0.3 s", "0.31"):
            one.fmu.doStep(one.time, 0.21)
        one.step(0.1)
        one.fmu.doStep(one.time, 0.1 * (1 + 1e-10))  # ends at 0.30000000001 s
        with refused(one, one.illegal_step, "stop time 0.3 s"):
            one.fmu.doStep(0.3, 0.1)


def test_sums_of_steps_reach_the_stop_time(fmu):
    """Ten steps of 0.1 s add up to 0.9999999999999999 s or more, never to a refusal."""
    with instance(fmu("Atwood")) as one:
        one.start(stop_time=1.0)
        for _ in range(10):
            one.step(0.1)
        assert one.get("x1") != 0


def test_illegal_calls_are_refused_and_the_instance_survives(fmu):
    """fmi2Fatal (pythonfmu knows no fmi2Error), the reason in the log, and it can go on."""
    with instance(fmu("PendulumCartesian")) as one, instance(fmu("PendulumCartesian")) as calm:
        one.fmu.setupExperiment()
        one.fmu.enterInitializationMode()
        for _ in range(3):
            with refused(one, FATAL, "'lambda.rod'", "calculated"):
                one.set("lambda.rod", 1.0)
            with refused(one, FATAL, "'solver.method' = 9", "2 (dop853)"):
                one.set("solver.method", 9)
            with refused(one, FATAL, "'m' = -1.0", "bounds [0"):
                one.set("m", -1.0)
            with refused(one, FATAL, "'L' = 0.0", "positive"):
                one.set("L", 0.0)
            for bad in (math.nan, math.inf, -math.inf):
                for name in ("m", "x", "der(y)", "solver.tolerance"):
                    with refused(one, FATAL, f"{name!r} = {bad!r}", "finite"):
                        one.set(name, bad)
            with refused(one, FATAL, "value reference 999"):
                one.fmu.getReal([999])
            with refused(one, FATAL, "is no Boolean"):
                one.fmu.getBoolean([0])
            with refused(one, FATAL, "'unique.rod'", "calculated"):
                one.fmu.setBoolean([one.variables["unique.rod"].valueReference], [True])
            with refused(one, FATAL, "'solver.steps'", "calculated"):
                one.fmu.setInteger([one.variables["solver.steps"].valueReference], [3])
        one.fmu.exitInitializationMode()
        calm.start()
        for _ in range(3):
            with refused(one, FATAL, "'m'", "before the end of the initialization"):
                one.set("m", 2.0)
            with refused(one, FATAL, "'x'", "before the end of the initialization"):
                one.set("x", 0.0)
        for each in (one, calm):
            for _ in range(3):
                each.step(0.1)
        assert one.outputs() == calm.outputs()


def test_an_input_that_is_not_finite_is_refused(fmu):
    """The force keeps its last value."""
    with instance(fmu("CartPendulum")) as one:
        one.start({"F": 3.0})
        before = one.get("der(s,2)")
        for bad in (math.nan, math.inf):
            with refused(one, FATAL, f"'F' = {bad!r}", "finite"):
                one.set("F", bad)
        assert one.get("der(s,2)") == before
        one.step(0.1)


def test_one_bad_value_of_several_leaves_all_as_they_were(fmu):
    """fmi2SetReal with a good and a bad value sets neither."""
    with instance(fmu("Atwood")) as one:
        one.fmu.setupExperiment()
        one.fmu.enterInitializationMode()
        references = [one.variables[n].valueReference for n in ("m1", "m2")]
        before = one.fmu.getReal(references)
        with refused(one, FATAL, "'m2' = nan"):
            one.fmu.setReal(references, [7.0, math.nan])
        assert one.fmu.getReal(references) == before


def test_an_experiment_that_cannot_be_is_refused(fmu):
    """Tolerances and times that are none; afterwards a good one is accepted."""
    with instance(fmu("Hemisphere")) as one:
        for tolerance in (0.0, -1e-6, math.nan, math.inf, 1000.0, math.nextafter(0.1, 1)):
            with refused(
                one, FATAL, f"tolerance = {tolerance!r}", "positive", "at most 0.1", "1e-8"
            ):
                one.fmu.setupExperiment(tolerance=tolerance)
        for tolerance in (-1e-6, math.nan, 1000.0, math.nextafter(0.1, 1)):
            with refused(one, FATAL, f"'solver.tolerance' = {tolerance!r}"):
                one.set("solver.tolerance", tolerance)
        for start, stop in ((math.nan, None), (math.inf, None), (1.0, 0.5), (0.0, math.nan)):
            with refused(one, FATAL, "start time", "stop"):
                one.fmu.setupExperiment(startTime=start, stopTime=stop)
        one.start(tolerance=0.1)
        one.step(0.1)


def test_parameters_that_make_the_start_impossible_are_refused_by_name(fmu):
    """Start at the rod's centre, a rod out of range: the cause, not a NaN; both can be mended."""
    for bad, good, parts in (
        ({"x": 0.0, "y": 0.0}, {"x": 1.0}, ("cannot be projected", "'rod'", "x = 0.0, y = 0.0")),
        ({"L": 1e200}, {"L": 1.0}, ("the start",)),
    ):
        with instance(fmu("PendulumCartesian")) as one:
            one.fmu.setupExperiment()
            one.fmu.enterInitializationMode()
            for name, value in bad.items():
                one.set(name, value)
            for _ in range(2):
                with refused(one, FATAL, *parts):
                    one.get("lambda.rod")
                with refused(one, FATAL, *parts):
                    one.fmu.exitInitializationMode()
            for name, value in good.items():
                one.set(name, value)
            one.fmu.exitInitializationMode()
            one.step(0.1)
            assert math.isfinite(one.get("lambda.rod"))


@pytest.mark.parametrize("target", ["python", "native"])
def test_what_cannot_be_computed_is_said_in_plain_words(tmp_path, target):
    """exp(1e4) is no double, and sqrt(x) no real number at x = -1: neither Python's errno nor a NaN."""
    x = dynamicsymbols("x")
    m, k, a = symbols("m k a", positive=True)
    for name, potential, place, words in (
        ("Steep", exp(x / a), 1e4, "beyond 1.8e308"),
        ("Root", sqrt(x / a), -1.0, "outside of its domain"),
    ):
        model = Model(
            name=name,
            lagrangian=m * x.diff() ** 2 / 2 - k * potential,
            coordinates={x: "m"},
            parameters=[Parameter(m, 1.0, "kg"), Parameter(k, 1.0, "J"), Parameter(a, 1.0, "m")],
            start={x: 1.0},
        )
        path = build_fmu(model, tmp_path, target=target, check=False)
        with instance(path) as one:
            one.fmu.setupExperiment()
            one.fmu.enterInitializationMode()
            one.set("x", place)
            words = words if target == "python" else "not finite"
            with refused(one, FATAL, "cannot be evaluated at t = 0.0 s", words):
                one.fmu.exitInitializationMode()


def test_bytes_that_are_no_state_are_refused(fmu):
    """Rubbish, half a state, and one with an altered byte: the instance keeps its own."""
    with instance(fmu("Atwood")) as one:
        one.start()
        one.step(0.1)
        saved = one.fmu.serializeFMUState(one.fmu.getFMUState())
        before = one.outputs()
        middle = len(saved) // 2
        altered = saved[:middle] + bytes([saved[middle] ^ 1]) + saved[middle + 1 :]
        for rubbish in (b"", b"rubbish", b"[]", b"{}", b"\xff\x00", saved[:middle], altered):
            for _ in range(3):
                with refused(one, FATAL, "saved state"):
                    one.fmu.setFMUState(one.fmu.deSerializeFMUstate(rubbish))
        assert one.outputs() == before
        one.step(0.1)


SURVIVE = """
import sys
sys.path.insert(0, sys.argv[2])
from instance import instance
for round in range(10):
    with instance(sys.argv[1]) as one:
        one.start()
        for k in range(20):
            for call in (
                lambda: one.set("lambda.rod", 1.0),
                lambda: one.set("x", 1.0),
                lambda: one.fmu.doStep(one.time, -1.0),
                lambda: one.fmu.getReal([999]),
            ):
                try:
                    call()
                except Exception:
                    pass
                else:
                    raise SystemExit("accepted")
            one.step(0.01)
print("alive")
"""


@pytest.mark.thorough
def test_the_process_survives_hundreds_of_refusals(fmu):
    """800 refused calls in ten instances: no crash, neither then nor at the end of the process."""
    command = [
        sys.executable,
        "-c",
        SURVIVE,
        str(fmu("PendulumCartesian")),
        os.path.dirname(__file__),
    ]
    run = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert run.returncode == 0, run.stderr[-2000:]
    assert run.stdout.strip().endswith("alive")


def test_a_refusal_behind_a_projected_start_keeps_its_cause(fmu):
    """A disk at 1e300 m/s: theta' is projected onto the rolling, which is to be logged, and then the
    energy is no double: the refusal says so."""
    with instance(fmu("InclineDisk")) as one:
        one.fmu.setupExperiment()
        one.set("der(y)", 1e300)
        one.fmu.enterInitializationMode()
        with refused(one, FATAL, "not finite" if one.native else "cannot be evaluated"):
            one.fmu.exitInitializationMode()


def test_an_inertia_that_no_double_holds_is_refused(fmu):
    """A disk of radius 1e-300 m has the inertia 5e-601 kg m^2: not 0, which would be another motion."""
    with instance(fmu("InclineDisk")) as one:
        one.fmu.setupExperiment()
        one.set("R", 1e-300)
        one.fmu.enterInitializationMode()
        with refused(one, FATAL, "overflow" if one.native else "too small for a double"):
            one.fmu.exitInitializationMode()


def test_a_derivative_by_another_time_is_refused(tmp_path):
    """x.diff(T) of x(t) is 0, and the kinetic energy would lack it without a word; road.diff(s) of a
    symbol that stands in it is none of that."""
    file = tmp_path / "late.py"
    file.write_text(
        "from sympy import diff, symbols\n"
        "from sympy.physics.mechanics import dynamicsymbols\n"
        "from lagfmu import Model, Parameter\n"
        "x = dynamicsymbols('x')\n"
        "t, m = symbols('t m', positive=True)\n"
        "slope = (m * t**2).diff(t)\n"
        "lagrangian = m * x.diff(t) ** 2 / 2 + m * diff(x, t) ** 2 / 2\n"
        "model = Model(name='Late', lagrangian=m * x.diff() ** 2 / 2, coordinates={x: 'm'},\n"
        "              parameters=[Parameter(m, 1.0, 'kg')])\n"
    )
    message = refusal(lambda: load(file), ModelError)
    says(
        message, "2 problems", "line 7: x.diff(t) is 0", "line 7: diff(x, t) is 0", "write x.diff()"
    )
