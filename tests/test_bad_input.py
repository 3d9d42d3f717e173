"""Bad input: one clear message that names the thing, its value, what was expected and the remedy."""

from __future__ import annotations

import contextlib
import io
import math
import os
import subprocess
import sys
import tempfile
import warnings
import zipfile
from pathlib import Path

import fmpy
import pytest
from conftest import MODELS
from fmpy.fmi1 import FMICallException
from instance import instance
from rich.console import Console
from sympy import Abs, Eq, I, Matrix, Max, Piecewise, cos, exp, oo, sin, sqrt, symbols
from sympy.physics.mechanics import ReferenceFrame, dynamicsymbols
from typer.testing import CliRunner
from zoo import point_mass

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
    multiplier,
    simulate,
    verify,
)
from lagfmu.errors import BuildError, ModelError, VerificationError
from lagfmu.testing import RedundantConstraintWarning, app, load, prepare
from lagfmu.testing import show_in as show

DISCARD, ERROR, FATAL = 2, 3, 4

t = dynamicsymbols._t
x, y, z, theta = dynamicsymbols("x y z theta")
m, g, L = symbols("m g L", positive=True)
a, b, c = symbols("a b c", real=True)
k, e, F = symbols("k_spring e F")
N = ReferenceFrame("N")
K = m * (x.diff() ** 2 + y.diff() ** 2) / 2
V = m * g * y
ROD = Holonomic("rod", x**2 + y**2 - L**2)
MASS, *OTHERS = CONSTANTS = (
    Parameter(m, 1.0, "kg"),
    Parameter(g, 9.81, "m/s^2"),
    Parameter(L, 1.0, "m"),
)
MINIMAL = Scene("P", formulation="minimal")


