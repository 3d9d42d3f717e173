"""Start values that miss the constraints: which of them move, and how that is told."""

from __future__ import annotations

import logging
import re
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.fmi1 import FMICallException
from instance import instance
from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols
from typer.testing import CliRunner
from zoo import point_mass
from zoo.linkages import pinned_rod

from lagfmu import Holonomic, Model, Parameter, Scene, simulate, sweep
from lagfmu.errors import ModelError, SimulationError
from lagfmu.testing import StartMovedWarning, app, prepare, write

x, y, theta = dynamicsymbols("x y theta")
Built = Callable[..., Path]
HALF = 0.75  # m, from the pivot to the middle of the rod
FILE = """
import sys
sys.path.insert(0, {folder!r})
from zoo.linkages import pinned_rod
from lagfmu import Scene
from sympy.physics.mechanics import dynamicsymbols
x, theta = dynamicsymbols("x theta")
model = pinned_rod({start})
scenes = [Scene("PinnedRod", stop_time=0.01, step_size=0.01)]
closed_forms = []
"""


@pytest.fixture(params=["python", "native"])
def rod(request: pytest.FixtureRequest, built: Built) -> Path:
    """The pinned rod with theta and theta' in the model's start, and nothing said of x and y."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", StartMovedWarning)
        return built(pinned_rod({theta: 0.3, theta.diff(): 1.86}), target=request.param)


class Heard(logging.Handler):
    """What lagfmu's logger is told."""

    def __init__(self) -> None:
        super().__init__()
        self.records: list[logging.LogRecord] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.records.append(record)


def begun(fmu: Path, **values: float) -> tuple[dict[str, float], list[str]]:
    """The values at t = 0, and what was said of those that moved."""
    given = {k.replace("_dot", ""): v for k, v in values.items() if not k.endswith("_dot")}
    given |= {f"der({k[:-4]})": v for k, v in values.items() if k.endswith("_dot")}
    heard = Heard()
    logging.getLogger("lagfmu").addHandler(heard)
    logging.getLogger("lagfmu").setLevel(logging.INFO)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        run = simulate(fmu, stop_time=1e-3, step_size=1e-3, start_values=given)
    logging.getLogger("lagfmu").removeHandler(heard)
    told = [str(w.message) for w in caught if issubclass(w.category, StartMovedWarning)]
    told += [record.getMessage() for record in heard.records]
    return {name: float(run[name][0]) for name in run.dtype.names}, told


def test_given_start_values_stay_and_the_omitted_ones_follow(rod):
    """theta' = 1.86 rad/s is given: the middle moves at l/2 theta', and theta' stays what it was."""
    at, told = begun(rod)
    assert (at["theta"], at["der(theta)"]) == (0.3, 1.86)
    assert at["x"] == pytest.approx(HALF * np.cos(0.3), rel=1e-14)
    assert at["der(y)"] == pytest.approx(HALF * 1.86 * np.cos(0.3), rel=1e-14)
    (line,) = told  # four values in one, and no warning: none of them was given
    head, _, values = line.partition(": ")
    assert head == "start values that were left out follow from the constraints"
    named = dict(v.split(" = ") for v in values.split(", "))
    assert {n: float(v) for n, v in named.items()} == {
        n: at[n] for n in ("x", "y", "der(x)", "der(y)")
    }


def test_what_the_importer_sets_stays_and_the_given_values_follow(rod):
    """x = 0.6 set by the importer turns the rod to arccos(0.8), though the model gives theta = 0.3; that
    theta' = 1.86 stays is no question of positions."""
    at, told = begun(rod, x=0.6)
    assert (at["x"], at["der(theta)"]) == (0.6, 1.86)
    assert at["theta"] == pytest.approx(np.arccos(0.8), rel=1e-14)
    assert any("start value theta = 0.3 misses" in t and repr(at["theta"])[:12] in t for t in told)


