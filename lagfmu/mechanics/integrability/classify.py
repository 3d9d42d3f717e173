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
values with 60 digits at random points (samples.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from sympy import Eq, Symbol, factor_terms, sympify
from sympy import Integral as Integral_
from sympy.physics.mechanics import dynamicsymbols

from ...errors import DerivationError
from ...model.display import Displayed
from ...model.elements import Expr
from .coefficients import Chart, pfaffian
from .echelon import rref
from .frobenius import curvature, derived_flag, exact, obstruction
from .integrals import first_integrals
from .surfaces import on_surfaces
from .tower import Tower
from .undecided import Undecided, within

__all__ = ["Classification", "Integral", "Kind", "classify", "pfaffian"]


_EFFORT = 3e6  # for the integrals of a set, and again for those of its forms one by one


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
    integrate: bool = True,
) -> Classification:
    """Classify a Pfaffian constraint, or a set of them.

    `holonomic` are functions f(q, t) that are 0 besides: the forms are classified on f = 0.  A coordinate
    in which an f is linear with a constant factor is put in; the differentials of the other f belong to the
    set, whose ranks are then those on nearly all surfaces f = const.  Ranks, witness and integrals are
    of what that leaves of the forms, and factors those modulo the differentials.

    `forms` are linear in the velocities q_j' of the `coordinates` q_j (`dynamicsymbols`), and set
    to zero; every other symbol is a generic parameter, every other function an unknown one.
    Numbers with a decimal point are read as the decimal number with 14 digits.  With
    `integrate=False`, the integrals are not looked for; else, with an effort that is
    counted in operations: the answer is the same on every machine and under any load.
    """
    given = tuple(forms) if isinstance(forms, list | tuple) else (forms,)
    plain = tuple(f.lhs - f.rhs if isinstance(f, Eq) else sympify(f) for f in given)
    for form in plain:
        pfaffian(form, coordinates)  # it is one, as it was given
    left, surfaces, free = on_surfaces(plain, tuple(coordinates), holonomic)
    return _classify(left, free, surfaces, integrate, _EFFORT)


def _classify(
    forms: tuple[Expr, ...],
    coordinates: tuple[Expr, ...],
    surfaces: tuple[Expr, ...],
    integrate: bool,
    effort: float,
) -> Classification:
    time = dynamicsymbols._t
    held = tuple(f.diff(time) for f in surfaces)
    split = [pfaffian(form, coordinates) for form in (*forms, *held)]
    rows = [[*a, a0] for a, a0 in split]
    used: set[Any] = set().union(*(entry.free_symbols for row in rows for entry in row))
    chart = Chart(coordinates, {symbol for symbol in used if isinstance(symbol, Symbol)})
    rows = [[chart.there(entry) for entry in row] for row in rows]
    each: tuple[Classification, ...] = ()
    if len(forms) > 1:
        share = effort / len(forms)
        each = tuple(_classify((form,), coordinates, surfaces, integrate, share) for form in forms)
    levels = [chart.there(f) for f in surfaces]
    known = [*levels, *(chart.there(i.f) for c in each for i in c.integrals)]
    analysis = _Analysis(forms, held, rows, chart, each)
    return analysis.run(known, levels, effort if integrate else 0.0)


class _Analysis:
    """Frobenius' theorem and the derived flag for the rows a of one-forms sum_j a_j dx_j: the forms, and
    `held`, which are differentials."""

    def __init__(
        self,
        forms: tuple[Expr, ...],
        held: tuple[Expr, ...],
        rows: list[list[Expr]],
        chart: Chart,
        each: tuple[Classification, ...],
    ) -> None:
        self.forms, self.rows, self.chart, self.each = forms, rows, chart, each
        self.all = (*forms, *held)
        self.variables = chart.variables
        self.width = len(self.variables)
        self.tower = Tower(self.variables, [entry for row in rows for entry in row])

    def run(self, known: list[Expr], levels: list[Expr], effort: float) -> Classification:
        rank = fixed = 0
        try:
            for entry in (entry for row in self.rows for entry in row if entry.has(Integral_)):
                raise Undecided(entry, "an integral, which is not looked into")
            matrix = [[self.tower.element(entry) for entry in row] for row in self.rows]
            reduced, pivots = self._echelon(matrix)
            count = len(pivots)
            fixed = len(rref(self.tower, matrix[len(self.forms) :], self.width)[1]) if levels else 0
            rank = count - fixed
            self._consistent(reduced, pivots)
            basis = [row[: self.width] for row in reduced[:count]]
            bend = curvature(self.tower, basis, pivots)
            first, witness, where = obstruction(self.tower, matrix, bend, pivots)
            flag, bottom = derived_flag(self.tower, basis, bend)
            stands = all(exact(self.tower, row) for row in matrix[: len(self.forms)])
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
        flag = [rank - fixed for rank in flag]
        depth = flag[-1]
        if stands:
            kind = Kind.HOLONOMIC
        elif depth == rank:
            kind = Kind.INTEGRABLE
        else:
            kind = Kind.PARTLY if depth else Kind.NONHOLONOMIC
        found: list[Integral] = []
        if effort and depth:
            rows = [[self.tower.back(entry) for entry in row] for row in bottom]
            with within(effort):
                candidates = first_integrals(self.rows, rows, self.variables, known)
            for f in (f for f in candidates if f not in levels):
                with suppress(Undecided):  # it has passed, but its factors may be too long
                    found.append(self._integral(f, reduced[:count], pivots))
        witness = self.chart.back(factor_terms(self.tower.back(witness)))
        text = self._certificate(kind, flag, first, witness, where)
        if effort and len(found) < depth:
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
        return rref(tower, [a + b for a, b in zip(matrix, unit, strict=True)], self.width)

    def _consistent(self, reduced: list[list[Any]], pivots: list[int]) -> None:
        """dt is no combination of the forms: else, they ask that a function of (q, t) be zero."""
        if self.width - 1 not in pivots:
            return
        row = reduced[pivots.index(self.width - 1)]
        used = [k for k in range(len(self.all)) if row[self.width + k]]
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

    def _integral(self, f: Expr, reduced: list[list[Any]], pivots: list[int]) -> Integral:
        """f with its integrating factors: df = sum_i (df/dx_(p_i)) (reduced row i)."""
        tower = Tower(self.variables, [f, *(entry for row in self.rows for entry in row)])
        f = min(f, tower.back(tower.element(f)), key=lambda e: e.count_ops())  # common factors gone
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
        count, held = len(self.forms), len(self.all) - len(self.forms)
        alone = count == 1
        wedge = "omega" if alone else " ^ ".join(f"omega_{k + 1}" for k in range(count))
        if flag[0] < count and not alone:
            wedge = f"({flag[0]} independent ones of omega_1 ... omega_{count})"
        if held:
            wedge += " ^ dg" if held == 1 else "".join(f" ^ dg_{k + 1}" for k in range(held))
        if flag[0] == 0:
            return "holonomic: the form is zero identically, and constrains nothing" + (
                " that the holonomic constraints do not" if held else ""
            )
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
