"""The process in which an FMU runs for a study: a crash takes it down, and nothing else.

`python -m lagfmu.study.sweep.process` reads pickled orders from its standard input and answers on what was
its standard output; what an FMU prints goes to standard error.  `SessionProcess` is the other end.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from ...errors import LagfmuError, SimulationError
from ...fmu.batch import Outcome, Plan, run_batch
from ...fmu.session import RefusalError, Session

CRASHED, TIMED_OUT = 6, 7  # status of a run whose process died, was killed; those of FMI end at 5
SLICE = 0.5  # [s] of work in one order: how far it has come is known in between


class DiedError(Exception):
    """The process ended while it was at work; how, in words."""

    status = CRASHED


class LateError(DiedError):
    """The process was ended, because it worked longer than it may."""

    status = TIMED_OUT


class EndedError(Exception):
    """Nobody waits for the answer any more."""


class SessionProcess:
    """A process with a session of the FMU that lies unpacked in `folder`; started when it is first needed,
    and again after a crash, or after a run that took longer than `limit` [s]."""

    def __init__(self, folder: str | Path, limit: float | None = None) -> None:
        self.folder, self.limit = folder, limit
        self.process: subprocess.Popen[bytes] | None = None
        self.pace = np.inf  # [s] that a run took
        self.ended = False

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
            if len(values) == 1:
                return _failed(plan, died)
        return joined([self._runs(plan, row[None, :]) for row in values])

    def end(self) -> None:
        """End the process for good, from another thread than that which waits for it."""
        self.ended = True
        if self.process is not None:
            self.process.kill()

    def close(self) -> None:
        """End the process."""
        if self.process is not None:
            self.process.kill()
            with contextlib.suppress(OSError), self.process:
                pass  # waits, and closes the pipes
        self.process = None

    def _ask(self, plan: Plan, values: NDArray[np.float64]) -> Outcome:
        if self.process is None:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "lagfmu.study.sweep.process"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env=os.environ | {"PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
                start_new_session=True,  # Ctrl-C is for the client, which keeps what is finished
            )
            self._exchange(str(self.folder))
        begun = time.monotonic()
        answer: Outcome = self._exchange((plan, values), self.limit)
        self.pace = (time.monotonic() - begun) / max(len(values), 1)
        return answer

    def _exchange(self, order: Any, limit: float | None = None) -> Any:
        process, late = self.process, threading.Event()

        def stop() -> None:
            late.set()
            if process is not None:
                process.kill()

        timer = threading.Timer(limit, stop) if limit is not None else None
        assert process is not None
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            if self.ended:
                raise EOFError
            if timer is not None:
                timer.start()
            pickle.dump(order, process.stdin)
            process.stdin.flush()
            answer = pickle.load(process.stdout)
        except (OSError, EOFError, pickle.UnpicklingError):
            if self.ended:
                self.close()
                raise EndedError from None
            code = process.wait()
            self.close()
            if late.is_set():
                raise LateError(f"the run took longer than the {limit:g} s of --timeout") from None
            how = f"signal {-code}" if code < 0 else f"exit code {code}"
            raise DiedError(f"the FMU took its process down ({how})") from None
        finally:
            if timer is not None:
                timer.cancel()
        if isinstance(answer, SimulationError):
            self.close()
            raise answer
        return answer


def joined(outcomes: list[Outcome]) -> Outcome:
    """Outcomes one after another."""
    if len(outcomes) == 1:
        return outcomes[0]
    reasons: dict[int, str] = {}
    first = 0
    for o in outcomes:
        reasons |= {first + r: text for r, text in o.reasons.items()}
        first += len(o.status)
    whole = [o.trajectory for o in outcomes if o.trajectory is not None]
    return Outcome(
        np.concatenate([o.result for o in outcomes]),
        np.concatenate(whole) if whole else None,
        np.concatenate([o.status for o in outcomes]),
        np.concatenate([o.reached for o in outcomes]),
        reasons,
    )


def _failed(plan: Plan, how: DiedError) -> Outcome:
    whole = np.full((1, len(plan.times), len(plan.keep)), np.nan) if plan.whole else None
    status, reached = np.array([how.status], dtype=np.int32), np.array([np.nan])
    return Outcome(np.full((1, len(plan.keep)), np.nan), whole, status, reached, {0: str(how)})


def main(orders: BinaryIO, answers: BinaryIO) -> None:
    """Serve until the orders end."""
    session: Session | None = None
    while True:
        try:
            order = pickle.load(orders)
        except EOFError:
            break
        answer: Any = None
        if isinstance(order, str):
            try:
                session = Session(order, "sweep")
            except RefusalError as error:
                answer = SimulationError(f"the FMU cannot be instantiated: {error.message}")
            except LagfmuError as error:
                answer = SimulationError(str(error))
        else:
            assert session is not None
            answer = run_batch(session, *order)
        pickle.dump(answer, answers)
        answers.flush()


if __name__ == "__main__":
    own = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    with contextlib.suppress(KeyboardInterrupt, BrokenPipeError):
        main(sys.stdin.buffer, own)
    os._exit(0)  # an FMU's libraries may not survive the interpreter's end
