"""One instance of an FMU by names, through fmpy's FMU2Slave; what is refused keeps its message."""

from __future__ import annotations

import ctypes
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from fmpy.logging import addLoggerProxy

from ...methods import NUMBERS
from ...verification.simulate import Trajectory
from .facts import Facts

KINDS: dict[str, Any] = {"Real": np.float64, "Integer": np.int32, "Boolean": np.bool_}
STATUS = ("OK", "warning", "discard", "error", "fatal", "pending")
MESSAGES: list[str] = []  # of one call: fmpy's proxy of the logger knows one logger a process
Values = Mapping[str, float | str]
Drive = Callable[[float], Mapping[str, float]]  # time [s] -> inputs that hold until the next point


def _log(_: Any, __: bytes, status: int, category: bytes, message: bytes) -> None:
    if status >= 2:
        MESSAGES.append(message.decode(errors="replace").strip())


LOGGER = fmi2CallbackLoggerTYPE(_log)  # kept for ever: fmpy's proxy goes on pointing to it


class RefusalError(Exception):
    """A call that did not return fmi2OK: which, its status, the messages in the log."""

    def __init__(self, call: str, status: int, message: str) -> None:
        super().__init__(f"{call}: {STATUS[status]}: {message}")
        self.call, self.status, self.message = call, status, message

    @property
    def clear(self) -> bool:
        """True for discard and error (fatal from pythonfmu) with a message that names a cause."""
        vague = r"internal error|traceback|assert|unknown error|no message|\w+Error\(|<class"
        told = len(self.message) >= 15 and not re.search(vague, self.message, re.IGNORECASE)
        return self.status in (2, 3, 4) and told


@dataclass(frozen=True)
class Run:
    """Outputs and inputs at the communication points that were reached, and what ended it early."""

    rows: Trajectory
    values: Mapping[str, float]
    tolerance: float
    refusal: RefusalError | None
    driven: bool = False


class Player:
    """An instance; free it with close()."""

    def __init__(self, facts: Facts, folder: Path, name: str = "stress") -> None:
        self.facts, self.folder, self.name = facts, folder, name
        self.time, self.used = 0.0, False
        self.slave: Any = None
        self.groups = [
            (kind, [v.name for v in facts.outputs if v.type == kind])
            for kind in KINDS
            if any(v.type == kind for v in facts.outputs)
        ]
        self._open()

    def _open(self) -> None:
        callbacks = fmi2CallbackFunctions()
        callbacks.logger = LOGGER
        callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(fmpy.free)
        addLoggerProxy(ctypes.byref(callbacks))
        self.slave = FMU2Slave(
            instanceName=self.name,
            guid=self.facts.description.guid,
            modelIdentifier=self.facts.description.coSimulation.modelIdentifier,
            unzipDirectory=str(self.folder),
        )
        self.call("instantiate", callbacks=callbacks, loggingOn=True)
        self.used = False

    def close(self) -> None:
        """Free the instance."""
        if self.slave is not None and self.slave.component is not None:
            self.slave.freeInstance()
        self.slave = None

    def renew(self) -> None:
        """Another instance in place of one that refused a call."""
        self.close()
        self._open()

    def call(self, name: str, *arguments: Any, **named: Any) -> Any:
        """A method of FMU2Slave.  Raises RefusalError unless the status is OK or a warning."""
        MESSAGES.clear()
        try:
            return getattr(self.slave, name)(*arguments, **named)
        except FMICallException as error:
            text = " ".join("; ".join(MESSAGES).split()) or "no message"
            raised = re.search(r"""Refused\((["'])(.*)\1\)""", text)  # as pythonfmu tells it
            raise RefusalError(name, error.status, raised[2] if raised else text) from None

    def references(self, names: Sequence[str]) -> list[int]:
        """Value references."""
        return [self.facts.variables[n].valueReference for n in names]

    def set(self, values: Values) -> None:
        """Set variables: Reals, and methods by name; an unknown name goes in as an unknown number."""
        methods = {
            n: NUMBERS.get(v, 1 + max(NUMBERS.values()))
            for n, v in values.items()
            if isinstance(v, str)
        }
        reals = {n: float(v) for n, v in values.items() if not isinstance(v, str)}
        if methods:
            self.call("setInteger", self.references(list(methods)), list(methods.values()))
        if reals:
            self.call("setReal", self.references(list(reals)), list(reals.values()))

    def begin(self, values: Values, tolerance: float | None, stop: float | None = None) -> None:
        """Reset if it was used; set up, initialize."""
        if self.used:
            self.call("reset")
        self.used, self.time = True, 0.0
        self.call("setupExperiment", tolerance=tolerance, startTime=0.0, stopTime=stop)
        self.set(values)
        self.call("enterInitializationMode")
        self.call("exitInitializationMode")

    def step(self, size: float) -> None:
        """fmi2DoStep from where it stands."""
        self.call("doStep", self.time, size)
        self.time += size

    def read(self) -> dict[str, Any]:
        """All outputs."""
        found: dict[str, Any] = {}
        for kind, names in self.groups:
            found |= dict(zip(names, self.call(f"get{kind}", self.references(names)), strict=True))
        return found

    def inputs(self) -> dict[str, float]:
        """All inputs, as they stand."""
        names = [i.name for i in self.facts.inputs]
        return dict(zip(names, self.call("getReal", self.references(names)), strict=True))

    def save(self) -> Any:
        """fmi2GetFMUstate."""
        return self.call("getFMUstate")

    def restore(self, state: Any, time: float) -> None:
        """fmi2SetFMUstate; the instance stands at `time` again."""
        self.call("setFMUstate", state)
        self.time = time


def table(facts: Facts, count: int) -> Trajectory:
    """An empty table: time, outputs, inputs."""
    columns: list[tuple[str, Any]] = [("time", np.float64)]
    columns += [(v.name, KINDS[v.type]) for v in facts.outputs]
    columns += [(i.name, np.float64) for i in facts.inputs]
    return np.zeros(count, dtype=columns)


def play(
    player: Player,
    values: Values,
    times: Sequence[float],
    tolerance: float | None = None,
    drive: Drive | None = None,
    stop: float | None = None,
) -> Run:
    """A run over the communication points `times` (from 0), or as far as the FMU goes."""
    facts = player.facts
    rows = table(facts, len(times))
    known = {s.name: s.start for s in (*facts.parameters, *facts.inputs, *facts.starts)}
    known |= {n: float(v) for n, v in values.items() if not isinstance(v, str)}
    fed = {i.name: known[i.name] for i in facts.inputs}
    reached, refusal = 0, None
    try:
        player.begin(values, tolerance, stop)
        for k, t in enumerate(times):
            if k:
                player.step(t - player.time)
            if drive is not None:
                given = dict(drive(t))
                player.set(given)
                fed = (player.inputs() if len(given) < len(fed) else {}) | given
            elif fed:  # a prescribed motion may move by itself
                fed = player.inputs()
            rows[k]["time"] = t
            for name, value in (player.read() | fed).items():
                rows[name][k] = value
            reached = k + 1
    except RefusalError as error:
        refusal = error
        player.renew()
    used = float(known.get("solver.tolerance") or 0) or tolerance or facts.tolerance
    return Run(rows[:reached], known, used, refusal, drive is not None)
