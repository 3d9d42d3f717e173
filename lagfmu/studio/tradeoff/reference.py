"""What the measured outputs should be: a converged run whose own error is known.

The reference is a run of dop853 at REFERENCE with steps no longer than the FMU's communication step.  Its
own error is the largest difference to one at FINER with steps half as long, through other communication
points: where the tolerance bounds the error that is the more accurate one, and where the longest step does,
too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ... import names
from ...fmu.read import Trajectory
from ...fmu.session import Session
from ...verification.evaluate import alone
from .observe import observe
from .quantities import Quantity, magnitudes, quantities
from .setting import Setting

REFERENCE, FINER = 1e-13, 1e-14
ROUNDING = 16 * float(np.finfo(float).eps)  # of a run in double precision
WIDER = (10, 5, 2)


@dataclass(frozen=True)
class Reference:
    """Right values: those of `run`; `own` error and `scale` of each quantity (own is relative to it)."""

    run: Trajectory
    known: tuple[Quantity, ...]
    scale: Mapping[str, float]
    own: Mapping[str, float]

    def errors(self, run: Trajectory) -> dict[str, float]:
        """The largest error of each quantity in another run, relative to its scale."""
        rows, alike = _shared(self.run, run)
        found = {}
        for q in self.known:
            same = alike
            if q.contact is not None:
                count = names.name(names.DEPARTURES, q.contact)
                if run[count][-1] != self.run[count][-1]:
                    found[q.name] = float("inf")  # an event that is missed, or one too many
                    continue
                same = run[count] == self.run[count][rows]
            difference = np.abs(run[q.name] - self.run[q.name][rows])[same]
            found[q.name] = float(difference.max(initial=0.0)) / self.scale[q.name]
        return found


def wider(session: Session, step: float | None = None) -> float:
    """Ten times the communication step [s], or less where a quarter of the run is shorter."""
    h = step or session.experiment.step_size
    return next((k * h for k in WIDER if k * h <= session.experiment.stop_time / 4), h)


def refer(
    session: Session,
    values: Mapping[str, Any] | None = None,
    communication: float | None = None,
) -> Reference:
    """The reference for an FMU at these start values.  Raises SimulationError if it cannot be run."""
    known = quantities(session.description)
    h, longest = communication or session.experiment.step_size, session.experiment.step_size

    def tight(tolerance: float, width: float, longest: float) -> Trajectory:
        setting = Setting("dop853", tolerance, 0.0, width)
        return observe(session, setting, {**(values or {}), names.MAXIMUM_STEP: longest})

    run = tight(REFERENCE, h, longest)
    found = Reference(run, known, magnitudes(known, run), {})
    missed = found.errors(tight(FINER, wider(session, h), longest / 2))
    return Reference(run, known, found.scale, {n: max(ROUNDING, e) for n, e in missed.items()})


def _shared(fine: Trajectory, run: Trajectory) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Rows of `fine` at the times of `run`, and where contacts and counts of events of both are alike, or
    differ at longer than a single point: that is an error like any other."""
    times = fine["time"]
    rows = np.clip(np.searchsorted(times, run["time"]), 1, len(times) - 1)
    rows -= np.abs(times[rows - 1] - run["time"]) < np.abs(times[rows] - run["time"])
    alike = np.ones(len(run), dtype=bool)
    for name in names.those(run.dtype.names or (), names.CONTACT, *names.COUNTS):
        alike &= ~alone(run[name] != fine[name][rows])
    return rows, alike
