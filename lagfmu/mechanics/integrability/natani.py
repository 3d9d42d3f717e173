"""Natani's method for three and more variables (Forsyth, *Theory of Differential Equations* I, ch. I-II).

With all variables but two constant, omega = 0 has an integral u; with u in place of one of the two,
the other drops out of omega, which is then a form in u and the variables that were constant.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence

from sympy import Dummy, S

from ...model.elements import Expr
from .form import OneForm
from .frobenius import pairs
from .inverse import invert
from .potential import without
from .tower import Tower

Integrate = Callable[[Sequence[Expr], Sequence[Expr]], Expr | None]  # of a form in fewer variables


def natani(form: OneForm, integrate: Integrate) -> Iterator[Expr | None]:
    """Integrate in two variables with the others constant, then the form that remains."""
    for i, j in itertools.islice(pairs(len(form.x)), 6):
        u = integrate([form.terms[i], form.terms[j]], [form.x[i], form.x[j]])
        if u is None:
            continue
        rest = [k for k in range(len(form.x)) if k not in (i, j)]
        mu = u.diff(form.x[i]) / form.terms[i]
        kept = [mu * form.terms[k] - u.diff(form.x[k]) for k in rest]
        level = Dummy("u", real=True)
        for gone, other in ((form.x[i], form.x[j]), (form.x[j], form.x[i])):
            inverse = invert(u, level, gone)
            if inverse is None:
                continue
            names = [level, *(form.x[k] for k in rest)]
            tower = Tower([*names, other])
            inner = []
            for entry in kept:
                part = tower.back(tower.element(entry.xreplace({gone: inverse})))
                inner.append(without(part, [other]))
            f = integrate([S.One, *inner], names)
            if f is not None:
                yield f.xreplace({level: u})
                break
