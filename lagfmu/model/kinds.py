"""What each field of a Model must hold to be read at all: dicts and lists, expressions, texts, names.

Nothing here knows what a name or an expression means; `check.py` does.

Expressions that can be written down but not used: they have no value somewhere, no derivative, or more
than one component.  Each is named with what to write instead.
"""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import accumulate
from typing import Any

import sympy as sp
from sympy.core.function import AppliedUndef
from sympy.physics.vector.dyadic import Dyadic
from sympy.physics.vector.vector import Vector

from ..names import RESERVED, read
from .elements import (
    TIME,
    Contact,
    Embedding,
    Expr,
    Friction,
    Holonomic,
    Input,
    ModelFields,
    Nonholonomic,
    Output,
    Parameter,
    Peak,
    is_name,
    name_of,
    plain,
)
from .frictions import check_kinds

KINKED = (sp.Abs, sp.sign, sp.Heaviside, sp.Max, sp.Min, sp.floor, sp.ceiling, sp.Mod)
MOST = 400  # operations of an f that is looked at as a product


def _of_several_components(what: str, thing: object) -> list[str]:
    """A vector or a matrix where one expression belongs."""
    if isinstance(thing, (sp.MatrixBase, sp.MatrixExpr, Vector, Dyadic)):
        kind = "vector" if isinstance(thing, (Vector, Dyadic)) else "matrix"
        how = "r.dot(N.x)" if kind == "vector" else "r[0]"
        return [
            f"{what} is a {kind}, {thing}: write one for each of its components, for example "
            f"Holonomic('close_x', {how})"
        ]
    return []


def _unusable(what: str, expression: Expr) -> list[str]:
    """Cases that leave a gap."""
    problems = []
    for piece in expression.atoms(sp.Piecewise):
        if piece.args[-1].cond != sp.true:
            problems.append(
                f"{what}: {plain(piece)} has no value where none of its conditions holds: end it with a "
                "case (value, True)"
            )
    return problems


def unusable_surfaces(model: ModelFields) -> list[str]:
    """Functions f of constraints that lack a second derivative, or whose gradient vanishes with them."""
    problems = []
    changing = (*model.coordinates, *(i.symbol for i in model.inputs))
    moving = {TIME}.union(*(s.free_symbols for s in changing))
    for c in model.constraints:
        if not isinstance(c, (Holonomic, Contact)):
            continue
        f = sp.sympify(c.expression)
        kinks = [k for k in f.atoms(*KINKED) if k.free_symbols & moving]
        if kinks:
            problems.append(
                f"constraint {c.name!r}: {', '.join(sorted(map(plain, kinks)))} has a kink or a jump, but f "
                "is differentiated twice: write a smooth f (x**2 - L**2 for |x| - L), or a constraint or "
                "Contact for each side"
            )
        elif f.count_ops() <= MOST and _is_squared(f, moving):
            problems.append(
                f"constraint {c.name!r}: the gradient of {plain(f)} vanishes wherever it is 0 itself, so "
                "that no multiplier can hold it: give what is squared there"
            )
    return problems


def _is_squared(f: Expr, moving: set[Expr]) -> bool:
    """A product, of the factors of which that vanish each is a square or a higher power."""
    terms = sp.Add.make_args(f)
    if len(terms) > 1 and not set.intersection(*(e.atoms(AppliedUndef) for e in terms)):
        return False  # it is none, and factor_terms() takes long to find that
    factors = [a for a in sp.Mul.make_args(sp.factor_terms(f)) if a.free_symbols & moving]
    powers = [a.as_base_exp()[1] for a in factors]
    return bool(powers) and all(p.is_number and p.is_positive and p > 1 for p in powers)


_NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")  # XML 1.0, sect. 2.2
COORDINATE_WORDS = (1, 3)
_NO_NUMBERS = (sp.I, sp.nan, sp.oo, -sp.oo, sp.zoo)


def check_containers(model: ModelFields) -> list[str]:
    """Fields that are no dict or list, before they are copied."""
    problems = []
    if isinstance(model.embedding, Embedding):
        examples = {"coordinates": "{s: 'm'}", "relations": "{x: 2*s}", "start": "{s: 1.0}"}
        problems += _no_dicts(model.embedding, "embedding ", examples)
    elif model.embedding is not None:
        problems.append(
            f"embedding = {model.embedding!r}, expected Embedding(coordinates, relations)"
        )
    examples = {"coordinates": "{x: 'm'}", "forces": "{x: F}", "start": "{x: 1.0}"}
    examples |= {"descriptions": "{x: 'height'}", "speeds": "{w: 'rad/s'}"}
    examples |= {"kinematics": "{phi: w}", "unwrapped": "{phi: atan2(y, x)}"}
    problems += _no_dicts(model, "", examples)
    lists = {"constraints": "Holonomic", "parameters": "Parameter", "inputs": "Input"}
    lists |= {"outputs": "Output", "picture": "Line", "rough": "x.diff"}
    return problems + [
        f"{name} = {value!r}, expected a list, e.g. {name}=[{example}(...)]"
        for name, example in lists.items()
        if isinstance(value := getattr(model, name), str) or not isinstance(value, Iterable)
    ]


