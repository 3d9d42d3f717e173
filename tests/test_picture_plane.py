"""Pictures of mechanisms in the plane: bodies by their markers, joints and loads by their kinds."""

import itertools

import pytest
import sympy as sp

from lagfmu import Disk, Line, Pivot, Rod, Spring
from lagfmu.bodies import (
    Body,
    Contact,
    Distance,
    Fixed,
    Gear,
    Gravity,
    Ground,
    Motor,
    PointOnPlane,
    Prismatic,
    Revolute,
    SpringDamper,
    Torsion,
    mechanism,
)
from lagfmu.testing import icon, picture_of, prepare, read_picture
from lagfmu.testing import picture_bytes as written

ground = Ground()


def everything():
    """A slide with a motor and a spring, a hinge that is geared, a weld, a plane, a wheel on a floor."""
    c, p, w, f = (Body(n, 1.0, 0.01) for n in "cpwf")
    return mechanism(
        "Everything",
        plane="xy",
        bodies=[c, p, w, f],
        joints=[
            Prismatic("S", ground.at((0, 0)), c.at((0, 0))),
            Revolute("H", c.at((0, 0.1)), p.at((-0.3, 0))),
            Fixed("W", p.at((0.3, 0)), w.at((0, 0))),
            PointOnPlane("P", ground.at((1, -0.5)), f.at((0, -0.1))),
            Distance("rod", p.at((0, 0)), f.at((0, 0.1)), 1.0),
            Gear("G", "S", "H", 0.1),
        ],
        loads=[
            Gravity((0, -9.81)),
            Motor("drive", "S"),
            Torsion("coil", "H", 2.0),
            Torsion("push", "S", 20.0),
            SpringDamper("spring", ground.at((0, 1)), p.at((0, 0)), 10, 0.5),
            SpringDamper("damper", ground.at((0, 1)), f.at((0, 0)), damping=1.0),
        ],
        contacts=[Contact("floor", ground.at((0, -0.8)), w.at((0, 0)), 0.1)],
    )


def at_start(model, point):
    """A point in numbers, the coordinates at their start."""
    known = {p.symbol: p.value for p in model.parameters} | dict(model.start)
    return tuple(round(float(sp.sympify(x).subs(known)), 9) for x in point)


def test_each_joint_and_load_shows_what_it_is():
    """A sleeve, a weld, a plate, what drives and what springs about an axis, springs and dampers, rods
    without mass, wheels: none of them moves bodies unseen."""
    model = everything()
    kinds = [s.kind for s in model.picture if isinstance(s, Pivot) and s.axis is not None]
    assert sorted(kinds) == sorted(
        ["sleeve", "weld", "plate", "plate", "motor", "torsion", "gear", "gear"]
    )
    springs = [s for s in model.picture if isinstance(s, Spring)]
    assert sorted(s.coils for s in springs) == [0, 8, 8]
    assert any(isinstance(s, Disk) and s.radius is not None for s in model.picture)
    bars = {
        tuple(at_start(model, p) for p in s.points) for s in model.picture if isinstance(s, Rod)
    }
    assert len(bars) == 4  # of c, p, f, and the one without mass
    lines = [s for s in model.picture if isinstance(s, Line)]
    assert len(lines) == 1  # the way that the slide has gone
    shown = picture_of(prepare(model))
    assert read_picture(written(shown)) == shown
    assert all("strokes" in s for s in shown["shapes"] if s["kind"] == "pivot" and "axis" in s)
    assert len(icon(prepare(model))) == 2


@pytest.mark.parametrize(
    ("places", "corners"),
    [
        ([(-0.1, 0), (0.1, 0), (0.1, 0)], 2),
        ([(-0.1, 0), (0.0, 0), (0.1, 0), (0.05, 0)], 2),
        ([(0, 0.2), (0.2, -0.1), (-0.2, -0.1), (0.2, -0.1)], 3),
        ([(-0.2, -0.1), (0.2, 0.1), (-0.2, 0.1), (0.2, -0.1)], 4),
    ],
)
def test_a_body_is_the_outline_of_its_markers_each_place_once(places, corners):
    """Markers at one place, on one line or in any order: a rod, or corners that go round once."""
    body, last = Body("body", 1.0, 0.01), Body("last", 1.0, 0.01)
    model = mechanism(
        "Outline",
        plane="xy",
        bodies=[body, last],
        joints=[Revolute("A", body.at(places[0]), last.at((-0.1, 0)))],
        loads=[
            SpringDamper(f"s{k}", ground.at((k, 3)), body.at(p), 1.0)
            for k, p in enumerate(places[1:])
        ],
    )
    outline = next(s for s in model.picture if isinstance(s, Rod | Line))
    found = [at_start(model, p) for p in outline.points]
    if corners > 2:
        assert found[0] == found[-1]
        turns = [
            (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
            for a, b, c in zip(found, found[1:], [*found[2:], found[1]], strict=False)
        ]
        assert all(turn > 1e-6 for turn in turns)
        found = found[:-1]
    assert len(set(found)) == len(found) == corners
    assert all(a != b for a, b in itertools.pairwise(found))
