"""Several slides and hinges between two bodies, with nothing that has mass between them.

In the axes of the first marker R = R_i(a) R_j(b) R_k(c), and with the axes i of the first marker and k of the
second (u and w along the ground's axes, s = u . w, and e the sign of the permutation i, j, k)

    w_rel = a' u + b' n + c' w ,     n = e w x u / |w x u| ,
    a' = (u - s w) . w_rel / (1 - s^2) ,   b' = n . w_rel ,   c' = (w - s u) . w_rel / (1 - s^2) .

Two hinges are square to each other, and the third direction is held.  A torque along what multiplies w_rel
works on its angle alone.  At s^2 = 1 the first and the last axis are one: three angles do not tell the
attitude there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import sympy as sp

from ..model.elements import Expr
from ..model.reactions import multiplier
from .body import Number, turn
from .draft import Draft, Relative, Wrench
from .guess import Guess, Pose, Reach
from .joints import CROSS, Joint, model_number
from .motion import (
    AXES,
    ZERO,
    Placed,
    Timed,
    TimedVector,
    Vector,
    between,
    cross,
    dot,
    minus,
    plus,
    product,
    times,
)


@dataclass(frozen=True, eq=False)
class Series(Joint):
    """The second marker slides along the axes `sliding` of the first, then turns about the axes `turning`,
    each square to the others and carried on by those before it (in space).

    `names` are those of these motions, in that order: angle.NAME, position.NAME; `stops` their limits.  The
    second of two hinges may be `apart` from the first, along the cross product n of their axes [m].
    """

    sliding: str = ""
    turning: str = ""
    names: Sequence[str] = ()
    stops: Mapping[str, Sequence[Number]] = field(default_factory=dict)

    apart: Number = 0.0

    possible: ClassVar[tuple[str, str]] = ("", "xyz")

    @property
    def measures(self) -> list[str]:
        """position.NAME and angle.NAME."""
        kinds = ["position"] * len(self.sliding) + ["angle"] * len(self.turning)
        return [f"{kind}.{name}" for kind, name in zip(kinds, self.names, strict=True)]

    def relative_pose(self, guess: Guess) -> Reach:
        """Where the given angles and positions put it, the others at 0."""
        given = [guess.given.get(m, 0.0) for m in self.measures]
        origin, axes = np.zeros(3), np.eye(3)
        for x, value in zip(self.sliding, given, strict=False):
            origin[AXES.index(x)] += value
        for x, value in zip(self.turning, given[len(self.sliding) :], strict=True):
            axes = axes @ turn(AXES.index(x), value)
            if x == self.turning[0] and len(self.turning) == 2:
                i, j = map(AXES.index, self.turning)
                arm = model_number(guess.model, self.apart)
                origin += arm * axes @ np.cross(np.eye(3)[i], np.eye(3)[j])
        reach = Reach((0, 0, 0), determined=True)
        reach.pose = Pose(axes, origin)
        return reach

    def rows(self, draft: Draft, a: Placed, b: Placed, axis: int, wrench: Wrench) -> None:
        """A row for each motion that it holds back."""
        away = self._away(draft, a, b)
        for k, x in enumerate(AXES):
            if x not in self.sliding:
                text = f"{self.name} does not move along {x} of its first marker"
                draft.hold(f"{self.name}.{x}", product(a.axes[k], away), text)
                wrench.force[k] += multiplier(f"{self.name}.{x}")
        if len(self.turning) == 2:
            i, j = map(AXES.index, self.turning)
            first, second = a.axes[i], b.axes[j]
            row = f"{self.name}.{CROSS}"
            draft.hold(row, product(first, second), f"the axes of {self.name} stay square")
            torque = times(multiplier(row), cross(second.value, first.value))
            torque = plus(torque, self._moment(draft, a, b, wrench))
            for k, e in enumerate(a.axes):
                wrench.torque[k] += dot(e.value, torque)
        elif len(self.turning) < 2:
            along, free = AXES.index(self.turning or "z"), "about" if self.turning else ""
            self.hold_turns(draft, a, b, along, wrench, free)

    def _arm(self, draft: Draft) -> Expr:
        text = f"distance of the hinges of {self.name}"
        return draft.number(self.apart, f"{self.name}.apart", "m", text)

    def _away(self, draft: Draft, a: Placed, b: Placed) -> TimedVector:
        """From the first marker to the second, less what lies between two hinges."""
        d = between(a, b)
        if len(self.turning) != 2 or self._arm(draft) == 0:
            return d
        u, v = a.axes[AXES.index(self.turning[0])], b.axes[AXES.index(self.turning[1])]
        rate = plus(cross(u.rate, v.value), cross(u.value, v.rate))
        ends = plus(cross(u.bend, v.value), cross(u.value, v.bend))
        n = cross(u.value, v.value), rate, plus(ends, times(2, cross(u.rate, v.rate)))
        arm = self._arm(draft)
        return TimedVector(*(minus(x, times(arm, y)) for x, y in zip(d, n, strict=True)))

    def _moment(self, draft: Draft, a: Placed, b: Placed, wrench: Wrench) -> Vector:
        """Of the force F on the arm that turns with the second axis: -arm v x (F x u)."""
        arm = self._arm(draft)
        if arm == 0:
            return ZERO
        u, v = a.axes[AXES.index(self.turning[0])], b.axes[AXES.index(self.turning[1])]
        force = ZERO
        for f, e in zip(wrench.force, a.axes, strict=True):
            force = plus(force, times(f, e.value))
        return times(-arm, cross(v.value, cross(force, u.value)))

    def coordinate(self, draft: Draft, a: Placed, b: Placed, axis: int, wrench: Wrench) -> None:
        """The motions that it leaves free, with their limits."""
        slides = [
            (AXES.index(x), product(a.axes[AXES.index(x)], between(a, b)), None)
            for x in self.sliding
        ]
        found = slides + self._angles(a, b)
        for name, (k, f, direction) in zip(self.measures, found, strict=True):
            turns = name.startswith("angle")
            f = draft.turning(name, f) if turns else f
            values, unit = (f.value, f.rate, draft.second(f)), "rad" if turns else "m"
            of = Relative(self.name, name, unit, values, a, b, k, direction)
            of.report(draft, name)
            own = name.split(".")[1]
            if own in self.stops:
                of.stop(draft, own, self.stops[own], sp.S.Zero)

    def _angles(self, a: Placed, b: Placed) -> list[tuple[int, Timed, Vector | None]]:
        """The axis of each hinge, its angle within a turn with its rate, and along what a torque works."""
        axes = [AXES.index(x) for x in self.turning]
        if not axes:
            return []
        w = minus(b.motion.omega, a.motion.omega)
        R = [[dot(x.value, y.value) for y in b.axes] for x in a.axes]
        if len(axes) == 1:
            i = axes[0]
            j, k = (i + 1) % 3, (i + 2) % 3
            e = a.axes[i]
            rate = Timed(sp.atan2(R[k][j], R[j][j]), dot(e.value, w), dot(e.rate, w))
            return [(i, rate, e.value)]
        i, j = axes[:2]
        k = 3 - i - j
        sign = 1 if (j - i) % 3 == 1 else -1
        u = a.axes[i]
        if len(axes) == 2:
            v = b.axes[j]
            first = Timed(sp.atan2(sign * R[k][j], R[j][j]), dot(u.value, w), dot(u.rate, w))
            second = Timed(sp.atan2(sign * R[i][k], R[i][i]), dot(v.value, w), dot(v.rate, w))
            return [(i, first, u.value), (j, second, v.value)]
        across = sp.sqrt(R[i][i] ** 2 + R[i][j] ** 2)
        within = (
            sp.atan2(-sign * R[j][k], R[k][k]),
            sp.atan2(sign * R[i][k], across),
            sp.atan2(-sign * R[i][j], R[i][i]),
        )
        directions = _dual(u, b.axes[k], sign)
        return [
            (axis, Timed(angle, dot(e, w), dot(rate, w)), e)
            for axis, angle, (e, rate) in zip(axes, within, directions, strict=True)
        ]


def _dual(u: TimedVector, w: TimedVector, sign: int) -> list[tuple[Vector, Vector]]:
    """What multiplies w_rel in the rates of three angles, and its derivative."""
    s, ds, _ = product(u, w)
    square = 1 - s**2
    found = []
    for x, y in ((u, w), (w, u)):
        e = times(1 / square, minus(x.value, times(s, y.value)))
        rate = minus(minus(x.rate, times(ds, y.value)), times(s, y.rate))
        found.append((e, plus(times(1 / square, rate), times(2 * s * ds / square, e))))
    size: Expr = sp.sqrt(square)
    n = times(sign / size, cross(w.value, u.value))
    turned = plus(cross(w.rate, u.value), cross(w.value, u.rate))
    middle = (n, plus(times(sign / size, turned), times(s * ds / square, n)))
    return [found[0], middle, found[1]]
