"""FMI 3.0 by single calls through ctypes: what fmpy's classes would not let a test do wrong."""

from __future__ import annotations

import ctypes
import zipfile
from collections.abc import Callable, Sequence
from ctypes import (
    byref,
    c_bool,
    c_char_p,
    c_double,
    c_int,
    c_int32,
    c_int64,
    c_size_t,
    c_uint32,
    c_void_p,
)
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fmpy
from single import OK, Caller

from lagfmu.methods import NUMBERS
from lagfmu.testing import host

LOGGER = ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)
POINTER = ctypes.POINTER
FLAGS = (c_bool, c_bool, c_bool, c_bool)
UPDATE = ctypes.CFUNCTYPE(None, c_void_p, c_double, *FLAGS, POINTER(c_bool), POINTER(c_double))
STORED = {
    "Float64": c_double,
    "Int32": c_int32,
    "Int64": c_int64,
    "Enumeration": c_int64,
    "Boolean": c_bool,
}
# what an importer does within a step: at a time, asked for inputs or not, with or without a way to return
# early; the time at which it wants the step to end
Between = Callable[["Single", float, bool, bool], "float | None"]


@dataclass(frozen=True)
class Step:
    """What fmi3DoStep answers."""

    status: int
    event: bool
    terminate: bool
    early: bool
    time: float


class Library:
    """The binary of an FMU, loaded once for any number of instances."""

    def __init__(self, path: Path, folder: Path) -> None:
        self.description = fmpy.read_model_description(str(path), validate=False)
        self.variables = {v.name: v for v in self.description.modelVariables}
        with zipfile.ZipFile(path) as archive:
            (entry,) = (
                n
                for n in archive.namelist()
                if n.startswith("binaries/") and n.endswith(host().suffix)
            )
            self.path = Path(archive.extract(entry, folder))
        self.dll = ctypes.CDLL(str(self.path))
        for kind in ("ModelExchange", "CoSimulation", "ScheduledExecution"):
            getattr(self.dll, f"fmi3Instantiate{kind}").restype = c_void_p
        self.dll.fmi3GetVersion.restype = c_char_p

    def __call__(self, **options: Any) -> Single:
        return Single(self, **options)


