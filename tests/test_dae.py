"""FMI-LS-DAE 1.0.0-alpha.1: the manifest of an FMU that is built with `dae`, the switch to DAE mode,
multipliers that an importer sets, and IDA (SUNDIALS) that solves for them, events included."""

from __future__ import annotations

import contextlib
from ctypes import byref, c_bool, c_double, c_size_t, c_void_p
from dataclasses import replace

import fmpy
import numpy as np
import pytest
from dae import MANIFEST, NAMESPACE, Importer, Manifest, solve
from fmpy.validation import validate_fmu
from sympy import sin, symbols
from sympy.physics.mechanics import dynamicsymbols
from test_forged_states import HEAD, forged
from zoo import point_mass, redundant, two_feet
from zoo.linkages import FOUR_BAR, rods

from lagfmu import (
    Contact,
    Friction,
    Holonomic,
    Input,
    Model,
    Nonholonomic,
    Parameter,
    Scene,
    build_fmu,
    multiplier,
    simulate,
)
from lagfmu.errors import ModelError, UsageError
from lagfmu.testing import RedundantConstraintWarning, find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")

x, y, z, phi, u = dynamicsymbols("x y z phi u")
m, g, L, J, w = symbols("m g L J w", positive=True)
t = dynamicsymbols._t
MASS, GRAVITY, LENGTH = 2.0, 9.81, 1.5
ENABLE = "solver.dae"

pendulum = point_mass(
    "Pendulum",
    "x y",
    [Holonomic("rod", (x**2 + y**2 - L**2) / 2)],
    up=y,
    mass=MASS,
    gravity=GRAVITY,
    parameters=[Parameter(L, LENGTH, "m")],
    start={x: 0.9, y: -1.2, x.diff(): 0.8, y.diff(): 0.6},
)
sleigh = Model(  # a knife edge, its heading turned by an input
    name="Sleigh",
    lagrangian=m * (x.diff() ** 2 + y.diff() ** 2) / 2 + J * phi.diff() ** 2 / 2,
    coordinates={x: "m", y: "m", phi: "rad"},
    constraints=[
        Nonholonomic("edge", x.diff() * sin(phi) - y.diff() * (1 - phi**2 / 2)),
    ],
    forces={x: m * g * sin(w * t), phi: u},
    inputs=[Input(u, "N*m", 0.3)],
    parameters=[
        *pendulum.parameters[:2],
        Parameter(J, 0.5, "kg*m^2"),
        Parameter(w, 2.0, "rad/s"),
    ],
    start={x.diff(): 1.0},
)
four_bar = rods("FourBar", FOUR_BAR)


def called(model) -> str:
    """Its name."""
    return getattr(model, "name", str(model))


@pytest.fixture(scope="module")
def path(built, prepared):
    """path(MODEL), path(NAME): its FMU."""

    def get(model):
        if isinstance(model, str):
            model = prepared(model).model
        return built(model, fmi=3, dae=True)

    return get


@pytest.fixture
def one(path, library3):
    """one(MODEL): an instance for model exchange in the continuous-time mode of DAE mode."""
    return lambda model: running(library3(path(model)), dae=True)


def running(library, dae=False):
    """As importers have it, by default those of an ordinary differential equation."""
    made = library(exchange=True)
    if dae:
        configure(made)
    made.start()
    made.updates()
    made.does("EnterContinuousTimeMode")
    return made


def configure(made) -> None:
    """DAE mode."""
    made.does("EnterConfigurationMode")
    made.set(ENABLE, True)
    made.does("ExitConfigurationMode")


def put(made, *states: float) -> None:
    """The states q1, v1, ..."""
    made.does("SetContinuousStates", (c_double * len(states))(*states), c_size_t(len(states)))


def accelerations(made) -> list[float]:
    """By the derivatives of the states."""
    size = c_size_t()
    made.does("GetNumberOfContinuousStates", byref(size))
    return made.array("GetContinuousStateDerivatives", size.value)[1::2]


# ---------------------------------------------------------------------------- the manifest


def test_the_standards_judges_take_the_fmu(path):
    """It is an ordinary FMU for them: fmpy's schema and rules have nothing to say."""
    for model in (four_bar, "SlippingSphere"):
        assert validate_fmu(str(path(model))) == []


