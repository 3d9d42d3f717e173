"""First integrals of integrable one-forms in closed form, by a bounded list of methods.

For one form: exactness, and integrating factors of the kinds of the textbooks (Ince, *Ordinary
Differential Equations*, ch. II: linear, Bernoulli, separable, a function of a combination such as
x*y); inverse integrating factors v, v d(omega) = dv wedge omega, which is linear in v, with an
ansatz that includes omega(V) for each affine field V (Lie); Natani's method for three and more
variables (Forsyth, *Theory of Differential Equations* I, ch. I-II).  For a system: each form alone,
an ansatz for f, which is linear in its coefficients, and elimination of a variable by an integral
already known.  A candidate counts only if df = 0 along the system is proven.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import lru_cache
from typing import Any

from sympy import (
    Abs,
    Add,
    Dummy,
    Function,
    Integral,
    Matrix,
    Mul,
    Piecewise,
    Poly,
    PolynomialError,
    Pow,
    S,
    acos,
    apart,
    asin,
    atan,
    cancel,
    cos,
    cosh,
    csc,
    exp,
    expand,
    eye,
    factor_list,
    factor_terms,
    factorial,
    ilcm,
    integrate,
    log,
    sec,
    sin,
    sinh,
    sqrt,
    tan,
    together,
)
from sympy import factor as factor_
from sympy.core.function import AppliedUndef
from sympy.integrals.manualintegrate import manualintegrate
from sympy.polys.domains import QQ
from sympy.polys.matrices import DomainMatrix
from sympy.simplify.fu import TR8

from lagfmu.zero import Tower, Undecided, late, pairs

Expr = Any  # SymPy has no types

_LONG = 600  # operations of an integrand beyond which no integration is tried
_TERM = 40  # operations of one term of it
_ANSATZ = 90  # unknowns of an ansatz
_FAILURES = (
    Undecided,
    ArithmeticError,
    NotImplementedError,
    PolynomialError,
    RecursionError,
    TypeError,
    ValueError,
)


def first_integrals(
    forms: Sequence[Sequence[Expr]],
    rows: Sequence[Sequence[Expr]],
    variables: Sequence[Expr],
    known: Sequence[Expr] = (),
    depth: int = 0,
) -> list[Expr]:
    """Independent first integrals of the integrable system that the reduced `rows` span.

    `forms` are further one-forms worth trying, and `known` candidates for integrals.
    """
    system = _System(rows, variables)
    for f in known:
        system.offer(f)
    if not system.complete():
        system.linear()
    for row in forms if forms and len(rows) == 1 else (*forms, *rows):
        if not system.complete() and not late() and system.contains(row):
            system.offer(single(row, variables))
    for degree in (1, 2, 3):
        if not system.complete() and not late():
            system.ansatz(degree)
    for f in list(system.found):
        if not system.complete() and not late() and depth < 3:
            with suppress(*_FAILURES):
                system.eliminate(f, depth)
    return system.found


class _System:
    """dx_p + sum_f b_f dx_f = 0, in reduced rows, and the integrals found so far."""

    def __init__(self, rows: Sequence[Sequence[Expr]], variables: Sequence[Expr]) -> None:
        self.rows = [list(row) for row in rows]
        self.variables = list(variables)
        self.pivots = [next(j for j, entry in enumerate(row) if entry != 0) for row in rows]
        self.free = [j for j in range(len(self.variables)) if j not in self.pivots]
        self.found: list[Expr] = []

    def complete(self) -> bool:
        return len(self.found) == len(self.rows)

    def contains(self, form: Sequence[Expr]) -> bool:
        """The form is a combination of the rows, and integrable on its own."""
        try:
            tower = Tower(self.variables, [*form, *itertools.chain(*self.rows)])
            for f in self.free:
                value = tower.element(form[f])
                for row, pivot in zip(self.rows, self.pivots, strict=True):
                    head, entry = tower.element(form[pivot]), tower.element(row[f])
                    value = tower.lift(value) - tower.lift(head) * tower.lift(entry)
                if not tower.is_zero(value):
                    return False
            return _Form(form, self.variables).integrable()
        except _FAILURES:
            return False

    def offer(self, f: Expr | None) -> bool:
        """Keep f if df = 0 along the system, and if it is independent of those found."""
        if f is None or self.complete() or late():
            return False
        try:
            tower = Tower(self.variables, [f, *self.found, *itertools.chain(*self.rows)])
            slope = tower.element(f)
            for j in self.free:
                value = tower.diff(slope, self.variables[j])
                for row, pivot in zip(self.rows, self.pivots, strict=True):
                    part = tower.diff(slope, self.variables[pivot])
                    entry = tower.element(row[j])
                    value = tower.lift(value) - tower.lift(part) * tower.lift(entry)
                if not tower.is_zero(value):
                    return False
            matrix = [
                [tower.diff(tower.element(g), self.variables[p]) for p in self.pivots]
                for g in (*self.found, f)
            ]
            if len(tower.rref(matrix, len(self.pivots))[1]) <= len(self.found):
                return False
        except _FAILURES:
            return False
        self.found.append(f)
        return True

    def linear(self) -> None:
        """dx = (A x + c(s)) ds with constant A: f = l exp(-A s) x - int l exp(-A s) c ds.

        The row vectors l are taken from the kernels of (A - a)**m and of A**2 - 2 m A + d, for the
        factors of the characteristic polynomial: the second ones give cosines and sines.
        """
        if len(self.free) != 1:
            return
        s = self.variables[self.free[0]]
        names = [self.variables[p] for p in self.pivots]
        speeds = [-row[self.free[0]] for row in self.rows]
        kept = list(range(len(names)))
        while True:
            x = [names[k] for k in kept]
            table = [[expand(speeds[k]).coeff(v) for v in x] for k in kept]
            rest = [
                expand(speeds[k] - Add(*[a * v for a, v in zip(line, x, strict=True)]))
                for k, line in zip(kept, table, strict=True)
            ]
            good = [
                k
                for k, line, c in zip(kept, table, rest, strict=True)
                if not any(a.has(s, *names) for a in line) and not c.has(*names)
            ]
            if good == kept:
                break
            kept = good
        if not 1 < len(kept) <= 6:
            return
        try:
            for vector in _exponentials(Matrix(table), s):
                drive = Add(*[a * c for a, c in zip(vector, rest, strict=True)])
                forced = S.Zero if drive == 0 else quadrature(drive, s)
                if forced is not None:
                    self.offer(Add(*[a * v for a, v in zip(vector, x, strict=True)]) - forced)
        except _FAILURES:
            return

    def ansatz(self, degree: int) -> None:
        """f = sum of monomials with constant coefficients: a linear system for these."""
        try:
            tower = Tower(self.variables, itertools.chain(*self.rows))
            rows = [[tower.element(entry) for entry in row] for row in self.rows]
            basis = _monomials(tower, self.variables, self.rows, degree)
            if basis is None:
                return
            columns = []
            for monomial in basis:
                element = tower.element(monomial)
                column = []
                for j in self.free:
                    value = tower.diff(element, self.variables[j])
                    for row, pivot in zip(rows, self.pivots, strict=True):
                        part = tower.diff(element, self.variables[pivot])
                        value = tower.lift(value) - tower.lift(row[j]) * tower.lift(part)
                    column.append(tower.reduce(value))
                columns.append(column)
            solutions = _relations(tower, columns)
        except _FAILURES:
            return
        for vector in solutions[:40]:
            self.offer(_combine(vector, basis))

    def eliminate(self, f: Expr, depth: int) -> None:
        """Restrict the system to f = c, where it has one integral less, and integrate that."""
        c = Dummy("c", real=True)
        for place, x in enumerate(self.variables):
            if self.complete() or late() or not f.has(x):
                continue
            inverse = _invert(f, c, x)
            if inverse is None:
                continue
            rest = [v for v in self.variables if v != x]
            try:
                rows = []
                for row in self.rows:
                    entries = []
                    for v, entry in zip(self.variables, row, strict=True):
                        if v != x:
                            part = entry + row[place] * inverse.diff(v)
                            entries.append(part.xreplace({x: inverse}))
                    rows.append(entries)
                tower = Tower(rest, itertools.chain(*rows))
                matrix = [[tower.element(entry) for entry in row] for row in rows]
                reduced, pivots = tower.rref(matrix, len(rest))
                rows = [[tower.back(e) for e in row] for row in reduced[: len(pivots)]]
            except _FAILURES:
                continue
            for g in first_integrals((), rows, rest, (), depth + 1):
                self.offer(g.xreplace({c: f}))


# --- one form --------------------------------------------------------------------------------


def single(row: Sequence[Expr], variables: Sequence[Expr], depth: int = 0) -> Expr | None:
    """f with df = mu * omega for an integrable one-form omega, or None."""
    try:
        form = _Form(row, variables)
    except _FAILURES:
        return None
    try:
        given = [form.tower.element(entry) for entry in form.given]
        if len(given) > 1 and form.exact(given):  # then no factor makes it easier
            f = potential(form.given, form.x)
            return f if f is not None and form.solves(f) else None
    except _FAILURES:
        return None
    for method in form.methods(depth):
        try:
            for f in method:
                if late():
                    return None
                if f is not None and form.solves(f):
                    return f
        except _FAILURES:
            continue
    return None


class _Form:
    """A one-form sum_i a_i dx_i, without common factors and with no coefficient zero."""

    def __init__(self, row: Sequence[Expr], variables: Sequence[Expr]) -> None:
        self.tower = Tower(variables, row)
        elements = [self.tower.element(entry) for entry in row]
        kept = [i for i, element in enumerate(elements) if not self.tower.is_zero(element)]
        for element in elements:  # so that the field has the derivatives that are met later
            for x, y in itertools.product(variables, repeat=2):
                self.tower.diff(self.tower.diff(element, x), y)
        self.given = [row[i] for i in kept]
        self.x = [variables[i] for i in kept]
        self.a = self._primitive([elements[i] for i in kept])
        self.terms = [self.tower.back(a) for a in self.a]

    def _primitive(self, row: list[Any]) -> list[Any]:
        """The row times its common denominator, divided by the common factor of the rest."""
        row = [self.tower.lift(entry) for entry in row]
        if not row:
            return row
        below, above = row[0].denom, row[0].numer
        for entry in row[1:]:
            below, above = below.lcm(entry.denom), above.gcd(entry.numer)
        factor = self.tower.K.new(below) / self.tower.K.new(above)
        return [self.tower.reduce(entry * factor) for entry in row]

    def wedge(self, b: list[Any], c: list[Any], i: int, j: int) -> Any:
        lift = self.tower.lift
        return lift(b[i]) * lift(c[j]) - lift(b[j]) * lift(c[i])

    def gradient(self, element: Any) -> list[Any]:
        return [self.tower.diff(element, x) for x in self.x]

    def curl(self, a: list[Any], i: int, j: int) -> Any:
        one, two = self.tower.diff(a[j], self.x[i]), self.tower.diff(a[i], self.x[j])
        return self.tower.lift(one) - self.tower.lift(two)

    def exact(self, a: list[Any]) -> bool:
        return all(self.tower.is_zero(self.curl(a, i, j)) for i, j in pairs(len(a)))

    def integrable(self) -> bool:
        """d(omega) wedge omega = 0."""
        for i, j, k in itertools.combinations(range(len(self.x)), 3):
            total = self.tower.K.zero
            for p, q, r in ((i, j, k), (j, k, i), (k, i, j)):
                curl = self.curl(self.a, q, r)
                total = self.tower.lift(total) + self.tower.lift(self.a[p]) * self.tower.lift(curl)
            if not self.tower.is_zero(total):
                return False
        return True

    def solves(self, f: Expr) -> bool:
        """df wedge omega = 0, and df is not zero."""
        tower = Tower(self.tower.variables, [f, *self.terms])
        slope = [tower.diff(tower.element(f), x) for x in self.x]
        a = [tower.element(term) for term in self.terms]
        return not all(tower.is_zero(s) for s in slope) and all(
            tower.is_zero(
                tower.lift(slope[i]) * tower.lift(a[j]) - tower.lift(slope[j]) * tower.lift(a[i])
            )
            for i, j in pairs(len(a))
        )

    def methods(self, depth: int) -> list[Iterator[Expr | None]]:
        """Iterators over candidates for f, the cheap methods first."""
        if len(self.x) < 2:
            return [iter(self.x)]
        found = [
            self.exact_without_factors(),
            self.by_factors(self.bernoulli()),
            self.by_factors(self.separable()),
            self.homogeneous(depth),
            self.by_factors(self.combination()),
            self.inverse_factors(),
        ]
        return [*found, self.natani(depth)] if len(self.x) > 2 and depth < 3 else found

    def exact_without_factors(self) -> Iterator[Expr | None]:
        if self.exact(self.a):
            yield tidy(potential(self.terms, self.x))

    def by_factors(self, logarithms: Iterator[Expr | None]) -> Iterator[Expr | None]:
        """The potential of mu * omega, for each of some log(mu)."""
        for logarithm in logarithms:
            if logarithm is not None:
                mu = exp(expand(logarithm))
                yield tidy(potential([mu * term for term in self.terms], self.x))

    def homogeneous(self, depth: int) -> Iterator[Expr | None]:
        """x_i = x w_i, if the ratios of the coefficients depend on the ratios w_i only.

        omega is then proportional to S dx/x + sum b_i dw_i, with S = sum_i b_i w_i and w = 1 at x;
        if S is not 0, b/S is exact.
        """
        tower, count = self.tower, len(self.x)
        for ratio in (self.a[i] / self.a[0] for i in range(1, count)):
            along = tower.K.zero
            for x in self.x:
                part = tower.diff(ratio, x)
                along = tower.lift(along) + tower.lift(part) * tower.element(x)
            if not tower.is_zero(along):
                return
        for p, x in enumerate(self.x):
            rest = [i for i in range(count) if i != p]
            w = {i: Dummy(f"w{i}", real=True) for i in rest}
            put = {self.x[i]: w[i] for i in rest} | {x: S.One}
            inner = Tower(list(w.values()))
            b = [inner.element(term.subs(put, simultaneous=True)) for term in self.terms]
            total = inner.lift(b[p])
            for i in rest:
                total += inner.lift(b[i]) * inner.element(w[i])
            names = list(w.values())
            if inner.is_zero(total):
                f = single([inner.back(b[i]) for i in rest], names, depth + 1)
            else:
                row = [inner.back(inner.reduce(inner.lift(b[i]) / total)) for i in rest]
                f = potential(row, names)
                f = f if f is None else tidy(log(x) + f)
            yield f if f is None else f.xreplace({w[i]: self.x[i] / x for i in rest})

    def bernoulli(self) -> Iterator[Expr | None]:
        """mu = y**(-k) exp(g(rest)) for dy + sum b_i dx_i; k = 0 is the linear equation."""
        tower = self.tower
        for p, y in enumerate(self.x):
            rest = [i for i in range(len(self.x)) if i != p]
            b = {i: tower.reduce(self.a[i] / self.a[p]) for i in rest}
            slope = {i: tower.diff(b[i], y) for i in rest}
            over = {i: tower.reduce(b[i] / tower.element(y)) for i in rest}
            k = tower.K.zero
            for i in rest:
                bend = tower.diff(slope[i], y)
                if not tower.is_zero(bend):
                    below = tower.diff(over[i], y)
                    k = None if tower.is_zero(below) else tower.reduce(bend / below)
                    break
            if k is None or not all(tower.is_zero(dk) for dk in self.gradient(k)):
                continue
            eta = {i: tower.reduce(slope[i] - k * over[i]) for i in rest}
            if not all(tower.is_zero(tower.diff(eta[i], y)) for i in rest):
                continue
            inner = potential([tower.back(eta[i]) for i in rest], [self.x[i] for i in rest])
            if inner is not None:
                yield inner - tower.back(k) * log(y) - log(self.terms[p])

    def separable(self) -> Iterator[Expr | None]:
        """mu = 1/Y(y) for dy + Y(y) sum Z_i dx_i."""
        tower = self.tower
        for p, y in enumerate(self.x):
            rest = [i for i in range(len(self.x)) if i != p]
            b = [tower.reduce(self.a[i] / self.a[p]) for i in rest]
            rate = tower.reduce(tower.diff(b[0], y) / tower.lift(b[0]))
            same = all(tower.is_zero(tower.diff(c, y) - rate * c) for c in b[1:])
            alone = all(tower.is_zero(tower.diff(rate, self.x[i])) for i in rest)
            if same and alone:
                inner = quadrature(tower.back(rate), y)
                if inner is not None:
                    yield -inner - log(self.terms[p])

    def combination(self) -> Iterator[Expr | None]:
        """mu a function of one combination u of the variables: d(omega) = -g du wedge omega."""
        tower = self.tower
        for x, y in itertools.combinations(self.x, 2):
            for u in (x, y, x * y, y / x, x + y, x - y, x**2 + y**2):
                du = self.gradient(tower.element(u))
                places = list(pairs(len(self.x)))
                wedges = [tower.reduce(self.wedge(du, self.a, i, j)) for i, j in places]
                curls = [tower.reduce(self.curl(self.a, i, j)) for i, j in places]
                first = next((k for k, w in enumerate(wedges) if not tower.is_zero(w)), None)
                if first is None:
                    continue
                g = tower.reduce(-curls[first] / wedges[first])
                dg = self.gradient(g)
                if all(
                    tower.is_zero(c + g * w) for c, w in zip(curls, wedges, strict=True)
                ) and all(tower.is_zero(self.wedge(dg, du, i, j)) for i, j in places):
                    yield potential([tower.back(tower.reduce(g * d)) for d in du], self.x)

    def inverse_factors(self) -> Iterator[Expr | None]:
        """mu = 1/v with v d(omega) = dv wedge omega, v a sum with constant coefficients."""
        tower = self.tower
        places = list(pairs(len(self.x)))
        for degree in (1, 2, 3):
            lines = [*self.x, S.One]
            basis = [x * term for term in self.terms for x in lines] if degree == 1 else []
            monomials = _monomials(tower, self.x, [self.terms], degree)
            if monomials is None:
                if degree > 1:
                    return
                monomials = []
            basis += [S.One, *monomials]
            columns = []
            for v in basis:
                element = tower.element(v)
                dv = self.gradient(element)
                columns.append(
                    [
                        tower.reduce(
                            tower.lift(element) * tower.lift(self.curl(self.a, i, j))
                            - self.wedge(dv, self.a, i, j)
                        )
                        for i, j in places
                    ]
                )
            found = []
            for vector in _relations(tower, columns)[:12]:
                v = _combine(vector, basis)
                if not tower.zero(v):
                    found.append(v)
            for one, two in itertools.islice(itertools.combinations(found, 2), 6):
                yield tower.back(tower.element(one / two))
            for v in found[:4]:
                inverse = tower.element(1 / v)
                mu = [tower.back(tower.reduce(inverse * tower.lift(a))) for a in self.a]
                yield tidy(potential(mu, self.x))

    def natani(self, depth: int) -> Iterator[Expr | None]:
        """Integrate in two variables with the others constant, then the form that remains."""
        for i, j in itertools.islice(pairs(len(self.x)), 6):
            u = single([self.terms[i], self.terms[j]], [self.x[i], self.x[j]], depth + 1)
            if u is None:
                continue
            rest = [k for k in range(len(self.x)) if k not in (i, j)]
            mu = u.diff(self.x[i]) / self.terms[i]
            kept = [mu * self.terms[k] - u.diff(self.x[k]) for k in rest]
            level = Dummy("u", real=True)
            for gone, other in ((self.x[i], self.x[j]), (self.x[j], self.x[i])):
                inverse = _invert(u, level, gone)
                if inverse is None:
                    continue
                names = [level, *(self.x[k] for k in rest)]
                tower = Tower([*names, other])
                inner = []
                for entry in kept:
                    part = tower.back(tower.element(entry.xreplace({gone: inverse})))
                    inner.append(_without(part, [other]))
                f = single([S.One, *inner], names, depth + 1)
                if f is not None:
                    yield f.xreplace({level: u})
                    break


# --- quadratures -----------------------------------------------------------------------------


def potential(row: Sequence[Expr], variables: Sequence[Expr]) -> Expr | None:
    """f with df/dx_i = row_i, for an exact row."""
    count = len(variables)
    for order in (list(range(count)), list(range(count))[::-1]):
        f: Any = S.Zero
        done: list[Expr] = []
        for i in order:
            try:
                tower = Tower(variables, [*row, f])
                element = tower.element(row[i] - f.diff(variables[i]))
                part = S.Zero if tower.is_zero(element) else row[i]
                if part != 0 and f != 0:
                    part = tower.back(element)
                term = quadrature(_without(part, done), variables[i])
            except _FAILURES:
                term = None
            if term is None:
                f = None
                break
            f += term
            done.append(variables[i])
        if f is not None:
            return f
    return None


def _without(expr: Expr, gone: Sequence[Expr]) -> Expr:
    """`expr`, which does not depend on the variables `gone`, written without them."""
    for x in gone:
        for value in (S.Zero, S.One, S(2), S.Half):
            if expr.has(x):
                plain = expr.subs(x, value)
                if plain.is_finite is not False and not plain.has(S.NaN, S.ComplexInfinity):
                    expr = plain
    return expr


def quadrature(expr: Expr, x: Expr) -> Expr | None:
    """The integral of `expr` by x, if a short attempt finds it."""
    if not expr.has(x):
        return expr * x
    if expr.count_ops() > _LONG:
        return None
    attempts = [expand(expr), expr]
    if expr.is_rational_function(x):
        attempts.insert(0, apart(together(expr), x))
    for attempt in attempts:
        total: Expr = S.Zero
        for term in Add.make_args(attempt):
            constant, rest = term.as_independent(x, as_Add=False)
            inner = _primitive_of(rest, x)
            if inner is None:
                break
            total += constant * inner
        else:
            return total
    return None


def _primitive_of(term: Expr, x: Expr) -> Expr | None:
    if term.count_ops() > _TERM or term.has(Integral) or late():
        return None
    if any(u.has(x) for u in term.atoms(AppliedUndef)):
        s = Dummy("s", real=True)
        for low in (S.Zero, S.One):
            if not term.subs(x, low).has(S.NaN, S.ComplexInfinity, S.Infinity):
                return Integral(term.xreplace({x: s}), (s, low, x))
        return None
    return _search(term, x)


@lru_cache(maxsize=500)
def _search(term: Expr, x: Expr) -> Expr | None:
    # where all symbols are positive: the primitive is verified for what they are, afterwards
    names = {v: Dummy(v.name, positive=True) for v in sorted(term.free_symbols | {x}, key=str)}
    plain, variable = term.xreplace(names), names[x]
    for method in (_oscillation, _heuristics, _half_angle):
        try:
            found = method(plain, variable)
        except Exception:  # SymPy's heuristics may raise anything
            continue
        if found is None:
            continue
        while found.has(Piecewise):
            piece = next(iter(found.atoms(Piecewise)))
            found = found.xreplace({piece: piece.args[0].expr})
        if not found.has(Integral, S.NaN, S.ComplexInfinity):
            return found.xreplace({new: old for old, new in names.items()})
    return None


def _heuristics(term: Expr, x: Expr) -> Expr | None:
    """SymPy's, which may take minutes: not for terms with several functions of curved arguments."""
    if term.is_rational_function(x):
        above, below = (Poly(part, x).degree() for part in together(term).as_numer_denom())
        if above + below > 12:
            return None
        return integrate(term, x, risch=False, meijerg=False, heurisch=False, manual=False)
    curved = {
        node.exp * log(node.base) if isinstance(node, Pow) else node.args[0]
        for node in term.atoms(Function, Pow)
        if node.has(x) and not (isinstance(node, Pow) and node.exp.is_Integer)
    }
    curved = {u for u in curved if u.diff(x).has(x)}
    if len(curved) > 1:
        return None
    if curved:
        (u,), v = curved, Dummy("v", positive=True)
        plain = (term / u.diff(x)).subs(u, v)
        if not plain.has(x):
            found = _heuristics(plain, v)
            return found if found is None else found.xreplace({v: u})
        if term.count_ops() > 10:
            return None
    found = manualintegrate(term, x)
    if not found.has(Integral):
        return found
    inverse = {cos: sec, sin: csc}
    other = term.replace(
        lambda e: isinstance(e, Pow) and e.exp.is_negative and type(e.base) in inverse,
        lambda e: inverse[type(e.base)](*e.base.args) ** -e.exp,
    )
    return None if other == term else manualintegrate(other, x)


