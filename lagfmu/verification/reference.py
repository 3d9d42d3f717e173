"""Reference results: a run held against a table of another one.

A value is right if |value - reference| <= atol + rtol * max |reference| of its column, at every time of the
reference.  Between communication points a Real is interpolated linearly, what is discrete keeps its value.
"""

from __future__ import annotations

import math
import os
from array import array
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import SettingError
from ..files import content_of, csv_of, foreign
from ..fmu.read import Trajectory
from .check import Check, Missed

Driven = Trajectory | str | os.PathLike[str]  # inputs over time: a table, or a CSV file
REMEDY = (
    "expected commas between columns and points in numbers, 0.5: save it so, or in pandas "
    "read_csv(FILE, sep=';', decimal=',').to_csv(FILE, index=False)"
)
LARGEST = 100_000_000  # bytes of a table
TRUTH = {"True": 1.0, "False": 0.0, "true": 1.0, "false": 0.0}


@dataclass(frozen=True)
class Reference:
    """A table (`time` [s], one column an output) and what is allowed; `own`: relative, of single columns."""

    table: Trajectory
    rtol: float = 1e-6
    atol: float = 0.0
    own: Mapping[str, float] = field(default_factory=dict)

    @property
    def variables(self) -> set[str]:
        """Its columns."""
        return {n for n in self.table.dtype.names or () if n != "time"}

    @property
    def stop_time(self) -> float | None:
        """The last time [s]; None of a table of the start alone."""
        return float(self.table["time"][-1]) or None

    def checks(self, result: Trajectory, values: Mapping[str, float]) -> list[Check]:
        """One statement a column.  Raises SettingError for columns that the FMU does not have."""
        names = [n for n in self.table.dtype.names or () if n != "time"]
        known = result.dtype.names or ()
        unknown = [n for n in (*names, *self.own) if n not in known]
        if unknown:
            raise SettingError(
                f"reference: {', '.join(map(repr, unknown))} is no output of the FMU, expected some of "
                f"{', '.join(n for n in known if n != 'time')}"
            )
        return [self._check(name, result) for name in names]

    def _check(self, name: str, result: Trajectory) -> Check:
        times = self.table["time"]
        chosen = (times >= result["time"][0]) & (times <= result["time"][-1] * (1 + 1e-12))
        allowed = self.own.get(name, self.rtol)
        if not chosen.any():
            return Check(f"reference: {name}", 0.0, allowed, 0)
        expected = self.table[name][chosen].astype(float)
        actual = at(result, name, times[chosen])
        scale = float(np.abs(expected).max())
        beyond = np.maximum(np.abs(actual - expected) - self.atol, 0.0)
        error = float(beyond.max()) / (scale or 1.0)
        missed = Missed(times[chosen], actual, expected) if error > allowed else None
        return Check(f"reference: {name}", error, allowed, int(chosen.sum()), missed=missed)


def at(result: Trajectory, name: str, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """A column of a run at other times [s]."""
    column = result[name]
    if column.dtype.kind == "f":
        return np.asarray(np.interp(times, result["time"], column))
    place = np.searchsorted(result["time"], times * (1 + 1e-12), side="right") - 1
    return np.asarray(column[np.clip(place, 0, len(column) - 1)], dtype=float)


def driven(inputs: Driven | None) -> Trajectory | None:
    """A table of inputs as simulate() takes it.  Raises SettingError for what is none."""
    if isinstance(inputs, (str, os.PathLike)):
        return read_table(Path(inputs))
    if inputs is not None and getattr(getattr(inputs, "dtype", None), "names", None) is None:
        raise SettingError(
            f"inputs: {type(inputs).__name__}, expected the path of a CSV file, or a structured array with "
            "'time' [s] and a field for each input (of a DataFrame: to_records(index=False))"
        )
    return inputs


def read_table(path: Path, gaps: bool = False) -> Trajectory:
    """A CSV file with a column `time` [s]; with `gaps` an empty cell is NaN.  Raises SettingError with what
    is wrong with it."""
    with foreign(
        lambda said: SettingError(f"{str(path)!r} cannot be read: {said}: correct the path")
    ):
        content = content_of(path, LARGEST)
    with foreign(
        lambda said: SettingError(
            f"{str(path)!r} is no table ({said}): expected names, and rows of numbers"
        )
    ):
        rows = csv_of(content)
        names = [n.strip() for n in next(rows, [])]
        _check_names(path, names)
        cells, bad = _cells(path, names, rows, gaps)
    table = np.zeros(len(cells), dtype=[(n, float) for n in names])
    for k, name in enumerate(names):
        table[name] = cells[:, k]
    if bad:
        more = f", and {len(bad) - 5} more" if len(bad) > 5 else ""
        raise SettingError(
            f"{str(path)!r}: {', '.join(bad[:5])}{more}: expected finite numbers"
            + (", or empty cells" if gaps else "")
        )
    if not len(table):
        raise SettingError(f"{str(path)!r} has no rows: expected names, and rows of numbers")
    if gaps:
        return table  # what its columns are is not yet known
    if "time" not in names:
        raise SettingError(
            f"{str(path)!r}: there is no column 'time', found {', '.join(names)}: rename that of the times"
        )
    if not (np.diff(table["time"]) >= 0).all():
        raise SettingError(f"{str(path)!r}: the times are not sorted, expected rising seconds")
    return table


def _check_names(path: Path, names: Sequence[str]) -> None:
    """Raises SettingError for headings that are none."""
    if len(names) == 1 and ";" in names[0]:
        raise SettingError(f"{str(path)!r} separates its columns by semicolons: {REMEDY}")
    if twice := sorted(n for n, count in Counter(names).items() if count > 1 and n):
        raise SettingError(
            f"{str(path)!r}: {', '.join(twice)} stands in two columns: remove one, or rename it"
        )
    if not names:
        raise SettingError(
            f"{str(path)!r} is no table: it is empty, expected names, and rows of numbers"
        )
    if "" in names:  # NumPy would call it f0, f1, ...
        raise SettingError(
            f"{str(path)!r}: column {names.index('') + 1} has no heading: give it one, or remove the column"
        )


def _cells(
    path: Path, names: Sequence[str], rows: Iterator[Sequence[str]], gaps: bool
) -> tuple[NDArray[np.float64], list[str]]:
    """The numbers (rows, names), and those that are not finite, in words.  Raises SettingError."""
    found, bad = array("d"), list[str]()
    for k, row in enumerate(rows, 1):
        if len(row) == 2 * len(names):
            raise SettingError(f"{str(path)!r} has decimal commas: {REMEDY}")
        try:
            for name, cell in zip(names, row, strict=True):
                text = cell.strip()
                number = np.nan if gaps and not text else float(TRUTH.get(text, text))
                if not math.isfinite(number) and text:
                    bad.append(f"{name} in row {k} is {text!r}")
                found.append(number)
        except ValueError:
            remedy = (
                REMEDY if len(row) > len(names) else f"expected {len(names)} numbers: correct it"
            )
            raise SettingError(
                f"{str(path)!r} is no table of numbers: row {k} is {','.join(row)!r}: {remedy}"
            ) from None
    return np.array(found).reshape(-1, len(names)), bad
