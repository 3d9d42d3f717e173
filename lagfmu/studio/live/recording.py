"""Runs that were computed elsewhere -> a page that plays them: of FMUs without C sources, films, modes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .facts import facts
from .playable import Told
from .render import Playable


def recorded(told: Told, run: Any, given: Mapping[str, Any], more: Sequence[Any] = ()) -> Playable:
    """The page's parts with `run`, a structured array of time [s] and outputs: those of which it tells.

    `given` are the parameters and start values that were set; `more`: further runs of as many rows.
    """
    found = facts(told.description, told.picture, told.preset)
    found["variables"] = [
        v for v in found["variables"] if not v["column"] or v["name"] in run.dtype.names
    ]
    for v in found["variables"]:
        if v["name"] in given and v["type"] != "String":
            v["start"] = float(given[v["name"]])
    names = ["time", *(v["name"] for v in found["variables"] if v["column"])]
    told_of = {v["name"] for v in found["variables"]}
    for key in ("curves", "sliders"):
        found["preset"][key] = [n for n in found["preset"][key] if n in told_of]
    numbers = [np.asarray(one[n], dtype="<f8") for one in (run, *more) for n in names]
    return Playable(found, told.equations, recording=np.stack(numbers).tobytes())
