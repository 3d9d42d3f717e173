"""What an importer finds in each FMU of models/: the description, the archive, the life cycle."""

from __future__ import annotations

import contextlib
import math
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path

import pytest
from conftest import FILES, KINDS
from fmpy import read_model_description
from fmpy.validation import validate_fmu
from instance import instance
from sympy import Rational, cos, symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass

from lagfmu import Contact, Holonomic, Input, Model, Nonholonomic, Parameter, Scene, build_fmu
from lagfmu.testing import described, name_of

Case = tuple[str, str]  # target, name
PYTHON = [("python", name) for name in ("CartPendulum", "Hemisphere")]
ALL = [*(("native", name) for name in sorted(FILES)), *PYTHON]
EACH = [*(("native", name) for name in KINDS), *PYTHON]
REPOSITORY = Path(__file__).parent.parent


@pytest.fixture(params=ALL, ids="-".join)
def case(request) -> Case:
    """Every native FMU of models/, and two of the python target."""
    return request.param


@pytest.fixture
def target(case) -> str:
    return case[0]


@pytest.fixture
def name(case) -> str:
    return case[1]


@pytest.fixture
def path(target, name, request) -> Path:
    """The built FMU."""
    return request.getfixturevalue(f"{target}_fmu")(name)


@pytest.fixture
def xml(path) -> ET.Element:
    """Its modelDescription.xml."""
    with zipfile.ZipFile(path) as archive:
        return ET.fromstring(archive.read("modelDescription.xml"))


def variables(xml) -> dict[str, tuple[dict, str, dict]]:
    """name -> (attributes, type, attributes of the type), in the order of the indices."""
    found = {}
    for element in xml.find("ModelVariables"):
        (typed,) = [e for e in element if e.tag != "Annotations"]
        found[element.get("name")] = (element.attrib, typed.tag, typed.attrib)
    return found


def listed(xml, what) -> dict[str, list[str]]:
    """name -> names of the dependencies, for Outputs, Derivatives or InitialUnknowns."""
    names = list(variables(xml))
    return {
        names[int(e.get("index")) - 1]: [
            names[int(d) - 1] for d in e.attrib["dependencies"].split()
        ]
        for e in xml.find(f"ModelStructure/{what}")
    }


# ---------------------------------------------------------------------------- checkers


@pytest.mark.parametrize("case", EACH, ids="-".join)
def test_fmpy_reports_no_problem(path):
    """fmpy validate is silent."""
    assert validate_fmu(str(path)) == []


FMUTOOL = """
import sys
from fmu_manipulation_toolbox.cli.fmutool import fmutool
for path in sys.argv[1:]:
    sys.argv = ["fmutool", "-input", path, "-check"]
    fmutool()
"""


def test_fmutool_reports_no_error(native_fmu, python_fmu):
    """fmutool -check (fmu-manipulation-toolbox): schema and rules of the standard."""
    fmus = {"native": native_fmu, "python": python_fmu}
    paths = [str(fmus[target](name)) for target, name in EACH]
    command = [sys.executable, "-c", FMUTOOL, *paths]
    run = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    text = run.stdout + run.stderr
    assert run.returncode == 0, text
    assert text.count("compliant with FMI-2.0") == len(paths)
    assert not re.search(r"\b(ERROR|FATAL|CRITICAL|WARNING)\b", text), text


# ---------------------------------------------------------------------------- the description


