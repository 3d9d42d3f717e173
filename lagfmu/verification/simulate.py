"""simulate(): a model, or an FMU through fmpy; the same columns from both."""

from __future__ import annotations

import contextlib
import difflib
import os
import re
import shutil
import tempfile
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi1 import FMICallException
from numpy.typing import NDArray

from .. import names
from ..errors import SettingError, SimulationError
from ..fmu import native
from ..fmu.archive import unpack
from ..fmu.described import (
    Trajectory,
    asked,
    experiment_of,
    has_error_bars,
    is_python,
    items_of,
    read_description,
)
from ..fmu.python import offered, slave_of
from ..fmu.slave import Refused
from ..fmu.target import NATIVE, PYTHON, target_of
from ..fmu.write import as_built
from ..methods import IN_PYTHON, NUMBERS, unknown
from ..model.model import Model
from ..model.scene import Scene
from ..numeric.priority import LEFT_OUT
from ..numeric.tolerance import tolerance_problem
from ..prepare.prepare import Prepared, prepare
from ..prepare.starts import tell
from .result import Result

STARTS = re.compile(rf"start value .* misses the constraints|{LEFT_OUT}")  # a message of a move
MOST_POINTS = 10_000_000  # communication points of a run, all of which are kept


class ErrorBarWarning(UserWarning):
    """Error bars that are lost, or that a method of fixed steps pays for with shorter ones."""


def simulate(
    source: Model | Prepared | str | os.PathLike[str],
    stop_time: float | None = None,
    step_size: float | None = None,
    tolerance: float | None = None,
    start_values: Mapping[str, Any] | None = None,
    inputs: Trajectory | None = None,
    scene: Scene | None = None,
    besides: Sequence[str] = (),
    error_bars: bool = False,
    target: str | None = None,
) -> Result:
    """Outputs at every communication point, as a structured array with the FMU's variable names and units.

    `source` is a Model (in `scene`) or the path of an FMU.  A model runs as `target`: 'native', compiled for
    this run, or 'python', integrated in this process; without one it is native where a C compiler is at
    hand, else python, with a warning that names what to install.

    Times in seconds; `start_values` maps parameters, coordinates, velocities and `solver.*` to values;
    `inputs` is a structured array with 'time' and one field an input, interpolated linearly.  What is left
    out comes from the scene, or the FMU's DefaultExperiment.  `besides`: local variables and inputs to be
    recorded too.  `error_bars`: a model's outputs have `error.NAME` beside them (docs/error_bars.md), as
    those of an FMU have that was built with them.

    Warns of each start value that is moved onto the constraints (starts.py), and of error bars that are
    lost.  Raises ModelError for a model
    that cannot start, SimulationError if a step fails, and
    VerificationError for a file that is no FMU.
    """
    values = dict(start_values or {})
    for what, number in (("stop_time", stop_time), ("step_size", step_size)):
        if number is not None and not 0 < number < np.inf:
            raise SettingError(f"{what} = {number!r} s, expected a positive number")
    if tolerance is not None and (problem := tolerance_problem(tolerance)):
        raise SettingError(problem)
    if isinstance(source, Model):
        source = prepare(source, scene)
    if isinstance(source, Prepared) and error_bars and not source.asked.error_bars:
        source = prepare(source.model, replace(source.asked, error_bars=True))
    run = (stop_time, step_size, tolerance, values, inputs, besides)
    if isinstance(source, Prepared):
        check_inputs(inputs, source.table.variables)
        name, kind, every = source.scene.name, target_of(target), source.table.variables
        if kind == PYTHON:
            table = _simulate_model(source, *run)
        else:
            with tempfile.TemporaryDirectory(prefix="lagfmu_") as folder:
                fmu = Path(folder, f"{name}.fmu")
                fmu.write_bytes(native.build(as_built(source, kind), {}, sources=False))
                table = _simulate_fmu(fmu, name, *run)
        units = {v.name: v.unit.name for v in every if v.unit is not None}
        return Result(table, units, name, kind)
    if target is not None:
        raise SettingError(f"target {target!r} is for a model: {str(source)!r} is an FMU already")
    path = Path(source)
    description = read_description(path)
    if error_bars and not has_error_bars(description.modelVariables):
        raise SimulationError(
            f"{str(path)!r} was built without error bars: build it with Scene(error_bars=True), or with "
            "lagfmu build --error-bars"
        )
    check_inputs(inputs, description.modelVariables)
    table = _simulate_fmu(path, repr(str(path)), *run)
    units = {v.name: v.unit for v in description.modelVariables if v.unit}
    return Result(table, units, description.modelName, PYTHON if is_python(path) else NATIVE)


