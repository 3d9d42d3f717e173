"""A run that was computed elsewhere -> a page that plays it: for FMUs without C sources, and for films."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .facts import facts
from .playable import Told
from .render import Playable


def recorded(told: Told, run: Any, given: Mapping[str, Any]) -> Playable:
    """The page's parts with `run`, a structured array of time [s] and outputs: those of which it tells.

    `given` are the parameters and start values that were set.
    """
    found = facts(told.description, told.picture, told.preset)
    found["variables"] = [
        v for v in found["variables"] if not v["column"] or v["name"] in run.dtype.names
    ]
    for v in found["variables"]:
        if v["name"] in given and v["type"] != "String":
            v["start"] = float(given[v["name"]])
    names = ["time", *(v["name"] for v in found["variables"] if v["column"])]
    numbers = np.stack([np.asarray(run[n], dtype="<f8") for n in names])
    return Playable(found, told.equations, recording=numbers.tobytes())
