"""The page in the FMU: it says what is integrated, names every variable, and needs nothing else."""

from __future__ import annotations

import html
import random
import re
from dataclasses import replace

import pytest
import sympy as sp
from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Contact, Holonomic, Input, Model, Nonholonomic, Parameter, Scene, derive
from lagfmu.testing import (
    Form,
    Notation,
    Prepared,
    name_latex,
    name_text,
    prepare,
    typeset,
    with_figures,
)
from lagfmu.testing import documentation_page as page

t = dynamicsymbols._t
x, y, s, theta, F = dynamicsymbols("x y s theta F")
m, M, g, L, c, omega = symbols("m M g L c omega", positive=True)

model = Model(  # a pendulum on a cart in front of a wall, with friction and a force that is driven
    name="Cart",
    description="A cart & a <b>pendulum</b>",
    lagrangian=M * s.diff() ** 2 / 2 + m * (x.diff() ** 2 + y.diff() ** 2) / 2 - m * g * y,
    forces={s: F - c * s.diff()},
    coordinates={s: "m", x: "m", y: "m"},
    constraints=[
        Holonomic("rod", (x - s) ** 2 + y**2 - L**2, "keeps its <length>"),
        Contact("wall", 3 * L - s - x),
    ],
    parameters=[
        Parameter(M, 2.0, "kg"),
        Parameter(m, 1.0, "kg", "mass of the bob <script>"),
        Parameter(g, 9.81, "m/s^2"),
        Parameter(L, 1.0, "m"),
        Parameter(c, 0.1, "N.s/m"),
    ],
    inputs=[Input(F, "N", 0.0, "force & drive")],
    start={x: 0.6, y: -0.9},
)
turned = Model(  # two rods whose angles are relative, on a turning slope: a dense mass matrix
    name="Turned",
    lagrangian=m * ((x.diff() * cos(theta) - L * theta.diff()) ** 2 + y.diff() ** 2) / 2
    + m * x.diff() * theta.diff() * L * sin(theta + omega * t) / 3
    - m * g * (x - y) * sin(theta) / 4,
    coordinates={x: "m", y: "m", theta: "rad"},
    constraints=[
        Nonholonomic("blade", x.diff() * sin(theta) - (x - y) * theta.diff() / 2 - omega * L)
    ],
    parameters=[
        Parameter(m, 1.0, "kg"),
        Parameter(g, 9.81, "m/s^2"),
        Parameter(L, 1.0, "m"),
        Parameter(omega, 0.5, "rad/s"),
    ],
)
FIGURES = [
    ("lambda.rod & more", "1.5e-14", "1e-07", "9", "pass"),
    ("energy", "2", "1e-07", "9", "FAIL"),
]


@pytest.fixture(scope="module")
def prepared() -> Prepared:
    return prepare(model, Scene("CartScene", formulation="nullspace"))


@pytest.fixture(scope="module")
def text(prepared: Prepared) -> str:
    return with_figures(page(prepared), FIGURES)


def read(text: str, notation: Notation) -> sp.Expr:
    """The expression that a reader takes from a printed one: a space between factors multiplies."""
    text = re.sub("[⁰¹²³⁴⁵⁶⁷⁸⁹]", lambda d: f"**{'⁰¹²³⁴⁵⁶⁷⁸⁹'.index(d[0])}", text)
    text = text.replace(" + ", "+").replace(" - ", "-").replace(" ", "*")
    known = {f"x{k:06d}": symbol for k, symbol in enumerate(notation.into)}
    written = {printed: name for name, printed in notation.text_of.items()}
    longest = sorted(written, key=len, reverse=True)
    names = "|".join(map(re.escape, longest))
    text = re.sub(rf"sin|cos|{names}", lambda name: written.get(name[0], name[0]), text)
    return sp.sympify(eval(text, {"sin": sin, "cos": cos}, known))


