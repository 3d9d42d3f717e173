"""What a fit asks: which values are free, which outputs were measured and how well, in which experiments.

mu                         free, from its described value, within the variable's bounds
mu=0.05:0.9                within these bounds; mu=0.05:0.9:0.3 from 0.3
lambda.rod:0.1             measured, with a standard deviation of 0.1 in its unit

What was measured: a table over time, with gaps; its columns by what they are for the FMU.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import SettingError, UnitError
from ...interface.variables import problems_of, unsettable
from ...model.rule import Rule, missing
from ...model.units import parse_quantity, parse_scaled, parse_unit
from ...verification.reference import read_table

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Experiment:
    """One experiment: `table` has a column `time` [s], and by the names of the FMU what was measured (NaN
    where it was not), inputs (driven with these), and parameters that keep one value.  It is a structured
    array, a pandas DataFrame, a mapping of columns or the path of a CSV file; a heading may have a unit of
    its own, 'force.A.x [kN]'.  `values` are start values and parameters of this experiment alone."""

    table: Any
    values: Mapping[str, Any] = field(default_factory=dict)
    name: str = ""


@dataclass(frozen=True)
class Series:
    """An experiment as the FMU knows it, in SI units: `time` (n,) [s], `measured` columns (n,) with NaN in
    gaps, `inputs` a table for fmu/read.py or None, `values` that are set; `unused`: what of its table is
    used for nothing."""

    name: str
    time: Floats
    measured: Mapping[str, Floats]
    inputs: Any
    values: Mapping[str, Any]
    unused: tuple[str, ...] = ()


def experiments_of(measured: Any) -> list[Experiment]:
    """One or several experiments, however they are given."""
    several = isinstance(measured, Sequence) and not isinstance(measured, (str, bytes))
    found = []
    for k, one in enumerate(measured if several else [measured]):
        made = one if isinstance(one, Experiment) else Experiment(one)
        name = made.name
        if not name:
            named = isinstance(made.table, (str, os.PathLike))
            name = Path(made.table).stem if named else f"experiment {k + 1}"
        found.append(Experiment(made.table, made.values, name))
    return found


def _series_of(
    experiment: Experiment,
    known: Mapping[str, str],
    units: Mapping[str, str | None],
    chosen: Sequence[str],
    offset: float,
    problems: list[str],
) -> Series | None:
    """The columns of an experiment; what is wrong with it joins `problems`.

    `known`: of each variable of the FMU 'output', 'input' or 'parameter' (what can be set besides);
    `chosen`: the outputs that count as measured, all that there are if empty; with an `offset` [s] of the
    clock what was measured so early that the run may not have begun is not used.
    """
    before = len(problems)
    columns = _in_si(experiment, units, problems)
    what = f"{experiment.name}: "
    if columns is None:
        return None
    if "time" not in columns:
        problems.append(
            f"{what}there is no column 'time', found {', '.join(columns) or 'nothing'}: rename that of the "
            "times"
        )
        return None
    time = columns.pop("time")
    if not (np.isfinite(time).all() and len(time) and (np.diff(time) >= 0).all()):
        problems.append(f"{what}the times are not sorted, expected rising seconds")
    values, driven, measured = dict(experiment.values), {}, {}
    for name, column in columns.items():
        use = known.get(name)
        if use is None:
            problems.append(what + missing(name, known))
        elif np.isinf(column).any():
            problems.append(f"{what}{name!r} holds what is no finite number")
        elif use == "output":
            measured[name] = column
        elif np.isnan(column).any():
            problems.append(f"{what}{name!r} is no output, and has gaps: fill them")
        elif use == "input":
            driven[name] = column
        elif np.ptp(column):
            problems.append(
                f"{what}{name!r} is a parameter, and its column does not keep one value"
            )
        else:
            values[name] = float(column[0])
    for name in chosen:
        if name not in measured:
            problems.append(what + missing(name, measured, "is no column"))
    if chosen:
        measured = {n: c for n, c in measured.items() if n in chosen}
    for name, column in measured.items():
        if np.isnan(column).all():
            problems.append(f"{what}{name!r} has gaps alone: leave the column out")
    if not measured:
        problems.append(f"{what}nothing was measured, expected a column that is an output")
    if len(problems) > before:
        return None
    inputs = None
    if driven:
        inputs = np.zeros(len(time), dtype=[("time", float), *((n, float) for n in driven)])
        inputs["time"] = time
        for name, column in driven.items():
            inputs[name] = column
    unused = [n for n in columns if known[n] == "output" and n not in measured]
    late = time >= offset
    if not late.all():
        unused.append(f"{int((~late).sum())} rows before {offset!r} s")
    if not late.any():
        problems.append(f"{what}all was measured before {offset!r} s, the largest offset in time")
        return None
    kept = {n: c[late] for n, c in measured.items()}
    return Series(experiment.name, time[late], kept, inputs, values, tuple(unused))


def _in_si(
    experiment: Experiment, units: Mapping[str, str | None], problems: list[str]
) -> dict[str, Floats] | None:
    """The columns by their names without units, in the units of the FMU."""
    table, what = experiment.table, f"{experiment.name}: "
    if isinstance(table, (str, os.PathLike)):
        try:
            table = read_table(Path(table), gaps=True)
        except SettingError as error:
            problems.append(str(error))
            return None
    if hasattr(table, "to_dict") and hasattr(table, "columns"):  # a DataFrame, perhaps over time
        if "time" not in table.columns and table.index.name == "time":
            table = table.reset_index()
        table = {str(n): table[n] for n in table.columns}
    names = table.dtype.names if isinstance(table, np.ndarray) else list(table)
    known = {"time": "s", **units}
    found: dict[str, Floats] = {}
    for heading in names or ():
        name, given = _parts(str(heading)) if str(heading) not in known else (str(heading), "")
        factor = 1.0
        if given and name in known:
            try:
                factor = _factor(given, known[name], f"{what}{name!r}")
            except UnitError as error:
                problems.append(str(error))
        if name in found:
            problems.append(f"{what}{name!r} stands in two columns")
        found[name] = np.asarray(table[heading], dtype=float) * factor
    return found


def _parts(heading: str) -> tuple[str, str]:
    """A name and its unit: force.A.x [kN]."""
    text = heading.rstrip()
    name, bracket, unit = text[:-1].rpartition("[")
    if not (text.endswith("]") and bracket) or "]" in unit:
        return heading, ""
    return name.rstrip(), unit


def _factor(given: str, unit: str | None, what: str) -> float:
    """From a unit to that of the FMU.  Raises UnitError."""
    read, expected = parse_scaled(given, what), parse_unit(unit or "1", what)
    if not read.unit.same_dimension(expected):
        raise UnitError(f"{what} is given in {given!r}, expected a multiple of {unit or '1'}")
    return float(read.size)


OFFSET = "offset."  # begins the name of the unknown offset in time of an experiment
LOSSES = ("linear", "soft_l1", "huber", "cauchy", "arctan")  # SciPy's


@dataclass(frozen=True)
class Free:
    """A value that is sought, in SI units; `of`: the experiment whose clock it sets right, if it is none of
    the FMU's."""

    name: str
    start: float
    low: float = -math.inf
    high: float = math.inf
    unit: str = ""
    of: str = ""

    def scale(self, value: float) -> float:
        """A magnitude of it: that of the value, or of the bounds where it starts from 0."""
        if self.start:
            return abs(value) or abs(self.start)
        return self.high - self.low if math.isfinite(self.high - self.low) else 1.0


