"""Which Pfaffian constraints are integrable, and to what.

A constraint sum_j a_j(q, t) q_j' + a_0(q, t) = 0 is the one-form sum_j a_j dq_j + a_0 dt on the
space of (q, t).  A set of them is integrable where Frobenius' theorem holds for the codistribution
I that they span: d(omega) wedge omega_1 wedge ... wedge omega_m = 0 for each omega of the set
(Arnold, *Mathematical Methods of Classical Mechanics*, app. 4; Marion and Thornton, *Classical
Dynamics*, sect. 7.5, for the mechanical meaning).  If it does not hold, the derived flag
I = I0 > I1 > ..., I(k+1) = {omega in I(k): d(omega) = 0 mod I(k)}, ends in the largest integrable
part; its rank is the number of independent first integrals (Bryant et al., *Exterior Differential
Systems*, ch. II).  All ranks are generic: they hold away from singular points.

That a coefficient vanishes is proven by exact arithmetic; that one does not is decided by its
values with 60 digits at random points (`lagfmu.zero`).
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from sympy import Dummy, Eq, Integer, S, Symbol, expand, factor_terms, simplify, sympify
from sympy import Integral as Integral_
from sympy.physics.mechanics import dynamicsymbols

from lagfmu.errors import DerivationError
from lagfmu.integrals import first_integrals
from lagfmu.zero import Tower, Undecided, pairs, within

Expr = Any  # SymPy has no types

_SECONDS = 8.0  # for the integrals of a set, and again for those of its forms one by one


class Kind(StrEnum):
    """What a set of Pfaffian constraints is."""

    HOLONOMIC = "holonomic"  # each form is df/dt as it stands
    INTEGRABLE = "integrable"  # with integrating factors, or only together
    PARTLY = "partly integrable"  # only some combinations of the forms are
    NONHOLONOMIC = "nonholonomic"  # no combination is
    UNDECIDED = "undecided"  # a coefficient of which it is not known whether it is zero


@dataclass(frozen=True)
class Integral:
    """A first integral: f(q, t) = const, with df/dt = sum_k factors[k] * forms[k] identically."""

    f: Expr
    factors: tuple[Expr, ...]


@dataclass(frozen=True)
class Classification:
    """The answer, with the proof of it.

    `rank` and `holonomic_rank` are generic ranks of one-forms in (q, t): of the set, and of the
    bottom of its derived flag, whose ranks are `flag`.  `witness` is 0 if the wedge products of
    Frobenius' theorem vanish, else a coefficient of one that does not (or, if undecided, the
    expression that could not be decided).  `each` has the classification of each form of a set
    alone.
    """

    kind: Kind
    forms: tuple[Expr, ...]
    rank: int
    holonomic_rank: int | None
    integrals: tuple[Integral, ...]
    certificate: str
    witness: Expr
    each: tuple[Classification, ...] = ()
    flag: tuple[int, ...] = ()


def pfaffian(form: Expr, coordinates: Sequence[Expr]) -> tuple[list[Expr], Expr]:
    """The coefficients (a_1, ..., a_n) and a_0 of sum_j a_j q_j' + a_0.

    Raises `DerivationError`, which names the term, if the form is not linear in the velocities.
    """
    time = dynamicsymbols._t
    if isinstance(form, Eq):
        form = form.lhs - form.rhs
    form = sympify(form)
    speeds = [Dummy(f"v{j}") for j in range(len(coordinates))]
    plain = form.subs(
        {q.diff(time, 2): Dummy("acceleration") for q in coordinates if form.has(q.diff(time, 2))}
    )
    if plain != form:
        raise DerivationError(
            f"constraint {form} has accelerations: a Pfaffian constraint is linear in the "
            "velocities; integrate it once, or leave it to the dynamics"
        )
    names = dict(zip([q.diff(time) for q in coordinates], speeds, strict=True))
    plain = form.xreplace(names)
    coefficients = [_coefficient(plain, v) for v in speeds]
    if any(coefficient.has(*speeds) for coefficient in coefficients if speeds):
        back = {v: q for q, v in names.items()}
        terms = [
            term
            for term in expand(plain).as_ordered_terms()
            if any(term.diff(v, w) != 0 for v in speeds for w in speeds)
        ]
        listed = ", ".join(str(term.xreplace(back)) for term in terms) or str(form)
        raise DerivationError(
            f"constraint {form} is not linear in the velocities: {listed}; a Pfaffian constraint "
            "is sum_j a_j(q, t)*q_j' + a_0(q, t) = 0"
        )
    rest = plain.xreplace(dict.fromkeys(speeds, S.Zero))
    return coefficients, rest


def _coefficient(plain: Expr, speed: Expr) -> Expr:
    slope = plain.diff(speed)
    if any(isinstance(v, Dummy) and v.name.startswith("v") for v in slope.free_symbols):
        slope = simplify(expand(slope))
    return slope


class _Chart:
    """Coordinates q_j(t) and t as independent real symbols, and back."""

    def __init__(self, coordinates: Sequence[Expr], used: set[Any]) -> None:
        time = dynamicsymbols._t
        names = [str(getattr(q, "func", q)) for q in coordinates]
        self.variables = [Dummy(name, real=True) for name in [*names, "t"]]
        self._there = dict(zip([*coordinates, time], self.variables, strict=True))
        for symbol in sorted(used - set(self._there), key=str):
            if symbol.is_extended_real is None:
                self._there[symbol] = Dummy(symbol.name, real=True)
        self._back = {value: key for key, value in self._there.items()}

    def there(self, expr: Expr) -> Expr:
        return expr.xreplace(self._there)

    def back(self, expr: Expr) -> Expr:
        return sympify(expr).xreplace(self._back)


def classify(
    forms: Sequence[Expr] | Expr, coordinates: Sequence[Expr], *, integrate: bool = True
) -> Classification:
    """Classify a Pfaffian constraint, or a set of them.

    `forms` are linear in the velocities q_j' of the `coordinates` q_j (`dynamicsymbols`), and set
    to zero; every other symbol is a generic parameter, every other function an unknown one.
    Numbers with a decimal point are read as the decimal number with 14 digits.  With
    `integrate=False`, the integrals are not looked for; else, for some seconds.
    """
    return _classify(forms, coordinates, integrate, _SECONDS)


def _classify(
    forms: Sequence[Expr] | Expr, coordinates: Sequence[Expr], integrate: bool, seconds: float
) -> Classification:
    forms = tuple(forms) if isinstance(forms, list | tuple) else (forms,)
    forms = tuple(f.lhs - f.rhs if isinstance(f, Eq) else sympify(f) for f in forms)
    coordinates = tuple(coordinates)
    split = [pfaffian(form, coordinates) for form in forms]
    rows = [[*a, a0] for a, a0 in split]
    used: set[Any] = set().union(*(entry.free_symbols for row in rows for entry in row))
    chart = _Chart(coordinates, {symbol for symbol in used if isinstance(symbol, Symbol)})
    rows = [[chart.there(entry) for entry in row] for row in rows]
    each: tuple[Classification, ...] = ()
    if len(forms) > 1:
        share = seconds / len(forms)
        each = tuple(_classify(form, coordinates, integrate, share) for form in forms)
    known = [chart.there(i.f) for c in each for i in c.integrals]
    return _Analysis(forms, rows, chart, each).run(known, seconds if integrate else 0.0)


class _Analysis:
    """Frobenius' theorem and the derived flag for the rows a of one-forms sum_j a_j dx_j."""

    def __init__(
        self,
        forms: tuple[Expr, ...],
        rows: list[list[Expr]],
        chart: _Chart,
        each: tuple[Classification, ...],
    ) -> None:
        self.forms, self.rows, self.chart, self.each = forms, rows, chart, each
        self.variables = chart.variables
        self.width = len(self.variables)
        self.tower = Tower(self.variables, [entry for row in rows for entry in row])

    def run(self, known: list[Expr], seconds: float) -> Classification:
        rank = 0
        try:
            for entry in (entry for row in self.rows for entry in row if entry.has(Integral_)):
                raise Undecided(entry, "an integral, which is not looked into")
            matrix = [[self.tower.element(entry) for entry in row] for row in self.rows]
            reduced, pivots = self._echelon(matrix)
            rank = len(pivots)
            self._consistent(reduced, pivots)
            basis = [row[: self.width] for row in reduced[:rank]]
            curvature, (first, witness, where) = self._obstruction(matrix, basis, pivots)
            flag, bottom = self._flag(basis, curvature)
            exact = all(self._exact(row) for row in matrix)
        except Undecided as undecided:
            return self._answer(
                Kind.UNDECIDED,
                rank,
                None,
                (),
                f"undecided: whether {self.chart.back(undecided.expr)} is zero decides the answer, "
                f"and it is {undecided.reason}",
                self.chart.back(undecided.expr),
                (),
            )
        depth = flag[-1]
        if exact:
            kind = Kind.HOLONOMIC
        elif depth == rank:
            kind = Kind.INTEGRABLE
        else:
            kind = Kind.PARTLY if depth else Kind.NONHOLONOMIC
        found: list[Integral] = []
        if seconds and depth:
            rows = [[self.tower.back(entry) for entry in row] for row in bottom]
            with within(seconds):
                candidates = first_integrals(self.rows, rows, self.variables, known)
            for f in candidates:
                with suppress(Undecided):  # it has passed, but its factors may be too long
                    found.append(self._integral(f, reduced[:rank], pivots))
        witness = self.chart.back(factor_terms(self.tower.back(witness)))
        text = self._certificate(kind, flag, first, witness, where)
        if seconds and len(found) < depth:
            text += (
                f"; of {depth} integrals, {len(found)} "
                f"{'was' if len(found) == 1 else 'were'} found in closed form"
            )
        return self._answer(kind, rank, depth, tuple(found), text, witness, tuple(flag))

    def _answer(
        self,
        kind: Kind,
        rank: int,
        depth: int | None,
        found: tuple[Integral, ...],
        text: str,
        witness: Expr,
        flag: tuple[int, ...],
    ) -> Classification:
        return Classification(kind, self.forms, rank, depth, found, text, witness, self.each, flag)

    def _echelon(self, matrix: list[list[Any]]) -> tuple[list[list[Any]], list[int]]:
        """Reduced rows, each followed by its combination of the given forms."""
        tower, count = self.tower, len(matrix)
        unit = [
            [tower.K.one if i == j else tower.K.zero for j in range(count)] for i in range(count)
        ]
        return tower.rref([a + b for a, b in zip(matrix, unit, strict=True)], self.width)

    def _consistent(self, reduced: list[list[Any]], pivots: list[int]) -> None:
        """dt is no combination of the forms: else, they ask that a function of (q, t) be zero."""
        if self.width - 1 not in pivots:
            return
        row = reduced[pivots.index(self.width - 1)]
        used = [k for k in range(len(self.forms)) if row[self.width + k]]
        if len(used) == 1 and not any(self.rows[used[0]][:-1]):
            raise DerivationError(
                f"constraint {self.forms[used[0]]} has no velocity in it: it is no Pfaffian "
                "constraint; if it is f(q, t) = 0, it is holonomic as it stands, and its Pfaffian "
                "form is its derivative by time"
            )
        names = ", ".join(str(self.forms[k]) for k in used)
        raise DerivationError(
            f"contradictory constraints {names}: a combination of them has no velocity in it, and "
            "is not zero; remove or correct one of them"
        )

    def _exact(self, row: list[Any]) -> bool:
        """d(omega) = 0 as it stands."""
        tower = self.tower
        for i, j in pairs(self.width):
            one = tower.diff(row[j], self.variables[i])
            two = tower.diff(row[i], self.variables[j])
            if not tower.is_zero(tower.lift(one) - tower.lift(two)):
                return False
        return True

    def _curvature(
        self, basis: list[list[Any]], pivots: list[int]
    ) -> dict[tuple[int, int], list[Any]]:
        """d(omega_i)(X_f, X_g), omega_i being the reduced rows, and X_f the fields they annul.

        With omega_i = dx_p + sum_f b_f dx_f, it is X_f(b_g) - X_g(b_f).
        """
        free = [j for j in range(self.width) if j not in pivots]
        table = {}
        for f, g in ((free[i], free[j]) for i, j in pairs(len(free))):
            column = []
            for row in basis:
                one = self._along(basis, pivots, f, row[g])
                two = self._along(basis, pivots, g, row[f])
                value = self.tower.reduce(self.tower.lift(one) - self.tower.lift(two))
                column.append(self.tower.K.zero if self.tower.is_zero(value) else value)
            table[f, g] = column
        return table

    def _along(self, basis: list[list[Any]], pivots: list[int], f: int, value: Any) -> Any:
        """X_f(value), with X_f = d/dx_f - sum_i b_if d/dx_(p_i)."""
        tower = self.tower
        total = tower.diff(value, self.variables[f])
        for row, pivot in zip(basis, pivots, strict=True):
            if row[f]:
                slope = tower.diff(value, self.variables[pivot])
                total = tower.lift(total) - tower.lift(row[f]) * slope
        return tower.reduce(total)

    def _obstruction(
        self, matrix: list[list[Any]], basis: list[list[Any]], pivots: list[int]
    ) -> tuple[dict[tuple[int, int], list[Any]], tuple[int | None, Any, tuple[int, ...]]]:
        """The curvature, and a coefficient of d(omega_k) wedge omega_1 ... that is not zero.

        The coefficient at dx_f, dx_g and the pivots is det(a_P) d(omega_k)(X_f, X_g), a_P being
        the pivot columns of independent forms; as omega_k = sum_i a_(k, p_i) (reduced row i),
        d(omega_k)(X_f, X_g) = sum_i a_(k, p_i) d(reduced row i)(X_f, X_g).
        """
        tower = self.tower
        curvature = self._curvature(basis, pivots)
        nothing = (None, tower.K.zero, ())
        best: tuple[int | None, Any, tuple[int, ...]] = nothing
        for (f, g), column in curvature.items():
            for k, row in enumerate(matrix):
                value = tower.K.zero
                for pivot, entry in zip(pivots, column, strict=True):
                    value += tower.lift(row[pivot]) * tower.lift(entry)
                value = tower.reduce(value)
                if value and not tower.is_zero(value):
                    value = tower.reduce(value * self._minor(matrix, pivots))
                    size = len(value.numer) + len(value.denom)
                    if best[0] is None or size < len(best[1].numer) + len(best[1].denom):
                        best = (k, value, (f, g, *pivots))
        return curvature, best

    def _minor(self, matrix: list[list[Any]], pivots: list[int]) -> Any:
        """The determinant of the pivot columns of the first independent forms."""
        tower = self.tower
        transposed = [[tower.lift(row[p]) for row in matrix] for p in pivots]
        _, independent = tower.rref(transposed, len(matrix))
        square = [[tower.lift(matrix[k][p]) for p in pivots] for k in independent]
        return _determinant(tower, square)

    def _flag(
        self, basis: list[list[Any]], curvature: dict[tuple[int, int], list[Any]]
    ) -> tuple[list[int], list[list[Any]]]:
        """The ranks of the derived flag down to where it is stable, and the reduced rows there."""
        tower = self.tower
        flag = [len(basis)]
        while basis and any(any(column) for column in curvature.values()):
            kernel = tower.nullspace(list(curvature.values()), len(basis))
            derived = []
            for vector in kernel:
                row = [tower.K.zero] * self.width
                for factor, form in zip(vector, basis, strict=True):
                    row = [
                        a + tower.lift(factor) * tower.lift(b)
                        for a, b in zip(row, form, strict=True)
                    ]
                derived.append([tower.reduce(entry) for entry in row])
            flag.append(len(derived))
            basis, pivots = tower.rref(derived, self.width)
            curvature = self._curvature(basis, pivots)
        return flag, basis

    def _integral(self, f: Expr, reduced: list[list[Any]], pivots: list[int]) -> Integral:
        """f with its integrating factors: df = sum_i (df/dx_(p_i)) (reduced row i)."""
        tower = Tower(self.variables, [f, *(entry for row in self.rows for entry in row)])
        factors = [tower.K.zero] * len(self.forms)
        for row, pivot in zip(reduced, pivots, strict=True):
            slope = tower.element(f.diff(self.variables[pivot]))
            for k in range(len(self.forms)):
                part = tower.element(self.tower.back(row[self.width + k]))
                factors[k] = tower.lift(factors[k]) + tower.lift(slope) * part
        listed = [self.chart.back(factor_terms(tower.back(tower.reduce(mu)))) for mu in factors]
        return Integral(self.chart.back(f), tuple(listed))

    def _certificate(
        self,
        kind: Kind,
        flag: list[int],
        first: int | None,
        witness: Expr,
        where: tuple[int, ...],
    ) -> str:
        names = [str(variable.name) for variable in self.variables]
        count = len(self.forms)
        alone = count == 1
        wedge = "omega" if alone else " ^ ".join(f"omega_{k + 1}" for k in range(count))
        if flag[0] < count and not alone:
            wedge = f"({flag[0]} independent ones of omega_1 ... omega_{count})"
        if flag[0] == 0:
            return "holonomic: the form is zero identically, and constrains nothing"
        if kind is Kind.HOLONOMIC:
            return f"holonomic: d({'omega' if alone else 'omega_k'}) = 0 as the forms stand"
        if kind is Kind.INTEGRABLE:
            together = "" if alone else " for each k: the set is integrable together"
            name = "omega" if alone else "omega_k"
            return f"integrable (Frobenius): d({name}) ^ {wedge} = 0{together}"
        name = "omega" if first is None or alone else f"omega_{first + 1}"
        basis = " ^ ".join(f"d{names[j]}" for j in where)
        plain = self.chart.there(witness).is_rational_function()
        how = "" if plain else " (by its values with 60 digits at random points)"
        text = (
            f"{kind.value}: the coefficient of {basis} in d({name}) ^ {wedge} is {witness}, "
            f"not 0{how}"
        )
        if not alone:
            ranks = " > ".join(map(str, flag))
            text += f"; the derived flag has the ranks {ranks}"
        return text


def _determinant(tower: Tower, matrix: list[list[Any]]) -> Any:
    """By expansion along the first row: the sets are small."""
    if not matrix:
        return tower.K.one
    total = tower.K.zero
    for j, entry in enumerate(matrix[0]):
        if entry:
            minor = [[*row[:j], *row[j + 1 :]] for row in matrix[1:]]
            total += Integer(-1) ** j * entry * _determinant(tower, minor)
    return tower.reduce(total)