def test_names_are_those_of_the_design(name, xml, prepared, target):
    """Motion, multipliers, forces, residuals, energies, contacts and departures, and nothing else."""
    model = prepared(name).model
    q = [name_of(c) for c in model.coordinates]
    expected = {name_of(p.symbol) for p in model.parameters}
    expected |= {name_of(i.symbol) for i in model.inputs}
    for i in model.prescribed:
        expected |= {f"der({name_of(i.symbol)})", f"der({name_of(i.symbol)},2)"}
    motions = list(q)
    if prepared(name).form.reduction is not None and model.embedding is not None:
        motions += [name_of(c) for c in model.embedding.coordinates]
    expected |= {form.format(c) for c in motions for form in ("{}", "der({})", "der({},2)")}
    expected |= {f"Q.{c}" for c in q}
    for constraint in model.constraints:
        c = constraint.name
        expected |= {f"lambda.{c}", f"residual.{c}", f"unique.{c}"}
        if isinstance(constraint, Contact):
            expected |= {f"contact.{c}", f"departure.{c}.time", f"departure.{c}.count"}
            expected |= {f"departure.{c}.{s}" for s in q}
            expected |= {f"departure.{c}.velocity.{s}" for s in q}
    for law in model.frictions:
        expected |= {f"{head}.{law.name}" for head in ("sticks", "margin", "power")}
        expected |= {f"slip.{row}" for row in law.of} | {"energy.dissipated"}
        expected |= {f"slipping.{law.name}.{s}" for s in ("time", "count", *q)}
        expected |= {f"slipping.{law.name}.velocity.{s}" for s in q}
    events = {v for v in expected if v.startswith(("departure.", "slipping."))}
    expected |= {re.sub("^departure", "closing", v) for v in events if v[0] == "d"}
    expected |= {re.sub("^slipping", "sticking", v) for v in events if v[0] == "s"}
    contacts = [c.name for c in model.constraints if isinstance(c, Contact)]
    expected |= {f"closing.{c}.impulse" for c in contacts}
    expected |= {"energy.dissipated"} if contacts or model.frictions else set()
    expected |= {"der(energy.dissipated)"} if model.frictions else set()
    expected |= {o.name for o in model.outputs}
    expected |= {f"energy.{e}" for e in ("kinetic", "potential", "total")}
    expected |= {
        f"solver.{s}" for s in ("method", "tolerance", "maximum_step", "maximum_steps", "steps")
    }
    expected |= {"solver.step"} if target == "native" else set()
    constraints = "|".join(c.name for c in model.constraints)
    found = {v for v in variables(xml) if not re.fullmatch(rf"Q\.({constraints})\.\w+", v)}
    assert found == expected
    for c in q:
        shares = [v for v in variables(xml) if re.fullmatch(rf"Q\.({constraints})\.{c}", v)]
        assert bool(shares) == any(q[j] == c for _, j in prepared(name).equations.G.todok())


def test_no_name_is_the_beginning_of_another(xml):
    """Importers make records of names: a variable `a` beside `a.b` would be a number and a record."""
    found = set(variables(xml))
    for name in found:
        parts = name.split(".")
        groups = {".".join(parts[:k]) for k in range(1, len(parts))}
        assert not groups & found, name


UNITS = {
    ("Hemisphere", "lambda.surface"): {"kg": 1, "m": 1, "s": -2},
    ("Hemisphere", "Q.theta"): {"kg": 1, "m": 2, "s": -2},
    ("Hemisphere", "departure.surface.velocity.theta"): {"s": -1, "rad": 1},
    ("Hemisphere", "departure.surface.time"): {"s": 1},
    ("PendulumCartesian", "lambda.rod"): {"kg": 1, "s": -2},
    ("PendulumAngle", "der(theta,2)"): {"s": -2, "rad": 1},
    ("PendulumCartesian", "residual.rod"): {"m": 2},
    ("RotatingWire", "lambda.drive"): {"kg": 1, "m": 2, "s": -2},
    ("RotatingWire", "omega"): {"s": -1, "rad": 1},
    ("KnifeEdge", "lambda.edge"): {"kg": 1, "m": 1, "s": -2},
    ("KnifeEdge", "residual.edge"): {"m": 1, "s": -1},
    ("CartPendulum", "energy.total"): {"kg": 1, "m": 2, "s": -2},
}


def test_every_real_has_a_unit_that_is_defined(name, xml):
    """Each Real names a unit, each unit is defined once, with the right exponents of the base units."""
    definitions = {}
    for unit in xml.find("UnitDefinitions"):
        assert unit.get("name") not in definitions
        definitions[unit.get("name")] = {k: int(v) for k, v in unit.find("BaseUnit").attrib.items()}
    used = set()
    for variable, (_, kind, typed) in variables(xml).items():
        if kind == "Real":
            assert typed["unit"] in definitions, variable
            used.add(typed["unit"])
    assert used == set(definitions)
    for (model, variable), exponents in UNITS.items():
        if model == name:
            assert definitions[variables(xml)[variable][2]["unit"]] == exponents, variable
    if name == "Hemisphere":
        assert variables(xml)["Q.theta"][2]["unit"] == "N.m"


