"""Closed forms as they travel inside an FMU: text that SymPy reads back.

The laws of a mechanism's bodies (model/closed_form.py) travel likewise.
"""

from __future__ import annotations

import contextlib
import difflib
import json
import warnings
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import sympy as sp

from .. import names
from ..errors import ModelError, TableError, VerificationError
from ..files import foreign, json_of
from ..interface.variables import VariableTable
from ..model.closed_form import (
    GROUND,
    Act,
    ClosedForm,
    Conserved,
    Laws,
    Where,
    in_variables,
    output,
)
from ..model.elements import Expr
from ..model.expression import functions_of, read_formula, text_of
from ..model.scene import Scene, parse
from ..model.spline import Spline, splines_in
from ..names import derivative

FIELDS = {"planar", "unknowns", "names", "masses", "inertias", "gravity", "acts", "jumps"}


def _pack_laws(laws: Laws, numbers: Mapping[str, Expr]) -> dict[str, Any]:
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


def _read_laws(data: Any, tables: Mapping[str, Any]) -> Laws:
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


FORMAT = 1
LAWS = "laws"
LARGEST_RECORD = 1 << 24  # bytes
EXPRESSIONS = ("actual", "expected", "scale", "when")
CONDITIONS = ("while_closed", "while_open", "until_departure", "at_departure")

TEXTS, NUMBERS = ("name", *CONDITIONS, *EXPRESSIONS), ("within", "rounding", "accuracy")


@dataclass(frozen=True)
class CarriedForm(ClosedForm):
    """A closed form (or what is conserved) as an FMU carries it, in symbols named as the FMU's variables.

    `expected` is None for a conserved quantity; `accuracy` is the relative error that the FMU was built
    to hold, as long as it runs with the settings that it was built with.
    """

    accuracy: float | None = None

    @property
    def lasts_until_landing(self) -> bool:
        """Whether it is of something conserved that an impact may change, and does not say itself where it
        holds: then it holds until a contact first closes."""
        said = any(getattr(self, c) is not None for c in (*CONDITIONS, "when"))
        return self.expected is None and not said and names.DISSIPATED not in self.variables

    def allowed(self, tolerance: float, as_built: bool) -> float:
        """The relative error that it may have; `as_built`: with the FMU's own settings."""
        if as_built and self.accuracy is not None:
            return max(self.accuracy, self.rounding)
        return max(self.within * tolerance, self.rounding)

    @property
    def variables(self) -> set[str]:
        """The FMU's variables and parameters that it needs."""
        found = {
            str(s)
            for e in (self.actual, self.expected, self.scale, self.when)
            if e is not None
            for s in sp.sympify(e).free_symbols
        }
        read = {names.initially(n) or n for n in found}
        contacts = {c for condition in CONDITIONS if (c := getattr(self, condition))}
        read |= {names.name(names.CONTACT, c) for c in contacts}
        left = {c for c in (self.until_departure, self.at_departure) if c}
        left |= {s.constraint for s in map(names.read, read) if s.head == names.DEPARTURE}
        return (read | {names.name(names.DEPARTURES, c) for c in left}) - {"time"}

    def in_scene(self, numbers: Mapping[str, Expr], held: Collection[str]) -> CarriedForm | None:
        """The same with numbers for parameters, and contacts that stay closed; None if it speaks of
        such a contact being open, or never holds with these numbers."""
        if {self.while_open, self.at_departure} & set(held):
            return None

        def put(e: Expr) -> Expr:
            if e is None:
                return None
            e = sp.sympify(e)
            return e.xreplace({s: numbers[str(s)] for s in e.free_symbols if str(s) in numbers})

        when = put(self.when)
        if when == sp.false:
            return None
        return replace(
            self,
            actual=put(self.actual),
            expected=put(self.expected),
            scale=put(self.scale),
            when=None if when == sp.true else when,
            while_closed=None if self.while_closed in held else self.while_closed,
            until_departure=None if self.until_departure in held else self.until_departure,
        )

    def with_losses(self) -> CarriedForm:
        """The same; of a conserved quantity that is linear in the energy, with what impacts and frictions
        took from it, if it does not name that itself."""
        energy, losses = output(names.TOTAL), output(names.DISSIPATED)
        actual = sp.sympify(self.actual)
        part = sp.diff(actual, energy)
        linear = part != 0 and energy not in part.free_symbols
        if self.expected is not None or not linear or losses in actual.free_symbols:
            return self
        return replace(self, actual=actual + part * losses)