def missing(name: str, known: Iterable[str], what: str = "is not in the FMU") -> str:
    """What to say of a name that the FMU does not have."""
    known = list(known)
    near = difflib.get_close_matches(name, known, 1)
    if near:
        return f"{name!r} {what}; did you mean {near[0]!r}?"
    return f"{name!r} {what}, expected one of {', '.join(known) or 'none'}"


def check_inputs(inputs: Trajectory | None, variables: Sequence[Any]) -> None:
    """A table of inputs, if there is one, has rising times and columns that are inputs of these variables, a
    table's or fmpy's.  Raises SettingError."""
    if inputs is None:
        return
    found = inputs.dtype.names or ()
    known = [v.name for v in variables if v.causality == "input"]
    problems = [missing(n, known, "is no input") for n in found if n != "time" and n not in known]
    if "time" not in found:
        problems.append("there is no column 'time'")
    elif not (np.isfinite(inputs["time"]).all() and (np.diff(inputs["time"]) >= 0).all()):
        problems.append("the times are not sorted, expected rising seconds")
    if problems:
        raise SettingError(f"inputs: {'; '.join(problems)}")


def communication_points(stop_time: float, step_size: float) -> NDArray[np.float64]:
    """0, h, 2 h, ..., and the stop time."""
    _check_count(stop_time, step_size)
    count = max(1, int(np.ceil(stop_time / step_size * (1 - 1e-12))))
    times = np.arange(count + 1, dtype=np.float64) * step_size
    times[-1] = stop_time
    return times


def steps_of(table: Trajectory) -> int:
    """Internal steps of a run; 0 where they are not reported."""
    return int(table[names.STEPS][-1]) if names.STEPS in (table.dtype.names or ()) else 0


def _check_count(stop_time: float, step_size: float) -> None:
    """Refuse a run that would fill the memory with communication points."""
    if stop_time / step_size > MOST_POINTS:
        raise SimulationError(
            f"step_size = {step_size!r} s asks for {stop_time / step_size:.3g} communication points "
            f"until {stop_time!r} s, expected at most {MOST_POINTS:.0e}: choose a larger step_size, or "
            "an earlier stop_time"
        )


def _simulate_model(
    prepared: Prepared,
    stop_time: float | None,
    step_size: float | None,
    tolerance: float | None,
    values: dict[str, Any],
    inputs: Trajectory | None,
    besides: Sequence[str],
) -> Trajectory:
    scene, table = prepared.scene, offered(prepared)
    settable = {
        v.name: _Settable(
            v.kind,
            v.minimum,
            v.maximum,
            v.positive,
            {m: NUMBERS[m] for m in v.items if m in IN_PYTHON},
        )
        for v in table.variables
        if v.role not in ("output", "estimate")
    }
    _check_values(scene.name, settable, values)
    times = communication_points(stop_time or scene.stop_time, step_size or scene.step_size)
    fed = {} if inputs is None else {n: inputs[n] for n in inputs.dtype.names or () if n != "time"}
    fed = {n: np.interp(times, np.asarray(inputs)["time"], x) for n, x in fed.items()}
    for end in (np.min, np.max):
        _check_values(scene.name, settable, {n: end(x) for n, x in fed.items()})
    slave = slave_of(prepared)(instance_name=scene.name)
    place = {v.name: k for k, v in enumerate(table.variables)}
    read = [*table.outputs, *(table[name] for name in besides)]
    kinds: dict[str, Any] = {"Real": np.float64, "Integer": np.int32, "Boolean": np.bool_}
    columns = [("time", np.float64), *((v.name, kinds[v.kind]) for v in read)]
    result = np.zeros(len(times), dtype=columns)
    rows = [place[v.name] for v in read]
    try:
        slave.setup_experiment(0.0, float(times[-1]), tolerance)
        for name, value in values.items():
            whole = settable[name].kind == "Enumeration"
            give = slave.set_integer if whole else slave.set_real
            number = settable[name].items.get(value, asked(table[name], value))
            give([place[name]], [number])
        slave.set_real([place[n] for n in fed], [float(x[0]) for x in fed.values()])
        slave.exit_initialization_mode()
        for k, t in enumerate(times.tolist()):
            if k:
                before = float(times[k - 1])
                if fed:
                    slave.set_real([place[n] for n in fed], [float(x[k - 1]) for x in fed.values()])
                if not slave.do_step(before, t - before):
                    raise SimulationError(slave.log_queue[-1].msg)
            row = slave.row()
            result[k] = (t, *(row[r] for r in rows))
    except Refused as error:  # without what is done to a text on its way to an importer
        raise SimulationError(str(error.__context__)) from error.__context__
    finally:
        tell(m.msg for m in slave.log_queue if STARTS.search(m.msg))
        for m in slave.log_queue:
            if m.msg.startswith("error bars") and m.category == "logStatusWarning":
                warnings.warn(m.msg, ErrorBarWarning, stacklevel=3)
    return result


