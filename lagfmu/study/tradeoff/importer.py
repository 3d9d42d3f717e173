"""One instance of an FMU, run again and again as an importer would (fmu/session.py): what it reports, and
how long it takes.

Only the loop of fmi2DoStep and fmi2GetReal is timed.  fmpy's calls cost microseconds each whatever the
FMU does: `floor` measures the same loop with a C function that does nothing in place of both.
"""

from __future__ import annotations

import ctypes
import gc
import itertools
import math
import shutil
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from fmpy.fmi1 import FMICallException

from ...errors import SimulationError, VerificationError
from ...fmu.archive import unpack
from ...fmu.described import Trajectory, experiment_of, is_python, read_description
from ...fmu.session import RefusalError, Session, plug, reason
from ...names import TOLERANCE
from ...verification.simulate import communication_points
from .setting import Setting

KINDS = {"Real": np.float64, "Integer": np.int32, "Boolean": np.bool_}


class TooSlowError(SimulationError):
    """A run that was broken off at the time that it was given."""


class Importer(Session):
    """An FMU loaded in this process.  Use it in a `with` statement."""

    def __init__(self, fmu: Path) -> None:
        self.path = fmu
        self.description = description = read_description(fmu)
        self.target = "python" if is_python(fmu) else "native"
        experiment = experiment_of(description)
        self.stop_time, self.step_size = experiment.stop_time, experiment.step_size
        self.variables = {v.name: v for v in description.modelVariables}
        self.outputs = [
            v
            for v in description.modelVariables
            if v.causality in ("output", "local") and v.type in KINDS
        ]
        if description.coSimulation is None or TOLERANCE not in self.variables:
            raise VerificationError(
                f"{str(fmu)!r} has no parameter {TOLERANCE!r}: it was not built by lagfmu, and "
                "there is no setting to vary"
            )
        folder = unpack(fmu)
        try:
            super().__init__(plug(fmu, description, folder), "tradeoff")
        except RefusalError as error:
            shutil.rmtree(folder, ignore_errors=True)
            raise SimulationError(f"{str(fmu)!r}: {error}") from None

    def __enter__(self) -> Importer:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
        shutil.rmtree(self.plug.folder, ignore_errors=True)

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
        names = [v.name for v in self.outputs]
        columns: list[tuple[str, Any]] = [("time", np.float64)]
        columns += [(v.name, KINDS[v.type]) for v in self.outputs]
        result = np.zeros(len(times), dtype=columns)
        result["time"] = times
        try:
            self._begin(setting, values or {}, float(times[-1]))
            for k, t in enumerate(times.tolist()):
                if time.perf_counter() - begun > limit:
                    raise TooSlowError(f"{setting}: a run takes longer than {limit:.3g} s")
                if k:
                    before = float(times[k - 1])
                    self.call("doStep", before, t - before)
                for name, value in self.read(names).items():
                    result[name][k] = value
        except RefusalError as error:
            raise self._failure(setting, error) from None
        return result

    def seconds(
        self, setting: Setting, names: Sequence[str], values: Mapping[str, Any] | None = None
    ) -> float:
        """Wall time [s] of the loop fmi2DoStep, fmi2GetReal of `names`, from start to stop."""
        try:
            self._begin(setting, values or {}, self.stop_time)
            return self._loop(setting, names)
        except RefusalError as error:
            raise self._failure(setting, error) from None
        except FMICallException as error:
            refused = RefusalError("doStep", error.status, reason())
            raise self._failure(setting, refused) from None

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
        references = self.references(names)
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
        self.begin(setting.values | dict(values), setting.tolerance or None, stop)

    def _failure(self, setting: Setting, error: RefusalError) -> SimulationError:
        """The reason, after the instance was replaced: after fmi2Fatal it must not be used again."""
        self.renew()
        return SimulationError(f"{self.description.modelName}, {setting}: {error.message}")
