"""The process in which an FMU runs for a sweep: it keeps a session, and answers plans and rows of values with
outcomes.  `SessionProcess` is the other end."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import SimulationError
from ...fmu.session import Outcome, Plan, RefusalError, Session, run_batch
from ..host import DiedError, Host, LateError, serve

CRASHED, TIMED_OUT = 6, 7  # status of a run whose process died, was killed; those of FMI end at 5
SLICE = 0.5  # [s] of work in one order: how far it has come is known in between


class SessionProcess(Host):
    """A process with a session of the FMU that lies unpacked in `folder`; started again after a crash, or
    after a run that took longer than `limit` [s]."""

    def __init__(self, folder: str | Path, limit: float | None = None) -> None:
        super().__init__("lagfmu.studio.sweep.process", str(folder))
        self.folder, self.limit = folder, limit
        self.pace = np.inf  # [s] that a run took

    def run(
        self, plan: Plan, values: NDArray[np.float64], tell: Callable[[int], None] = lambda _: None
    ) -> Outcome:
        """All runs; `tell` hears how many are done.  Where the process dies, each is tried by itself, and
        those that kill it, or take too long, are told.

        Raises SimulationError if the FMU cannot be loaded at all, and EndedError after `end`.
        """
        found, first = [], 0
        while first < len(values):
            spell = SLICE if self.limit is None else min(SLICE, self.limit / 4)
            count = max(1, int(spell / self.pace))
            found.append(self._runs(plan, values[first : first + count]))
            first += count
            tell(min(first, len(values)))
        return joined(found)

    def _runs(self, plan: Plan, values: NDArray[np.float64]) -> Outcome:
        try:
            return self._ask(plan, values)
        except DiedError as died:
            if len(values) == 1 and isinstance(died, LateError):
                told = f"the run took longer than the {self.limit:g} s of --timeout"
                return _failed(plan, TIMED_OUT, told)
            if len(values) == 1:
                return _failed(plan, CRASHED, f"the FMU took its process down ({died})")
        return joined([self._runs(plan, row[None, :]) for row in values])

    def _ask(self, plan: Plan, values: NDArray[np.float64]) -> Outcome:
        self.start()
        begun = time.monotonic()
        answer: Outcome = self.ask((plan, values), self.limit)
        self.pace = (time.monotonic() - begun) / max(len(values), 1)
        return answer


def joined(outcomes: list[Outcome]) -> Outcome:
    """Outcomes one after another."""
    if len(outcomes) == 1:
        return outcomes[0]
    reasons: dict[int, str] = {}
    moved: dict[int, str] = {}
    first = 0
    for o in outcomes:
        reasons |= {first + r: text for r, text in o.reasons.items()}
        moved |= {first + r: text for r, text in o.moved.items()}
        first += len(o.status)
    whole = [o.trajectory for o in outcomes if o.trajectory is not None]
    return Outcome(
        np.concatenate([o.result for o in outcomes]),
        np.concatenate(whole) if whole else None,
        np.concatenate([o.status for o in outcomes]),
        np.concatenate([o.reached for o in outcomes]),
        reasons,
        moved,
    )


def _failed(plan: Plan, status: int, reason: str) -> Outcome:
    whole = np.full((1, len(plan.times), len(plan.keep)), np.nan) if plan.whole else None
    statuses, reached = np.array([status], dtype=np.int32), np.array([np.nan])
    return Outcome(np.full((1, len(plan.keep)), np.nan), whole, statuses, reached, {0: reason})


def answering() -> Callable[[Any], Outcome | None]:
    """What answers orders: a folder is loaded, a plan and values are run."""
    sessions: list[Session] = []

    def answer(order: Any) -> Outcome | None:
        if not isinstance(order, str):
            return run_batch(sessions[0], *order)
        try:
            sessions.append(Session(order, "sweep"))
        except RefusalError as error:
            raise SimulationError(f"the FMU cannot be instantiated: {error.message}") from None
        return None

    return answer


if __name__ == "__main__":
    serve(answering())
