"""Which outputs are measured, in groups, and the magnitude that an error is relative to.

An error is relative to the largest magnitude of that quantity over the reference run.  A quantity that
is zero throughout, up to rounding, is measured against the largest one of its group and unit.
"""

from __future__ import annotations

import fnmatch
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ... import names
from ...errors import SimulationError
from ...fmu.read import Trajectory, kind_of

MULTIPLIER, FORCE, MOTION, EVENT = "lambda", "Q", "coordinates", "event time"
OWN = "outputs"
GROUPS = (MULTIPLIER, FORCE, MOTION, OWN, EVENT)
ZERO = 1e-9  # part of its group's magnitude below which a quantity counts as zero


@dataclass(frozen=True)
class Quantity:
    """One output that is measured: its group, its unit and, for an event time, the contact."""

    name: str
    group: str
    unit: str
    contact: str | None = None


def quantities(description: Any) -> tuple[Quantity, ...]:
    """Every output of an FMU (fmpy's ModelDescription) that is a lambda, Q, coordinate, departure time
    or output of the model's own."""
    reals = [v for v in description.modelVariables if kind_of(v) == "Real"]
    units = {v.name: v.unit or "1" for v in reals if v.causality == "output"}
    known = {v.name for v in description.modelVariables}
    own = [n for n in units if _is_own(n, known)]
    moving = [n for n in names.those(units, names.VALUE) if not names.read(n).order]
    coordinates = [n for n in moving if n not in own]
    found = [Quantity(n, MULTIPLIER, units[n]) for n in names.those(units, names.MULTIPLIER)]
    forces = names.those(units, names.FORCE)
    found += [Quantity(n, FORCE, units[n]) for n in forces if not names.read(n).constraint]
    found += [Quantity(c, MOTION, units[c]) for c in coordinates]
    found += [Quantity(n, OWN, units[n]) for n in own]
    times = names.those(units, names.DEPARTURE_TIME)
    found += [Quantity(n, EVENT, units[n], names.read(n).constraint) for n in times]
    return tuple(found)


def _is_own(name: str, known: Collection[str]) -> bool:
    """True for an output that the model names itself: neither the FMU's own, nor one that moves.

    A full FMU reports the velocity of each of its coordinates.
    """
    of = names.read(name)
    if of.quantity != names.VALUE or of.order:
        return of.head in names.OF_FRICTION
    full = "." in name or any(names.read(n).order for n in known)
    return full and names.derivative(name) not in known


def selected(known: Sequence[Quantity], asked: Sequence[str]) -> tuple[Quantity, ...]:
    """Those that match a name, a pattern (Q.*) or a group; all without names.

    Raises SimulationError if a name matches nothing.
    """
    chosen: list[Quantity] = []
    for name in asked:
        hits = [q for q in known if fnmatch.fnmatchcase(q.name, name) or q.group == name]
        if not hits:
            raise SimulationError(
                f"no measured quantity is called {name!r}, expected one of "
                f"{', '.join(q.name for q in known)}, a pattern such as 'Q.*', or a group: "
                f"{', '.join(repr(g) for g in GROUPS)}"
            )
        chosen += [q for q in hits if q not in chosen]
    return tuple(chosen) if asked else tuple(known)


def magnitudes(known: Sequence[Quantity], run: Trajectory) -> dict[str, float]:
    """The magnitude that each quantity's error is relative to; 1 where all of its kind are zero."""
    largest = {q.name: float(np.abs(run[q.name]).max()) for q in known}
    found = {}
    for q in known:
        peers = [largest[p.name] for p in known if (p.group, p.unit) == (q.group, q.unit)]
        own = largest[q.name]
        found[q.name] = (own if own > ZERO * max(peers) else max(peers)) or 1.0
    return found