@dataclass(frozen=True)
class _Settable:
    """What may be set to what; `items` are the numbers of an Enumeration by name."""

    kind: str
    minimum: float | None
    maximum: float | None
    positive: bool = False
    items: Mapping[str, int] = field(default_factory=dict)


def _check_values(what: str, settable: Mapping[str, _Settable], values: Mapping[str, Any]) -> None:
    """Refuse what the FMU would refuse: all problems at once."""
    problems = []
    for name, value in values.items():
        v = settable.get(name)
        if v is None:
            near = difflib.get_close_matches(name, settable, 1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            problems.append(f"{name!r} cannot be set, expected one of {', '.join(settable)}{hint}")
        elif v.kind == "Enumeration":
            if value not in v.items and value not in v.items.values():
                problems.append(f"{name!r} = {value!r}: {unknown(value, v.items)}")
        elif not isinstance(value, (int, float, np.number)) or not np.isfinite(value):
            problems.append(f"{name!r} = {value!r}, expected a finite number")
        elif (v.minimum is not None and value < v.minimum) or (
            v.maximum is not None and value > v.maximum
        ):
            problems.append(
                f"{name!r} = {value!r} is outside its bounds [{v.minimum}, {v.maximum}]"
            )
        elif v.positive and not value > 0:
            problems.append(f"{name!r} = {value!r}, expected a positive number")
    if problems:
        raise SettingError(f"{what}: " + "; ".join(problems))


def _simulate_fmu(
    path: Path,
    called: str,
    stop_time: float | None,
    step_size: float | None,
    tolerance: float | None,
    values: dict[str, Any],
    inputs: Trajectory | None,
    besides: Sequence[str],
) -> Trajectory:
    description = read_description(path)
    messages: list[str] = []
    moved: list[str] = []
    lost: list[str] = []

    def logger(_: Any, __: bytes, status: int, category: bytes, message: bytes) -> None:
        if status >= 2:  # discard, error, fatal
            messages.append(message.decode(errors="replace").strip())
        elif STARTS.search(text := message.decode(errors="replace").strip()):
            moved.append(text)
        elif status == 1 and text.startswith("error bars"):
            lost.append(text)

    experiment = experiment_of(description, stop_time, step_size)
    stop, step = experiment.stop_time, experiment.step_size
    _check_count(stop, step)
    settable = {
        v.name: _Settable(
            v.type,
            None if v.min is None else float(v.min),
            None if v.max is None else float(v.max),
            items=items_of(v),
        )
        for v in description.modelVariables
        if v.causality in ("parameter", "input") or v.initial in ("exact", "approx")
    }
    _check_values(called, settable, values)
    variables = {v.name: v for v in description.modelVariables}
    values = {
        k: settable[k].items.get(v, v) if isinstance(v, str) else asked(variables[k], v)
        for k, v in values.items()
    }
    folder = unpack(path)
    try:
        with contextlib.chdir("."):  # fmpy stays in the folder of a library that it cannot load
            result: Trajectory = fmpy.simulate_fmu(
                folder,
                stop_time=stop,
                output_interval=step,
                step_size=step,
                relative_tolerance=tolerance,
                start_values=values,
                output=[v.name for v in description.modelVariables if v.causality == "output"]
                + list(besides),
                input=inputs,
                logger=logger,
                debug_logging=True,
            )
    except FMICallException as error:
        raise SimulationError(_told(called, error, messages)) from None
    except Exception as error:
        raise SimulationError(f"{called} cannot be simulated: {error}") from None
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    tell(moved)
    for text in lost:
        warnings.warn(text, ErrorBarWarning, stacklevel=3)
    reached = float(result["time"][-1])
    if reached < stop * (1 - 1e-9):  # fmpy ends a run at fmi2Discard without a word
        cause = "; ".join(messages) or "no message was logged"
        raise SimulationError(
            f"{called}: the run ends at t = {reached!r} s, before {stop!r} s ({cause})"
        )
    return result


def _told(called: str, error: FMICallException, messages: Sequence[str]) -> str:
    """The FMU's own reason; pythonfmu's binary wraps it in the name of the exception."""
    raised = re.search(r"""Refused\((["'])(.*)\1\)""", " ".join("; ".join(messages).split()))
    if raised:
        return f"{called}: {error.function} is refused: {raised[2]}"
    return f"{called}: {error} ({'; '.join(messages) or 'no message was logged'})"
