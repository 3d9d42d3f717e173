"""Pictures in space: solids of a body's inertia, shapes that are given to bodies, URDF's primitives."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from conftest import Opened
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Box, Disk, Line, Pivot, Rod, Scene, Sphere
from lagfmu.bodies import (
    Body,
    Distance,
    Gravity,
    Ground,
    Prismatic,
    Revolute,
    Spherical,
    from_urdf,
    mechanism,
)
from lagfmu.errors import BuildError, LagfmuWarning, ModelError
from lagfmu.testing import (
    picture_bytes,
    picture_of,
    playable,
    prepare,
    read_picture,
    render,
    solid,
)
from lagfmu.testing import picture_values as values

ground = Ground()


def inertia_of(shape: Any) -> Any:
    """The tensor of inertia per mass about the middle, by integration over points of a grid."""
    n = np.linspace(-1, 1, 81)
    n = (n[1:] + n[:-1]) / 2
    x, y, z = (a.ravel() for a in np.meshgrid(n, n, n))
    if isinstance(shape, Sphere):
        r = float(shape.radius) * np.array([x, y, z])[:, x**2 + y**2 + z**2 < 1]
    elif isinstance(shape, Box):
        r = np.array(shape.rotation) @ (np.array([x, y, z]) * np.array(shape.size)[:, None] / 2)
    else:
        half = (np.array(shape.end) - shape.start) / 2
        u = np.cross(half, np.roll(half, 1) + 0.1)
        u *= shape.radius / np.linalg.norm(u)
        v = np.cross(half, u) / np.linalg.norm(half)
        inside = x**2 + y**2 < 1
        r = (np.outer(u, x) + np.outer(v, y) + np.outer(half, z))[:, inside]
    return (r**2).sum(axis=0).mean() * np.eye(3) - r @ r.T / r.shape[1]


TURNED = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
TENSORS = {
    "box": (Box, np.diag([0.05, 0.04, 0.02])),
    "turned box": (Box, TURNED @ np.diag([0.05, 0.04, 0.02]) @ TURNED.T),
    "wheel": (Rod, np.diag([0.02, 0.02, 0.035])),
    "turned rod": (Rod, TURNED @ np.diag([0.05, 0.002, 0.05]) @ TURNED.T),
    "ball": (Sphere, 0.03 * np.eye(3)),
}


@pytest.mark.parametrize("case", TENSORS)
def test_a_body_looks_like_what_has_its_inertia(case: str) -> None:
    """The uniform solid of the mass 2 kg that is drawn has the tensor that was given."""
    kind, J = TENSORS[case]
    found = solid(2.0, [*np.diag(J), J[0, 1], J[0, 2], J[1, 2]], (0, 0, 0), 0.0)
    assert isinstance(found, kind)
    np.testing.assert_allclose(2.0 * inertia_of(found), J, rtol=0, atol=0.01 * np.trace(J))


def test_a_solid_is_not_larger_than_its_mechanism() -> None:
    """A rotor's inertia on a small body: as large as was said, in proportion; a plate keeps a thickness."""
    large = solid(0.01, (5.0, 4.0, 2.0, 0, 0, 0), (0, 0, 0), 0.3)
    free = solid(0.01, (5.0, 4.0, 2.0, 0, 0, 0), (0, 0, 0), 0.0)
    assert isinstance(large, Box)
    assert isinstance(free, Box)
    assert max(large.size) == pytest.approx(0.3)
    np.testing.assert_allclose(np.divide(large.size, free.size), 0.3 / max(free.size))
    plate = solid(20.0, (6.7, 7.8, 1.1, 0, 0, 0), (0, 0, 0), 0.0)
    assert isinstance(plate, Box)
    assert sorted(plate.size) == pytest.approx([0.04, 0.812, 2.005], abs=1e-3)


def hanging(**fields: Any) -> Any:
    """A body on a ball joint, its centre of mass below."""
    body = Body("bob", mass=1.0, inertia=(0.02, 0.02, 0.01), center=(0.1, 0, -0.5), **fields)
    return mechanism(
        "Hanging",
        bodies=[body],
        joints=[Spherical("pin", ground.at((0, 0, 2)), body.at((0, 0, 0)))],
        loads=[Gravity((0, 0, -9.81))],
    )


