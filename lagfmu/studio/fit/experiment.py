"""What was measured: a table over time, with gaps; its columns by what they are for the FMU."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import SettingError, UnitError
from ...model.rule import missing
from ...model.units import parse_scaled, parse_unit
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
    gaps, `inputs` a table for fmu/inputs.py or None, `values` that are set; `unused`: what of its table is
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


def series_of(
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
