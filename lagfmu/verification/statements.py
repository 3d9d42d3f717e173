"""What must hold of any FMU, from a TOML file: a list of tables, each of one of the KINDS.

    [[bounds]]
    of = "lambda.rod"
    at_least = 0

Formulas are read as text that is never run (model/expression.py).

A run of deviation d is right where d <= absolute + within * scale; d is of the unit of `of`, and the scale
the largest magnitude of `of` along the run.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from .. import names
from ..errors import SettingError
from ..files import content_of, foreign, toml_of
from ..fmu.read import Trajectory, numbers_of
from ..model.closed_form import output
from ..model.elements import Expr
from ..model.expression import read_named
from ..model.rule import missing
from .check import Against, Check
from .closed_forms import evaluate, measured
from .reference import Reference, read_table

# of the formula of a key, at the points of a statement
Values = Callable[[str], NDArray[np.float64]]


@dataclass(frozen=True)
class Claim:
    """One statement; `formulas` by their keys, errors allowed up to `absolute` + `within` * scale."""

    kind: str
    name: str
    formulas: Mapping[str, Expr]
    within: float
    absolute: float
    direction: float = 1.0
    occurrence: int = 1
    stop_time: float | None = None

    @property
    def variables(self) -> set[str]:
        """The FMU's variables and parameters that it needs."""
        found = {str(s) for e in self.formulas.values() for s in e.free_symbols}
        return {names.initially(n) or n for n in found}

    def checks(self, result: Trajectory, values: Mapping[str, float]) -> list[Check]:
        """What came of it."""
        chosen = np.ones(len(result), dtype=bool)
        if "when" in self.formulas:
            when = evaluate(self.formulas["when"], result, result, values, self.name)
            chosen = (when != 0) & ~np.isnan(when)
        rows = result[chosen]
        if not len(rows):
            return [Check(self.name, 0.0, self.within, 0)]

        def of(key: str) -> NDArray[np.float64]:
            return evaluate(self.formulas[key], rows, result, values, self.name)

        if self.kind == "event":
            return [self._event(of, rows["time"])]
        actual, nearest = of("of"), self._nearest(of)
        scale = of("scale") if "scale" in self.formulas else actual
        found = (self.name, self.within, result, chosen, actual, nearest, scale, self.absolute)
        return [measured(*found)]

    def _nearest(self, of: Values) -> NDArray[np.float64]:
        """What `of` would have to be at each point, as near as possible to what it is."""
        actual = of("of")
        if self.kind == "equal":
            return of("to")
        if self.kind == "conserved":
            return np.full_like(actual, actual[0])
        if self.kind == "monotone":
            highest = np.maximum.accumulate(self.direction * actual)
            return np.asarray(self.direction * highest)
        if "at_least" in self.formulas:
            actual = np.maximum(actual, of("at_least"))
        if "at_most" in self.formulas:
            actual = np.minimum(actual, of("at_most"))
        return actual

    def _event(self, of: Values, times: NDArray[np.float64]) -> Check:
        """A condition becomes true between two points of a run: no error where the time that is said lies
        between these."""
        holds = of("becomes") != 0
        begins = np.flatnonzero(holds[1:] & ~holds[:-1]) + 1
        if len(begins) < self.occurrence:
            expected = float(of("at")[-1])
            if expected > times[-1]:
                return Check(self.name, 0.0, self.within, 0)
            told = f"came {len(begins)} times until t = {times[-1]:.9g} s"
            return Check(self.name, np.inf, self.within, len(times), told)
        k = int(begins[self.occurrence - 1])
        expected, before, after = float(of("at")[k]), float(times[k - 1]), float(times[k])
        beyond = max(before - expected, expected - after, 0.0)
        scale = abs(float(of("scale")[k])) if "scale" in self.formulas else abs(expected)
        error = max(beyond - self.absolute, 0.0) / (scale or 1.0)
        if not np.isfinite(error):
            return Check(self.name, np.inf, self.within, len(times), "not a finite number")
        told = f"came between {before:.9g} and {after:.9g} s, expected at {expected:.9g} s"
        return Check(self.name, error, self.within, len(times), told if error else "")


WITHIN = 1e-6  # relative error that is allowed where nothing is said
DIRECTIONS = {"rising": 1.0, "falling": -1.0}
LARGEST = 1_000_000  # bytes of a file
LONGEST = 200  # letters of the name of one


@dataclass(frozen=True)
class Kind:
    """A kind of statement: keys that it must have and may have, besides those of all, and its title."""

    needed: tuple[str, ...]
    optional: tuple[str, ...]
    title: Callable[[Mapping[str, Any]], str]


def _limits(said: Mapping[str, Any]) -> str:
    low = f"{said['at_least']} <= " if "at_least" in said else ""
    high = f" <= {said['at_most']}" if "at_most" in said else ""
    return f"{low}{said.get('of')}{high}"


KINDS = {
    "equal": Kind(("of", "to"), (), lambda s: f"{s.get('of')} = {s.get('to')}"),
    "bounds": Kind(("of",), ("at_least", "at_most"), _limits),
    "conserved": Kind(("of",), (), lambda s: f"{s.get('of')} is conserved"),
    "monotone": Kind(
        ("of", "direction"), (), lambda s: f"{s.get('of')} is {s.get('direction')} or rests"
    ),
    "event": Kind(
        ("becomes", "at"), ("occurrence",), lambda s: f"{s.get('becomes')} at {s.get('at')} s"
    ),
    "reference": Kind(("file",), (), lambda s: f"reference {s.get('file')}"),
}
OF_ALL = ("name", "when", "scale", "within", "absolute")
FORMULAS = ("of", "to", "at_least", "at_most", "becomes", "at", "when", "scale")
POSITIVE = ("within", "absolute", "occurrence")
TEXTS = ("name", "direction", "file")