def test_every_variable_is_described(xml):
    """No description is empty or repeats the name only; value references count up from 0."""
    for reference, (variable, (attributes, _, _)) in enumerate(variables(xml).items()):
        assert len(attributes["description"]) > 3
        assert attributes["description"] != variable
        assert " of: " not in attributes["description"]  # velocity of x
        assert int(attributes["valueReference"]) == reference


def test_experiment_log_categories_and_capabilities_are_stated(name, xml, prepared, target):
    """DefaultExperiment is the scene's; all categories are described; no tool is needed."""
    scene = prepared(name).scene
    experiment = xml.find("DefaultExperiment").attrib
    assert float(experiment["startTime"]) == 0.0
    assert float(experiment["stopTime"]) == scene.stop_time
    assert float(experiment["tolerance"]) == scene.tolerance
    assert float(experiment["stepSize"]) == scene.step_size
    categories = {c.get("name"): c.get("description") for c in xml.find("LogCategories")}
    assert {"logStatusWarning", "logStatusDiscard", "logStatusFatal", "logEvents"} <= set(
        categories
    )
    assert all(categories.values())
    co_simulation = xml.find("CoSimulation").attrib
    assert co_simulation["needsExecutionTool"] == "false"
    assert co_simulation["canGetAndSetFMUstate"] == "true"
    assert co_simulation["canSerializeFMUstate"] == "true"
    if target == "native":
        exchange = xml.find("ModelExchange").attrib
        derivatives = not prepared(name).model.frictions
        for attributes in (co_simulation, exchange):
            offered = attributes.get("providesDirectionalDerivative") == "true"
            assert offered == derivatives
        assert exchange["canGetAndSetFMUstate"] == exchange["canSerializeFMUstate"] == "true"
        assert co_simulation["canInterpolateInputs"] == "true"
        assert co_simulation["maxOutputDerivativeOrder"] == str(int(derivatives))
    assert co_simulation["modelIdentifier"] == xml.get("modelName") == name
    assert xml.get("variableNamingConvention") == "structured"
    assert re.fullmatch(r"\{[0-9a-f-]{36}\}", xml.get("guid"))


def test_derivatives_refer_to_their_states(xml):
    """der(theta) is the derivative of theta, der(theta,2) of der(theta): of states alone, for importers
    (OMSimulator) count the states by this attribute."""
    names = list(variables(xml))
    for variable, (_, _, typed) in variables(xml).items():
        if variable in listed(xml, "Derivatives"):
            inner, _, order = variable[4:-1].partition(",")
            of = f"der({inner})" if order == "2" else inner
            assert names[int(typed["derivative"]) - 1] == of
        else:
            assert "derivative" not in typed
    states = {
        n
        for n, (a, _, _) in variables(xml).items()
        if a["causality"] == "output" and a.get("initial") in ("exact", "approx")
    }
    states |= (
        {"energy.dissipated"}.intersection(names) if "der(energy.dissipated)" in names else set()
    )
    derivatives = listed(xml, "Derivatives")
    assert {names[int(variables(xml)[d][2]["derivative"]) - 1] for d in derivatives} == states


def test_each_method_has_its_number_for_ever(xml, name, target):
    """auto 1, dop853 2, rk4 3, radau 4, rattle 5 (rk4 and rattle native): for saved experiments."""
    types = {t.get("name"): t for t in xml.find("TypeDefinitions")}
    items = {i.get("name"): int(i.get("value")) for i in types["Method"].iter("Item")}
    expected = {"auto": 1, "dop853": 2, "rk4": 3, "radau": 4, "rattle": 5}
    if target == "python":
        del expected["rk4"], expected["rattle"]
    assert items == expected
    _, kind, typed = variables(xml)["solver.method"]
    start = "4" if name == "SliderCrank" else "1"  # its scene asks for radau
    assert (kind, typed["declaredType"], typed["start"]) == ("Enumeration", "Method", start)


def test_angles_are_shown_in_degrees(xml):
    """Every variable in rad, rad/s, rad/s2 has a type with a display unit of 180/pi of it."""
    types = {t.get("name"): t[0].attrib for t in xml.find("TypeDefinitions")}
    units = {u.get("name"): u for u in xml.find("UnitDefinitions")}
    for _, kind, typed in variables(xml).values():
        if kind == "Real" and typed["unit"].startswith("rad"):
            known = types[typed["declaredType"]]
            assert known["unit"] == typed["unit"]
            (shown,) = units[typed["unit"]].findall("DisplayUnit")
            assert shown.get("name") == known["displayUnit"] == typed["unit"].replace("rad", "deg")
            assert float(shown.get("factor")) == pytest.approx(180 / math.pi, rel=1e-15)


