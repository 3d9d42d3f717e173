"""Bodies and joints from a URDF file, read by yourdfpy.

A link is a body whose own frame is that of the link, so that the FMU's points and inertias are those of the
file; a joint of the file keeps its name, and what it drives turns about the z axis of a marker that is laid
along the file's axis.  Links that are fixed to another are one body with it.  The root link is the ground, or
with base='floating' a body.

The model that a URDF file is by itself: all of it, in gravity, with motors where they are asked for.
"""

from __future__ import annotations

import os
import warnings
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import LagfmuWarning, ModelError
from ..files import foreign
from ..model.model import Model
from ..model.picture import Box, Rod, Shape, Sphere
from . import markup
from .body import Body, Ground, Marker, onto, quaternion
from .check_files import (
    left_out,
    needed,
    number_of_dynamics,
    problems_of_parts,
    problems_of_text,
    problems_of_tree,
)
from .joints import Fixed, Gear, Joint, Planar, Prismatic, Revolute, Spherical
from .loads import Gravity, Torsion
from .markup import chosen, components, motors, together, words_of
from .mechanism import mechanism

KINDS: dict[str, Any] = {
    "revolute": Revolute,
    "continuous": Revolute,
    "prismatic": Prismatic,
    "fixed": Fixed,
    "planar": Planar,
    "floating": None,  # leaves its child free
    "spherical": Spherical,  # of Bullet
}
WITHOUT_AXIS = ("fixed", "spherical")
BASES = ("fixed", "floating")
ROUNDING = 1e-15  # of the largest inertia of a file: what programs leave of one that is 0
UP = np.array([0.0, 0.0, 1.0])
Pose = NDArray[np.float64]  # (4, 4) homogeneous


@dataclass(frozen=True)
class Parts:
    """What a URDF file holds: pass it on to `mechanism`, with loads and motors of your own beside it.

    `joints` hold a gear for each <mimic>; `loads` are the dampers.  `frames` names the links that are fixed
    to another: each is a marker.  `start` puts every joint at 0, or in the middle of limits that leave 0 out;
    `description` tells of other names than those of the file, and of what was left out.
    """

    name: str
    ground: Ground
    bodies: tuple[Body, ...]
    joints: tuple[Joint | Gear, ...]
    loads: tuple[Torsion, ...]
    frames: dict[str, Marker]
    start: dict[str, Any]
    description: str


def from_urdf(
    file: str | os.PathLike[str],
    limits: bool = True,
    base: str = "fixed",
    fold_fixed: bool = True,
) -> Parts:
    """The bodies and joints of a URDF file; without `limits` its joints do not stop where it says so.

    With base='floating' the root link moves freely.  Without `fold_fixed` each link that is fixed to another,
    and has mass and inertia, is a body, so that the wrench between them is told.

    Raises ModelError with every problem at once: what is no number, links that move and carry no mass,
    joints of a kind that there is not, links with two parents or none, names that become one.
    """
    if base not in BASES:
        raise ModelError(Path(file).name, [f"base is {base!r}, expected 'fixed' or 'floating'"])
    robot, left = _read(Path(file))
    problems = [*problems_of_tree(robot), *problems_of_parts(robot, KINDS, limits)]
    if problems:
        raise ModelError(str(robot.name), problems)
    builder = _Builder(robot, limits, base == "floating", fold_fixed)
    if builder.problems:
        raise ModelError(str(robot.name), builder.problems)
    if left:
        warnings.warn(f"{robot.name!r}: {left}", LagfmuWarning, stacklevel=2)
    return builder.parts(left)


def _read(path: Path) -> tuple[Any, str]:
    """What yourdfpy makes of it, and in words what it has and a mechanism has not."""
    try:
        from yourdfpy import URDF
    except ImportError:
        raise ModelError(path.name, ["reading URDF needs yourdfpy: pip install yourdfpy"]) from None
    root, problem = markup.read(path)
    if root is None:
        raise ModelError(path.name, [problem])
    if problems := problems_of_text(path.name, root):
        raise ModelError(path.name, problems)
    left = left_out(root)
    with foreign(
        lambda said: ModelError(
            path.name, [f"{str(path)!r} is no URDF file that yourdfpy reads: {said}: correct it"]
        )
    ):
        file = BytesIO(needed(root))
        return URDF.load(file, build_scene_graph=False, load_meshes=False).robot, left


