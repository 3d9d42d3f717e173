"""What is read from a saved state is a state that this system can be in, or it is refused.

Bytes come from a file, or from anyone; a check sum tells altered bytes, not forged ones.  So each value has
the type that its field says, numbers are finite (unless they may be infinite), counts are not negative, and
there is one for each coordinate, row or contact.
"""

from __future__ import annotations

import json
import math
from dataclasses import fields
from typing import Any

from ..numeric.system import System
from ..numeric.tolerance import tolerance_problem
from .state import Departure, Settings, Slide, State
from .stiffness import LATEST, MOST, Choice

MOST_COUNTED = 2**53
POSITIVE = (
    *("scale", "size", "gap", "rate", "step", "span", "longest", "product", "ratio", "noise"),
    "local",
)
UNBOUNDED = ("step", "rate", "longest", "product", "ratio", "span")  # may be infinite
MOST_OF = {"failures": MOST, "retries": LATEST}


def restored(system: System, text: Any) -> State:
    """The state that a text says.  Raises ValueError with what is not one of this system's."""
    try:
        raw = json.loads(text)
    except (TypeError, RecursionError) as error:
        raise ValueError(str(error)) from None
    _fields(State, raw)
    n, contacts = system.n, len(system.contacts)
    lengths = {"q": n, "v": n, "size": n, "scale": 2 * n, "offset": system.m}
    lengths |= dict.fromkeys(("closed", "armed", "gap", "departures"), contacts)
    lengths |= dict.fromkeys(("hits", "hit_times", "impulses"), contacts)
    lengths |= {"levels": len(system.floors), "local": 4}
    lengths |= dict.fromkeys(("slides", "slippings"), len(system.frictions))
    for name, length in lengths.items():
        if len(raw[name]) != length:
            raise ValueError(f"its {name} has {len(raw[name])} values, expected {length}")
    for slide in raw["slides"]:
        if len(slide["direction"]) != 2:
            raise ValueError("its slides have other directions")
    for departure in (*raw["departures"], *raw["slippings"]):
        if not len(departure["q"]) == len(departure["v"]) == n:
            raise ValueError("its departures have other coordinates")
    return State.from_json(json.dumps(raw))


def restored_settings(raw: Any, methods: Any) -> Settings:
    """The settings that were saved.  Raises ValueError with what cannot be one."""
    _fields(Settings, raw)
    if raw["method"] not in methods:
        raise ValueError(f"its method is {raw['method']!r}")
    for f in fields(Settings):
        if f.type == "float" and not 0 <= raw[f.name] < math.inf:
            raise ValueError(f"its {f.name} is {raw[f.name]!r}")
    if problem := tolerance_problem(raw["tolerance"]):
        raise ValueError(f"its {problem}")
    return Settings(**raw)


def _fields(kind: type, raw: Any) -> None:
    """`raw` has the fields of the dataclass, each of its type.  Raises ValueError."""
    if not isinstance(raw, dict) or set(raw) != {f.name for f in fields(kind)}:
        raise ValueError(f"it holds no {kind.__name__}")
    for f in fields(kind):
        _value(f.name, str(f.type), raw[f.name])


def _value(name: str, kind: str, value: Any) -> None:
    parts = {"Departure": Departure, "Choice": Choice, "Slide": Slide}
    if kind in parts:
        _fields(parts[kind], value)
    elif kind.startswith("tuple["):
        if not isinstance(value, list):
            raise ValueError(f"its {name} is {value!r}, expected a list")
        for one in value:
            _value(name, kind[len("tuple[") :].split(",")[0], one)
    elif not _is(name, kind, value):
        raise ValueError(f"its {name} is {value!r}")


def _is(name: str, kind: str, value: Any) -> bool:
    if kind in ("bool", "str"):
        return type(value).__name__ == kind
    if type(value) not in (int, float) or (kind == "int" and type(value) is float):
        return False
    if kind == "int":
        return bool(0 <= value <= MOST_OF.get(name, MOST_COUNTED))
    low = 0.0 if name in POSITIVE else -math.inf
    finite = math.isfinite(value) if type(value) is float else abs(value) <= MOST_COUNTED
    return bool((finite or (name in UNBOUNDED and value == math.inf)) and value >= low)
