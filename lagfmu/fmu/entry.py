"""What the generated script imports; where NumPy or SciPy is missing, stand-ins that say so.

pythonfmu's binary takes its process down after an instantiation that failed.  So the instance is made all
the same, and its first call is refused with the cause (fmi2Fatal, pythonfmu knows no fmi2Error).
"""

from __future__ import annotations

import sys
from typing import Any

from .references import end_once, keep, keep_module_of

try:
    from ..solver.system import Embedding, Friction, Lookups, Own, Row, System
    from .slave import LagfmuSlave
except ImportError as error:
    from pythonfmu.fmi2slave import Fmi2Slave

    CAUSE = (
        f"this python FMU needs NumPy and SciPy, but the Python at {sys.prefix!r} says: {error}. Install "
        "them there, let PYTHONPATH name their site-packages, or take the native FMU, which needs neither"
    )

    class NeedsPackagesError(Exception):
        """The first call of an instance that cannot compute."""

    class LagfmuSlave(Fmi2Slave):  # type: ignore[no-redef,misc]
        """An instance that refuses to be set up, with the cause."""

        def __init__(self, **kwargs: Any) -> None:
            super().__init__(**kwargs)
            keep_module_of(self)
            end_once(self)

        def _refuse(self, *_: Any) -> Any:
            keep(self, type(self), self.log_queue)
            raise NeedsPackagesError(CAUSE.encode("ascii", "backslashreplace").decode())

        setup_experiment = enter_initialization_mode = exit_initialization_mode = do_step = _refuse
        get_real = get_integer = get_boolean = get_string = _refuse
        set_real = set_integer = set_boolean = set_string = _refuse

    def _nothing(*_: Any, **__: Any) -> None:
        """In place of what the script builds of the equations."""

    Embedding = Friction = Lookups = Own = Row = System = _nothing  # type: ignore[misc,assignment]

__all__ = ["Embedding", "Friction", "LagfmuSlave", "Lookups", "Own", "Row", "System"]
