"""Constraints that follow from others: as many steps as without them, and the same motion."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmi2
import fmpy
import numpy as np
import pytest
from conftest import of_each_kind
from fmpy.fmi1 import FMICallException
from instance import instance
from runs import simulate_fmu
from sympy import sqrt, symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass
from zoo.linkages import rods
from zoo.redundant import SYSTEMS
from zoo.tops import door

from lagfmu import Contact, Holonomic, Model, Output, Parameter, Scene, multiplier, simulate
from lagfmu.bodies import Body, Gravity, Ground, Revolute, mechanism
from lagfmu.errors import ModelError, SimulationError
from lagfmu.testing import Stage, prepare

pytestmark = [
    pytest.mark.filterwarnings("ignore::lagfmu.testing.RedundantConstraintWarning"),
    pytest.mark.filterwarnings("ignore::lagfmu.testing.StartMovedWarning"),
]
SPAN = 1.0  # s
UPPER = [multiplier(f"upper.{a}") for a in "xyz"]
COMPONENTS = {
    "across": UPPER[0],
    "shear": sqrt(UPPER[0] ** 2 + UPPER[1] ** 2),
    "along": UPPER[2],
    "whole": sqrt(sum(f**2 for f in UPPER)),
    "sum": UPPER[2] + multiplier("lower.z"),
}
Pair = tuple[Path, Path]
EACH = pytest.mark.parametrize(
    "name", of_each_kind(SYSTEMS, kinds=("platform", "four_bar", "ball", "trammel"))
)


@pytest.fixture
def pair(built: Any) -> Callable[[str], Pair]:
    """pair(NAME): the system without redundant constraints, and with them."""

    def get(name: str) -> Pair:
        models = (SYSTEMS[name](redundant) for redundant in (False, True))
        scene = {"stop_time": SPAN, "step_size": SPAN / 20}
        plain, redundant = (built(m, Scene(m.name, **scene)) for m in models)
        return plain, redundant

    return get


def run(fmu: Path, method: str, tolerance: float) -> Any:
    return simulate(fmu, tolerance=tolerance, start_values={"solver.method": method})


def compare(fmus: Pair, method: str, tolerance: float) -> None:
    """Steps within 1.5, and the motions within what two integrations of this tolerance differ by."""
    plain, redundant = (run(fmu, method, tolerance) for fmu in fmus)
    assert redundant["solver.steps"][-1] <= 1.5 * plain["solver.steps"][-1]
    for name in plain.dtype.names:
        if name.startswith(("x", "y", "a", "turn")):
            assert np.abs(redundant[name] - plain[name]).max() < max(1e4 * tolerance, 1e-9), name


@EACH
def test_redundant_constraints_cost_no_steps(name, pair):
    """Stages lie off the constraints, where rows that depend on each other ask for different accelerations:
    as many as are independent on the constraints say what acts."""
    for method, tolerance in (("dop853", 1e-6), ("dop853", 1e-12), ("radau", 1e-9), ("rk4", 1e-6)):
        compare(pair(name), method, tolerance)


def test_an_instance_that_has_not_begun_goes_on_by_the_rows_of_a_saved_state(pair):
    """Of a four-bar with a redundant row: which rows stand for all is part of the state, and an instance that
    never initialized has none of its own. One state, one future, to the last bit."""
    fmu = pair("four_bar")[1]
    with instance(fmu) as one, instance(fmu, "fresh") as fresh:
        one.start()
        one.step(0.25)
        saved = one.fmu.serializeFMUState(one.fmu.getFMUState())
        fresh.fmu.setFMUState(fresh.fmu.deserializeFMUState(saved))
        fresh.time = one.time
        for each in (one, fresh):
            each.step(0.25)
        assert fresh.outputs() == one.outputs()


def test_a_loop_that_closes_against_the_count_of_freedoms_needs_the_steps_of_its_order(native_fmu):
    """Bennett's linkage at a 10,000th of the tolerance: a method of order 8 takes 10^(4/8) = 3.2 times the
    steps (it took 240, by rates of another place where rows are at small angles to each other)."""
    steps = [
        simulate(native_fmu("Bennett"), tolerance=tol)["solver.steps"][-1] for tol in (1e-8, 1e-12)
    ]
    assert steps[1] < 4 * steps[0]


@pytest.mark.parametrize("name", ["Bennett", "Door"])
def test_drift_changes_the_forces_by_as_much_as_it_is(native_fmu, tmp_path, name):
    """Off the constraints, where an importer's integrator leaves it, rows that follow from others seem to be
    independent: what they ask for differs by the drift, over which angles as small are no forces."""
    library = fmi2.Library(native_fmu(name), tmp_path)
    one = library.continuous()
    forces = [n for n in library.variables if n.startswith("force.") and n.endswith(".norm")]
    held, x = (
        np.array(one.reals(forces)),
        one.array("GetContinuousStates", library.description.numberOfContinuousStates),
    )
    drift = np.random.default_rng(3).uniform(-1, 1, (5, len(x)))
    for eps in (1e-9, 1e-7, 1e-5):
        for along in drift:
            one.states(np.array(x) + eps * along)
            assert np.abs(np.array(one.reals(forces)) - held).max() < 100 * eps * held.max()


def test_rows_that_follow_from_others_hold_as_they_do(native_fmu):
    """Bennett's linkage next to where it folds flat: each row holds to 20 roundings, also those that no
    step of the projection asked for (47e-15, from a step by the others that made them worse)."""
    run = simulate_fmu(
        native_fmu("Bennett"),
        start_values={"one.inertia.yy": 0.00225},
        output_interval=0.5 / 60,
    )
    rows = [n for n in run.dtype.names if n.startswith("residual.")]
    assert len(rows) == 20
    assert max(np.abs(run[n]).max() for n in rows) < 20 * np.finfo(float).eps


@EACH
def test_redundant_constraints_cost_no_accuracy(name, pair):
    """Q is what it is without them within two tolerances, at points inside steps too: the angle between rows
    that depend on each other everywhere is rounding, and tells of no singular configuration, next to
    which a step would be allowed errors of 1e-10."""
    tolerance = 1e-13
    plain, redundant = (run(fmu, "dop853", tolerance) for fmu in pair(name))
    forces = [n for n in plain.dtype.names if re.fullmatch(r"Q\.\w+", n)]
    largest = max(np.abs(plain[n]).max() for n in forces)
    for n in forces:
        assert np.abs(redundant[n] - plain[n]).max() < 2 * tolerance * largest, n


@EACH
def test_an_importers_integrator_does_not_meet_them_either(name, pair, monkeypatch):
    """Model exchange: as many evaluations of the derivatives as without the redundancy, within 1.5."""
    count = 0
    plain = fmpy.fmi2.FMU2Model.getDerivatives

    def counted(*arguments: Any) -> Any:
        nonlocal count
        count += 1
        return plain(*arguments)

    monkeypatch.setattr(fmpy.fmi2.FMU2Model, "getDerivatives", counted)
    for tolerance in (1e-4, 1e-6):
        found = []
        for fmu in pair(name):
            count = 0
            simulate_fmu(
                str(fmu),
                fmi_type="ModelExchange",
                relative_tolerance=tolerance,
                output_interval=SPAN / 20,
            )
            found.append(count)
        assert found[1] <= 1.5 * found[0]


@pytest.mark.parametrize(
    "name", of_each_kind(["trammel", "platform", "closed_chain"], kinds=("trammel", "platform"))
)
def test_no_unit_of_mass_says_which_constraints_follow_from_others(name, pair):
    """With all masses 2^-30 of what they were nothing moves otherwise: rows that nearly depend on each
    other, off the constraints, were taken for independent beside light masses (errors of 1e-5)."""
    fmu = pair(name)[1]
    ordinary, light = (
        simulate(fmu, tolerance=1e-9, start_values={"m": 1.5 * 2.0**power}) for power in (0, -30)
    )
    for q in ordinary.dtype.names:
        if q.startswith(("x", "y", "a", "turn")):
            assert np.abs(light[q] - ordinary[q]).max() < 1e-10 * max(1, np.abs(ordinary[q]).max())


def test_multipliers_of_redundant_constraints_are_shared_with_least_norm(pair):
    """Three parallel cranks carry the platform together: the force on it is that of two cranks, and what no
    measurement of the motion can tell, which crank carries how much, is flagged."""
    plain, redundant = (run(fmu, "dop853", 1e-10) for fmu in pair("platform"))
    for name in ("Q.x", "Q.y", "Q.turn"):
        np.testing.assert_allclose(redundant[name], plain[name], atol=1e-6)
    assert not redundant["unique.crank3"].any()
    assert plain["unique.crank1"].all()


@pytest.mark.parametrize("count", [4, 24])
def test_configurations_beside_the_start_are_near_it(monkeypatch, count):
    """Dependent constraints are told at four configurations beside the start, each a tenth of a bar away: a
    few of Newton's steps, however long the linkage of bars of 1 m is (it took 40, or did not arrive)."""
    taken = []
    nearest = Stage.nearest

    def counted(self, *arguments):
        taken.append(1)
        return nearest(self, *arguments)

    monkeypatch.setattr(Stage, "nearest", counted)
    zigzag = [(0.8 * k, 0.6 * (k % 2)) for k in range(1, count + 1)]
    found = prepare(rods(f"Zigzag{count}", zigzag)).structure
    assert found.degrees_of_freedom == count - 2
    assert 4 <= len(taken) <= 4 * 7