def test_states_have_nominal_values_and_positive_parameters_a_minimum(name, xml, prepared):
    """The size of each coordinate that has one, of its velocity size times rate; m > 0 is told as min 0."""
    state, states = prepared(name).structure.start, prepared(name).table.states
    states = [s for s in states if s != "energy.dissipated"]
    for j, (q, v) in enumerate(zip(states[::2], states[1::2], strict=True)):
        if state.size[j] > 0:
            assert float(variables(xml)[q][2]["nominal"]) == pytest.approx(state.size[j], rel=0.1)
            speed = state.size[j] * state.rate
            if speed > 0:
                assert float(variables(xml)[v][2]["nominal"]) == pytest.approx(speed, rel=0.1)
    for p in prepared(name).model.parameters:
        if p.symbol.is_positive:
            assert float(variables(xml)[name_of(p.symbol)][2]["min"]) >= 0


def test_dependencies_say_of_what_kind_they_are(xml):
    """A state among its own dependencies is a constant factor, 1; where nothing is said all are dependent."""
    names = list(variables(xml))
    for part in ("Outputs", "Derivatives", "InitialUnknowns"):
        for element in xml.find(f"ModelStructure/{part}"):
            known = element.get("dependencies").split()
            own = [names[int(k) - 1] == names[int(element.get("index")) - 1] for k in known]
            kinds = ["constant" if is_own else "dependent" for is_own in own]
            told = element.get("dependenciesKind")
            assert told == (" ".join(kinds) if any(own) else None)


def test_dependencies_are_left_out_where_they_would_be_too_many(tmp_path, monkeypatch, caplog):
    """In a large mechanism all depends on all: no attribute `dependencies`, which means that for FMI, and the
    build says so."""
    m = symbols("m", positive=True)
    parameters = [Parameter(m, 1.0, "kg")]
    free = point_mass("Free", "x", parameters=parameters)
    caplog.set_level("INFO", "lagfmu")
    for most, told in ((100, 0), (3, 1)):
        monkeypatch.setattr(described, "MOST", most)
        path = build_fmu(free, tmp_path, target="python", check=False)
        with zipfile.ZipFile(path) as archive:
            text = archive.read("modelDescription.xml").decode()
        assert ("dependencies=" in text) == (not told)
        assert validate_fmu(str(path)) == []
        assert sum("leaves out `dependencies`" in line for line in caplog.messages) == told


def test_the_model_says_who_made_it(tmp_path):
    """author, version, license and copyright of a Model stand in the description; none are invented."""
    x, m = dynamicsymbols("x"), symbols("m", positive=True)
    body = {"coordinates": {x: "m"}, "parameters": [Parameter(m, 1.0, "kg")]}
    made = {"author": "A. Lagrange", "version": "1788", "license": "CC0", "copyright": "none"}
    for given in ({}, made):
        model = Model(name="Free", lagrangian=m * x.diff() ** 2 / 2, **body, **given)
        fmu = build_fmu(model, tmp_path, target="python", check=False)
        with zipfile.ZipFile(fmu) as archive:
            root = ET.fromstring(archive.read("modelDescription.xml"))
        assert {k: root.get(k) for k in made if root.get(k)} == given


def test_the_model_structure_is_complete(xml):
    """Every output, state derivative and approx or calculated output, each with `dependencies`."""
    outputs = {n for n, (a, _, _) in variables(xml).items() if a["causality"] == "output"}
    unknown = {n for n in outputs if variables(xml)[n][0]["initial"] in ("approx", "calculated")}
    unknown |= {"der(energy.dissipated)"}.intersection(variables(xml))
    assert set(listed(xml, "Outputs")) == outputs
    assert set(listed(xml, "InitialUnknowns")) == unknown
    for name, (attributes, _, typed) in variables(xml).items():
        has_start = attributes.get("initial") in ("exact", "approx") or (
            attributes["causality"] == "input"
        )
        assert ("start" in typed) == has_start, name
    known = {
        n
        for n, (a, _, _) in variables(xml).items()
        if a["causality"] == "input" or a.get("initial") == "exact"
    }
    for dependencies in listed(xml, "InitialUnknowns").values():
        assert set(dependencies) <= known


