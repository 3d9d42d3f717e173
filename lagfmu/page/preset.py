"""What a live page shows at first, as data that travels in the FMU (resources/page.json):
{"sliders": ["m", ...], "curves": [...], "ranges": {"m": [0.5, 2.0]}}.
"""

from __future__ import annotations

import json
import math
from typing import Any

from ..errors import BuildError, ModelError
from ..files import foreign, json_of
from ..interface.table import variable_table
from ..mechanics.form import Form
from ..model.page import told
from ..model.scene import EVERYTHING
from ..model.selection import select
from ..prepare.prepare import Prepared

Preset = dict[str, Any]
IN_FMU = "resources/page.json"
SETTABLE = ("parameter", "input", "start")  # roles of what a slider may set


def preset_of(prepared: Prepared) -> Preset | None:
    """The model's, of what the FMU in this scene has.  Raises ModelError for names that no FMU of it has."""
    page = prepared.model.page
    if page is None:
        return None
    tables = [prepared.whole]
    if not prepared.scene.complete:
        tables.append(variable_table(Form(prepared.derived), prepared.asked))
    variables = {v.name: v for table in tables for v in table.variables}
    settable = [n for n, v in variables.items() if v.role in SETTABLE]
    readable = [n for n, v in variables.items() if v.causality == "output"]
    problems: list[str] = []
    sliders = [n for v in page.sliders for n in select([told(v)], settable, "slider", problems)]
    curves = [n for v in page.curves for n in select([told(v)], readable, "curve", problems)]
    select([told(v) for v in page.ranges], settable, "the slider of a range", problems)
    if problems and tuple(prepared.asked.frictions) == EVERYTHING:  # else it has outputs of others
        raise ModelError(prepared.model.name, [f"page: {p}" for p in problems])
    return {
        "sliders": [n for n in dict.fromkeys(sliders) if n in prepared.table],
        "curves": [n for n in dict.fromkeys(curves) if n in prepared.table],
        "ranges": {
            told(v): [float(low), float(high)]
            for v, (low, high) in page.ranges.items()
            if told(v) in prepared.table
        },
    }


def as_bytes(preset: Preset) -> bytes:
    """The preset as it travels in an FMU."""
    return json.dumps(preset, ensure_ascii=False, sort_keys=True, allow_nan=False).encode()


def read_preset(text: bytes) -> Preset:
    """The preset in an FMU.  Raises BuildError for what is none: an FMU may come from anywhere."""
    with foreign(
        lambda said: BuildError(f"{IN_FMU} is no page of lagfmu's ({said}): build the FMU anew")
    ):
        found = json_of(text)
        ranges = {str(n): _ends(ends) for n, ends in dict(found["ranges"]).items()}
        lists = {what: [str(n) for n in list(found[what])] for what in ("sliders", "curves")}
        return {**lists, "ranges": ranges}


def _ends(ends: Any) -> list[float]:
    low, high = map(float, ends)
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise ValueError(f"a range {ends!r}")
    return [low, high]