def pendulum(**changes) -> Model:
    """A good pendulum, with one thing changed."""
    fields = {
        "name": "Pendulum",
        "lagrangian": K - V,
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
    """Every part stands in the message, but those that begin with ~, which must not."""
    for part in parts:
        assert (part.removeprefix("~") in message) != part.startswith("~"), f"{part!r}: {message!r}"


# ---------------------------------------------------------------------------- models


EXPRESSIONS = [
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
    (  # nobody declared a spring constant, and z is no coordinate
        {"lagrangian": K - V - k * z**2 / 2},
        ("2 problems", "k_spring", "z is neither coordinate, parameter nor input", "declare"),
    ),
    ({"lagrangian": K - m * symbols("g") * y}, ("g is", "use the same")),  # not positive: another g
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
    (
        {"constraints": [Holonomic("pin", Matrix([x - L, y]))]},
        ("constraint 'pin' is a matrix", "each of its components"),
    ),
    (
        {"constraints": [Holonomic("pin", (x - L) * N.x + y * N.y)]},
        ("constraint 'pin' is a vector", "r.dot(N.x)"),
    ),
    ({"lagrangian": "K - V("}, ("lagrangian", "K - V(", "no SymPy expression", "str")),
    ({"lagrangian": K + m * x * x.diff(t, 2)}, ("lagrangian", "order 2", "at most 1")),
    ({"constraints": [Holonomic("c", x.diff())]}, ("'c'", "order 1", "Nonholonomic")),
    ({"constraints": [Holonomic("c", Eq(x, L))]}, ("constraint 'c'", "Eq(", "vanishes")),
    ({"constraints": [Contact("c", x >= L)]}, ("constraint 'c'", ">=", "vanishes")),
    ({"constraints": [Holonomic("c", L)]}, ("constraint 'c'", "L holds no coordinate")),
    ({"lagrangian": K - I * m * g * y}, ("lagrangian", "holds I", "real and finite")),
    ({"forces": {x: m * g * oo}}, ("force on x", "holds oo", "real and finite")),
    (  # a prescribed speed is no Pfaffian form
        {"constraints": [Nonholonomic("speed", x.diff() ** 2 + y.diff() ** 2 - g * L)]},
        ("'speed'", "nonlinear in the velocities", "a_j(q, t) v_j"),
    ),
    (
        {"constraints": [Nonholonomic("place", x - L)]},
        ("'place'", "no velocity", "Holonomic"),
    ),
    (
        {"lagrangian": K - V + m * x.diff() ** 3 / sqrt(g * L)},
        ("der(x)**3", "not quadratic", "forces"),
    ),
    (  # where the terms of a constraint disagree, its lambda is not blamed for having no unit
        {
            "constraints": [Holonomic("rod", x**2 + y - L)],
            "outputs": [Output("push", multiplier("rod"), "N")],
        },
        ("1 problem:", "constraint 'rod'", "unit m2", "~'push'"),
    ),
]
PLACES = [
    ({"lagrangian": None}, ("neither lagrangian nor kinetic_energy",)),
    ({"kinetic_energy": K}, ("both lagrangian and kinetic_energy",)),
    ({"constraints": [x**2 - L**2]}, ("constraints hold", "expected Holonomic", "write")),
    ({"constraints": ROD}, ("constraints = Holonomic", "expected a list", "[Holonomic(...)]")),
    (
        {"constraints": [Holonomic("rod", ROD.expression, while_closed="floor")]},
        ("'rod'", "while_closed='floor'", "contacts: none"),
    ),
    (
        {"constraints": [Contact("floor", y, restitution=e)]},
        ("restitution of 'floor'", "e is neither"),
    ),
    ({"parameters": {m: 1.0}}, ("parameters hold m", "expected Parameter")),
    ({"parameters": [Parameter("m", 1.0, "kg")]}, ("parameter 'm'", "sympy.symbols")),
    ({"parameters": None}, ("parameters = None", "expected a list")),
    ({"coordinates": {symbols("x"): "m"}}, ("coordinate x", "dynamicsymbols('x')")),
    ({"coordinates": {}}, ("no coordinate",)),
    *(
        ({"coordinates": bare}, ("'x' has no unit", "'y' has no unit", "give one, e.g. 'm'"))
        for bare in ([x, y], {x: "", y: "  "}, {x: None, y: 3})
    ),
    ({"coordinates": {x: "deg", y: "m"}}, ("lagrangian", "must have unit")),
    ({"coordinates": {x: "furlongs/fort", y: "m"}}, ("'x'", "not a unit", "'m'", "correct")),
    ({"coordinates": {x: "degC", y: "m"}}, ("'x'", "offset", "'K'")),
    ({"start": {"x": 0.6, y: -0.8}}, ("start", "text 'x'", "write x without quotes")),
    ({"start": {"der(x)": 0.6, y: -0.8}}, ("text 'der(x)'", "write x without", ".diff()")),
    ({"start": {z: 1.0, x.diff(t, 2): 3.0}}, ("start names z", "start names der(x,2)")),
    ({"start": [1.0]}, ("start = [1.0]", "expected a dict")),
    ({"forces": {z: m * g}}, ("force is given on z", "no coordinate")),
    ({"forces": [m * g]}, ("forces = [g*m]", "expected a dict", "forces={x: F}")),
    ({"embedding": {x: L * sin(theta)}}, ("embedding = {", "expected Embedding(")),
    ({"embedding": Embedding([theta], {x: L})}, ("embedding coordinates", "expected a dict")),
    (
        {"embedding": Embedding({theta: "rad"}, {x: k * L, z: L}, {theta: math.nan, y: 1.0})},
        ("4 problems", "embedding of x: k_spring is", "gives z", "start names y", "theta is nan"),
    ),
    ({"description": 5}, ("description of the model is 5", "expected a text")),
]
NUMBERS = [
    (
        {"parameters": (Parameter(m, True, "kg"), *OTHERS)},
        ("parameter 'm' is True", "finite number"),
    ),
    (  # a text, though it reads like a number
        {"parameters": (Parameter(m, "1.0", "kg"), *OTHERS)},
        ("parameter 'm' is '1.0'", "finite number, without quotes"),
    ),
    (
        {"parameters": (Parameter(m, 1.0, "kg", min="0", max=3), *OTHERS)},
        ("min of parameter 'm' is '0'", "without quotes"),
    ),
    ({"start": {x: "0.6", y: -0.8}}, ("start of x is '0.6'", "without quotes")),
    *(
        (
            {
                "parameters": (Parameter(m, bad, "kg"), *OTHERS),
                "inputs": [Input(F, "N", bad)],
                "start": {x: bad, y.diff(): bad},
            },
            tuple(
                f"{what} is {bad!r}, expected a finite number"
                for what in ("parameter 'm'", "input 'F'", "start of x", "of der(y)")
            ),
        )
        for bad in (math.nan, math.inf, -math.inf, "long", None, 1 + 2j)
    ),
    (
        {
            "parameters": [
                Parameter(m, -1.0, "kg", min=0),
                Parameter(g, 9.81, "m/s^2", max=5),
                Parameter(L, 1.0, "m", min=3, max=2),
            ]
        },
        (
            *("'m' = -1.0 is outside its own bounds [0, None]", "declared positive"),
            *("'g' = 9.81 is outside", "'L': min = 3 is above max = 2"),
        ),
    ),
    *(  # a potential that is infinite, or not real, at the start
        (
            {"lagrangian": K - bad, "start": start},
            ("cannot be evaluated", "x = 1.0", "choose others"),
        )
        for bad, start in (
            (m * g * L**2 / y, {x: 1.0, y: 0.0}),
            (m * g * sqrt(L) * sqrt(y), {x: 1.0, y: -0.1}),
        )
    ),
]
NAMES = [
    (
        {
            "parameters": (*CONSTANTS, Parameter(symbols("x"), 1.0, "m")),
            "constraints": [Holonomic("y", ROD.expression), ROD, ROD],
        },
        (
            *("'x' is used twice, by a coordinate and a parameter", "constraint 'y'", "'Q.y'"),
            *("two constraints are called 'rod'", "rename"),
        ),
    ),
    *(
        (
            {"name": name, "constraints": [Holonomic(name, ROD.expression)]},
            (f"model name {name!r}", f"constraint name {name!r}", "use letters a-z"),
        )
        for name in ("", "my model", 'the "rod"', "a<b", "θ", "1st", "a..b", "a\n", None)
    ),
    (  # LaTeX and Greek are fine in SymPy, not in an FMU
        {
            "coordinates": {x: "m", y: "m", dynamicsymbols("θ"): "rad"},
            "parameters": (*CONSTANTS, Parameter(symbols(r"\tau"), 1.0, "1")),
        },
        ("coordinate name 'θ'", repr(r"\tau")),
    ),
    *(  # departure.surface.velocity.theta must stay one thing
        (
            {"coordinates": {x: "m", y: "m", dynamicsymbols(name): "m"}},
            (f"{name!r} is reserved", "choose another"),
        )
        for name in ("velocity", "time", "t", "der", "count", "solver", "lambda")
    ),
    *(  # Q.A.B is the share of a constraint A in the force on B, bob no variable beside bob.mass
        (
            {
                "coordinates": {x: "m", y: "m", dynamicsymbols(coordinate): "m"},
                "parameters": (*CONSTANTS, Parameter(symbols("bob"), 1.0, "1")),
            },
            parts,
        )
        for coordinate, parts in (
            ("angle.A", ("'angle.A' has 2 words", "three", "'crank.position.x'")),
            ("bob.position.x", ("'bob' is a parameter", "'bob.position.x'", "group", "rename")),
            ("Q.position.x", ("'Q.position.x' is reserved", "choose another")),
            ("bob..x", ("'bob..x' is not a name that FMI allows", "'crank.mass'")),
        )
    ),
    *(  # what no XML file can hold: control characters, halves of surrogate pairs
        (
            {
                "description": f"the{sign}rod",
                "descriptions": {x: f"the{sign}rod"},
                "parameters": (Parameter(m, 1.0, "kg", f"the{sign}rod"), *OTHERS),
                "constraints": [Holonomic("rod", ROD.expression, f"the{sign}rod")],
            },
            ("4 problems", "parameter 'm'", "constraint 'rod'", repr(sign), "leave it out"),
        )
        for sign in ("\x00", "\x1b", "\ufffe", "\ud800")
    ),
]
MECHANICS = [
    (  # no real solution, whatever the start values are
        {"constraints": [Holonomic("rod", x**2 + y**2 + L**2)]},
        ("'rod'", "no configuration", "expected 0", "correct its expression"),
    ),
    (  # at the centre the rod's gradient is zero: no direction leads to the circle
        {"start": {x: 0.0, y: 0.0}},
        ("x = 0.0, y = 0.0", "cannot be projected", "'rod' by -1", "for example x = "),
    ),
    ({"start": {}}, ("'rod', missed by -1", "give x and y a start value")),  # nobody gave the zeros
    (  # x = 0.5 and x = 1 cannot both hold; the innocent constraint is not named
        {
            "constraints": [
                Holonomic("one", x - a),
                Holonomic("level", y),
                Holonomic("two", x - b),
            ],
            "parameters": (*CONSTANTS, Parameter(a, 0.5, "m"), Parameter(b, 1.0, "m")),
        },
        ("'one', 'two'", "contradict each other", "leave one out", "~level"),
    ),
    (
        {
            "constraints": [Nonholonomic("one", x.diff() - a), Nonholonomic("two", x.diff() - b)],
            "parameters": (*CONSTANTS, Parameter(a, 0.5, "m/s"), Parameter(b, 1.0, "m/s")),
        },
        ("'one', 'two'", "no velocities", "leave one out"),
    ),
    (  # they agree in place and speed at the start, and part at once
        {
            "constraints": [
                Holonomic("one", x),
                Holonomic("level", y),
                Holonomic("two", x - g * t**2 / 2),
            ],
            "start": {},
        },
        ("'one', 'two'", "no accelerations", "leave one out", "~level"),
    ),
    (  # nothing determines y''
        {"lagrangian": m * x.diff() ** 2 / 2 - V, "constraints": []},
        ("mass matrix is singular", "'y'", "give it a mass"),
    ),
    (  # pushed to the right, it would go to the left
        {"lagrangian": -K - V},
        ("kinetic energy is negative", "'x' is -1", "'y' is -1", "sign of T in L = T - V"),
    ),
    (
        {"lagrangian": m * (x.diff() ** 2 - y.diff() ** 2) / 2 - V},
        ("the mass of 'y' is -1 ", "~'x' is"),
    ),
    *(  # T = m (x'^2 + y'^2)/2 + c m x' y' is negative along x' = -y' (or x' = y') where |c| > 1
        (
            {"lagrangian": K + coupling * m * x.diff() * y.diff() - V},
            ("negative where 'x', 'y' move together", "eigenvalue -0.5 ", "L = T - V"),
        )
        for coupling in (1.5, -1.5)
    ),
]


@pytest.mark.parametrize(
    ("changes", "parts"), [*EXPRESSIONS, *PLACES, *NUMBERS, *NAMES, *MECHANICS]
)
def test_a_model_that_cannot_be_is_refused_in_words(changes, parts):
    """The term, the field or the constraint, what stands there, what belongs there and what to do, whether it
    is seen when the model is written or when its equations and start are; no traceback from SymPy."""
    says(refusal(lambda: prepare(pendulum(**changes))), *parts)


@pytest.mark.parametrize(
    ("changes", "parts"),
    [
        (  # an ellipse, not the rod's circle
            {"embedding": Embedding({theta: "rad"}, {x: L * sin(theta), y: 2 * L * cos(theta)})},
            ("embedding", "'rod' becomes", "expected 0", "correct"),
        ),
        (  # they only turn by their sum
            {
                "embedding": Embedding(
                    {theta: "rad", z: "rad"}, {x: L * sin(theta + z), y: L * cos(theta + z)}
                )
            },
            ("theta, z", "not independent"),
        ),
        ({}, ("scene 'P'", "no minimal formulation", "Embedding", "'multipliers'")),
    ],
)
def test_minimal_coordinates_that_cannot_be_are_refused(changes, parts):
    """The embedding holds the constraints with as many coordinates as there are degrees of freedom; without
    one, x^2 + y^2 - L^2 is linear in no coordinate."""
    says(refusal(lambda: prepare(pendulum(**changes), MINIMAL)), *parts)


def test_a_kink_that_does_not_move_is_no_kink():
    """|L| of a parameter is a number; x^2 (y - L) is a product, and vanishes with a gradient at y = L."""
    for f in (x**2 + y**2 - Abs(L) ** 2, (x**2 + L**2) * (y + L * sqrt(1) * 4 / 5)):
        prepare(pendulum(constraints=[Holonomic("rod", f)]))


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
                lagrangian=K + m * z.diff() ** 2 / 2 - V,
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


def test_the_value_of_a_parameter_decides_whether_kinetic_energy_is_negative():
    """With |c| < 1 m (x'^2 + y'^2)/2 + c m x' y' is positive; with |c| = 1 there is a motion without mass, no
    negative one."""
    lagrangian = K + c * m * x.diff() * y.diff() - V

    def model(value):
        return pendulum(lagrangian=lagrangian, parameters=(*CONSTANTS, Parameter(c, value)))

    for value in (0.5, 1.0):
        assert prepare(model(value)).structure.degrees_of_freedom == 1
    says(refusal(lambda: prepare(model(2.0)), ModelError), "eigenvalue -1 ")


def test_mass_that_vanishes_at_the_start_is_no_negative_one():
    """A folded linkage: m L^2 (0.3 + 3 c cos(theta)) is 0 at theta = pi, and -6e-17 kg m^2 in doubles."""
    assert 0.3 + 3 * 0.1 * math.cos(math.pi) < 0
    folded = m * L**2 * (0.3 + 3 * c * cos(theta)) * theta.diff() ** 2 + m * x.diff() ** 2 / 2
    made = pendulum(
        lagrangian=folded - m * g * x,
        coordinates={x: "m", theta: "rad"},
        parameters=(*CONSTANTS, Parameter(c, 0.1)),
        constraints=[Holonomic("band", x - L * theta)],
        start={x: math.pi, theta: math.pi},
    )
    assert prepare(made).structure.degrees_of_freedom == 1


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        ({"formulation": "maximal"}, ("'maximal'", "multipliers, nullspace, minimal")),
        ({"method": "euler"}, ("'euler'", "dop853, rk4, radau")),
        ({"stop_time": math.nan}, ("stop_time = nan", "positive")),
        ({"step_size": 0.0}, ("step_size = 0.0", "positive")),
        ({"tolerance": -1e-8}, ("tolerance = -1e-08", "positive")),
        ({"tolerance": 1000.0}, ("tolerance = 1000.0", "at most 0.1")),
        ({"tolerance": "1e-6"}, ("tolerance = '1e-6'", "positive number")),
        ({"stop_time": "4"}, ("stop_time = '4'", "positive number")),
        ({"step": "0.1"}, ("step = '0.1'", "positive number")),
        ({"name": "N" * 300}, ("'NNNN", "has 300 letters, expected at most 200")),  # a file's name
        ({"name": "my scene"}, ("'my scene'", "not a name that FMI allows")),
    ],
)
def test_a_scene_that_cannot_be_is_refused(change, parts):
    """The field, its value and what is known."""
    says(refusal(lambda: Scene(**({"name": "P"} | change)), ModelError), *parts)


