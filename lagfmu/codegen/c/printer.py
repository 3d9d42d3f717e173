"""SymPy expressions -> C99 expressions of doubles: no integers, the functions of <math.h> only.

The only C printer of expressions; function.py makes functions of them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import count
from typing import Any

import sympy as sp
from sympy.core.relational import Relational
from sympy.logic.boolalg import Boolean, BooleanFunction

from ...errors import DerivationError
from ...model.differential import Share
from ...model.elements import Expr
from ..parts import Largest, identifier

Text = tuple[str, int]  # of an expression, and how tightly its outermost operator binds
SUM, PRODUCT, ATOM = range(3)
POWER = 6  # integer powers up to this one are printed as products

FUNCTIONS = {
    **{f: f.__name__ for f in (sp.sin, sp.cos, sp.tan, sp.asin, sp.acos, sp.atan, sp.atan2)},
    **{f: f.__name__ for f in (sp.sinh, sp.cosh, sp.tanh, sp.asinh, sp.acosh, sp.atanh)},
    **{f: f.__name__ for f in (sp.exp, sp.log, sp.erf, sp.erfc)},
    sp.Abs: "fabs",
    sp.floor: "floor",
    sp.ceiling: "ceil",
    sp.gamma: "tgamma",
    sp.loggamma: "lgamma",
    sp.sign: "sign",
    sp.Heaviside: "heaviside",
    Share: "share",
}
CUBIC = """/* A tabulated function and its derivatives: y = c0 + c1 s + c2 s^2 + c3 s^3, s = x - x[k], between
 * knots (de Boor, A Practical Guide to Splines, ch. IV); a straight line, or the period, outside. */
typedef struct {
    int n, periodic;
    const double *x;      /* (n) knots */
    const double (*c)[4]; /* (n) the last row holds beyond the last knot */
} Cubic;

static double cubic(const Cubic *table, int order, double x) {
    const double first = table->x[0], last = table->x[table->n - 1];
    if (table->periodic) x -= (last - first) * floor((x - first) / (last - first));
    int k = 0;
    for (int end = table->n; end - k > 1;) {
        const int middle = k + (end - k) / 2;
        if (table->x[middle] <= x)
            k = middle;
        else
            end = middle;
    }
    const double s = x - table->x[k], *c = table->c[k];
    const double c2 = s < 0.0 ? 0.0 : c[2], c3 = s < 0.0 ? 0.0 : c[3];
    if (order == 0) return c[0] + s * (c[1] + s * (c2 + s * c3));
    if (order == 1) return c[1] + s * (2.0 * c2 + s * 3.0 * c3);
    return order == 2 ? 2.0 * c2 + s * 6.0 * c3 : 6.0 * c3;
}
"""
HELPERS = {  # what <math.h> has not; printed into a file that calls it
    "sign": "static inline double sign(double x) {\n    return (x > 0.0) - (x < 0.0);\n}\n",
    "heaviside": (
        "static inline double heaviside(double x, double at_zero) {\n"
        "    return x > 0.0 ? 1.0 : x < 0.0 ? 0.0 : at_zero;\n}\n"
    ),
    "share": "static inline double share(double w, double e) {\n    return w != 0.0 ? w * e : 0.0;\n}\n",
    "cubic": CUBIC,
}

KEYWORDS = """
    auto break case char const continue default do double else enum extern float for goto if inline int
    long register restrict return short signed sizeof static struct switch typedef union unsigned void
    volatile while alignas alignof asm bool catch class complex constexpr delete explicit export false
    friend imaginary mutable namespace new noreturn nullptr operator private protected public template
    this thread_local throw true try typename typeof typeof_unqual using virtual
"""  # of C99, and those that later standards, C++ and common headers add
MATH = """
    acos acosh asin asinh atan atan2 atanh cbrt ceil copysign cos cosh drem erf erfc exp exp10 exp2 expm1
    fabs fdim finite floor fma fmax fmin fmod frexp gamma hypot ilogb isfinite isgreater isgreaterequal
    isinf isless islessequal islessgreater isnan isnormal isunordered j0 j1 jn ldexp lgamma llrint
    llround log log10 log1p log2 logb lrint lround modf nan nearbyint nextafter nexttoward pow pow10
    remainder remquo rint round scalb scalbln scalbn signbit signgam significand sin sincos sinh sqrt
    tan tanh tgamma trunc y0 y1 yn fpclassify math_errhandling matherr exception abs div labs
    double_t float_t size_t ptrdiff_t wchar_t max_align_t offsetof errno
