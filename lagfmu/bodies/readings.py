"""What is read of markers on request: where they are, how they move, how they are turned.

URDF's roll, pitch and yaw turn about the fixed axes x, y, z in turn, R = Rz(yaw) Ry(pitch) Rx(roll):

    yaw = atan2(R21, R11) ,  pitch = atan2(-R31, h) ,  roll = atan2(R21 R13 - R11 R23, R11 R22 - R21 R12)

with h^2 = R11^2 + R21^2 = cos^2 pitch.  At a pitch of +-pi/2 roll and yaw turn about one line: where h is
below 1e-8 the yaw is 0, and the roll all of the turn, so that the three together are R there too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import sympy as sp

from ..model.elements import Output
from .body import Body, Marker
from .draft import Draft
from .motion import Placed, Timed
from .vectors import AXES

TURNS = ("roll", "pitch", "yaw")
LOCK = sp.Float(1e-8)  # nearer to it, roundings of R would turn roll and yaw by more than that


@dataclass(frozen=True, eq=False)
class Reading:
    """The FMU tells NAME.position.x [m], NAME.velocity.x [m/s], NAME.acceleration.x [m/s^2], ... of the
    marker, along the ground's axes, and in space how it is turned: NAME.rpy.roll, .pitch, .yaw [rad]."""

    name: str
    at: Marker

    def add(self, draft: Draft) -> None:
        """Its outputs."""
        placed = draft.readings[self.name] = draft.place(self.at, self.name)
        where = f"of {self.name} on {placed.body.name}"
        points = [Timed(*parts) for parts in zip(*placed.origin, strict=True)]
        told = (
            ("position", [p.value for p in points], "m"),
            ("velocity", [p.rate for p in points], "m/s"),
            ("acceleration", [draft.second(p) for p in points], "m/s^2"),
        )
        for what, vector, unit in told:
            text = f"{what} {where}, from the ground"
            for x, component in zip(draft.components, vector, strict=False):
                draft.report(f"{self.name}.{what}.{x}", component, unit, text)
        if len(draft.components) == len(AXES):
            self._turned(draft, placed, where)

    def _turned(self, draft: Draft, placed: Placed, where: str) -> None:
        (r11, r21, r31), (r12, r22, _), (r13, r23, _) = (axis.value for axis in placed.axes)
        h2 = r11**2 + r21**2
        k = sp.sqrt(h2 - LOCK**2)  # no number at lock, and before it a length that does not count
        roll = sp.atan2(k * (r21 * r13 - r11 * r23), k * (r11 * r22 - r21 * r12))
        found = (
            (roll, sp.atan2(-r23, r22)),
            (sp.atan2(-r31, sp.sqrt(h2)), None),
            (sp.atan2(k * r21, k * r11), sp.S.Zero),
        )
        for what, (angle, at_lock) in zip(TURNS, found, strict=True):
            name, text = f"{self.name}.rpy.{what}", f"{what} {where}, against the ground"
            draft.outputs.append(Output(name, angle, "rad", text, otherwise=at_lock))


def readings_of(read: Mapping[str, Any], planar: bool) -> list[Reading]:
    """Of markers by name; of a body its own frame."""
    origin = (0.0, 0.0) if planar else (0.0, 0.0, 0.0)
    return [Reading(n, m.at(origin) if isinstance(m, Body) else m) for n, m in read.items()]
