"""A rough place for each body: from the ground along the joints, each as far as it determines a place.

A body whose attitude no joint determines starts parallel to the ground; a hinge turns it, by the least
rotation, until the axes agree.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import sympy as sp

from ..model.elements import name_of
from ..model.model import Model
from .body import Ground, Marker, onto, quaternion, rotation_of, turn, turned_by
from .draft import Draft
from .rows import Array, numbers_of


class Pose:
    """A frame: the matrix of its axes, its origin [m], and in the plane its angle over many turns [rad]."""

    def __init__(self, axes: Array, origin: Array, angle: float = 0.0) -> None:
        self.axes, self.origin, self.angle = axes, origin, angle

    def then(self, other: Pose) -> Pose:
        """A frame that is given in this one."""
        origin = self.origin + self.axes @ other.origin
        return Pose(self.axes @ other.axes, origin, self.angle + other.angle)

    def back(self) -> Pose:
        """The frame in which this one is the ground."""
        return Pose(self.axes.T, -self.axes.T @ self.origin, -self.angle)


STILL = Pose(np.eye(3), np.zeros(3))


class Guess:
    """The places of bodies; `given` by the names of the FMU."""

    def __init__(self, draft: Draft, model: Model, given: Mapping[str, float]) -> None:
        self.draft, self.model, self.given = draft, model, given
        self.planar = len(draft.components) == 2
        self.local = self._markers()
        self.known: dict[Any, Pose] = {Ground(): STILL}

    def poses(self, ties: Sequence[Any]) -> dict[Any, Pose]:
        """Each body, the ground among them."""
        bodies = [b for b in self.draft.motions if b not in self.known]
        while len(self.known) <= len(bodies):
            open_ties = (
                t for t in ties if (t.first.body in self.known) != (t.second.body in self.known)
            )
            tie = next(open_ties, None)
            placed = next((b for b in bodies if b not in self.known and self._is_given(b)), None)
            if tie is None or (placed is not None and _leaves_place_to(placed, tie)):
                body = placed or next(b for b in bodies if b not in self.known)
                self.known[body] = self._put(body, self._attitude(body) or STILL)
            else:
                self._follow(tie)
        return self.known

    def _follow(self, tie: Any) -> None:
        """The body at the free end of a tie."""
        forward = tie.first.body in self.known
        base, free = (tie.first, tie.second) if forward else (tie.second, tie.first)
        at = self.known[base.body].then(self.local[base])
        relative = tie.relative_pose(self)
        given = self._attitude(free.body)
        if given is None and relative.determined:
            step = relative.pose if forward else relative.pose.back()
            pose = at.then(step).then(self.local[free].back())
        else:
            pose = given or STILL
            if relative.axis is not None:
                pose = Pose(
                    onto(
                        pose.axes @ self.local[free].axes[:, relative.axis],
                        at.axes[:, relative.axis],
                    )
                    @ pose.axes,
                    pose.origin,
                    pose.angle,
                )
            frame = Pose(pose.axes, np.zeros(3), pose.angle).then(self.local[free])
            reach = (
                at.axes @ relative.pose.origin if forward else -frame.axes @ relative.pose.origin
            )
            pose = Pose(pose.axes, at.origin + reach - frame.origin, pose.angle)
        self.known[free.body] = self._put(free.body, pose)

    def nearest(self, curved: Any) -> float:
        """The value of a curve's parameter at which it is nearest to where the second marker is."""
        first, second = (
            self.known[m.body].then(self.local[m]) for m in (curved.first, curved.second)
        )
        values, points = curved.tried(self)
        away = points - first.axes.T @ (second.origin - first.origin)
        return float(values[np.argmin(np.linalg.norm(away, axis=1))])

    def _put(self, body: Any, pose: Pose) -> Pose:
        """With the components of the position that are given."""
        names = [f"{body.name}.position.{x}" for x in "xyz"]
        origin = [self.given.get(n, x) for n, x in zip(names, pose.origin.tolist(), strict=True)]
        return Pose(pose.axes, np.array(origin), pose.angle)

    def _is_given(self, body: Any) -> bool:
        names = [f"{body.name}.position.{x}" for x in self.draft.components]
        return all(n in self.given for n in names)

    def _attitude(self, body: Any) -> Pose | None:
        """The attitude of a body, if any of it is given."""
        names = [f"{body.name}.orientation.{x}" for x in "wxyz"]
        values = [self.given.get(n) for n in names]
        if self.planar and values[3] is not None:
            return Pose(turn(2, values[3]), np.zeros(3), values[3])
        if self.planar or all(x is None for x in values):
            return None
        return Pose(turned_by(np.array([x or 0.0 for x in values])), np.zeros(3))

    def _markers(self) -> dict[Marker, Pose]:
        """Each marker in its body, from the centre of mass."""
        upright = {q: float(str(q.func).endswith("orientation.w")) for q in self.model.coordinates}
        placed = self.draft.placed
        parts = [x for p in placed.values() for x in (*p.point, p.angle)]
        found = numbers_of(self.model, [sp.sympify(x).xreplace(upright) for x in parts])
        poses = {}
        for m, (x, y, z, angle) in zip(placed, found.reshape(-1, 4).tolist(), strict=True):
            axes = turn(2, angle) if self.planar else np.array(rotation_of(m), dtype=float)
            poses[m] = Pose(axes, np.array([x, y, z]), angle)
        return poses


def _leaves_place_to(body: Any, tie: Any) -> bool:
    """Whether a tie to others says less of where things are than the place that `body` is given: it holds
    its marker to a surface, a curve or a distance."""
    loose = getattr(tie, "slides", "across") == "across"
    return loose and body not in (tie.first.body, tie.second.body)


class Reach:
    """Where a tie holds its second marker in the first: its origin, its attitude if that is determined, else
    the axis about which it turns, if there is one."""

    def __init__(
        self,
        reach: Sequence[float],
        angle: float | None = None,
        axis: int | None = None,
        determined: bool = False,
    ) -> None:
        self.axis, self.determined = axis, determined
        about = 2 if axis is None else axis
        self.pose = Pose(turn(about, angle or 0.0), np.array(reach, dtype=float), angle or 0.0)


def guessed(draft: Draft, model: Model, ties: Sequence[Any], given: Mapping[str, float]) -> Array:
    """The coordinates of the bodies, in the order of the model, then those of points on curves; angles that
    go on over turns follow at 0."""
    guess = Guess(draft, model, given)
    found = guess.poses([t for t in ties if hasattr(t, "relative_pose")])
    values: list[float] = []
    for body in draft.motions:
        if isinstance(body, Ground):
            continue
        pose = found[body]
        if len(draft.components) == 2:
            values += [*pose.origin[:2].tolist(), pose.angle]
        else:
            values += [*pose.origin.tolist(), *quaternion(pose.axes).tolist()]
    curved = {f"{t.name}.curve.s": t for t in ties if hasattr(t, "tried")}
    for name in map(name_of, draft.curves):
        value = guess.nearest(curved[name]) if name in curved else 0.0
        values.append(given.get(name, value))
    return np.array([*values, *([0.0] * (len(model.coordinates) - len(values)))])
