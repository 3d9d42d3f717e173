"""What the modelDescription.xml of an FMU says, as fmpy reads it.

Tables of inputs over time: a structured array with 'time' [s] and a field an input.
"""

from __future__ import annotations

import math
import re
import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from numpy.typing import NDArray

from .. import names
from ..errors import LagfmuWarning, SettingError, SimulationError, VerificationError
from ..files import content_of, foreign, xml_of
from ..interface.variables import problems_of
from ..model.rule import Rule, missing
from ..names import rate_of
from ..numeric.thresholds import DEFAULT_TOLERANCE
from .archive import LARGEST_TEXT, entry, opened, platforms
from .target import NATIVE, PYTHON

PLATFORMS = {"2": fmpy.platform, "3": fmpy.platform_tuple}  # of this machine, by version of FMI
TYPES = {"Float64": "Real", "Int32": "Integer"}  # types of FMI 3.0 as FMI 2.0 calls them
SHOWN = 5  # problems in a message
MOST_POINTS = 10_000_000  # communication points of a run, all of which are kept
Trajectory = NDArray[Any]  # structured: 'time' [s] and one field an output


@dataclass(frozen=True)
class Experiment:
    """Times in s; the tolerance is relative."""

    stop_time: float
    step_size: float
    tolerance: float


def experiment_of(
    description: Any, stop_time: float | None = None, step_size: float | None = None
) -> Experiment:
    """The default experiment, with another stop time or communication step where they are given."""
    said = description.defaultExperiment
    stop = float(getattr(said, "stopTime", None) or 1.0) if stop_time is None else stop_time
    step = step_size
    if step is None:
        step = float(getattr(said, "stepSize", None) or stop / 500)
    return Experiment(stop, step, float(getattr(said, "tolerance", None) or DEFAULT_TOLERANCE))


def communication_points(stop_time: float, step_size: float) -> NDArray[np.float64]:
    """0, h, 2 h, ..., and the stop time [s].  Raises SimulationError for more than fit a memory."""
    if stop_time / step_size > MOST_POINTS:
        raise SimulationError(
            f"step_size = {step_size!r} s asks for {stop_time / step_size:.3g} communication points "
            f"until {stop_time!r} s, expected at most {MOST_POINTS:.0e}: choose a larger step_size, or "
            "an earlier stop_time"
        )
    count = max(1, int(np.ceil(stop_time / step_size * (1 - 1e-12))))
    times = np.arange(count + 1, dtype=np.float64) * step_size
    times[-1] = stop_time
    return times


def obstacle(path: Path, description: Any) -> str:
    """Why a session cannot step an FMU, a file or an unpacked folder, on this machine; empty if it can."""
    version = description.fmiVersion
    here = PLATFORMS.get(version.partition(".")[0])
    if here is None:
        return f"is an FMU of FMI {version}, expected FMI 2.0 or 3.0"
    if description.coSimulation is None:
        return "has no co-simulation: run it in an importer that integrates, as fmpy does"
    found = platforms(path)
    if here in found:
        return ""
    return f"has no binary for this machine ({here}), but for {', '.join(found) or 'none'}"


def kind_of(v: Any) -> str:
    """What a variable of fmpy's is, in the words of FMI 2.0; an array is none of what is read here."""
    return "Array" if v.dimensions else TYPES.get(v.type, v.type)


def numbers_of(description: Any) -> dict[str, float]:
    """The described values of parameters and inputs, by name."""
    return {
        v.name: float(v.start)
        for v in description.modelVariables
        if kind_of(v) == "Real" and v.causality in ("parameter", "input") and v.start is not None
    }


def units_of(variables: Sequence[Any]) -> dict[str, str | None]:
    """The unit of each variable, of a table or of fmpy, by name."""
    return {v.name: getattr(v.unit, "name", v.unit) for v in variables}


def target_in(fmu: Path) -> str:
    """What an FMU is made of: native or python."""
    with opened(fmu) as archive:
        return PYTHON if "resources/slavemodule.txt" in archive.namelist() else NATIVE