APPROX = {
    "Hemisphere": {"r", "der(r)"},  # the surface touches r alone, M is diagonal
    "InclineDisk": {"y", "theta", "der(y)", "der(theta)"},
    "InclineDiskMinimal": set(),
    "PendulumCartesian": {"x", "y", "der(x)", "der(y)"},
    "PendulumNullspace": {"x", "y", "der(x)", "der(y)"},
    "PendulumAngle": set(),
    "RotatingWire": {"phi", "der(phi)"},
    "KnifeEdge": {"der(x)", "der(y)"},  # no position constraint; phi is not in the blade's row
    "Atwood": {"x1", "x2", "der(x1)", "der(x2)"},
    "CartPendulum": {"s", "x", "y", "der(s)", "der(x)", "der(y)"},
    "BouncingBall": {"y", "der(y)"},
    "Chain": {f(c + str(k)) for c in "xy" for k in (1, 2, 3, 4) for f in (str, "der({})".format)},
    "Crane": {"s", "x", "y", "der(s)", "der(x)", "der(y)"},
    "HalfCar": {"zf", "zr", "der(zf)", "der(zr)"},  # the body hangs on the springs
    "DoublePendulum": {f(c + k) for c in "xy" for k in "12" for f in (str, "der({})".format)},
    "Ladder": {"x", "y", "theta", "der(x)", "der(y)", "der(theta)"},
    "Loop": {"x", "y", "der(x)", "der(y)"},
    "RollingSphere": {"r", "der(r)", "der(theta)", "der(phi)"},  # rolling ties velocities alone
    "SlippingSphere": {f(c) for c in ("r", "theta", "phi") for f in (str, "der({})".format)},
    "SliderCrank": {"phi", "x", "y", "der(phi)", "der(x)"},  # y hangs on the spring: r + l + s
}


def test_only_states_that_a_projection_can_move_are_approximate(name, xml):
    """The others start exactly as they are described or set."""
    found = {n for n, (a, _, _) in variables(xml).items() if a.get("initial") == "approx"}
    assert found == APPROX[name]


def test_start_values_in_the_description_are_those_of_the_binary(path, xml):
    """17 digits: the text reads back as the very double that the instance holds and starts with."""
    with instance(path) as one:
        one.fmu.setupExperiment()
        one.fmu.enterInitializationMode()
        for variable, (_, kind, typed) in variables(xml).items():
            if "start" in typed:
                expected = typed["start"] if kind == "String" else float(typed["start"])
                found = one.get(variable)
                assert (found.decode() if kind == "String" else found) == expected, variable
                if kind != "String":
                    assert float(repr(expected)) == expected


def test_awkward_start_values_survive(tmp_path):
    """0.1 + 0.2, 1/3 and 1e-300 come back bit for bit from the text and from the binary."""
    x, k = dynamicsymbols("x"), symbols("k", real=True)
    model = point_mass(
        "Awkward",
        "x",
        energy=-k * x,
        mass=Rational(1, 3),
        parameters=[Parameter(k, 1e-300, "N")],
        start={x: 0.1 + 0.2, x.diff(): -2 / 3},
    )
    path = build_fmu(model, tmp_path, check=False)
    expected = {"x": 0.1 + 0.2, "der(x)": -2 / 3, "m": 1 / 3, "k": 1e-300}
    described = {v.name: v for v in read_model_description(str(path)).modelVariables}
    with instance(path) as one:
        one.start()
        for variable, value in expected.items():
            assert float(described[variable].start) == value
            assert one.get(variable) == value


# ---------------------------------------------------------------------------- true dependencies

SAFE = {  # states that satisfy the constraints, away from symmetric ones
    "Hemisphere": {"theta": 0.3, "der(theta)": 0.4},
    "CartPendulum": {"F": 2.0, "der(s)": 0.3},
    "KnifeEdge": {"phi": 0.4, "der(phi)": 0.9, "der(x)": 0.5, "der(y)": 0.2},
    "PendulumAngle": {"theta": 0.7, "der(theta)": 0.4},
    "RotatingWire": {"r": 0.6, "der(r)": 0.2},
}


