"""simulate(): a model, or an FMU; the same columns from both."""

from __future__ import annotations

import os
import re
import tempfile
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import names
from ..errors import LagfmuWarning, SettingError, SimulationError
from ..fmu import native
from ..fmu.inputs import check_inputs, columns_at, jumps
from ..fmu.read import (
    Trajectory,
    communication_points,
    has_error_bars,
    read_description,
    target_in,
)
from ..fmu.session import (
    DISCARD,
    WARNING,
    RefusalError,
    Run,
    Session,
)
from ..fmu.target import PYTHON, target_of
from ..fmu.write import as_built
from ..interface.rules import problems_of
from ..model.file import in_scene, is_model
from ..model.model import Model
from ..model.scene import Scene
from ..numeric.start_priority import LEFT_OUT, MISSES
from ..numeric.tolerance import tolerance_problem
from ..prepare.prepare import Prepared, prepare
from ..prepare.starts import check_given, tell
from .reference import Driven, driven
from .result import Result

if TYPE_CHECKING:
    from ..fmu.inprocess import InProcess

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
        from ..fmu.inprocess import InProcess  # and with it the solver, which no native FMU needs

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
