"""modelDescription.xml -> what the page has to know of an FMU: variables, their groups, the experiment.

Everything comes from the variables as any importer sees them, so that a page can be made of an FMU
alone, and new kinds of outputs need nothing here.
"""

from __future__ import annotations

import io
from typing import Any

import fmpy

from ... import names
from ...fmu.archive import pack
from ...fmu.read import described_rules, experiment_of, kind_of
from ...model.rule import MESSAGES, Rule
from ...model.units import for_reading
from ...page.groups import heading
from ...page.preset import SETTABLE

# of a variable; `reference`: its place.  What is seldom usual comes first
USUAL: dict[str, Any] = {
    **dict.fromkeys(("name", "description", "group", "unit"), ""),
    **{"discrete": False, "counted": "", "type": "Real", "role": "output", "column": True},
    **dict.fromkeys(("start", "min", "max")),
    **{"event": False, "items": [], "reference": None},
}
NUMBERS = ("Real", "Integer", "Boolean")


def facts(
    description: bytes, picture: dict[str, Any] | None, preset: dict[str, Any] | None = None
) -> dict[str, Any]:
    """The facts as the page's scripts read them (web/api.js); numbers in SI, times in s."""
    archive = io.BytesIO(pack({"modelDescription.xml": description}))  # fmpy reads archives only
    read = fmpy.read_model_description(archive, validate=False)
    experiment = experiment_of(read)
    named = {v.name for v in read.modelVariables}
    first = names.of_interest(v.name for v in read.modelVariables)
    joints = any(
        n.startswith("force.") for n in first
    )  # elsewhere the page begins with whole groups
    given = preset or {"sliders": [], "curves": first if joints else [], "ranges": {}}
    settable = {v.name for v in read.modelVariables if _role(v) in SETTABLE}
    columns = {v.name for v in read.modelVariables if _is_column(v)}
    rules = described_rules(read)
    variables = [_variable(v, rules[v.name], named) for v in read.modelVariables]
    return {
        "name": read.modelName,
        "description": read.description or "",
        "experiment": {
            "stopTime": experiment.stop_time,
            "stepSize": experiment.step_size,
            "tolerance": experiment.tolerance,
        },
        "variables": variables,
        "rules": MESSAGES,
        "picture": picture,
        "preset": {
            "sliders": [n for n in given["sliders"] if n in settable],
            "curves": [n for n in given["curves"] if n in columns],
            "ranges": {n: ends for n, ends in given["ranges"].items() if n in settable},
        },
    }


def lean(found: dict[str, Any]) -> dict[str, Any]:
    """The facts as they stand in a page: a variable is a row beside `usual`, null where it is so, up to
    the last that is not; its group is a place in `groups` (web/api.js)."""
    groups, rows = [*dict.fromkeys(v["group"] for v in found["variables"])], []
    for place, v in enumerate(found["variables"]):
        told, usual = {**v, "group": groups.index(v["group"])}, {**USUAL, "reference": place}
        row = [None if told[key] == x else told[key] for key, x in usual.items()]
        while row[-1] is None:
            row.pop()
        rows.append(row)
    return {**found, "variables": rows, "usual": [*USUAL.items()], "groups": groups}


def _variable(v: Any, rule: Rule, named: set[str]) -> dict[str, Any]:
    """One variable.  `column`: a run records it; `event`: the count of an event whose time is known;
    `counted`: the count without which it says nothing (names.counted)."""
    role = _role(v)
    return {
        "name": v.name,
        "reference": int(v.valueReference),
        "type": kind_of(v),
        "role": role,
        "group": heading(v.name, role, named),
        "unit": for_reading(v.unit),
        "start": _number(v),
        "items": [{"name": item, "value": number} for item, number in rule.items.items()],
        "min": rule.minimum,
        "max": rule.maximum,
        "description": v.description or "",
        "column": _is_column(v),
        "discrete": v.variability == "discrete",
        "event": names.read(v.name).quantity in names.COUNTS,
        "counted": count if (count := names.counted(v.name)) in named else "",
    }


def _is_column(v: Any) -> bool:
    return v.causality == "output" and kind_of(v) in NUMBERS


def _role(v: Any) -> str:
    """What may set it: parameter, start, input, solver; or output: nothing."""
    if v.causality == "parameter":
        return "solver" if names.read(v.name).head == names.SOLVER else "parameter"
    if v.causality == "input":
        return "input"
    return "start" if v.initial in ("exact", "approx") else "output"


def _number(v: Any) -> float | str | None:
    if v.start is None or kind_of(v) == "String":
        return None if v.start is None else str(v.start)
    if kind_of(v) == "Boolean":
        return float(str(v.start).lower() in ("true", "1"))
    return float(v.start)
