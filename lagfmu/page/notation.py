"""How symbols and expressions are written: LaTeX, and plain text in one line.

Dots stand for time derivatives and Greek letters for their names: theta -> \\theta, der(theta,2) ->
\\ddot{\\theta}, lambda.surface -> \\lambda_{\\mathrm{surface}}.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

import sympy as sp
from sympy.core.alphabets import greeks
from sympy.printing.latex import LatexPrinter, tex_greek_dictionary
from sympy.printing.pretty.pretty_symbology import greek_unicode
from sympy.printing.str import StrPrinter

from ..mechanics.equations import EquationsOfMotion
from ..mechanics.formulations import Reduction
from ..model.elements import TIME, Expr
from ..model.reactions import multiplier
from ..model.units import SUPERSCRIPT
from ..names import derivative, rate_of, read

Printed = tuple[str, str]  # LaTeX, text
LONGEST = 500  # operations beyond which an expression is not printed
GREEK = {*greeks, *(name.capitalize() for name in greeks), "lambda", "Lambda"}
OF_BODIES = {  # what the literature calls the quantities of a body
    **{"position": "", "orientation": "phi", "velocity": "v", "omega": "omega"},
    **{"mass": "m", "inertia": "J"},
}
PARTS = re.compile(r"([A-Za-z]+?)(\d*)((?:_[A-Za-z0-9]+)*)_?\Z")
SUBSCRIPT = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
DOTS = ("", "\u0307", "\u0308", "\u20db")


def name_latex(name: str, dots: int = 0) -> str:
    """A name as LaTeX: theta_1 -> \\theta_{1}, slide -> \\mathrm{slide}; with up to 3 dots."""
    base, subscripts = _parts(name)
    written = letter(base)
    if dots:
        written = f"\\{'d' * dots}ot{{{written}}}"
    if subscripts:
        written += f"_{{{','.join(letter(s) for s in subscripts)}}}"
    return written


def name_text(name: str, dots: int = 0) -> str:
    """A name as text: theta_1 -> θ₁, der(theta) -> θ with a dot; der(slide,2) stays as it is."""
    base, subscripts = _parts(name)
    written = _greek(base)
    if dots and len(written) > 1:
        return derivative(name, dots)
    tail = "".join(
        s.translate(SUBSCRIPT) if s.isdigit() and len(subscripts) == 1 else f"_{_greek(s)}"
        for s in subscripts
    )
    return written + DOTS[dots] + tail


def _parts(name: str) -> tuple[str, tuple[str, ...]]:
    """theta0 -> theta, (0,); mu_s -> mu, (s,); crank.position.x -> x, (crank,); crank.inertia.xx -> J,
    (xx, crank); a name of another form is one word."""
    body, *words = name.split(".")
    letters = [w for w in (OF_BODIES.get(words[0], ""), *words[1:]) if w] if words else []
    if letters and words[0] in OF_BODIES:
        return letters[0], (*letters[1:], body)
    match = PARTS.match(name)
    if match is None:
        return name, ()
    base, digits, rest = match.groups()
    subscripts = tuple(s for s in (digits, *rest.split("_")) if s)
    if len(base) > 1 and base not in GREEK:
        return name, ()
    return base, subscripts


def letter(word: str) -> str:
    """A word as LaTeX: a Greek letter, a number or a single letter as it stands, otherwise upright."""
    if word in GREEK:
        return str(tex_greek_dictionary.get(word, f"\\{word}"))
    if word.isdigit() or len(word) == 1:
        return word
    return f"\\mathrm{{{word}}}".replace("_", "\\_")


def _greek(word: str) -> str:
    return str(greek_unicode.get(word, word))


def _positive_first(terms: Iterable[Expr]) -> list[Expr]:
    """r - a rather than -a + r."""
    return sorted(terms, key=lambda term: bool(term.could_extract_minus_sign()))


class _Latex(LatexPrinter):  # type: ignore[misc]
    def _as_ordered_terms(self, expr: Expr, order: Any = None) -> list[Expr]:
        return _positive_first(super()._as_ordered_terms(expr, order=order))


class _Text(StrPrinter):  # type: ignore[misc]
    def _as_ordered_terms(self, expr: Expr, order: Any = None) -> list[Expr]:
        return _positive_first(super()._as_ordered_terms(expr, order=order))


class Notation:
    """How each symbol is written, and in which order factors stand: m g r, not g m r by the ABC."""

    def __init__(self, eom: EquationsOfMotion, reduction: Reduction | None = None) -> None:
        written: dict[Expr, Printed] = {}
        for p in eom.p:
            written[p] = name_latex(str(p)), name_text(str(p))
        written[TIME] = "t", "t"
        places, speeds = list(eom.q), list(eom.v)
        if reduction is not None:
            places, speeds = [*places, *reduction.s], [*speeds, *reduction.sdot]
        moving = [*eom.u, *places, *speeds]
        moving += [sp.Symbol(rate_of(str(v)), real=True) for v in speeds]
        for symbol in moving:
            of = read(str(symbol))
            name, dots = of.coordinate, of.order
            written.setdefault(symbol, (name_latex(name, dots), name_text(name, dots)))
        self.multipliers = []
        for c in eom.constraints:
            symbol = multiplier(c.name)
            written[symbol] = f"\\lambda_{{{letter(c.name)}}}", f"λ_{c.name}"
            self.multipliers.append(symbol)
        for q, force in zip(eom.directions, eom.Q, strict=True):
            written[force] = f"Q_{{{name_latex(q)}}}", f"Q_{name_text(q)}"
        self.into = {s: sp.Symbol(f"x{k:06d}", **s.assumptions0) for k, s in enumerate(written)}
        names = [self.into[s] for s in written]
        latex = dict(zip(names, (a for a, _ in written.values()), strict=True))
        self.text_of = {str(s): b for s, (_, b) in zip(names, written.values(), strict=True)}
        self.latex_printer = _Latex({"symbol_names": latex})
        self.text_printer = _Text({"full_prec": False})

    def show(self, expression: Expr) -> Printed:
        """An expression in both notations; one that is too long is only counted."""
        expression = sp.sympify(expression)
        size = expression.count_ops()
        if size > LONGEST:
            what = f"{size} operations, not printed"
            return f"\\left[\\text{{{what}}}\\right]", f"[{what}]"
        renamed = expression.xreplace(self.into)
        text = self.text_printer.doprint(renamed)
        text = re.sub(r"\*\*(\d+)(?![\d.])", lambda m: m[1].translate(SUPERSCRIPT), text)
        text = text.replace("**", "^").replace("*", " ").replace("sqrt(", "√(")
        text = re.sub(r"x\d{6}", lambda m: self.text_of[m[0]], text)
        return self.latex_printer.doprint(renamed), text

    def factor(self, expression: Expr) -> Printed:
        """An expression that stands before another factor: in brackets if it is a sum."""
        latex, text = self.show(expression)
        if expression.xreplace(self.into).is_Add:  # 2*(x - s), rebuilt, is a sum
            return f"\\left({latex}\\right)", f"({text})"
        return latex, f"({text})" if "/" in text else text

    def _sum(self, a: Expr) -> list[Printed]:
        """A sum as factors: 2*x - 2*s as 2 and (x - s); a sign in front of all terms goes ahead."""
        number, rest = a.primitive()
        if number.q != 1:
            number, rest = sp.S.One, a
        if all(term.could_extract_minus_sign() for term in rest.args):
            number, rest = -number, -rest
        if number == 1:
            return [self.factor(rest)]
        front = ("-", "-") if number == -1 else self.show(number)
        return [front, self.factor(rest)]

    def linear(self, terms: Iterable[tuple[Expr, Expr]]) -> list[Printed]:
        """The terms coefficient * symbol."""
        out = []
        for a, symbol in terms:
            if a == 0:
                continue
            short = a.is_Add and a.count_ops() <= LONGEST  # what is longer is only counted
            product = sp.factor_terms(a) if short else a
            if sum(not b.is_Number for b in sp.Mul.make_args(product)) > 1:
                a = product  # m (cos(theta) + 1) rather than m cos(theta) + m
            if a.is_Number or (a.is_Mul and a.args[0].is_Rational and a.args[0].q != 1):
                out.append(self.show(a * symbol))  # half of it: the symbol goes above the bar
            elif a.is_Add:
                out.append(joined([*self._sum(a), self.show(symbol)]))
            else:
                out.append(joined([self.factor(a), self.show(symbol)]))
        return out


def joined(factors: Sequence[Printed]) -> Printed:
    """Factors one behind the other, a minus sign close to what it stands before."""
    latex = " ".join(a for a, _ in factors)
    text = " ".join(b for _, b in factors)
    return latex.replace("- ", "-", 1) if latex.startswith("- ") else latex, (
        text.replace("- ", "-", 1) if text.startswith("- ") else text
    )


def put(latex: str, text: str, of: Printed) -> Printed:
    """What is printed, within these two."""
    return latex.format(of[0]), text.format(of[1])


def magnitude(of: Printed) -> Printed:
    """What is printed, between bars."""
    return put("\\left|{}\\right|", "|{}|", of)


def total(terms: Sequence[Printed]) -> Printed:
    """Terms joined by + and -."""
    if not terms:
        return "0", "0"
    sides = []
    for texts in zip(*terms, strict=True):
        whole = texts[0]
        for text in texts[1:]:
            whole += f" - {text[1:].lstrip()}" if text.startswith("-") else f" + {text}"
        sides.append(whole)
    return sides[0], sides[1]
