"""Integrating factors of the kinds of the textbooks (Ince, *Ordinary Differential Equations*, ch. II).

mu with d(mu omega) = 0, that is, d(omega) = -d(log mu) ^ omega, is looked for as that of a linear or a
Bernoulli equation, and of separable variables.  Each function yields log(mu).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from sympy import log

from ...model.elements import Expr
from .form import OneForm
from .potential import potential
from .quadrature import quadrature


def bernoulli(form: OneForm) -> Iterator[Expr | None]:
    """mu = y**(-k) exp(g(rest)) for dy + sum b_i dx_i; k = 0 is the linear equation."""
    tower = form.tower
    for p, y in enumerate(form.x):
        rest = [i for i in range(len(form.x)) if i != p]
        b = {i: tower.reduce(form.a[i] / form.a[p]) for i in rest}
        slope = {i: tower.diff(b[i], y) for i in rest}
        over = {i: tower.reduce(b[i] / tower.element(y)) for i in rest}
        k: Any = tower.K.zero
        for i in rest:
            bend = tower.diff(slope[i], y)
            if not tower.is_zero(bend):
                below = tower.diff(over[i], y)
                k = None if tower.is_zero(below) else tower.reduce(bend / below)
                break
        if k is None or not all(tower.is_zero(dk) for dk in form.gradient(k)):
            continue
        eta = {i: tower.reduce(slope[i] - k * over[i]) for i in rest}
        if not all(tower.is_zero(tower.diff(eta[i], y)) for i in rest):
            continue
        inner = potential([tower.back(eta[i]) for i in rest], [form.x[i] for i in rest])
        if inner is not None:
            yield inner - tower.back(k) * log(y) - log(form.terms[p])


def separable(form: OneForm) -> Iterator[Expr | None]:
    """mu = 1/Y(y) for dy + Y(y) sum Z_i dx_i."""
    tower = form.tower
    for p, y in enumerate(form.x):
        rest = [i for i in range(len(form.x)) if i != p]
        b = [tower.reduce(form.a[i] / form.a[p]) for i in rest]
        rate = tower.reduce(tower.diff(b[0], y) / tower.lift(b[0]))
        same = all(tower.is_zero(tower.diff(c, y) - rate * c) for c in b[1:])
        alone = all(tower.is_zero(tower.diff(rate, form.x[i])) for i in rest)
        if same and alone:
            inner = quadrature(tower.back(rate), y)
            if inner is not None:
                yield -inner - log(form.terms[p])
