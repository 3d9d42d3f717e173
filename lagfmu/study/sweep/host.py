"""The process in which an FMU runs for a study: a crash takes it down, and nothing else.

`python -m lagfmu.study.sweep.host` reads pickled orders from its standard input and answers on what was its
standard output; what an FMU prints goes to standard error.  `Host` is the other end.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import subprocess
import sys
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from ...errors import SimulationError
from ...fmu.session import Outcome, Plan, Plug, RefusalError, Session

CRASHED = 6  # status of a run whose process died; fmi2Status ends at 5


class HostDiedError(Exception):
    """The process ended while it was at work; how, in words."""


class Host:
    """A process with one instance of an FMU; started when it is first needed, and again after a crash."""

    def __init__(self, plug: Plug) -> None:
        self.plug = plug
        self.process: subprocess.Popen[bytes] | None = None

    def run(self, plan: Plan, values: NDArray[np.float64]) -> Outcome:
        """All runs; where the process dies, each is tried by itself, and those that kill it are told.

        Raises SimulationError if the FMU cannot be loaded at all.
        """
        try:
            return self._ask(plan, values)
        except HostDiedError as died:
            if len(values) == 1:
                return _crashed(plan, str(died))
        return joined([self.run(plan, row[None, :]) for row in values])

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
                [sys.executable, "-m", "lagfmu.study.sweep.host"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env=os.environ | {"PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
            )
            self._exchange(self.plug)
        answer: Outcome = self._exchange((plan, values))
        return answer

    def _exchange(self, order: Any) -> Any:
        process = self.process
        assert process is not None
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            pickle.dump(order, process.stdin)
            process.stdin.flush()
            answer = pickle.load(process.stdout)
        except (OSError, EOFError, pickle.UnpicklingError):
            code = process.wait()
            self.close()
            how = f"signal {-code}" if code < 0 else f"exit code {code}"
            raise HostDiedError(f"the FMU took its process down ({how})") from None
        if isinstance(answer, SimulationError):
            self.close()
            raise answer
        return answer


def joined(outcomes: list[Outcome]) -> Outcome:
    """Outcomes one after another."""
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


def _crashed(plan: Plan, how: str) -> Outcome:
    whole = np.full((1, len(plan.times), len(plan.keep)), np.nan) if plan.whole else None
    status, reached = np.array([CRASHED], dtype=np.int32), np.array([np.nan])
    return Outcome(np.full((1, len(plan.keep)), np.nan), whole, status, reached, {0: how})


def main(orders: BinaryIO, answers: BinaryIO) -> None:
    """Serve until the orders end."""
    session: Session | None = None
    while True:
        try:
            order = pickle.load(orders)
        except EOFError:
            break
        answer: Any = None
        if isinstance(order, Plug):
            try:
                session = Session(order, "sweep")
            except RefusalError as error:
                answer = SimulationError(f"the FMU cannot be instantiated: {error.message}")
        else:
            assert session is not None
            answer = session.batch(*order)
        pickle.dump(answer, answers)
        answers.flush()


if __name__ == "__main__":
    own = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    with contextlib.suppress(KeyboardInterrupt, BrokenPipeError):
        main(sys.stdin.buffer, own)
    os._exit(0)  # an FMU's libraries may not survive the interpreter's end
