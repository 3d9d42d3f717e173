"""An output as one writes it on a command line:  tension = -2*L*lambda.rod [N]

Names are those of the FMU's variables: coordinates and parameters, der(x), der(x,2), lambda.rod, Q.x,
time.  The text is read as an expression of names, numbers, + - * / ** (or ^) and functions, and is never
executed (expression.py).
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence
from dataclasses import replace

import sympy as sp
from sympy.physics.vector import dynamicsymbols

from ..errors import RequestError
from ..names import derivative
from .elements import Expr, Input, Output, name_of
from .expression import read_formula
from .model import Model
from .reactions import force_of_constraint, multiplier

TEXT = re.compile(r"\s*([^=\s]+)\s*=(.*)\[([^\[\]]*)\]\s*\Z", re.S)
NAMES = re.compile(
    r"der\(\s*[A-Za-z_][\w.]*\s*(?:,\s*2\s*)?\)|(?<![\w.])[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*(?!\w|\s*\()"
)
EXAMPLE = "'tension = -2*L*lambda.rod [N]'"
CAPITALS = re.compile(r"\b(abs|min|max)(?=\s*\()")  # SymPy's names of these begin with one


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
        return Output(name, _read(formula.strip(), _known(model)), unit.strip())
    except ValueError as error:
        problems.append(f"--add-output {text!r}: {error}")
    return None


def _known(model: Model) -> dict[str, Expr]:
    """The names of the FMU's variables that an output can hold, and what they mean."""
    t = dynamicsymbols._t
    known: dict[str, Expr] = {"time": t, "pi": sp.pi}
    known |= {name_of(p.symbol): p.symbol for p in model.parameters}
    for symbol in (*model.coordinates, *model.speeds, *(i.symbol for i in model.inputs)):
        name = name_of(symbol)
        known[name] = symbol
        if symbol in model.speeds:
            known[derivative(name)] = symbol.diff(t)
        elif symbol in model.coordinates or _moves(model, symbol):
            known |= {derivative(name, k): symbol.diff(t, k) for k in (1, 2)}
    reactions = [multiplier(c.name) for c in model.constraints]
    reactions += [force_of_constraint(q) for q in model.directions]
    return known | {str(s): s for s in reactions}


def _moves(model: Model, symbol: Expr) -> bool:
    prescribed: tuple[Input, ...] = model.prescribed
    return symbol in {i.symbol for i in prescribed}


def _read(formula: str, known: dict[str, Expr]) -> Expr:
    """The expression.  Raises ValueError with what cannot be read, and what was expected."""
    meant: dict[str, Expr] = {}
    named: list[str] = []

    def stand_in(match: re.Match[str]) -> str:
        name = re.sub(r"\s+", "", match[0])
        if name not in known:
            near = difflib.get_close_matches(name, known, 3, 0.5) or list(known)[:8]
            raise ValueError(f"{name!r} is unknown; did you mean {', '.join(map(repr, near))}?")
        named.append(name)
        meant[f"x{len(meant)}"] = known[name]
        return f"x{len(meant) - 1}"

    plain = CAPITALS.sub(lambda m: m[0].capitalize(), formula.replace("^", "**"))
    plain = NAMES.sub(stand_in, plain)
    try:
        return read_formula(plain, meant)
    except ValueError as error:
        text = re.sub(r"\bx(\d+)\b", lambda m: named[int(m[1])], str(error))
        raise ValueError(f"{text}, expected an expression as in {EXAMPLE}") from None
