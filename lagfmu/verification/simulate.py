"""simulate(): a model, or an FMU; the same columns from both.

What a simulation gives: a structured NumPy array with units, a short table, plots, and ways out of it.
"""

from __future__ import annotations

import os
import re
import tempfile
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import names
from ..errors import LagfmuWarning, SettingError, SimulationError
from ..fmu import native
from ..fmu.read import (
    Trajectory,
    check_inputs,
    columns_at,
    communication_points,
    has_error_bars,
    jumps,
    read_description,
    target_in,
)
from ..fmu.session import DISCARD, WARNING, RefusalError, Run, Session
from ..fmu.target import PYTHON, target_of
from ..fmu.write import as_built
from ..interface.variables import problems_of
from ..model.file import in_scene, is_model
from ..model.model import Model
from ..model.rule import missing
from ..model.scene import Scene
from ..model.units import for_reading
from ..numeric.failure import LEFT_OUT, MISSES
from ..numeric.thresholds import tolerance_problem
from ..prepare.prepare import prepare
from ..prepare.starts import check_given, tell
from ..prepare.steps import Prepared
from .reference import Driven, driven

if TYPE_CHECKING:
    from ..fmu.python import InProcess


SHOWN = 24  # rows of a table
NOT_YET = "none"  # the time and the state of an event that has not happened


def as_text(value: Any, digits: int = 6) -> str:
    """A number of a run for reading: a zero has no sign."""
    if np.asarray(value).dtype.kind != "f":
        return str(value)
    return f"{float(value) + 0.0:.{digits}g}"