def read_statements(path: Path, description: Any) -> list[Against]:
    """The statements of a file, on the FMU of that description.  Raises SettingError with all
    that is wrong."""
    said = _read(path)
    known = _known(description)
    problems: list[str] = []
    common = said.pop("within", WITHIN)
    if not _is_number(common) or common < 0:
        problems.append(f"within = {common!r}, expected a number from 0")
        common = WITHIN  # told once, not with each table
    found: list[Against] = []
    for kind, entries in said.items():
        if kind not in KINDS:
            problems.append(f"[[{kind}]]: {missing(kind, KINDS, 'is unknown')}")
        elif not isinstance(entries, list) or not all(isinstance(e, dict) for e in entries):
            problems.append(f"{kind!r}: expected tables [[{kind}]]")
        else:
            for k, entry in enumerate(entries):
                wrong = _wrong(kind, entry)
                if not wrong:
                    try:
                        found.append(_made(kind, entry, common, known, path))
                    except (ValueError, SettingError) as error:
                        wrong = [str(error)]
                problems += [f"[[{kind}]] {k + 1}: {text}" for text in wrong]
    if not problems and not found:
        problems.append("it says nothing, expected tables such as [[bounds]]")
    if problems:
        raise SettingError(f"{str(path)!r}: {'; '.join(problems)}: correct it there")
    return found


def _read(path: Path) -> dict[str, Any]:
    with foreign(
        lambda said: SettingError(f"{str(path)!r} cannot be read ({said}): correct the path")
    ):
        content = content_of(path, LARGEST)
    with foreign(lambda said: SettingError(f"{str(path)!r} is no TOML: {said}: correct it there")):
        return toml_of(content)


def _known(description: Any) -> dict[str, Expr]:
    """The names of a formula: variables of a run and parameters, numbers all."""
    parameters = numbers_of(description)
    of_a_run = ("output", "local", "input", "calculatedParameter")
    run = [
        v.name
        for v in description.modelVariables
        if v.causality in of_a_run and v.type not in ("String", "Binary", "Clock")
    ]
    known = {"pi": sp.pi, "time": output("time")}
    known |= {n: output(n) for n in (*parameters, *run)}
    return known | {names.initial(n): output(names.initial(n)) for n in run}


def _wrong(kind: str, entry: Mapping[str, Any]) -> list[str]:
    """What is wrong with a table, of its keys and of the types of their values."""
    keys = (*KINDS[kind].needed, *KINDS[kind].optional, *OF_ALL)
    problems = [missing(key, keys, "is unknown") for key in entry if key not in keys]
    problems += [f"{key!r} is missing" for key in KINDS[kind].needed if key not in entry]
    if kind == "bounds" and not {"at_least", "at_most"} & set(entry):
        problems.append("'at_least' or 'at_most' is missing")
    for key, value in entry.items():
        if key in FORMULAS and not (isinstance(value, str) or _is_number(value)):
            problems.append(f"{key} = {value!r}, expected a formula in quotes, or a number")
        if key in POSITIVE and not (_is_number(value) and value >= 0):
            problems.append(f"{key} = {value!r}, expected a number from 0")
        if key in TEXTS and not isinstance(value, str):
            problems.append(f"{key} = {value!r}, expected text")
    if entry.get("direction", "rising") not in DIRECTIONS:
        problems.append(f"direction = {entry['direction']!r}, expected {' or '.join(DIRECTIONS)}")
    occurrence = entry.get("occurrence", 1)
    if _is_number(occurrence) and not (occurrence >= 1 and float(occurrence).is_integer()):
        problems.append(f"occurrence = {occurrence!r}, expected 1, 2, ...")
    return problems


def _made(
    kind: str, entry: Mapping[str, Any], common: float, known: Mapping[str, Expr], path: Path
) -> Against:
    """Raises ValueError or SettingError with what is wrong with a formula or a table."""
    within, absolute = float(entry.get("within", common)), float(entry.get("absolute", 0.0))
    if kind == "reference":
        if extra := sorted({"when", "scale", "name"} & set(entry)):
            raise ValueError(f"{', '.join(map(repr, extra))} is not for a reference")
        return Reference(read_table(_within(path.parent, entry["file"])), within, absolute)
    formulas, problems = {}, []
    for key in FORMULAS:
        if key in entry:
            try:
                formulas[key] = sp.sympify(read_named(str(entry[key]), known))
            except ValueError as error:
                problems.append(f"{key}: {error}")
    if problems:
        raise ValueError("; ".join(problems))
    return Claim(
        kind,
        entry.get("name") or KINDS[kind].title(entry),
        formulas,
        within,
        absolute,
        DIRECTIONS[entry.get("direction", "rising")],
        int(entry.get("occurrence", 1)),
    )


def _within(folder: Path, file: str) -> Path:
    """A file that stands in the folder of the statements, or below.  Raises ValueError."""
    if "\0" in file:
        raise ValueError(f"file = {file!r}, expected the name of a CSV file")
    found = folder / file
    if len(file) > LONGEST:
        raise ValueError(f"file = {file!r}, expected a name of at most {LONGEST} letters")
    if not found.resolve().is_relative_to(folder.resolve()):
        raise ValueError(
            f"file = {file!r} stands outside the folder of the statements: put the table beside them"
        )
    if found.exists() and not found.is_file():  # a pipe has no end
        raise ValueError(f"file = {file!r} is no file, expected a CSV file: put the table there")
    return found


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