def _oscillation(term: Expr, x: Expr) -> Expr | None:
    """The integral of a sum of x**n exp(a x) sin(b x + c), products of sines included."""
    if not term.has(sin, cos, exp):
        return None
    total: Expr = S.Zero
    for part in Add.make_args(expand(TR8(term))):
        constant, rest = part.as_independent(x, as_Add=False)
        power, exponent, wave = 0, S.Zero, None
        for factor in Mul.make_args(rest):
            if isinstance(factor, exp):
                exponent += factor.args[0]
            elif isinstance(factor, sin | cos) and wave is None:
                wave = factor
            elif factor != 1:
                base, power = factor.as_base_exp()
                if base != x or not power.is_Integer or not 0 <= power <= 6:
                    return None
        rate = expand(exponent).diff(x)
        angle = wave.args[0] if wave is not None else S.Zero
        turn = angle.diff(x)
        if rate.has(x) or turn.has(x) or rate == turn == 0:
            return None
        # y = (u cos + v sin) exp is stood for by u - i v: to integrate is to divide by a + i b
        u, v = (S.One, S.Zero) if wave is None or isinstance(wave, cos) else (S.Zero, S.One)
        size = rate**2 + turn**2
        for k in range(power, -1, -1):
            u, v = (u * rate - v * turn) / size, (u * turn + v * rate) / size
            total += constant * x**k * (u * cos(angle) + v * sin(angle)) * exp(exponent)
            constant *= -k
    return total