def hinged() -> Model:
    """The door, which is asked of each component."""
    return door(outputs=[Output(n, f, "N", unique=True) for n, f in COMPONENTS.items()])


@pytest.mark.parametrize("target", ["native", "python"])
def test_a_door_tells_which_components_of_its_forces_are_unique(target):
    """On two hinges that each hold a point: across the hinge line each force is unique, and its norm; along
    it only the sum is, the weight, whose derivative is 0."""
    run = simulate(hinged(), target=target, stop_time=0.5)
    assert all(run[f"unique.{n}"].all() for n in ("across", "shear", "sum"))
    assert not any(run[f"unique.{n}"].any() for n in ("along", "whole"))
    np.testing.assert_allclose(run["sum"], 2.0 * 9.81, rtol=1e-12)


def test_a_unique_output_has_a_derivative_where_its_multipliers_have_none(built):
    """The weight on both hinges does not change along the motion; that on one is not known."""
    with instance(built(hinged())) as one:
        one.start()
        one.step(0.1)
        known = [one.variables["wz"].valueReference]
        total, one_alone = (one.variables[n].valueReference for n in ("sum", "along"))
        assert one.fmu.getDirectionalDerivative([total], known, [1.0]) == pytest.approx(
            [0], abs=1e-9
        )
        with pytest.raises(FMICallException):
            one.fmu.getDirectionalDerivative([one_alone], known, [1.0])