def carried(scene: Scene, closed_forms: Sequence[ClosedForm | Conserved]) -> list[CarriedForm]:
    """The closed forms that apply to this FMU."""
    found = []
    for form in closed_forms:
        if form.only is not None and scene.name not in form.only:
            continue
        said = {f.name: getattr(form, f.name) for f in fields(form)}
        if isinstance(form, Conserved):
            said |= {"actual": said.pop("expression"), "expected": None}
        elif form.actual is None:
            said["actual"] = output(form.name)
        said |= {k: in_variables(said[k]) for k in EXPRESSIONS if said[k] is not None}
        found.append(CarriedForm(**said))
    return found


def pack_closed_forms(
    scene: Scene,
    closed_forms: Sequence[ClosedForm | Conserved],
    table: VariableTable,
    numbers: Mapping[str, Expr] | None = None,
    held: Collection[str] = (),
    tables: Sequence[Spline] = (),
    contacts: Collection[str] = (),
    laws: Laws | None = None,
) -> bytes:
    """JSON with the closed forms; expressions are indexed symbols, so that any name can be read back.

    `numbers` are the values of parameters that the FMU does not have, `held` the contacts that stay
    closed, `contacts` those that may open, `tables` those that the model looks up, besides those of the
    closed forms, `laws` those of its bodies.  Those that need a variable which the scene leaves out are left
    out too, and counted.
    Raises ModelError if one uses what no FMU of the model has.
    """
    known_of = carried(scene, closed_forms)
    applying = [
        found for form in known_of if (found := form.in_scene(numbers or {}, held)) is not None
    ]
    known = {v.name for v in table.variables}
    if names.DISSIPATED in known:
        applying = [form.with_losses() for form in applying]
    modes = {names.name(names.CONTACT, c) for c in contacts}
    problems = []
    kept = []
    for form in applying:
        missing = sorted((form.variables | (modes if form.lasts_until_landing else set())) - known)
        if not missing:
            kept.append(form)
        elif scene.complete:
            for name in missing:
                near = difflib.get_close_matches(name, known, 1)
                problems.append(
                    f"closed form {form.name!r} uses {name!r}, which is no variable of the FMU"
                    + (f"; did you mean {near[0]!r}?" if near else "")
                )
    goal = None if scene.accuracy is None else parse(scene.accuracy)
    held_against = [getattr(form, key) for form in kept for key in EXPRESSIONS]
    used = splines_in(e for e in held_against if e is not None)
    tables = sorted({*tables, *used}, key=lambda s: s.name)
    packed, functions = [], functions_of(tables)
    for form in kept:
        plain = ("name", *CONDITIONS, "within", "rounding")
        entry: dict[str, Any] = {key: getattr(form, key) for key in plain}
        short_of: dict[Expr, str] = {}
        for key in EXPRESSIONS:
            e = getattr(form, key)
            entry[key] = None if e is None else _text(sp.sympify(e), short_of)
        if goal is not None:
            symbols = {str(s) for s in sp.sympify(form.actual).free_symbols}
            entry["accuracy"] = goal.allowed(symbols, form.within)
        entry["symbols"] = {short: str(symbol) for symbol, short in short_of.items()}
        packed.append(entry)
        try:
            _form(entry, functions)  # it has to come back
        except ValueError as error:
            problems.append(f"closed form {form.name!r} cannot be carried by an FMU: {error}")
    if problems:
        raise ModelError(scene.name, problems)
    record: dict[str, Any] = {"format": FORMAT, "closed_forms": packed}
    if len(kept) < len(known_of):
        record["left_out"] = len(known_of) - len(kept)
    if laws is not None:
        record[LAWS] = _pack_laws(laws, numbers or {})
    if tables:
        record["tables"] = [
            {"name": s.name, "x": s.x, "y": s.y, "ends": s.ends}
            | {"x_unit": s.x_unit.name, "y_unit": s.y_unit.name}
            for s in tables
        ]
    return json.dumps(record, indent=1).encode()


