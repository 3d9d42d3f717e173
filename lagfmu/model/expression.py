"""A formula as text, inside an FMU or on a command line: read back without being run.

An FMU comes from anyone.  SymPy's own readers (`sympify`, `parse_expr`) hand text to Python's eval; here
the text is parsed to a syntax tree (`ast.parse`, which runs nothing), and a SymPy expression is put together
from the kinds of node in the whitelist below.  Everything else is refused by name.  A short text can still
ask for endless work (9**9**9), so the sizes are limited: of the text, of the tree, of exact numbers, and
what holds no symbol must be a finite double.

A formula in the names of an FMU's variables:  lambda.rod - m*g*cos(theta), der(x,2), 'my mass'

Any name may stand in quotes; plain, dotted ones with indices and der(...), initial(...) of one need none.
The text is read as an expression of names, numbers, + - * / ** (or ^), comparisons and functions, and is
never executed.

An output as one writes it on a command line:  tension = -2*L*lambda.rod [N]

Names are those of the FMU's variables: coordinates and parameters, der(x), der(x,2), lambda.rod, Q.x,
time.
"""

from __future__ import annotations

import ast
import difflib
import math
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import sympy as sp
from sympy.printing.str import StrPrinter

from ..errors import RequestError
from ..names import derivative
from .elements import TIME, Expr, Input, Output, name_of
from .model import Model
from .reactions import force_of_constraint, multiplier
from .spline import HIGHEST as HIGHEST_DERIVATIVE
from .spline import Spline

Make = Callable[..., Expr]
LONGEST = 200_000  # characters of one formula
MOST_NODES = 50_000  # of its syntax tree
DEEPEST = 60  # levels of it, a sum or a product being one
LONGEST_SUM = 500  # terms: Python's parser nests each inside of the one before
MOST_DIGITS = 400  # of an exact number
LARGEST_EXPONENT = 100  # of a power whose exponent is a number
HIGHEST = 20  # order of a Bessel function
MOST_JOINED = 12  # comparisons inside of "and" and "or", which SymPy multiplies out


ARITIES = {  # of the functions, which are SymPy's of these names
    **dict.fromkeys(("sin", "cos", "tan", "cot", "sec", "csc"), (1,)),
    **dict.fromkeys(("asin", "acos", "atan", "acot"), (1,)),
    **dict.fromkeys(("sinh", "cosh", "tanh", "coth", "sech", "csch"), (1,)),
    **dict.fromkeys(("asinh", "acosh", "atanh", "exp", "log", "sqrt"), (1,)),
    **dict.fromkeys(("Abs", "sign", "floor", "ceiling", "sinc"), (1,)),
    **dict.fromkeys(("erf", "erfc", "gamma", "loggamma"), (1,)),
    **dict.fromkeys(("atan2", "besselj", "bessely"), (2,)),
    **{"Heaviside": (1, 2), "Min": (1, 2, 3, 4), "Max": (1, 2, 3, 4)},
}
LARGEST_LOGGAMMA = 1000.0  # argument: SymPy takes that of an integer by its factorial
CONSTANTS = {"pi": (sp.pi, math.pi), "E": (sp.E, math.e)}
COMPARISONS: dict[type, Any] = {ast.Lt: sp.Lt, ast.LtE: sp.Le, ast.Gt: sp.Gt, ast.GtE: sp.Ge}
EQUALITIES = {"Eq": sp.Eq, "Ne": sp.Ne}
JOINTS: dict[type, Any] = {ast.BitAnd: sp.And, ast.BitOr: sp.Or}


class _Printer(StrPrinter):  # type: ignore[misc]
    """SymPy's text, with every double to its last digit, and long sums in brackets of LONGEST_SUM."""

    def _print_Mod(self, expr: Expr) -> str:
        a, b = (self._print(x) for x in expr.args)
        return f"({a} - ({b})*floor(({a})/({b})))"

    def _print_Add(self, expr: Expr, order: str | None = None) -> str:
        terms = list(expr.args)
        if len(terms) <= LONGEST_SUM:
            return str(super()._print_Add(expr, order))
        parts = [sp.Add(*terms[k : k + LONGEST_SUM]) for k in range(0, len(terms), LONGEST_SUM)]
        return " + ".join(f"({self._print(part)})" for part in parts)

    def _print_Float(self, expr: Expr) -> str:
        return repr(float(expr))


