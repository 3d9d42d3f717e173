"""The symbols of a model, and what to say of those in an expression that are none of them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import sympy as sp
from sympy.core.function import AppliedUndef

from .elements import TIME, Expr, ModelFields, name_of


def known_symbols(model: ModelFields) -> set[Expr]:
    """Coordinates, speeds, parameters, inputs and time."""
    declared = {p.symbol for p in model.parameters} | {i.symbol for i in model.inputs}
    return {*model.coordinates, *model.speeds, *declared, TIME}


def unused(model: ModelFields) -> list[str]:
    """The parameters that stand nowhere in the model."""
    told = [getattr(model, f.name) for f in fields(model) if f.name != "parameters"]
    said = _standing_in([*told, *(p.value for p in model.parameters)])
    return [name_of(p.symbol) for p in model.parameters if p.symbol not in said]


def _standing_in(part: Any) -> set[Expr]:
    """The free symbols of all expressions in what a model is made of."""
    if isinstance(part, sp.Basic | sp.MatrixBase):
        return set(part.free_symbols)
    if isinstance(part, Mapping):
        return _standing_in([*part.keys(), *part.values()])
    if isinstance(part, list | tuple | set | frozenset):
        return set().union(*map(_standing_in, part))
    if is_dataclass(part) and not isinstance(part, type):
        return _standing_in([getattr(part, f.name) for f in fields(part)])
    return set()


def undeclared(
    model: ModelFields,
    what: str,
    expression: Expr,
    also: Collection[Expr] = (),
    known: Collection[Expr] = (),
) -> list[str]:
    """The symbols of an expression that are none of the model's, nor `also`, each with the remedy.  `known`:
    those of the model, where many expressions are asked about."""
    known = known or known_symbols(model)
    others = symbols_in(expression).difference(known, also)
    names = {name_of(s) for s in known} if others else set()
    problems = []
    for symbol in sorted(others, key=lambda s: str(plain(s))):
        remedy = "declare it, e.g. as a Parameter with value and unit"
        if model.embedding and symbol in model.embedding.coordinates:
            remedy = "it is one of the embedding: write it by the model's own coordinates"
        elif plain(symbol) in names:
            remedy = (
                "one of that name is declared, but as another symbol (other assumptions, or no "
                "function of time): use the same"
            )
        problems.append(
            f"{what}: {plain(symbol)} is neither coordinate, parameter nor input: {remedy}"
        )
    return problems


def symbols_in(expression: Expr) -> set[Expr]:
    """Symbols, and functions of time."""
    e = sp.sympify(expression)
    found: set[Expr] = e.free_symbols | e.atoms(AppliedUndef)
    return found


def plain(expr: Expr) -> str:
    """The expression as text: r for r(t), der(r) and der(r,2) for its derivatives."""
    expr = sp.sympify(expr)
    names: dict[Expr, Expr] = {}
    for node in expr.atoms(sp.Derivative):
        order = sum(int(count) for _, count in node.variable_count)
        wrt = [plain(v) for v, _ in node.variable_count if v != TIME]
        tail = [plain(node.expr), *wrt, *([str(order)] if order > 1 else [])]
        names[node] = sp.Symbol(f"der({','.join(tail)})")
    for node in expr.atoms(AppliedUndef):
        if len(node.args) == 1 and node.args[0].is_Symbol:
            names[node] = sp.Symbol(node.func.__name__)
    return str(expr.xreplace(names))
