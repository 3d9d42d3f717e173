"""Tables as functions: a bead on a tabulated wire, their ends, units, and what is refused."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest
import sympy as sp
from instance import instance
from scipy.interpolate import CubicSpline
from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    ClosedForm,
    Holonomic,
    Model,
    Output,
    Parameter,
    Scene,
    Spline,
    build_fmu,
    derive,
    simulate,
    verify,
)
from lagfmu.errors import LagfmuError, LagfmuWarning, ModelError, TableError

x, z = dynamicsymbols("x z")
m, g = symbols("m g", positive=True)
KNOTS = [-1.0, -0.4, 0.1, 0.7, 1.0]
HEIGHTS = [0.9, 0.1, 0.05, 0.4, 0.8]
wire = Spline("wire", KNOTS, HEIGHTS, "m", "m")


def bead(table: Spline = wire, **changes) -> Model:
    """A bead on a smooth wire z = wire(x)."""
    fields = {
        "name": "Bead",
        "lagrangian": m * (x.diff() ** 2 + z.diff() ** 2) / 2 - m * g * z,
        "coordinates": {x: "m", z: "m"},
        "constraints": [Holonomic("wire", z - table(x))],
        "parameters": [Parameter(m, 2.0, "kg"), Parameter(g, 9.81, "m/s^2")],
        "start": {x: -0.8, z: table.table(-0.8)},
        "outputs": [Output("slope", table(x).diff(x), "1"), Output("above", z - table(x), "m")],
    }
    return Model(**(fields | changes))


@pytest.mark.parametrize("ends", ["natural", "clamped", "not-a-knot", "periodic"])
def test_a_table_is_the_cubic_spline_through_its_points(ends):
    """Value and three derivatives between the knots are SciPy's; outside a straight line, or a period."""
    y = [*HEIGHTS[:-1], HEIGHTS[0]] if ends == "periodic" else HEIGHTS
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        table = Spline("p", KNOTS, y, "m", "m", ends).table
    right = CubicSpline(KNOTS, y, bc_type=ends)
    inside = np.linspace(-1, 1, 41)[:-1]
    for order in range(4):
        found = [table(float(a), order) for a in inside]
        np.testing.assert_allclose(found, right(inside, order), atol=1e-12)
    if ends == "periodic":
        assert table(1.3, 1) == pytest.approx(float(right(-0.7, 1)), abs=1e-12)
    else:
        assert table(3.0) == pytest.approx(HEIGHTS[-1] + 2 * float(right(1.0, 1)))
        assert (table(3.0, 1), table(3.0, 2)) == (table(2.0, 1), 0.0)
        assert table(-3.0) == pytest.approx(HEIGHTS[0] - 2 * float(right(-1.0, 1)))


def test_the_equations_hold_the_table_and_its_derivatives():
    """G = (-wire', 1) and gamma = wire'' x'^2: one function and its derivatives, never its pieces."""
    eom = derive(bead())
    q, v = eom.q[0], eom.v[0]
    assert list(eom.G) == [-wire.derivative(1)(q), 1]
    assert eom.gamma[0] - wire.derivative(2)(q) * v**2 == 0
    assert not any(e.has(sp.Piecewise) for e in (*eom.G, *eom.gamma, *eom.f))


@pytest.mark.parametrize(
    ("target", "formulation"),
    [("python", "multipliers"), ("native", "multipliers"), ("native", "minimal")],
)
def test_a_bead_keeps_to_the_tabulated_wire(target, formulation, tmp_path):
    """z = wire(x), the energy is conserved, lambda = m (g + z''), across four knots; also where the wire is
    solved for z."""
    scene = Scene("Bead", formulation, step_size=0.01)
    path = build_fmu(bead(), tmp_path, scene, target=target, check=False)
    run = simulate(path, 1.0 if target == "native" else 0.3, tolerance=1e-10)
    right = CubicSpline(KNOTS, HEIGHTS, bc_type="natural")
    np.testing.assert_allclose(run["z"], right(run["x"]), atol=1e-13)
    np.testing.assert_allclose(run["slope"], right(run["x"], 1), atol=1e-13)
    np.testing.assert_allclose(run["lambda.wire"], 2.0 * (9.81 + run["der(z,2)"]), rtol=1e-12)
    np.testing.assert_allclose(run["energy.total"], run["energy.total"][0], rtol=2e-8)
    if target == "native":
        assert run["x"].max() > 0.7