def drawn(model: Any) -> list[dict[str, Any]]:
    """The picture's shapes, after the way through an FMU."""
    picture = picture_of(prepare(model, Scene(model.name)))
    assert picture is not None
    assert picture["dimensions"] == 3
    assert read_picture(picture_bytes(picture)) == picture
    return list(picture["shapes"])


def look(position: Any, quaternion: Any, **more: float) -> Any:
    """Values of the FMU's variables of the body bob."""
    names = {f"bob.position.{x}": p for x, p in zip("xyz", position, strict=True)}
    names |= {f"bob.orientation.{x}": p for x, p in zip("wxyz", quaternion, strict=True)}
    center = {"bob.center.x": 0.1, "bob.center.z": -0.5}
    return (names | center | more).__getitem__


def test_a_given_shape_is_carried_by_its_body() -> None:
    """A point p of the body's own frame is at r + R (p - c), the columns of a box's axes are those of R A;
    and nothing else is drawn of that body."""
    shapes = [
        Box((0, 0, -0.25), (0.1, 0.2, 0.5), ("rpy", 0, 0, np.pi / 2)),
        Sphere((0.1, 0, -0.5), 0.15),
        Rod((0, 0, 0), (0.1, 0, -0.5), 0.02),
        Line((0, 0, 0), (0, 0, -1)),
    ]
    box, ball, rod, line, *rest = drawn(hanging(shape=shapes))
    assert [s["kind"] for s in rest] == ["pivot", "direction", "arrow"]
    e = np.array([0.5, -0.5, 0.1, 0.7])
    e /= np.linalg.norm(e)
    r, c = np.array([1.0, 2.0, 3.0]), np.array([0.1, 0, -0.5])
    R = matrix(e)
    at = look(r, e)

    def point(p: Any) -> Any:
        return [values(x, at) for x in p]

    np.testing.assert_allclose(point(box["center"]), r + R @ (np.array([0, 0, -0.25]) - c))
    quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    np.testing.assert_allclose(np.array([point(a) for a in box["axes"]]).T, R @ quarter, atol=1e-15)
    assert point(box["size"]) == [0.1, 0.2, 0.5]
    np.testing.assert_allclose(point(ball["center"]), r)
    np.testing.assert_allclose(point(rod["points"][0]), r - R @ c)
    assert rod["radius"] == 0.02
    np.testing.assert_allclose(point(line["points"][1]), r + R @ ([0, 0, -1] - c))


def matrix(e: Any) -> Any:
    """R = 1 + 2 w [v] + 2 [v]^2."""
    w, (x, y, z) = e[0], e[1:]
    V = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * V + 2 * V @ V


def test_a_body_without_a_shape_is_drawn_to_its_markers() -> None:
    """The cylinder of its inertia about the centre of mass, a rod to the marker that is not on it."""
    rod, arm, pivot, gravity, arrow = drawn(hanging())
    at = look((0, 0, 0), (1, 0, 0, 0), **{"gravity.z": -9.81})
    ends = np.array([[values(x, at) for x in p] for p in rod["points"]])
    np.testing.assert_allclose(ends.mean(axis=0), 0, atol=1e-15)
    assert rod["radius"] == pytest.approx(np.sqrt(0.02))
    assert [values(x, at) for x in arm["points"][1]] == pytest.approx([-0.1, 0, 0.5])
    assert (pivot["of"], arrow["name"], gravity["name"]) == ("ball", "pin", "gravity")
    assert [values(x, at) for x in gravity["vector"]] == [0, 0, -9.81]


