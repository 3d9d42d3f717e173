"""What the generated script imports; where NumPy or SciPy is missing, stand-ins that say so.

Engines do not outlive a refusal at an early call: libcosim (libcosimpy 0.0.6) and ecos 0.7.2 go on with
the NULL of a refused fmi2Instantiate; libcosim ends the process at any error before the first step, which
it meets in a thread where nothing catches it.  Both carry a refused fmi2DoStep.  So the instance is made and
initialized all the same, the cause is told on the error stream (most importers ask for no log) and in
the log, every Real is NaN, and each step is refused with the cause (fmi2Fatal, pythonfmu knows no
fmi2Error).
"""

from __future__ import annotations

import math
import platform
import sys
from typing import Any

from .references import end_once, keep, keep_module_of
from .script import Facts, Variable

try:
    from ...numeric.functions import Cubic, across, levers, rotation, turned
    from ...numeric.system import Embedding, Lookups, Own, Row, System
    from .fmi2 import LagfmuSlave
except Exception as error:  # a NumPy of another Python, or an old one, fails in many ways
    from pythonfmu.enums import Fmi2Status
    from pythonfmu.fmi2slave import Fmi2Slave

    CAUSE = (
        f"this python FMU needs NumPy and SciPy, but the Python {platform.python_version()} at "
        f"{sys.prefix!r} says: {error}. Install them there, let PYTHONPATH name their site-packages, or "
        "take the native FMU, which needs neither"
    )
    TOLD: set[str] = set()  # the causes that stand on the error stream already

    class NeedsPackagesError(Exception):
        """A step of an instance that cannot compute."""

    class LagfmuSlave(Fmi2Slave):  # type: ignore[no-redef,misc]
        """An instance that has no numbers and refuses to step, with the cause."""

        facts: Facts

        def __init__(self, **kwargs: Any) -> None:
            super().__init__(**kwargs)
            keep_module_of(self)
            end_once(self)

        def setup_experiment(self, *_: Any) -> None:
            """The cause, once in a process and once in each instance's log."""
            text = CAUSE.encode("ascii", "backslashreplace").decode()
            if text not in TOLD and sys.stderr is not None:
                TOLD.add(text)
                print(f"{type(self).__name__}: {text}", file=sys.stderr, flush=True)
            self.log(text.replace("%", "%%"), Fmi2Status.error)  # read as a format of printf

        def do_step(self, *_: Any) -> bool:
            """Refused."""
            keep(self, type(self), self.log_queue)
            raise NeedsPackagesError(CAUSE.encode("ascii", "backslashreplace").decode())

        def _accept(self, *_: Any) -> None:
            """Nothing to give it to."""

        def _nothing_known(self, references: Any) -> list[Any]:
            """NaN for a Real; the other types have no such value."""
            kinds = {"Real": math.nan, "Boolean": False, "String": ""}
            return [kinds.get(self.facts.variables[k].kind, 0) for k in references]

        enter_initialization_mode = exit_initialization_mode = _accept
        set_real = set_integer = set_boolean = set_string = _accept
        get_real = get_integer = get_boolean = get_string = _nothing_known

    def _nothing(*_: Any, **__: Any) -> None:
        """In place of what the script builds of the equations."""

    Cubic = Embedding = Lookups = Own = Row = System = _nothing  # type: ignore[misc,assignment]
    across = levers = rotation = turned = _nothing  # type: ignore[assignment]

__all__ = [
    "Cubic",
    "Embedding",
    "Facts",
    "LagfmuSlave",
    "Lookups",
    "Own",
    "Row",
    "System",
    "Variable",
    "across",
    "levers",
    "rotation",
    "turned",
]
