"""FMI 2.0 by single calls through ctypes: what fmpy's classes would not let a test do wrong."""

from __future__ import annotations

import ctypes
import zipfile
from collections.abc import Sequence
from ctypes import byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from typing import Any

import fmpy
from single import Caller

from lagfmu.methods import NUMBERS
from lagfmu.testing import host

EXCHANGE, CO_SIMULATION = 0, 1

FUNCTIONS = (
    "GetTypesPlatform",
    "GetVersion",
    "SetDebugLogging",
    "Instantiate",
    "FreeInstance",
    "SetupExperiment",
    "EnterInitializationMode",
    "ExitInitializationMode",
    "Terminate",
    "Reset",
    "GetReal",
    "GetInteger",
    "GetBoolean",
    "GetString",
    "SetReal",
    "SetInteger",
    "SetBoolean",
    "SetString",
    "GetFMUstate",
    "SetFMUstate",
    "FreeFMUstate",
    "SerializedFMUstateSize",
    "SerializeFMUstate",
    "DeSerializeFMUstate",
    "GetDirectionalDerivative",
    "EnterEventMode",
    "NewDiscreteStates",
    "EnterContinuousTimeMode",
    "CompletedIntegratorStep",
    "SetTime",
    "SetContinuousStates",
    "GetDerivatives",
    "GetEventIndicators",
    "GetContinuousStates",
    "GetNominalsOfContinuousStates",
    "SetRealInputDerivatives",
    "GetRealOutputDerivatives",
    "DoStep",
    "CancelStep",
    "GetStatus",
    "GetRealStatus",
    "GetIntegerStatus",
    "GetBooleanStatus",
    "GetStringStatus",
)

LOGGER = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p, c_void_p)
ALLOCATE = ctypes.CFUNCTYPE(c_void_p, c_size_t, c_size_t)
FREE = ctypes.CFUNCTYPE(None, c_void_p)


class Callbacks(ctypes.Structure):
    """fmi2CallbackFunctions."""

    _fields_ = (
        ("logger", LOGGER),
        ("allocate", ALLOCATE),
        ("free", FREE),
        ("finished", c_void_p),
        ("environment", c_void_p),
    )


class EventInfo(ctypes.Structure):
    """fmi2EventInfo."""

    _fields_ = (
        ("needed", c_int),
        ("terminate", c_int),
        ("nominals", c_int),
        ("values", c_int),
        ("defined", c_int),
        ("time", c_double),
    )


class Library:
    """The binary of an FMU, loaded once for any number of instances."""

    def __init__(self, path: Path, folder: Path) -> None:
        self.description = fmpy.read_model_description(str(path), validate=False)
        self.variables = {v.name: v for v in self.description.modelVariables}
        name = self.description.coSimulation.modelIdentifier
        entry = f"binaries/{host().folder}/{name}{host().suffix}"
        with zipfile.ZipFile(path) as archive:
            self.path = Path(archive.extract(entry, folder))
        self.dll = ctypes.CDLL(str(self.path))
        self.dll.fmi2Instantiate.restype = c_void_p
        self.dll.fmi2GetVersion.restype = c_char_p
        self.dll.fmi2GetTypesPlatform.restype = c_char_p
        self.libc = ctypes.CDLL(None)
        self.libc.calloc.restype = c_void_p
        self.libc.calloc.argtypes = (c_size_t, c_size_t)
        self.libc.free.argtypes = (c_void_p,)

    def __call__(self, **options: Any) -> Single:
        return Single(self, **options)

    def continuous(self, **values: float) -> Single:
        """An instance for model exchange in continuous-time mode, the events of its start over."""
        one = self(kind=EXCHANGE).start(values, tolerance=1e-8)
        one.goes_on()
        return one


