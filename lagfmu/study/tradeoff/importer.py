"""One instance of an FMU, run again and again as an importer would (fmu/session.py): what it reports, and
how long it takes.  Only the loop of fmi2DoStep and fmi2GetReal is timed."""

from __future__ import annotations

import itertools
import shutil
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import SimulationError, VerificationError
from ...fmu.archive import unpack
from ...fmu.described import Trajectory, experiment_of, is_python, read_description
from ...fmu.session import RefusalError, Session, plug
from ...names import TOLERANCE
from ...verification.simulate import communication_points
from .setting import Setting

KINDS = {"Real": np.float64, "Integer": np.int32, "Boolean": np.bool_}


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

    def __exit__(self, *_: object) -> None:
        self.close()
        shutil.rmtree(self.plug.folder, ignore_errors=True)

    def observe(
        self,
        setting: Setting,
        values: Mapping[str, Any] | None = None,
        stop: float | None = None,
    ) -> Trajectory:
        """All outputs at every communication point.  Raises SimulationError with the FMU's reason."""
        times = communication_points(stop or self.stop_time, setting.communication)
        names = [v.name for v in self.outputs]
        columns: list[tuple[str, Any]] = [("time", np.float64)]
        columns += [(v.name, KINDS[v.type]) for v in self.outputs]
        result = np.zeros(len(times), dtype=columns)
        result["time"] = times
        try:
            self._begin(setting, values or {}, float(times[-1]))
            for k, t in enumerate(times.tolist()):
                if k:
                    before = float(times[k - 1])
                    self.call("doStep", before, t - before)
                for name, value in self.read(names).items():
                    result[name][k] = value
        except RefusalError as error:
            raise self._failure(setting, error) from None
        return result

    def seconds(self, setting: Setting, names: Sequence[str]) -> float:
        """Wall time [s] of the loop fmi2DoStep, fmi2GetReal of `names`, of a run that is known to succeed."""
        self._begin(setting, {}, self.stop_time)
        times = communication_points(self.stop_time, setting.communication).tolist()
        references = self.references(names)
        do_step, get_real, rows = self.slave.doStep, self.slave.getReal, []
        begun = time.perf_counter()
        for t, later in itertools.pairwise(times):
            do_step(t, later - t)
            rows.append(get_real(references))
        return time.perf_counter() - begun

    def _begin(self, setting: Setting, values: Mapping[str, Any], stop: float) -> None:
        self.begin(setting.values | dict(values), setting.tolerance or None, stop)

    def _failure(self, setting: Setting, error: RefusalError) -> SimulationError:
        """The reason, after the instance was replaced: after fmi2Fatal it must not be used again."""
        self.renew()
        return SimulationError(f"{self.description.modelName}, {setting}: {error.message}")