def initial_outputs(path, values) -> dict:
    """All outputs in initialization mode."""
    with instance(path) as one:
        one.fmu.setupExperiment()
        one.fmu.enterInitializationMode()
        for variable, value in values.items():
            one.set(variable, value)
        return one.outputs()


def outputs_after(path, values, late=None) -> dict:
    """All outputs right after initialization; `late` sets inputs after it."""
    with instance(path) as one:
        one.start(values)
        for variable, value in (late or {}).items():
            one.set(variable, value)
        return one.outputs()


def changed(a, b) -> set[str]:
    """Outputs that differ by more than rounding."""
    return {
        n
        for n in a
        if abs(a[n] - b[n]) > 1e-9 * max(abs(a[n]), abs(b[n]), 1e-3) and n != "solver.steps"
    }


@pytest.mark.parametrize("name", sorted(SAFE))
def test_initial_dependencies_are_true(name, native_fmu):
    """Perturb each exact start value, parameter and input: what changes has listed it."""
    path = native_fmu(name)
    with zipfile.ZipFile(path) as archive:
        xml = ET.fromstring(archive.read("modelDescription.xml"))
    base = initial_outputs(path, SAFE[name])
    dependencies = listed(xml, "InitialUnknowns")
    seen = set()
    for known, (attributes, kind, typed) in variables(xml).items():
        exact = attributes.get("initial") == "exact" or attributes["causality"] == "input"
        if not exact or kind != "Real" or known.startswith("solver."):
            continue
        value = SAFE[name].get(known, float(typed["start"]))
        moved = initial_outputs(path, SAFE[name] | {known: value * 1.01 + 1e-3})
        for output in changed(base, moved):
            if output == known:
                continue
            assert known in dependencies[output], f"{output} depends on {known}"
            seen.add(output)
    assert "energy.kinetic" in seen
    assert any(n.startswith("lambda.") for n in seen)


@pytest.mark.parametrize("name", ["CartPendulum"])
def test_inputs_act_on_the_outputs_that_list_them(name, native_fmu):
    """An input set between two steps changes accelerations and lambda at once, as listed, no state."""
    path = native_fmu(name)
    with zipfile.ZipFile(path) as archive:
        xml = ET.fromstring(archive.read("modelDescription.xml"))
    moved = changed(outputs_after(path, {}), outputs_after(path, {}, {"F": 5.0}))
    assert {"lambda.rod", "der(s,2)", "Q.s"} <= moved
    listing = {n for n, d in listed(xml, "Outputs").items() if "F" in d}
    assert moved <= listing
    assert not listing & {"s", "x", "y", "der(s)", "energy.total", "residual.rod"}


@pytest.mark.parametrize("name", sorted(SAFE))
def test_dependencies_on_states_are_true(name, native_fmu):
    """From one consistent state to another in the same contact mode: what changes has listed one of
    the states that moved; and so has the mode, where that changes."""
    path = native_fmu(name)
    with zipfile.ZipFile(path) as archive:
        xml = ET.fromstring(archive.read("modelDescription.xml"))
    base = outputs_after(path, SAFE[name])
    dependencies = listed(xml, "Outputs")
    states = [
        n
        for n, (a, _, _) in variables(xml).items()
        if a["causality"] == "output" and a.get("initial") in ("exact", "approx")
    ]
    for state in states:
        moved = outputs_after(path, SAFE[name] | {state: base[state] * 1.01 + 1e-3})
        different = changed(base, moved)
        sources = different & set(states)
        modes = {n for n in different if n.startswith("contact.")}
        for output in modes or different - set(states):  # in another mode everything may differ
            assert sources & set(dependencies[output]), f"{output} depends on one of {sources}"


# ---------------------------------------------------------------------------- the archive


