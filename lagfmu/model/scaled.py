"""Numbers given in g, mm, deg or rpm, in coherent SI: what a Model keeps.

The equations know coherent SI alone.  A unit that is a multiple of one belongs to the numbers beside it:
value and bounds of a parameter, start and rate of an input, the start of a coordinate and of its velocity,
what an output is otherwise.  An expression carries its own dimension.  Importers are told of the unit as the
one in which the variable is shown.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from sympy.core.function import AppliedUndef

from ..errors import UnitError
from .elements import TIME, Expr, Input, ModelFields, Output, Parameter, is_number, name_of
from .units import DisplayUnit, parse_scaled


def in_si(model: ModelFields) -> dict[str, Any]:
    """The fields of a model that are others in coherent SI, `display_units` among them.

    What cannot be read stays as it is, for `check.py` to tell.
    """
    shown: dict[str, str] = dict(model.display_units)
    numbers = {
        "parameters": ("value", "min", "max"),
        "inputs": ("start", "rate"),
        "outputs": ("otherwise",),
    }
    found: dict[str, Any] = {
        name: tuple(_taken(one, of, shown) for one in getattr(model, name))
        for name, of in numbers.items()
    }
    found["coordinates"], found["start"] = _motion(model.coordinates, model.start, shown)
    found["speeds"], found["start"] = _motion(model.speeds, found["start"], shown)
    if model.embedding is not None:
        coordinates, start = _motion(model.embedding.coordinates, model.embedding.start, shown)
        found["embedding"] = replace(model.embedding, coordinates=coordinates, start=start)
    return {**found, "display_units": shown}


def _scaled(text: object) -> DisplayUnit | None:
    """A unit that is a multiple of a coherent one; None for any other text."""
    try:
        read = parse_scaled(text, "a value")  # type: ignore[arg-type]
    except UnitError:
        return None
    return None if read.coherent else read


def _taken(one: Any, numbers: tuple[str, ...], shown: dict[str, str]) -> Any:
    """A parameter, input or output in coherent SI; `numbers`: its fields that are in its unit."""
    if not isinstance(one, Parameter | Input | Output):
        return one
    unit = _scaled(one.unit)
    if unit is None:
        return one
    shown[one.name if isinstance(one, Output) else name_of(one.symbol)] = unit.name
    given = {k: getattr(one, k) for k in numbers}
    si: dict[str, Any] = {k: unit.to_si(float(x)) for k, x in given.items() if is_number(x)}
    return replace(one, unit=unit.unit.name, **si)


def _motion(
    coordinates: Mapping[Expr, str], start: Mapping[Expr, Any], shown: dict[str, str]
) -> tuple[dict[Expr, str], dict[Expr, Any]]:
    """Coordinates with their units, and start values, in coherent SI."""
    units, values = dict(coordinates), dict(start)
    for q, text in coordinates.items():
        unit = _scaled(text)
        if unit is None or not isinstance(q, AppliedUndef):
            continue
        units[q] = unit.unit.name
        shown[name_of(q)] = unit.name
        for state in (q, q.diff(TIME)):
            if state in values and is_number(values[state]):
                values[state] = unit.to_si(float(values[state]))
    return units, values
