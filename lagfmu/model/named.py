"""A formula in the names of an FMU's variables:  lambda.rod - m*g*cos(theta), der(x,2), 'my mass'

Any name may stand in quotes; plain, dotted ones with indices and der(...), initial(...) of one need none.
The text is read as an expression of names, numbers, + - * / ** (or ^), comparisons and functions, and is
never executed (expression.py).
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping

from .elements import Expr
from .expression import read_formula

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