@pytest.mark.parametrize("target", ["python", "native"])
def test_inertia_alone_moves_no_value_that_meets_no_constraint(target: str, built: Built) -> None:
    """A cart's pendulum is held at another angle than is given: the cart, which no constraint holds, stays
    where it was, said or not, however its inertia is coupled to the pendulum's."""
    m, L, held = symbols("m L held", positive=True)
    cart = Model(
        name="HeldPendulum",
        lagrangian=m * (x.diff() + L * theta.diff() * cos(theta)) ** 2 / 2 + m * x.diff() ** 2,
        coordinates={x: "m", theta: "rad"},
        constraints=[Holonomic("clamp", theta - held)],
        parameters=[Parameter(m, 1.0, "kg"), Parameter(L, 0.5, "m"), Parameter(held, 0.3, "rad")],
        start={theta: 0.3},
    )
    fmu = built(cart, target=target)
    at, _ = begun(fmu, held=0.31, theta_dot=2.0)
    assert at["theta"] == pytest.approx(0.31, rel=1e-15)
    assert (at["x"], at["der(x)"], at["der(theta)"]) == (0.0, 0.0, 0.0)
    at, told = begun(fmu, held=0.31, theta=0.32, theta_dot=2.0, x=0.25, x_dot=1.0)
    assert at["theta"] == pytest.approx(0.31, rel=1e-15)
    assert (at["x"], at["der(x)"], at["der(theta)"]) == (0.25, 1.0, 0.0)
    assert [line.split()[2] for line in told] == ["theta", "der(theta)"]


def test_velocities_that_are_set_move_the_least_where_all_are(rod):
    """x' and y' are set, theta = 0.3 is given: of (x', y') the part along the circle stays."""
    at, _ = begun(rod, x_dot=0.5, y_dot=1.0)
    along = -0.5 * np.sin(0.3) + np.cos(0.3)
    assert at["der(x)"] == pytest.approx(-along * np.sin(0.3), rel=1e-8)
    assert at["der(y)"] == pytest.approx(along * np.cos(0.3), rel=1e-8)


def test_a_value_that_is_the_described_one_is_not_set(rod):
    """Importers write all start values back: theta = 0.3 set to what is described stays a given value."""
    at, _ = begun(rod, theta=0.3, x=0.6)
    assert at["x"] == 0.6
    described = {"theta": 0.5, "x": 0.0, "der(x)": 0.0}
    run = simulate_fmu(str(rod), stop_time=1e-3, start_values=described, output=["theta", "x"])
    assert run["theta"][0] == 0.5
    assert run["x"][0] == pytest.approx(HALF * np.cos(0.5), rel=1e-15)


def test_a_zero_that_a_user_asks_for_is_meant(rod):
    """theta' = 1.86 rad/s is given and nothing is said of y': y' = 0, though that is also what an omitted
    value is described as, stays, and the rod rests."""
    at, told = begun(rod, y_dot=0.0)
    assert (at["der(y)"], at["der(theta)"]) == pytest.approx((0.0, 0.0), abs=1e-15)
    runs = sweep(rod, {"der(y)": [0.0]}, keep=["der(theta):max"], stop_time=1e-6)
    assert abs(runs["der(theta):max"][0]) < 1e-4
    assert any("start value der(theta) = 1.86 misses" in t for t in told)


def test_changed_parameters_move_omitted_values_first(rod):
    """With another length the middle lies elsewhere on the same ray: theta stays."""
    at, _ = begun(rod, l=3.0)
    assert at["theta"] == 0.3
    assert np.hypot(at["x"], at["y"]) == pytest.approx(1.5, rel=1e-14)


def test_a_model_whose_own_start_contradicts_itself_is_neither_built_nor_simulated(tmp_path):
    """x = 0.5 with theta = 0.3 misses x = l/2 cos(theta) by 0.2 m: both are named with both numbers."""
    prepared = prepare(pinned_rod({theta: 0.3, x: 0.5}))
    for run in (lambda: write(prepared, tmp_path), lambda: simulate(prepared, target="python")):
        with pytest.raises(ModelError) as refused:
            run()
        text = str(refused.value)
        assert "start gives theta = 0.3" in text
        assert "start gives x = 0.5" in text
        assert "misses the constraints ('pinx' by -0.217 m)" in text
    assert not list(tmp_path.iterdir())


def test_every_move_is_said_by_show_simulate_and_build(tmp_path):
    """A start given to 8 digits is moved onto the constraint by 1e-9 m, and each command says so."""
    near = float(HALF * np.cos(0.3) + 1e-9)
    path = tmp_path / "rod.py"
    here = str(Path(__file__).parent)
    path.write_text(FILE.format(folder=here, start=f"{{theta: 0.3, x: {near!r}}}"))
    run = CliRunner()
    for command in (
        ["show", str(path)],
        ["simulate", str(path)],
        ["build", str(path), "--out", str(tmp_path), "--no-check"],
    ):
        result = run.invoke(app, command)
        assert result.exit_code == 0, result.output
        said = " ".join((result.output + result.stderr).split())
        assert repr(near) in said, command
        assert "x = " in said, command
        assert re.search(r"left out follow from the constraints: .*\by = |y is left out", said), (
            command
        )
        assert not re.search(r"warning: start value y\b", said), command


