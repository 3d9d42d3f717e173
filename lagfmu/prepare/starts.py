"""Start values that miss the constraints: who said them, what they are moved to, and how that is told."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterable, Sequence

from ..errors import ModelError
from ..interface.variables import VariableTable
from ..numeric.start_priority import GIVEN, LEFT_OUT, OMITTED, Moved, left_out
from ..numeric.system import System

LOG = logging.getLogger("lagfmu")
ALLOWED = 1e-6  # part of its coordinate's size by which a value in `start` may miss the constraints


class StartMovedWarning(UserWarning):
    """A start value is not the one that the simulation begins with."""


def priorities(system: System, table: VariableTable) -> list[int]:
    """Of each coordinate (nq) and then each speed (nv): who said its start value, as in start_priority.py."""
    return [GIVEN if table[name].given else OMITTED for name in system.states]


def tell(moved: Iterable[Moved | str]) -> None:
    """One warning for each value that was given and is moved (as an FMU says it, or to be said); the logger
    `lagfmu` hears in one line what those are that were left out."""
    known = list(moved)
    lines = [left_out(m for m in known if isinstance(m, Moved))]
    for m in known:
        if isinstance(m, str) and m.startswith(LEFT_OUT):
            lines.append(m)
        elif isinstance(m, str) or m.priority != OMITTED:
            warnings.warn(str(m), StartMovedWarning, stacklevel=3)
    for line in filter(None, lines):
        LOG.info(line)


def check_given(model: str, moved: Iterable[Moved], missed: Sequence[str]) -> None:
    """Raises ModelError naming the values in the model's `start` that miss the constraints, all at once.

    `missed`: the constraints that they miss, and by how much.
    """
    wrong = [m for m in moved if m.priority == GIVEN and abs(m.used - m.given) > ALLOWED * m.size]
    if wrong:
        what = f"the constraints ({', '.join(missed)})"
        if not missed:
            what = "what the other values say: a quaternion has the norm 1, an angle goes with it"
        raise ModelError(
            model,
            [
                f"start gives {m.name} = {m.given!r}, which misses {what}; "
                f"the nearest start that satisfies them has {m.used!r}: correct the start, or leave it out"
                for m in wrong
            ],
        )
