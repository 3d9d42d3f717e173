"""The library of an FMU, loaded into this process by fmpy; what it logs, by the thread that called it."""

from __future__ import annotations

import contextlib
import ctypes
import threading
from collections.abc import Callable
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
from fmpy.fmi3 import FMU3Model
from fmpy.logging import addLoggerProxy

from .binary3 import Slave3

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
