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
values at random points (zero.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from sympy import Dummy, Eq, S, expand, eye, factor_terms, simplify, sympify

from ...errors import DerivationError
from ...model.display import Displayed
from ...model.elements import TIME, Expr
from .frobenius import Reduced, closed, curvature, derived_flag, first_integrals, obstruction, rref
from .zero import DIGITS, Undecided, plain, short, slope

_SHORT = 60  # operations of a coordinate's value that is put in


def pfaffian(form: Expr, coordinates: Sequence[Expr]) -> tuple[list[Expr], Expr]:
    """The coefficients (a_1, ..., a_n) and a_0 of sum_j a_j q_j' + a_0.

    Raises `DerivationError`, which names the term, if the form is not linear in the velocities.
    """
    form = form.lhs - form.rhs if isinstance(form, Eq) else sympify(form)
    if any(form.has(q.diff(TIME, 2)) for q in coordinates):
        raise DerivationError(
            f"constraint {form} has accelerations: a Pfaffian constraint is linear in the "
            "velocities; integrate it once, or leave it to the dynamics"
        )
    speeds = {q.diff(TIME): Dummy(f"v{j}") for j, q in enumerate(coordinates)}
    plain = form.xreplace(speeds)
    v = list(speeds.values())
    coefficients = [plain.diff(speed) for speed in v]
    coefficients = [simplify(expand(a)) if a.has(*v) else a for a in coefficients]
    if any(a.has(*v) for a in coefficients):
        back = {speed: rate for rate, speed in speeds.items()}
        terms = [
            str(term.xreplace(back))
            for term in expand(plain).as_ordered_terms()
            if any(term.diff(one, two) != 0 for one in v for two in v)
        ]
        raise DerivationError(
            f"constraint {form} is not linear in the velocities: {', '.join(terms) or form}; "
            "a Pfaffian constraint is sum_j a_j(q, t)*q_j' + a_0(q, t) = 0"
        )
    return coefficients, plain.xreplace(dict.fromkeys(v, S.Zero))


class Chart:
    """Coordinates q_j(t) and t as independent real symbols, and back."""

    def __init__(self, coordinates: Sequence[Expr], entries: Sequence[Expr]) -> None:
        used: set[Any] = set().union(*(entry.free_symbols for entry in entries))
        names = [str(getattr(q, "func", q)) for q in coordinates]
        self.variables = [Dummy(name, real=True) for name in [*names, "t"]]
        self._there = dict(zip([*coordinates, TIME], self.variables, strict=True))
        for symbol in sorted(used - set(self._there), key=str):
            if symbol.is_extended_real is None:
                self._there[symbol] = Dummy(symbol.name, real=True)
        self._back = {value: key for key, value in self._there.items()}

    def there(self, expr: Expr) -> Expr:
        return plain(expr.xreplace(self._there))

    def back(self, expr: Expr) -> Expr:
        return sympify(expr).xreplace(self._back)


def _on_surfaces(
    forms: Sequence[Expr], coordinates: Sequence[Expr], holonomic: Sequence[Expr]
) -> tuple[tuple[Expr, ...], tuple[Expr, ...], tuple[Expr, ...]]:
    """The forms, the f and the coordinates that are left.

    An f that is linear in a coordinate, with a factor that is constant, is solved for it, and the
    coordinate and its velocity are put into the forms and into the other f: exact, and f is gone.  An f
    that is not stays, and its differential has to join the forms.
    """
    left, kept, free = list(forms), [], list(coordinates)
    surfaces = sorted(map(sympify, holonomic), key=lambda f: f.count_ops())
    while surfaces:
        f = surfaces.pop(0)
        solved = ((q, expand(q - f / f.diff(q))) for q in free if _is_constant(f.diff(q)))
        q, value = next(solved, (None, S.NaN))
        if q is None or value.count_ops() > _SHORT:
            kept.append(f)
            continue
        free.remove(q)
        put = {q.diff(TIME): value.diff(TIME)}
        left, surfaces, kept = (
            [e.xreplace(put).xreplace({q: value}) for e in group]
            for group in (left, surfaces, kept)
        )
    return tuple(left), tuple(f for f in kept if f != 0), tuple(free)


def _is_constant(factor: Expr) -> bool:
    """It depends on parameters alone, and is not zero whatever they are."""
    if factor.has(TIME):
        return False
    return bool(factor.is_Symbol or factor.is_nonzero)


__all__ = ["Classification", "Integral", "Kind", "classify", "pfaffian"]


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
class Classification(Displayed):
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


def classify(
    forms: Sequence[Expr] | Expr,
    coordinates: Sequence[Expr],
    *,
    holonomic: Sequence[Expr] = (),
) -> Classification:
    """Classify a Pfaffian constraint, or a set of them.

    `holonomic` are functions f(q, t) that are 0 besides: the forms are classified on f = 0.  A coordinate
    in which an f is linear with a constant factor is put in; the differentials of the other f belong to the
    set, whose ranks are then those on nearly all surfaces f = const.  Ranks, witness and integrals are
    of what that leaves of the forms, and factors those modulo the differentials.

    `forms` are linear in the velocities q_j' of the `coordinates` q_j (`dynamicsymbols`), and set
    to zero; every other symbol is a generic parameter, every other function an unknown one.
    Numbers with a decimal point are read as the decimal number with 14 digits.  Integrals are found where
    an integrating factor is simple and they are elementary; else the certificate says that there is no
    closed form found.  What would take too long is told by the sizes of expressions, not by a clock: the
    answer is the same on every machine and under any load.
    """
    given = tuple(forms) if isinstance(forms, list | tuple) else (forms,)
    plain = tuple(f.lhs - f.rhs if isinstance(f, Eq) else sympify(f) for f in given)
    for form in plain:
        pfaffian(form, coordinates)  # it is one, as it was given
    left, surfaces, free = _on_surfaces(plain, tuple(coordinates), holonomic)
    return _classify(left, free, surfaces)


def _classify(
    forms: tuple[Expr, ...],
    coordinates: tuple[Expr, ...],
    surfaces: tuple[Expr, ...],
) -> Classification:
    each: tuple[Classification, ...] = ()
    if len(forms) > 1:
        each = tuple(_classify((form,), coordinates, surfaces) for form in forms)
    system = _System(forms, coordinates, surfaces)
    back = system.chart.back
    try:
        kind, flag, bottom, text, witness = system.proof()
    except Undecided as undecided:
        expr = back(undecided.expr)
        text = f"undecided: whether {expr} is zero decides the answer, and it is {undecided.reason}"
        return Classification(Kind.UNDECIDED, forms, system.rank, None, (), text, expr, each)
    depth = flag[-1]
    found = system.integrals(bottom, [i.f for c in each for i in c.integrals]) if depth else ()
    if len(found) < depth:
        text += f"; no closed form found for {depth - len(found)} of {depth} integrals"
    return Classification(kind, forms, system.rank, depth, found, text, witness, each, flag)


class _System:
    """The one-forms of a set, and the differentials of the surfaces that they are held on."""

    def __init__(
        self, forms: tuple[Expr, ...], coordinates: tuple[Expr, ...], surfaces: tuple[Expr, ...]
    ) -> None:
        self.forms = forms
        self.all = (*forms, *(f.diff(TIME) for f in surfaces))
        rows = [[*a, a0] for a, a0 in (pfaffian(form, coordinates) for form in self.all)]
        self.chart = Chart(coordinates, [entry for row in rows for entry in row])
        self.rows = [[self.chart.there(entry) for entry in row] for row in rows]
        self.levels = [self.chart.there(f) for f in surfaces]
        self.rank = 0

    def proof(self) -> tuple[Kind, tuple[int, ...], Reduced, str, Expr]:
        """Frobenius' theorem: the kind, the derived flag and the rows at its bottom, certificate, witness."""
        x = self.chart.variables
        unit = eye(len(self.all)).tolist()
        whole = [a + b for a, b in zip(self.rows, unit, strict=True)]  # each with what it is of
        self.reduced = rref(whole, len(x))
        pivots = self.reduced.pivots
        held = len(rref(self.rows[len(self.forms) :], len(x)).pivots)
        self.rank = len(pivots) - held
        self._consistent()
        basis = Reduced([row[: len(x)] for row in self.reduced.rows[: len(pivots)]], pivots)
        bend = curvature(basis, x)
        first, value, where = obstruction(self.rows, bend, pivots)
        ranks, bottom = derived_flag(basis, bend, x)
        flag = tuple(rank - held for rank in ranks)
        if all(closed(row, x) for row in self.rows[: len(self.forms)]):
            kind = Kind.HOLONOMIC
        elif flag[-1] == self.rank:
            kind = Kind.INTEGRABLE
        else:
            kind = Kind.PARTLY if flag[-1] else Kind.NONHOLONOMIC
        witness = self.chart.back(factor_terms(value))
        return kind, flag, bottom, self._certificate(kind, flag, first, witness, where), witness

    def integrals(self, bottom: Reduced, known: list[Expr]) -> tuple[Integral, ...]:
        """Integrals of the rows, besides the surfaces themselves."""
        known = [*self.levels, *map(self.chart.there, known)]
        found = first_integrals(self.rows, bottom, self.chart.variables, known)
        return tuple(self._integral(f) for f in found if f not in self.levels)

    def _integral(self, f: Expr) -> Integral:
        """f with its integrating factors: df = sum_i (df/dx_(p_i)) (reduced row i)."""
        x = self.chart.variables
        slopes = [slope(f, x[pivot]) for pivot in self.reduced.pivots]
        factors = []
        for k in range(len(self.forms)):
            pairs = zip(slopes, self.reduced.rows, strict=False)
            mu = short(sum(df * row[len(x) + k] for df, row in pairs))
            factors.append(self.chart.back(factor_terms(mu)))
        return Integral(self.chart.back(f), tuple(factors))

    def _consistent(self) -> None:
        """dt is no combination of the forms: else, they ask that a function of (q, t) be zero."""
        width = len(self.chart.variables)
        if width - 1 not in self.reduced.pivots:
            return
        row = self.reduced.rows[-1 + len(self.reduced.pivots)]
        used = [k for k in range(len(self.all)) if row[width + k] != 0]
        if len(used) == 1 and not any(self.rows[used[0]][:-1]):
            raise DerivationError(
                f"constraint {self.all[used[0]]} has no velocity in it: it is no Pfaffian "
                "constraint; if it is f(q, t) = 0, it is holonomic as it stands, and its Pfaffian "
                "form is its derivative by time"
            )
        names = ", ".join(str(self.all[k]) for k in used)
        raise DerivationError(
            f"contradictory constraints {names}: a combination of them has no velocity in it, and "
            "is not zero; remove or correct one of them"
        )

    def _certificate(
        self,
        kind: Kind,
        flag: tuple[int, ...],
        first: int | None,
        witness: Expr,
        where: tuple[int, ...],
    ) -> str:
        count, held = len(self.forms), len(self.all) - len(self.forms)
        if flag[0] == 0:
            less = " that the holonomic constraints do not" * bool(held)
            return f"holonomic: the form is zero identically, and constrains nothing{less}"
        alone = count == 1
        each = "omega" if alone else "omega_k"
        if kind is Kind.HOLONOMIC:
            return f"holonomic: d({each}) = 0 as the forms stand"
        factors = ["omega"] if alone else [f"omega_{k + 1}" for k in range(count)]
        name = factors[first or 0]
        if flag[0] < count and not alone:
            factors = [f"({flag[0]} independent ones of omega_1 ... omega_{count})"]
        factors += ["dg"] if held == 1 else [f"dg_{k + 1}" for k in range(held)]
        wedge = " ^ ".join(factors)
        if kind is Kind.INTEGRABLE:
            together = "" if alone else " for each k: the set is integrable together"
            return f"integrable (Frobenius): d({each}) ^ {wedge} = 0{together}"
        basis = " ^ ".join(f"d{self.chart.variables[j].name}" for j in where)
        plain = self.chart.there(witness).is_rational_function()
        how = "" if plain else f" (by {DIGITS} digits of it at random points)"
        text = f"{kind.value}: the coefficient of {basis} in d({name}) ^ {wedge} is {witness}, not 0{how}"
        ranks = " > ".join(map(str, flag))
        return text if alone else f"{text}; the derived flag has the ranks {ranks}"
