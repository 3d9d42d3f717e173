"""Bodies and joints from a URDF file, read by yourdfpy.

A link is a body whose own frame is that of the link, so that the FMU's points and inertias are those of the
file; a joint of the file keeps its name, and what it drives turns about the z axis of a marker that is laid
along the file's axis.  The root link is the ground.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import LagfmuWarning, ModelError
from ..model.picture import Box, Rod, Shape, Sphere
from .body import Body, Ground, Marker
from .check_urdf import number_of_dynamics, problems_of_parts, problems_of_text, problems_of_tree
from .joints import Fixed, Joint, Prismatic, Revolute
from .loads import Torsion
from .rotation import onto

KINDS = {"revolute": Revolute, "continuous": Revolute, "prismatic": Prismatic, "fixed": Fixed}
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # xx, yy, zz, xy, xz, yz
UP = np.array([0.0, 0.0, 1.0])
Pose = NDArray[np.float64]  # (4, 4) homogeneous


@dataclass(frozen=True)
class Parts:
    """What a URDF file holds: pass it on to `mechanism`, with loads and motors of your own beside it.

    `loads` are the dampers of its joints; `frames` names the links without mass that are fixed to another:
    each is a marker, not a body.  Bodies and ground look as the file says, by boxes, cylinders and spheres.
    """

    name: str
    ground: Ground
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    loads: tuple[Torsion, ...]
    frames: dict[str, Marker]


def from_urdf(file: str | os.PathLike[str], limits: bool = True) -> Parts:
    """The bodies and joints of a URDF file; without `limits` its joints do not stop where it says so.

    Raises ModelError with every problem at once: what is no number, links without inertia that move, mimic
    joints, joints of a kind that there is not, links with two parents or none, friction in a joint.
    """
    robot = _read(Path(file))
    problems = [*problems_of_tree(robot), *problems_of_parts(robot, KINDS)]
    if problems:
        raise ModelError(str(robot.name), problems)
    _tell_of_meshes(robot)
    return _Builder(robot, limits).parts()


def _read(path: Path) -> Any:
    try:
        from yourdfpy import URDF
    except ImportError:
        raise ModelError(path.name, ["reading URDF needs yourdfpy: pip install yourdfpy"]) from None
    try:
        content = path.read_bytes()
    except OSError as error:
        problem = f"{str(path)!r} cannot be read ({error.strerror or error}): correct the path"
        raise ModelError(path.name, [problem]) from None
    if problems := problems_of_text(content):
        raise ModelError(path.name, problems)
    try:
        return URDF.load(BytesIO(content), build_scene_graph=False, load_meshes=False).robot
    except Exception as error:  # of what lagfmu does not need: a colour, a calibration
        problem = f"{str(path)!r} is no URDF file that can be read: {str(error).splitlines()[0]}"
        raise ModelError(path.name, [problem]) from None


def _root(robot: Any) -> str:
    children = {joint.child for joint in robot.joints}
    return next(str(link.name) for link in robot.links if link.name not in children)


def _mass(link: Any) -> float:
    return float(link.inertial.mass) if link.inertial is not None else 0.0


class _Builder:
    """Links in the order in which the tree reaches them."""

    def __init__(self, robot: Any, limits: bool) -> None:
        self.robot, self.limits = robot, limits
        self.links = {link.name: link for link in robot.links}
        self.shapes = self._shapes()
        self.ground = Ground(shape=self.shapes[_root(robot)] or None)
        self.carrier: dict[str, tuple[Body | Ground, Pose]] = {}  # of each link's frame
        self.bodies: list[Body] = []
        self.joints: list[Joint] = []
        self.loads: list[Torsion] = []
        self.frames: dict[str, Marker] = {}

    def parts(self) -> Parts:
        """The whole of it."""
        self.carrier[_root(self.robot)] = self.ground, np.eye(4)
        waiting = list(self.robot.joints)
        while waiting:
            joint = next(j for j in waiting if j.parent in self.carrier)
            waiting.remove(joint)
            self._add(joint)
        return Parts(
            str(self.robot.name),
            self.ground,
            tuple(self.bodies),
            tuple(self.joints),
            tuple(self.loads),
            self.frames,
        )

    def _shapes(self) -> dict[str, list[Shape]]:
        """What each link looks like, with the links that are markers on it."""
        found: dict[str, list[Shape]] = {}
        for name, link in self.links.items():
            pose = np.eye(4)
            while (joint := self._marker_joint(link)) is not None:
                pose = _pose(joint.origin) @ pose
                link = self.links[joint.parent]
            found.setdefault(link.name, []).extend(_shapes(self.links[name], pose))
        return found

    def _marker_joint(self, link: Any) -> Any:
        """The fixed joint that makes a link without mass a marker on another."""
        to = (j for j in self.robot.joints if j.child == link.name and j.type == "fixed")
        return None if _mass(link) else next(to, None)

    def _add(self, joint: Any) -> None:
        carrier, pose = self.carrier[joint.parent]
        pose = pose @ _pose(joint.origin)
        link = self.links[joint.child]
        if self._marker_joint(link) is not None:
            self.carrier[link.name] = carrier, pose
            self.frames[link.name] = _marker(carrier, pose)
            return
        body = _body(link, self.shapes[link.name])
        self.bodies.append(body)
        self.carrier[link.name] = body, np.eye(4)
        turned = np.eye(4)
        if joint.type != "fixed":
            axis = (1.0, 0.0, 0.0) if joint.axis is None else joint.axis
            turned[:3, :3] = onto(UP, np.array(axis, dtype=float) / np.linalg.norm(axis))
        kind = KINDS[joint.type]
        stops = joint.limit if self.limits and joint.type in ("revolute", "prismatic") else None
        limits = None if stops is None else (stops.lower or 0.0, stops.upper or 0.0)
        first, second = _marker(carrier, pose @ turned), _marker(body, turned)
        axis_of_marker = "" if joint.type == "fixed" else "z"
        self.joints.append(kind(joint.name, first, second, axis_of_marker, limits))
        if damping := number_of_dynamics(joint, "damping"):
            self.loads.append(Torsion(f"{joint.name}_damper", joint.name, damping=damping))


def _body(link: Any, shapes: list[Shape]) -> Body:
    """The link's mass, centre and inertia, which the file gives in axes of their own, in the link's frame."""
    origin = _pose(link.inertial.origin)
    R = origin[:3, :3]
    J = R @ np.array(link.inertial.inertia, dtype=float) @ R.T
    inertia = tuple(float(J[pair]) for pair in PAIRS)
    center = tuple(map(float, origin[:3, 3]))
    return Body(link.name, _mass(link), inertia, center=center, shape=shapes or None)


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


def _tell_of_meshes(robot: Any) -> None:
    """A mesh is not read, and that is no reason to refuse the file."""
    left = [
        f"{element.geometry.mesh.filename!r} of link {link.name!r}"
        for link in robot.links
        for element in link.visuals
        if element.geometry.mesh is not None
    ]
    if left:
        warnings.warn(
            f"{robot.name!r}: meshes are left out of the picture, {', '.join(left)}: a link without box, "
            "cylinder or sphere in the file is drawn by its mass and inertia",
            LagfmuWarning,
            stacklevel=3,
        )


def _marker(carrier: Body | Ground, pose: Pose) -> Marker:
    rotation = None if np.array_equal(pose[:3, :3], np.eye(3)) else pose[:3, :3].tolist()
    return carrier.at(tuple(map(float, pose[:3, 3])), rotation=rotation)
