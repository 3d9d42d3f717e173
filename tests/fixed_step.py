"""An importer that takes fixed steps in model exchange and sees events at their ends alone: neither does it
search for the time of an indicator's change of sign, nor does it take a step back."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from ctypes import byref, c_double, c_int, c_size_t
from dataclasses import dataclass
from typing import Any

from fmi2 import EXCHANGE, EventInfo, Library, Single

Inputs = Callable[[float], dict[str, float]]


@dataclass(frozen=True)
class Ended:
    """Values at the end of a run, and how many events there were in it."""

    values: dict[str, float]
    events: int

    def __getitem__(self, name: str) -> float:
        return self.values[name]


class _Stepper:
    def __init__(self, one: Single, inputs: Inputs | None) -> None:
        self.one, self.inputs = one, inputs
        self.n = 0
        for name in one.library.variables.values():
            self.n += name.derivative is not None
        described = one.library.description
        self.indicators = described.numberOfEventIndicators
        self.x, self.dx = (c_double * self.n)(), (c_double * self.n)()
        self.z = (c_double * self.indicators)()

    def read(self) -> list[float]:
        self.one.does("GetContinuousStates", self.x, c_size_t(self.n))
        return list(self.x)

    def put(self, time: float, x: Sequence[float]) -> None:
        self.one.does("SetTime", c_double(time))
        self.x[:] = x
        self.one.does("SetContinuousStates", self.x, c_size_t(self.n))
        for name, value in (self.inputs(time) if self.inputs else {}).items():
            self.one.set(name, value)

    def rate(self, time: float, x: Sequence[float]) -> list[float]:
        self.put(time, x)
        self.one.does("GetDerivatives", self.dx, c_size_t(self.n))
        return list(self.dx)

    def signs(self) -> list[bool]:
        self.one.does("GetEventIndicators", self.z, c_size_t(self.indicators))
        return [z > 0 for z in self.z]


def _along(x: Sequence[float], h: float, dx: Sequence[float]) -> list[float]:
    return [a + h * b for a, b in zip(x, dx, strict=True)]


def euler(s: Any, t: float, x: Sequence[float], h: float) -> list[float]:
    return _along(x, h, s.rate(t, x))


def rk4(s: Any, t: float, x: Sequence[float], h: float) -> list[float]:
    a = s.rate(t, x)
    b = s.rate(t + h / 2, _along(x, h / 2, a))
    c = s.rate(t + h / 2, _along(x, h / 2, b))
    d = s.rate(t + h, _along(x, h, c))
    return _along(x, h / 6, [p + 2 * q + 2 * r + w for p, q, r, w in zip(a, b, c, d, strict=True)])


def run(
    library: Library,
    method: Callable[..., list[float]],
    steps: int,
    stop: float,
    read: Sequence[str],
    start: dict[str, float] | None = None,
    inputs: Inputs | None = None,
    look: Callable[[float, Single], None] | None = None,
    tolerance: float = 1e-8,
) -> Ended:
    """From 0 to `stop` [s] in so many equal steps."""
    one = library(kind=EXCHANGE)
    one.does("SetupExperiment", 1, c_double(tolerance), c_double(0), 0, c_double(0))
    for name, value in (start or {}).items():
        one.set(name, value)
    for name, value in (inputs(0.0) if inputs else {}).items():
        one.set(name, value)
    one.does("EnterInitializationMode")
    one.does("ExitInitializationMode")
    stepper, info = _Stepper(one, inputs), EventInfo()
    event, end, events = c_int(), c_int(), 0
    one.does("NewDiscreteStates", byref(info))
    one.does("EnterContinuousTimeMode")
    signs, x = stepper.signs(), stepper.read()
    for k in range(steps):
        t, after = stop * k / steps, stop * (k + 1) / steps
        x = method(stepper, t, x, after - t)
        stepper.put(after, x)
        one.does("CompletedIntegratorStep", 1, byref(event), byref(end))
        now = stepper.signs()
        if event.value or now != signs:
            events += 1
            one.does("EnterEventMode")
            one.does("NewDiscreteStates", byref(info))
            one.does("EnterContinuousTimeMode")
            if info.values:
                x = stepper.read()
            now = stepper.signs()
        signs = now
        if look is not None:
            look(after, one)
    variables = library.variables
    values = {}
    for name in read:
        values[name] = one.get(name) if variables[name].type == "Real" else one.integer(name)
    one.free()
    return Ended(values, events)