def test_the_manifest_is_that_of_the_standard(path):
    """Its root and attributes; the parameter that switches DAE mode on, structural, fixed and false; each
    multiplier is algebraic; for each there is one residual; all else as in the core standard."""
    found = Manifest(path("SlippingSphere"))
    assert MANIFEST == "extra/org.fmi-standard.fmi-ls-dae/fmi-ls-manifest.xml"
    assert found.root.tag == "fmiDAEManifest"
    told = {k.removeprefix(f"{NAMESPACE}fmi-ls-"): v for k, v in found.root.attrib.items()}
    assert told == {
        "name": "org.fmi-standard.fmi-ls-dae",
        "version": "1.0.0-alpha.1",
        "description": "Layered standard for differential-algebraic equations",
    }
    parts = [e.tag for e in found.root]
    assert parts == ["EnableDAEParameter", "AlgebraicVariables", "ModelStructure"]
    variables = fmpy.read_model_description(str(path("SlippingSphere"))).modelVariables
    called = {int(v.valueReference): v for v in variables}
    switch = called[found.enable]
    assert (switch.name, switch.type, switch.start) == (ENABLE, "Boolean", "false")
    assert (switch.causality, switch.variability) == ("structuralParameter", "fixed")
    rows = [called[k].name.removeprefix("lambda.") for k in found.algebraic]
    assert [called[k].name for k in found.residuals] == [f"equation.{c}" for c in rows]
    kinds = [e.tag for e in found.root[2]]
    order = ["Output", "ContinuousStateDerivative", "InitialUnknown", "EventIndicator", "Residual"]
    assert list(dict.fromkeys(kinds)) == order
    assert all(
        e.attrib.keys() <= {"valueReference", "dependencies", "dependenciesKind"}
        for e in found.root[2]
    )


def test_multipliers_have_nominals(path, prepared):
    """Of the order of what they are: m g for a rod that bears a mass, or a ball on a floor."""
    for model, name, size in (
        (pendulum, "lambda.rod", 13.0),
        ("BouncingBall", "lambda.floor", 9.81),
    ):
        told = {v.name: v for v in fmpy.read_model_description(str(path(model))).modelVariables}
        assert size / 3 < float(told[name].nominal) < 3 * size


@pytest.mark.parametrize("model", [pendulum, sleigh, four_bar, "SlippingSphere"], ids=called)
def test_what_an_unknown_depends_on_is_listed_and_nothing_else_moves_it(path, tmp_path, model):
    """Derivatives, residuals and outputs change with no state, input or multiplier that the manifest leaves
    out, and with every one that it lists of the residuals where the rows act."""
    made = Importer(path(model), tmp_path)
    manifest = made.manifest
    listed = manifest.knowns("ContinuousStateDerivative") | manifest.knowns("Output")
    residuals = manifest.knowns("Residual")
    listed |= residuals
    outputs = [k for k in listed if made.kinds[k] == "Float64"]
    at = made.begin() + 0.01 * np.cos(np.arange(1.0, len(made.known) + 1))
    moved = np.zeros((len(outputs), len(at)), dtype=bool)
    for step in (0.1, -0.07, 0.03):
        for k in range(len(at)):
            made.put(0.2, at)
            before = made.get(outputs)
            made.put(0.2, at + step * (np.arange(len(at)) == k))
            moved[:, k] |= made.get(outputs) != before
    found = {
        o: {made.known[k] for k in np.flatnonzero(row)}
        for o, row in zip(outputs, moved, strict=True)
    }
    for o, by in found.items():
        assert by <= {*listed[o]}, made.names[o]
    for o, on in residuals.items() if model != "SlippingSphere" else ():
        assert {*on} & {*made.known} - {manifest.algebraic[manifest.residuals.index(o)]} <= found[o]
    made.close()


# ---------------------------------------------------------------------------- the switch


def test_without_the_switch_it_is_the_ordinary_fmu(path, built, library3):
    """Bit for bit the accelerations and multipliers of the FMU that was built without `dae`."""
    plain, made = running(library3(built(pendulum, fmi=3))), running(library3(path(pendulum)))
    for each in (plain, made):
        put(each, 1.0, 0.5, -1.3, 0.25)
    assert accelerations(made) == accelerations(plain)
    assert made.get("lambda.rod") == plain.get("lambda.rod")
    assert made.get(ENABLE) is False


