"""Which outputs are measured, in groups, and the magnitude that an error is relative to.

An error is relative to the largest magnitude of that quantity over the reference run.  A quantity that
is zero throughout, up to rounding, is measured against the largest one of its group and unit.
"""

from __future__ import annotations

import fnmatch
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import SimulationError
from ...names import RESERVED
from ...verification.simulate import Trajectory

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
    reals = [v for v in description.modelVariables if v.type == "Real"]
    units = {v.name: v.unit or "1" for v in reals if v.causality == "output"}
    known = {v.name for v in description.modelVariables}
    own = [n for n in units if _is_own(n, known)]
    coordinates = [n for n in units if re.fullmatch(r"[A-Za-z_]\w*", n) and n not in own]
    found = [Quantity(n, MULTIPLIER, units[n]) for n in units if n.startswith("lambda.")]
    found += [Quantity(n, FORCE, units[n]) for n in units if re.fullmatch(r"Q\.\w+", n)]
    found += [Quantity(c, MOTION, units[c]) for c in coordinates]
    found += [Quantity(n, OWN, units[n]) for n in own]
    for n in units:
        parts = n.split(".")
        if len(parts) == 3 and parts[0] == "departure" and parts[2] == "time":
            found.append(Quantity(n, EVENT, units[n], parts[1]))
    return tuple(found)


def _is_own(name: str, known: Collection[str]) -> bool:
    """True for an output that the model names itself: neither the FMU's own, nor one that moves.

    A full FMU reports the velocity of each of its coordinates.
    """
    full = any(n.startswith("der(") for n in known)
    if "." in name or "(" in name:
        return "(" not in name and name.split(".")[0] not in RESERVED
    return full and f"der({name})" not in known


def residual(run: Trajectory) -> float:
    """The largest |residual| of a constraint, in its own SI unit, while it acts.

    A contact acts while it is closed; what acts with a contact has a multiplier of zero otherwise.
    """
    names = run.dtype.names or ()
    contacts = {n.removeprefix("contact.") for n in names if n.startswith("contact.")}
    largest = 0.0
    for name in (n.removeprefix("residual.") for n in names if n.startswith("residual.")):
        acts = np.ones(len(run), dtype=bool)
        if name in contacts:
            acts = run[f"contact.{name}"]
        elif contacts:
            acts = run[f"lambda.{name}"] != 0
        largest = max(largest, float(np.abs(run[f"residual.{name}"])[acts].max(initial=0.0)))
    return largest


def selected(known: Sequence[Quantity], names: Sequence[str]) -> tuple[Quantity, ...]:
    """Those that match a name, a pattern (Q.*) or a group; all without names.

    Raises SimulationError if a name matches nothing.
    """
    chosen: list[Quantity] = []
    for name in names:
        hits = [q for q in known if fnmatch.fnmatchcase(q.name, name) or q.group == name]
        if not hits:
            raise SimulationError(
                f"no measured quantity is called {name!r}, expected one of "
                f"{', '.join(q.name for q in known)}, a pattern such as 'Q.*', or a group: "
                f"{', '.join(repr(g) for g in GROUPS)}"
            )
        chosen += [q for q in hits if q not in chosen]
    return tuple(chosen) if names else tuple(known)


def magnitudes(known: Sequence[Quantity], run: Trajectory) -> dict[str, float]:
    """The magnitude that each quantity's error is relative to; 1 where all of its kind are zero."""
    largest = {q.name: float(np.abs(run[q.name]).max()) for q in known}
    found = {}
    for q in known:
        peers = [largest[p.name] for p in known if (p.group, p.unit) == (q.group, q.unit)]
        own = largest[q.name]
        found[q.name] = (own if own > ZERO * max(peers) else max(peers)) or 1.0
    return found
