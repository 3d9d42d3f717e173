"""Runs of a session (fmu/session.py) under probes, with what the judge has to know of them."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ... import names
from ...fmu.read import Trajectory
from ...fmu.session import RefusalError, Session
from .facts import Facts

VAGUE = r"internal error|traceback|assert|unknown error|no message|\w+Error\(|<class"
Values = Mapping[str, float | str]
Drive = Callable[[float], Mapping[str, float]]  # time [s] -> inputs that hold until the next point


def clear(refusal: RefusalError) -> bool:
    """True for discard and error (fatal from pythonfmu) with a message that names a cause."""
    told = len(refusal.message) >= 15 and not re.search(VAGUE, refusal.message, re.IGNORECASE)
    return refusal.status in (2, 3, 4) and told


@dataclass(frozen=True)
class Run:
    """Outputs and inputs at the communication points that were reached, and what ended it early."""

    rows: Trajectory
    values: Mapping[str, float]
    tolerance: float
    refusal: RefusalError | None
    driven: bool = False


def opened(facts: Facts, folder: Path, name: str = "stress") -> Session:
    """A session of the FMU that lies unpacked in `folder`."""
    session = Session(folder, name)
    session.outputs = [v.name for v in facts.outputs]
    return session


def play(
    session: Session,
    facts: Facts,
    values: Values,
    times: Sequence[float],
    tolerance: float | None = None,
    drive: Drive | None = None,
    late: bool = False,
) -> Run:
    """A run over the communication points `times`, or as far as the FMU goes; `late`: inputs are set when all
    has been read."""
    known = {s.name: s.start for s in (*facts.parameters, *facts.inputs, *facts.starts)}
    known |= {n: float(v) for n, v in values.items() if not isinstance(v, str)}
    driven = [] if drive is None else [drive(t) for t in times]
    inputs = {n: [given[n] for given in driven] for n in (driven[0] if driven else ())}
    read = [*session.outputs, *(i.name for i in facts.inputs)]
    found = session.run(times, values, tolerance, read, inputs, late=late)
    used = float(known.get(names.TOLERANCE) or 0) or tolerance or facts.tolerance
    return Run(found.rows, known, used, found.refusal, drive is not None)