def has_error_bars(variables: Sequence[Any]) -> bool:
    """True if one of the variables, a table's or fmpy's, is the error bar of another."""
    known = {v.name for v in variables}
    return any(names.barred(n) in known for n in known)


def joint_starts(description: Any) -> set[str]:
    """The joint coordinates that may be set as start values, and their rates: such a rate is no state."""
    states = {u.variable.derivative.name for u in description.derivatives}
    given = {v.name for v in description.modelVariables if v.initial in ("exact", "approx")}
    rates = {n for n in given - states if states and names.read(n).order == 1}
    return rates | {names.read(n).coordinate for n in rates}


def described_rules(description: Any) -> dict[str, Rule]:
    """What the variables of an FMU may be set to, by name."""
    return {v.name: _rule(v) for v in description.modelVariables}


def _rule(v: Any) -> Rule:
    items = getattr(v.declaredType, "items", None) or [] if kind_of(v) == "Enumeration" else []
    return Rule(
        v.name,
        kind_of(v),
        v.causality in ("parameter", "input") or v.initial in ("exact", "approx"),
        None if v.min is None else float(v.min),
        None if v.max is None else float(v.max),
        items={item.name: int(item.value) for item in items},
        start=float(v.start) if kind_of(v) == "Real" and v.start is not None else None,
        begins=v.causality not in ("parameter", "input") and v.initial in ("exact", "approx"),
        follows=(v.description or "").endswith(names.FOLLOWS),
    )


def read_description(path: Path) -> Any:
    """fmpy's ModelDescription of an FMU, a file or a folder that one was unpacked into.

    Raises VerificationError if the file is missing, damaged or no FMU.
    """
    with foreign(
        lambda said: VerificationError(
            f"{str(path)!r}: modelDescription.xml cannot be read ({said}): correct it, or build the FMU anew"
        )
    ):
        if path.is_dir():
            content = content_of(path / "modelDescription.xml", LARGEST_TEXT)
        else:
            with opened(path) as archive:
                if "modelDescription.xml" not in archive.namelist():
                    raise VerificationError(
                        f"{str(path)!r} is no FMU: it holds no modelDescription.xml: build the FMU anew"
                    )
                content = entry(archive, "modelDescription.xml")
        xml_of(content)
        found = fmpy.read_model_description(str(path), validate=False)
    if problems := [*_of_experiment(found.defaultExperiment), *_of_variables(found)]:
        more = f"; and {len(problems) - SHOWN} more" if len(problems) > SHOWN else ""
        raise VerificationError(
            f"{str(path)!r}: modelDescription.xml: {'; '.join(problems[:SHOWN])}{more}: correct it, or build "
            "the FMU anew"
        )
    return found


def _of_experiment(said: Any) -> list[str]:
    """What is wrong with the default experiment."""
    given = {
        n: value
        for n in ("startTime", "stopTime", "stepSize", "tolerance")
        if (value := getattr(said, n, None)) is not None
    }
    problems = [
        f"{n} is {value!r}, expected a finite number"
        for n, value in given.items()
        if not math.isfinite(_number(value))
    ]
    if problems:
        return problems
    problems = [
        f"{n} is {given[n]!r}, expected a positive number"
        for n in ("stepSize", "tolerance")
        if n in given and _number(given[n]) <= 0
    ]
    start, stop = _number(given.get("startTime", 0)), given.get("stopTime")
    if stop is not None and _number(stop) < start:
        problems.append(f"stopTime is {stop!r}, expected one after the startTime {start!r}")
    return problems