class Result(np.ndarray):  # type: ignore[type-arg]
    """A row a communication point: `result["time"]` in s, `result["lambda.rod"]`, ...

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


STARTS = re.compile(rf"start value .* {MISSES}|{LEFT_OUT}")  # a message of a move
BARS = "error bars"  # begins a message of them
MOST = 5  # warnings that are told one by one


class FmuWarning(LagfmuWarning):
    """What the FMU itself warned of in a run."""


class ErrorBarWarning(FmuWarning):
    """Error bars that are lost from some time on."""


def simulate(
    source: Model | Prepared | str | os.PathLike[str],
    stop_time: float | None = None,
    step_size: float | None = None,
    tolerance: float | None = None,
    start_values: Mapping[str, Any] | None = None,
    inputs: Driven | None = None,
    scene: Scene | str | None = None,
    besides: Sequence[str] = (),
    error_bars: bool = False,
    target: str | None = None,
) -> Result:
    """Outputs at every communication point, as a structured array with the FMU's variable names and units.

    `source` is a Model (in `scene`), a model file (in it, also by its name, or in its first), or the path
    of an FMU.  A model runs as `target`: 'native', compiled for this run, or 'python', integrated in this
    process; without one it is native where a C compiler is at hand, else python, with a warning that names
    what to install.

    Times in seconds; `start_values` maps parameters, coordinates, velocities and `solver.*` to values;
    `inputs` is a structured array with 'time' and one field an input, or a CSV file of such columns,
    interpolated linearly.  What is left out comes from the scene, or the FMU's DefaultExperiment.
    `besides`: local variables and inputs to be recorded too.  `error_bars`: a model's outputs have
    `error.NAME` beside them (docs/error_bars.md), as those of an FMU have that was built with them.

    Warns of each start value that is moved onto the constraints (starts.py), and of what the FMU itself warns
    of.  Raises ModelError for a model that cannot start, or not as its own `start` says, SimulationError if a
    step fails, and VerificationError for a file that is no FMU.
    """
    for what, number in (("stop_time", stop_time), ("step_size", step_size)):
        if number is not None and not 0 < number < np.inf:
            raise SettingError(f"{what} = {number!r} s, expected a positive number")
    if tolerance is not None and (problem := tolerance_problem(tolerance)):
        raise SettingError(problem)
    if isinstance(source, (str, os.PathLike)) and is_model(source):
        source, scene, _ = in_scene(source, scene)
    if isinstance(source, Model):
        source = prepare(source, in_scene(source, scene).scene)
    asked = _Asked(
        stop_time, step_size, tolerance, dict(start_values or {}), driven(inputs), besides
    )
    if isinstance(source, Prepared):
        if error_bars and not source.asked.error_bars:
            source = prepare(source.model, replace(source.asked, error_bars=True))
        return _of_model(source, target_of(target), asked)
    for what, chosen in (("target", target), ("scene", scene)):
        if chosen is not None:
            told = f"{what} {chosen!r} is for a model: {str(source)!r} is an FMU already"
            raise SettingError(told)
    path = Path(source)
    description = read_description(path)
    if error_bars and not has_error_bars(description.modelVariables):
        raise SimulationError(
            f"{str(path)!r} was built without error bars: build it with Scene(error_bars=True), or with "
            "lagfmu build --error-bars"
        )
    units = {v.name: v.unit for v in description.modelVariables if v.unit}
    rows = _ran(path, repr(str(path)), asked)
    return Result(rows, units, description.modelName, target_in(path))


@dataclass(frozen=True)
class _Asked:
    """What is asked of a run; of times [s] and the tolerance None where nothing is."""

    stop_time: float | None
    step_size: float | None
    tolerance: float | None
    values: Mapping[str, Any]
    inputs: Trajectory | None
    besides: Sequence[str]


def _of_model(prepared: Prepared, target: str, asked: _Asked) -> Result:
    name, structure = prepared.scene.name, prepared.structure
    check_given(prepared.model.name, structure.start.moved, structure.missed)
    if target == PYTHON:
        from ..fmu.python import InProcess  # and with it the solver, which no native FMU needs

        rows = _ran(InProcess(prepared), name, asked)
    else:
        with tempfile.TemporaryDirectory(prefix="lagfmu_") as folder:
            fmu = Path(folder, f"{name}.fmu")
            fmu.write_bytes(native.build(as_built(prepared, target), {}, sources=False))
            rows = _ran(fmu, name, asked)
    units = {v.name: v.unit.name for v in prepared.table.variables if v.unit is not None}
    return Result(rows, units, name, target)


def _ran(target: Path | InProcess, called: str, asked: _Asked) -> Trajectory:
    """The rows of a run.  Raises SimulationError where it ends early."""
    try:
        with Session(target, log=True) as session:
            run = _run(session, called, asked)
            stop = asked.stop_time or session.experiment.stop_time
    except RefusalError as refusal:
        raise SimulationError(f"{called} cannot be simulated: {refusal.message}") from None
    refused = run.refusal
    if refused is None:
        return run.rows
    if refused.status == DISCARD and refused.time is not None:
        raise SimulationError(
            f"{called}: the run ends at t = {refused.time!r} s, before {stop!r} s ({refused.message})"
        )
    raise SimulationError(f"{called}: {refused.call} is refused: {refused.message}")


def _run(session: Session, called: str, asked: _Asked) -> Run:
    """A run of a session; what it warns of becomes warnings."""
    inputs, known, rules = asked.inputs, session.experiment, session.rules
    check_inputs(inputs, rules, session.inputs)
    if problems := problems_of(rules, asked.values):
        raise SettingError(f"{called}: " + "; ".join(problems))
    given = {n: rules[n].asked(x) for n, x in asked.values.items()}
    times = communication_points(
        asked.stop_time or known.stop_time, asked.step_size or known.step_size
    )
    every = np.union1d(times, jumps(inputs, times))
    read, fed = [*session.outputs, *asked.besides], columns_at(inputs, every, rules)
    tolerance = asked.tolerance or known.tolerance
    run = session.run(every.tolist(), given, tolerance, read, fed, late=True)
    tell(text for _, text in session.messages if STARTS.search(text))
    _pass_on([text for status, text in session.messages if status == WARNING])
    return replace(run, rows=run.rows[np.isin(run.rows["time"], times)])


def _pass_on(said: Sequence[str]) -> None:
    """The FMU's warnings, but for those of moved starts, each once and the first MOST of them."""
    told = [text for text in dict.fromkeys(said) if not STARTS.search(text)]
    for text in told[:MOST]:
        kind = ErrorBarWarning if text.startswith(BARS) else FmuWarning
        warnings.warn(text, kind, stacklevel=5)
    if len(told) > MOST:
        warnings.warn(f"the FMU warned of {len(told) - MOST} more", FmuWarning, stacklevel=5)


def steps_of(table: Trajectory) -> int:
    """Internal steps of a run; 0 where they are not reported."""
    return int(table[names.STEPS][-1]) if names.STEPS in (table.dtype.names or ()) else 0