@pytest.mark.parametrize("target", ["python", "native"])
def test_beyond_its_ends_a_table_goes_on_straight_and_says_so_once(target, tmp_path):
    """Thrown over the end of the table, the bead slides on along a straight line: z'' = wire' x''."""
    start = {x: 0.9, z: wire.table(0.9), x.diff(): 3.0, z.diff(): 3.0 * wire.table(0.9, 1)}
    path = build_fmu(bead(start=start), tmp_path, target=target)
    with instance(path) as one:
        one.start()
        for _ in range(20):
            one.step(0.01)
        assert one.get("x") > 1.1
        slope = CubicSpline(KNOTS, HEIGHTS, bc_type="natural")(1.0, 1)
        assert one.get("der(z)") == pytest.approx(slope * one.get("der(x)"), rel=1e-12)
        told = [text for _, _, text in one.log if "table wire is looked up" in text]
    assert len(told) == 1
    assert "from -1.0 to 1.0" in told[0]


def test_a_closed_form_may_hold_a_table(tmp_path):
    """A closed form that looks a table up travels with its points, and is held against the run."""
    forms = [ClosedForm("z", wire(x)), ClosedForm("der(z)", wire(x).diff())]
    path = build_fmu(bead(), tmp_path, Scene("Bead"), forms, target="native", check=False)
    found = verify(path, stop_time=0.5)
    assert found.passed
    assert [c.name for c in found.checks if c.name in ("z", "der(z)")] == ["z", "der(z)"]
    wrong = [ClosedForm("z", wire(x) * 1.001)]
    path = build_fmu(bead(), tmp_path, Scene("Bead"), wrong, target="native", check=False)
    assert not verify(path, stop_time=0.5).passed


def test_the_points_come_from_a_file(tmp_path):
    """By the columns' numbers or names; what is no number is told with its row."""
    path = tmp_path / "road.csv"
    path.write_text("way [m],height [m]\n0,0\n1,0.5\n2,0.25\n")
    table = Spline.read("road", path, "m", "m", columns=("way [m]", 1))
    assert (table.x, table.y) == ((0.0, 1.0, 2.0), (0.0, 0.5, 0.25))
    path.write_text("0,0\n1,high\n")
    with pytest.raises(TableError, match=r"road.csv', row 2: 'high' is no number"):
        Spline.read("road", path, "m", "m")
    with pytest.raises(TableError, match="column 'way' is not there"):
        Spline.read("road", path, "m", "m", columns=("way", 1))
    with pytest.raises(TableError, match="cannot be read"):
        Spline.read("road", tmp_path / "none.csv", "m", "m")


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (([0, 2, 1], [0, 0, 0]), "x[1] = 2.0 is followed by 1.0, expected ascending"),
        (([0, 1, 1], [0, 0, 0]), "x[1] = x[2] = 1.0: a function has one value"),
        (([0], [0]), "1 points, expected at least 2"),
        (([0, 1], [0, 1, 2]), "2 values of x and 3 of y"),
        (([0, math.nan], [0, 1]), "x[1] = nan, expected finite"),
        (([0, 1], [0, math.inf]), "y[1] = inf, expected finite"),
        (([0, 1], "ab"), "y = 'ab', expected a list of numbers"),
        (([0, 1], [0, 1], "m", "degC"), "an offset or logarithmic scale"),
        (([0, 1], [0, 1], "m", "m", "free"), "ends = 'free', expected one of 'natural'"),
        (([0, 1, 2], [0, 1, 2], "m", "m", "periodic"), "begins with 0.0 and ends with 2.0"),
        (([0, 1, 2], [0, 1, 2], "m", "m", "not-a-knot"), "at least 4"),
    ],
)
def test_a_table_that_is_no_function_is_refused(arguments, part):
    """The table is named, with the point, what was expected and what to do."""
    units = () if len(arguments) > 2 else ("m", "m")
    with pytest.raises(TableError) as refused:
        Spline("road", *arguments, *units)
    assert "spline 'road'" in str(refused.value)
    assert part in str(refused.value)


def test_names_that_cannot_be_are_refused():
    """A name of SymPy's, no identifier, and two tables that are called alike."""
    for name in ("sin", "my road"):
        with pytest.raises(LagfmuError, match="its name"):
            Spline(name, [0, 1], [0, 1], "m", "m")
    other = Spline("wire", [0, 1], [0, 1], "m", "m")
    with pytest.raises(ModelError, match="two tables are called 'wire'"):
        bead(lagrangian=m * x.diff() ** 2 - m * g * other(x))


def test_a_table_has_units():
    """Its argument, and its value and slopes, are held to its units."""
    force = Spline("force", [0, 1], [0, 1], "m/s", "N")
    bead(forces={x: -force(x.diff())})
    for wrong in (force(x), force(x.diff()) * x):
        with pytest.raises(ModelError) as refused:
            bead(forces={x: wrong})
        assert "force" in str(refused.value)


def test_ends_that_jump_are_told():
    """A clamped spline that goes on straight has a jump of its second derivative there."""
    with pytest.warns(LagfmuWarning, match="spline 'p'.*jump of the second derivative"):
        Spline("p", [0, 1, 2], [0, 1, 0], "m", "m", "clamped")