def test_the_archive_holds_what_it_needs_and_no_more(name, path, target):
    """Binaries, script or sources, documentation; no caches, no paths of the machine that built it."""
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
        names = archive.namelist()
        content = {n: archive.read(n) for n in names}
        assert all(i.date_time == (1980, 1, 1, 0, 0, 0) for i in archive.infolist())
    assert len(names) == len(set(names))
    assert names[0] == "modelDescription.xml"
    for needed in (
        f"binaries/linux64/{name}.so",
        "documentation/index.html",
        "documentation/licenses/license.txt",
        "resources/lagfmu.json",
        "resources/slavemodule.txt" if target == "python" else "sources/model.c",
    ):
        assert needed in names
    assert not [n for n in names if "__pycache__" in n or n.endswith((".pyc", "/"))]
    traces = {str(REPOSITORY), str(path.parent), os.path.expanduser("~"), sys.prefix, "/tmp/"}
    for entry, data in content.items():
        if target == "native" or not entry.startswith("binaries/"):
            assert not [p for p in traces if p.encode() in data], entry
    own = {str(REPOSITORY), str(path.parent), sys.prefix}
    assert not [e for e, data in content.items() for p in own if p.encode() in data]


BUILD = """
import sys
from lagfmu.testing import load, prepare, write
file = load(sys.argv[1])
write(prepare(file.model, file.scenes[0]), sys.argv[2])
"""


@pytest.mark.thorough
def test_source_date_epoch_gives_a_date_in_utc(tmp_path):
    """1,700,000,000 s after 1970 is 2023-11-14T22:13:20Z; without the variable there is no date."""
    bare = {k: v for k, v in os.environ.items() if k != "SOURCE_DATE_EPOCH"}
    dated = {**bare, "SOURCE_DATE_EPOCH": "1700000000"}
    for environment, expected in ((dated, "2023-11-14T22:13:20Z"), (bare, None)):
        command = [sys.executable, "-c", BUILD, str(REPOSITORY / "models/atwood.py"), str(tmp_path)]
        subprocess.run(command, env=environment, check=True, timeout=120)
        found = read_model_description(str(tmp_path / "Atwood.fmu")).generationDateAndTime
        assert found == expected


# ---------------------------------------------------------------------------- life cycle


def record(one, steps=5, size=0.05) -> list[dict]:
    """Outputs after each step."""
    found = []
    for _ in range(steps):
        one.step(size)
        found.append(one.outputs())
    return found


@pytest.mark.parametrize("case", EACH, ids="-".join)
def test_a_second_experiment_after_reset_gives_the_same_numbers(path):
    """Also after parameters were changed, and right after instantiation."""
    with instance(path) as one:
        one.fmu.reset()
        one.start()
        first = record(one)
        one.fmu.terminate()
        one.fmu.reset()
        parameter = one.description.modelVariables[0].name
        one.start({parameter: 1.25, "solver.method": "radau"})
        assert record(one) != first
        one.fmu.reset()
        one.start()
        assert record(one) == first


@pytest.mark.parametrize("case", EACH, ids="-".join)
def test_values_can_be_set_and_read_before_the_first_step(path):
    """Parameters right after instantiation; in initialization mode each output has a finite value, the one
    that the initialization keeps.  Arrays of length zero are accepted, as some importers pass them."""
    with instance(path) as one:
        parameter = one.description.modelVariables[0].name
        one.set(parameter, 1.25)
        assert one.get(parameter) == 1.25
        one.fmu.setupExperiment()
        one.fmu.enterInitializationMode()
        for kind in ("Real", "Integer", "Boolean", "String"):
            getattr(one.fmu, f"set{kind}")([], [])
            assert getattr(one.fmu, f"get{kind}")([]) == []
        before = one.outputs()
        one.fmu.exitInitializationMode()
        assert one.outputs() == before
        assert one.get(parameter) == 1.25


@pytest.mark.parametrize("case", EACH, ids="-".join)
def test_an_experiment_may_start_late(name, path):
    """Started at t = 10 s: an autonomous system repeats what it does from t = 0."""
    with instance(path) as one, instance(path) as late:
        one.start()
        late.start(start_time=10.0, stop_time=11.0, values={})
        if name == "RotatingWire":  # rheonomic: the wire stands at omega t
            assert late.get("phi") == pytest.approx(10 * late.get("omega"))
            late.step(0.1)
            assert late.get("residual.drive") == pytest.approx(0.0, abs=1e-12)
            return
        for a, b in zip(record(one), record(late), strict=True):
            for output in a:
                if not output.startswith(("solver", "departure")):
                    assert b[output] == pytest.approx(a[output], rel=1e-5, abs=1e-6), output