def _root(robot: Any) -> str:
    children = {joint.child for joint in robot.joints}
    return next(str(link.name) for link in robot.links if link.name not in children)


def _mass(link: Any) -> float:
    return float(link.inertial.mass or 0.0) if link.inertial is not None else 0.0


def _tensor(link: Any) -> Pose:
    """The inertia about the centre of mass (3, 3), in the link's axes."""
    if link.inertial is None or link.inertial.inertia is None:
        return np.zeros((3, 3))
    R = _pose(link.inertial.origin)[:3, :3]
    found: Pose = R @ np.array(link.inertial.inertia, dtype=float) @ R.T
    return found


class _Builder:
    """Links in the order in which the tree reaches them; a link's carrier is the body that it is part of."""

    def __init__(self, robot: Any, limits: bool, floating: bool, fold: bool) -> None:
        self.robot, self.limits, self.floating, self.fold = robot, limits, floating, fold
        self.links = {link.name: link for link in robot.links}
        self.root = _root(robot)
        self.joints = list(_along_tree(robot, self.root))
        self.carrier: dict[str, tuple[str, Pose]] = {self.root: (self.root, np.eye(4))}
        self.place = {self.root: np.eye(4)}  # in the ground, every joint at 0
        for j in self.joints:
            own = j.type != "fixed" or self._stays_alone(self.links[j.child])
            on, pose = self.carrier[j.parent]
            there = np.eye(4) if own else pose @ _pose(j.origin)
            self.carrier[j.child] = (j.child if own else on), there
            self.place[j.child] = self.place[j.parent] @ _pose(j.origin)
        self.own = [n for n, (on, _) in self.carrier.items() if n == on]
        self.words, self.problems = words_of(
            [n for n in self.own if n != self.root or floating],
            [j.name for j in self.joints if self._moves(j)],
        )
        self.bodies = self._bodies()

    def _stays_alone(self, link: Any) -> bool:
        return not self.fold and _mass(link) > 0 and bool((np.diag(_tensor(link)) > 0).all())

    def _moves(self, joint: Any) -> bool:
        return KINDS[joint.type] is not None and self.carrier[joint.child][0] == joint.child

    def _bodies(self) -> dict[str, Body | Ground]:
        """Of each link that is its own carrier, with what is fixed to it."""
        found: dict[str, Body | Ground] = {}
        largest = max(np.abs(_tensor(link)).max() for link in self.robot.links)
        for name in self.own:
            parts = [(self.links[n], pose) for n, (on, pose) in self.carrier.items() if on == name]
            shapes = [shape for link, pose in parts for shape in _shapes(link, pose)] or None
            if name == self.root and not self.floating:
                found[name] = Ground(shape=shapes)
                continue
            mass, center, J = together([*_inertias(parts)])
            if np.abs(J).max() <= ROUNDING * largest:
                J = np.zeros((3, 3))
            word = self.words.links.get(name, name)
            told = f"link {name!r} of the file" if word != name else ""
            found[name] = Body(
                word, mass, components(J), tuple(map(float, center)), description=told, shape=shapes
            )
        self._check_idle(found)
        return found

    def _check_idle(self, bodies: dict[str, Body | Ground]) -> None:
        """Links that move though neither they nor those that they carry have a mass; what follows another
        joint, or is followed, is held by that."""
        heavy = {n for n, b in bodies.items() if isinstance(b, Body) and (b.mass or any(b.inertia))}
        mimics = [j for j in self.joints if j.mimic is not None]
        tied = {n for j in mimics for n in (j.name, j.mimic.joint)}
        moves = {j.child: j for j in self.joints}
        for j in reversed(self.joints):
            if self.carrier[j.child][0] in heavy:
                heavy.add(self.carrier[j.parent][0])
        for name in (n for n, b in bodies.items() if isinstance(b, Body) and n not in heavy):
            if name in moves and moves[name].name in tied:
                continue
            self.problems.append(
                f"link {name!r} moves and has no mass, nor does it carry one: give it an <inertial> with "
                "mass and inertia, or a fixed joint to a link that has one"
                + ("; or leave base='floating' out" if name == self.root else "")
            )

    def parts(self, left: str) -> Parts:
        """The whole of it."""
        joints: list[Joint | Gear] = []
        loads: list[Torsion] = []
        start: dict[str, Any] = {}
        if self.floating:
            start |= self._free(self.root)
        for j in self.joints:
            if j.type == "floating":
                start |= self._free(j.child)
            if not self._moves(j):
                continue
            joints.append(self._joint(j))
            if (damping := number_of_dynamics(j, "damping")) and self._rubs(j):
                name = self.words.joints[j.name]
                loads.append(Torsion(f"{name}_damper", name, damping=damping))
        moving = [j for j in self.joints if self._moves(j) and j.type not in WITHOUT_AXIS]
        for j in moving:
            start[self._measure(j)] = self._start(j)
        gears = [j for j in moving if j.mimic is not None]
        for j in gears:
            of = self.words.joints[j.mimic.joint]
            name = self.words.joints[j.name]
            ratio, offset = (float(x) for x in (j.mimic.multiplier, j.mimic.offset))
            joints.append(Gear(f"{name}_mimic", name, of, ratio, offset))
        return Parts(
            self.words.name(str(self.robot.name)),
            next((b for b in self.bodies.values() if isinstance(b, Ground)), Ground()),
            tuple(b for b in self.bodies.values() if isinstance(b, Body)),
            tuple(joints),
            tuple(loads),
            {
                n: _marker(self.bodies[on], pose)
                for n, (on, pose) in self.carrier.items()
                if n != on
            },
            start,
            "; ".join([*self.words.told(), *([left] if left else []), *self._efforts()]),
        )

    def _rubs(self, joint: Any) -> bool:
        return joint.type in ("revolute", "continuous", "prismatic")

    def _measure(self, joint: Any) -> str:
        kind = "position" if joint.type == "prismatic" else "angle"
        return f"{kind}.{self.words.joints[joint.name]}"

    def _free(self, link: str) -> dict[str, Any]:
        """Where a body that nothing holds begins."""
        body, place = self.bodies[link], self.place[link]
        assert isinstance(body, Body)
        at = place[:3, 3] + place[:3, :3] @ np.array(body.center, dtype=float)
        return {
            f"{body.name}.position": tuple(map(float, at)),
            f"{body.name}.orientation": tuple(map(float, quaternion(place[:3, :3]))),
        }

    def _stops(self, joint: Any) -> tuple[float, float] | None:
        """Its limits; those of a joint that follows another are those of the other."""
        limited = self.limits and joint.limit is not None and joint.mimic is None
        if not limited or joint.type not in ("revolute", "prismatic"):
            return None
        lower, upper = joint.limit.lower or 0.0, joint.limit.upper or 0.0
        return (float(lower), float(upper)) if lower < upper else None

    def _start(self, joint: Any) -> float:
        if joint.mimic is not None:
            by_name = {j.name: j for j in self.joints}
            other = self._start(by_name[joint.mimic.joint])
            return float(joint.mimic.multiplier) * other + float(joint.mimic.offset)
        stops = self._stops(joint)
        return 0.0 if stops is None or stops[0] <= 0 <= stops[1] else sum(stops) / 2

    def _joint(self, joint: Any) -> Joint:
        on, pose = self.carrier[joint.parent]
        pose = pose @ _pose(joint.origin)
        turned = np.eye(4)
        if joint.type not in WITHOUT_AXIS:
            axis = (1.0, 0.0, 0.0) if joint.axis is None else joint.axis
            turned[:3, :3] = onto(UP, np.array(axis, dtype=float) / np.linalg.norm(axis))
        first = _marker(self.bodies[on], pose @ turned)
        second = _marker(self.bodies[joint.child], turned)
        friction = number_of_dynamics(joint, "friction") if self._rubs(joint) else 0.0
        kind, word = KINDS[joint.type], "force" if joint.type == "prismatic" else "torque"
        rubs = {f"friction_{word}": friction} if friction else {}
        axis_of_marker = "" if joint.type in WITHOUT_AXIS else "z"
        name = self.words.joints[joint.name]
        made: Joint = kind(name, first, second, axis_of_marker, self._stops(joint), **rubs)
        return made

    def _efforts(self) -> list[str]:
        """The limits that nothing enforces."""
        units = {"prismatic": ("N", "m/s")}
        told = []
        for j in self.joints:
            if self._moves(j) and j.limit is not None:
                of = units.get(j.type, ("N.m", "rad/s"))
                values = (j.limit.effort, j.limit.velocity)
                told += [
                    f"{self.words.joints[j.name]} {float(x):g} {unit}"
                    for x, unit in zip(values, of, strict=True)
                    if x
                ]
        return [f"limits that nothing enforces: {', '.join(told)}"] if told else []


