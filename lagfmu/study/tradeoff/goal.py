"""The accuracy that is asked for: 1e-6, 1e-6:lambda.surface, 1e-6:lambda.surface,Q.*"""

from __future__ import annotations

from dataclasses import dataclass

from ...errors import BuildError

MARGIN = 5.0  # the choice is this much better on the scene than what was asked
HELD_OUT_MARGIN = 2.0  # and still this much on other start values and parameters
LOOSEST, FINEST = 0.1, 1e-12


@dataclass(frozen=True)
class Goal:
    """A relative error, and the quantities that it is asked of (all measured ones if empty)."""

    accuracy: float
    names: tuple[str, ...] = ()

    @property
    def on_the_scene(self) -> float:
        """The error that a setting may have where it is chosen."""
        return self.accuracy / MARGIN

    @property
    def held_out(self) -> float:
        """The error that it may have elsewhere."""
        return self.accuracy / HELD_OUT_MARGIN

    def __str__(self) -> str:
        return f"{self.accuracy:g}" + (f" of {', '.join(self.names)}" if self.names else "")


def parse(text: str) -> Goal:
    """'1e-6' or '1e-6:NAME,NAME'.  Raises BuildError if it is neither."""
    number, colon, names = text.partition(":")
    wanted = tuple(n.strip() for n in names.split(",") if n.strip())
    try:
        accuracy = float(number)
    except ValueError:
        accuracy = float("nan")
    if not FINEST <= accuracy <= LOOSEST or (colon and not wanted):
        raise BuildError(
            f"--accuracy {text!r}: expected a relative error from {FINEST:g} to {LOOSEST:g}, and after "
            "a colon the outputs that it is asked of, e.g. 1e-6 or 1e-6:lambda.surface,Q.*"
        )
    return Goal(accuracy, wanted)