@pytest.mark.parametrize("model", [model, turned], ids=lambda model: model.name)
def test_printed_equations_are_those_that_are_integrated(model):
    """Read back, they say M v' = F + G^T lambda, Q = G^T lambda and G v' = gamma."""
    eom = derive(model)
    sections = {section.title: section.equations for section in typeset(Form(eom))}
    vdot = eom.vdot
    generator = random.Random(3)
    notation = Notation(eom)
    point = {symbol: generator.uniform(-2, 2) for symbol in notation.into}
    multipliers = notation.multipliers
    Q = [sum(eom.G[k, j] * multipliers[k] for k in range(eom.m)) for j in range(eom.nv)]
    motion = [
        sum(eom.M[j, i] * vdot[i] for i in range(eom.nv)) - eom.F[j] - Q[j] for j in range(eom.nv)
    ]
    closing = [
        sum(eom.G[k, j] * vdot[j] for j in range(eom.nv)) - eom.gamma[k] for k in range(eom.m)
    ]
    for title, expected in (
        ("Lagrange's equations with multipliers", motion),
        ("Constraints as accelerations", closing),
    ):
        for equation, e in zip(sections[title], expected, strict=True):
            left, right = (read(side, notation) for side in equation.text.split(" = "))
            assert (left - right - e).subs(point) == pytest.approx(0, abs=1e-12), equation.text
    for equation, e in zip(sections["Generalized forces of constraint"], Q, strict=True):
        right = read(equation.text.split(" = ")[1], notation)
        assert sp.sympify(right - e).subs(point) == pytest.approx(0, abs=1e-12), equation.text


def test_names_are_written_as_in_the_textbook():
    """Greek letters, dots above the letter, indices below it."""
    assert name_latex("theta", 2) == r"\ddot{\theta}"
    assert name_latex("theta_1", 1) == r"\dot{\theta}_{1}"
    assert name_latex("slide") == r"\mathrm{slide}"
    assert name_latex("mu_rel") == r"\mu_{\mathrm{rel}}"
    assert name_text("theta0") == "θ₀"
    assert name_text("slide", 2) == "der(slide,2)"
    assert name_text("crank.position.x") == "x_crank"
    assert name_text("jack.position") == "jack.position"  # the input of a motor in a slide


def test_what_is_too_long_to_print_is_counted_and_not_made_shorter(monkeypatch):
    """Common factors of a bicycle's inertias took 20 s, for entries of which the page says their length."""
    a, b = symbols("a b")
    long = sp.Add(*(a**k * sin(k * b) for k in range(1, 200)))
    monkeypatch.setattr(sp, "factor_terms", lambda e: pytest.fail("was made shorter"))
    [(_, text)] = Notation(derive(turned)).linear([(long, b)])
    assert "operations, not printed]" in text


def test_markup_in_descriptions_is_shown_as_it_stands(text):
    """`<b>` and `&` are characters of a description, not of the page."""
    assert "A cart &amp; a &lt;b&gt;pendulum&lt;/b&gt;" in text
    assert "keeps its &lt;length&gt;" in text
    assert "<script" not in text
    assert "lambda.rod &amp; more" in text


def test_every_variable_is_named_once_in_the_tables(text, prepared):
    """The page lists what modelDescription.xml lists, with units and start values."""
    rows = re.findall(r'<tr><th scope="row"><code>([^<]*)</code></th><td>\w+</td><td>\w+<', text)
    assert sorted(rows) == sorted(v.name for v in prepared.table.variables)


def test_page_needs_no_other_file(text):
    """No link, script, image or font from elsewhere; xmlns is a name, not an address."""
    assert not re.search(r"<(script|link|img|iframe|object)\b", text)
    assert not re.search(r"url\(|@import|\bsrc=", text)
    assert set(re.findall(r'href="(.)', text)) == {"#"}
    assert set(re.findall(r"https?://[^\"]*", text)) <= {"http://www.w3.org/1998/Math/MathML"}


def test_equations_are_mathematics_for_the_browser(text, prepared):
    """Each equation is a <math> element, and its text stands beside it for screen readers."""
    sections = typeset(replace(prepared.form, formulation="nullspace"))
    equations = [e for section in sections for e in section.equations]
    assert text.count("<math") == len(equations)
    assert "\\" not in text.partition("</style>")[2]
    for e in equations:
        assert f'aria-label="{html.escape(e.text)}"' in text


def test_page_is_the_same_each_time(text):
    """Same model, same bytes."""
    again = prepare(model, Scene("CartScene", formulation="nullspace"))
    assert with_figures(page(again), FIGURES) == text
