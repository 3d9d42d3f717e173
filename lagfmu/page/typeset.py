"""Equations of motion as the textbook writes them: LaTeX, and plain text in one line.

    d/dt dL/dv_j - dL/dq_j = Q_nc,j + sum_k lambda_k a_kj      (Marion & Thornton sect. 7.5)

with dots for time derivatives and Greek letters for their names: theta -> \\theta, der(theta,2) ->
\\ddot{\\theta}, lambda.surface -> \\lambda_{\\mathrm{surface}}.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any

import sympy as sp
from sympy.core.alphabets import greeks
from sympy.printing.latex import LatexPrinter, tex_greek_dictionary
from sympy.printing.pretty.pretty_symbology import greek_unicode
from sympy.printing.str import StrPrinter

from ..mechanics import simplification
from ..mechanics.equations import EquationsOfMotion
from ..mechanics.form import Form
from ..mechanics.formulations.minimal import Reduction
from ..mechanics.formulations.nullspace import lambda_free, largest_group
from ..model.elements import TIME, Expr, name_of
from ..model.model import Contact, Nonholonomic
from ..model.reactions import multiplier
from ..model.units import SUPERSCRIPT
from ..names import SLIP, derivative, rate_of, read
from ..names import name as name_of_variable

Printed = tuple[str, str]  # LaTeX, text
MOST = 24  # equations of a kind that are printed
LONGEST = 500  # operations beyond which an expression is not printed
MINORS = 3  # constraints in one group beyond which lambda is not eliminated in symbols
GREEK = {*greeks, *(name.capitalize() for name in greeks), "lambda", "Lambda"}
OF_BODIES = {  # what the literature calls the quantities of a body
    **{"position": "", "orientation": "phi", "velocity": "v", "omega": "omega"},
    **{"mass": "m", "inertia": "J"},
}
PARTS = re.compile(r"([A-Za-z]+?)(\d*)((?:_[A-Za-z0-9]+)*)_?\Z")
SUBSCRIPT = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
DOTS = ("", "\u0307", "\u0308", "\u20db")


@dataclass(frozen=True)
class Equation:
    """One equation (or several that belong together), and the coordinate or constraint it is of."""

    label: str
    latex: str
    text: str


@dataclass(frozen=True)
class Section:
    """Equations of one kind, with a sentence that says what they are."""

    title: str
    remark: str
    equations: tuple[Equation, ...]


def typeset(form: Form) -> tuple[Section, ...]:
    """The equations of a model in a formulation, ready for reading."""
    eom, reduction = form.equations, form.reduction
    page = _Typesetter(eom, reduction)
    if eom.model.parts:
        return (page.parts(),) + ((page.frictions(),) if eom.frictions else ())
    sections = [page.energies(), page.lagrange()]
    if not eom.moves_plainly:
        sections.insert(1, page.kinematics())
    if eom.m:
        sections += [page.constraints(), page.forces(), page.accelerations()]
    if eom.frictions:
        sections.append(page.frictions())
    if form.formulation == "nullspace" and eom.m:
        sections.append(page.without_lambda())
    if reduction is not None:
        sections += [page.embedding(reduction), page.reduced(reduction)]
    if eom.outputs:
        sections.append(page.outputs())
    return tuple(sections)


def name_latex(name: str, dots: int = 0) -> str:
    """A name as LaTeX: theta_1 -> \\theta_{1}, slide -> \\mathrm{slide}; with up to 3 dots."""
    base, subscripts = _parts(name)
    letter = _letter(base)
    if dots:
        letter = f"\\{'d' * dots}ot{{{letter}}}"
    if subscripts:
        letter += f"_{{{','.join(_letter(s) for s in subscripts)}}}"
    return letter


def name_text(name: str, dots: int = 0) -> str:
    """A name as text: theta_1 -> θ₁, der(theta) -> θ with a dot; der(slide,2) stays as it is."""
    base, subscripts = _parts(name)
    letter = _greek(base)
    if dots and len(letter) > 1:
        return derivative(name, dots)
    tail = "".join(
        s.translate(SUBSCRIPT) if s.isdigit() and len(subscripts) == 1 else f"_{_greek(s)}"
        for s in subscripts
    )
    return letter + DOTS[dots] + tail


def _parts(name: str) -> tuple[str, tuple[str, ...]]:
    """theta0 -> theta, (0,); mu_s -> mu, (s,); crank.position.x -> x, (crank,); crank.inertia.xx -> J,
    (xx, crank); a name of another form is one word."""
    body, *words = name.split(".")
    if words and words[0] in OF_BODIES:
        letters = [w for w in (OF_BODIES[words[0]], *words[1:]) if w]
        return letters[0], (*letters[1:], body)
    match = PARTS.match(name)
    if match is None:
        return name, ()
    base, digits, rest = match.groups()
    subscripts = tuple(s for s in (digits, *rest.split("_")) if s)
    if len(base) > 1 and base not in GREEK:
        return name, ()
    return base, subscripts


def _letter(word: str) -> str:
    if word in GREEK:
        return str(tex_greek_dictionary.get(word, f"\\{word}"))
    if word.isdigit() or len(word) == 1:
        return word
    return f"\\mathrm{{{word}}}".replace("_", "\\_")


def _greek(word: str) -> str:
    return str(greek_unicode.get(word, word))


# --------------------------------------------------------------------------------- printers


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
            written[symbol] = f"\\lambda_{{{_letter(c.name)}}}", f"λ_{c.name}"
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
            product = sp.factor_terms(a) if a.is_Add else a
            if sum(not b.is_Number for b in sp.Mul.make_args(product)) > 1:
                a = product  # m (cos(theta) + 1) rather than m cos(theta) + m
            if a.is_Number or (a.is_Mul and a.args[0].is_Rational and a.args[0].q != 1):
                out.append(self.show(a * symbol))  # half of it: the symbol goes above the bar
            elif a.is_Add:
                out.append(_joined([*self._sum(a), self.show(symbol)]))
            else:
                out.append(_joined([self.factor(a), self.show(symbol)]))
        return out


def _joined(factors: Sequence[Printed]) -> Printed:
    latex = " ".join(a for a, _ in factors)
    text = " ".join(b for _, b in factors)
    return latex.replace("- ", "-", 1) if latex.startswith("- ") else latex, (
        text.replace("- ", "-", 1) if text.startswith("- ") else text
    )


def _put(latex: str, text: str, of: Printed) -> Printed:
    """What is printed, within these two."""
    return latex.format(of[0]), text.format(of[1])


def _magnitude(of: Printed) -> Printed:
    return _put("\\left|{}\\right|", "|{}|", of)


def _total(terms: Sequence[Printed]) -> Printed:
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


def _tidy(expression: Expr) -> Expr:
    """The shortest of a few equal forms."""
    expression = sp.sympify(expression)
    size = expression.count_ops()
    if size > LONGEST:
        return expression
    flat = simplification.expanded(expression)
    forms = [expression, flat, simplification.sums_of_angles(flat)]
    return min(forms, key=lambda e: e.count_ops())


def _factored(expression: Expr) -> Expr:
    """A short expression as a product, if that is shorter."""
    if expression.has(sp.Float):
        return _tidy(expression)
    return min((_tidy(expression), simplification.product(expression)), key=lambda e: e.count_ops())


# --------------------------------------------------------------------------------- sections


class _Typesetter:
    def __init__(self, eom: EquationsOfMotion, reduction: Reduction | None) -> None:
        self.eom = eom
        self.notation = Notation(eom, reduction)
        self.vdot = eom.vdot

    def section(
        self,
        title: str,
        remark: str,
        equations: Iterable[tuple[str, Sequence[Printed]]],
        count: int = 0,
    ) -> Section:
        """`equations`: label, and the sides and signs that stand one after the other; `count`: all."""
        lines = tuple(Equation(label, *_joined(parts)) for label, parts in islice(equations, MOST))
        if count > MOST:
            remark += f" The first {MOST} of {count} are shown."
        return Section(title, remark, lines)

    def parts(self) -> Section:
        """What a mechanism is made of, a line each."""
        lines = tuple(
            Equation(name, f"\\text{{{text}}}", text) for name, text in self.eom.model.parts
        )
        remark = (
            "Of each body Newton's and Euler's equations hold, m r̈ = F and J ω̇ + ω × J ω = M. The "
            "multipliers λ of a joint's rows are forces [N] and torques [N·m] on its second body; force.NAME "
            "and torque.NAME are all that it receives, about its marker, in the axes of the first marker."
        )
        return Section("Bodies, joints and loads", remark, lines)

    def energies(self) -> Section:
        show = self.notation.show
        v, M = self.eom.v, self.eom.M.todok()
        mass = {ij: _tidy(m) for ij, m in M.items()} if self.eom.nv <= MOST else M
        T = sp.Add(*(m * v[i] * v[j] / 2 for (i, j), m in mass.items()))
        equations = [("kinetic energy", [("T =", "T ="), show(_energy(T))])]
        if self.eom.potential is not None:
            equations.append(
                ("potential energy", [("V =", "V ="), show(_energy(self.eom.potential))])
            )
        return self.section("Energies", "", equations)

    def frictions(self) -> Section:
        """Coulomb's law: |lambda| <= static |N| where it sticks, lambda = -kinetic |N| s/|s| where not."""
        show, factor = self.notation.show, self.notation.factor
        rows = {c.name: k for k, c in enumerate(self.eom.constraints)}

        def slip(row: str) -> Printed:
            """Of a mechanism's joint as the FMU calls it: in the speeds of bodies it would fill lines."""
            if self.eom.model.parts:
                return f"s_{{{_letter(row)}}}", name_of_variable(SLIP, row)
            k = rows[row]
            moved = sp.Add(*(self.eom.G[k, j] * v for j, v in enumerate(self.eom.v)))
            return show(_tidy(moved - self.eom.nu[k]))

        def vector(components: Sequence[Printed]) -> Printed:
            """In brackets, if it has several components."""
            latex, text = (", ".join(parts) for parts in zip(*components, strict=True))
            several = len(components) > 1
            return _put("\\left({}\\right)", "({})", (latex, text)) if several else (latex, text)

        equations: list[tuple[str, Sequence[Printed]]] = []
        for law in self.eom.frictions:
            size = _magnitude(show(law.normal)) if len(law.parts) == 1 else factor(law.normal)
            force = vector([show(multiplier(row)) for row in law.of])
            speed = vector([slip(row) for row in law.of])
            s = ("s", "s") if len(law.of) > 1 else speed
            stick = [_magnitude(force), ("\\le", "≤"), factor(law.static), size]
            equations.append((f"{law.name} sticks", stick))
            text = "({0})/|{0}|" if " " in s[1] else "{0}/|{0}|"
            sign = _put("\\frac{{{0}}}{{\\left|{0}\\right|}}", text, s)
            slide = [force, ("=", "="), _put("-{}", "-{}", factor(law.kinetic)), size, sign]
            if len(law.of) > 1:
                slide += [("\\text{with } s =", "with s ="), speed]
            equations.append((f"{law.name} slips", slide))
        remark = (
            "What a friction limits holds as long as it sticks; where it slips this is its force."
        )
        return self.section("Coulomb's law", remark, equations)

    def lagrange(self) -> Section:
        """(M vdot)_j - (F - Q_nc)_j = Q_nc,j + sum_k lambda_k a_kj."""
        eom, model = self.eom, self.eom.model
        equations = []
        forces = {name_of(c): force for c, force in model.forces.items()}
        for j, direction in enumerate(eom.directions[:MOST]):
            given = _tidy(eom.plain(forces.get(direction, 0)))
            left = self._motion(eom, j, self.vdot, given)
            right = self.terms(given) + self.multiplied(eom.G, range(eom.m), j)
            equations.append((direction, [left, ("=", "="), _total(right)]))
        if model.lagrangian is not None:
            left_text, force = "d/dt ∂L/∂q̇ − ∂L/∂q", "the non-conservative forces"
        else:
            left_text, force = "d/dt ∂T/∂q̇ − ∂T/∂q", "the generalized forces"
        sides = [force] * bool(model.forces) + ["the forces of constraint"] * bool(eom.m)
        each = "for each coordinate q"
        if not eom.moves_plainly:
            each = "in the direction of each speed (the equations of Boltzmann and Hamel)"
        remark = f"On the left {left_text} {each}, on the right {' and '.join(sides) or 'zero'}."
        title = "Lagrange's equations" + (" with multipliers" if eom.m else "")
        return self.section(title, remark, equations, eom.nv)

    def _motion(
        self, eom: EquationsOfMotion, j: int, vdot: Sequence[Expr], given: Expr = sp.S.Zero
    ) -> Printed:
        """M vdot - F + given, in coordinate j."""
        row = [(i, _tidy(eom.M[j, i])) for i in range(eom.nv) if eom.M[j, i] != 0]
        inertia = self.notation.linear((mass, vdot[i]) for i, mass in row)
        rest = _tidy(given - eom.F[j])
        short = simplification.gathered(rest, eom.p, eom.q)
        return _total(inertia + self.terms(min(short, rest, key=lambda e: e.count_ops())))

    def terms(self, expression: Expr) -> list[Printed]:
        """The expression as what may follow other terms."""
        return [] if expression == 0 else [self.notation.show(expression)]

    def multiplied(self, G: Expr, rows: Sequence[int], j: int) -> list[Printed]:
        """The terms a_kj lambda_k; `rows` are the numbers of G's rows among all constraints."""
        multipliers = self.notation.multipliers
        return self.notation.linear(
            (_tidy(G[k, j]), multipliers[row]) for k, row in enumerate(rows)
        )

    def constraints(self) -> Section:
        eom, show = self.eom, self.notation.show
        equations = []
        contacts = False
        for k, c in enumerate(eom.constraints[:MOST]):
            label = c.name
            closed = getattr(c, "while_closed", None)
            if closed is not None:
                label += f", while {closed} is closed"
            if isinstance(c, Nonholonomic):
                row = ((_tidy(eom.G[k, j]), eom.v[j]) for j in range(eom.nv))
                left = _total(self.notation.linear(row) + self.terms(_tidy(-eom.nu[k])))
                parts = [left, ("= 0", "= 0")]
            else:
                parts = [show(eom.f[k]), ("= 0", "= 0")]
            if isinstance(c, Contact):
                contacts = True
                lam, f = show(self.notation.multipliers[k]), self.notation.factor(eom.f[k])
                positive = "\\geq 0,\\quad", "≥ 0,"
                parts = [show(eom.f[k]), positive, lam, positive, lam, f, ("= 0", "= 0")]
            equations.append((label, parts))
        remark = ""
        if contacts:
            remark = "A contact pushes and never pulls: it is closed, or its multiplier is zero."
        return self.section("Constraints", remark, equations, eom.m)

    def forces(self) -> Section:
        equations = []
        for j, q in enumerate(self.eom.directions[:MOST]):
            right = self.multiplied(self.eom.G, range(self.eom.m), j)
            left = f"Q_{{{name_latex(q)}}} =", f"Q_{name_text(q)} ="
            equations.append((q, [left, _total(right)]))
        remark = (
            "Q = Gᵀλ stands with a plus on the side of the forces; a multiplier is zero while its "
            "constraint does not act."
        )
        return self.section("Generalized forces of constraint", remark, equations, self.eom.nv)

    def kinematics(self) -> Section:
        """q' = B v + b."""
        equations = []
        for q, rate in islice(zip(self.eom.q, self.eom.qdot, strict=True), MOST):
            left = f"\\dot{{{name_latex(str(q))}}} =", f"d{name_text(str(q))}/dt ="
            equations.append((str(q), [left, self.notation.show(_tidy(rate))]))
        remark = "How the coordinates move by the speeds."
        four = [[str(self.eom.q[j]) for j in places] for places in self.eom.quaternions]
        if four:
            each = "; ".join(", ".join(names) for names in four[:MOST])
            remark += f" A unit quaternion: {each}."
        return self.section("Kinematics", remark, equations, self.eom.nq)

    def accelerations(self) -> Section:
        eom = self.eom
        equations = []
        for k, c in enumerate(eom.constraints[:MOST]):
            row = ((_tidy(eom.G[k, j]), self.vdot[j]) for j in range(eom.nv))
            left = _total(self.notation.linear(row))
            equations.append((c.name, [left, ("=", "="), self.notation.show(_tidy(eom.gamma[k]))]))
        remark = (
            "The constraints differentiated to accelerations, G v̇ = γ: with Lagrange's equations "
            "they determine v̇ and λ."
        )
        return self.section("Constraints as accelerations", remark, equations, eom.m)

    def without_lambda(self) -> Section:
        title = "Equations without multipliers"
        if largest_group(self.eom) > MINORS:
            remark = (
                f"More than {MINORS} constraints act together here: λ is eliminated numerically, "
                "Sᵀ (M v̇ − F) = 0 with G S = 0."
            )
            return Section(title, remark, ())
        equations = [
            (f"{k + 1}", [self._homogeneous(e), ("= 0", "= 0")])
            for k, e in enumerate(lambda_free(self.eom)[:MOST])
        ]
        remark = (
            "Sᵀ (M v̇ − F) = 0 with G S = 0, and G v̇ = γ, without common factors. They hold while "
            "all constraints act; λ is evaluated afterwards."
        )
        return self.section(title, remark, equations, self.eom.nv)

    def _homogeneous(self, equation: Expr) -> Printed:
        """The terms with accelerations, then the others."""
        equation = sp.sympify(equation)
        if equation.count_ops() > LONGEST:
            return self.notation.show(equation)
        rest = equation.xreplace(dict.fromkeys(self.vdot, sp.S.Zero))
        slopes = [(_factored(equation.diff(a)), a) for a in self.vdot]
        return _total(self.notation.linear(slopes) + self.terms(_tidy(rest)))

    def embedding(self, reduction: Reduction) -> Section:
        equations = []
        for q, phi in zip(self.eom.q, reduction.phi, strict=True):
            if q != phi:
                left, right = self.notation.show(q), self.notation.show(phi)
                equations.append((str(q), [left, ("=", "="), right]))
        remark = "What the independent coordinates determine, q = φ(s)."
        return self.section("Dependent coordinates", remark, equations, len(equations))

    def reduced(self, reduction: Reduction) -> Section:
        eom = reduction.reduced
        sddot = eom.vdot
        equations = []
        for j, s in enumerate(eom.q[:MOST]):
            right = self.multiplied(eom.G, reduction.rows, j)
            equations.append((str(s), [self._motion(eom, j, sddot), ("=", "="), _total(right)]))
        remark = (
            "The equations that are integrated, in the independent coordinates; λ is recovered "
            "from Lagrange's equations with multipliers."
        )
        return self.section("Reduced equations", remark, equations, eom.nv)

    def outputs(self) -> Section:
        """What the model reports of its own."""
        equations = []
        for o in self.eom.outputs[:MOST]:
            of = read(o.name)
            left = ".".join(_letter(part) for part in of.coordinate.split(".")), o.name
            if of.order:
                left = f"\\{'d' * of.order}ot{{{left[0]}}}", o.name
            equations.append((o.name, [left, ("=", "="), self.notation.show(o.expression)]))
        remark = "Quantities that the model names itself, of values of the same instant."
        return self.section("Outputs of the model", remark, equations, len(self.eom.outputs))


def _energy(E: Expr) -> Expr:
    """An energy in the shorter of its forms, with common factors taken out or not."""
    if E.count_ops() > LONGEST:
        return E
    tidy = _tidy(E)
    return min((tidy, sp.factor_terms(E), sp.factor_terms(tidy)), key=lambda e: e.count_ops())