def text_of(e: Expr) -> str:
    """The text from which `read_formula` makes the expression again, its symbols being s0, s1, ..."""
    return str(_Printer({"order": None}).doprint(e))


def functions_of(tables: Sequence[Spline]) -> dict[str, Make]:
    """The tables and their derivatives, by the names that they have in a formula."""
    made = (s.derivative(order) for s in tables for order in range(HIGHEST_DERIVATIVE + 1))
    return {function.__name__: function for function in made}


def read_formula(
    text: str, symbols: Mapping[str, Expr], tables: Mapping[str, Make] | None = None
) -> Expr:
    """The expression that a text says; `symbols` are the names, `tables` the further functions of it.

    Nothing of the text is run.  Raises ValueError with what is not allowed in it.
    """
    if not isinstance(text, str):
        raise ValueError(f"a formula is {type(text).__name__}, expected text")
    if len(text) > LONGEST:
        raise ValueError(f"a formula of {len(text)} characters, expected at most {LONGEST}")
    try:
        tree = ast.parse(text, mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
        raise ValueError(f"{_short(text)} is no formula ({error})") from None
    try:
        return _Reader(symbols, tables or {}).read(tree)
    except (ArithmeticError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError(f"{_short(text)} is no formula ({error})") from None


def _short(text: str) -> str:
    return repr(text if len(text) <= 60 else text[:57] + "...")


@dataclass(frozen=True)
class _Read:
    """An expression; `value`: that of one without symbols, as a double; `logical`: true or false."""

    expr: Expr
    value: float | None = None
    logical: bool = False


class _Reader:
    def __init__(self, symbols: Mapping[str, Expr], tables: Mapping[str, Make]) -> None:
        self.symbols, self.tables = symbols, tables
        self.nodes = self.joined = 0

    def read(self, tree: ast.expr) -> Expr:
        expr = self._any(tree, 0).expr
        if expr.has(sp.zoo, sp.nan, sp.oo, sp.S.NegativeInfinity, sp.I):
            raise ValueError("a number that is not finite")
        return expr

    def _any(self, node: ast.AST, depth: int) -> _Read:
        self.nodes += 1
        if self.nodes > MOST_NODES or depth > DEEPEST:
            raise ValueError(
                f"a formula of more than {MOST_NODES} operations, or more than {DEEPEST} inside of one "
                "another"
            )
        if isinstance(node, ast.Constant):
            return _constant(node.value)
        if isinstance(node, ast.Name):
            return self._name(node.id)
        if isinstance(node, ast.UnaryOp):
            return self._unary(node, depth)
        if isinstance(node, ast.BinOp):
            return self._binary(node, depth)
        if isinstance(node, ast.Compare):
            return self._comparison(node, depth)
        if isinstance(node, ast.Call):
            return self._call(node, depth)
        raise ValueError(
            f"{_short(ast.unparse(node))} is none of the things that a formula is made of"
        )

    def _number(self, node: ast.AST, depth: int) -> _Read:
        found = self._any(node, depth + 1)
        if found.logical:
            raise ValueError(f"{_short(str(found.expr))} is true or false, expected a number")
        return found

    def _condition(self, node: ast.AST, depth: int) -> _Read:
        found = self._any(node, depth + 1)
        if not found.logical:
            raise ValueError(f"{_short(str(found.expr))} is a number, expected a comparison")
        return found

    def _name(self, name: str) -> _Read:
        if name in self.symbols:
            return _Read(self.symbols[name])
        if name in CONSTANTS:
            return _Read(*CONSTANTS[name])
        raise ValueError(f"the name {_short(name)} means nothing in a formula")

    def _unary(self, node: ast.UnaryOp, depth: int) -> _Read:
        if isinstance(node.op, ast.Invert):
            return _Read(sp.Not(self._condition(node.operand, depth).expr), logical=True)
        inner = self._number(node.operand, depth)
        if isinstance(node.op, ast.USub):
            return _made(operator.neg, [inner], operator.neg)
        if isinstance(node.op, ast.UAdd):
            return inner
        raise ValueError("'not' is none of the operations of a formula")

    def _binary(self, node: ast.BinOp, depth: int) -> _Read:
        if isinstance(node.op, (ast.Add, ast.Sub)):
            return self._sum(node, depth)
        if isinstance(node.op, (ast.Mult, ast.Div)):
            return self._product(node, depth)
        if isinstance(node.op, ast.Pow):
            return _power(self._number(node.left, depth), self._number(node.right, depth))
        joint = JOINTS.get(type(node.op))
        if joint is None:
            what = type(node.op).__name__
            raise ValueError(f"the operator {what} is none of the operations of a formula")
        parts = [self._condition(part, depth) for part, _ in _chain(node, (type(node.op),))]
        self.joined += len(parts)
        if self.joined > MOST_JOINED:
            raise ValueError(f"more than {MOST_JOINED} comparisons joined by 'and' and 'or'")
        return _Read(joint(*(p.expr for p in parts)), logical=True)

    def _sum(self, node: ast.BinOp, depth: int) -> _Read:
        chain = _chain(node, (ast.Add, ast.Sub))
        minus = [isinstance(op, ast.Sub) for _, op in chain]

        def signed(parts: Sequence[Any]) -> list[Any]:
            return [-p if m else p for p, m in zip(parts, minus, strict=True)]

        return _made(
            lambda *parts: sp.Add(*signed(parts)),
            [self._number(part, depth) for part, _ in chain],
            lambda *values: math.fsum(signed(values)),
        )

    def _product(self, node: ast.BinOp, depth: int) -> _Read:
        chain = _chain(node, (ast.Mult, ast.Div))
        below = [isinstance(op, ast.Div) for _, op in chain]
        factors = [self._number(part, depth) for part, _ in chain]
        if any(f.expr.is_zero and b for f, b in zip(factors, below, strict=True)):
            raise ValueError("a division by zero")

        def inverted(parts: Sequence[Any]) -> list[Any]:
            return [1 / p if b else p for p, b in zip(parts, below, strict=True)]

        return _made(
            lambda *parts: sp.Mul(*inverted(parts)),
            factors,
            lambda *values: math.prod(inverted(values)),
        )

    def _comparison(self, node: ast.Compare, depth: int) -> _Read:
        compare = COMPARISONS.get(type(node.ops[0]))
        if len(node.ops) != 1 or compare is None:
            raise ValueError(f"{_short(ast.unparse(node))} is none of the comparisons of a formula")
        left = self._number(node.left, depth)
        right = self._number(node.comparators[0], depth)
        return self._compared(compare, left, right)

    def _compared(self, compare: Any, left: _Read, right: _Read) -> _Read:
        """SymPy tries to decide it, which is quick only where no Piecewise stands in it."""
        if left.expr.has(sp.Piecewise) or right.expr.has(sp.Piecewise):
            raise ValueError("a Piecewise inside of a comparison")
        return _Read(compare(left.expr, right.expr), logical=True)

    def _call(self, node: ast.Call, depth: int) -> _Read:
        name = node.func.id if isinstance(node.func, ast.Name) else ast.unparse(node.func)
        if node.keywords:
            raise ValueError(f"{_short(name)} is called with {node.keywords[0].arg!r}=...")
        if name == "Piecewise":
            return self._piecewise(node.args, depth)
        arities = ARITIES | dict.fromkeys(EQUALITIES, (2,)) | dict.fromkeys(self.tables, (1,))
        if name not in arities:
            raise ValueError(
                f"{_short(name)} is no function of a formula, expected one of "
                + ", ".join([*ARITIES, *EQUALITIES, "Piecewise"])
            )
        if len(node.args) not in arities[name]:
            raise ValueError(f"{name} cannot take {len(node.args)} arguments")
        arguments = [self._number(a, depth) for a in node.args]
        if name.startswith("bessel") and not _is_order(arguments[0].value):
            raise ValueError(f"the order of {name} is no number between -{HIGHEST} and {HIGHEST}")
        if name in EQUALITIES:
            return self._compared(EQUALITIES[name], *arguments)
        return _made(self.tables.get(name) or getattr(sp, name), arguments)

    def _piecewise(self, pieces: Sequence[ast.expr], depth: int) -> _Read:
        pairs = []
        for piece in pieces:
            if not isinstance(piece, ast.Tuple) or len(piece.elts) != 2:
                raise ValueError("Piecewise of something else than (value, condition)")
            value, condition = piece.elts
            pairs.append((self._number(value, depth).expr, self._condition(condition, depth).expr))
        if not pairs or all(c == sp.false for _, c in pairs):
            raise ValueError("Piecewise of nothing")
        expr = sp.Piecewise(*pairs)
        return _Read(expr, None if expr.free_symbols else _double(float, [expr]))


def _is_order(value: float | None) -> bool:
    return value is not None and abs(value) <= HIGHEST and float(2 * value).is_integer()


def _chain(node: ast.AST, operators: tuple[type, ...]) -> list[tuple[ast.AST, ast.operator]]:
    """The parts of a + b - c, each with the operator before it: as deep as the chain is long."""
    parts: list[tuple[ast.AST, ast.operator]] = []
    while isinstance(node, ast.BinOp) and isinstance(node.op, operators):
        parts.append((node.right, node.op))
        node = node.left
    parts.append((node, ast.Add()))
    return parts[::-1]


def _constant(value: object) -> _Read:
    if isinstance(value, bool):
        return _Read(sp.true if value else sp.false, logical=True)
    if isinstance(value, int):
        return _made(lambda: sp.Integer(value), [], lambda: value)
    if isinstance(value, float):
        return _made(lambda: sp.Float(value), [], lambda: value)
    raise ValueError(f"{_short(repr(value))} is no number")


def _power(base: _Read, exponent: _Read) -> _Read:
    if exponent.value is not None and abs(exponent.value) > LARGEST_EXPONENT:
        raise ValueError(f"the exponent {exponent.value:g}, expected at most {LARGEST_EXPONENT}")
    if base.expr.is_zero and exponent.value is not None and exponent.value < 0:
        raise ValueError("a division by zero")
    _digits(base.expr)
    found = _made(operator.pow, [base, exponent], operator.pow)
    _digits(found.expr)
    return found


def _digits(e: Expr) -> None:
    """Raises ValueError where an exact number in it is longer than any that means something."""
    for number in e.atoms(sp.Rational):
        if max(abs(number.p), number.q) >= 10**MOST_DIGITS:
            raise ValueError(f"an exact number of more than {MOST_DIGITS} digits")


def _made(make: Make, parts: Sequence[_Read], value: Callable[..., float] | None = None) -> _Read:
    """make(*parts); where no part holds a symbol, `value` of theirs has to be a finite double first, which
    without one is what SymPy makes of doubles."""
    expressions = [p.expr for p in parts]
    values = [p.value for p in parts if p.value is not None]
    if len(values) == len(parts):
        number = _double(value or partial(_of_doubles, make), values)
        return _Read(make(*expressions), number)
    expr = make(*expressions)
    return _Read(expr, None if expr.free_symbols else _double(float, [expr]))  # they cancelled


def _of_doubles(make: Make, *values: float) -> float:
    """NaN where SymPy looks for the value without end."""
    endless = make in (sp.besselj, sp.bessely)
    if endless or (make is sp.loggamma and abs(values[0]) > LARGEST_LOGGAMMA):
        return math.nan
    return float(make(*map(sp.Float, values)))


def _double(value: Callable[..., float], arguments: Sequence[Any]) -> float:
    try:
        found = float(value(*arguments))
    except (ValueError, OverflowError, ZeroDivisionError, TypeError):
        found = math.nan
    if not math.isfinite(found):
        raise ValueError("a number that is not finite")
    return found


_PART = r"[A-Za-z_]\w*(?:\[\s*\d+(?:\s*,\s*\d+)*\s*\])?"
_PATH = rf"{_PART}(?:\.{_PART})*"
_RATE = rf"der\(\s*{_PATH}\s*(?:,\s*\d\s*)?\)"
NAMES = re.compile(
    rf"'(?P<quoted>[^']+)'|\binitial\(\s*(?:{_RATE}|{_PATH})\s*\)|\b{_RATE}"
    rf"|(?<![\w.]){_PATH}(?![\w\[]|\s*\()"
)
CAPITALS = re.compile(r"\b(abs|min|max)(?=\s*\()")  # SymPy's names of these begin with one


class UnknownNameError(ValueError):
    """A name in a formula that means nothing, with those that are near."""


def read_named(formula: str, known: Mapping[str, Expr]) -> Expr:
    """The expression; `known`: what each name means.  Raises ValueError with what cannot be read."""
    meant: dict[str, Expr] = {}
    named: list[str] = []

    def stand_in(match: re.Match[str]) -> str:
        name = match["quoted"] or re.sub(r"\s+", "", match[0])
        if name not in known:
            near = difflib.get_close_matches(name, known, 3, 0.5) or list(known)[:8]
            raise UnknownNameError(
                f"{name!r} is unknown; did you mean {', '.join(map(repr, near))}?"
            )
        named.append(name)
        meant[f"x{len(meant)}"] = known[name]
        return f"x{len(meant) - 1}"

    plain = CAPITALS.sub(lambda m: m[0].capitalize(), formula.replace("^", "**"))
    plain = NAMES.sub(stand_in, plain)
    try:
        return read_formula(plain, meant)
    except ValueError as error:
        raise ValueError(re.sub(r"\bx(\d+)\b", lambda m: _called(named, m), str(error))) from None


def _called(named: list[str], match: re.Match[str]) -> str:
    """The name that stood where x0, x1, ... stand."""
    return named[int(match[1])] if int(match[1]) < len(named) else match[0]


TEXT = re.compile(r"\s*([^=\s]+)\s*=(.*)\[([^\[\]]*)\]\s*\Z", re.S)
EXAMPLE = "'tension = -2*L*lambda.rod [N]'"


def with_outputs(model: Model, texts: Sequence[str]) -> Model:
    """The model with the outputs that the texts describe.  Raises RequestError with every problem."""
    problems: list[str] = []
    added = [_output(text, model, problems) for text in texts]
    if problems:
        raise RequestError(model.name, problems)
    own = (*model.outputs, *(o for o in added if o is not None))
    return replace(model, outputs=own) if texts else model


def _output(text: str, model: Model, problems: list[str]) -> Output | None:
    found = TEXT.match(text)
    if found is None:
        problems.append(f"--add-output {text!r}: expected NAME = EXPRESSION [UNIT], e.g. {EXAMPLE}")
        return None
    name, formula, unit = found.groups()
    try:
        return Output(name, read_named(formula.strip(), _known(model)), unit.strip())
    except UnknownNameError as error:
        problems.append(f"--add-output {text!r}: {error}")
    except ValueError as error:
        problems.append(f"--add-output {text!r}: {error}, expected an expression as in {EXAMPLE}")
    return None


def _known(model: Model) -> dict[str, Expr]:
    """The names of the FMU's variables that an output can hold, and what they mean."""
    known: dict[str, Expr] = {"time": TIME, "pi": sp.pi}
    known |= {name_of(p.symbol): p.symbol for p in model.parameters}
    for symbol in (*model.coordinates, *model.speeds, *(i.symbol for i in model.inputs)):
        name = name_of(symbol)
        known[name] = symbol
        if symbol in model.speeds:
            known[derivative(name)] = symbol.diff(TIME)
        elif symbol in model.coordinates or _moves(model, symbol):
            known |= {derivative(name, k): symbol.diff(TIME, k) for k in (1, 2)}
    reactions = [multiplier(c.name) for c in model.constraints]
    reactions += [force_of_constraint(q) for q in model.directions]
    return known | {str(s): s for s in reactions}


def _moves(model: Model, symbol: Expr) -> bool:
    prescribed: tuple[Input, ...] = model.prescribed
    return symbol in {i.symbol for i in prescribed}
