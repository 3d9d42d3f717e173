"""The plain symbols of the equations, named as in the FMU, for the functions of time of a model."""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp

from ..model.elements import TIME, Expr, name_of
from ..model.model import Model
from ..names import derivative


def plain_symbols(model: Model) -> dict[Expr, Expr]:
    """dynamicsymbols and their derivatives -> plain symbols named as in the FMU."""
    table = {}
    extra = model.embedding.coordinates if model.embedding else {}
    for s in (*model.coordinates, *extra, *(i.symbol for i in model.inputs)):
        name = name_of(s)
        if s.is_Symbol:
            continue  # an input that was written as a plain symbol
        table[s] = sp.Symbol(name, real=True)
        for k in (1, 2):
            table[s.diff(TIME, k)] = sp.Symbol(derivative(name, k), real=True)
    return table | _own_speeds(model, table)


def _own_speeds(model: Model, table: Mapping[Expr, Expr]) -> dict[Expr, Expr]:
    """Speeds of the model's own, and the derivatives of the coordinates that move by them."""
    found = {}
    for w in model.speeds:
        found[w] = sp.Symbol(name_of(w), real=True)
        found[w.diff(TIME)] = sp.Symbol(derivative(name_of(w)), real=True)
    rates = {s.diff(TIME): sp.sympify(rate) for s, rate in model.kinematics.items()}
    whole = {**table, **found}
    found |= {s: rate.xreplace(whole) for s, rate in rates.items()}
    expressions = [sp.sympify(o.expression) for o in model.outputs]
    read = set().union(*(e.atoms(sp.Derivative) for e in expressions)) if expressions else set()
    for s, rate in rates.items():
        if s.diff(TIME) in read:
            found[s.diff(TIME)] = rate.diff(TIME).xreplace(rates).xreplace(whole)
    return found


def plain_inputs(
    model: Model, table: dict[Expr, Expr]
) -> tuple[tuple[Expr, ...], dict[Expr, Expr]]:
    """The plain input symbols, and the rate of each that is differentiated."""
    u: list[Expr] = []
    rates: dict[Expr, Expr] = {}
    for i in model.inputs:
        u.append(table.get(i.symbol, i.symbol))
        if i in model.prescribed:
            first, second = table[i.symbol.diff(TIME)], table[i.symbol.diff(TIME, 2)]
            rates |= {u[-1]: first, first: second}
            u += [first, second]
            if i.rates == "estimated":
                u.append(sp.Symbol(derivative(name_of(i.symbol), 3), real=True))
    return tuple(u), rates