def _half_angle(term: Expr, x: Expr) -> Expr | None:
    """A rational function of the sine and cosine of one angle, by the tangent of its half."""
    angles = {node.args[0] for node in term.atoms(sin, cos, tan, sec, csc) if node.has(x)}
    if len(angles) != 1:
        return None
    angle = angles.pop()
    turn, t = angle.diff(x), Dummy("t", positive=True)
    put = {sin(angle): 2 * t / (1 + t**2), cos(angle): (1 - t**2) / (1 + t**2)}
    put[tan(angle)] = 2 * t / (1 - t**2)
    plain = together(term.xreplace(put) * 2 / (turn * (1 + t**2))).cancel()
    if turn.has(x) or plain.has(x):
        return None
    found = _heuristics(apart(plain, t), t)
    return found if found is None else found.xreplace({t: tan(angle / 2)})


def tidy(f: Expr | None) -> Expr | None:
    """A sum of logarithms with rational ratios is exponentiated: log(x) - w*t to x*exp(-w*t).

    A product with roots is raised to the power that removes them.
    """
    if f is None:
        return None
    powers = [factor.as_base_exp()[1] for factor in Mul.make_args(f)]
    if all(power.is_Rational for power in powers):
        return f ** ilcm(1, *[power.q for power in powers])
    terms = Add.make_args(expand(f))
    logs = [(term / node, node) for term in terms for node in term.args if isinstance(node, log)]
    logs += [(S.One, term) for term in terms if isinstance(term, log)]
    logs = [(c, node) for c, node in logs if not c.has(log) and node.args[0].free_symbols]
    if not logs:
        return f
    ratios = [((c / logs[0][0]).cancel(), node) for c, node in logs]
    if logs[0][0].free_symbols & node_symbols(logs) or not all(r.is_Rational for r, _ in ratios):
        return f
    scale = ilcm(1, *[ratio.q for ratio, _ in ratios])
    rest = expand(f - Add(*[c * node for c, node in logs]))
    product = Mul(*[Pow(node.args[0], scale * ratio) for ratio, node in ratios])
    return factor_terms(product) * exp(expand(scale * rest / logs[0][0]))


