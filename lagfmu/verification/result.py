"""What a simulation gives: a structured NumPy array with units, a short table, plots, and ways out of it."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from .. import names
from ..errors import SimulationError
from ..model.rule import missing
from ..model.units import for_reading

SHOWN = 24  # rows of a table
NOT_YET = "none"  # the time and the state of an event that has not happened


def as_text(value: Any, digits: int = 6) -> str:
    """A number of a run for reading: a zero has no sign."""
    if np.asarray(value).dtype.kind != "f":
        return str(value)
    return f"{float(value) + 0.0:.{digits}g}"


class Result(np.ndarray):  # type: ignore[type-arg]
    """A row a communication point: result["time"] [s], result["lambda.rod"], ...

    `units` maps the columns to their units, `name` is the FMU's or the scene's, `target` what has run: native
    or python.  A column is a plain array.
    """

    units: Mapping[str, str]
    name: str
    target: str

    def __new__(cls, table: Any, units: Mapping[str, str], name: str, target: str) -> Result:
        """A view on a structured array with a field `time`."""
        made = np.asarray(table).view(cls)
        made.units = {"time": "s", **units}
        made.name, made.target = name, target
        return made

    def __array_finalize__(self, other: Any) -> None:
        self.units = getattr(other, "units", {})
        self.name = getattr(other, "name", "")
        self.target = getattr(other, "target", "")

    @property
    def _heading(self) -> str:
        return f"{self.name} ({self.target}): {len(self)} points"

    def __getitem__(self, key: Any) -> Any:
        columns = self.dtype.names
        if isinstance(key, str) and columns is not None and key not in columns:
            raise ValueError(missing(key, columns, f"is no column of {self.name}"))
        found = super().__getitem__(key)
        if isinstance(found, np.ndarray) and found.dtype.names is None:
            return found.view(np.ndarray)
        return found

    def _rows(self) -> list[tuple[str, str, str, str, str]]:
        """Variable, smallest, largest and last value, unit."""
        rows = []
        for n in self.dtype.names or ():
            if not len(self[n]):
                continue
            column = self[n][self.known(n)]
            ends = (column.min(), column.max(), column[-1]) if len(column) else ()
            cells = [as_text(x) for x in ends] or [NOT_YET] * 3
            rows.append((n, *cells, for_reading(self.units.get(n))))
        return rows  # type: ignore[return-value]

    def known(self, name: str) -> Any:
        """Where a variable says something (len): the time and the state of an event from the first one on."""
        count = names.counted(name)
        if count not in (self.dtype.names or ()):
            return np.ones(len(self), dtype=bool)
        return self[count] > 0

    def __repr__(self) -> str:
        if self.dtype.names is None:
            return str(self.view(np.ndarray))
        rows = [("", "smallest", "largest", "last", "unit"), *self._rows()]
        widths = [max(len(r[k]) for r in rows) for k in range(5)]
        lines = [
            f"{r[0]:{widths[0]}}  " + "  ".join(f"{c:>{w}}" for c, w in zip(r[1:4], widths[1:4], strict=True))
            + f"  {r[4]}"
            for r in rows
        ]  # fmt: skip
        hidden = len(lines) - 1 - SHOWN
        if hidden > 0:
            lines = [*lines[: SHOWN + 1], f"and {hidden} more: to_dataframe(), or by name"]
        return "\n".join([self._heading, *(line.rstrip() for line in lines)])

    __str__ = __repr__

    def _repr_html_(self) -> str:
        if self.dtype.names is None:
            return f"<pre>{escape(repr(self))}</pre>"
        head = "".join(f"<th>{h}</th>" for h in ("variable", "smallest", "largest", "last", "unit"))
        body = "".join(
            "<tr>" + "".join(f"<td>{escape(c)}</td>" for c in row) + "</tr>" for row in self._rows()
        )
        caption = f"<caption>{escape(self._heading)}</caption>"
        return f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"

    def plot(self, *names: str, out: str | Path | None = None) -> Any:
        """The figure of `lagfmu simulate --plot`: the named variables, or every lambda and coordinate.

        Returns a matplotlib Figure, or writes it to `out` and returns the path.
        """
        from .plot import figure_of, plot

        if out is not None:
            return plot(self, self.units, out, names, self.name)
        return figure_of(self, self.units, names, self.name)

    def to_dataframe(self) -> Any:
        """A pandas DataFrame indexed by time [s]; units in `.attrs["units"]`."""
        pandas = _needed("pandas")
        names = [n for n in self.dtype.names or () if n != "time"]
        frame = pandas.DataFrame(
            {n: self[n] for n in names}, index=pandas.Index(self["time"], name="time")
        )
        frame.attrs["units"] = dict(self.units)
        return frame

    def to_xarray(self) -> Any:
        """An xarray.Dataset over time [s], each variable with its unit."""
        xarray = _needed("xarray")
        data = {
            n: ("time", self[n], {"units": self.units.get(n, "")})
            for n in self.dtype.names or ()
            if n != "time"
        }
        coords = {"time": ("time", self["time"], {"units": "s"})}
        return xarray.Dataset(data, coords, {"name": self.name})


def _needed(module: str) -> Any:
    try:
        return __import__(module)
    except ImportError:
        raise SimulationError(f"this needs {module}: pip install {module}") from None
