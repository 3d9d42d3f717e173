"""One instance under probes: the session (fmu/session.py) with the facts of the FMU, its time, and runs
that keep what ended them."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ... import names
from ...fmu.described import Trajectory
from ...fmu.session import RefusalError, Session, plug
from .facts import Facts

KINDS: dict[str, Any] = {"Real": np.float64, "Integer": np.int32, "Boolean": np.bool_}
VAGUE = r"internal error|traceback|assert|unknown error|no message|\w+Error\(|<class"
Values = Mapping[str, float | str]
Drive = Callable[[float], Mapping[str, float]]  # time [s] -> inputs that hold until the next point


def clear(refusal: RefusalError) -> bool:
    """True for discard and error (fatal from pythonfmu) with a message that names a cause."""
    told = len(refusal.message) >= 15 and not re.search(VAGUE, refusal.message, re.IGNORECASE)
    return refusal.status in (2, 3, 4) and told


@dataclass(frozen=True)
class Run:
    """Outputs and inputs at the communication points that were reached, and what ended it early."""

    rows: Trajectory
    values: Mapping[str, float]
    tolerance: float
    refusal: RefusalError | None
    driven: bool = False


class Player(Session):
    """An instance that knows the FMU's variables and where it stands; free it with close()."""

    def __init__(self, facts: Facts, folder: Path, name: str = "stress") -> None:
        self.facts, self.time = facts, 0.0
        self.outputs = [v.name for v in facts.outputs]
        super().__init__(plug(facts.path, facts.description, str(folder)), name)

    def prepare(
        self, values: Values, tolerance: float | None, stop: float | None = None, start: float = 0.0
    ) -> None:
        """As a session does; it stands at the start."""
        self.time = start
        super().prepare(values, tolerance, stop, start)

    def step(self, size: float) -> None:
        """fmi2DoStep from where it stands."""
        self.call("doStep", self.time, size)
        self.time += size

    def read(self, names: Sequence[str] | None = None) -> dict[str, Any]:
        """Values of variables; of all outputs without names."""
        return super().read(self.outputs if names is None else names)

    def inputs(self) -> dict[str, float]:
        """All inputs, as they stand."""
        return self.read([i.name for i in self.facts.inputs])

    def save(self) -> Any:
        """fmi2GetFMUstate."""
        return self.call("getFMUstate")

    def restore(self, state: Any, time: float) -> None:
        """fmi2SetFMUstate; the instance stands at `time` again."""
        self.call("setFMUstate", state)
        self.time = time

    def hand(self, other: Player, state: Any = None, time: float | None = None) -> None:
        """By the bytes of a state, else of the present one, the other goes on from there."""
        kept = self.save() if state is None else state
        data = self.call("serializeFMUstate", kept)
        if state is None:
            self.call("freeFMUstate", kept)
        taken = other.call("deSerializeFMUstate", data)
        other.restore(taken, self.time if time is None else time)
        other.call("freeFMUstate", taken)


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
    late: bool = False,
) -> Run:
    """A run over the communication points `times` (from 0), or as far as the FMU goes; `late`: inputs are set
    when all has been read."""
    facts = player.facts
    rows = table(facts, len(times))
    known = {s.name: s.start for s in (*facts.parameters, *facts.inputs, *facts.starts)}
    known |= {n: float(v) for n, v in values.items() if not isinstance(v, str)}
    fed = {i.name: known[i.name] for i in facts.inputs}
    reached, refusal = 0, None
    try:
        player.begin(values, tolerance)
        for k, t in enumerate(times):
            if k:
                player.step(t - player.time)
            if drive is not None and not late:
                given = dict(drive(t))
                player.give(given)
                fed = (player.inputs() if len(given) < len(fed) else {}) | given
            elif fed:  # a prescribed motion may move by itself
                fed = player.inputs()
            rows[k]["time"] = t
            for name, value in (player.read() | fed).items():
                rows[name][k] = value
            if late and drive is not None:
                player.give(dict(drive(t)))
            reached = k + 1
    except RefusalError as error:
        refusal = error
        player.renew()
    used = float(known.get(names.TOLERANCE) or 0) or tolerance or facts.tolerance
    return Run(rows[:reached], known, used, refusal, drive is not None)