def _along_tree(robot: Any, root: str) -> Iterator[Any]:
    """The joints in the order of the file, but each behind that of its parent."""
    of: dict[str, list[int]] = defaultdict(list)
    for k, joint in enumerate(robot.joints):
        of[joint.parent].append(k)
    waiting = of[root]
    while waiting:
        joint = robot.joints[heappop(waiting)]
        yield joint
        for k in of[joint.child]:
            heappush(waiting, k)


def _inertias(parts: list[tuple[Any, Pose]]) -> Iterator[tuple[float, Pose, Pose]]:
    """Mass [kg], centre [m] and inertia about it (3, 3) of links at poses, in one frame."""
    for link, pose in parts:
        if link.inertial is not None:
            R, own = pose[:3, :3], _pose(link.inertial.origin)[:3, 3]
            yield _mass(link), pose[:3, 3] + R @ own, R @ _tensor(link) @ R.T


def _pose(origin: Any) -> Pose:
    return np.eye(4) if origin is None else np.array(origin, dtype=float)


def _drawn(link: Any) -> list[Any]:
    """The elements by which a link is drawn: <visual>, or <collision> if none of those can be."""
    found = [[e for e in es if e.geometry.mesh is None] for es in (link.visuals, link.collisions)]
    return found[0] or found[1]


