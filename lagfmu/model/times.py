"""Derivatives by a time that is none: x.diff(T) of x(t) is 0 without a word, before the model sees it.

So the file's own text is read: a name that is a function of time, differentiated by a symbol that it does
not hold.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping
from typing import Any

import sympy as sp
from sympy.core.function import AppliedUndef

from .elements import TIME


def foreign_times(text: bytes, names: Mapping[str, Any]) -> list[str]:
    """Each X.diff(S), diff(X, S), Derivative(X, S) of the file that is 0; `names`: what its names are."""
    found = []
    for node in ast.walk(ast.parse(text)):
        if not isinstance(node, ast.Call):
            continue
        if isinstance(node.func, ast.Attribute) and node.func.attr == "diff":
            what, *by = node.func.value, *node.args
        elif (
            isinstance(node.func, ast.Name) and node.func.id in ("diff", "Derivative") and node.args
        ):
            what, *by = node.args
        else:
            continue
        moving = names.get(what.id) if isinstance(what, ast.Name) else None
        if not isinstance(moving, AppliedUndef) or not moving.has(TIME):
            continue
        for one in by:
            other = names.get(one.id) if isinstance(one, ast.Name) else None
            if isinstance(other, sp.Symbol) and not moving.has(other):
                found.append(
                    f"line {node.lineno}: {ast.unparse(node)} is 0, since the time of {moving.func} is "
                    f"dynamicsymbols._t and {one.id} is another symbol: write {moving.func}.diff()"  # type: ignore[attr-defined]
                )
    return found
