"""What the live page of a model shows at first: the sliders that matter, the curves that tell, the ranges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import sympy as sp

from .closed_form import variable_name
from .elements import Expr, ModelFields, is_number, name_of

Named = str | Expr  # a variable by its name in the FMU, or what a model has for it


@dataclass(frozen=True)
class Page:
    """What the live page shows at first; everything else is there, folded away.

    `sliders` are parameters, inputs and start values, in this order; `curves` outputs of the FMU, the
    first of them beside the picture; `ranges` the lowest and highest value [SI] of a slider.  Variables are
    named as in the FMU ("lambda.surface", "der(theta)"), or as in the model (theta, theta.diff(), m).
    """

    sliders: Sequence[Named] = ()
    curves: Sequence[Named] = ()
    ranges: Mapping[Named, tuple[float, float]] = field(default_factory=dict)


def told(variable: Named) -> str:
    """Its name in the FMU."""
    return variable if isinstance(variable, str) else variable_name(variable)


def check_page(model: ModelFields, problems: list[str]) -> None:
    """What is wrong with the page of a model, but for names: those are known when its FMU is."""
    page: Any = model.page
    if page is None:
        return
    if not isinstance(page, Page):
        problems.append(f"page = {page!r}, expected Page(sliders=[...], curves=[...], ranges=...)")
        return
    for what in ("sliders", "curves", "ranges"):
        given, kind = getattr(page, what), Mapping if what == "ranges" else Sequence
        if isinstance(given, str) or not isinstance(given, kind):
            expected = "{m: (0.5, 2)}" if what == "ranges" else "[m, 'lambda.wire']"
            problems.append(f"page: {what} = {given!r}, expected e.g. {what}={expected}")
            continue
        problems += [
            f"page: {what} hold {v!r}, expected the name of a variable, or a symbol of the model"
            for v in given
            if not isinstance(v, str | sp.Symbol | sp.Function | sp.Derivative)
        ]
    if not isinstance(page.ranges, Mapping):
        return
    values = {name_of(p.symbol): p for p in model.parameters}
    for variable, ends in page.ranges.items():
        what = f"page: the range of {told(variable)}"
        if not isinstance(ends, tuple | list) or len(ends) != 2 or not all(map(is_number, ends)):
            problems.append(f"{what} is {ends!r}, expected two numbers (low, high)")
            continue
        low, high = ends
        if not low < high:
            problems.append(f"{what} is {ends!r}, expected the lower number first")
        p = values.get(told(variable))
        if p is None:
            continue
        if (p.min is not None and low < p.min) or (p.max is not None and high > p.max):
            problems.append(f"{what} is {ends!r}, beyond its bounds [{p.min}, {p.max}]")
        if not low <= float(p.value) <= high:
            problems.append(f"{what} is {ends!r} without its own value {p.value}")
