"""The slave of the python target in this process, without an FMU around it: a session calls it as it calls
the library of one, by the names of fmpy's FMU2Slave."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fmpy.fmi1 import FMICallException

from ..interface.variables import rules_of
from ..prepare.prepare import Prepared
from .binary import Hear
from .python import offered, slave_of
from .read import Experiment
from .slave.fmi2 import Refused

DISCARD, ERROR = 2, 3  # statuses
CALLS = {  # of a session -> of the slave
    "enterInitializationMode": "enter_initialization_mode",
    "exitInitializationMode": "exit_initialization_mode",
    "terminate": "terminate",
    **{f"get{kind}": f"get_{kind.lower()}" for kind in ("Real", "Integer", "Boolean")},
    **{f"set{kind}": f"set_{kind.lower()}" for kind in ("Real", "Integer", "Boolean")},
}


class InProcess:
    """A prepared model, for a session: what its slave's variables are called and may be set to, its default
    experiment, and `instantiated(hear)`.  Raises BuildError if the python target cannot run it."""

    def __init__(self, prepared: Prepared) -> None:
        table, scene = offered(prepared), prepared.scene
        self.prepared, self.variables, self.rules = prepared, table.variables, rules_of(table)
        self.reference = dict(table.position)
        self.experiment = Experiment(scene.stop_time, scene.step_size, scene.tolerance)

    def instantiated(self, hear: Hear) -> SlaveInProcess:
        """An instance, of which `hear` is told what it logs."""
        return SlaveInProcess(self.prepared, hear)


class SlaveInProcess:
    """An instance of the slave that a python FMU of `prepared` holds; `hear` is told what it logs."""

    def __init__(self, prepared: Prepared, hear: Hear) -> None:
        self.kind, self.name, self.hear = slave_of(prepared), prepared.scene.name, hear
        self.reset()

    def __getattr__(self, name: str) -> Callable[..., Any]:
        if name not in CALLS:
            raise AttributeError(name)
        method = getattr(self.slave, CALLS[name])
        return lambda *arguments: self._called(name, method, *arguments)

    def reset(self) -> None:
        """A new instance."""
        self.slave = self.kind(instance_name=self.name)

    def freeInstance(self) -> None:
        """Nothing is held."""

    def setupExperiment(
        self,
        tolerance: float | None,
        startTime: float,
        stopTime: float | None,
    ) -> None:
        """Times in s."""
        experiment = (startTime, stopTime, tolerance)
        self._called("setupExperiment", self.slave.setup_experiment, *experiment)

    def doStep(self, time: float, size: float) -> None:
        """A communication step [s]."""
        if not self._called("doStep", self.slave.do_step, time, size):
            raise FMICallException("doStep", DISCARD)

    def _called(self, name: str, method: Callable[..., Any], *arguments: Any) -> Any:
        try:
            return method(*arguments)
        except Refused as error:  # without what is done to a text on its way to an importer
            self.hear(ERROR, str(error.__context__ or error))
            raise FMICallException(name, ERROR) from error
        finally:
            for m in self.slave.log_queue:
                self.hear(int(m.status), m.msg)
            self.slave.log_queue.clear()