def _no_dicts(thing: object, owner: str, examples: Mapping[str, str]) -> list[str]:
    """Those of these fields that are no dict."""
    return [
        f"{owner}{name} = {value!r}, expected a dict, e.g. {name}={example}"
        for name, example in examples.items()
        if not isinstance(value := getattr(thing, name), Mapping)
    ]


def check_types(model: ModelFields, problems: list[str]) -> None:
    """Things that are not what the fields of a Model hold, before anything is read from them."""
    kinds: tuple[tuple[str, Sequence[object], tuple[type, ...]], ...] = (
        ("parameters", model.parameters, (Parameter,)),
        ("inputs", model.inputs, (Input,)),
        ("constraints", model.constraints, (Holonomic, Nonholonomic, Contact, Friction)),
        ("outputs", model.outputs, (Output, Peak)),
    )
    for field_name, items, types in kinds:
        expected = ", ".join(t.__name__ for t in types)
        problems += [
            f"{field_name} hold {item!r}, expected {expected}: write {types[0].__name__}(...)"
            for item in items
            if not isinstance(item, types)
        ]
    check_kinds(model, problems)
    if problems:
        return
    for kind, symbol in [
        *(("parameter", p.symbol) for p in model.parameters),
        *(("input", i.symbol) for i in model.inputs),
    ]:
        if not isinstance(symbol, (sp.Symbol, AppliedUndef)):
            problems.append(f"{kind} {symbol!r} is no SymPy symbol: make one with sympy.symbols")
    expressions = [("lagrangian", model.lagrangian), ("kinetic_energy", model.kinetic_energy)]
    expressions += [(f"force on {plain(sp.sympify(q))}", f) for q, f in model.forces.items()]
    expressions += [(f"constraint {c.name!r}", c.expression) for c in model.constraints]
    expressions += [(f"output {o.name!r}", o.expression) for o in model.outputs]
    expressions += [(f"otherwise of output {o.name!r}", o.otherwise) for o in model.outputs]
    rates = (("kinematics of", model.kinematics), ("unwrapped", model.unwrapped))
    expressions += [(f"{kind} {plain(q)}", e) for kind, of in rates for q, e in of.items()]
    relations = model.embedding.relations if model.embedding else {}
    expressions += [(f"embedding of {plain(sp.sympify(q))}", e) for q, e in relations.items()]
    for what, expression in expressions:
        several = _of_several_components(what, expression)
        problems += several
        if not several and expression is not None and not _is_expression(expression):
            problems.append(
                f"{what}: {expression} is no SymPy expression with a value (it is a "
                f"{type(expression).__name__}): write sums, products and functions of symbols; "
                "a constraint is the expression that vanishes"
            )
        elif not several and expression is not None and sp.sympify(expression).has(*_NO_NUMBERS):
            problems.append(
                f"{what}: {plain(expression)} holds {_no_number(expression)}, expected real and "
                "finite numbers: correct it"
            )
        elif not several and expression is not None:
            problems += _unusable(what, sp.sympify(expression))
    _check_texts(model, problems)


def _no_number(expression: Expr) -> str:
    return ", ".join(str(n) for n in _NO_NUMBERS if sp.sympify(expression).has(n))


def _check_texts(model: ModelFields, problems: list[str]) -> None:
    """Descriptions are texts of characters that XML can hold."""
    texts: list[tuple[str, object]] = [("the model", model.description)]
    about = ("author", "version", "license", "copyright")
    texts += [(f"the model's {what}", getattr(model, what)) for what in about]
    texts += [(f"parameter {name_of(p.symbol)!r}", p.description) for p in model.parameters]
    texts += [(f"input {name_of(i.symbol)!r}", i.description) for i in model.inputs]
    texts += [(f"constraint {c.name!r}", c.description) for c in model.constraints]
    texts += [(f"output {o.name!r}", o.description) for o in model.outputs]
    texts += [(f"{plain(sp.sympify(q))}", text) for q, text in model.descriptions.items()]
    for what, text in texts:
        if not isinstance(text, str):
            problems.append(f"description of {what} is {text!r}, expected a text: put it in quotes")
            continue
        bad = sorted(set(_NO_XML.findall(text)))
        if bad:
            problems.append(
                f"description of {what}: {text!r} holds {', '.join(map(repr, bad))}, which no XML "
                "file can hold: leave it out"
            )


