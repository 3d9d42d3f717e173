"""Closed forms as they travel inside an FMU: text that SymPy reads back."""

from __future__ import annotations

import difflib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp
from sympy.parsing.sympy_parser import parse_expr

from .closed_form import ClosedForm, Conserved, in_variables, output
from .errors import ModelError, VerificationError
from .scene import Scene
from .variables import VariableTable

Expr = Any
FORMAT = 1
EXPRESSIONS = ("actual", "expected", "scale", "when")
CONDITIONS = ("while_closed", "while_open", "until_departure", "at_departure")


@dataclass(frozen=True)
class Claim:
    """One statement to verify, in symbols named as the FMU's variables.

    `expected` is None for a conserved quantity.
    """

    name: str
    actual: Expr
    expected: Expr | None
    while_closed: str | None
    while_open: str | None
    until_departure: str | None
    at_departure: str | None
    scale: Expr | None
    within: float
    rounding: float
    when: Expr | None = None


def claims_of(scene: Scene, closed_forms: Sequence[ClosedForm | Conserved]) -> list[Claim]:
    """The closed forms that apply to this FMU."""
    claims = []
    for form in closed_forms:
        if form.only is not None and scene.name not in form.only:
            continue
        scale = None if form.scale is None else in_variables(form.scale)
        if isinstance(form, Conserved):
            actual, expected, leaving = form.expression, None, None
        else:
            actual = output(form.name) if form.actual is None else form.actual
            expected, leaving = in_variables(form.expected), form.at_departure
        claims.append(
            Claim(
                name=form.name,
                actual=in_variables(actual),
                expected=expected,
                while_closed=form.while_closed,
                while_open=form.while_open,
                until_departure=form.until_departure,
                at_departure=leaving,
                scale=scale,
                within=form.within,
                rounding=form.rounding,
                when=None if form.when is None else in_variables(form.when),
            )
        )
    return claims


def pack_closed_forms(
    scene: Scene, closed_forms: Sequence[ClosedForm | Conserved], table: VariableTable
) -> bytes:
    """JSON with the claims; expressions are indexed symbols, so that any name can be read back.

    Raises ModelError if a claim uses what the FMU does not have.
    """
    claims = claims_of(scene, closed_forms)
    known = {v.name for v in table.variables}
    problems = []
    for claim in claims:
        used = {
            str(s)
            for e in (claim.actual, claim.expected, claim.scale, claim.when)
            if e is not None
            for s in sp.sympify(e).free_symbols
        }
        read = {n[len("initial(") : -1] if n.startswith("initial(") else n for n in used}
        contacts = {getattr(claim, condition) for condition in CONDITIONS}
        read |= {f"contact.{c}" for c in contacts if c}
        for name in sorted(read - known - {"time"}):
            near = difflib.get_close_matches(name, known, 1)
            problems.append(
                f"closed form {claim.name!r} uses {name!r}, which is no variable of the FMU"
                + (f"; did you mean {near[0]!r}?" if near else "")
            )
    if problems:
        raise ModelError(scene.name, problems)
    packed = []
    for claim in claims:
        entry: dict[str, Any] = {
            key: getattr(claim, key) for key in ("name", *CONDITIONS, "within", "rounding")
        }
        names: dict[Expr, str] = {}
        for key in EXPRESSIONS:
            e = getattr(claim, key)
            entry[key] = None if e is None else _text(sp.sympify(e), names)
        entry["symbols"] = {short: str(symbol) for symbol, short in names.items()}
        packed.append(entry)
    return json.dumps({"format": FORMAT, "closed_forms": packed}, indent=1).encode()


def unpack_closed_forms(content: bytes, name: str) -> list[Claim]:
    """The claims in an FMU.  Raises VerificationError if the file is not lagfmu's."""
    try:
        data = json.loads(content)
        if data["format"] != FORMAT:
            raise ValueError(f"format {data['format']!r}, expected {FORMAT}")
        return [_claim(entry) for entry in data["closed_forms"]]
    except (ValueError, KeyError, TypeError, SyntaxError, AttributeError) as error:
        raise VerificationError(
            f"{name!r}: resources/lagfmu.json cannot be read ({error}); rebuild the FMU with this "
            "version of lagfmu"
        ) from None


def _text(e: Expr, names: dict[Expr, str]) -> str:
    for symbol in sorted(e.free_symbols, key=str):
        names.setdefault(symbol, f"s{len(names)}")
    return str(sp.sstr(e.xreplace({s: sp.Symbol(n) for s, n in names.items()}), full_prec=True))


def _claim(entry: dict[str, Any]) -> Claim:
    symbols = {short: output(name) for short, name in entry.pop("symbols").items()}
    for key in EXPRESSIONS:
        if entry.get(key) is not None:
            entry[key] = parse_expr(entry[key], local_dict=symbols)
    return Claim(**entry)