"""
OURS = """
    t q v u p s sdot M F G nu gamma f h e energy dt dq dv du ds dsdot dM dF dG dnu dgamma df denergy fill
    rates drift angle drates ddrift dangle places shared blocks vdot Q dvdot dlambda dQ w dw other dother
    sign heaviside share cubic Cubic
    Kind Formulation Row System Plan Type Role Place Variable near far small interface
    linux unix i386 main Friction coefficients load normal
    data rotation rotation_change turned turned_change across across_change levers
"""
TAKEN = frozenset(
    [
        *KEYWORDS.split(),
        *OURS.split(),
        *(name + suffix for name in MATH.split() for suffix in ("", "f", "l")),
    ]
)
MACROS = re.compile(  # of <math.h> and <stddef.h>, and our own constants
    r"(NULL|S?NAN\w*|INFINITY|HUGE|HUGE_VAL\w*|MAXFLOAT|DOMAIN|SING|OVERFLOW|UNDERFLOW|[PT]LOSS|EOF|X_TLOSS"
    r"|M_(E|LOG2E|LOG10E|LN2|LN10|PI|PI_2|PI_4|1_PI|2_PI|2_SQRTPI|SQRT2|SQRT1_2)(l|f\d*x?)?"
    r"|(FP|MATH|AT|ROLE|TYPE|LAGFMU|DEFAULT|MODEL)_\w*|VARIABLES|VARIABLE_COUNT"
    r"|HOLONOMIC|NONHOLONOMIC|CONTACT|MULTIPLIERS|NULLSPACE|MINIMAL|is[a-z]\w*|_\w*)\Z"
)


def table_name(spline: Any) -> str:
    """The C name of a table, which no symbol of a model has (MACROS)."""
    return f"LAGFMU_TABLE_{spline.name}"


def table_text(spline: Any) -> str:
    """C text that defines a table."""
    name, table = table_name(spline), spline.table
    knots = "".join(f"    {x!r},\n" for x in table.knots)
    rows = "".join(f"    {{{', '.join(map(repr, row))}}},\n" for row in table.coefficients)
    fields = f"{len(table.knots)}, {int(table.periodic)}, {name}_x, {name}_c"
    return (
        f"static const double {name}_x[] = {{\n{knots}}};\n"
        f"static const double {name}_c[][4] = {{\n{rows}}};\n"
        f"static const Cubic {name} = {{{fields}}};\n"
    )


def identifiers(symbols: Sequence[Expr], taken: Sequence[str] = ()) -> dict[Expr, str]:
    """A distinct C identifier for each symbol: theta, der_theta, der2_theta, m, ...

    d(theta), the change of theta along a direction, becomes d_theta.
    """
    used = set(taken)
    names: dict[Expr, str] = {}
    for symbol in symbols:
        text = str(symbol)
        change = text.startswith("d(")
        text = f"d_{identifier(text[2:-1])}" if change else identifier(text)
        if MACROS.match(text):
            text = f"x_{text}"
        while text in TAKEN or text in used:
            text += "_"
        used.add(text)
        names[symbol] = text
    return names


def number(value: Expr) -> str:
    """A double as C text that reads back to the same bits.  Raises DerivationError outside doubles."""
    try:
        nearest = int(value.p) / int(value.q) if value.is_Rational else float(value)
    except OverflowError:
        nearest = math.inf
    if not math.isfinite(nearest) or (nearest == 0 and not value.is_zero):
        shown = str(value)
        shown = shown if len(shown) < 40 else f"{shown[:12]}... ({len(shown)} characters)"
        raise DerivationError(
            f"the number {shown} cannot be written as numeric code: it is outside the range of "
            "double precision, about 1e-308 to 1e308 in magnitude; choose other units"
        )
    return repr(nearest)


def string(text: str) -> str:
    """A C string literal; what is not ASCII becomes UTF-8 in octal escapes."""
    plain = {ord(c): c for c in map(chr, range(32, 127)) if c not in '"\\?'}
    return '"' + "".join(plain.get(b, f"\\{b:03o}") for b in text.encode()) + '"'


class Printer:
    """C text of expressions; `names` maps every symbol to its identifier."""

    def __init__(self, names: Mapping[Expr, str]) -> None:
        self.names = names

    def __call__(self, expression: Expr) -> str:
        """The text.  Raises DerivationError if a function or number has no counterpart in C."""
        return self._any(sp.sympify(expression))[0]

    def _any(self, e: Expr) -> Text:
        if e.is_Symbol:
            return self.names[e], ATOM
        if e.is_Rational or e.is_Float or e.is_NumberSymbol:
            text = number(e)
            return text, SUM if text.startswith("-") else ATOM
        if e.is_Add:
            return self._sum(e), SUM
        if e.is_Mul:
            return self._product(e)
        if e.is_Pow:
            return self._power(e)
        if isinstance(e, (sp.Max, sp.Min, Largest)):
            return self._extreme("fmin" if isinstance(e, sp.Min) else "fmax", e.args), ATOM
        if isinstance(e, sp.Piecewise):
            return self._piecewise(e), ATOM
        if isinstance(e, sp.Mod):
            x, y = e.args
            return self._sum(x - y * sp.floor(x / y)), SUM
        if isinstance(e, Boolean):
            return self._condition(e), ATOM  # 0.0 or 1.0
        if hasattr(e, "spline"):
            return f"cubic(&{table_name(e.spline)}, {e.order}, {self(e.args[0])})", ATOM
        name = FUNCTIONS.get(e.func)
        if name is None:
            rewritten = _rewritten(e)
            if rewritten is None:
                raise _unprintable(e)
            return self._any(rewritten)
        return f"{name}({', '.join(self(a) for a in e.args)})", ATOM

    def _within(self, e: Expr, level: int) -> str:
        """The text, in parentheses if its operator binds more loosely than `level`."""
        text, own = self._any(e)
        return text if own >= level else f"({text})"

    def _sum(self, e: Expr) -> str:
        parts = [self._any(a)[0] for a in sp.Add.make_args(e)]
        first = next((k for k, text in enumerate(parts) if not text.startswith("-")), 0)
        parts.insert(0, parts.pop(first))  # a - b rather than -b + a
        return parts[0] + "".join(
            f" - {text[1:]}" if text.startswith("-") else f" + {text}" for text in parts[1:]
        )

    def _product(self, e: Expr) -> Text:
        coefficient, _ = e.as_coeff_Mul()
        sign = "-" if coefficient.is_negative else ""
        above: list[str] = []
        below: list[str] = []
        for factor in e.args:
            if factor.is_Rational or factor.is_Float:
                if abs(factor) != 1:
                    above.append(number(abs(factor)))
            elif factor.is_Pow and factor.exp.is_Rational and factor.exp.is_negative:
                below.append(
                    self._within(sp.Pow(factor.base, -factor.exp, evaluate=False), PRODUCT)
                )
            else:
                above.append(self._within(factor, PRODUCT))
        text = "*".join(above) or "1.0"
        if below:
            bottom = "*".join(below)
            text += f"/({bottom})" if len(below) > 1 or "*" in bottom else f"/{bottom}"
        return sign + text, SUM if sign else PRODUCT

    def _power(self, e: Expr) -> Text:
        base, exponent = e.base, e.exp
        if base is sp.E:
            return f"exp({self(exponent)})", ATOM
        if exponent == sp.S.Half:
            return f"sqrt({self(base)})", ATOM
        if exponent.is_Rational and exponent.is_negative:
            return self._product(sp.Mul(sp.S.One, e, evaluate=False))
        if exponent.is_Rational and exponent.q in (1, 2) and exponent <= POWER:
            factors = [self._within(base, ATOM)] * (int(exponent.p) // int(exponent.q))
            if exponent.q == 2:
                factors.append(f"sqrt({self(base)})")
            return "*".join(factors), ATOM if len(factors) == 1 else PRODUCT
        return f"pow({self(base)}, {self(exponent)})", ATOM

    def _extreme(self, name: str, arguments: Sequence[Expr]) -> str:
        text = self(arguments[0])
        for a in arguments[1:]:
            text = f"{name}({text}, {self(a)})"
        return text

    def _piecewise(self, e: Expr) -> str:
        *cases, last = e.args
        if last.cond != sp.true:
            raise DerivationError(
                f"an expression cannot be written as numeric code: {e} says nothing where none of "
                "its conditions holds; end the Piecewise with (expression, True)"
            )
        text = self._within(last.expr, PRODUCT)
        for case in reversed(cases):
            text = f"{self._condition(case.cond)} ? {self._within(case.expr, PRODUCT)} : {text}"
        return f"({text})"

    def _condition(self, c: Expr) -> str:
        if c in (sp.true, sp.false):
            return "1" if c == sp.true else "0"
        if c.is_Symbol:
            return f"({self.names[c]} != 0.0)"
        if isinstance(c, Relational):
            return f"({self(c.lhs)} {c.rel_op} {self(c.rhs)})"
        if isinstance(c, sp.Not):
            return f"!{self._condition(c.args[0])}"
        if isinstance(c, (sp.And, sp.Or)):
            ordered = sorted(c.args, key=sp.default_sort_key)
            joint = " && " if isinstance(c, sp.And) else " || "
            return f"({joint.join(self._condition(a) for a in ordered)})"
        simpler = c.to_nnf() if isinstance(c, BooleanFunction) else c
        if simpler == c:
            raise _unprintable(c)
        return self._condition(simpler)


def _rewritten(e: Expr) -> Expr | None:
    """cot, sec, sinc and the like in terms of what C has; None if there is no such rewriting."""
    for target in (sp.sin, sp.cos, sp.tan, sp.atan, sp.exp, sp.log, sp.Piecewise, sp.gamma):
        try:
            other = e.rewrite(target)
        except (TypeError, ValueError, NotImplementedError):
            continue
        known = (*FUNCTIONS, sp.Max, sp.Min, sp.Piecewise)
        if other != e and all(isinstance(a, known) for a in other.atoms(sp.Function)):
            return other
    return None


def _unprintable(e: Expr) -> DerivationError:
    what = e.func.__name__ if e.args else str(e)
    return DerivationError(
        f"an expression cannot be written as numeric code: {what} has no counterpart in C; use "
        "functions that C's math.h has"
    )


class Names:
    """Fresh symbols, and names for them that no other symbol in `local` has."""

    def __init__(self, local: dict[Expr, str]) -> None:
        self.local = local
        self.taken = {*local.values(), *TAKEN}
        self.count = 0

    def __iter__(self) -> Iterator[Expr]:
        while True:
            yield self.fresh()

    def fresh(self) -> Expr:
        while (text := f"x{self.count}") in self.taken:
            self.count += 1
        self.count += 1
        symbol = sp.Symbol(f"common {text}", real=True)
        self.local[symbol] = text
        return symbol

    def array(self, letter: str) -> str:
        """A name for an array."""
        text = next(t for k in count() if (t := f"{letter}{k}") not in self.taken)
        self.taken.add(text)
        return text

    def describe(self, symbol: Expr, e: Expr) -> None:
        """sin(theta) is called sin_theta."""
        if len(e.args) == 1 and e.is_Function and self.local.get(e.args[0], "").isidentifier():
            text = f"{e.func.__name__}_{self.local[e.args[0]]}"
            if text not in self.taken:
                self.taken.add(text)
                self.local[symbol] = text


def common_subexpressions(
    values: Sequence[Expr], names: Names
) -> tuple[list[tuple[Expr, Expr]], list[Expr]]:
    """Common subexpressions in the order in which they are needed, and the values in their terms.

    What is printed more than once gets a name too: the base of an integer power, a square root that
    stands for x^(k/2).
    """
    found, reduced = sp.cse(values, symbols=iter(names), order="none", list=True)
    common: list[tuple[Expr, Expr]] = []
    named: dict[Expr, Expr] = {}

    def name(e: Expr) -> Expr:
        if e not in named:
            named[e] = names.fresh()
            common.append((named[e], e))
        return named[e]

    def flat(e: Expr) -> Expr:
        if not e.args or isinstance(e, Boolean):
            return e
        arguments = [flat(a) for a in e.args]
        if e.is_Pow and e.exp.is_Rational and abs(e.exp) <= POWER:
            base, exponent = arguments[0], e.exp
            if exponent.q == 2:
                return name(sp.sqrt(base)) ** exponent.p
            if exponent.q == 1 and abs(exponent) > 1 and base.args:
                return name(base) ** exponent
        if all(a is b for a, b in zip(arguments, e.args, strict=True)):
            return e
        return e.func(*arguments)

    for symbol, e in found:
        plain = e if e.is_Pow and e.exp == sp.S.Half and not e.base.args else flat(e)
        names.describe(symbol, plain)
        common.append((symbol, plain))
        named[plain] = symbol
    return common, [flat(e) for e in reduced]
