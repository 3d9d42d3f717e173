"""What is wrong with the frictions of a model, in words.

A friction limits the multipliers of one or two constraints, forces or one torque, by a normal force that is
linear in multipliers of other constraints, or a sum of norms of such (reactions.py), or a limit of its own.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import sympy as sp

from ..errors import UnitError
from .dimensions import check_dimension, dimension_of
from .elements import (
    NAME,
    TIME,
    Contact,
    Expr,
    Friction,
    ModelFields,
    Nonholonomic,
    plain,
    undeclared,
)
from .reactions import multiplier, norms_of, reactions_in
from .units import ONE, Unit, parse_unit

MOST_ROWS = 2  # tangential directions of a surface
NEWTON = parse_unit("N", "a force")
TORQUE = parse_unit("N.m", "a torque")
METRE = parse_unit("m", "a length")


def split(constraints: Iterable[object]) -> tuple[tuple[object, ...], tuple[Friction, ...]]:
    """The constraints that have rows of their own, and the frictions among them."""
    items = tuple(constraints)
    rest = tuple(c for c in items if not isinstance(c, Friction))
    return rest, tuple(c for c in items if isinstance(c, Friction))


def check_kinds(model: ModelFields, problems: list[str]) -> None:
    """Fields that cannot be read at all: names, lists of names, expressions."""
    seen: set[str] = set()
    for f in model.frictions:
        if not isinstance(f, Friction):
            problems.append(
                f"frictions hold {f!r}, expected Friction(...): put it in `constraints`"
            )
            continue
        if not isinstance(f.name, str) or not NAME.match(f.name):
            problems.append(
                f"friction name {f.name!r} is not a name that FMI allows: use letters a-z, A-Z, digits "
                "and _, not beginning with a digit"
            )
        if f.name in seen:
            problems.append(f"two frictions are called {f.name!r}: rename one")
        seen.add(f.name)
        named = isinstance(f.of, Sequence) and not isinstance(f.of, str)
        if not named or not f.of or not all(isinstance(name, str) for name in f.of):
            problems.append(
                f"friction {f.name!r}: of = {f.of!r}, expected a list of constraint names, e.g. "
                "of=['rolling']"
            )
        if f.limit is not None and (f.normal is not f.limit or f.static != 1):
            problems.append(
                f"friction {f.name!r}: limit is given with normal or static, expected one of both: the limit "
                "is the force or torque itself"
            )
            continue
        for what, value in (
            (_word(f), f.normal),
            ("static", f.static),
            ("kinetic", f.sliding),
        ):
            is_text = isinstance(value, str)
            if is_text or not isinstance(sp.sympify(value, strict=False), sp.Expr):
                problems.append(
                    f"friction {f.name!r}: {what} = {value!r} is no expression: write a number, "
                    "or an expression of parameters (normal: of multiplier(NAME))"
                )
        if not isinstance(f.description, str):
            problems.append(
                f"description of friction {f.name!r} is {f.description!r}, expected a text"
            )


def _word(f: Friction) -> str:
    """What the force or torque that limits it is called."""
    return "normal" if f.limit is None else "limit"


def check_frictions(
    model: ModelFields, units: Mapping[Expr, Unit], reactions: Mapping[Expr, Unit]
) -> list[str]:
    """Everything that is wrong with frictions whose fields can be read."""
    problems: list[str] = []
    owner: dict[str, str] = {}
    for f in model.frictions:
        before = len(problems)
        _check_rows(model, f, owner, reactions, problems)
        if len(problems) == before:
            _check_directions(model, f, units, problems)
    for f in model.frictions:
        known = {**units, **reactions}
        arm = _check_normal(model, f, owner, known, problems)
        _check_coefficients(model, f, known, arm, problems)
    if model.frictions and model.embedding is not None:
        problems.append(
            "friction with an embedding: the normal force is needed in every mode, and the embedding "
            "eliminates it: leave the embedding out, and let constraints tie the coordinates"
        )
    return problems


def _check_rows(
    model: ModelFields,
    f: Friction,
    owner: dict[str, str],
    reactions: Mapping[Expr, Unit],
    problems: list[str],
) -> None:
    known = {c.name: c for c in model.constraints}
    if len(f.of) > MOST_ROWS:
        problems.append(
            f"friction {f.name!r}: of = {list(f.of)!r} names {len(f.of)} constraints, expected one or "
            "two, the directions in which a surface can slip: make more frictions"
        )
    for name in f.of:
        c = known.get(name)
        if c is None:
            problems.append(
                f"friction {f.name!r}: of = {list(f.of)!r} names {name!r}, which is no constraint of "
                f"this model (constraints: {', '.join(known) or 'none'}): correct the name"
            )
            continue
        if isinstance(c, Contact):
            problems.append(
                f"friction {f.name!r}: of = {list(f.of)!r} names the contact {name!r}, expected what "
                "holds along the surface: a Nonholonomic slip velocity, and the contact in `normal`"
            )
            continue
        if name in owner:
            problems.append(
                f"the constraint {name!r} belongs to the frictions {owner[name]!r} and {f.name!r}: "
                "take it out of one"
            )
        owner[name] = f.name
        unit = reactions.get(multiplier(name))
        alone = len(f.of) == 1
        if unit is not None and not any(map(unit.same_dimension, (NEWTON, TORQUE)[: 1 + alone])):
            problems.append(
                f"friction {f.name!r}: the multiplier of {name!r} is in {unit.name}, expected N"
                f"{' or N.m' if alone else ''}: write the constraint as a length or a velocity at the "
                "surface, e.g. x - R*theta in m or x.diff() - R*theta.diff() in m/s"
            )
        gate = getattr(c, "while_closed", None)
        if gate is not None and multiplier(gate) not in sp.sympify(f.normal).free_symbols:
            problems.append(
                f"friction {f.name!r}: {name!r} acts while {gate!r} is closed, but its normal force "
                f"{plain(sp.sympify(f.normal))} is not of that contact: use "
                f"normal=multiplier({gate!r}), or leave while_closed out"
            )


def _check_directions(
    model: ModelFields, f: Friction, units: Mapping[Expr, Unit], problems: list[str]
) -> None:
    """Two rows are velocities of one point along perpendicular directions.

    That can be seen where they hold lengths x, y of which the Lagrangian has m (x'^2 + y'^2)/2: these are
    Cartesian, and the product of the directions is that of the coefficients.
    """
    known = {c.name: c for c in model.constraints}
    rows = [sp.sympify(known[name].expression) for name in f.of if name in known]
    if len(rows) != MOST_ROWS or len(rows) != len(f.of):
        return
    rates = [q.diff(TIME) for q in model.coordinates]
    rows = [
        row if isinstance(known[name], Nonholonomic) else row.diff(TIME)
        for name, row in zip(f.of, rows, strict=True)
    ]
    straight = [
        v
        for q, v in zip(model.coordinates, rates, strict=True)
        if units[q].same_dimension(METRE) and any(row.has(v) for row in rows)
    ]
    L = model.energy_expression
    masses = {(a, b): sp.simplify(L.diff(a, b)) for a in straight for b in straight}
    equal = {masses[v, v] for v in straight}
    if len(equal) != 1 or any(masses[a, b] != 0 for a in straight for b in straight if a != b):
        return
    product = sp.simplify(sum(rows[0].diff(v) * rows[1].diff(v) for v in straight))
    if product != 0:
        problems.append(
            f"friction {f.name!r}: {f.of[0]!r} and {f.of[1]!r} are not perpendicular (the product of "
            f"their directions is {plain(product)}), so that their multipliers are no components of one "
            "force: write the slip velocities along two perpendicular directions"
        )


def _check_normal(
    model: ModelFields,
    f: Friction,
    owner: Mapping[str, str],
    units: Mapping[Expr, Unit],
    problems: list[str],
) -> Unit:
    """Of the normal force; returns the unit that a coefficient then needs: of the multiplier over the normal
    force's, of which the one or the other may be a torque."""
    normal = sp.sympify(f.normal)
    what = f"{_word(f)} of friction {f.name!r}"
    rows = {multiplier(c.name): c for c in model.constraints}
    before = len(problems)
    for symbol in reactions_in(normal):
        if symbol not in rows:
            problems.append(
                f"{what}: {symbol} is no multiplier of this model's constraints "
                f"({', '.join(c.name for c in rows.values())}): use multiplier(NAME)"
            )
        elif rows[symbol].name in owner:
            problems.append(
                f"{what}: {symbol} is itself limited by the friction {owner[rows[symbol].name]!r}, "
                "expected multipliers of surfaces and joints"
            )
    present = [s for s in reactions_in(normal) if s in rows]
    pushing = [rows[s].name for s in present if isinstance(rows[s], Contact)]
    norms = norms_of(normal)
    if norms is None:
        problems.append(
            f"{what}: {plain(normal)} is neither linear in the multipliers nor a sum of norms of such, "
            "expected a sum of multipliers times numbers, or, in a joint whose force has two components, "
            "norm(multiplier('A.x'), multiplier('A.y')): a friction for each component would be up to 41 % "
            "too strong"
        )
    elif len(sum(norms, ())) > 1 and pushing:
        problems.append(
            f"{what}: {plain(normal)} is a norm with the contact{'s' if len(pushing) > 1 else ''} "
            f"{', '.join(map(repr, pushing))}, expected multipliers of joints: a contact pushes along its "
            "normal alone: make a friction of each contact"
        )
    if f.limit is not None and present:
        problems.append(
            f"{what}: {plain(normal)} holds multipliers: give them as normal, with static"
        )
    _check_symbols(model, what, normal, set(present), problems)
    limited = next((units[s] for s in map(multiplier, f.of) if s in units), NEWTON)
    if len(problems) > before:
        return ONE
    try:
        found = dimension_of(normal, units, what) or NEWTON
    except UnitError as error:
        problems.append(str(error))
        return ONE
    if f.limit is not None:
        problems += check_dimension(normal, limited, units, what)
        return ONE
    if limited.same_dimension(TORQUE) and found.same_dimension(TORQUE):
        return ONE
    problems += check_dimension(normal, NEWTON, units, what)
    return limited / NEWTON