@dataclass(frozen=True)
class Problem:
    """`free` values, and `deviations`: of each measured output the standard deviation, None where it is
    unknown and estimated from the residuals."""

    free: tuple[Free, ...]
    deviations: Mapping[str, float | None]
    series: tuple[Series, ...]
    units: Mapping[str, str]

    @property
    def points(self) -> int:
        """How many numbers were measured."""
        return sum(int(np.isfinite(c).sum()) for s in self.series for c in s.measured.values())


def derivatives_of(free: Iterable[str], measure: Iterable[str]) -> list[str]:
    """What an FMU that is built for the fit shall tell, as a scene's sensitivities."""
    by, of = ",".join(free), ",".join(measure)
    return [f"{of}:{by}"] if by and of else []


def named(texts: Iterable[str], sign: str) -> Iterator[tuple[str, str]]:
    """NAME=LOW:HIGH, or OUTPUT:DEVIATION, as the name and what is behind the sign."""
    for text in texts:
        name, _, given = (part.strip() for part in text.partition(sign))
        yield name, given


def bounds_of(name: str, text: str, units: Mapping[str, str | None]) -> tuple[float, ...] | None:
    """LOW:HIGH or LOW:HIGH:START as numbers; None for nothing.  Raises SettingError."""
    if not text:
        return None
    what, parts = f"--free '{name}={text}'", text.split(":")
    if len(parts) not in (2, 3):
        raise SettingError(f"{what}: expected NAME, NAME=LOW:HIGH or NAME=LOW:HIGH:START")
    return tuple(_number(part, units.get(name), what) for part in parts)


def deviation_of(name: str, text: str, units: Mapping[str, str | None]) -> float | None:
    """A standard deviation as a number; None for nothing.  Raises SettingError."""
    return _number(text, units.get(name), f"--measure '{name}:{text}'") if text else None