def spherical(angle: float) -> Model:
    """A spherical pendulum in the angle from below and the azimuth, which has no inertia below."""
    phi = dynamicsymbols("phi")
    m, g, length = symbols("m g l", positive=True)
    speed = theta.diff() ** 2 + sin(theta) ** 2 * phi.diff() ** 2
    return Model(
        name="Spherical",
        lagrangian=m * length**2 * speed / 2 + m * g * length * cos(theta),
        coordinates={theta: "rad", phi: "rad"},
        parameters=[
            Parameter(m, 1.0, "kg"),
            Parameter(g, 9.81, "m/s^2"),
            Parameter(length, 1.0, "m"),
        ],
        start={theta: angle, phi.diff(): 0.5},
    )


def test_a_coordinate_without_inertia_is_named():
    """Below the pivot the azimuth means nothing, m l^2 sin(theta)^2 = 0: the model is refused with phi, and
    with what to do: elsewhere phi has inertia."""
    with pytest.raises(ModelError, match=r"'phi' has neither mass .* elsewhere it has: start at"):
        prepare(spherical(0.0))


@pytest.mark.parametrize("target", ["python", "native"])
def test_a_start_without_inertia_is_refused_by_the_fmu(target, built):
    """The same when an importer sets theta = 0: the FMU's message names phi."""
    fmu = built(spherical(0.5), target=target)
    with pytest.raises(SimulationError, match=r"a coordinate has (no|neither) mass.* \(phi\)"):
        simulate(fmu, start_values={"theta": 0.0})


L_ROD = symbols("l", positive=True)


@pytest.fixture(params=["python", "native"])
def placed(request: pytest.FixtureRequest, built: Built) -> Path:
    """The pinned rod whose start places its middle by the rod's length."""
    model = pinned_rod({theta: 0.3, x: L_ROD / 2 * cos(0.3), y: L_ROD / 2 * sin(0.3)})
    return built(model, target=request.param)


def test_a_start_of_parameters_follows_them(placed: Path) -> None:
    """A rod of 2 m that starts at 0.3 rad has its middle at (cos, sin) of it: nothing has to be moved."""
    at, told = begun(placed, l=2.0)
    assert (at["x"], at["y"]) == (pytest.approx(np.cos(0.3)), pytest.approx(np.sin(0.3)))
    assert at["theta"] == 0.3
    assert told == []


def test_a_start_that_is_set_goes_before_its_expression(placed: Path) -> None:
    """x = 1 of a rod of 2 m is where it stands upright; y, which the model gives, has to follow."""
    at, told = begun(placed, l=4.0, x=1.0)
    assert at["x"] == pytest.approx(1.0, rel=1e-12)
    assert at["x"] ** 2 + at["y"] ** 2 == pytest.approx(4.0, rel=1e-12)
    assert any(text.startswith("start value y = 0.59") for text in told), told


def test_a_start_set_to_the_described_value_counts_as_not_set(placed: Path) -> None:
    """Some importers set every value of the description: that is no wish."""
    described = read_model_description(str(placed)).modelVariables
    x0 = next(float(v.start) for v in described if v.name == "x")
    given = {"l": 2.0, "x": x0}
    at = simulate_fmu(str(placed), stop_time=1e-3, start_values=given, output=["x"])[0]
    assert at["x"] == pytest.approx(np.cos(0.3))


def test_a_described_start_that_a_user_asks_for_is_meant(built: Built) -> None:
    """A spring of 2 m that starts at 1 m, the start of one of 0.5 m: in `simulate` and sweeps alike."""
    model = spring(2 * REACH)
    assert simulate(model, 0.1, start_values={"a": 2.0, "x": 1.0})["x"][0] == pytest.approx(1.0)
    fmu = built(model)
    assert simulate(fmu, 0.1, start_values={"a": 2.0, "x": 1.0})["x"][0] == pytest.approx(1.0)
    runs = sweep(fmu, {"a": [2.0], "x": [1.0, 3.0]}, keep=["x:max"], stop_time=0.1)
    assert runs["x:max"].values.ravel() == pytest.approx([1.0, 3.0])


