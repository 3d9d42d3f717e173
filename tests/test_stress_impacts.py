"""Contacts that are struck together: what is right passes, a wrong law is found (stress_impacts.py)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stress_impacts as impacts
from impact_models import corner, cradle, rod, table, wedge
from stress_geometry import geometry_of, lay_geometry, twin
from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Contact, Friction, Model, Nonholonomic, Parameter, Scene, multiplier
from lagfmu.testing import (
    RIGHT,
    WRONG,
    Bench,
    Verdict,
    attempt,
    find_compiler,
    native,
    prepare,
    verdict,
    write,
)

pytestmark = [
    pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine"),
    pytest.mark.filterwarnings("ignore:.*follows? from the others"),
]


def probed(model: Model, folder: Path) -> dict[str, Verdict]:
    """Every row of the family."""
    scene = Scene(model.name, stop_time=2.0)
    one = prepare(model, scene)
    path = write(one, folder, [], target="native")
    lay_geometry(path, one)
    turned = replace(model, constraints=tuple(reversed(model.constraints)))
    write(prepare(turned, scene), folder / "reversed", [], target="native").replace(twin(path))
    with Bench(path, quick=False) as bench:
        found = [
            verdict(p, attempt(p, bench), 0.0) for p in impacts.probes(bench.facts, bench.quick)
        ]
    return {row.probe: row for row in found}


@pytest.mark.parametrize(
    ("model", "sets"),
    [(rod(), 3), (table(), 9), (wedge(value=0.5), 3), (cradle(4), 4), (corner(tilt=0.3), 3)],
    ids=["rod", "table", "wedge", "cradle", "corner"],
)
def test_impacts_together_are_right(model, sets, tmp_path):
    """Each set of contacts that can close together keeps Newton's law, the energy, the order and the
    symmetry: a table has 9 of them, since three legs on the floor have the fourth on it."""
    rows = probed(model, tmp_path)
    assert len(rows) == sets
    assert {row.verdict for row in rows.values()} == {RIGHT}
    assert all(row.checks >= 12 for row in rows.values())


ONE_BY_ONE = "if (entering[c] && x.k == 0) x.contact[x.k++] = c;"
MUTANTS: dict[str, tuple[str, str]] = {
    "one after another": ("if (entering[c]) x.contact[x.k++] = c;", ONE_BY_ONE),
    "the same e twice": (
        "(1 + x->e[row]) * x->slip[row];",
        "(1 + 1.1 * x->e[row]) * x->slip[row];",
    ),
    "a contact that pulls": (
        "x->active[row] = pass == 0 ? x->w[i] == 0 : x->z[i] > 0;",
        "x->active[row] = 1;",
    ),
}


@pytest.mark.parametrize("mutant", MUTANTS)
def test_a_wrong_law_of_impacts_is_found(mutant, tmp_path, monkeypatch):
    """Contacts taken one after another, a rebound too fast by a tenth of e, contacts that pull: each is
    wrong in some row."""
    files: Callable[[], dict[str, Any]] = native.runtime_files
    old, new = (text.encode() for text in MUTANTS[mutant])
    changed = files()
    assert changed["impact.c"].count(old) == 1
    changed["impact.c"] = changed["impact.c"].replace(old, new)
    monkeypatch.setattr(native, "runtime_files", lambda: changed)
    rows = probed(rod(inertia=4.0, theta=0.2), tmp_path) | probed(corner(tilt=0.3), tmp_path)
    assert any(row.verdict == WRONG for row in rows.values())


@pytest.mark.parametrize(("feet", "mirrors"), [(("left", "right"), 1), (("left",), 0)])
def test_a_rod_that_rubs_with_one_foot_has_no_mirror_image(feet, mirrors, tmp_path):
    """theta -> -theta, x -> -x takes a foot to the other one: an image only if both rub, or none."""
    t = dynamicsymbols._t
    x, z, theta = dynamicsymbols("x z theta")
    m, l = symbols("m l", positive=True)  # noqa: E741
    ends = {"left": -l, "right": l}
    rows = [Contact(n, z + s * sin(theta)) for n, s in ends.items()]
    for n in feet:
        rate = (x + ends[n] * cos(theta)).diff(t)
        rows += [
            Nonholonomic(f"{n}_foot", rate),
            Friction(f"{n}_grip", of=[f"{n}_foot"], normal=multiplier(n), static=0.5),
        ]
    model = Model(
        name="Rubs",
        lagrangian=m * (x.diff() ** 2 + z.diff() ** 2) / 2 + m * l**2 / 6 * theta.diff() ** 2,
        coordinates={x: "m", z: "m", theta: "rad"},
        constraints=rows,
        parameters=[Parameter(m, 1.0, "kg"), Parameter(l, 1.0, "m")],
        start={z: 1.0},
    )
    lay_geometry(tmp_path / "Rubs.fmu", prepare(model, Scene("Rubs")))
    geometry = geometry_of(tmp_path / "Rubs.fmu")
    known = {"m": 1.0, "l": 1.0, "time": 0.0}
    found = impacts._mirrors(geometry, known, np.array([0.0, 0.0, 0.0]))
    assert len([s for s in found if s[2] < 0]) == mirrors