def _shapes(link: Any, pose: Pose) -> Iterator[Shape]:
    """Boxes, cylinders (along z) and spheres of a link, at a pose."""
    for element in _drawn(link):
        there = pose @ _pose(element.origin)
        R, center, geometry = there[:3, :3], there[:3, 3], element.geometry
        if geometry.box is not None:
            yield Box(tuple(center.tolist()), tuple(map(float, geometry.box.size)), R.tolist())
        elif geometry.cylinder is not None:
            half = R[:, 2] * float(geometry.cylinder.length) / 2
            low, high = (tuple((center + sign * half).tolist()) for sign in (-1, 1))
            yield Rod(low, high, float(geometry.cylinder.radius))
        elif geometry.sphere is not None:
            yield Sphere(tuple(center.tolist()), float(geometry.sphere.radius))


def _marker(carrier: Body | Ground, pose: Pose) -> Marker:
    rotation = None if np.array_equal(pose[:3, :3], np.eye(3)) else pose[:3, :3].tolist()
    return carrier.at(tuple(map(float, pose[:3, 3])), rotation=rotation)


GRAVITY = (0, 0, -9.81)  # m/s^2
CHOICES = {"base": BASES, "motors": ("none", "torque", "motion"), "limits": ("true", "false")}
# The Python file that says the same.
PYTHON = '''"""The robot of {file}.  Add motors, contacts and closed loops of your own, then:

    lagfmu simulate {own} --plot out.svg
"""

from pathlib import Path

from lagfmu import Scene
from lagfmu.bodies import Gravity, from_urdf, mechanism

robot = from_urdf(Path(__file__).parent / {path!r})
model = mechanism(
    robot.name,
    bodies=robot.bodies,
    joints=[*robot.joints],
    loads=[Gravity((0, 0, -9.81)), *robot.loads],
    start={{**robot.start}},  # e.g. "angle.j2": 0.5
    description=robot.description,
)
scenes = [Scene(model.name, stop_time=1.0, step_size=0.01)]
'''


def read(path: Path, arguments: Sequence[str] = ()) -> Model:
    """The model of a URDF file; `arguments` are texts base=floating, motors=torque or motion, limits=false,
    and starts by names of the FMU, angle.j2=0.5.

    With motors=torque each joint that follows no other has the input J_motor.torque (J_motor.force), with
    motors=motion J_motor.angle (J_motor.position).  Raises RequestError for arguments, ModelError.
    """
    asked, given = chosen(path, arguments, CHOICES)
    parts = from_urdf(path, limits=asked["limits"] == "true", base=asked["base"])
    if not parts.bodies:
        raise ModelError(
            parts.name, ["nothing in the file moves: give it a joint, or base=floating"]
        )
    start = {**parts.start, **given}
    return mechanism(
        parts.name,
        bodies=parts.bodies,
        joints=parts.joints,
        loads=[Gravity(GRAVITY), *parts.loads, *motors(parts.joints, asked["motors"], start)],
        start=start,
        description=f"{path.name}{f': {parts.description}' if parts.description else ''}",
    )