def test_a_light_bob_on_a_heavy_cart_leaves_the_centre_of_mass_where_it_is():
    """1 mg beside 1,000 t, from rest at 1 rad: M X + m (x - x0) = 0, so that the cart moves by 1e-12 m,
    and the rod has lambda = -m g (3 cos theta - 2 cos 1)/(2 L) as on a cart that is held."""
    X, x, y = dynamicsymbols("X x y")
    M, m, g, L = symbols("M m g L", positive=True)
    model = Model(
        name="Unlike",
        lagrangian=M * X.diff() ** 2 / 2 + m * (x.diff() ** 2 + y.diff() ** 2) / 2 - m * g * y,
        coordinates={X: "m", x: "m", y: "m"},
        constraints=[Holonomic("rod", (x - X) ** 2 + y**2 - L**2)],
        parameters=[
            Parameter(M, 1e6, "kg"),
            Parameter(m, 1e-6, "kg"),
            Parameter(g, 9.81, "m/s^2"),
            Parameter(L, 1.0, "m"),
        ],
        start={X: 0.0, x: np.sin(1), y: -np.cos(1)},
    )
    run = simulate(model, target="native", stop_time=2.0, step_size=0.1, tolerance=1e-10)
    assert np.abs(1e12 * run["X"] + run["x"] - np.sin(1)).max() < 1e-11
    force = -1e-6 * 9.81 * (-3 * run["y"] - 2 * np.cos(1)) / 2
    np.testing.assert_allclose(run["lambda.rod"], force, rtol=1e-8)
    assert run["solver.steps"][-1] < 100