def _is_expression(thing: object) -> bool:
    return not isinstance(thing, str) and isinstance(sp.sympify(thing, strict=False), sp.Expr)


def check_names(model: ModelFields, problems: list[str]) -> None:
    """Names that no FMI variable or Python file can bear, and names of two things."""
    named = [("model", model.name)]
    extra = model.embedding.coordinates if model.embedding else {}
    for kind, symbols in (("coordinate", (*model.coordinates, *extra)), ("speed", model.speeds)):
        for q in symbols:
            if not (isinstance(q, AppliedUndef) and q.args == (TIME,)):
                problems.append(
                    f"{kind} {q} is no function of time: write it as dynamicsymbols('{q}')"
                )
                continue
            named.append(("unwrapped angle" if q in model.unwrapped else kind, name_of(q)))
    if not model.coordinates:
        problems.append("there is no coordinate: a model needs at least one")
    named += [("parameter", name_of(p.symbol)) for p in model.parameters]
    named += [("input", name_of(i.symbol)) for i in model.inputs]
    own = {o.name for o in model.outputs if is_name(o.name)} | {*map(name_of, model.unwrapped)}
    named += [("output", o.name) for o in model.outputs if not _is_rate_of(o.name, own)]
    seen: dict[str, str] = {}
    for kind, name in named:
        _check_name(kind, name, problems)
        if kind == "model" or not is_name(name):
            continue
        if name in seen:
            problems.append(
                f"the name {name!r} is used twice, by {_a(seen[name])} and {_a(kind)}: rename one"
            )
        seen[name] = kind
    problems += [
        f"{short!r} is {_a(seen[short])} and, with the {seen[name]} {name!r}, a group: rename one"
        for name in seen
        for short in accumulate(name.split("."), lambda a, b: f"{a}.{b}")
        if short != name and short in seen
    ]
    contacts = {c.name for c in model.constraints if isinstance(c, Contact)}
    if contacts and seen.get("impulse") == "coordinate":
        c = min(contacts)
        problems.append(
            f"the coordinate 'impulse' in a model with contacts: 'closing.{c}.impulse' would be its value "
            f"when {c!r} closed, and the impulse then: choose another name"
        )
    names = set()
    for constraint in model.constraints:
        _check_name("constraint", constraint.name, problems)
        if constraint.name in names:
            problems.append(f"two constraints are called {constraint.name!r}: rename one")
        names.add(constraint.name)
        if seen.get(constraint.name) in ("coordinate", "speed"):
            problems.append(
                f"constraint {constraint.name!r} has the name of a {seen[constraint.name]}, so that "
                f"'Q.{constraint.name}' would be two things: rename one"
            )
        closed = getattr(constraint, "while_closed", None)
        if closed is not None and closed not in contacts:
            known = ", ".join(sorted(contacts)) or "none"
            problems.append(
                f"constraint {constraint.name!r} acts while_closed={closed!r}, which is no contact "
                f"of this model (contacts: {known})"
            )


def _a(kind: str) -> str:
    return f"an {kind}" if kind[0] in "aeiou" else f"a {kind}"


def _is_rate_of(name: object, outputs: set[str]) -> bool:
    """der(angle.A), of which angle.A is another output."""
    return isinstance(name, str) and read(name).coordinate in outputs - {name}


def _check_name(kind: str, name: Any, problems: list[str]) -> None:
    words = name.split(".") if is_name(name) else []
    if not words or (kind == "model" and len(words) > 1):
        problems.append(
            f"{kind} name {name!r} is not a name that FMI allows: use letters a-z, A-Z, digits and _, "
            "not beginning with a digit"
            + ("" if kind == "model" else ", in words with a dot between them, as 'crank.mass'")
        )
    elif kind in ("coordinate", "speed") and len(words) not in COORDINATE_WORDS:
        problems.append(
            f"{kind} name {name!r} has {len(words)} words, expected one as 'theta' or three as "
            "'crank.position.x': with others 'Q.A.B' could be the share of a constraint"
        )
    elif kind == "model" and keyword.iskeyword(name):
        problems.append(f"model name {name!r} is a word of the Python language: choose another")
    elif kind != "model" and words[0] in RESERVED:
        problems.append(
            f"{kind} name {name!r} is reserved for the FMU's own variables "
            f"({', '.join(RESERVED)}): choose another"
        )


def check_energy(model: ModelFields, problems: list[str]) -> None:
    """One of the two forms of Lagrange's equations is chosen."""
    given = [f for f in (model.lagrangian, model.kinetic_energy) if f is not None]
    if len(given) != 1:
        found = "both lagrangian and" if given else "neither lagrangian nor"
        problems.append(
            f"{found} kinetic_energy given: give either a "
            "lagrangian (with non-conservative forces) or a kinetic_energy (with all forces)"
        )
