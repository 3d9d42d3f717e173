"""A process in which an FMU runs for a study: a crash takes it down, and nothing else.

`Host` starts `python -m MODULE` and gives it pickled orders on its standard input; there `serve` answers on
what was its standard output, and what an FMU prints goes to standard error.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from typing import Any

from ..errors import LagfmuError, SimulationError


class DiedError(Exception):
    """The process ended while it was at work; how, in words."""


class LateError(DiedError):
    """The process was ended, because it worked longer than it may."""


class EndedError(Exception):
    """Nobody waits for the answer any more."""


class Host:
    """The process of `module`; started when it is first needed, and again after it has died, each time with
    the order `first`.  `errors`: where its standard error goes."""

    def __init__(self, module: str, first: Any, errors: Any = subprocess.DEVNULL) -> None:
        self.module, self.first, self.errors = module, first, errors
        self.process: subprocess.Popen[bytes] | None = None
        self.ended = False

    def start(self, limit: float | None = None) -> None:
        """Start it, if it does not run.  Raises as `ask`."""
        if self.process is None:
            self.process = subprocess.Popen(
                [sys.executable, "-m", self.module],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self.errors,
                env=os.environ | {"PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
                start_new_session=True,  # Ctrl-C is for the client, which keeps what is finished
            )
            self._exchange(self.first, limit)

    def ask(self, order: Any, limit: float | None = None) -> Any:
        """The answer.  Raises DiedError, LateError after `limit` [s], EndedError after `end`, and
        SimulationError for a LagfmuError there."""
        self.start()
        return self._exchange(order, limit)

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

    def _exchange(self, order: Any, limit: float | None) -> Any:
        process, late = self.process, threading.Event()
        assert process is not None
        assert process.stdin is not None
        assert process.stdout is not None

        def stop() -> None:
            late.set()
            process.kill()

        timer = threading.Timer(limit or 0.0, stop)
        try:
            if self.ended:
                raise EOFError
            if limit is not None:
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
                raise LateError from None
            name = f"signal {-code}, {signal.Signals(-code).name}" if code < 0 else ""
            raise DiedError(name or f"exit code {code}") from None
        finally:
            timer.cancel()
        if isinstance(answer, SimulationError):
            self.close()
            raise answer
        return answer


def serve(answer: Callable[[Any], Any]) -> None:
    """In the process: answer orders until they end."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    with contextlib.suppress(KeyboardInterrupt, BrokenPipeError, EOFError):
        while True:
            order = pickle.load(sys.stdin.buffer)
            try:
                found = answer(order)
            except LagfmuError as error:
                found = SimulationError(str(error))
            pickle.dump(found, answers)
            answers.flush()
    os._exit(0)  # an FMU's libraries may not survive the interpreter's end
