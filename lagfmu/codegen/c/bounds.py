"""How fast the indicators of events can change: their rates in interval arithmetic, as C99.

    f' = G v - nu  of a contact,   h' = dh/dt + dh/dq v  of a jump of the forces

evaluated for boxes of t, q, v and u, they bound what f and h can have done between two looks (Moore,
Interval Analysis, 1966).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy as sp
from sympy.core.relational import Relational

from ...mechanics.equations import EquationsOfMotion
from ...mechanics.jumps import Jumps
from ...model.attitude import written_out
from ...model.differential import Differential
from ...model.elements import TIME, Expr
from ...model.model import Constraint, Contact

FUNCTIONS = {
    **{f: f.__name__ for f in (sp.sin, sp.cos, sp.tan, sp.exp, sp.log, sp.atan, sp.asin, sp.acos)},
    **{f: f.__name__ for f in (sp.sinh, sp.cosh, sp.tanh, sp.asinh, sp.atan2, sp.sign, sp.floor)},
    sp.Abs: "magnitude",
    sp.Heaviside: "heaviside",
    sp.Min: "smaller",
    sp.Max: "larger",
}


class _UnknownError(Exception):
    """A function whose bounds are not known."""


def rates(eom: EquationsOfMotion, constraints: Sequence[Constraint], jumps: Jumps) -> list[Expr]:
    """d/dt of the indicators whose bounds are wanted, written out: f of the contacts, then h of the jumps."""
    contacts = [k for k, c in enumerate(constraints) if isinstance(c, Contact)]
    entries = eom.G.todok().items()
    found = [
        sp.Add(*(a * eom.v[j] for (i, j), a in entries if i == k), -eom.nu[k]) for k in contacts
    ]
    moving = dict(zip(eom.q, eom.qdot, strict=True)) | dict(eom.rates) | {TIME: sp.S.One}
    if jumps.surfaces:
        names = {str(s): s for s in (*eom.q, *eom.u)}
        direction = {s: moving[s] for s in moving if s is TIME or str(s) in names}
        d = Differential(direction | {_plain(s): r for s, r in direction.items()})
        found += [d(s.h) for s in jumps.surfaces]
    return [*map(written_out, found)]


def _plain(s: Expr) -> Expr:
    return sp.Symbol(str(s), real=True) if s.is_real is None else s


def body(expressions: Sequence[Expr], places: Mapping[Expr, str]) -> tuple[list[str], list[str]]:
    """Statements `name = text` that compute common parts, and the text of each rate; one of which nothing
    is known is no number.  `places`: where each symbol's interval stands."""
    known = [e if _is_known(e) else None for e in map(sp.sympify, expressions)]
    printer = _Printer(places)
    common, reduced = sp.cse([e for e in known if e is not None], order="none", list=True)
    statements = []
    for s, e in common:
        text = printer(e)
        printer.places[s] = str(s)
        statements.append(f"{s} = {text}")
    texts = iter([printer(e) for e in reduced])
    return statements, ["interval_unknown()" if e is None else next(texts) for e in known]


def _is_known(e: Expr) -> bool:
    try:
        _Printer({})(e)
    except _UnknownError:
        return False
    return True


class _Printer:
    """The text of an expression of intervals."""

    def __init__(self, places: Mapping[Expr, str]) -> None:
        self.places = dict(places)

    def __call__(self, e: Expr) -> str:
        if e.is_Symbol:
            return self.places.get(e, str(e))
        if e.is_Rational or e.is_Float or e.is_NumberSymbol:
            return self._of("of", repr(float(e)))
        if e.is_Add or e.is_Mul:
            return self._chain("add" if e.is_Add else "mul", e.args)
        if e.is_Pow:
            return self._power(e)
        if isinstance(e, (sp.Min, sp.Max)):
            return self._chain(FUNCTIONS[e.func], e.args)
        if isinstance(e, sp.Piecewise):
            return self._piecewise(e)
        if isinstance(e, sp.Heaviside):
            return self._of("heaviside", self(e.args[0]))
        if e.func in FUNCTIONS:
            return self._of(FUNCTIONS[e.func], *(self(a) for a in e.args))
        raise _UnknownError(str(e.func))

    def _of(self, name: str, *arguments: str) -> str:
        return f"interval_{name}({', '.join(arguments)})"

    def _chain(self, name: str, parts: Sequence[Expr]) -> str:
        text = self(parts[0])
        for part in parts[1:]:
            text = self._of(name, text, self(part))
        return text

    def _power(self, e: Expr) -> str:
        base, exponent = e.base, e.exp
        if base is sp.E:
            return self._of("exp", self(exponent))
        if exponent.is_Integer:
            return self._of("power", self(base), str(int(exponent)))
        if exponent.is_Rational and exponent.q == 2:
            return self._of("power", self._of("sqrt", self(base)), str(int(exponent.p)))
        product = self._of("mul", self(exponent), self._of("log", self(base)))
        return self._of("exp", product)

    def _piecewise(self, e: Expr) -> str:
        *cases, last = e.args
        text = self(last.expr)
        for case in reversed(cases):
            h = _side(case.cond)
            one = self(case.expr)
            text = (
                self._of("hull", one, text) if h is None else self._of("choose", self(h), one, text)
            )
        return text


def _side(condition: Expr) -> Expr | None:
    """h if the condition is h > 0 or h >= 0."""
    if not isinstance(condition, Relational):
        return None
    if condition.rel_op in (">", ">="):
        return condition.lhs - condition.rhs
    if condition.rel_op in ("<", "<="):
        return condition.rhs - condition.lhs
    return None
