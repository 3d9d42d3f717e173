"""The form in which a model is simulated: its equations, what they are reduced to, the formulation."""

from __future__ import annotations

from dataclasses import dataclass

from .equations import EquationsOfMotion
from .formulations.minimal import Reduction
from .joint_coordinates import JointCoordinate


@dataclass(frozen=True)
class Form:
    """`equations` of all coordinates; the `reduction` to independent ones, where the formulation is
    'minimal' and more than these is read."""

    equations: EquationsOfMotion
    reduction: Reduction | None = None
    formulation: str = "multipliers"

    @property
    def joint_coordinates(self) -> tuple[JointCoordinate, ...]:
        """Those by which an importer may give the start: where all coordinates are stepped."""
        return self.equations.joint_coordinates if self.reduction is None else ()

    @property
    def stepped(self) -> EquationsOfMotion:
        """The equations of the coordinates that are stepped."""
        return self.equations if self.reduction is None else self.reduction.reduced
