"""Equations of motion as the textbook writes them, section by section.

d/dt dL/dv_j - dL/dq_j = Q_nc,j + sum_k lambda_k a_kj      (Marion & Thornton sect. 7.5)
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import islice

import sympy as sp

from ..mechanics import simplification
from ..mechanics.equations import EquationsOfMotion
from ..mechanics.formulations import Form, Reduction, lambda_free, largest_group
from ..model.elements import Expr, name_of
from ..model.model import Contact, Nonholonomic
from ..model.reactions import multiplier
from ..names import SLIP, read
from ..names import name as name_of_variable
from .notation import (
    LONGEST,
    Notation,
    Printed,
    joined,
    letter,
    magnitude,
    name_latex,
    name_text,
    put,
    total,
)

MOST = 24  # equations of a kind that are printed
MINORS = 3  # constraints in one group beyond which lambda is not eliminated in symbols


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
        lines = tuple(Equation(label, *joined(parts)) for label, parts in islice(equations, MOST))
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
                return f"s_{{{letter(row)}}}", name_of_variable(SLIP, row)
            k = rows[row]
            moved = sp.Add(*(self.eom.G[k, j] * v for j, v in enumerate(self.eom.v)))
            return show(_tidy(moved - self.eom.nu[k]))

        def vector(components: Sequence[Printed]) -> Printed:
            """In brackets, if it has several components."""
            latex, text = (", ".join(parts) for parts in zip(*components, strict=True))
            several = len(components) > 1
            return put("\\left({}\\right)", "({})", (latex, text)) if several else (latex, text)

        equations: list[tuple[str, Sequence[Printed]]] = []
        for law in self.eom.frictions:
            size = magnitude(show(law.normal)) if len(law.parts) == 1 else factor(law.normal)
            force = vector([show(multiplier(row)) for row in law.of])
            speed = vector([slip(row) for row in law.of])
            s = ("s", "s") if len(law.of) > 1 else speed
            stick = [magnitude(force), ("\\le", "≤"), factor(law.static), size]
            equations.append((f"{law.name} sticks", stick))
            text = "({0})/|{0}|" if " " in s[1] else "{0}/|{0}|"
            sign = put("\\frac{{{0}}}{{\\left|{0}\\right|}}", text, s)
            slide = [force, ("=", "="), put("-{}", "-{}", factor(law.kinetic)), size, sign]
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
            equations.append((direction, [left, ("=", "="), total(right)]))
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
        return total(inertia + self.terms(min(short, rest, key=lambda e: e.count_ops())))

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
                left = total(self.notation.linear(row) + self.terms(_tidy(-eom.nu[k])))
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
            equations.append((q, [left, total(right)]))
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
            left = total(self.notation.linear(row))
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
        return total(self.notation.linear(slopes) + self.terms(_tidy(rest)))

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
            equations.append((str(s), [self._motion(eom, j, sddot), ("=", "="), total(right)]))
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
            left = ".".join(letter(part) for part in of.coordinate.split(".")), o.name
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