def test_dae_mode_is_switched_on_in_configuration_mode_until_the_reset(path, library3):
    """It can be read in every mode from then on; in configuration mode no other value is set."""
    made = library3(path(pendulum))(exchange=True)
    configure(made)
    assert made.get(ENABLE) is True
    made.start()
    assert made.get(ENABLE) is True
    made.does("Reset")
    assert made.get(ENABLE) is False
    made.does("EnterConfigurationMode")
    function, arguments = made.set_call("m", 3.0)
    assert "'m' is no structural parameter" in made.refuses(function, *arguments)
    unknown = made.references(["m"])
    unknown[0] = 9999
    text = made.refuses("SetBoolean", unknown, c_size_t(1), byref(c_bool(True)), c_size_t(1))
    assert "value reference 9999" in text
    assert "configuration mode" in made.refuses(
        "GetBoolean", unknown, c_size_t(1), byref(c_bool()), c_size_t(1)
    )
    assert "configuration mode" in made.refuses("EnterConfigurationMode")
    made.does("ExitConfigurationMode")
    assert "'instantiated'" in made.refuses("ExitConfigurationMode")


def test_the_switch_is_refused_outside_of_configuration_mode_and_in_co_simulation(path, library3):
    """By its name, with the reason."""
    library = library3(path(pendulum))
    made = library(exchange=True)
    function, arguments = made.set_call(ENABLE, True)
    for each in (made, library(exchange=True).start()):
        assert f"'{ENABLE}' is a structural parameter" in each.refuses(function, *arguments)
    made.start()
    assert "'event mode'" in made.refuses("EnterConfigurationMode")
    stepping = library()
    stepping.does("EnterConfigurationMode")
    assert "DAE mode is for Model Exchange" in stepping.refuses(function, *arguments)
    stepping.set(ENABLE, False)


def test_an_fmu_without_structural_parameters_has_no_configuration_mode(built, library3):
    """As the standard says."""
    made = library3(built(pendulum, fmi=3))(exchange=True)
    assert "fmi3EnterConfigurationMode" in made.refuses("EnterConfigurationMode")


def test_dependencies_in_dae_mode_are_told_by_the_manifest(path, library3):
    """Those of modelDescription.xml hold without it."""
    made = library3(path(pendulum))(exchange=True)
    ask = made.references(["der(x,2)"])[0], byref(c_size_t())
    made.does("GetNumberOfVariableDependencies", *ask)
    configure(made)
    assert "the manifest" in made.refuses("GetNumberOfVariableDependencies", *ask)


def test_multipliers_are_set_in_the_continuous_time_mode_of_dae_mode_alone(path, built, library3):
    """Not by an importer that has not switched it on, of co-simulation, before, or in event mode; not where
    there is none; and to finite numbers."""
    library = library3(path(pendulum))
    stepping, made = library().start(), running(library)
    function, arguments = made.set_call("lambda.rod", 1.0)
    for each in (stepping, made, library(exchange=True).start()):
        text = each.refuses(function, *arguments)
        assert "'lambda.rod'" in text
        assert "outside of DAE mode" in text
    made = library(exchange=True)
    configure(made)
    assert "in continuous-time mode alone" in made.refuses(function, *arguments)
    assert "in continuous-time mode alone" in made.start().refuses(function, *arguments)
    plain = running(library3(built(pendulum, fmi=3)))
    assert "is calculated and cannot be set" in plain.refuses(function, *arguments)
    made = running(library, dae=True)
    for value in (np.nan, np.inf):
        function, arguments = made.set_call("lambda.rod", value)
        assert "'lambda.rod' = " in made.refuses(function, *arguments)


# ---------------------------------------------------------------------------- multipliers that are given


def test_accelerations_follow_from_the_multiplier_that_is_set(one):
    """m x'' = lambda x, m y'' = -m g + lambda y, whatever the state, set with lambda in one call; and the
    equation says what is missing to f'' = x x'' + y y'' + x'^2 + y'^2."""
    made = one(pendulum)
    names = ["x", "der(x)", "y", "der(y)", "lambda.rod"]
    values = (c_double * 5)(1.0, 0.5, -1.3, 0.25, -7.0)
    made.does("SetFloat64", made.references(names), c_size_t(5), values, c_size_t(5))
    ax, ay = -7.0 * 1.0 / MASS, -GRAVITY + 7.0 * 1.3 / MASS
    assert accelerations(made) == pytest.approx([ax, ay], rel=1e-14)
    assert made.floats(["lambda.rod", "Q.x", "Q.rod.y"]) == pytest.approx([-7.0, -7.0, 9.1])
    assert made.get("residual.rod") == pytest.approx((1.0 + 1.69 - LENGTH**2) / 2)
    assert made.get("equation.rod") == pytest.approx(ax - 1.3 * ay + 0.25 + 0.0625)


