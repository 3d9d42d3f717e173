"""Rows of axes vanish at half a turn, too: a joint holds with its axes the same way, or is refused."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from lagfmu import simulate
from lagfmu.bodies import (
    Body,
    Cylindrical,
    Fixed,
    Gear,
    Gravity,
    Ground,
    Planar,
    Prismatic,
    Revolute,
    mechanism,
)
from lagfmu.errors import ModelError, SimulationError

ground = Ground()
MOMENTS = (0.02, 0.03, 0.04)
HELD = {Fixed: "xyz", Prismatic: "xyz", Revolute: "z", Cylindrical: "z", Planar: "z"}


def turned(rpy):
    """The matrix of roll, pitch and yaw."""
    (a, b, c), matrices = rpy, []
    for axis, angle in ((2, c), (1, b), (0, a)):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        R = np.eye(3)
        R[i, i] = R[j, j] = math.cos(angle)
        R[j, i], R[i, j] = math.sin(angle), -math.sin(angle)
        matrices.append(R)
    return matrices[0] @ matrices[1] @ matrices[2]


def rotation_of(run, name):
    """The attitude of a marker that is read, at the start."""
    return turned([run[f"{name}.rpy.{x}"][0] for x in ("roll", "pitch", "yaw")])


def test_a_chain_of_hinges_hangs_from_a_marker_that_is_nearly_upside_down():
    """The first axis points down (3.14161 rad from up): so do both bodies, and the tip lies below."""
    b1, b2 = (Body(n, 1.0, MOMENTS, center=(0.1, 0, 0.05)) for n in ("b1", "b2"))
    down = ground.at((0, 0, 0), rotation=("rpy", 3.14161, 0, 0))
    model = mechanism(
        "Reversed",
        bodies=[b1, b2],
        joints=[
            Revolute("j1", down, b1.at((0, 0, 0))),
            Revolute("j2", b1.at((0.2, 0, 0)), b2.at((0, 0, 0))),
        ],
        loads=[Gravity((0, 0, -9.81))],
        read={"tip": b2.at((0, 0, 0.05))},
    )
    assert simulate(model, stop_time=0.01)["tip.position.z"][0] == pytest.approx(-0.05, abs=1e-9)


@pytest.mark.parametrize(
    "kind",
    [Revolute, *(pytest.param(k, marks=pytest.mark.thorough) for k in HELD if k is not Revolute)],
)
def test_a_joint_at_half_a_turn_holds_its_axes_the_same_way(kind):
    """Whatever is left of half a turn, about each axis of either marker: z1 . z2 = 1, of a weld and a slide
    all axes, and the markers' frames are orthogonal."""
    joints, first, read = [], {}, {}
    for off in (0.0, 1e-15, -1e-9, 2e-6, 1e-3) if kind is not Revolute else (0.0, -1e-9, 1e-3):
        for axis, second in itertools.product(range(3), (False, True)):
            name, rpy = f"b{len(joints)}", [0.0, 0.0, 0.0]
            rpy[axis] = math.pi + off
            at = Body(name, 1.0, MOMENTS).at(
                (0.1, 0.2, 0.3), rotation=("rpy", *rpy) if second else None
            )
            frame = ground.at((0, 0, 0), rotation=None if second else ("rpy", *rpy))
            joints.append(kind(f"K{name}", frame, at))
            read[f"at{name}"] = at
            first[f"at{name}"] = np.eye(3) if second else turned(rpy)
    bodies = [j.second.body for j in joints]
    run = simulate(mechanism("Half", bodies=bodies, joints=joints, read=read), stop_time=1e-3)
    for name, R in first.items():
        product = R.T @ rotation_of(run, name)
        for x in HELD[kind]:
            assert product["xyz".index(x), "xyz".index(x)] == pytest.approx(1, abs=1e-9)


def test_an_axis_next_to_minus_z_is_that_axis():
    """The marker's z axis is the given direction to rounding, however near to -z: none is refused."""
    body, axes = Body("b", 1.0, MOMENTS), {}
    for k, off in enumerate((1e-15, 1e-12, 3e-8, 1e-6, 1e-4, 0.1)):
        for n, way in enumerate(np.linspace(0, 2 * math.pi, 6)[1:]):
            axes[f"at{k}{n}"] = np.array([off * math.cos(way), off * math.sin(way), -1.0])
    weld = Fixed("K", ground.at((0, 0, 0)), body.at((0, 0, 0)))
    read = {name: body.at((0, 0, 0), axis=tuple(axis)) for name, axis in axes.items()}
    run = simulate(mechanism("Axis", bodies=[body], joints=[weld], read=read), stop_time=1e-3)
    for name, axis in axes.items():
        found = rotation_of(run, name)[:, 2]
        assert found == pytest.approx(axis / np.linalg.norm(axis), abs=4e-15)


