"""variables.c: the variable table, read back from the compiled library bit for bit."""

from __future__ import annotations

import ctypes
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from conftest import FILES
from runtime import RUNTIME_FILES, compile_library

from lagfmu.methods import NUMBERS
from lagfmu.solver.initial import start
from lagfmu.solver.observe import observe
from lagfmu.solver.state import Settings
from lagfmu.testing import Prepared, model_source, string, variables_source

NAMES = sorted(set(FILES) - {"SlippingSphere"})  # the table of places has no frictions here
TYPES = ("Real", "Integer", "Boolean", "String")
ROLES = ("parameter", "start", "input", "solver", "output")


class CVariable(ctypes.Structure):
    """`Variable` of variables.h."""

    _fields_ = [
        ("name", ctypes.c_char_p),
        ("type", ctypes.c_int),
        ("role", ctypes.c_int),
        ("place", ctypes.c_int),
        ("index", ctypes.c_int),
        ("contact", ctypes.c_int),
        ("state", ctypes.c_int),
        ("start", ctypes.c_double),
        ("min", ctypes.c_double),
        ("max", ctypes.c_double),
        ("positive", ctypes.c_int),
    ]


def places() -> list[str]:
    """The enumerators of Place, from the header, in order."""
    header = RUNTIME_FILES["variables.h"].read_text(encoding="utf-8")
    inside = re.sub(r"/\*.*?\*/", "", header[header.index("AT_PARAMETER") :], flags=re.DOTALL)
    return re.findall(r"AT_(\w+)", inside[: inside.index("}")])


def methods() -> dict[str, int]:
    """The enumerators of MethodName and their values, from the header."""
    header = RUNTIME_FILES["state.h"].read_text(encoding="utf-8")
    found = re.search(r"enum \{([^}]*)\} MethodName", header)
    assert found is not None
    return {k: int(v) for k, v in re.findall(r"(\w+) = (\d+)", found[1])}


@pytest.fixture(scope="session")
def table(
    prepared: Callable[[str], Prepared], tmp_path_factory: pytest.TempPathFactory
) -> Callable[[str], tuple[Prepared, Any, list[CVariable]]]:
    """table(NAME): what Python knows, the library, and the variables that it holds."""
    folder = tmp_path_factory.mktemp("variables_c")
    Path(folder, "identity.h").write_text('#define LAGFMU_GUID "{1234}"\n')
    made: dict[str, tuple[Prepared, Any, list[CVariable]]] = {}

    def get(name: str) -> tuple[Prepared, Any, list[CVariable]]:
        if name not in made:
            p = prepared(name)
            text = variables_source(p.table, p.form, p.scene, p.system)
            model = model_source(p.form)
            motions = (
                "const Prescribed MOTIONS;\n"  # of prescribed.c: only the tables are looked at
            )
            library = compile_library(
                folder, ("interval.c",), model + text + motions, [f"-I{folder}"]
            )
            count = ctypes.c_int.in_dll(library, "VARIABLE_COUNT").value
            first = ctypes.c_void_p.in_dll(library, "VARIABLES").value
            rows = (CVariable * count).from_address(first)
            made[name] = (p, library, list(rows))
        return made[name]

    return get


@pytest.mark.parametrize("name", NAMES)
def test_every_variable_is_there_in_order(table: Any, name: str) -> None:
    """Name, type, role, start, bounds: as in modelDescription.xml, doubles with all their bits."""
    p, library, rows = table(name)
    assert len(rows) == len(p.table.variables)
    for row, v in zip(rows, p.table.variables, strict=True):
        assert row.name.decode() == v.name
        kind = "Integer" if v.kind == "Enumeration" else v.kind
        assert (TYPES[row.type], ROLES[row.role]) == (kind, v.role)
        start = NUMBERS[v.start] if isinstance(v.start, str) else v.start
        assert row.start == (0.0 if start is None else start)
        assert row.min == (-math.inf if v.minimum is None else v.minimum)
        assert row.max == (math.inf if v.maximum is None else v.maximum)
        assert bool(row.positive) == v.positive
    assert ctypes.c_char_p.in_dll(library, "MODEL_IDENTIFIER").value == name.encode()
    assert ctypes.c_char_p.in_dll(library, "MODEL_GUID").value == b"{1234}"
    assert ctypes.c_double.in_dll(library, "DEFAULT_TOLERANCE").value == p.scene.tolerance
    method = ctypes.c_int.in_dll(library, "DEFAULT_METHOD").value
    assert methods()[p.scene.method.upper()] == method
    assert methods() == {k.upper(): number for k, number in NUMBERS.items()}