def test_rows_that_come_to_contradict_each_other_are_named():
    """x = L, and x = L + a t^6/T^4: at the start they are one row, up to the fourth derivative; then one says
    that x rests, and the other that it does not.  That is no singular place."""
    x, y = dynamicsymbols("x y")
    m, L, a, T = symbols("m L a T", positive=True)
    model = point_mass(
        "Contradicted",
        "x y",
        [
            Holonomic("still", x - L),
            Holonomic("led", x - L - a * dynamicsymbols._t**6 / T**4),
        ],
        parameters=[Parameter(L, 1.0, "m"), Parameter(a, 1.0, "m/s^2"), Parameter(T, 1.0, "s")],
        forces={y: m * a},
        start={x: L},
    )
    with pytest.raises(
        SimulationError, match="contradict each other at this state: 'still', 'led'"
    ):
        simulate(model, target="native", stop_time=1.0, step_size=0.1)


@pytest.mark.parametrize("target", ["native", "python"])
def test_a_force_is_not_unique_as_long_as_what_is_redundant_is_closed(target):
    """A block falls onto two props of one height and is pulled up with m g t/(1 s): in the air either force
    is 0 and unique; on both their sum, m g (1 - t/(1 s)), is, and neither is; after 1 s both are again."""
    y = dynamicsymbols("y")
    m, g, T, h = symbols("m g T h", positive=True)
    left, right = multiplier("left"), multiplier("right")
    block = point_mass(
        "Props",
        "y",
        [Contact("left", y), Contact("right", y)],
        up=y,
        mass=2.0,
        parameters=[Parameter(T, 1.0, "s"), Parameter(h, 0.2, "m")],
        forces={y: m * g * dynamicsymbols._t / T},
        start={y: h},
        outputs=[
            Output("one", left, "N", unique=True),
            Output("both", left + right, "N", unique=True),
        ],
    )
    run = simulate(block, target=target, stop_time=1.3, step_size=0.05, tolerance=1e-9)
    t, closed = run["time"], run["contact.left"] & run["contact.right"]
    np.testing.assert_array_equal(run["contact.left"], run["contact.right"])
    assert [*closed[[0, 3, 5, 19, 21, 26]]] == [False, False, True, True, False, False]
    np.testing.assert_array_equal(run["unique.one"], ~closed)
    np.testing.assert_array_equal(run["unique.left"], ~closed)
    assert run["unique.both"].all()
    np.testing.assert_allclose(run["both"], np.where(closed, 2 * 9.81 * (1 - t), 0), atol=1e-9)


def test_what_is_unique_may_be_read_alone(built):
    """A scene that reads nothing else holds the output all the same; a constraint's name is refused."""
    run = simulate_fmu(built(hinged(), Scene("Asked", outputs=["unique.sum"])), stop_time=0.1)
    assert run["unique.sum"].all()
    with pytest.raises(ModelError, match=r"'unique\.upper\.x' would be two things"):
        door(outputs=[Output("upper.x", multiplier("upper.x"), "N", unique=True)])


def on_two_hinges(*names: str) -> Model:
    """A door that swings on hinges as far above as below its centre of mass, declared in this order."""
    ground, leaf = Ground(), Body("leaf", mass=20.0, inertia=(6.7, 7.8, 1.1))
    z = {"lower": -0.7, "upper": 0.7}
    hinges = [Revolute(n, ground.at((0, 0, z[n])), leaf.at((-0.4, 0, z[n]))) for n in names]
    start = {f"angle.{names[0]}": 0.2, f"der(angle.{names[0]})": 1.5}
    return mechanism(
        "Leaf", bodies=[leaf], joints=hinges, loads=[Gravity((0, 0, -9.81))], start=start
    )


def test_both_hinges_of_a_door_bear_alike_whichever_was_declared_first(built):
    """Nothing tells the hinges apart along their line: each bears half the weight in every sample of a swing;
    and who is named first does not matter."""
    runs = [
        simulate(built(on_two_hinges(*names)), 1.0, 0.05, 1e-9)
        for names in (("lower", "upper"), ("upper", "lower"))
    ]
    for run in runs:
        np.testing.assert_allclose(run["force.lower.z"], 20 * 9.81 / 2, rtol=1e-9)
        np.testing.assert_allclose(run["force.upper.z"], 20 * 9.81 / 2, rtol=1e-9)
        assert not run["unique.lower.z"].any()
    for name in (
        f"{of}.{hinge}.{x}"
        for of in ("force", "torque")
        for hinge in ("lower", "upper")
        for x in "xyz"
    ):
        np.testing.assert_allclose(runs[0][name], runs[1][name], rtol=0, atol=1e-8 * 20 * 9.81)