def node_symbols(logs: Sequence[tuple[Expr, Expr]]) -> set[Any]:
    """The symbols in the arguments of logarithms."""
    return set().union(*(node.free_symbols for _, node in logs))


def _invert(f: Expr, value: Expr, x: Expr) -> Expr | None:
    """x with f(x) = value, by undoing one operation after the other; one branch of it."""
    undo = {exp: log, log: exp, sin: asin, asin: sin, cos: acos, acos: cos, tan: atan, atan: tan}
    for _ in range(20):
        if f == x:
            return value
        if isinstance(f, Add | Mul):
            rest, part = f.as_independent(x)
            if not isinstance(part, type(f)):
                value = value - rest if isinstance(f, Add) else value / rest
                f = part
                continue
        elif isinstance(f, Pow) and not f.exp.has(x):
            f, value = f.base, value ** (1 / f.exp)
            continue
        elif type(f) in undo:
            f, value = f.args[0], undo[type(f)](value)
            continue
        break
    try:
        polynomial = Poly(together(f - value).as_numer_denom()[0], x)
    except PolynomialError:
        return None
    if any(c.has(x) for c in polynomial.all_coeffs()) or polynomial.degree() not in (1, 2):
        return None
    if polynomial.degree() == 1:
        a, b = polynomial.all_coeffs()
        return -b / a
    a, b, c = polynomial.all_coeffs()
    return (-b + sqrt(b**2 - 4 * a * c)) / (2 * a)