def test_continuous_time_mode_begins_with_the_multipliers_as_the_fmu_solves_for_them(one):
    """After each event too; those that are not set stay what they were, though the state moves on."""
    made = one(four_bar)
    names = [f"lambda.{c.name}" for c in four_bar.constraints]
    equations = [f"equation.{c.name}" for c in four_bar.constraints]
    before = made.floats(names)
    assert np.abs(made.floats(equations)).max() < 1e-11
    made.set(names[1], 12.0)
    held = [before[0], 12.0, *before[2:]]
    assert made.floats(names) == held
    states = made.array("GetContinuousStates", 12)
    states[1] += 1e-4
    put(made, *states)
    assert made.floats(names) == held
    made.does("EnterEventMode")
    assert made.updates() == (False, True), "what has drifted comes back at an event"
    made.does("EnterContinuousTimeMode")
    assert np.abs(made.floats(equations)).max() < 1e-11
    assert np.abs(np.array(made.floats(names)) - before).max() < 1e-2


def test_nothing_is_stabilized_between_events(one):
    """Off the constraints v' is M^-1 (F + G^T lambda) alone; drift beyond a thousandth asks for an event."""
    made = one(pendulum)
    made.set("lambda.rod", 0.0)
    put(made, 0.9, 0.5, -1.2, 0.25)
    assert accelerations(made) == [0.0, -GRAVITY]
    flags = c_bool(), c_bool()
    ask = "CompletedIntegratorStep", c_bool(True), *map(byref, flags)
    put(made, 2.0, 0.5, -2.0, 0.25)
    assert accelerations(made) == [0.0, -GRAVITY]
    made.does(*ask)
    assert flags[0].value


def test_saved_states_know_the_mode_and_the_multipliers(path, library3):
    """A state of DAE mode makes an instance one in DAE mode; one of before makes it an ordinary one."""
    library = library3(path(pendulum))
    plain, made = running(library), running(library, dae=True)
    solved = plain.get("lambda.rod")
    made.set("lambda.rod", -3.0)
    put(made, 0.9, 0.8, -1.2, 0.6)
    given = accelerations(made)
    ordinary, state = plain.saved(), made.saved()
    data = made.bytes_of(state)
    for each, bytes_, expected in ((plain, data, -3.0), (made, plain.bytes_of(ordinary), solved)):
        there = c_void_p()
        each.does("DeserializeFMUState", bytes_, c_size_t(len(bytes_)), byref(there))
        each.does("SetFMUState", there)
        assert each.get("lambda.rod") == expected
        assert each.get(ENABLE) == (expected == -3.0)
    assert accelerations(plain) == given


def test_a_forged_state_gives_no_multipliers(path, built, library3):
    """Neither to an FMU that was built without, nor by a flag that is none."""
    for library, flag in ((library3(built(pendulum, fmi=3)), 1), (library3(path(pendulum)), 3)):
        made, seen = running(library), set()
        good = made.saved()
        whole, solved = made.bytes_of(good), made.get("lambda.rod")
        for at in range(HEAD, min(len(whole) - 4, 1000), 4):
            word = forged(whole, at, flag.to_bytes(4, "little"))
            state = c_void_p()
            made.does("DeserializeFMUState", word, c_size_t(len(word)), byref(state))
            if made.call("SetFMUState", state) != 0:
                seen.add(made.log[-1][2].rpartition(" its ")[2])
                assert made.get("lambda.rod") == solved
            made.does("SetFMUState", good)
        told = {text.removesuffix(".0") for text in seen}
        assert {f"DAE mode is {flag}", "multipliers is 1"} <= told


# ---------------------------------------------------------------------------- rows that do not act


def test_the_equation_of_an_open_contact_is_its_multiplier(one):
    """A ball in flight: lambda = 0 is what its equation asks for, and lambda pushes the ball until it is."""
    made = one("BouncingBall")
    made.set("lambda.floor", 3.0)
    assert made.get("equation.floor") == 3.0
    assert accelerations(made) == [3.0 - 9.81]