def test_a_joint_shows_its_kind_and_axis() -> None:
    """A hinge a pin along its axis, a slide a sleeve, a rod without mass a rod."""
    one = Body("one", 1.0, (0.1, 0.1, 0.1), shape=())
    two = Body("two", 1.0, (0.1, 0.1, 0.1), shape=())
    shapes = drawn(
        mechanism(
            "Kinds",
            bodies=[one, two],
            joints=[
                Revolute(
                    "hinge", ground.at((0, 0, 0), axis=(0, 3, 4)), one.at((0, 0, 0), axis=(0, 3, 4))
                ),
                Prismatic("slide", one.at((0, 0, 1)), two.at((0, 0, 0)), axis="x"),
                Distance("bar", ground.at((0, 0, 5)), two.at((0, 0, 0)), 4.0),
            ],
        )
    )
    pins = {s["of"]: s for s in shapes if s["kind"] == "pivot"}
    assert pins["pin"]["axis"] == [0.0, 0.6, 0.8]
    assert set(pins) == {"pin", "sleeve"}
    assert [s["kind"] for s in shapes].count("rod") == 1


def test_a_marker_that_is_read_shows_its_axes() -> None:
    """A frame at the marker whose z axis was laid onto (0, 3, 4): its origin and axes move with the body."""
    body = Body("bob", mass=1.0, inertia=(0.02, 0.02, 0.01), center=(0.1, 0, -0.5), shape=())
    tip = body.at((0, 0, -1), axis=(0, 3, 4))
    joint = Spherical("pin", ground.at((0, 0, 2)), body.at((0, 0, 0)))
    shapes = drawn(mechanism("Read", bodies=[body], joints=[joint], read={"tip": tip}))
    (frame,) = (s for s in shapes if s["kind"] == "frame")
    e = np.array([0.5, -0.5, 0.1, 0.7])
    at = look((1, 2, 3), e, **{"tip.z": -1.0})
    R = matrix(e)
    found = [[values(x, at) for x in axis] for axis in frame["axes"]]
    np.testing.assert_allclose(found[2], R @ [0, 0.6, 0.8], atol=1e-15)
    np.testing.assert_allclose(np.cross(found[0], found[1]), found[2], atol=1e-15)
    point = [values(x, at) for x in frame["at"]]
    np.testing.assert_allclose(point, [1, 2, 3] + R @ [-0.1, 0, -0.5], atol=1e-15)


def test_a_body_of_the_plane_may_have_a_shape(tmp_path: Path, opened: Opened) -> None:
    """A box that is turned with its body, a bar as thick as it says: both filled, in the page's own scale."""
    arm = Body(
        "arm", mass=1.0, inertia=0.1, shape=[Box((0, 0), (2, 0.5)), Rod((0, 0), (0, 1), 0.1)]
    )
    joint = Revolute("pin", ground.at((0, 0)), arm.at((-1, 0)))
    model = mechanism("Plane", plane="xy", bodies=[arm], joints=[joint], start={"angle.pin": 0.3})
    out = tmp_path / "plane.html"
    out.write_text(render(playable(prepare(model, Scene("Plane")))), encoding="utf-8")
    page = opened(out)
    page.until("lagfmu.runs")
    outlines = page.tab.locator("#picture .solid").all()
    box, bar = (corners(str(o.get_attribute("d"))) for o in outlines)
    sides = np.linalg.norm(box - np.roll(box, 1, axis=0), axis=1)
    scale = sides.max() / 2
    assert sorted(sides) == pytest.approx(scale * np.array([0.5, 0.5, 2, 2]), rel=1e-2)
    long = (box - np.roll(box, 1, axis=0))[np.argmax(sides)]
    assert abs(long[1] / long[0]) == pytest.approx(np.tan(0.3), rel=1e-2)
    thick = np.linalg.norm(bar - np.roll(bar, 1, axis=0), axis=1)
    assert sorted(thick) == pytest.approx(scale * np.array([0.2, 0.2, 1, 1]), rel=1e-2)


def corners(path: str) -> Any:
    """Of the first polygon of an SVG path [pixels]."""
    points = path.removeprefix("M").split("Z")[0].split()
    return np.array([[float(x) for x in p.split(",")] for p in points])


