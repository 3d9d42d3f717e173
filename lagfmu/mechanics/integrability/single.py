"""f with df = mu omega for one integrable one-form omega: a bounded list of methods, cheap ones first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from sympy import exp, expand

from ...model.elements import Expr
from .factors import bernoulli, separable
from .form import OneForm
from .lie import inverse_factors
from .potential import potential, tidy
from .undecided import FAILURES, late


def single(row: Sequence[Expr], variables: Sequence[Expr]) -> Expr | None:
    """f with df = mu * omega for an integrable one-form omega, or None."""
    try:
        form = OneForm(row, variables)
    except FAILURES:
        return None
    try:
        given = [form.tower.element(entry) for entry in form.given]
        if len(given) > 1 and form.closed(given):  # then no factor makes it easier
            f = potential(form.given, form.x)
            return f if f is not None and form.solves(f) else None
    except FAILURES:
        return None
    for method in _methods(form):
        try:
            for f in method:
                if late():
                    return None
                if f is not None and form.solves(f):
                    return f
        except FAILURES:
            continue
    return None


def _methods(form: OneForm) -> list[Iterator[Expr | None]]:
    """Iterators over candidates for f, the cheap methods first."""
    if len(form.x) < 2:
        return [iter(form.x)]

    return [
        _exact(form),
        _by_factors(form, bernoulli(form)),
        _by_factors(form, separable(form)),
        inverse_factors(form),
    ]


def _exact(form: OneForm) -> Iterator[Expr | None]:
    if form.exact(form.a):
        yield tidy(potential(form.terms, form.x))


def _by_factors(form: OneForm, logarithms: Iterator[Expr | None]) -> Iterator[Expr | None]:
    """The potential of mu * omega, for each of some log(mu)."""
    for logarithm in logarithms:
        if logarithm is not None:
            mu = exp(expand(logarithm))
            yield tidy(potential([mu * term for term in form.terms], form.x))
