"""Everything that a simulation remembers between two communication points, and nothing else.

A State is a value: saving it is keeping it, rolling back is putting it back, bit for bit.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field, fields

from ..numeric.tolerance import DEFAULT_TOLERANCE, MAXIMUM_STEPS
from .stiffness import Choice


@dataclass(frozen=True)
class Settings:
    """How to step: the method, the relative tolerance, the step [s] of rk4, the largest step [s], and how
    many steps shorter than 1e-6 of the natural time a communication step may take (0: no limit)."""

    method: str = "auto"
    tolerance: float = DEFAULT_TOLERANCE
    step: float = 0.0
    maximum_step: float = 0.0
    maximum_steps: float = MAXIMUM_STEPS


@dataclass(frozen=True)
class Departure:
    """The latest opening of a contact: its time [s], the state then, and how many there were."""

    count: int
    time: float
    q: tuple[float, ...]
    v: tuple[float, ...]


@dataclass(frozen=True)
class Slide:
    """How a friction stands: it sticks, or slips.

    `sign` is that of the multipliers' sum N, so that the normal force is sign * N; `direction` the unit
    vector of the slip velocity, where that is zero or was last known; slip velocities up to `noise` [m/s]
    are rounding.
    """

    sticks: bool = False
    sign: float = 1.0
    direction: tuple[float, float] = (1.0, 0.0)
    noise: float = 0.0


Local = tuple[float, float, float, float]
NO_LOCAL: Local = (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class State:
    """Time, motion, contact modes, step-size memory.

    q, v (n); closed, armed, departures: one entry a contact; offset (m): the level f = offset that a
    constraint keeps which came back with its contact; scale (2 n): the magnitudes below which errors
    in q and v are measured absolutely; size (n): the coordinates' magnitudes, for rounding; gap: |f|
    below which a contact touches; step [s]: the next step to try; span [s]: the communication step that
    led to t (0: none); rate [1/s]: the motion's
    natural rate at the start; choice: what `auto` remembers; levels: those of jumps (jumps.py);
    slides, slippings: one entry a friction, how it stands and its latest start of slipping; dissipated
    [J]: by frictions and impacts so far; strikes: contacts that were struck so far;
    hits, hit_times [s], impulses [of lambda times s]: one entry a contact, how often, when last, how hard;
    local: with error bars, of the local errors of explicit and of implicit steps the sums, then the largest
    of each (bars.py).
    """

    t: float
    q: tuple[float, ...]
    v: tuple[float, ...]
    closed: tuple[bool, ...]
    armed: tuple[bool, ...]
    offset: tuple[float, ...]
    scale: tuple[float, ...]
    size: tuple[float, ...]
    gap: tuple[float, ...]
    rate: float
    step: float
    span: float
    steps: int
    departures: tuple[Departure, ...]
    choice: Choice = field(default_factory=Choice)
    slides: tuple[Slide, ...] = ()
    slippings: tuple[Departure, ...] = ()
    dissipated: float = 0.0
    strikes: int = 0
    hits: tuple[int, ...] = ()
    hit_times: tuple[float, ...] = ()
    impulses: tuple[float, ...] = ()
    local: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    levels: tuple[float, ...] = ()

    def to_json(self) -> str:
        """Text that `from_json` turns into an equal state; floats keep every bit."""
        return json.dumps(asdict(self))

    @staticmethod
    def from_json(text: str) -> State:
        """The state written by `to_json`."""
        raw = json.loads(text)
        for f in fields(State):
            if isinstance(raw[f.name], list):
                raw[f.name] = tuple(raw[f.name])
        for name in ("departures", "slippings"):
            raw[name] = tuple(
                Departure(d["count"], d["time"], tuple(d["q"]), tuple(d["v"])) for d in raw[name]
            )
        raw["slides"] = tuple(
            Slide(x["sticks"], x["sign"], tuple(x["direction"]), x["noise"]) for x in raw["slides"]
        )
        raw["choice"] = Choice(**raw["choice"])
        return State(**raw)
