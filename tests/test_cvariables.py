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


def test_strings_are_escaped() -> None:
    """Quotes, backslashes, trigraphs and letters beyond ASCII survive a C string literal."""
    assert string('a"b\\c') == '"a\\042b\\134c"'
    assert string("??/") == '"\\077\\077/"'
    assert string("µ") == '"\\302\\265"'