class Single(Caller):
    """One instance; `log` holds (status, category, message)."""

    version = 3

    def __init__(
        self,
        library: Library,
        exchange: bool = False,
        events: bool = False,
        early: bool = False,
        between: Between | None = None,
        named: Sequence[str] = (),
        token: str | None = None,
        name: bytes = b"one",
    ) -> None:
        self.library, self.time, self.between = library, 0.0, between
        super().__init__()
        self.logger, self.update = LOGGER(self._logged), UPDATE(self._updated)
        token = library.description.instantiationToken if token is None else token
        common = name, token.encode(), None, c_bool(False), c_bool(True)
        if exchange:
            made = library.dll.fmi3InstantiateModelExchange(*common, None, self.logger)
        else:
            made = library.dll.fmi3InstantiateCoSimulation(
                *(*common, c_bool(events), c_bool(early)),
                *(self.references(named), c_size_t(len(named)), None, self.logger),
                self.update if between else UPDATE(0),
            )
        self.handle = c_void_p(made)

    def _logged(self, _: Any, status: int, category: bytes, text: bytes) -> None:
        self.log.append((status, category.decode(), text.decode()))

    def _updated(self, _, time, asked, readable, finished, returns, requested, when) -> None:
        try:
            assert asked != readable
            assert readable == finished
            end = self.between(self, time, asked, returns)
        except BaseException as error:
            self.broken, end = self.broken or error, None
        if end is not None:
            requested[0], when[0] = True, end

    # ------------------------------------------------------------------ whole steps of a life

    def initializing(
        self,
        values: dict[str, float] | None = None,
        tolerance: float = 1e-10,
        stop: float | None = None,
    ) -> Single:
        """`values` set, and in Initialization Mode."""
        for name, value in (values or {}).items():
            self.set(name, value)
        end = c_bool(stop is not None), c_double(stop or 0.0)
        self.does("EnterInitializationMode", c_bool(True), c_double(tolerance), c_double(0), *end)
        return self

    def start(self, *arguments: Any, **named: Any) -> Single:
        """The same, and initialized; of co-simulation in Step Mode."""
        self.initializing(*arguments, **named)
        self.does("ExitInitializationMode")
        return self

    def step(self, h: float, status: int = OK) -> Step:
        """One communication step from where it stands."""
        flags = [c_bool() for _ in range(3)]
        time = c_double()
        told = [byref(f) for f in flags]
        found = self.call(
            "DoStep", c_double(self.time), c_double(h), c_bool(True), *told, byref(time)
        )
        assert found == status, self.log[-1:]
        self.time = time.value
        return Step(found, *(f.value for f in flags), time.value)

    def updates(self) -> tuple[bool, bool]:
        """fmi3UpdateDiscreteStates: whether another instant is to follow, and states have changed; `nominals`
        whether these have."""
        flags, time = [c_bool(True) for _ in range(5)], c_double()
        self.does("UpdateDiscreteStates", *(byref(f) for f in flags), byref(time))
        again, terminate, self.nominals, values, defined = (f.value for f in flags)
        assert (terminate, defined) == (False, False)
        return again, values

    def meets_event(self) -> None:
        """Through event mode, and back to Step Mode."""
        self.does("EnterEventMode")
        while self.updates()[0]:
            pass
        self.does("EnterStepMode")

    # ------------------------------------------------------------------ values

    def references(self, names: Sequence[str]) -> Any:
        found = [self.library.variables[n].valueReference for n in names]
        return (c_uint32 * max(len(found), 1))(*found)

    def get_call(self, name: str) -> tuple[str, tuple[Any, ...], Any]:
        """The getter, its arguments and where the value is to stand."""
        kind = self.library.variables[name].type
        if kind == "Clock":
            value = c_bool()
            return "GetClock", (self.references([name]), c_size_t(1), byref(value)), value
        value = STORED[kind]()
        kind = "Int64" if kind == "Enumeration" else kind
        return (
            f"Get{kind}",
            (self.references([name]), c_size_t(1), byref(value), c_size_t(1)),
            value,
        )

    def get(self, name: str) -> Any:
        function, arguments, value = self.get_call(name)
        self.does(function, *arguments)
        return value.value

    def floats(self, names: Sequence[str]) -> list[float]:
        values = (c_double * max(len(names), 1))()
        count = c_size_t(len(names))
        self.does("GetFloat64", self.references(names), count, values, count)
        return list(values)[: len(names)]

    def set_call(self, name: str, value: float | str) -> tuple[str, tuple[Any, ...]]:
        kind = "Int64" if isinstance(value, str) else self.library.variables[name].type
        kind = "Int64" if kind == "Enumeration" else kind
        stored = STORED[kind](NUMBERS[value] if isinstance(value, str) else value)
        return f"Set{kind}", (self.references([name]), c_size_t(1), byref(stored), c_size_t(1))

    def set(self, name: str, value: float | str) -> None:
        function, arguments = self.set_call(name, value)
        self.does(function, *arguments)

    def of(self, **wanted: str) -> list[str]:
        """Names of the Float64 variables with these attributes."""
        return [
            n
            for n, v in self.library.variables.items()
            if v.type == "Float64" and all(getattr(v, k) == a for k, a in wanted.items())
        ]

    def outputs(self) -> list[float]:
        """All Float64 outputs."""
        return self.floats(self.of(causality="output"))

    def array(self, function: str, size: int) -> list[float]:
        values = (c_double * max(size, 1))()
        self.does(function, values, c_size_t(size))
        return list(values)[:size]

    # ------------------------------------------------------------------ saved states, derivatives

    def saved(self) -> c_void_p:
        state = c_void_p()
        self.does("GetFMUState", byref(state))
        return state

    def bytes_of(self, state: c_void_p) -> bytes:
        size = c_size_t()
        self.does("SerializedFMUStateSize", state, byref(size))
        buffer = ctypes.create_string_buffer(size.value)
        self.does("SerializeFMUState", state, buffer, size)
        return buffer.raw

    def derive(
        self, function: str, unknowns: Sequence[str], knowns: Sequence[str], seed: Sequence[float]
    ) -> list[float]:
        """fmi3GetDirectionalDerivative, with a seed of the knowns, or fmi3GetAdjointDerivative, of the
        unknowns."""
        size = len(unknowns) if function == "GetDirectionalDerivative" else len(knowns)
        found = (c_double * size)()
        sides = ((self.references(names), c_size_t(len(names))) for names in (unknowns, knowns))
        given = (c_double * len(seed))(*seed), c_size_t(len(seed))
        self.does(function, *(a for side in sides for a in side), *given, found, c_size_t(size))
        return list(found)

    def free(self) -> None:
        self.library.dll.fmi3FreeInstance(self.handle)
        self.handle = c_void_p()

    __del__ = free