def test_the_equation_of_a_friction_that_slips_is_its_law(one):
    """lambda + mu N s/|s| with the N that the importer has set, on a belt."""
    made = one("Belt")
    made.set("lambda.belt", 5.0)
    made.set("lambda.ride", 1.5)
    assert made.get("equation.ride") == pytest.approx(made.get("der(x,2)"))
    assert made.get("indicator.grip.mode") == pytest.approx((2.5 - 1.5) / (2.5 + 1.5), abs=1e-9)
    put(made, 0.06, 0.2, 0.0, 0.0, 0.0)  # k x = 6 N, beyond mu_s m g
    made.does("EnterEventMode")
    made.updates()
    made.does("EnterContinuousTimeMode")
    assert not made.get("sticks.grip")
    assert made.get("lambda.ride") == pytest.approx(0.3 * 9.81)
    put(made, 0.06, 0.1, 0.0, 0.0, 0.0)
    made.set("lambda.belt", 5.0)
    made.set("lambda.ride", 1.0)
    assert made.get("equation.ride") == pytest.approx(1.0 - 0.3 * 5.0)
    assert made.get("der(x,2)") == pytest.approx(1.0 - 6.0)


@pytest.mark.parametrize("twice", [False, True])
def test_of_constraints_that_say_the_same_one_bears_the_force(path, tmp_path, twice):
    """A four-bar whose rods are told twice: the equations are regular, lambda of as many rows as are too many
    is 0, and the generalized forces are those of the four-bar."""
    with pytest.warns(RedundantConstraintWarning) if twice else contextlib.nullcontext():
        made = Importer(path(redundant.four_bar(twice)), tmp_path)
    forces = [k for k, name in made.names.items() if name.startswith("Q.") and name.count(".") == 1]
    n, rows = made.count, len(made.manifest.residuals)
    J = made.jacobian(0.0, made.begin())[n:, n:]
    assert np.linalg.matrix_rank(J) == rows
    assert np.abs(made.get(made.manifest.residuals)).max() < 1e-11
    assert (made.begin()[n:] == 0).sum() == (2 if twice else 0)
    own = simulate(path(redundant.four_bar(twice)), stop_time=0.1, step_size=0.1)
    expected = np.array([own[made.names[k]][0] for k in forces])
    np.testing.assert_allclose(made.get(forces), expected, atol=1e-11 * np.abs(expected).max())
    made.close()


@pytest.mark.filterwarnings("ignore::lagfmu.testing.RedundantConstraintWarning")
def test_two_feet_that_stick_share_their_force_as_an_importer_finds_it(path, tmp_path):
    """Of two rows that say the same one is left out: its lambda is 0, the other bears m g sin(alpha) alone,
    more than the cone of its foot; the pair holds all the same, since some share lies in both cones."""
    made = Importer(path(two_feet.model), tmp_path)
    n = made.count
    assert np.linalg.matrix_rank(made.jacobian(0.0, made.begin())[n:, n:]) == 4
    found = solve(made, np.linspace(0.0, 0.5, 6), 1e-9)
    low, low_rests, up, up_rests = found[-1, n:]
    assert low_rests + up_rests == pytest.approx(-9.81 * np.sin(0.4), rel=1e-9)
    assert low_rests * up_rests == 0
    assert abs(low_rests + up_rests) > 0.5 * max(low, up)
    assert made.events < 10
    grips = [made.references[f"sticks.grip_{foot}"] for foot in ("low", "up")]
    assert made.fmu.getBoolean(grips) == [True, True]
    assert np.abs(found[-1, :n] - found[0, :n]).max() < 1e-9
    made.close()


@pytest.mark.filterwarnings("ignore::lagfmu.testing.RedundantConstraintWarning")
def test_two_feet_that_are_pushed_slip_and_stick_together(path, tmp_path):
    """6 N sin(6 t) along the incline: whichever foot an importer lets bear the force, both slip and stick
    when the pair does, as in co-simulation."""
    pytest.importorskip("sksundae", reason="pip install -e '.[test]'")
    force = Parameter(symbols("P", positive=True), 6.0, "N")
    rate = Parameter(w, 6.0, "rad/s")
    pushed = replace(
        two_feet.model,
        name="Pushed",
        forces={x: force.symbol * sin(w * t)},
        parameters=[*two_feet.model.parameters, force, rate],
    )
    own = simulate(path(pushed), stop_time=2.0, step_size=0.05, tolerance=1e-12)
    made = Importer(path(pushed), tmp_path, 1e-9)
    found = solve(made, np.linspace(0, 2.0, 41), 1e-9)
    columns = {made.names[k]: found[:, j] for j, k in enumerate(made.known)}
    for name in (
        f"{e}.grip_{foot}.count" for e in ("slipping", "sticking") for foot in ("low", "up")
    ):
        assert made.fmu.getInt32([made.references[name]])[0] == own[name][-1] == 2
    for name in ("x", "der(x)", "lambda.low", "lambda.up"):
        np.testing.assert_allclose(columns[name], own[name], atol=1e-7 * np.abs(own[name]).max())
    both = [of["lambda.low_rests"] + of["lambda.up_rests"] for of in (columns, own)]
    np.testing.assert_allclose(*both, atol=1e-8 * np.abs(both[1]).max())
    made.close()


