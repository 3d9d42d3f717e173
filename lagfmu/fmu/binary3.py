"""The library of an FMU of FMI 3.0, called as fmpy's FMU2Slave is: a session knows its names alone.

Without event mode a communication step does what it does in FMI 2.0.  An FMU with clocks cannot do without:
then the events at the end of a step are gone through here, and what is read is what holds after them.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from typing import Any

from fmpy.fmi3 import FMU3Slave, fmi3Boolean, fmi3Float64

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
