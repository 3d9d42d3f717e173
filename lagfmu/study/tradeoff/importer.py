"""One instance of an FMU, run again and again through fmpy's FMU2Slave, as an importer would.

It is instantiated once; each run resets it, sets it up, and steps it.  Only the loop of fmi2DoStep and
fmi2GetReal is timed.  fmpy's calls cost microseconds each whatever the FMU does: `floor` measures the
same loop with a C function that does nothing in place of both.
"""

from __future__ import annotations

import ctypes
import gc
import itertools
import math
import re
import shutil
import time
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import fmpy
import numpy as np
from fmpy import calloc, free
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from fmpy.logging import addLoggerProxy

from ...errors import SimulationError, VerificationError
from ...methods import NUMBERS
from ...verification.simulate import Trajectory, communication_points, read_description
from .setting import Setting

KINDS = {"Real": np.float64, "Integer": np.int32, "Boolean": np.bool_}


MESSAGES: list[str] = []  # of one call: fmpy's proxy of the logger knows one logger a process


def _log(_: Any, __: bytes, status: int, category: bytes, message: bytes) -> None:
    if status >= 2:  # discard, error, fatal
        MESSAGES.append(message.decode(errors="replace").strip())


class TooSlowError(SimulationError):
    """A run that was broken off at the time that it was given."""