def hung() -> Model:
    """A block on a spring and a rough floor; a bob hangs on it by a rod that is told twice."""
    k, mu, M = symbols("k mu M", positive=True)
    x, z, u, w = dynamicsymbols("x z u w")
    rod = (u - x) ** 2 + (w - z) ** 2 - L**2
    return Model(
        "Hung",
        lagrangian=M * (x.diff() ** 2 + z.diff() ** 2) / 2
        + m * (u.diff() ** 2 + w.diff() ** 2) / 2
        - g * (M * z + m * w)
        - k * x**2 / 2,
        coordinates=dict.fromkeys((x, z, u, w), "m"),
        constraints=[
            Contact("floor", z),
            Nonholonomic("slide", x.diff(), while_closed="floor"),
            Friction("grip", of=["slide"], normal=multiplier("floor"), static=mu, kinetic=mu),
            Holonomic("rod", rod),
            Holonomic("again", 2 * rod),
        ],
        parameters=[
            *(Parameter(m, 1.0, "kg"), Parameter(M, 2.0, "kg"), Parameter(g, 9.81, "m/s^2")),
            *(Parameter(L, 0.5, "m"), Parameter(k, 60.0, "N/m"), Parameter(mu, 0.2, "1")),
        ],
        start={x: 0.0, u: 0.4, w: -0.3},
    )


@pytest.mark.filterwarnings("ignore::lagfmu.testing.RedundantConstraintWarning")
def test_ida_meets_slip_and_stick_beside_constraints_that_say_the_same(path, tmp_path):
    """The bob drags the block to and fro: modes, states, the force of the floor and that of the rods together
    are those of co-simulation; of the rods one bears it."""
    pytest.importorskip("sksundae", reason="pip install -e '.[test]'")
    times = np.linspace(0, 2.0, 41)
    own = simulate(path(hung()), stop_time=2.0, step_size=0.05, tolerance=1e-12)
    made = Importer(path(hung()), tmp_path, 1e-11)
    found = solve(made, times, 1e-11)
    columns = {made.names[k]: found[:, j] for j, k in enumerate(made.known)}
    assert own["slipping.grip.count"][-1] >= 2
    for name in ("slipping.grip.count", "sticking.grip.count"):
        assert made.fmu.getInt32([made.references[name]])[0] == own[name][-1]
    for name in ("x", "u", "w", "der(x)", "der(u)", "lambda.floor", "lambda.slide"):
        scale = np.abs(own[name]).max()
        np.testing.assert_allclose(columns[name], own[name], atol=1e-7 * scale)
    rods = [of["lambda.rod"] + 2 * of["lambda.again"] for of in (columns, own)]
    np.testing.assert_allclose(*rods, atol=1e-7 * np.abs(rods[1]).max())
    assert (columns["lambda.rod"] * columns["lambda.again"] == 0).all()
    made.close()


# ---------------------------------------------------------------------------- derivatives

AWAY = {
    "SlippingSphere": 0.45,
    "Belt": 1.2,
    "HalfCar": 0.35,
    "BouncingBall": 0.1,
    "Hung": 0.3,
}  # s, amid modes