@pytest.mark.parametrize("case", EACH, ids="-".join)
def test_a_communication_step_of_any_size_follows_any_other(path):
    """1e-9, 0.1, 1e-3 s: the coordinates are those of one single step."""
    with instance(path) as one, instance(path) as single:
        one.start(tolerance=1e-10)
        for size in (1e-9, 0.1, 1e-3, 0.05, 1e-6, 0.1):
            one.step(size)
        single.start(tolerance=1e-10)
        single.step(one.time)
        a, b = one.outputs(), single.outputs()
        for output in a:
            if output.startswith(("solver", "residual")):
                continue
            assert a[output] == pytest.approx(b[output], rel=1e-6, abs=1e-7), output


def test_instances_in_turns_do_not_touch_each_other(fmu):
    """Eight particles, each from an angle of its own, and a machine of Atwood's: each as if it were alone."""
    starts = [("Hemisphere", {"theta": 0.1 + 0.1 * k}) for k in range(8)] + [("Atwood", {})]
    alone = []
    for name, values in starts:
        with instance(fmu(name)) as one:
            alone.append(record(one.start(values), 3, 0.2))
    with contextlib.ExitStack() as stack:
        turns = [stack.enter_context(instance(fmu(n), f"i{k}")) for k, (n, _) in enumerate(starts)]
        for one, (_, values) in zip(turns, starts, strict=True):
            one.start(values)
        for step in range(3):
            assert [record(one, 1, 0.2) for one in turns] == [[r[step]] for r in alone]


def test_the_log_tells_projected_starts_and_departures(fmu):
    """Start values off the surface: which, how far; the departure: when."""
    with instance(fmu("Hemisphere")) as one:
        one.start({"a": 2.0, "r": 1.5, "theta": 0.3})  # r = 1.5 is inside the sphere of radius 2
        assert one.get("r") == 2.0
        messages = [m for _, c, m in one.log if c == "logStatusWarning"]
        assert any("r = 1.5" in m and "2.0" in m and "moved by 0.5" in m for m in messages), one.log
        for _ in range(40):
            one.step(0.1)
        assert any("surface opened at t = " in m for _, c, m in one.log if c == "logEvents")


def test_the_tolerance_of_the_experiment_is_obeyed_and_the_parameter_goes_first(fmu):
    """Fewer steps at 1e-4 than at 1e-12; solver.tolerance overrides fmi2SetupExperiment."""

    def steps(values, tolerance):
        with instance(fmu("PendulumCartesian")) as one:
            one.start(values, tolerance=tolerance)
            one.step(2.0)
            return one.get("solver.steps")

    rough, default, fine = steps({}, 1e-4), steps({}, None), steps({}, 1e-12)
    assert rough < default < fine
    assert steps({"solver.tolerance": 1e-12}, 1e-4) == fine
    assert steps({}, 1e-8) == default


def test_an_input_is_read_back_and_its_effect_is_there_at_once(fmu):
    """After fmi2SetReal(F) the accelerations are new, without a step."""
    with instance(fmu("CartPendulum")) as one:
        one.start()
        before = one.get("der(s,2)")
        one.set("F", 10.0)
        assert one.get("F") == 10.0
        assert one.get("der(s,2)") > before


def test_constraints_that_mix_give_every_variable_its_dependencies(tmp_path):
    """A contact, a rheonomic, a nonholonomic constraint and a prescribed motion in one FMU that no
    checker complains about."""
    t = dynamicsymbols._t
    x, y, z, u = dynamicsymbols("x y z u")
    w, g = symbols("w g", positive=True)
    model = point_mass(
        "Mixed",
        "x y z",
        [
            Contact("floor", z - u),
            Nonholonomic("steer", x.diff() * cos(w * t) - y.diff()),
            Holonomic("rail", x - w * t * g / w**2, while_closed="floor"),
        ],
        up=z,
        parameters=[Parameter(w, 1.0, "rad/s")],
        inputs=[Input(u, "m")],
        start={x.diff(): 9.81, y.diff(): 9.81},
    )
    path = build_fmu(model, tmp_path, Scene("Mixed"), check=False)
    assert validate_fmu(str(path)) == []
    with instance(path) as one:
        one.start()
        one.step(0.1)
        assert one.get("lambda.floor") == pytest.approx(9.81)
        assert one.get("der(x)") == pytest.approx(9.81)