def test_a_shape_that_no_body_has_is_refused_by_name() -> None:
    """Of another kind, of another space, turned by what turns nothing: all at once."""
    wrong = [Pivot((0, 0, 0)), Disk((0, 0)), Box((0, 0, 0), (1, 1, 1), ((2, 0, 0),) * 3), "box"]
    with pytest.raises(ModelError) as caught:
        hanging(shape=wrong)
    told = str(caught.value)
    assert "has 4 problems" in told
    for part in ("Pivot(", "3 numbers", "turns nothing", "expected one of lagfmu.Box"):
        assert part in told, part


def test_a_box_in_a_model_is_turned_as_it_says() -> None:
    """By a matrix, by a quaternion or, in the plane, by an angle; anything else is refused."""
    angle = dynamicsymbols("phi")
    assert Box((0, 0), (1, 2), angle).axes[0] == (sp.cos(angle), sp.sin(angle))
    quarter = Box((0, 0, 0), (1, 1, 1), [sp.sqrt(2) / 2, 0, 0, sp.sqrt(2) / 2]).axes
    found = [[float(x.opened()) for x in axis] for axis in quarter]
    np.testing.assert_allclose(found, [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], atol=1e-15)
    with pytest.raises(ModelError, match="its rotation is"):
        hanging_with(Box((0, 0, 0), (1, 1, 1), 0.3))
    with pytest.raises(ModelError, match="its kind is 'knob', expected one of pin"):
        hanging_with(Pivot((0, 0, 0), (0, 0, 1), "knob"))


def hanging_with(shape: Any) -> Any:
    body = Body("bob", mass=1.0, inertia=(0.02, 0.02, 0.01))
    return mechanism("Free", bodies=[body], picture=[shape])


INERTIA = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
URDF = f"""<robot name="R">
<link name="base"><visual><geometry><box size="1 1 0.1"/></geometry></visual></link>
<link name="a"><inertial><mass value="1"/>{INERTIA}</inertial>
<visual><geometry><mesh filename="a.stl"/></geometry></visual>
<collision><origin xyz="0 0 0.5" rpy="0 1.5707963267948966 0"/>
<geometry><cylinder radius="0.1" length="2"/></geometry></collision></link>
<link name="tool"><visual><geometry><sphere radius="0.2"/></geometry></visual></link>
<joint name="j" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/></joint>
<joint name="t" type="fixed"><origin xyz="1 0 0"/><parent link="a"/><child link="tool"/></joint></robot>"""


def test_a_urdf_file_says_how_its_links_look(tmp_path: Path) -> None:
    """Primitives of <visual>, else of <collision>, with those of a frame that is fixed on the link; a mesh is
    left out, and counted."""
    path = tmp_path / "r.urdf"
    path.write_text(URDF)
    with pytest.warns(LagfmuWarning, match=r"'R': meshes \(1\) are left out"):
        parts = from_urdf(path)
    (base,) = parts.ground.shape
    assert base.size == (1.0, 1.0, 0.1)
    rod, ball = parts.bodies[0].shape
    np.testing.assert_allclose([rod.start, rod.end], [[-1, 0, 0.5], [1, 0, 0.5]], atol=1e-15)
    assert (rod.radius, ball.radius, ball.center) == (0.1, 0.2, (1.0, 0.0, 0.0))
    kinds = [s["kind"] for s in drawn(mechanism("R", bodies=parts.bodies, joints=parts.joints))]
    assert kinds == ["box", "rod", "disk", "pivot", "arrow"]


@pytest.mark.parametrize(
    "shape",
    [
        {"kind": "pivot", "of": "knob", "at": [0, 0, 0]},
        {"kind": "box", "center": [0, 0, 0], "size": [1, 1, 1]},
        {"kind": "disk", "center": [["attitude", 0, 3, "w", "x", "y", "z"], 0, 0]},
    ],
)
def test_a_forged_solid_is_refused(shape: dict[str, Any]) -> None:
    """Of a kind, with axes, of an element that there is."""
    with pytest.raises(BuildError, match="picture"):
        read_picture(picture_bytes({"dimensions": 3, "shapes": [shape]}))
