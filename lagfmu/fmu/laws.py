"""The laws of a mechanism's bodies (model/laws.py) as they travel inside an FMU."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any

import sympy as sp

from ..model.closed_form import output
from ..model.elements import Expr
from ..model.expression import read_formula, text_of
from ..model.laws import GROUND, Act, Laws, Where
from ..names import derivative

FIELDS = {"planar", "unknowns", "names", "masses", "inertias", "gravity", "acts", "jumps"}


def pack_laws(laws: Laws, numbers: Mapping[str, Expr]) -> dict[str, Any]:
    """For JSON, with the `numbers` of parameters that the FMU does not have; symbols are numbered."""
    short: dict[Expr, Expr] = {}

    def text(e: Expr) -> str:
        e = sp.sympify(e)
        e = e.xreplace(
            {s: sp.sympify(numbers[str(s)]) for s in e.free_symbols if str(s) in numbers}
        )
        for s in sorted(e.free_symbols, key=str):
            short.setdefault(s, sp.Symbol(f"s{len(short)}"))
        return text_of(e.xreplace(short))

    def all_of(several: Any) -> list[str]:
        return [text(e) for e in several]

    def where(w: Where) -> list[Any]:
        return [w.body, all_of(w.arm), all_of(w.axes)]

    found: dict[str, Any] = {
        "planar": laws.planar,
        "unknowns": laws.unknowns,
        "names": list(laws.names),
        "masses": all_of(laws.masses),
        "inertias": [all_of(row) for row in laws.inertias],
        "gravity": all_of(laws.gravity),
        "acts": [
            [
                *map(where, (a.on, a.along)),
                a.against,
                a.line,
                *map(all_of, (a.force, a.torque)),
                text(a.size),
            ]
            for a in laws.acts
        ],
        "jumps": all_of(laws.jumps),
    }
    return found | {"symbols": {str(s): str(name) for name, s in short.items()}}


def read_laws(data: Any, tables: Mapping[str, Any]) -> Laws:
    """What pack_laws() made.  Raises ValueError with what is wrong in it."""
    if not isinstance(data, dict) or set(data) != FIELDS | {"symbols"}:
        raise ValueError("laws with other fields than this version of lagfmu knows")
    try:
        return _laws(data, tables)
    except (TypeError, AttributeError, KeyError, IndexError):
        raise ValueError("laws of another shape than this version of lagfmu knows") from None


def _laws(data: Mapping[str, Any], tables: Mapping[str, Any]) -> Laws:
    count = len(_texts(data["names"]))
    symbols = {short: output(name) for short, name in data["symbols"].items()}
    _texts(list(data["symbols"].values()))
    read: dict[str, Expr] = {}

    def formula(text: str) -> Expr:
        if text not in read:
            read[text] = read_formula(text, symbols, tables)
        return read[text]

    def several(texts: Any, length: int) -> list[Expr]:
        return [formula(t) for t in _texts(texts, length)]

    def body(number: Any) -> int:
        if type(number) is not int or not GROUND <= number < count:
            raise ValueError(f"a law speaks of body {number!r} of {count}")
        return number

    def where(given: Any) -> Where:
        on, arm, axes = given
        return Where(body(on), several(arm, 3), several(axes, 9))

    def act(given: Any) -> Act:
        on, along, against, line, force, torque, size = given
        vectors = several(force, 3), several(torque, 3), formula(size)
        return Act(where(on), where(along), body(against), line is True, *vectors)

    planar, unknowns = data["planar"] is True, data["unknowns"]
    if type(unknowns) is not int or unknowns < 0:
        raise ValueError(f"laws of {unknowns!r} unknowns")
    inertias = [several(row, 1 if planar else 6) for row in data["inertias"]]
    if len(inertias) != count:
        raise ValueError(f"{len(inertias)} inertias of {count} bodies")
    masses, gravity = several(data["masses"], count), several(data["gravity"], 3)
    acts = [act(a) for a in data["acts"]]
    jumps = [formula(t) for t in _texts(data["jumps"])]
    return Laws(planar, unknowns, data["names"], masses, inertias, gravity, acts, jumps)


def _texts(given: Any, length: int | None = None) -> list[str]:
    """A list of texts.  Raises ValueError for what is none."""
    if not isinstance(given, list) or not all(isinstance(t, str) for t in given):
        raise ValueError(f"{given!r}: expected a list of texts")
    if length is not None and len(given) != length:
        raise ValueError(f"a list of {len(given)} texts, expected {length}")
    return given


def motion_of(laws: Laws, body: int, second: bool = False) -> list[str]:
    """The variables that say where a body is, and how it moves if `second`."""
    name = laws.names[body]
    if laws.planar:
        states = [*(f"{name}.position.{x}" for x in "xy"), f"{name}.orientation.z"]
        return states + [derivative(s, 2) for s in states] * second
    place = [f"{name}.position.{x}" for x in "xyz"]
    spin = [f"{name}.omega.{x}" for x in "xyz"]
    moving = [derivative(s, 2) for s in place] + spin + [derivative(w) for w in spin]
    return place + [f"{name}.orientation.{x}" for x in "wxyz"] + moving * second


def needed(laws: Laws, body: int) -> set[str]:
    """The variables and parameters of the two laws of a body."""

    def symbols(several: Any) -> Iterator[str]:
        for e in several:
            yield from map(str, sp.sympify(e).free_symbols)

    own = (laws.masses[body], *laws.inertias[body], *laws.gravity, *laws.jumps)
    found = {*motion_of(laws, body, True), *symbols(own)}
    for act in laws.acts:
        if body in act.bodies:
            found |= set(symbols(act.expressions))
            for where in (act.on, act.along):
                found |= set(motion_of(laws, where.body)) if where.body != GROUND else set()
    return found - {"time"}


def stated(laws: Laws, known: Collection[str]) -> list[int]:
    """The bodies of whose laws nothing is missing."""
    return [k for k in range(len(laws.names)) if needed(laws, k) <= set(known)]