def _number(text: str, unit: str | None, what: str) -> float:
    try:
        return parse_quantity(text, parse_unit(unit or "1", what), what)
    except UnitError as error:
        raise SettingError(str(error)) from None


def problem_of(
    variables: Sequence[Any],
    rules: Mapping[str, Rule],
    experiments: Sequence[Experiment],
    free: Mapping[str, Any],
    measure: Mapping[str, float | None],
    values: Mapping[str, Any],
    offset: float,
) -> Problem:
    """All of it checked against an FMU.  Raises SettingError with every problem."""
    units = {v.name: v.unit for v in variables}
    known = _uses(variables, rules)
    problems = problems_of(rules, values)
    problems += [
        missing(n, [k for k, use in known.items() if use == "output"], "is no output")
        for n in measure
        if known.get(n) != "output"
    ]
    for name, sd in measure.items():
        if sd is not None and not 0 < sd < math.inf:
            problems.append(f"{name!r}: a standard deviation of {sd!r}, expected a positive number")
    if not 0 <= offset < math.inf:
        problems.append(f"offset = {offset!r} s, expected the largest one, from 0")
    if not (free or offset):
        problems.append("nothing is free: name what shall be found, e.g. mu=0.05:0.9")
    sought = [_free(n, bounds, rules, units, values, problems) for n, bounds in free.items()]
    names = [e.name for e in experiments]
    if twice := sorted({n for n in names if names.count(n) > 1}):
        problems.append(f"several experiments are called {', '.join(map(repr, twice))}")
    wanted = [n for n in measure if known.get(n) == "output"]
    series = []
    for e in experiments:
        one = _series_of(e, known, units, wanted, offset, problems)
        series += [] if one is None else [one]
    for one in series:
        problems += [f"{one.name}: {text}" for text in problems_of(rules, one.values)]
        problems += [f"{one.name}: {n!r} is set and free" for n in one.values if n in free]
    if problems:
        raise SettingError("; ".join(problems))
    if offset:
        sought += [Free(OFFSET + s.name, 0.0, -offset, offset, "s", s.name) for s in series]
    outputs = dict.fromkeys(n for s in series for n in s.measured)
    made = Problem(
        tuple(f for f in sought if f is not None),
        {n: measure.get(n) for n in outputs},
        tuple(series),
        {n: u or "1" for n, u in units.items()},
    )
    if made.points < len(made.free):
        raise SettingError(
            f"{made.points} measured numbers for {len(made.free)} unknowns: measure more, or free fewer"
        )
    if made.points == len(made.free) and None in made.deviations.values():
        raise SettingError(
            f"{made.points} measured numbers for as many unknowns leave no residuals, which tell how well "
            "they are known: measure more, free fewer values, or give standard deviations (OUTPUT:DEVIATION)"
        )
    return made


def _uses(variables: Sequence[Any], rules: Mapping[str, Rule]) -> dict[str, str]:
    """What a column of this name is for: output, input or parameter (what can be set besides)."""
    plain = {"output": "output", "input": "input"}
    return {
        v.name: plain.get(v.causality, "parameter")
        for v in variables
        if v.causality in plain or rules[v.name].settable
    }


def _free(
    name: str,
    bounds: Any,
    rules: Mapping[str, Rule],
    units: Mapping[str, str | None],
    values: Mapping[str, Any],
    problems: list[str],
) -> Free | None:
    """One of those that are sought; `bounds`: None, (low, high) or (low, high, start)."""
    if text := unsettable(rules, name):
        problems.append(text)
        return None
    rule = rules[name]
    if rule.kind != "Real":
        problems.append(f"{name!r} is a {rule.kind}, expected what changes continuously")
        return None
    given = () if bounds is None else tuple(float(x) for x in bounds)
    if len(given) not in (0, 2, 3) or not all(map(math.isfinite, given)):
        problems.append(f"{name!r}: bounds {bounds!r}, expected (low, high) or (low, high, start)")
        return None
    low, high = given[:2] or (
        -math.inf if rule.minimum is None else rule.minimum,
        math.inf if rule.maximum is None else rule.maximum,
    )
    start = given[2] if len(given) == 3 else float(values.get(name, rule.start or 0.0))
    if not low < high:
        problems.append(f"{name!r}: bounds {low!r} and {high!r}, expected the smaller one first")
    elif not low <= start <= high:
        problems.append(
            f"{name!r}: the start {start!r} lies outside the bounds {low!r} and {high!r}: give one between "
            "them, NAME=LOW:HIGH:START"
        )
    problems += [text for x in given if (text := rule.problem(x)) and text not in problems]
    return Free(name, start, low, high, units.get(name) or "1")