def _exponentials(A: Expr, s: Expr) -> Iterator[list[Expr]]:
    """Real row vectors l exp(-A s), where the characteristic polynomial's factors allow it."""
    count = A.shape[0]
    z = Dummy("z")
    polynomial = together(A.charpoly(z).as_expr(z)).as_numer_denom()[0]
    for factor, power in factor_list(polynomial)[1]:
        degree = Poly(factor, z).degree()
        if degree not in (1, 2) or (degree == 2 and power > 1):
            continue
        if degree == 1:
            one, zero = Poly(factor, z).all_coeffs()
            value = (-zero / one).cancel()
            N = (A - value * eye(count)).applyfunc(cancel)
            for column in (N.T**power).applyfunc(cancel).nullspace():
                vector = total = column.T
                for k in range(1, power):
                    vector = (vector * N).applyfunc(cancel)
                    total += vector * (-s) ** k / factorial(k)
                yield list((total * exp(-value * s)).applyfunc(factor_terms))
            continue
        two, one, zero = Poly(factor, z).all_coeffs()
        middle = (-one / two / 2).cancel()
        square = factor_terms(factor_(middle**2 - zero / two))
        N = (A - middle * eye(count)).applyfunc(cancel)
        kernel = (N**2 - square * eye(count)).T.applyfunc(cancel).nullspace()
        turns = square.is_negative or (not square.is_positive and square.could_extract_minus_sign())
        rate = sqrt(-square if turns else square).replace(Abs, lambda u: u)
        for column in kernel:
            one_, other = column.T, (column.T * N).applyfunc(cancel) / rate
            if turns:
                total = one_ * cos(rate * s) - other * sin(rate * s)
            else:
                total = one_ * cosh(rate * s) - other * sinh(rate * s)
            yield list((total * exp(-middle * s)).applyfunc(factor_terms))


