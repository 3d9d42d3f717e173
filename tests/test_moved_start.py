"""Start values that miss the constraints are moved onto them, in the metric of the masses."""

from __future__ import annotations

from math import cos, hypot, sin

import pytest
from instance import instance

from lagfmu import simulate
from lagfmu.testing import StartMovedWarning

ALONG, LENGTH = cos(0.5) + 2 * sin(0.5), hypot(0.6, 0.9)
MOVED = {  # FMU, what is set, and where it starts
    "the other mass follows": ("Atwood", {"x1": 0.3}, {"x1": 0.3, "x2": -0.3}),
    # both were set: what is missing is shared in the inverse ratio of m1 = 2 kg and m2 = 1 kg
    "the lighter mass moves more": (
        "Atwood",
        {"x1": 0.4, "x2": -0.1},
        {"x1": 0.4 - 0.1, "x2": -0.1 - 0.2},
    ),
    "a bob moves along its rod": (
        "PendulumCartesian",
        {"x": 0.6, "y": -0.9, "der(x)": 0.6, "der(y)": -0.9},
        {"x": 0.6 / LENGTH, "y": -0.9 / LENGTH, "der(x)": 0.0, "der(y)": 0.0},
    ),
    "a sideways velocity is taken away": (
        "KnifeEdge",
        {"phi": 0.5, "der(x)": 1.0, "der(y)": 2.0},
        {"der(x)": ALONG * cos(0.5), "der(y)": ALONG * sin(0.5)},
    ),
    "the motor wins": (
        "RotatingWire",
        {"omega": 3.0, "der(phi)": 2.0, "r": 0.1},
        {"der(phi)": 3.0, "r": 0.1, "der(r,2)": 0.9},
    ),
}


@pytest.mark.parametrize("case", MOVED)
def test_a_start_that_misses_the_constraints_is_moved_onto_them(native_fmu, case):
    """What was set stands where something else can follow; where not, masses share the way inversely, and
    only the velocity that the constraints allow is left.  Each that moves is told."""
    name, values, expected = MOVED[case]
    with instance(native_fmu(name)) as one:
        one.start(values)
        found = {n: one.get(n) for n in expected}
        assert found == pytest.approx(expected, rel=1e-14, abs=1e-15)
        told = {text.split()[2] for status, _, text in one.log if status == 1}
        starts = {n: one.variables[n].start for n in expected}
    before = {n: float(x) for n, x in (starts | values).items() if x is not None}
    assert told == {n for n in found.keys() & before.keys() if found[n] != before[n]}


@pytest.mark.filterwarnings("ignore::lagfmu.testing.StartMovedWarning")
@pytest.mark.parametrize(
    ("name", "variable", "asked", "reach"),
    [
        ("PendulumCartesian", "x", 1.5, 1.0),
        ("PendulumCartesian", "y", -3.0, -1.0),
        ("Door", "door.position.x", -1.0, -0.4),
        ("SliderCrankBodies", "piston.position.x", 5.0, 0.7),
    ],
)
def test_a_value_beyond_reach_is_moved_to_about_as_far_as_it_reaches(
    fmu, name, variable, asked, reach
):
    """A bob farther out than its rod is long, a door's middle farther from its hinges than half its width, a
    piston beyond crank and rod: each begins on the constraints, in the direction that was asked for."""
    with pytest.warns(StartMovedWarning, match=f"start value {variable} = {asked}"):
        run = simulate(fmu(name), 1e-4, 1e-4, start_values={variable: asked})
    assert reach * run[variable][0] > 0
    assert 0.9 * abs(reach) < abs(run[variable][0]) <= (1 + 1e-12) * abs(reach)
    assert max(abs(run[n][0]) for n in run.dtype.names if n.startswith("residual")) < 1e-14