@pytest.mark.parametrize("times", [1, pytest.param(5, marks=pytest.mark.thorough)])
def test_a_loop_of_hinges_in_any_plane_closes_with_its_axes_the_same_way(times):
    """A four-bar linkage whose markers are turned at random closes with its axes one way."""
    draws = np.random.default_rng(5)
    for _ in range(times):
        W = turned(draws.uniform(-math.pi, math.pi, 3))
        points = [W @ p for p in np.array([[0, 0, 0], [0.1, 0.2, 0], [0.45, 0.35, 0], [0.5, 0, 0]])]
        bodies = [Body(f"b{k}", 1.0, MOMENTS) for k in range(3)]
        frames = [turned(draws.uniform(-math.pi, math.pi, 3)) for _ in bodies]
        middles = [(p + q) / 2 for p, q in itertools.pairwise(points)]
        own = [(ground, np.zeros(3), np.eye(3)), *zip(bodies, middles, frames, strict=True)]
        joints, read = [], {}
        for k, p in enumerate(points):
            sides = []
            for body, middle, R in (own[k], own[(k + 1) % 4]):
                about = W @ turned((0, 0, draws.uniform(-math.pi, math.pi)))
                sides.append(body.at(tuple(R.T @ (p - middle)), rotation=(R.T @ about).tolist()))
            joints.append(Revolute(f"j{k}", *sides))
            read |= {f"at{k}{side}": m for side, m in enumerate(sides) if m.body is not ground}
        model = mechanism("FourBar", bodies=bodies, joints=joints, read=read)
        with pytest.warns(UserWarning, match="follow"):
            run = simulate(model, stop_time=1e-3)
        for name in read:
            assert rotation_of(run, name)[:, 2] == pytest.approx(W[:, 2], abs=1e-9)


@pytest.mark.parametrize("target", ["native", "python"])
def test_an_importer_turns_no_hinge_over(built, target):
    """Half a turn about an axis across the hinge satisfies its rows, and is refused by the joint's name;
    half a turn about the hinge is a start like any other."""
    body = Body("b", 1.0, MOMENTS, center=(0.1, 0, 0))
    model = mechanism(
        "Hinge",
        bodies=[body],
        joints=[Revolute("pin", ground.at((0, 0, 0)), body.at((0, 0, 0)))],
        loads=[Gravity((0, -9.81, 0))],
    )

    fmu = built(model, target=target)

    def begun(**e):
        values = {f"b.orientation.{x}": e.get(x, 0.0) for x in "wxyz"}
        return simulate(fmu, stop_time=0.01, start_values=values)

    for axis in "xy":
        with pytest.raises(SimulationError, match="'pin' is turned over by half a turn"):
            begun(**{axis: 1.0})
    assert abs(begun(z=1.0)["angle.pin"][0]) == pytest.approx(math.pi)


def test_a_weld_that_is_given_upside_down_is_refused():
    """R = -1 satisfies its rows, too."""
    one = Body("one", 1.0, MOMENTS)
    weld, over = Fixed("weld", ground.at((0, 0, 0)), one.at((0, 0, 0))), (math.pi, 0, 0)
    with pytest.raises(ModelError, match="joint 'weld' begins turned over"):
        mechanism("Weld", bodies=[one], joints=[weld], start={"one.rpy": over})


def test_a_hinge_behind_a_gear_is_led_back_and_told():
    """A body that is given upside down goes back to where its hinge points up, with both numbers; the body
    behind the gear, which nobody gave, is not turned over either."""
    one, two = Body("one", 1.0, MOMENTS), Body("two", 1.0, MOMENTS)
    a = Revolute("A", ground.at((0, 0, 0)), one.at((0, 0, 0)))
    b = Revolute("B", ground.at((0.1, 0, 0)), two.at((0, 0, 0)))
    with pytest.warns(
        UserWarning, match=r"one.orientation.x = 1.0, .* one.orientation.x = 0 instead"
    ):
        model = mechanism(
            "Geared",
            bodies=[one, two],
            joints=[a, b, Gear("G", a, b, -1.0)],
            loads=[],
            start={"one.rpy": (math.pi, 0, 0)},
        )
    run = simulate(model, stop_time=1e-3)
    for body in ("one", "two"):
        x, y = (run[f"{body}.orientation.{k}"][0] for k in "xy")
        assert 1 - 2 * (x**2 + y**2) == pytest.approx(1)