def _check_coefficients(
    model: ModelFields, f: Friction, units: Mapping[Expr, Unit], arm: Unit, problems: list[str]
) -> None:
    values = {p.symbol: float(p.value) for p in model.parameters}
    numbers = {}
    for kind, mu in (("static", sp.sympify(f.static)), ("kinetic", sp.sympify(f.sliding))):
        if kind == "kinetic" and f.kinetic is None:
            continue
        what = f"{kind} of friction {f.name!r}"
        before = len(problems)
        _check_symbols(model, what, mu, set(), problems)
        if len(problems) == before:
            found = check_dimension(mu, arm, units, what)
            if found and arm.same_dimension(METRE):
                found[-1] += (
                    f"; it limits the torque {', '.join(f.of)} by a force, and takes the radius with it: "
                    "mu*r"
                )
            problems += found
        if len(problems) > before:
            continue
        value = sp.sympify(mu.xreplace(values))
        if value.is_number:
            numbers[kind] = float(value) if value.is_real else math.nan
            if not 0 <= numbers[kind] < math.inf:
                shown = repr(numbers[kind]) if value.is_real else plain(value)
                problems.append(f"{what} is {shown}, expected a number of at least 0")
    if "kinetic" in numbers and numbers["kinetic"] > numbers.get("static", math.inf):
        problems.append(
            f"friction {f.name!r}: kinetic = {numbers['kinetic']!r} is above static = "
            f"{numbers['static']!r}, so that it could neither stick nor slip: exchange them"
        )


def _check_symbols(
    model: ModelFields, what: str, expression: Expr, also: set[Expr], problems: list[str]
) -> None:
    told = {s for s in reactions_in(expression) if what.startswith("normal")}
    problems += undeclared(model, what, expression, also | told)
    for d in sorted(expression.atoms(sp.Derivative), key=str):
        highest = 0 if d.expr in model.speeds or d.expr not in model.coordinates else 1
        if d.derivative_count > highest:
            problems.append(f"{what}: holds {plain(d)}, expected coordinates and their velocities")
