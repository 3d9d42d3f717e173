"""The description of FMI 3.0: that of FMI 2.0 in other words, and what only FMI 3.0 has variables for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from xml.etree.ElementTree import Element, fromstring

import fmpy
import pytest
from conftest import of_each_kind
from fmpy.validation import validate_fmu
from lxml import etree
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass

from lagfmu import Holonomic, Scene
from lagfmu.errors import ModelError, UsageError
from lagfmu.testing import (
    Face,
    Prepared,
    as_built,
    build_description,
    prepare,
    sources_of,
    write,
)

SCHEMAS = Path(fmpy.__file__).parent / "schema" / "fmi3"
TYPES = {"Real": "Float64", "Integer": "Int32"} | {n: n for n in ("Boolean", "Enumeration")}
FRICTION = "SlippingSphere"  # a contact and a friction


def described(prepared: Prepared, **of_3: bool) -> bytes:
    """modelDescription.xml of FMI 3.0."""
    face = Face(3, **of_3)
    return sources_of(as_built(prepared, "native", face), True, face).description


def variables(text: bytes) -> dict[str, Element]:
    """By name."""
    return {v.get("name", ""): v for v in fromstring(text).find("ModelVariables") or ()}


def structure(text: bytes, kind: str) -> dict[str, list[str]]:
    """The dependencies of unknowns of a kind, by name."""
    called = {v.get("valueReference"): n for n, v in variables(text).items()}
    return {
        called[u.get("valueReference")]: [called[k] for k in u.get("dependencies", "").split()]
        for u in fromstring(text).iterfind(f"ModelStructure/{kind}")
    }


def schema(name: str) -> etree.XMLSchema:
    """One of the standard's."""
    return etree.XMLSchema(etree.parse(SCHEMAS / f"{name}.xsd"))


@pytest.mark.parametrize("name", of_each_kind(["Hemisphere", "HalfCar", FRICTION, "RotatingWire"]))
def test_the_standard_takes_it(
    name: str, prepared: Callable[[str], Prepared], tmp_path: Path
) -> None:
    """The schema and fmpy have nothing to say, with clocks and arrays too."""
    for further in ({}, {"clocks": True, "arrays": True}):
        text = described(prepared(name), **further)
        schema("fmi3ModelDescription").assertValid(etree.fromstring(text))
        (tmp_path / "modelDescription.xml").write_bytes(text)
        assert validate_fmu(str(tmp_path)) == []


def test_what_a_recompilation_needs_is_told() -> None:
    """One file, which includes the others."""
    text = build_description("Hemisphere", ("all.c",))
    schema("fmi3BuildDescription").assertValid(etree.fromstring(text))
    assert [f.get("name") for f in fromstring(text).iter("SourceFile")] == ["all.c"]


def test_the_variables_of_both_versions_are_the_same(prepared: Callable[[str], Prepared]) -> None:
    """Value references, units, bounds and start values: what is new in FMI 3.0 comes after all of them."""
    of_2 = fromstring(sources_of(as_built(prepared(FRICTION), "native")).description)
    of_3 = list(variables(described(prepared(FRICTION), clocks=True, arrays=True)).values())
    old = list(of_2.find("ModelVariables") or ())
    for v, new in zip(old, of_3, strict=False):
        (typed,) = v
        assert new.tag == TYPES[typed.tag]
        said = {**v.attrib, **typed.attrib}
        if "derivative" in said:  # there an index, here a value reference
            said["derivative"] = str(int(said["derivative"]) - 1)
        assert said == {n: x for n, x in new.attrib.items() if n != "intermediateUpdate"}
    further = of_3[len(old) :]
    assert [v.get("name") for v in further if v.tag == "Clock"] == ["clock.surface", "clock.grip"]
    assert not any(v.get("clocks") for v in of_3)


def test_time_stands_behind_what_moves_with_it(prepared: Callable[[str], Prepared]) -> None:
    """A wire that turns as w t is rheonomic: the angle stands in the forces; a hemisphere is scleronomic."""
    found = structure(described(prepared("RotatingWire")), "Output")
    assert any("time" in known for known in found.values())
    resting = structure(described(prepared("Hemisphere")), "Output")
    assert not any("time" in known for known in resting.values())


def test_each_surface_that_is_watched_has_an_indicator(
    prepared: Callable[[str], Prepared],
) -> None:
    """A contact has one, a friction two; with error bars there is no model exchange, and no indicator."""
    text = described(prepared(FRICTION))
    assert list(structure(text, "EventIndicator")) == [
        "indicator.surface",
        "indicator.grip.mode",
        "indicator.grip.normal",
    ]
    barred = described(prepare(prepared(FRICTION).model, Scene("Barred", error_bars=True)))
    assert structure(barred, "EventIndicator") == {}


def test_forces_of_a_unit_are_one_array(prepared: Callable[[str], Prepared]) -> None:
    """The generalized forces in newtons are one array; a multiplier in N/m is in another."""
    found = variables(described(prepared("PendulumCartesian"), arrays=True))
    array = found["Q.N"]
    assert [d.get("start") for d in array.iter("Dimension")] == ["2"]
    assert array.get("description") == "array of Q.x, Q.y"
    assert {"lambda.'N/m'", "residual.m2"} < found.keys()


def test_what_is_not_there_is_refused_by_name(tmp_path: Path) -> None:
    """Clocks in FMI 2.0, another version, a python FMU of FMI 3.0, a constraint called as an array."""
    with pytest.raises(UsageError, match=r"clocks and arrays: FMI 2\.0 has none"):
        Face(2, clocks=True, arrays=True)
    with pytest.raises(UsageError, match="fmi = 1 is no version that is known, expected 2 or 3"):
        Face(1)
    x = dynamicsymbols("x")
    model = point_mass("Held", "x", [Holonomic("N", x)])
    with pytest.raises(UsageError, match=r"the target python has FMI 2\.0 alone"):
        write(prepare(model), tmp_path, target="python", face=Face(3))
    with pytest.raises(ModelError, match=r"two variables of the FMU would be called 'lambda\.N'"):
        as_built(prepare(model), "native", Face(3, arrays=True))