# --- ansatz ----------------------------------------------------------------------------------


def _monomials(
    tower: Tower, variables: Sequence[Expr], rows: Sequence[Sequence[Expr]], degree: int
) -> list[Expr] | None:
    """Monomials of 1 to `degree` factors in the variables and functions of the rows."""
    present = set().union(*(entry.free_symbols for row in rows for entry in row))
    places = {j for row in rows for j, entry in enumerate(row) if entry != 0}
    atoms = [x for j, x in enumerate(variables) if x in present or j in places]
    atoms += tower.functions()
    basis: list[Expr] = []
    for count in range(1, degree + 1):
        for factors in itertools.combinations_with_replacement(atoms, count):
            basis.append(Mul(*factors))
            if len(basis) > _ANSATZ:
                return None
    return basis


def _combine(vector: Sequence[Expr], basis: Sequence[Expr]) -> Expr:
    first = next(c for c in vector if c != 0)
    return Add(*[(c / first).cancel() * term for c, term in zip(vector, basis, strict=True)])


def _relations(tower: Tower, columns: Sequence[Sequence[Any]]) -> list[list[Expr]]:
    """Vectors c of constants with sum_m c_m columns_m = 0 identically."""
    columns = [[tower.lift(entry) for entry in column] for column in columns]
    constants = tower.constants()
    places = [k for k, symbol in enumerate(tower.K.symbols) if symbol in constants]
    table: dict[Any, dict[int, Any]] = {}
    ring = tower.K.ring
    for equation in range(len(columns[0])):
        below = ring.one
        for column in columns:
            below = below.lcm(column[equation].denom)
        for m, column in enumerate(columns):
            entry = column[equation]
            for monomial, coefficient in (entry.numer * below.exquo(entry.denom)).terms():
                outer = tuple(0 if k in places else e for k, e in enumerate(monomial))
                inner = tuple(e if k in places else 0 for k, e in enumerate(monomial))
                cells = table.setdefault((equation, outer), {})
                cells[m] = cells.get(m, ring.zero) + ring.term_new(inner, coefficient)
    width = len(columns)
    if not table:
        return [[S.One if i == m else S.Zero for i in range(width)] for m in range(width)]
    chance = random.Random(3)
    numbers = [QQ(chance.randint(2, 99), chance.randint(2, 99)) for _ in tower.K.symbols]
    sample = [
        [
            QQ.convert(cells[m].evaluate(list(zip(ring.gens, numbers, strict=True))))
            if m in cells
            else QQ.zero
            for m in range(width)
        ]
        for cells in table.values()
    ]
    plain = DomainMatrix(sample, (len(sample), width), QQ)
    if not constants or all(c.is_ground for cells in table.values() for c in cells.values()):
        return [[QQ.to_sympy(c) for c in row] for row in plain.nullspace().to_dense().to_list()]
    if plain.rank() == width or len(sample) * width > 20000:
        return []
    domain = QQ.frac_field(*[tower.K.symbols[k] for k in places])
    zero = domain.zero
    exactly = [
        [domain.from_sympy(cells[m].as_expr()) if m in cells else zero for m in range(width)]
        for cells in table.values()
    ]
    kernel = DomainMatrix(exactly, (len(exactly), width), domain).nullspace().to_dense()
    return [[tower.name(domain.to_sympy(c)) for c in row] for row in kernel.to_list()]