def test_names_that_mean_something_in_python_are_fine(tmp_path):
    """Parameters called q, p, sqrt, def and lambda_ do not disturb the generated code."""
    names = [symbols(n, positive=True) for n in ("q", "p", "sqrt", "def", "lambda_", "u")]
    factor = names[0] * names[1] * names[2] * names[3] * names[4] * names[5]
    model = pendulum(
        lagrangian=K - V * factor,
        parameters=(*CONSTANTS, *(Parameter(n, 1.0, "1") for n in names)),
    )
    run = simulate(build_fmu(model, tmp_path, target="python", check=False), stop_time=0.2)
    assert run["x"] == pytest.approx(simulate(pendulum(), stop_time=0.2)["x"], rel=1e-6)


def test_descriptions_with_markup_survive(built):
    """What XML and HTML would take for markup comes back as it was written."""
    text = "<b>\"bob\" & 'rod'</b> ]]> \\ {curly} θ é 100 %"
    path = built(
        pendulum(
            description=text,
            descriptions={x: text},
            parameters=(Parameter(m, 1.0, "kg", text), *OTHERS),
            constraints=[Holonomic("rod", ROD.expression, text)],
        )
    )
    description = fmpy.read_model_description(str(path))
    described = {v.name: v.description for v in description.modelVariables}
    assert description.description == text
    assert described["m"] == described["x"] == text
    assert text in described["lambda.rod"]
    with zipfile.ZipFile(path) as archive:
        page = archive.read("documentation/index.html").decode()
    assert '<b>"bob"' not in page
    assert simulate(path, stop_time=0.02)["x"][0] == 0.6


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