def _of_variables(description: Any) -> list[str]:
    """What is wrong with the names, references, numbers and derivatives of variables."""
    variables = description.modelVariables
    counts = Counter(v.name for v in variables)
    problems = [f"several variables are called {n!r}" for n, k in counts.items() if k > 1]
    for v in variables:
        if not v.name:
            problems.append("a variable has no name")
        if v.name == "time" and v.causality in ("input", "output"):
            problems.append(f"an {v.causality} is called 'time', which names the time itself")
        whole: list[tuple[str, Any]] = [("valueReference", v.valueReference)]
        if kind_of(v) == "Enumeration":
            items = getattr(v.declaredType, "items", None) or []
            whole += [(f"item {item.name!r}", item.value) for item in items]
        problems += [
            f"{v.name!r}: {what} is {value!r}, expected a whole number"
            for what, value in whole
            if not _number(value).is_integer()
        ]
        real = kind_of(v) == "Real"
        numbers = {"min": v.min, "max": v.max} | ({"start": v.start} if real else {})
        problems += [
            f"{v.name!r}: {what} is {value!r}, expected a number"
            for what, value in numbers.items()
            if value is not None and math.isnan(_number(value))
        ]
    for u in description.derivatives:
        if getattr(u.variable, "derivative", None) is None:
            name = getattr(u.variable, "name", None)
            problems.append(f"{name!r} is listed as a derivative, and does not say of what")
    return problems


def _number(value: Any) -> float:
    """NaN for what is none."""
    try:
        return float(value)
    except (TypeError, ValueError):
        return math.nan


def file_stem(description: Any) -> str:
    """The name of the model as the name of a file in the folder that is meant, whatever it holds."""
    return re.sub(r"[^\w-]", "_", description.modelName or "") or "FMU"


def check_inputs(table: Trajectory | None, rules: Mapping[str, Rule], known: Sequence[str]) -> None:
    """A table of inputs, if there is one, has rising times and columns of those that are `known`, with values
    that the rules allow.  Raises SettingError."""
    if table is None:
        return
    found = table.dtype.names or ()
    problems = [missing(n, known, "is no input") for n in found if n != "time" and n not in known]
    if "time" not in found:
        problems.append("there is no column 'time'")
    elif not (np.isfinite(table["time"]).all() and (np.diff(table["time"]) >= 0).all()):
        problems.append("the times are not sorted, expected rising seconds")
    for end in (np.min, np.max):
        values = {n: end(table[n]) for n in found if n in known and len(table)}
        problems += [text for text in problems_of(rules, values) if text not in problems]
    if problems:
        raise SettingError(f"inputs: {'; '.join(problems)}")


def warn_of_rates(table: Trajectory | None, rules: Mapping[str, Rule]) -> None:
    """Warns of motions in a table whose rates it leaves out, and which move otherwise than these begin: for
    runs whose FMU nobody hears."""
    if table is None:
        return
    fields, apart = table.dtype.names or (), np.diff(table["time"])
    left = {}
    for n in fields:
        rate = rate_of(n)
        if n != "time" and rate in rules and rate not in fields:
            slopes = np.diff(table[n])[apart > 0] / apart[apart > 0]
            if not np.allclose(slopes, float(rules[rate].start or 0.0)):
                left[n] = rate
    if left:
        warnings.warn(
            f"inputs: {', '.join(left)} moves, and the table leaves out {', '.join(left.values())}, so that "
            "the forces of constraint are wrong: add these columns, or build the FMU with "
            'Input(..., rates="estimated")',
            LagfmuWarning,
            stacklevel=3,
        )


def columns_at(
    table: Trajectory | None, times: NDArray[np.float64], rules: Mapping[str, Rule]
) -> dict[str, list[float]]:
    """The inputs at these times: interpolated linearly, held where they are no Reals; at a jump (two rows of
    one time) the value after it."""
    if table is None:
        return {}
    at = np.clip(np.searchsorted(table["time"], times, "right") - 1, 0, None)
    return {
        n: (
            np.interp(times, table["time"], table[n]) if rules[n].kind == "Real" else table[n][at]
        ).tolist()
        for n in table.dtype.names or ()
        if n != "time"
    }


def jumps(table: Trajectory | None, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """The times between the first and the last of `times` at which inputs jump, and that are none of them."""
    if table is None or len(table) < 2:
        return np.empty(0)
    found = np.unique(table["time"][:-1][np.diff(table["time"]) == 0])
    found = found[(found > times[0]) & (found < times[-1])]
    near = np.abs(found[:, None] - times[None, :]).min(axis=1, initial=np.inf)
    apart: NDArray[np.float64] = found[near > 1e-9 * np.abs(found)]
    return apart
