"""The library of an FMU, loaded into this process by fmpy; what it logs, by the thread that called it.

One of FMI 3.0 is called as fmpy's FMU2Slave is: a session knows its names alone.

Without event mode a communication step does what it does in FMI 2.0.  An FMU with clocks cannot do without:
then the events at the end of a step are gone through here, and what is read is what holds after them.
"""

from __future__ import annotations

import contextlib
import ctypes
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import fmpy
from fmpy.fmi2 import (
    FMU2Model,
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from fmpy.fmi3 import FMU3Model, FMU3Slave, fmi3Boolean, fmi3Float64
from fmpy.logging import addLoggerProxy

CALLS = {  # what only has another name
    "getReal": "getFloat64",
    "setReal": "setFloat64",
    "getFMUstate": "getFMUState",
    "setFMUstate": "setFMUState",
    "freeFMUstate": "freeFMUState",
}
MOST_ROUNDS = 100  # of the discrete states at one instant


class Slave3(FMU3Slave):  # type: ignore[misc]
    """For co-simulation; `variables`: those of its description."""

    def __init__(self, variables: Sequence[Any], **library: str) -> None:
        super().__init__(**library)
        self.long = {int(v.valueReference) for v in variables if v.type == "Enumeration"}
        self.clocked = any(v.type == "Clock" for v in variables)
        self.experiment: tuple[Any, ...] = (None, 0.0, None)
        # of a step: whether an event is to be handled, the end is asked for, it ended early; the time [s]
        self.told = fmi3Boolean(), fmi3Boolean(), fmi3Boolean(), fmi3Float64()
        self.places = tuple(map(ctypes.byref, self.told))

    def begin(self, log: Callable[..., None], on: bool) -> None:
        """Instantiate; `log` is called as fmi3LogMessageCallback is."""
        self.instantiate(loggingOn=on, eventModeUsed=self.clocked, logMessage=log)

    def __getattr__(self, name: str) -> Callable[..., Any]:
        if name not in CALLS:
            raise AttributeError(name)
        method: Callable[..., Any] = getattr(self, CALLS[name])
        return method

    def getInteger(self, references: Sequence[int]) -> list[int]:
        """Of Int32 and of Enumerations, which are Int64."""
        if not self.long.intersection(references):
            return list(self.getInt32(references))
        return [(self.getInt64 if r in self.long else self.getInt32)([r])[0] for r in references]

    def setInteger(self, references: Sequence[int], values: Sequence[int]) -> None:
        """Likewise."""
        for r, value in zip(references, values, strict=True):
            (self.setInt64 if r in self.long else self.setInt32)([r], [value])

    def setupExperiment(
        self, tolerance: float | None, startTime: float, stopTime: float | None
    ) -> None:
        """Times in s; told when initialization mode is entered."""
        self.experiment = tolerance, startTime, stopTime

    def enterInitializationMode(self) -> None:
        """With the experiment that was set up."""
        super().enterInitializationMode(*self.experiment)

    def exitInitializationMode(self) -> None:
        """To step mode."""
        super().exitInitializationMode()
        if self.clocked:
            self._go_through_events()

    def doStep(self, time: float, size: float) -> None:
        """A communication step [s], events at its end included."""
        self.fmi3DoStep(self.component, time, size, True, *self.places)
        if self.told[0].value:
            self.enterEventMode()
            self._go_through_events()

    def _go_through_events(self) -> None:
        for _ in range(MOST_ROUNDS):
            needed, *_rest = self.updateDiscreteStates()
            if not needed:
                break
        self.enterStepMode()


BATCH = "lagfmu_batch"  # many runs in one call (runtime/fmi/batch.h)
Hear = Callable[[int, str], None]  # the status of a message, and its text

_here = threading.local()  # fmpy's proxy of the logger knows one logger a process


def _log(*told: Any) -> None:
    """As the callback of either version, whose last are the status, the category and the message."""
    status, _, message = told[-3:]
    hear = getattr(_here, "hear", None)
    if hear is not None:
        hear(status, " ".join(message.decode(errors="replace").split()))


LOGGER = fmi2CallbackLoggerTYPE(_log)  # kept for ever: fmpy's proxy goes on pointing to it


def listen(hear: Hear | None) -> None:
    """Who hears, from now on, what FMUs say in this thread."""
    _here.hear = hear


def instantiated(folder: Path, description: Any, name: str, log: bool) -> FMU2Slave | Slave3:
    """An instance for co-simulation of the FMU that lies unpacked in `folder`; one of lagfmu gives its
    reasons and warnings unasked, and logs events only with `log`.  Raises what fmpy raises."""
    library = {
        "instanceName": name,
        "guid": description.guid,
        "modelIdentifier": description.coSimulation.modelIdentifier,
        "unzipDirectory": str(folder),
    }
    with contextlib.chdir("."):  # fmpy stays in the folder of a library that it cannot load
        if description.fmiVersion == "2.0":
            slave = FMU2Slave(**library)
            slave.instantiate(callbacks=_callbacks(), loggingOn=log or not is_ours(slave))
        else:
            slave = Slave3(description.modelVariables, **library)
            slave.begin(_log, log or not is_ours(slave))
    if is_ours(slave) and not log:
        slave.setDebugLogging(True, ["logStatusWarning"])
    return slave


def exchanging(folder: Path, description: Any, name: str) -> FMU2Model | FMU3Model:
    """An instance for model exchange of the FMU that lies unpacked in `folder`, likewise."""
    library = {
        "instanceName": name,
        "guid": description.guid,
        "modelIdentifier": description.modelExchange.modelIdentifier,
        "unzipDirectory": str(folder),
    }
    with contextlib.chdir("."):
        if description.fmiVersion == "2.0":
            one = FMU2Model(**library)
            one.instantiate(callbacks=_callbacks())
        else:
            one = FMU3Model(**library)
            one.instantiate(logMessage=_log)
    one.setDebugLogging(True, ["logStatusWarning"])
    return one


def is_ours(slave: Any) -> bool:
    """Whether the library of an instance is lagfmu's."""
    return hasattr(getattr(slave, "dll", None), BATCH)


def _callbacks() -> fmi2CallbackFunctions:
    callbacks = fmi2CallbackFunctions()
    callbacks.logger = LOGGER
    callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
    callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(fmpy.free)
    addLoggerProxy(ctypes.byref(callbacks))  # formats a message with its arguments
    return callbacks