# the derivative of x(t) by another time is 0, and the kinetic energy would lack it; that of road by s is none
LATE = (
    GOOD
    + """
from sympy import diff
s = symbols("t", positive=True)
slope = (m * s**2).diff(s); late = m * x.diff(s) ** 2 / 2 + m * diff(x, s) ** 2 / 2
"""
)


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
        (LATE, ("2 problems", "line 12: x.diff(s) is 0", "line 12: diff(x, s) is 0", "x.diff()")),
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


def test_a_temporary_folder_that_cannot_be_written_is_told(tmp_path, monkeypatch):
    """The disk of temporary files is full, or not there: one line, and no traceback."""

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(tempfile, "mkdtemp", full)
    words = ["build", str(MODELS / "pendulum.py"), "--out", str(tmp_path)]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 3
    says(" ".join(done.stderr.split()), "No space left on device", "TMPDIR", "~Traceback")


@pytest.mark.skipif(sys.platform == "win32", reason="no limits of files there")
@pytest.mark.parametrize(
    ("command", "kept"),
    [
        ("verify FMU --json KEPT", "all.json"),
        *(
            pytest.param(words, kept, marks=pytest.mark.thorough)
            for words, kept in (
                ("simulate FMU --csv KEPT", "runs.csv"),
                ("sweep FMU --vary m1=1,2 --out KEPT", "runs.csv"),
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
from lagfmu.cli import main
main()
"""


def test_a_file_that_is_missing_or_no_python_file_is_refused(tmp_path):
    """A missing file, a folder, whose Python files are named, a text file."""
    (tmp_path / "bead.py").write_text("")
    says(refusal(lambda: load(tmp_path / "none.py"), ModelError), "none.py", "no such file")
    message = refusal(lambda: load(tmp_path), ModelError)
    says(message, str(tmp_path), "this is a folder, expected a Python file", "bead.py")
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
        refusal(lambda: build_fmu(pendulum(), tmp_path, check=False), BuildError),
        "Is a directory",
        "a folder of that name is there",
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


@pytest.mark.parametrize(
    ("entry", "content"),
    [
        *(("resources/lagfmu.json", c) for c in (None, b"", b"{", b"[]", b'{"format": 99}')),
        *(("modelDescription.xml", c) for c in (b"", b"<xml", b"<a/>", b"\xff\xfe", None)),
        *(("binaries/linux64/Atwood.so", c) for c in (None, b"no ELF")),
        ("resources/SCRIPT.py", b"raise RuntimeError('x')"),
    ],
)
def test_an_fmu_with_a_missing_or_damaged_part_is_not_verified(request, tmp_path, entry, content):
    """The record of closed forms, the description, the binary or the script: one message with the FMU's name,
    and the process stands in the folder that it stood in."""
    source = request.getfixturevalue("python_fmu" if "SCRIPT" in entry else "native_fmu")("Atwood")
    with zipfile.ZipFile(source) as archive:
        if "SCRIPT" in entry:
            script = archive.read("resources/slavemodule.txt").decode().strip()
            entry = entry.replace("SCRIPT", script)
    here = Path.cwd()
    path = rewritten(source, tmp_path / "X.fmu", entry, content)
    says(refusal(lambda: verify(path)), "X.fmu", entry if entry.endswith("xml") else "")
    assert Path.cwd() == here


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


@pytest.mark.parametrize(
    ("options", "parts"),
    [
        ({"start_values": {"mass": 1.0}}, ("mass", "m1")),
        ({"start_values": {"m1": "heavy"}}, ("m1", "'heavy'")),
        ({"start_values": {"m1": math.nan}}, ("'m1' = nan", "finite")),
        ({"start_values": {"m1": 0.0}}, ("'m1' = 0.0, expected a positive number", "~Fatal py")),
        ({"start_values": {"solver.method": "euler"}}, ("euler", "dop853")),
        ({"stop_time": -1.0}, ("stop_time", "-1.0")),
        ({"step_size": 0.0}, ("step_size", "0.0")),
        ({"step_size": math.inf}, ("step_size", "inf")),
        ({"step_size": 1e-12}, ("step_size = 1e-12", "at most 1e+07", "larger step_size")),
        ({"tolerance": 0.0}, ("tolerance = 0.0", "positive")),
        ({"tolerance": 1e3}, ("tolerance = 1000.0", "at most 0.1")),
        ({"tolerance": math.nan}, ("tolerance = nan",)),
        # a step that the FMU discards is no short trajectory that verify finds in order
        ({"start_values": {"solver.maximum_step": 1e-12}}, ("t = 0.0 s", "step")),
    ],
)
@pytest.mark.parametrize("how", ["simulate", "verify", "in this process"])
def test_a_run_that_cannot_be_is_refused(native_fmu, prepared, how, options, parts):
    """An unknown variable, a text for a number, a time that is none: of an FMU, and of a model in this
    process, in the same words."""
    run, source = verify if how == "verify" else simulate, native_fmu("Atwood")
    if how == "in this process":
        source, options = prepared("Atwood"), options | {"target": "python"}
    says(refusal(lambda: run(source, **options)), *parts)


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


NO_STEPS = {
    0.0: "0.0 s, expected a positive number",
    -0.1: "-0.1 s, expected a positive number",
    math.nan: "nan s, expected a positive number",
    math.inf: "inf s, expected a positive number",
    1e300: "communication step",
    1e-300: "communication step",
}


@pytest.mark.parametrize("method", ["dop853", "radau", "rk4"])
def test_a_communication_step_that_cannot_be_done_is_refused(fmu, method):
    """fmi2Discard (fmi2Error where it can be returned and the call is illegal), with the reason in the
    log; nothing has changed, and the next step is done."""
    with instance(fmu("PendulumCartesian")) as one, instance(fmu("PendulumCartesian")) as calm:
        if method == "rk4" and not one.native:
            pytest.skip("the python target has no rk4")
        for each in (one, calm):
            each.start({"solver.method": method})
            each.step(0.1)
        before = one.outputs()
        for step, reason in [*NO_STEPS.items(), *NO_STEPS.items()]:
            illegal = one.native and not 0 < step < math.inf
            with refused(one, ERROR if illegal else DISCARD, *reason.split(", ")):
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


def test_a_value_that_is_not_finite_leaves_all_as_they_were(fmu):
    """The force keeps its last value; fmi2SetReal with a good and a bad value sets neither."""
    with instance(fmu("CartPendulum")) as one:
        one.fmu.setupExperiment()
        one.fmu.enterInitializationMode()
        references = [one.variables[n].valueReference for n in ("M", "m")]
        before = one.fmu.getReal(references)
        with refused(one, FATAL, "'m' = nan"):
            one.fmu.setReal(references, [7.0, math.nan])
        assert one.fmu.getReal(references) == before
        one.set("F", 3.0)
        one.fmu.exitInitializationMode()
        before = one.get("der(s,2)")
        for bad in (math.nan, math.inf):
            with refused(one, FATAL, f"'F' = {bad!r}", "finite"):
                one.set("F", bad)
        assert one.get("der(s,2)") == before
        one.step(0.1)


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
    k, a = symbols("k a", positive=True)
    for name, potential, place, words in (
        ("Steep", exp(x / a), 1e4, "beyond 1.8e308"),
        ("Root", sqrt(x / a), -1.0, "outside of its domain"),
    ):
        model = point_mass(
            name,
            "x",
            energy=-k * potential,
            parameters=[Parameter(k, 1.0, "J"), Parameter(a, 1.0, "m")],
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