def test_a_start_of_parameters_is_approximate_and_says_so() -> None:
    """FMI: a value that the FMU may change is no exact start; what it follows is in its description."""
    table = prepare(spring(2 * REACH), Scene("Spring", outputs=["der(x)"])).table
    assert (table["x"].initial, table["x"].start) == ("approx", 1.0)
    assert table["x"].depends_initially == ("a",)
    assert table["x"].description.endswith("starts at 2*a unless another start is set")
    assert "a" in table  # nothing but the start depends on it


REACH, MASS, OTHER, STIFFNESS = symbols("a m M k", positive=True)


def spring(start: object) -> Model:
    """A mass on a spring, drawn out at the start."""
    return Model(
        "Spring",
        lagrangian=MASS * x.diff() ** 2 / 2 - STIFFNESS * x**2 / 2,
        coordinates={x: "m"},
        parameters=[
            Parameter(REACH, 0.5, "m"),
            Parameter(MASS, 1.0, "kg"),
            Parameter(OTHER, 2.0, "kg"),
            Parameter(STIFFNESS, 1.0, "N/m"),
        ],
        start={x: start},
    )


@pytest.mark.parametrize(
    ("start", "says"),
    [
        (MASS, "start of x.*has unit kg, expected m"),
        (2 * x, "start of x = 2.x holds t, x, expected a number or an expression of parameters"),
        (symbols("b"), "holds b"),
        (REACH * MASS / (2 * MASS - OTHER), "is zoo at the values of the parameters"),
    ],
)
def test_a_start_that_cannot_be_found_is_refused(start: object, says: str) -> None:
    """A mass is no length, a coordinate not known yet, a quotient by 0 no number."""
    with pytest.raises(ModelError, match=says):
        spring(start)


@pytest.mark.parametrize("target", ["python", "native"])
def test_a_start_that_is_infinite_at_what_is_set_is_refused(target: str, built: Built) -> None:
    """a m/(M - m) at m = M: the FMU says which start value has no value."""
    fmu = built(spring(REACH * MASS / (OTHER - MASS)), target=target)
    assert begun(fmu, m=1.5)[0]["x"] == pytest.approx(1.5)
    with pytest.raises(SimulationError, match="start value of x is an expression of parameters"):
        simulate(fmu, start_values={"m": 2.0})


def test_what_has_no_start_has_one_as_soon_as_something_else_is_set(built: Built) -> None:
    """A bob on a rod of L = 1 m and a rail at y = H + V t: above the rod's end there is no place for it, and
    each question is told so; below it, after a reset and in a state saved before, x = sqrt(L^2 - y^2)."""
    L, H, V = symbols("L H V", positive=True)
    model = point_mass(
        "Railed",
        "x y",
        [
            Holonomic("rod", x**2 + y**2 - L**2),
            Holonomic("rail", y - H - V * dynamicsymbols._t),
        ],
        up=y,
        parameters=[Parameter(L, 1.0, "m"), Parameter(H, 0.6, "m"), Parameter(V, 0.1, "m/s")],
        start={x: 0.8, y: 0.6},
    )
    fmu = built(model, Scene("Railed", tolerance=1e-9))
    with instance(fmu) as one:

        def begins(start_time: float = 0.0) -> None:
            one.fmu.setupExperiment(startTime=start_time)
            one.fmu.enterInitializationMode()

        def refused() -> None:
            told = len(one.log)
            for _ in range(3):
                with pytest.raises(FMICallException):
                    one.get("lambda.rod")
            texts = [text for _, _, text in one.log[told:]]
            assert len(texts) == 3
            assert len({*texts}) == 1

        begins()
        saved = one.fmu.getFMUState()
        one.set("H", 1.5)
        refused()
        one.set("L", 2.5)
        assert one.get("x") == pytest.approx(2.0)
        one.set("L", 1.0)
        refused()
        one.fmu.setFMUState(saved)
        assert one.get("x") == pytest.approx(0.8)
        one.set("H", 1.5)
        refused()
        one.fmu.reset()
        begins(start_time=5.0)
        refused()
        one.set("V", 0.04)
        assert one.get("y") == pytest.approx(0.8)
        one.fmu.freeFMUState(saved)


def test_the_minimal_formulation_starts_its_own_coordinates() -> None:
    """x and y by expressions of l, where the form steps theta: it would have to solve for it."""
    model = pinned_rod({x: L_ROD / 2 * cos(0.3), y: L_ROD / 2 * sin(0.3)})
    with pytest.raises(ModelError, match="by expressions of parameters, which the minimal form"):
        prepare(model, Scene("Rod", formulation="minimal"))
    assert prepare(model, Scene("Rod", outputs=["Q.theta"])).formulation == "multipliers"
