"""An output as one writes it on a command line:  tension = -2*L*lambda.rod [N]

Names are those of the FMU's variables: coordinates and parameters, der(x), der(x,2), lambda.rod, Q.x,
time (named.py).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import sympy as sp

from ..errors import RequestError
from ..names import derivative
from .elements import TIME, Expr, Input, Output, name_of
from .model import Model
from .named import UnknownNameError, read_named
from .reactions import force_of_constraint, multiplier

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