class Single(Caller):
    """One instance; `log` holds (status, category, message), `blocks` what it has allocated."""

    version = 2

    def __init__(
        self,
        library: Library,
        kind: int = CO_SIMULATION,
        name: bytes | None = b"one",
        guid: bytes | None = None,
        logging: bool = True,
        memory: bool = True,
        half: bool = False,
        room: bool = True,
    ) -> None:
        self.library, self.time = library, 0.0
        super().__init__()
        self.blocks: set[int] = set()
        self.allocations = 0
        self.room = room
        self.callbacks = Callbacks(
            LOGGER(self._logged),
            ALLOCATE(self._allocate) if memory else ALLOCATE(0),
            FREE(self._free) if memory and not half else FREE(0),
        )
        guid = library.description.guid.encode() if guid is None else guid
        self.handle = c_void_p(
            library.dll.fmi2Instantiate(
                name, kind, guid, b"", byref(self.callbacks), 0, int(logging)
            )
        )

    def _logged(self, _: Any, __: bytes, status: int, category: bytes, text: bytes, more: int):
        shown = ctypes.string_at(more) if text == b"%s" else text
        if b"%" in text and text != b"%s":
            self.broken = AssertionError(text)
        self.log.append((status, category.decode(), shown.decode()))

    def _allocate(self, count: int, size: int) -> int | None:
        self.allocations += 1
        block = self.library.libc.calloc(count, size) if self.room else None
        if block:
            self.blocks.add(block)
        return block

    def _free(self, block: int) -> None:
        self.blocks.discard(block)
        self.library.libc.free(block)

    # ------------------------------------------------------------------ whole steps of a life

    def initializing(
        self,
        values: dict[str, float] | None = None,
        tolerance: float = 1e-10,
        stop: float | None = None,
        begin: float = 0.0,
    ) -> Single:
        """Set up, `values` set, and in initialization mode."""
        self.does("SetupExperiment", 1, c_double(tolerance), c_double(begin), *self.stop(stop))
        for name, value in (values or {}).items():
            self.set(name, value)
        self.does("EnterInitializationMode")
        self.time = begin
        return self

    def start(self, *arguments: Any, **named: Any) -> Single:
        """The same, and initialized."""
        self.initializing(*arguments, **named)
        self.does("ExitInitializationMode")
        return self

    @staticmethod
    def stop(stop: float | None) -> tuple[int, c_double]:
        return int(stop is not None), c_double(stop or 0.0)

    def step(self, h: float) -> None:
        self.does("DoStep", c_double(self.time), c_double(h), 1)
        self.time += h

    def events(self) -> EventInfo:
        info = EventInfo()
        self.does("NewDiscreteStates", byref(info))
        return info

    def goes_on(self) -> EventInfo:
        """What an event brings, after which it is in continuous-time mode."""
        info = self.events()
        self.does("EnterContinuousTimeMode")
        return info

    def meets_event(self) -> EventInfo:
        """The same, from continuous-time mode."""
        self.does("EnterEventMode")
        return self.goes_on()

    def asks_for_event(self) -> bool:
        """Whether an event is to be met at the end of an integrator's step."""
        event, end = c_int(), c_int()
        self.does("CompletedIntegratorStep", 1, byref(event), byref(end))
        return bool(event.value)

    def references(self, names: Sequence[str]) -> Any:
        found = [self.library.variables[n].valueReference for n in names]
        return (c_uint * len(found))(*found)

    def reals(self, names: Sequence[str]) -> list[float]:
        values = (c_double * len(names))()
        self.does("GetReal", self.references(names), c_size_t(len(names)), values)
        return list(values)

    def get(self, name: str) -> float:
        return self.reals([name])[0]

    def integer(self, name: str) -> int:
        """Of an Integer or a Boolean."""
        value = c_int()
        kind = self.library.variables[name].type
        self.does(f"Get{kind}", self.references([name]), c_size_t(1), byref(value))
        return value.value

    def set_call(self, name: str, value: float) -> tuple[Any, ...]:
        return self.references([name]), c_size_t(1), byref(c_double(value))

    def method_call(self, name: str, number: int) -> tuple[Any, ...]:
        return self.references([name]), c_size_t(1), (c_int * 1)(number)

    def set(self, name: str, value: float | str) -> None:
        if isinstance(value, str):
            self.does("SetInteger", *self.method_call(name, NUMBERS[value]))
        else:
            self.does("SetReal", *self.set_call(name, value))

    def push(self, name: str, order: int, value: float) -> None:
        """The derivative of an input."""
        which = self.references([name]), c_size_t(1), byref(c_int(order))
        self.does("SetRealInputDerivatives", *which, byref(c_double(value)))

    def outputs(self) -> list[float]:
        """All Real outputs."""
        names = [
            n
            for n, v in self.library.variables.items()
            if v.type == "Real" and v.causality == "output"
        ]
        return self.reals(names)

    def array(self, function: str, size: int) -> list[float]:
        values = (c_double * size)()
        self.does(function, values, c_size_t(size))
        return list(values)

    def states(self, x: Sequence[float]) -> None:
        self.does("SetContinuousStates", (c_double * len(x))(*x), c_size_t(len(x)))

    def saved(self, into: c_void_p | None = None) -> c_void_p:
        state = c_void_p() if into is None else into
        self.does("GetFMUstate", byref(state))
        return state

    def bytes_of(self, state: c_void_p) -> bytes:
        size = c_size_t()
        self.does("SerializedFMUstateSize", state, byref(size))
        buffer = ctypes.create_string_buffer(size.value)
        self.does("SerializeFMUstate", state, buffer, size)
        return buffer.raw

    def takes_over(self, other: Single) -> None:
        """It goes on from where the other is."""
        self.does("SetFMUstate", self.loaded(other.bytes_of(other.saved())))
        self.time = other.time

    def loaded(self, data: bytes) -> c_void_p:
        state = c_void_p()
        self.does("DeSerializeFMUstate", data, c_size_t(len(data)), byref(state))
        return state

    def directional(self, unknown: Sequence[str], known: Sequence[str], seed: Sequence[float]):
        values = (c_double * len(unknown))()
        self.does(
            "GetDirectionalDerivative",
            self.references(unknown),
            c_size_t(len(unknown)),
            self.references(known),
            c_size_t(len(known)),
            (c_double * len(seed))(*seed),
            values,
        )
        return list(values)

    def free(self) -> None:
        self.library.dll.fmi2FreeInstance(self.handle)
        self.handle = c_void_p()

    __del__ = free