@pytest.mark.parametrize("name", NAMES)
def test_states_are_those_that_are_stepped(table: Any, name: str) -> None:
    """`state` numbers the start values: coordinates, then velocities, of the stepped system."""
    p, _, rows = table(name)
    q = p.system.coordinates
    order = [*q, *(f"der({c})" for c in q)]
    found = {row.state: row.name.decode() for row in rows if ROLES[row.role] == "start"}
    assert [found[j] for j in range(len(order))] == order
    assert all(row.state == -1 for row in rows if ROLES[row.role] != "start")


def arrays(p: Prepared) -> dict[str, Any]:
    """What the C solver observes at the start, by place, from what the Python solver observes."""
    system = p.system
    full = system if system.embedding is None else system.embedding.full
    value = {v.name: v.start for v in p.table.variables}
    u = [float(value[str(s)]) for s in p.equations.u]
    parameters = [float(value[str(s)]) for s in p.equations.p]
    q0 = [float(value[c]) for c in system.coordinates]
    v0 = [float(value[f"der({c})"]) for c in system.coordinates]
    state = start(system, Settings(), 0.0, q0, v0, u, parameters).state
    seen = observe(system, state, u, parameters)
    coordinates, rows = full.coordinates, [row.name for row in full.rows]
    entries = [(rows[k], coordinates[j]) for k, j in zip(*full.jacobian, strict=True)]
    contacts = [system.rows[k].name for k in system.contacts]
    count = len(contacts)  # at the start nothing has closed
    seen |= {v.name: 0 for v in p.table.variables if v.of.head == "closing"}
    seen |= {"energy.dissipated": 0.0}
    return {
        "seen": seen,
        "PARAMETER": parameters,
        "INPUT": u,
        "Q": [seen[c] for c in coordinates],
        "V": [seen[f"der({c})"] for c in coordinates],
        "VDOT": [seen[f"der({c},2)"] for c in coordinates],
        "S": [seen[c] for c in system.coordinates],
        "SDOT": [seen[f"der({c})"] for c in system.coordinates],
        "SDDOT": [seen[f"der({c},2)"] for c in system.coordinates],
        "LAMBDA": [seen[f"lambda.{r}"] for r in rows],
        "UNIQUE": [seen[f"unique.{r}"] for r in rows],
        "RESIDUAL": [seen[f"residual.{r}"] for r in rows],
        "FORCE": [seen[f"Q.{c}"] for c in coordinates],
        "SHARE": [seen[f"Q.{r}.{c}"] for r, c in entries],
        "KINETIC": [seen["energy.kinetic"]],
        "POTENTIAL": [seen.get("energy.potential")],
        "TOTAL": [seen.get("energy.total")],
        "LOST": [0.0],
        "OUTPUT": [seen[own.name] for own in full.outputs],
        "CONTACT": [seen[f"contact.{c}"] for c in contacts],
        "DEPARTURE_COUNT": [[seen[f"departure.{c}.count"]] for c in contacts],
        "DEPARTURE_TIME": [[seen[f"departure.{c}.time"]] for c in contacts],
        "DEPARTURE_Q": [[seen[f"departure.{c}.{q}"] for q in coordinates] for c in contacts],
        "DEPARTURE_V": [
            [seen[f"departure.{c}.velocity.{q}"] for q in coordinates] for c in contacts
        ],
        "IMPULSE": [0] * count,
        "CLOSING_COUNT": [[0]] * count,
        "CLOSING_TIME": [[0]] * count,
        "CLOSING_Q": [[0] * full.n] * count,
        "CLOSING_V": [[0] * full.n] * count,
        "STEPS": [seen["solver.steps"]],
    }


@pytest.mark.parametrize("name", NAMES)
def test_places_hold_what_the_names_say(table: Any, name: str) -> None:
    """Read by place and index, each output is the value that the Python solver reports by name."""
    p, _, rows = table(name)
    where, at = places(), arrays(p)
    own = [str(c) for c in p.equations.q]
    for row in rows:
        place, full_name = where[row.place], row.name.decode()
        if ROLES[row.role] == "solver":
            assert full_name == f"solver.{place.lower()}"
            continue
        if ROLES[row.role] in ("parameter", "input"):
            assert place == ROLES[row.role].upper()
            assert at[place][row.index] == row.start
            continue
        if place in ("S", "SDOT", "SDDOT"):
            assert re.sub(r"der\((\w+).*", r"\1", full_name) not in own
        values = at[place]
        if place.startswith(("DEPARTURE_", "CLOSING_")):
            values = values[row.contact]
        assert values[row.index] == at["seen"][full_name]
    used = [(row.place, row.index, row.contact) for row in rows]
    assert len(set(used)) == len(used)


def test_strings_are_escaped() -> None:
    """Quotes, backslashes, trigraphs and letters beyond ASCII survive a C string literal."""
    assert string('a"b\\c') == '"a\\042b\\134c"'
    assert string("??/") == '"\\077\\077/"'
    assert string("µ") == '"\\302\\265"'