class Importer:
    """An FMU loaded in this process.  Use it in a `with` statement."""

    def __init__(self, fmu: Path) -> None:
        self.path = fmu
        self.description = read_description(fmu)
        with zipfile.ZipFile(fmu) as archive:
            files = set(archive.namelist())
        python = "resources/slavemodule.txt" in files
        self.target = "python" if python else "native"
        experiment = self.description.defaultExperiment
        self.stop_time = float(getattr(experiment, "stopTime", None) or 1.0)
        self.step_size = float(getattr(experiment, "stepSize", None) or self.stop_time / 500)
        self.variables = {v.name: v for v in self.description.modelVariables}
        self.outputs = [
            v
            for v in self.description.modelVariables
            if v.causality in ("output", "local") and v.type in KINDS
        ]
        if self.description.coSimulation is None or "solver.tolerance" not in self.variables:
            raise VerificationError(
                f"{str(fmu)!r} has no parameter 'solver.tolerance': it was not built by lagfmu, and "
                "there is no setting to vary"
            )
        self.folder = fmpy.extract(str(fmu))
        self.slave: Any = None
        self.used = False

    def __enter__(self) -> Importer:
        self._open()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._close()
        shutil.rmtree(self.folder, ignore_errors=True)

    def _open(self) -> None:
        callbacks = fmi2CallbackFunctions()
        callbacks.logger = fmi2CallbackLoggerTYPE(_log)
        callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
        callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
        addLoggerProxy(ctypes.byref(callbacks))  # formats a message with its arguments
        try:
            self.slave = FMU2Slave(
                instanceName="tradeoff",
                guid=self.description.guid,
                modelIdentifier=self.description.coSimulation.modelIdentifier,
                unzipDirectory=self.folder,
            )
            self.slave.instantiate(callbacks=callbacks, loggingOn=True)
        except Exception as error:
            cause = "; ".join(MESSAGES) or "no message was logged"
            raise SimulationError(f"{str(self.path)!r}: {error} ({cause})") from None
        self.used = False

    def _close(self) -> None:
        if self.slave is not None and self.slave.component is not None:
            self.slave.freeInstance()
        self.slave = None

    def observe(
        self,
        setting: Setting,
        values: Mapping[str, Any] | None = None,
        stop: float | None = None,
        limit: float = math.inf,
    ) -> Trajectory:
        """All outputs at every communication point.

        Raises SimulationError with the FMU's reason, TooSlowError if it takes longer than `limit` [s].
        """
        begun = time.perf_counter()
        times = communication_points(stop or self.stop_time, setting.communication)
        columns: list[tuple[str, Any]] = [("time", np.float64)]
        columns += [(v.name, KINDS[v.type]) for v in self.outputs]
        result = np.zeros(len(times), dtype=columns)
        result["time"] = times
        kinds = [
            (get, [v.name for v in self.outputs if v.type == kind])
            for kind, get in (
                ("Real", "getReal"),
                ("Integer", "getInteger"),
                ("Boolean", "getBoolean"),
            )
        ]
        try:
            self._begin(setting, values or {}, float(times[-1]))
            for k, t in enumerate(times.tolist()):
                if time.perf_counter() - begun > limit:
                    raise TooSlowError(f"{setting}: a run takes longer than {limit:.3g} s")
                if k:
                    before = float(times[k - 1])
                    self.slave.doStep(before, t - before)
                for get, names in kinds:
                    if names:
                        row = getattr(self.slave, get)(self._references(names))
                        for name, value in zip(names, row, strict=True):
                            result[name][k] = value
        except FMICallException as error:
            raise self._failure(setting, error) from None
        return result

    def seconds(
        self, setting: Setting, names: Sequence[str], values: Mapping[str, Any] | None = None
    ) -> float:
        """Wall time [s] of the loop fmi2DoStep, fmi2GetReal of `names`, from start to stop."""
        try:
            self._begin(setting, values or {}, self.stop_time)
            return self._loop(setting, names)
        except FMICallException as error:
            raise self._failure(setting, error) from None

    def floor(self, communication: float, names: Sequence[str]) -> float:
        """Wall time [s] of the same loop with a C function that returns at once: fmpy's own share."""
        slave = self.slave
        idle = slave.dll["fmi2GetTypesPlatform"]  # a constant text; further arguments are not read
        idle.restype = None
        unsigned, size = ctypes.c_uint, ctypes.c_size_t
        pointer, real = ctypes.c_void_p, ctypes.c_double
        step, get = slave.dll["fmi2GetTypesPlatform"], slave.dll["fmi2GetTypesPlatform"]
        step.restype = get.restype = None
        step.argtypes = [pointer, real, real, ctypes.c_int]
        get.argtypes = [pointer, ctypes.POINTER(unsigned), size, ctypes.POINTER(real)]
        slave.fmi2DoStep, slave.fmi2GetReal = step, get
        try:
            return self._loop(Setting("", 0.0, 0.0, communication), names)
        finally:
            del slave.fmi2DoStep, slave.fmi2GetReal

    def _loop(self, setting: Setting, names: Sequence[str]) -> float:
        times = communication_points(self.stop_time, setting.communication).tolist()
        pairs = [(a, b - a) for a, b in itertools.pairwise(times)]
        references = self._references(names)
        do_step, get_real, rows = self.slave.doStep, self.slave.getReal, []
        collecting = gc.isenabled()
        gc.disable()
        try:
            begun = time.perf_counter()
            for t, h in pairs:
                do_step(t, h)
                rows.append(get_real(references))
            return time.perf_counter() - begun
        finally:
            if collecting:
                gc.enable()

    def _begin(self, setting: Setting, values: Mapping[str, Any], stop: float) -> None:
        MESSAGES.clear()
        slave = self.slave
        if self.used:
            slave.reset()
        self.used = True
        slave.setupExperiment(tolerance=setting.tolerance or None, startTime=0.0, stopTime=stop)
        for name, value in (setting.values | dict(values)).items():
            if isinstance(value, str):
                slave.setInteger(self._references([name]), [NUMBERS[value]])
            else:
                slave.setReal(self._references([name]), [float(value)])
        slave.enterInitializationMode()
        slave.exitInitializationMode()

    def _references(self, names: Sequence[str]) -> list[int]:
        return [self.variables[n].valueReference for n in names]

    def _failure(self, setting: Setting, error: Exception) -> SimulationError:
        """The reason, after the instance was replaced: after fmi2Fatal it must not be used again."""
        cause = " ".join("; ".join(MESSAGES).split()) or "no message was logged"
        raised = re.search(r"""Refused\((["'])(.*)\1\)""", cause)  # as pythonfmu's binary tells it
        cause = raised[2] if raised else cause
        self._close()
        self._open()
        return SimulationError(f"{self.description.modelName}, {setting}: {cause} ({error})")
