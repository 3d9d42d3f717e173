"""What the engine remembers between two communication points, and how it was told to go.

A step is a function of (state, settings, inputs, parameters) alone: a state that is restored goes on with
the same bits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ..numeric.system import System


@dataclass(frozen=True)
class Settings:
    """Method, relative tolerance, longest step [s] (0: any), how many tiny steps a communication step may
    take (0: any), and the scale of the motion at the start: the size of each coordinate (nq), that of a
    displacement in each speed (nv), that of each speed (nv), and the rate [1/s].
    """

    method: str
    tolerance: float
    maximum_step: float
    maximum_steps: float
    size: tuple[float, ...]
    span: tuple[float, ...]
    swift: tuple[float, ...]
    rate: float


@dataclass(frozen=True)
class Event:
    """The latest of a kind that happened to a contact: how many there were, time [s], and where: the model's
    coordinates and speeds just before; the impulse [lambda times s]."""

    count: int = 0
    time: float = 0.0
    q: tuple[float, ...] = ()
    v: tuple[float, ...] = ()
    impulse: float = 0.0


@dataclass(frozen=True)
class State:
    """Time [s], coordinates (nq), speeds (nv); of each contact: is it closed, latest departure and closing;
    the next step [s] (0: to be found), the latest communication step [s], steps so far, energy lost in
    impacts [J]; of each contact: the farthest that it has been open, and the largest term of its f there."""

    t: float
    q: tuple[float, ...]
    v: tuple[float, ...]
    closed: tuple[bool, ...]
    departures: tuple[Event, ...]
    closings: tuple[Event, ...]
    step: float = 0.0
    span: float = 0.0
    steps: int = 0
    dissipated: float = 0.0
    heights: tuple[float, ...] = ()
    extents: tuple[float, ...] = ()


def restored_settings(kept: dict[str, Any], methods: Sequence[str], system: System) -> Settings:
    """From what asdict made of them.  Raises ValueError, TypeError or KeyError if that is none."""
    size, span = _numbers(kept.pop("size"), system.nq), _numbers(kept.pop("span"), system.nv)
    swift = kept.pop("swift")
    settings = Settings(**kept, size=size, span=span, swift=_numbers(swift, system.nv))
    if settings.method not in methods:
        raise ValueError(f"its method is {settings.method!r}")
    numbers = settings.tolerance, settings.maximum_step, settings.maximum_steps, settings.rate
    if not all(_is_number(x) and x >= 0 for x in numbers) or not 0 < settings.tolerance < 1:
        raise ValueError(f"its settings are {numbers!r}")
    return settings


def restored(system: System, kept: dict[str, Any]) -> State:
    """From what asdict made of it.

    Raises ValueError, TypeError or KeyError if that is none of this system's.
    """
    contacts = len(system.contacts)
    whole = system if system.embedding is None else system.embedding.full
    closed = tuple(kept.pop("closed"))
    if len(closed) != contacts or not all(isinstance(c, bool) for c in closed):
        raise ValueError(f"its contacts are {closed!r}")
    q, v = _numbers(kept.pop("q"), system.nq), _numbers(kept.pop("v"), system.nv)
    departures, closings = (
        tuple(_event(e, whole) for e in kept.pop(what)) for what in ("departures", "closings")
    )
    if not len(departures) == len(closings) == contacts:
        raise ValueError("it has other contacts")
    heights, extents = (_numbers(kept.pop(x), contacts) for x in ("heights", "extents"))
    state = State(
        q=q,
        v=v,
        closed=closed,
        departures=departures,
        closings=closings,
        heights=heights,
        extents=extents,
        **kept,
    )
    if not _is_count(state.steps) or not all(
        _is_number(x) for x in (state.t, state.step, state.span, state.dissipated)
    ):
        raise ValueError("its time or its steps are no numbers")
    if state.step < 0 or state.span < 0:
        raise ValueError(f"its steps are {state.step!r} s and {state.span!r} s")
    return state


def _event(kept: dict[str, Any], system: System) -> Event:
    nq, nv = (system.nq, system.nv) if kept["count"] else (0, 0)
    event = Event(**kept | {"q": _numbers(kept["q"], nq), "v": _numbers(kept["v"], nv)})
    if not (_is_count(event.count) and _is_number(event.time) and _is_number(event.impulse)):
        raise ValueError(f"one of its events is {kept!r}")
    return event


def _numbers(kept: Any, n: int) -> tuple[float, ...]:
    if not isinstance(kept, (list, tuple)) or len(kept) != n or not all(map(_is_number, kept)):
        raise ValueError(f"{kept!r} are not {n} numbers")
    return tuple(float(x) for x in kept)


def _is_number(x: Any) -> bool:
    return isinstance(x, (int, float)) and not isinstance(x, bool) and math.isfinite(x)


def _is_count(x: Any) -> bool:
    return isinstance(x, int) and not isinstance(x, bool) and 0 <= x < 2**53