@pytest.mark.parametrize(
    "model",
    [sleigh, four_bar, "Gyroscope", "SlippingSphere", "Belt", "HalfCar", "BouncingBall", hung()],
    ids=called,
)
@pytest.mark.filterwarnings("ignore::lagfmu.testing.RedundantConstraintWarning")
def test_derivatives_by_states_and_multipliers_are_those_of_differences(path, tmp_path, model):
    """Of q', v', of the equations, the indicators, Q and lambda, by columns and, adjoint, by rows, whatever
    acts, slips or is open; a quaternion that is set is normalized."""
    made = Importer(path(model), tmp_path)
    t = AWAY.get(called(model), 0.0)
    if t > 0:
        solve(made, np.array([0.0, t]), 1e-9)
    at = made.begin()
    at += 1e-3 * made.nominals * np.cos(np.arange(1.0, len(at) + 1))
    turned = [k for k, s in enumerate(made.states) if ".orientation." in made.names[s]]
    at[turned] /= np.linalg.norm(at[turned]) if turned else 1.0
    unknown = [*made.unknown, *made.manifest.knowns("EventIndicator")]
    unknown += [k for k, name in made.names.items() if name.startswith(("Q.", "lambda."))]
    for k, reference in enumerate(made.known):
        h = 1e-5 * made.nominals[k]
        sides = []
        for sign in (1, -1):
            made.put(t, at + sign * h * (np.arange(len(at)) == k))
            sides.append(made.get(unknown))
        made.put(t, at)
        found = np.array(made.fmu.getDirectionalDerivative(unknown, [reference], [1.0]))
        adjoint = [made.fmu.getAdjointDerivative([r], [reference], [1.0])[0] for r in unknown]
        expected = (sides[0] - sides[1]) / (2 * h)
        scale = np.abs(sides[0]) / made.nominals[k] + np.abs(expected).max()
        assert np.all(np.abs(found - expected) <= 1e-6 * scale), made.names[reference]
        np.testing.assert_allclose(adjoint, found, rtol=1e-12, atol=1e-12 * np.abs(expected).max())
    made.close()


