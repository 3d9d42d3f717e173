"""FMI 2.0 co-simulation of the python target: pythonfmu's calls, handed to an Instance.

This folder travels inside each FMU, together with `lagfmu/solver` and `lagfmu/numeric`, in a package whose
name carries the hash of its content.  It needs NumPy and SciPy, no SymPy and no installed lagfmu.

Status of calls: a communication step that cannot be done returns False (fmi2Discard), with the reason
in the log and the instance as it was before the step.  pythonfmu turns every exception into fmi2Fatal
and knows no way to return fmi2Error; other refusals are therefore exceptions with a plain message.
"""

from __future__ import annotations

import functools
import json
import zlib
from collections.abc import Callable
from typing import Any, TypeVar

from pythonfmu.enums import Fmi2Status
from pythonfmu.fmi2slave import Fmi2Slave

from ...numeric.failure import StepFailureError
from .instance import WARNING, Instance
from .instance import Refused as Refused
from .references import end_once, keep, keep_module_of
from .script import Facts

Call = TypeVar("Call", bound=Callable[..., Any])


def guarded(method: Call) -> Call:
    """Let an exception reach the importer as text, and the instance survive it (references.py); log what the
    call has told."""

    @functools.wraps(method)
    def call(self: LagfmuSlave, *arguments: Any) -> Any:
        try:
            return method(self, *arguments)
        except Exception as error:
            keep(self, type(self), self.log_queue)
            self.log_queue.clear()  # what waits to be logged would take the exception's text with it
            self.run.messages.clear()
            text = str(error).encode("ascii", "backslashreplace").decode()
            text = text.replace("%", "%%")  # the importer's logger reads it as a format of printf
            if isinstance(error, (Refused, StepFailureError)):
                raise Refused(text) from None
            raise Refused(f"internal error, {type(error).__name__}: {text}") from error
        finally:
            for level, text in self.run.messages:
                kind = "logStatusWarning" if level == WARNING else "logEvents"
                status = Fmi2Status.warning if level == WARNING else Fmi2Status.ok
                self.log(text, status, kind)
            self.run.messages.clear()

    return call  # type: ignore[return-value]


def _getter(kind: str, as_kind: Callable[[Any], Any]) -> Callable[..., list[Any]]:
    @guarded
    def get(self: LagfmuSlave, vrs: list[int]) -> list[Any]:
        return [as_kind(x) for x in self.run.get(vrs, kind)]

    return get


def _setter(kind: str) -> Callable[..., None]:
    @guarded
    def put(self: LagfmuSlave, vrs: list[int], values: list[Any]) -> None:
        self.run.set(vrs, values, kind)

    return put


class LagfmuSlave(Fmi2Slave):  # type: ignore[misc]
    """A simulation behind the FMI functions; the generated subclass gives its `facts`."""

    facts: Facts

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        keep_module_of(self)
        end_once(self)
        self.run = Instance(self.facts)

    @guarded
    def setup_experiment(
        self, start_time: float, stop_time: float | None, tolerance: float | None
    ) -> None:
        """Start and stop time [s]; the tolerance is the dial between speed and accuracy."""
        self.run.experiment(start_time, stop_time, tolerance)

    def enter_initialization_mode(self) -> None:
        """Nothing is computed before a value is read or the mode is left."""

    @guarded
    def exit_initialization_mode(self) -> None:
        """Project the start values, choose the contact modes."""
        self.run.begin()

    def terminate(self) -> None:
        """Nothing to release."""

    @guarded
    def do_step(self, current_time: float, step_size: float) -> bool:
        """Advance by `step_size` [s]; False (fmi2Discard) leaves everything as it was."""
        try:
            self.run.step(current_time, step_size)
        except StepFailureError as error:
            self.run.messages.clear()
            self.log(str(error), Fmi2Status.discard, "logStatusDiscard")
            return False
        return True

    # of a kind each; what can be set are parameters, start values and inputs
    get_real, get_integer = _getter("Real", float), _getter("Integer", int)
    get_boolean, get_string = _getter("Boolean", bool), _getter("String", str)
    set_real, set_integer = _setter("Real"), _setter("Integer")
    set_boolean, set_string = _setter("Boolean"), _setter("String")

    @guarded
    def _get_fmu_state(self) -> dict[str, Any]:
        return self.run.saved()

    @guarded
    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        if "refused" in state:
            raise Refused(state["refused"])
        self.run.restore(state)

    @staticmethod
    def _fmu_state_to_bytes(state: dict[str, Any]) -> bytes:
        text = json.dumps(state, sort_keys=True).encode("ascii")
        return b"%08x %s" % (zlib.crc32(text), text)

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> dict[str, Any]:
        try:
            check, _, text = state.rstrip(b"\0").partition(b" ")
            if check != b"%08x" % zlib.crc32(text):
                raise ValueError("their check sum is wrong")
            return dict(json.loads(text.decode("ascii")))
        except (TypeError, ValueError, RecursionError) as error:
            # raised here, it would crash pythonfmu's binary
            return {"refused": f"the bytes are no saved state of an FMU ({error})"}
