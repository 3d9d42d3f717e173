"""A model in which some of its frictions never slip."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

import sympy as sp

from .elements import Contact, Expr, ModelFields, Nonholonomic
from .reactions import multiplier
from .selection import select

Fields = TypeVar("Fields", bound=ModelFields)


def stuck(model: Fields, slipping: Sequence[str], problems: list[str]) -> Fields:
    """The model in which only the frictions `slipping` (names or patterns) may slip.

    What the others limit holds always, or while the one contact of its normal force is closed; parameters
    that stand in those frictions alone go with them.
    """
    may = select(slipping, [f.name for f in model.frictions], "friction", problems)
    gone = [f for f in model.frictions if f.name not in may]
    if not gone:
        return model
    gates: dict[str, str] = {}
    contacts = {multiplier(c.name): c.name for c in model.constraints if isinstance(c, Contact)}
    for f in gone:
        normal = sp.sympify(f.normal)
        normals = [name for symbol, name in contacts.items() if normal.has(symbol)]
        gates |= {name: normals[0] for name in f.of if normals}
        rough = [name for name in f.of if not isinstance(_row(model, name), Nonholonomic)]
        if len(normals) > 1 or (normals and rough):
            problems.append(
                f"the friction {f.name!r} shall not slip, but {', '.join(map(repr, f.of))} acts with "
                f"{' and '.join(map(repr, normals))}: that can be said of a Nonholonomic constraint and "
                f"one contact alone (while_closed); name it in `frictions`"
            )
    if problems:
        return model
    kept = tuple(f for f in model.frictions if f.name in may)
    rest = {f.name: getattr(model, f.name) for f in fields(model)} | {"frictions": kept}
    used = _symbols([v for name, v in rest.items() if name != "parameters"])
    idle = _symbols(gone) - used
    return replace(
        model,
        frictions=kept,
        constraints=tuple(
            replace(c, while_closed=gates[c.name])
            if c.name in gates and isinstance(c, Nonholonomic)
            else c
            for c in model.constraints
        ),
        parameters=tuple(p for p in model.parameters if p.symbol not in idle),
    )


def _row(model: ModelFields, name: str) -> object:
    return next(c for c in model.constraints if c.name == name)


def _symbols(x: Any) -> set[Expr]:
    """The symbols in everything that a model holds."""
    if isinstance(x, sp.Basic):
        return set(x.free_symbols)
    if isinstance(x, Mapping):
        return _symbols([*x.keys(), *x.values()])
    if is_dataclass(x) and not isinstance(x, type):
        return _symbols([getattr(x, f.name) for f in fields(x)])
    if isinstance(x, list | tuple):
        return set().union(*map(_symbols, x)) if x else set()
    return set()
