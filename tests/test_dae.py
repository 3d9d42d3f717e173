"""FMI-LS-DAE: the manifest of an FMU that is built with `dae`, multipliers that an importer sets, and IDA
(SUNDIALS) that solves for them."""

from __future__ import annotations

from ctypes import byref, c_bool, c_double, c_size_t, c_void_p
from pathlib import Path

import fmpy
import numpy as np
import pytest
import redundant
from dae import MANIFEST, NAMESPACE, Importer, Manifest, solve
from fmpy.validation import validate_fmu
from linkages import FOUR_BAR, rods
from lxml import etree
from sympy import sin, symbols
from sympy.physics.mechanics import dynamicsymbols
from test_forged_states import HEAD, forged

from lagfmu import Holonomic, Input, Model, Nonholonomic, Parameter, Scene, build_fmu, simulate
from lagfmu.errors import ModelError, UsageError
from lagfmu.testing import RedundantConstraintWarning, find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")

x, y, z, phi, u = dynamicsymbols("x y z phi u")
m, g, L, J, w = symbols("m g L J w", positive=True)
t = dynamicsymbols._t
MASS, GRAVITY, LENGTH = 2.0, 9.81, 1.5

pendulum = Model(
    name="Pendulum",
    lagrangian=m * (x.diff() ** 2 + y.diff() ** 2) / 2 - m * g * y,
    coordinates={x: "m", y: "m"},
    constraints=[Holonomic("rod", (x**2 + y**2 - L**2) / 2)],
    parameters=[
        Parameter(m, MASS, "kg"),
        Parameter(g, GRAVITY, "m/s^2"),
        Parameter(L, LENGTH, "m"),
    ],
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
    """one(MODEL): an instance for model exchange in continuous-time mode."""
    return lambda model: running(library3(path(model)))


def running(library):
    """As the importers of an ordinary differential equation have it."""
    made = library(exchange=True).start()
    made.updates()
    made.does("EnterContinuousTimeMode")
    return made


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
    assert validate_fmu(str(path(four_bar))) == []


def test_the_manifest_is_as_the_draft_describes_it(path):
    """Its root and attributes; each multiplier is algebraic; each constraint a residual in three
    formulations, of index 3 for f, 2 for G v - nu and 1 for G vdot - gamma, in variables of their own; all
    else as in the core standard."""
    found = Manifest(path(four_bar))
    assert MANIFEST == "extra/org.fmi-standard.fmi-ls-dae/fmi-ls-manifest.xml"
    assert found.root.tag == f"{NAMESPACE}fmiLayeredStandardManifest"
    told = {k.removeprefix(f"{NAMESPACE}fmi-ls-"): v for k, v in found.root.attrib.items()}
    assert told == {
        "name": "org.fmi-standard.fmi-ls-dae",
        "version": "0.0.1",
        "description": "Layered standard for DAE support in FMI",
    }
    assert [e.tag.removeprefix(NAMESPACE) for e in found.root] == [
        "AlgebraicVariables",
        "ModelStructure",
    ]
    variables = fmpy.read_model_description(str(path(four_bar))).modelVariables
    called = {int(v.valueReference): v.name for v in variables}
    rows = [c.name for c in four_bar.constraints]
    assert [called[k] for k in found.algebraic] == [f"lambda.{c}" for c in rows]
    assert [[(i, called[k]) for i, k, _ in r] for r in found.residuals] == [
        [(3, f"residual.{c}"), (2, f"der(residual.{c})"), (1, f"der(residual.{c},2)")] for c in rows
    ]
    kinds = {e.tag.removeprefix(NAMESPACE) for e in found.root[1]}
    assert kinds == {"Output", "ContinuousStateDerivative", "InitialUnknown", "Residual"}


def test_the_manifest_fits_a_schema_of_the_drafts_text(path):
    """fmi_ls_dae.xsd, which refuses a residual without a formulation."""
    schema = etree.XMLSchema(etree.parse(Path(__file__).parent / "fmi_ls_dae.xsd"))
    for model in (pendulum, sleigh, four_bar):
        schema.assertValid(etree.fromstring(Manifest(path(model)).text))
    root = etree.fromstring(Manifest(path(pendulum)).text)
    residual = root.find(f".//{NAMESPACE}Residual")
    residual.clear()
    assert not schema.validate(root)


def test_a_constraint_on_velocities_is_of_index_2(path):
    """G v - nu = 0 is differentiated once."""
    (residual,) = Manifest(path(sleigh)).residuals
    assert [index for index, *_ in residual] == [2, 1]


def test_units_are_those_of_time_derivatives(path):
    """f/s and f/s^2."""
    told = {v.name: v.unit for v in fmpy.read_model_description(str(path(four_bar))).modelVariables}
    assert [told[n] for n in ("residual.rod1", "der(residual.rod1)", "der(residual.rod1,2)")] == [
        "m2",
        "m2/s",
        "m2/s2",
    ]


@pytest.mark.parametrize("model", [pendulum, sleigh, four_bar], ids=called)
def test_what_an_unknown_depends_on_is_listed_and_nothing_else_moves_it(path, tmp_path, model):
    """Derivatives, residuals and outputs change with no state, input or multiplier that the manifest leaves
    out, and with every one that it lists of the residuals."""
    made = Importer(path(model), tmp_path)
    listed = made.manifest.knowns("ContinuousStateDerivative") | made.manifest.knowns("Output")
    residuals = {k: on for r in made.manifest.residuals for _, k, on in r}
    listed |= residuals
    outputs = [k for k in listed if made.kinds[k] == "Float64"]
    at = made.begin() + 0.01 * np.cos(np.arange(1.0, made.count + 1 + len(made.manifest.algebraic)))
    moved = np.zeros((len(outputs), len(at)), dtype=bool)
    for step in (0.1, -0.07, 0.03):
        for k in range(len(at)):
            made.put(0.2, at)
            before = made.get(outputs)
            made.put(0.2, at + step * (np.arange(len(at)) == k))
            moved[:, k] |= made.get(outputs) != before
    known = [*made.states, *made.manifest.algebraic]
    found = {
        o: {known[k] for k in np.flatnonzero(row)} for o, row in zip(outputs, moved, strict=True)
    }
    for o, by in found.items():
        assert by <= {*listed[o]}, made.names[o]
    for o, on in residuals.items():
        assert {*on} & {*known} <= found[o], made.names[o]
    made.close()


# ---------------------------------------------------------------------------- multipliers that are given


def test_accelerations_follow_from_the_multiplier_that_is_set(one):
    """m x'' = lambda x, m y'' = -m g + lambda y, whatever the state, and the residuals say what is missing to
    f, f' and f'' = x x'' + y y'' + x'^2 + y'^2."""
    made = one(pendulum)
    put(made, 1.0, 0.5, -1.3, 0.25)
    made.set("lambda.rod", -7.0)
    ax, ay = -7.0 * 1.0 / MASS, -GRAVITY + 7.0 * 1.3 / MASS
    assert accelerations(made) == pytest.approx([ax, ay], rel=1e-14)
    assert made.floats(["lambda.rod", "Q.x", "Q.rod.y"]) == pytest.approx([-7.0, -7.0, 9.1])
    assert made.get("residual.rod") == pytest.approx((1.0 + 1.69 - LENGTH**2) / 2)
    assert made.get("der(residual.rod)") == pytest.approx(0.5 - 1.3 * 0.25)
    assert made.get("der(residual.rod,2)") == pytest.approx(ax - 1.3 * ay + 0.25 + 0.0625)


def test_an_importer_that_sets_none_has_the_ordinary_equations(path, built, library3):
    """Bit for bit the accelerations of the FMU without `dae`, and G vdot = gamma."""
    plain, made = running(library3(built(pendulum, fmi=3))), running(library3(path(pendulum)))
    for each in (plain, made):
        put(each, 1.0, 0.5, -1.3, 0.25)
    assert accelerations(made) == accelerations(plain)
    assert made.get("lambda.rod") == plain.get("lambda.rod")
    assert abs(made.get("der(residual.rod,2)")) < 1e-14
    assert made.get("der(residual.rod)") == pytest.approx(0.5 - 1.3 * 0.25)


def test_the_first_that_is_set_makes_all_given_until_the_reset(one):
    """The others stay what they came out as, though the state moves on; a reset gives them back."""
    made = one(four_bar)
    names = [f"lambda.{c.name}" for c in four_bar.constraints]
    before = made.floats(names)
    made.set(names[1], 12.0)
    held = [before[0], 12.0, *before[2:]]
    assert made.floats(names) == held
    states = made.array("GetContinuousStates", 12)
    states[1] += 3.0
    put(made, *states)
    assert made.floats(names) == held
    made.does("EnterEventMode")
    assert made.updates() == (False, False)
    assert made.array("GetContinuousStates", 12) == states, "what drifts is the importer's"
    made.does("EnterContinuousTimeMode")
    assert made.floats(names) == held
    made.does("Reset")
    made.start()
    assert made.floats(names) == before


def test_nothing_is_stabilized_or_projected_once_they_are_given(one):
    """Off the constraints v' is M^-1 (F + G^T lambda) alone, and no step asks for an event."""
    made = one(pendulum)
    put(made, 2.0, 0.5, -2.0, 0.25)
    flags = c_bool(), c_bool()
    ask = "CompletedIntegratorStep", c_bool(True), *map(byref, flags)
    made.does(*ask)
    assert flags[0].value, "drift asks for an event"
    made.set("lambda.rod", 0.0)
    made.does(*ask)
    assert not flags[0].value
    assert accelerations(made) == [0.0, -GRAVITY]


def test_saved_states_know_whether_they_are_given(one):
    """A rollback to before the first set is one to the ordinary equations; one to after it is not."""
    made = one(pendulum)
    before = made.saved()
    solved = made.get("lambda.rod")
    made.set("lambda.rod", -3.0)
    after, given = made.saved(), accelerations(made)
    made.does("SetFMUState", before)
    assert made.get("lambda.rod") == solved
    made.does("SetFMUState", after)
    assert (made.get("lambda.rod"), accelerations(made)) == (-3.0, given)


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
        assert f"multipliers is {flag}" in {text.removesuffix(".0") for text in seen}


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_multiplier_is_a_finite_number(one, value):
    """Named, and nothing is given then."""
    made = one(pendulum)
    function, arguments = made.set_call("lambda.rod", value)
    assert "'lambda.rod' = " in made.refuses(function, *arguments)
    assert made.get("lambda.rod") != value


def test_multipliers_are_set_in_continuous_time_mode_alone(path, built, library3):
    """Not by an importer of co-simulation, before, or in event mode; not in an FMU that was built without."""
    library = library3(path(pendulum))
    stepping, made = library().start(), library(exchange=True)
    function, arguments = made.set_call("lambda.rod", 1.0)
    for each in (stepping, made, made.start()):
        text = each.refuses(function, *arguments)
        assert "'lambda.rod'" in text
        assert "continuous-time mode" in text
    plain = running(library3(built(pendulum, fmi=3)))
    assert "is calculated and cannot be set" in plain.refuses(function, *arguments)


def test_they_are_knowns_of_derivatives_once_they_are_given(one):
    """d(G vdot - gamma)/d lambda = G M^-1 G^T, by columns and, adjoint, by rows; refused before."""
    made = one(four_bar)
    names = [f"lambda.{c.name}" for c in four_bar.constraints]
    residuals = [f"der(residual.{c.name},2)" for c in four_bar.constraints]
    size = c_size_t(1)
    ask = made.references(residuals), size, made.references(names), size
    room = (c_double * 1)(1.0), size, (c_double * 1)(), size
    assert "once one has been set" in made.refuses("GetDirectionalDerivative", *ask, *room)
    made.set(names[0], made.get(names[0]))
    columns = [made.derive("GetDirectionalDerivative", residuals, [n], [1.0]) for n in names]
    rows = [made.derive("GetAdjointDerivative", [r], names, [1.0]) for r in residuals]
    A = np.array(rows)
    np.testing.assert_allclose(A, np.array(columns).T, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(A, A.T, rtol=1e-12, atol=1e-13)
    assert np.linalg.eigvalsh(A)[0] > 0
    before = np.array(made.floats(residuals))
    made.set(names[2], made.get(names[2]) + 2.0)
    np.testing.assert_allclose(made.floats(residuals) - before, 2.0 * A[:, 2], atol=1e-11)


@pytest.mark.parametrize("model", [sleigh, four_bar, "Gyroscope"], ids=called)
def test_derivatives_by_states_hold_the_multipliers(path, tmp_path, model):
    """Of q', v', of the residuals and of Q, against differences; a quaternion that is set is normalized, and
    what would change its norm changes nothing."""
    made = Importer(path(model), tmp_path)
    unknown = [*made.manifest.derivatives, *(k for r in made.manifest.residuals for _, k, _ in r)]
    unknown += [k for k, name in made.names.items() if name.startswith("Q.")]
    at = made.begin() + 0.01
    turned = [k for k, s in enumerate(made.states) if ".orientation." in made.names[s]]
    at[turned] /= np.linalg.norm(at[turned]) if turned else 1.0
    known = [*made.states, *made.manifest.algebraic]
    for k, reference in enumerate(known):
        step = 1e-5 * (np.arange(len(at)) == k)
        sides = []
        for sign in (1, -1):
            made.put(0.3, at + sign * step)
            sides.append(made.get(unknown))
        made.put(0.3, at)
        found = np.array(made.fmu.getDirectionalDerivative(unknown, [reference], [1.0]))
        adjoint = [made.fmu.getAdjointDerivative([r], [reference], [1.0])[0] for r in unknown]
        expected = (sides[0] - sides[1]) / 2e-5
        scale = 1 + np.abs(expected).max()
        np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-7 * scale)
        np.testing.assert_allclose(adjoint, found, rtol=1e-12, atol=1e-12 * scale)
    made.close()


# ---------------------------------------------------------------------------- IDA


@pytest.mark.parametrize(
    ("model", "end"),
    [(pendulum, 2.0), (sleigh, 2.0), (four_bar, 2.0), ("Gyroscope", 0.2)],
    ids=called,
)
def test_ida_finds_the_multipliers_of_the_fmus_own_run(path, tmp_path, model, end):
    """It knows the manifest alone; what is left falls with its tolerance, and the positions drift with it."""
    pytest.importorskip("sksundae", reason="pip install -e '.[test]'")
    times = np.linspace(0, end, 21)
    own = simulate(path(model), stop_time=end, step_size=end / 20, tolerance=1e-12)
    errors, drift = [], []
    for tolerance in (1e-7, 1e-11):
        made = Importer(path(model), tmp_path / str(tolerance))
        found = solve(made, times, tolerance)
        assert found.success
        expected = np.array([own[made.names[k]] for k in made.manifest.algebraic]).T
        errors.append(np.abs(found.y[:, made.count :] - expected).max() / np.abs(expected).max())
        drift.append(np.abs(made.get([r[0][1] for r in made.manifest.residuals])).max())
        made.close()
    assert errors[1] < 1e-7
    assert errors[1] < errors[0] / 100
    assert drift[1] < 1e-7


# ---------------------------------------------------------------------------- refusals


def refused(model: Model, folder, **more) -> str:
    """Why it cannot be built."""
    scene = more.pop("scene", None)
    with pytest.raises(ModelError) as told:
        build_fmu(model, folder, scene, fmi=3, dae=True, check=False, **more)
    return str(told.value)


def test_contacts_and_frictions_are_refused_by_name(prepared, tmp_path):
    """All at once, with the remedy."""
    text = refused(prepared("SlippingSphere").model, tmp_path)
    assert "contact 'surface'" in text
    assert "friction 'grip'" in text
    assert "leave it out" in text


def test_constraints_that_follow_from_others_are_refused_by_name(tmp_path):
    """The rods that are said twice."""
    with pytest.warns(RedundantConstraintWarning):
        text = refused(redundant.four_bar(True), tmp_path)
    assert "'again0'" in text
    assert "'again2'" in text


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
        ({"outputs": ["lambda.rod"]}, "'residual.rod' is not among the outputs"),
    ],
)
def test_scenes_that_cannot_have_it_are_refused(tmp_path, scene, part):
    """Another formulation, no model exchange, no residual among the outputs."""
    assert part in refused(pendulum, tmp_path, scene=Scene("P", **scene))


def test_without_constraints_there_is_nothing_to_solve_for(tmp_path):
    """A falling mass."""
    falling = Model(
        name="Falling",
        lagrangian=m * y.diff() ** 2 / 2 - m * g * y,
        coordinates={y: "m"},
        parameters=pendulum.parameters[:2],
    )
    assert "no constraint" in refused(falling, tmp_path)


def test_it_is_of_fmi_3(tmp_path):
    """FMI 2.0 has no layered standards."""
    with pytest.raises(UsageError, match="dae: FMI 2"):
        build_fmu(pendulum, tmp_path, dae=True)
