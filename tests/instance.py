"""A bare FMI 2.0 instance for tests that need single calls instead of a whole simulation."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import fmpy
from fmpy.fmi2 import FMU2Slave
from runs import unpacked

from lagfmu.testing import described_rules


class Instance:
    """An FMU by names: `get`, `set`, `step`; `log` holds (status, category, message)."""

    def __init__(self, path: Path | str, name: str = "instance") -> None:
        folder, self.description = unpacked(path)
        self.variables = {v.name: v for v in self.description.modelVariables}
        self.rules = described_rules(self.description)
        self.native = self.description.modelExchange is not None
        self.refusal = 3 if self.native else 4  # pythonfmu cannot return fmi2Error, only fmi2Fatal
        self.illegal_step = 3 if self.native else 2  # nor from fmi2DoStep: fmi2Discard
        self.log: list[tuple[int, str, str]] = []
        self.fmu = FMU2Slave(
            guid=self.description.guid,
            unzipDirectory=folder,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        callbacks = fmpy.fmi2.fmi2CallbackFunctions()
        callbacks.logger = fmpy.fmi2.fmi2CallbackLoggerTYPE(self._logged)
        callbacks.allocateMemory = fmpy.fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        callbacks.freeMemory = fmpy.fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
        self.callbacks = callbacks
        self.fmu.instantiate(callbacks=callbacks, loggingOn=True)
        self.time = 0.0

    def _logged(self, _: Any, __: bytes, status: int, category: bytes, message: bytes) -> None:
        self.log.append((status, (category or b"").decode(), message.decode()))

    def start(
        self,
        values: Mapping[str, Any] | None = None,
        tolerance: float | None = None,
        stop_time: float | None = None,
        start_time: float = 0.0,
    ) -> Instance:
        self.fmu.setupExperiment(tolerance=tolerance, startTime=start_time, stopTime=stop_time)
        self.time = start_time
        self.fmu.enterInitializationMode()
        for name, value in (values or {}).items():
            self.set(name, value)
        self.fmu.exitInitializationMode()
        return self

    def set(self, name: str, value: Any) -> None:
        v = self.variables[name]
        if v.type == "Enumeration":
            self.fmu.setInteger([v.valueReference], [self.rules[name].number(value)])
        else:
            self.fmu.setReal([v.valueReference], [value])

    def get(self, name: str) -> Any:
        v = self.variables[name]
        kind = "Integer" if v.type == "Enumeration" else v.type
        getter = getattr(self.fmu, f"get{kind}")
        return getter([v.valueReference])[0]

    def outputs(self) -> dict[str, Any]:
        return {n: self.get(n) for n, v in self.variables.items() if v.causality == "output"}

    def step(self, size: float) -> None:
        self.fmu.doStep(currentCommunicationPoint=self.time, communicationStepSize=size)
        self.time += size

    def repeated(self, size: float, count: int) -> dict[str, Any]:
        """What it tells some steps later: the same bits from where it is and from its state as bytes."""
        data, now, ends = self.fmu.serializeFMUState(self.fmu.getFMUState()), self.time, []
        for _ in range(2):
            for _ in range(count):
                self.step(size)
            ends.append(self.outputs())
            self.fmu.setFMUState(self.fmu.deSerializeFMUstate(data))
            self.time = now
        assert ends[0] == ends[1]
        return ends[0]

    def free(self) -> None:
        with contextlib.suppress(Exception):
            self.fmu.terminate()
        self.fmu.freeInstance()


@contextlib.contextmanager
def instance(path: Path | str, name: str = "instance") -> Iterator[Instance]:
    """An instance that is freed at the end."""
    one = Instance(path, name)
    try:
        yield one
    finally:
        one.free()
