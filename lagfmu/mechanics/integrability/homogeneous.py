"""Homogeneous forms: x_i = x w_i separates x (Ince, *Ordinary Differential Equations*, ch. II)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from sympy import Dummy, S, log

from ...model.elements import Expr
from .form import OneForm
from .potential import potential, tidy
from .tower import Tower

Integrate = Callable[[Sequence[Expr], Sequence[Expr]], Expr | None]  # of a form in fewer variables


def homogeneous(form: OneForm, integrate: Integrate) -> Iterator[Expr | None]:
    """x_i = x w_i, if the ratios of the coefficients depend on the ratios w_i only.

    omega is then proportional to S dx/x + sum b_i dw_i, with S = sum_i b_i w_i and w = 1 at x;
    if S is not 0, b/S is exact.
    """
    tower, count = form.tower, len(form.x)
    for ratio in (form.a[i] / form.a[0] for i in range(1, count)):
        along = tower.K.zero
        for x in form.x:
            part = tower.diff(ratio, x)
            along = tower.lift(along) + tower.lift(part) * tower.element(x)
        if not tower.is_zero(along):
            return
    for p, x in enumerate(form.x):
        rest = [i for i in range(count) if i != p]
        w = {i: Dummy(f"w{i}", real=True) for i in rest}
        put = {form.x[i]: w[i] for i in rest} | {x: S.One}
        inner = Tower(list(w.values()))
        b = [inner.element(term.subs(put, simultaneous=True)) for term in form.terms]
        total = inner.lift(b[p])
        for i in rest:
            total += inner.lift(b[i]) * inner.element(w[i])
        names = list(w.values())
        if inner.is_zero(total):
            f = integrate([inner.back(b[i]) for i in rest], names)
        else:
            row = [inner.back(inner.reduce(inner.lift(b[i]) / total)) for i in rest]
            f = potential(row, names)
            f = f if f is None else tidy(log(x) + f)
        yield f if f is None else f.xreplace({w[i]: form.x[i] / x for i in rest})
