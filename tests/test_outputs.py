"""Outputs that a model names itself: tension, height, power; from lambda, Q, accelerations and inputs."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import fmpy
import numpy as np
import pytest
from instance import instance
from runs import simulate_fmu
from sympy import Abs, cos, log, sin, sqrt, symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo.pendulums import on_hemisphere, pendulum

from lagfmu import (
    Contact,
    Embedding,
    Holonomic,
    Input,
    Model,
    Output,
    Parameter,
    Scene,
    build_fmu,
    force_of_constraint,
    multiplier,
    simulate,
)
from lagfmu.errors import ModelError, SimulationError
from lagfmu.testing import OWN, prepare, python_source, quantities, with_outputs
from lagfmu.testing import documentation_page as page

t = dynamicsymbols._t
x, y, r, theta, F = dynamicsymbols("x y r theta F")
m, g, L = symbols("m g L", positive=True)
CONSTANTS = (Parameter(m, 2.0, "kg"), Parameter(g, 9.81, "m/s^2"), Parameter(L, 1.5, "m"))


swing = partial(pendulum, mass=2.0, length=1.5, start={x: 0.9, y: -1.2})
TENSION = Output("tension", -2 * L * multiplier("rod"), "N", "pull of the rod on the bob")
HEIGHT = Output("bob.height", y + L, "m")
SPEED = Output("bob.speed", sqrt(x.diff() ** 2 + y.diff() ** 2), "m/s")


# ---------------------------------------------------------------------------- values


@pytest.mark.parametrize("formulation", ["multipliers", "nullspace", "minimal"])
def test_the_tension_carries_the_weight_and_turns_the_bob(formulation):
    """T = m v^2/L - m g y/L, whichever way lambda is found; Q and the acceleration are its parts."""
    outputs = [
        TENSION,
        Output("pull", sqrt(force_of_constraint(x) ** 2 + force_of_constraint(y) ** 2), "N"),
        Output("felt", m * sqrt(x.diff(t, 2) ** 2 + (y.diff(t, 2) + g) ** 2), "N"),
    ]
    embedding = Embedding({theta: "rad"}, {x: L * sin(theta), y: -L * cos(theta)}, {theta: 0.6})
    model = swing(outputs=outputs, embedding=embedding)
    run = simulate(model, 0.5, 0.1, scene=Scene("P", formulation))
    square = run["der(x)"] ** 2 + run["der(y)"] ** 2
    expected = 2.0 * (square - 9.81 * run["y"]) / 1.5
    for name in ("tension", "pull", "felt"):
        np.testing.assert_allclose(run[name], expected, rtol=1e-12)


def test_an_output_alone_is_what_it_is_among_all(native_fmu, tmp_path):
    """A scene of the tension, or of the height, keeps only what they need, and their values."""
    whole = simulate(native_fmu("PendulumCartesian"), 1.0)
    description = fmpy.read_model_description(str(native_fmu("PendulumCartesian")))
    model = swing(
        outputs=[TENSION, HEIGHT],
        parameters=[replace(p, value=v) for p, v in zip(CONSTANTS, (1.0, 9.81, 1.0), strict=True)],
        start={x: np.sin(1.0), y: -np.cos(1.0)},
    )
    scene = Scene("Alone", stop_time=1.0, outputs=["tension"])
    assert [v.name for v in prepare(model, scene).table.outputs] == ["tension"]
    alone = simulate(build_fmu(model, tmp_path, scene, target="native"), 1.0)
    assert alone.dtype.names == ("time", "tension")
    np.testing.assert_allclose(alone["tension"], whole["tension"], rtol=0, atol=0)
    found = {q.name: q.group for q in quantities(description)}
    assert found["tension"] == found["bob.height"] == OWN


def test_an_output_of_ones_own_is_read_as_any_other(native_fmu):
    """In model exchange; with a derivative, which for the tension -2 L lambda is -2 L times that of lambda,
    and for the height is that of y; in a figure under its name and unit."""
    path = str(native_fmu("PendulumCartesian"))
    run = {"stop_time": 1.0, "output_interval": 0.1, "relative_tolerance": 1e-9}
    names = ["tension", "bob.height"]
    near, far = (
        simulate_fmu(path, fmi_type=kind, output=names, **run)
        for kind in ("CoSimulation", "ModelExchange")
    )
    for name in names:
        np.testing.assert_allclose(far[name], near[name], rtol=0, atol=1e-5)
    with instance(path) as one:
        one.start({})
        at = {n: v.valueReference for n, v in one.variables.items()}
        of = [at["tension"], at["lambda.rod"], at["bob.height"]]
        for known, slope in (("x", 0.0), ("y", 1.0)):
            tension, multiplied, height = one.fmu.getDirectionalDerivative(of, [at[known]], [1.0])
            assert multiplied != 0
            length = one.get("L")
            assert tension == pytest.approx(-2 * length * multiplied, rel=1e-12)
            assert height == slope
    (axis,) = simulate(path, 0.5).plot("tension").axes
    assert axis.get_ylabel() == "[N]"
    assert [line.get_label() for line in axis.lines] == ["tension"]


def test_what_needs_no_lambda_needs_no_solution_for_it():
    """The speed and the height of the bob are read of theta alone: no multiplier is solved for."""
    embedding = Embedding({theta: "rad"}, {x: L * sin(theta), y: -L * cos(theta)}, {theta: 0.6})
    model = swing(outputs=[TENSION, HEIGHT, SPEED], embedding=embedding)
    made = prepare(model, Scene("Height", outputs=["bob.height", "bob.speed"]))
    assert made.formulation == "minimal"
    assert made.coded.equations.bare
    run = simulate(made, 0.5, 0.1)
    energy = 9.81 * run["bob.height"] + run["bob.speed"] ** 2 / 2
    np.testing.assert_allclose(energy, energy[0], rtol=1e-7)


@pytest.mark.parametrize("target", ["python", "native"])
def test_a_quotient_has_another_value_where_it_has_none(target, tmp_path):
    """Tangential over normal force, 0 in flight: finite on both sides of the departure."""
    weight = Output("slope", m * g * sin(theta) / multiplier("surface"), "1", otherwise=-1)
    model = on_hemisphere("Dome", 0.3, mass=2.0, outputs=(weight,))
    run = simulate(build_fmu(model, tmp_path, Scene("Dome", step_size=0.05), target=target), 1.0)
    closed = run["contact.surface"]
    assert closed[0]
    assert not closed[-1]
    tangent = 2.0 * 9.81 * np.sin(run["theta"][closed])
    np.testing.assert_allclose(run["slope"][closed], tangent / run["lambda.surface"][closed])
    assert (run["slope"][~closed] == -1).all()


HEADING = Output("heading", x.diff() / SPEED.expression, "1")


@pytest.mark.parametrize("target", ["python", "native"])
def test_a_value_that_is_none_is_refused_by_name(target, tmp_path):
    """The direction of a bob that is brought to rest: 0/0, told with the output and the remedy."""
    moving = {x: 0.9, y: -1.2, x.diff(): 0.8, y.diff(): 0.6}
    path = build_fmu(swing(outputs=[HEADING], start=moving), tmp_path, target=target)
    assert simulate(path, 0.1)["heading"][0] == pytest.approx(0.8, rel=1e-12)
    with pytest.raises(SimulationError) as refused:
        simulate(path, 0.1, start_values={"der(x)": 0.0, "der(y)": 0.0})
    for part in ("'heading' has no value at t = 0", "otherwise"):
        assert part in str(refused.value)


def test_a_model_whose_output_has_no_value_at_its_start_is_refused(tmp_path):
    """Told when the FMU is built, by the same words, and no file is left."""
    with pytest.raises(ModelError, match="'heading' has no value"):
        build_fmu(swing(outputs=[HEADING]), tmp_path, target="native", check=False)
    assert not list(tmp_path.iterdir())


def test_an_output_of_many_coordinates_reads_those_that_it_holds():
    """The middle of two balls is as long an expression among 30 balls as among 3: code for n bodies that each
    tell something of their own grows with n."""

    def code(n: int) -> str:
        places = dynamicsymbols(f"x1:{n + 1}")
        model = Model(
            "Balls",
            lagrangian=sum(m * p.diff() ** 2 / 2 for p in places),
            coordinates=dict.fromkeys(places, "m"),
            parameters=CONSTANTS[:1],
            outputs=[Output("middle", (places[0] + places[2]) / 2, "m")],
        )
        text = python_source(prepare(model).coded)
        return text[text.index("def output_0(") :].partition("\n\n")[0]

    assert code(30) == code(3)


def test_what_an_output_depends_on_is_told(prepared):
    """The power F s' depends on F and s' at an instant; the tension on all that moves, and on F."""
    table = prepared("CartPendulum").table
    assert table["drive.power"].depends == ("F", "der(s)")
    assert {"F", "x", "der(x)"} <= set(table["tension"].depends)
    assert table["tension"].unit.name == "N"
    assert "F" in table["drive.power"].depends_initially


def test_the_page_shows_what_an_output_is_made_of(prepared):
    """The expression among the equations, the variable with unit and description in the table."""
    text = page(prepared("PendulumCartesian"))
    assert "Outputs of the model" in text
    assert "pull of the rod on the bob" in text


# ---------------------------------------------------------------------------- what is refused

SOLVED_FOR = ("solved for", "Friction", "Output")
OUTPUTS = [  # of the driven pendulum, and what is wrong
    (Output("tension", -2 * multiplier("rod"), "N"), ("'tension'", "N/m", "expected N")),
    (Output("h", y + m, "m"), ("output 'h'", "'m' (unit kg)", "unit m")),
    (Output("h", y + L, ""), ("output 'h' has no unit", "give one")),
    (Output("h", y + L, "degC"), ("output 'h'", "an offset or logarithmic scale")),
    (Output("tension", multiplier("rope"), "N/m"), ("lambda.rope", "constraint", "rod")),
    (Output("f", force_of_constraint(r), "N"), ("Q.r", "coordinate", "x, y")),
    (Output("f", symbols("k") * y, "N"), ("output 'f'", "k is neither", "declare")),
    (Output("jerk", x.diff(t, 3), "m/s^3"), ("output 'jerk'", "der(x,3)", "at most 2")),
    (Output("rate", F.diff(), "W"), ("output 'rate'", "der(F)", "prescribed")),
    (Output("x", y, "m"), ("'x' is used twice", "rename")),
    (Output("x.high", y, "m"), ("'x' is a coordinate", "x.high", "group")),
    (Output("energy.mine", m * g * y, "J"), ("'energy.mine'", "reserved", "energy, ", "choose")),
    (Output("bob height", y, "m"), ("'bob height'", "not a name that FMI allows", "crank.mass")),
    (Output("h", "y", "m"), ("output 'h'", "no SymPy expression")),
    (Output("h", y, "m", description=3), ("output 'h'", "expected a text")),
    (Output("h", y, "m", otherwise=m), ("output 'h', otherwise", "kg", "m")),
    (y + L, ("outputs hold", "Output")),
]


@pytest.mark.parametrize(
    ("changes", "parts"),
    [
        *(({"outputs": [output]}, parts) for output, parts in OUTPUTS),
        ({"outputs": [HEIGHT, HEIGHT]}, ("'bob.height' is used twice",)),
        ({"outputs": TENSION}, ("outputs = ", "expected a list")),
        # lambda and Q in a force, in L or in a constraint
        ({"forces": {x: -multiplier("rod") * x.diff() / L}}, SOLVED_FOR),
        ({"lagrangian": m * x.diff() ** 2 - force_of_constraint(y) * x}, SOLVED_FOR),
        ({"constraints": [Holonomic("rod", x - L * cos(multiplier("rod")))]}, SOLVED_FOR),
        *(  # lambda of a contact is 0 in the open: a quotient by it needs a value there
            (
                {
                    "constraints": [Contact("rod", L**2 - x**2 - y**2)],
                    "outputs": [Output("ratio", expression, unit)],
                },
                ("output 'ratio'", "while the contact 'rod' is open", "otherwise=0"),
            )
            for expression, unit in (
                (1 / multiplier("rod"), "m/N"),
                (force_of_constraint(x) / (2 * force_of_constraint(y)), "1"),
                (log(Abs(multiplier("rod"))), "1"),
            )
        ),
    ],
)
def test_what_an_output_cannot_be_is_told(changes, parts):
    """The output, what is wrong with it, what was expected and what to do; what is solved for cannot stand in
    the equations."""
    with pytest.raises(ModelError) as refused:
        swing(**({"inputs": [Input(F, "N")], "forces": {x: F}} | changes))
    for part in parts:
        assert part in str(refused.value)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("tension = -2*L*lambda.rod [N]", TENSION),
        ("bob.speed = sqrt(der(x)^2 + der( y )**2) [m/s]", SPEED),
        ("felt = m*abs(der(x,2)) + 0.5*Q.y [N]", None),
    ],
)
def test_an_output_of_the_command_line_is_that_of_the_file(text, expected):
    """The FMU's names in a formula mean the model's coordinates, rates, lambda and Q."""
    (found,) = with_outputs(swing(), [text]).outputs
    if expected is None:
        value = m * Abs(x.diff(t, 2)) + force_of_constraint(y) / 2
        assert (found.expression - value).evalf() == 0
    else:
        assert (found.name, found.expression, found.unit) == (
            expected.name,
            expected.expression,
            expected.unit,
        )


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("tension", ("NAME = EXPRESSION [UNIT]", "lambda.rod [N]")),
        ("tension = -2*L*lambda.rope [N]", ("'lambda.rope' is unknown", "'lambda.rod'")),
        ("h = y + [m]", ("'y +' is no formula", "expected an expression as in")),
        ("h = exec(1) [m]", ("'exec' is no function",)),
        ("h = y if x else L [m]", ("'if' is unknown",)),
        ("h = (y, L) [m]", ("none of the things that a formula is made of",)),
        ("h = sqrt() [m]", ("sqrt cannot take 0 arguments",)),
        ("h = y*y [m]", ("output 'h'", "m2", "expected m")),
    ],
)
def test_a_formula_that_cannot_be_read_is_told(text, parts):
    """What is wrong in it, and what was expected; nothing of it is executed."""
    with pytest.raises(ModelError) as refused:
        with_outputs(swing(), [text])
    for part in parts:
        assert part in str(refused.value)