def test_the_derivative_of_the_equations_by_lambda_is_the_schur_complement(one):
    """G M^-1 G^T, by columns and by rows, symmetric and positive; refused while DAE mode is off."""
    made = one(four_bar)
    names = [f"lambda.{c.name}" for c in four_bar.constraints]
    equations = [f"equation.{c.name}" for c in four_bar.constraints]
    columns = [made.derive("GetDirectionalDerivative", equations, [n], [1.0]) for n in names]
    rows = [made.derive("GetAdjointDerivative", [r], names, [1.0]) for r in equations]
    A = np.array(rows)
    np.testing.assert_allclose(A, np.array(columns).T, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(A, A.T, rtol=1e-12, atol=1e-13)
    assert np.linalg.eigvalsh(A)[0] > 0
    before = np.array(made.floats(equations))
    made.set(names[2], made.get(names[2]) + 2.0)
    np.testing.assert_allclose(made.floats(equations) - before, 2.0 * A[:, 2], atol=1e-11)


def test_multipliers_are_no_knowns_while_dae_mode_is_off(path, library3):
    """Refused, with the remedy."""
    made = running(library3(path(four_bar)))
    size = c_size_t(1)
    row = four_bar.constraints[0].name
    ask = made.references([f"equation.{row}"]), size, made.references([f"lambda.{row}"]), size
    room = (c_double * 1)(1.0), size, (c_double * 1)(), size
    assert "DAE mode" in made.refuses("GetDirectionalDerivative", *ask, *room)


# ---------------------------------------------------------------------------- IDA


@pytest.mark.parametrize(
    ("model", "end"),
    [(pendulum, 2.0), (sleigh, 2.0), (four_bar, 2.0), ("Gyroscope", 0.2)],
    ids=called,
)
def test_ida_finds_the_multipliers_of_the_fmus_own_run(path, tmp_path, model, end):
    """It knows the manifest alone; what is left falls with its tolerance."""
    pytest.importorskip("sksundae", reason="pip install -e '.[test]'")
    times = np.linspace(0, end, 21)
    own = simulate(path(model), stop_time=end, step_size=end / 20, tolerance=1e-12)
    errors = []
    for tolerance in (1e-7, 1e-11):
        made = Importer(path(model), tmp_path / str(tolerance), tolerance)
        found = solve(made, times, tolerance)[:, made.count :]
        expected = np.array([own[made.names[k]] for k in made.manifest.algebraic]).T
        errors.append(np.abs(found - expected).max() / np.abs(expected).max())
        made.close()
    assert errors[1] < 1e-7
    assert errors[1] < errors[0] / 100


@pytest.mark.parametrize(
    ("name", "counts"),
    [
        ("Hemisphere", {"departure.surface.count": 1}),
        ("BouncingBall", {"closing.floor.count": 30}),
        ("Belt", {"slipping.grip.count": 4, "sticking.grip.count": 4}),
        ("HalfCar", {"departure.front.count": 1, "closing.rear.count": 1}),
        ("SlippingSphere", {"slipping.grip.count": 1, "departure.surface.count": 1}),
    ],
)
def test_ida_meets_the_events_of_co_simulation(path, tmp_path, prepared, name, counts):
    """Departures, impacts until the ball rests, slip and stick, wheels that leave the road and land: states
    and multipliers at each communication point agree to 1e-7 of their size, as do the times of the events,
    and there are as many."""
    pytest.importorskip("sksundae", reason="pip install -e '.[test]'")
    end = prepared(name).scene.stop_time
    times = np.linspace(0, end, 41)
    own = simulate(path(name), stop_time=end, step_size=end / 40, tolerance=1e-12)
    made = Importer(path(name), tmp_path, 1e-11)
    found = solve(made, times, 1e-11)
    expected = np.array([own[made.names[k]] for k in made.known]).T
    sizes = np.maximum(np.abs(expected).max(axis=0), 1e-3 * made.nominals)
    assert (np.abs(found - expected) / sizes).max() < 1e-7
    for count, least in counts.items():
        assert made.fmu.getInt32([made.references[count]])[0] == own[count][-1]
        assert own[count][-1] >= least
        when = count.replace(".count", ".time")
        assert made.value(when) == pytest.approx(own[when][-1], abs=1e-7 * end)
    made.close()


# ---------------------------------------------------------------------------- refusals


def refused(model: Model, folder, **more) -> str:
    """Why it cannot be built."""
    scene = more.pop("scene", None)
    with pytest.raises(ModelError) as told:
        build_fmu(model, folder, scene, fmi=3, dae=True, check=False, **more)
    return str(told.value)


def test_what_has_no_mass_of_its_own_is_refused_by_name(tmp_path):
    """A slider without mass, which the constraint gives that of the bob."""
    held = Holonomic("slider", z - x)
    text = refused(
        Model(
            name="Massless",
            lagrangian=pendulum.lagrangian,
            coordinates={**pendulum.coordinates, z: "m"},
            constraints=[*pendulum.constraints, held],
            parameters=pendulum.parameters,
            start={**pendulum.start, z: 0.9, z.diff(): 0.8},
        ),
        tmp_path,
    )
    assert "M is singular (der(z))" in text


@pytest.mark.parametrize(
    ("scene", "part"),
    [
        ({"formulation": "nullspace"}, "the formulation 'nullspace'"),
        ({"error_bars": True}, "error bars"),
        ({"outputs": ["residual.rod"]}, "'lambda.rod' is not among the outputs"),
    ],
)
def test_scenes_that_cannot_have_it_are_refused(tmp_path, scene, part):
    """Another formulation, no model exchange, no multiplier among the outputs."""
    assert part in refused(pendulum, tmp_path, scene=Scene("P", **scene))


@pytest.mark.filterwarnings("ignore::lagfmu.testing.RedundantConstraintWarning")
def test_a_friction_whose_normal_force_is_shared_is_refused(tmp_path):
    """Of two guides that say the same nobody knows which presses."""
    mu = symbols("mu", positive=True)
    text = refused(
        Model(
            name="Guided",
            lagrangian=m * (x.diff() ** 2 + z.diff() ** 2) / 2 - m * g * z,
            coordinates={x: "m", z: "m"},
            constraints=[
                Holonomic("guide", z),
                Holonomic("again", 2 * z),
                Nonholonomic("slide", x.diff()),
                Friction("grip", of=["slide"], normal=multiplier("guide"), static=mu),
            ],
            parameters=[*pendulum.parameters[:2], Parameter(mu, 0.3, "1")],
            start={x.diff(): 1.0},
        ),
        tmp_path,
    )
    assert "'again') share the normal force of 'grip'" in text


def test_without_constraints_there_is_nothing_to_solve_for(tmp_path):
    """A falling mass."""
    falling = point_mass("Falling", "y", up=y, parameters=pendulum.parameters[:2])
    assert "no constraint" in refused(falling, tmp_path)


def test_it_is_of_fmi_3(tmp_path):
    """FMI 2.0 has no layered standards."""
    with pytest.raises(UsageError, match="dae: FMI 2"):
        build_fmu(pendulum, tmp_path, dae=True)
