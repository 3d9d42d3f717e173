"""Inverse integrating factors v: omega/v is exact where v d(omega) = dv ^ omega.

That is linear in v, which is looked for as a sum with constant coefficients of monomials and of
omega(V) for affine fields V: if omega = 0 has the symmetry V, v = omega(V) is one (Lie; Olver,
*Applications of Lie Groups to Differential Equations*, sect. 2.5).  The ratio of two is an integral.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from sympy import S

from ...model.elements import Expr
from .ansatz import combine, monomials, relations
from .form import OneForm
from .frobenius import pairs
from .potential import potential, tidy


def inverse_factors(form: OneForm) -> Iterator[Expr | None]:
    """mu = 1/v with v d(omega) = dv wedge omega, v a sum with constant coefficients."""
    tower = form.tower
    places = list(pairs(len(form.x)))
    for degree in (1, 2, 3):
        lines = [*form.x, S.One]
        basis = [x * term for term in form.terms for x in lines] if degree == 1 else []
        terms = monomials(tower, form.x, [form.terms], degree)
        if terms is None:
            if degree > 1:
                return
            terms = []
        basis += [S.One, *terms]
        columns = []
        for v in basis:
            element = tower.element(v)
            dv = form.gradient(element)
            columns.append(
                [
                    tower.reduce(
                        tower.lift(element) * tower.lift(form.curl(form.a, i, j))
                        - form.wedge(dv, form.a, i, j)
                    )
                    for i, j in places
                ]
            )
        found = []
        for vector in relations(tower, columns)[:12]:
            v = combine(vector, basis)
            if not tower.zero(v):
                found.append(v)
        for one, two in itertools.islice(itertools.combinations(found, 2), 6):
            yield tower.back(tower.element(one / two))
        for v in found[:4]:
            inverse = tower.element(1 / v)
            mu = [tower.back(tower.reduce(inverse * tower.lift(a))) for a in form.a]
            yield tidy(potential(mu, form.x))