def left_out_of(content: bytes) -> int:
    """How many closed forms the scene leaves out, of a file that unpack_closed_forms() reads."""
    return int(json_of(content).get("left_out", 0))


def unpack_laws(content: bytes, name: str) -> Laws | None:
    """The laws of bodies in an FMU, which unpack_closed_forms() reads; None without any.  Raises as that."""
    with _read(name):
        data = json_of(content)
        if LAWS not in data:
            return None
        tables = functions_of([_spline(entry) for entry in data.get("tables", [])])
        return _read_laws(data[LAWS], tables)


def unpack_closed_forms(content: bytes, name: str) -> list[CarriedForm]:
    """The closed forms in an FMU, none of whose text is run (model/expression.py).

    Raises VerificationError if the file is not lagfmu's.
    """
    with _read(name):
        if len(content) > LARGEST_RECORD:
            raise ValueError(f"{len(content)} bytes, expected at most {LARGEST_RECORD}")
        data = json_of(content)
        if not isinstance(data, dict) or data.get("format") != FORMAT:
            raise ValueError(f"expected format {FORMAT}")
        for what, field in (("closed forms", "closed_forms"), ("tables", "tables")):
            if not isinstance(data.get(field, []), list) or "closed_forms" not in data:
                raise ValueError(f"expected a list of {what}")
        if type(data.get("left_out", 0)) is not int:
            raise ValueError("expected a number of closed forms that are left out")
        functions = functions_of([_spline(entry) for entry in data.get("tables", [])])
        return [_form(entry, functions) for entry in data["closed_forms"]]


def _read(name: str) -> contextlib.AbstractContextManager[None]:
    return foreign(
        lambda said: VerificationError(
            f"{name!r}: resources/lagfmu.json cannot be read ({said}); rebuild the FMU with this version of "
            "lagfmu"
        )
    )


def _text(e: Expr, short_of: dict[Expr, str]) -> str:
    for symbol in sorted(e.free_symbols, key=str):
        short_of.setdefault(symbol, f"s{len(short_of)}")
    return text_of(e.xreplace({s: sp.Symbol(n) for s, n in short_of.items()}))


def _spline(entry: Any) -> Spline:
    """A table of the record.  Raises ValueError with what is wrong in it."""
    fields = ("name", "x", "y", "x_unit", "y_unit", "ends")
    if not isinstance(entry, dict) or set(entry) != set(fields):
        raise ValueError("a table with other fields than this version of lagfmu knows")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # told when the FMU was built
            return Spline(*(entry[f] for f in fields))
    except TableError as error:
        raise ValueError(str(error)) from None


def _form(entry: Any, tables: Mapping[str, Any]) -> CarriedForm:
    """One entry of the record.  Raises ValueError with what is wrong in it."""
    if not isinstance(entry, dict) or {*entry, "accuracy"} != {*TEXTS, *NUMBERS, "symbols"}:
        raise ValueError("a closed form with other fields than this version of lagfmu knows")
    for key in TEXTS:
        optional = key not in ("name", "actual")
        if not isinstance(entry[key], str) and not (optional and entry[key] is None):
            raise ValueError(f"{key!r} of a closed form is {entry[key]!r}, expected text")
    fields: dict[str, Any] = {key: entry[key] for key in ("name", *CONDITIONS)}
    for key in NUMBERS:
        number = entry.get(key)
        if key == "accuracy" and number is None:
            continue
        if isinstance(number, bool) or not isinstance(number, (int, float)) or not number >= 0:
            raise ValueError(f"{key!r} of {entry['name']!r} is {number!r}, expected a number >= 0")
        fields[key] = float(number)
    named = entry["symbols"]
    if not isinstance(named, dict) or not all(isinstance(n, str) for n in named.values()):
        raise ValueError(f"the symbols of {entry['name']!r} are not names")
    symbols = {short: output(name) for short, name in named.items()}
    for key in EXPRESSIONS:
        text = entry[key]
        fields[key] = None if text is None else read_formula(text, symbols, tables)
    return CarriedForm(**fields)
