"""sweep(): many runs of one FMU, as an xarray Dataset and, if asked for, a file."""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
import threading
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from numpy.typing import NDArray

from ...errors import SettingError, SimulationError
from ...files import write_whole
from ...fmu.archive import unpack, version
from ...fmu.read import (
    Trajectory,
    check_inputs,
    columns_at,
    communication_points,
    described_rules,
    experiment_of,
    kind_of,
    obstacle,
    read_description,
    warn_of_rates,
)
from ...fmu.session import Plan
from ...fmu.write import as_fmu
from ...interface.variables import unsettable
from ...model.model import Model
from ...model.rule import Rule
from ...model.scene import Scene
from ...numeric.thresholds import tolerance_problem
from ...verification.reference import Driven, driven
from .design import Design, Values, design, number
from .engine import asked_to_stop, closed, connected, distributed, local
from .results import Layout, Parts, dataset, peaked, write_rows
from .results import kept as parsed

MOST = 2000  # runs in a chunk
FEWEST = 100  # chunks, of a large sweep
MEMORY = 0.1  # of this machine's, for one table: it is held a few times over
ROWS = (".parquet", ".csv")  # files of a row a run; others hold trajectories too
SUFFIXES = (*ROWS, ".nc", ".zarr")

Progress = Callable[[int, int, int], None]  # runs done, of how many, of those refused


def sweep(
    source: str | os.PathLike[str] | Model,
    vary: Mapping[str, Sequence[float] | Values] | None = None,
    *,
    sample: Mapping[str, Any] | None = None,
    runs: int | None = None,
    seed: int = 0,
    sampling: str = "latin-hypercube",
    rows: Any = None,
    keep: Sequence[str] = (),
    stop_time: float | None = None,
    step_size: float | None = None,
    tolerance: float | None = None,
    inputs: Driven | None = None,
    scene: Scene | str | None = None,
    out: str | os.PathLike[str] | None = None,
    on: Any = None,
    workers: int | None = None,
    resume: bool = False,
    timeout: float | None = None,
    progress: Progress | None = None,
    command: str = "",
) -> Any:
    """Run an FMU (or a model, or a model file, built natively where a compiler is at hand) many times.

    Parameters, start values and `solver.*` may vary.  `vary` maps names to values, which are crossed;
    `sample` maps names to frozen distributions of SciPy, from which `sampling` ('latin-hypercube' or 'sobol')
    draws `runs` points with `seed`; `rows` is a table with a column for each name (a pandas DataFrame, a
    structured array, or a dict of sequences).

    `keep` lists 'NAME:last', ':max', ':min', ':time-of-max' (of the continuous motion where the FMU has
    peaks, as one that is built here; else of communication points), ':mean' or
    ':trajectory'.  If empty: the largest multipliers, counts and times of departures and of slipping.
    `out` is .parquet or .csv (a row for each run), or .nc or .zarr (with trajectories).  Finished parts
    are in OUT.parts; `resume` continues from them.  `on` is a Dask scheduler's address or a
    `dask.distributed.Client`; without it `workers` processes of this machine do the runs (default: all
    cores).  `timeout` [s] limits a run: its status is then 'timeout', and its process is replaced.

    Returns an xarray.Dataset over the crossed quantities, or over `run`; a refused run has NaN, its `status`
    and its `reason`.  Raises SimulationError with what was expected.
    """
    _require()
    path_out = None if out is None else Path(out)
    _check_options(workers, seed, tolerance, path_out, resume, timeout)
    with as_fmu(source, scene, peaks=peaked(keep)) as path:
        varied = _design(vary, sample, runs, seed, sampling, rows)
        times = _times(path, stop_time, step_size)
        study = _study(path, varied, keep, times, tolerance, driven(inputs), command)
        if study.layout.kept.trajectories and path_out is not None and path_out.suffix in ROWS:
            raise SettingError(
                f"trajectories do not fit a {path_out.suffix} file: --out FILE.nc or FILE.zarr"
            )
        folder = None if path_out is None else path_out.with_name(f"{path_out.name}.parts")
        parts = Parts(folder, study.identity, resume)
        try:
            if resume:
                parts.check(study.rows, study.points)
            _run(study, parts, on, workers, timeout, progress)
            found = _assembled(study, parts, path_out)
        except BaseException:
            if parts.temporary:
                parts.remove()
            raise
        finally:
            parts.release()
        parts.remove()
        return found


@dataclass(frozen=True)
class Study:
    """What is run, of which FMU, in chunks of how many runs, and what stands in the table of results."""

    path: Path
    plan: Plan
    layout: Layout
    chunk: int

    @property
    def identity(self) -> dict[str, str]:
        """What a sweep that goes on must share with the one that was interrupted."""
        facts, drives = self.layout.facts, self.plan.drives
        driven = "" if drives is None else hashlib.sha256(drives.tobytes()).hexdigest()
        found = {k: facts[k] for k in ("fmu_sha256", "stop_time", "step_size", "tolerance")}
        found |= {"design": self.layout.design.digest, "keep": repr(self.layout.kept)}
        return found | {"inputs": driven, "chunk": str(self.chunk)}

    @property
    def rows(self) -> dict[int, dict[str, Any]]:
        """Of each chunk the numbers of its runs, and what varies in them."""
        design, size = self.layout.design, self.chunk
        found: dict[int, dict[str, Any]] = {}
        for first in range(0, len(design), size):
            table = design.table[first : first + size]
            found[first // size] = {"run": np.arange(first, first + len(table))}
            found[first // size] |= {n: table[:, k] for k, n in enumerate(design.names)}
        return found

    @property
    def points(self) -> tuple[int, ...] | None:
        """The shape of a run's trajectories, None where none are kept."""
        count = len(self.layout.kept.trajectories)
        return (len(self.plan.times), count) if count else None


def _study(
    path: Path,
    varied: Design,
    keep: Sequence[str],
    times: NDArray[np.float64],
    tolerance: float | None,
    inputs: Trajectory | None,
    command: str,
) -> Study:
    """All that can be said before anything is run.  Raises SettingError."""
    description = read_description(path)
    if problem := obstacle(path, description):
        raise SimulationError(
            f"{str(path)!r} {problem}: build it with --platforms, or run the sweep where it has one"
            if "binary" in problem
            else f"{str(path)!r} {problem}"
        )
    rules = described_rules(description)
    variables = {v.name: v for v in description.modelVariables}
    outputs = [n for n, v in variables.items() if v.causality == "output"]
    kept = parsed(keep, {n: kind_of(v) for n, v in variables.items()}, outputs)
    check_inputs(inputs, rules, [n for n, v in variables.items() if v.causality == "input"])
    warn_of_rates(inputs, rules)
    driven = columns_at(inputs, times, rules)
    _check(varied, rules, driven)
    size = 8 * len(varied) * (len(kept.numbers) + len(kept.trajectories) * len(times))
    if size > memory():
        raise SettingError(
            f"{len(varied)} runs would keep {size / 1e9:.3g} GB, more than the {memory() / 1e9:.3g} GB that "
            "fit here: keep less, or make fewer runs"
        )
    plan = Plan(
        vary=varied.names,
        keep=kept.plan,
        times=times,
        tolerance=tolerance or 0.0,
        drive=tuple(driven),
        drives=np.column_stack(list(driven.values())) if driven else None,
        whole=bool(kept.trajectories),
    )
    facts = {
        "fmu": path.name,
        "fmu_sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "lagfmu": version(),
        "fmpy": fmpy.__version__,
        "command": command,
        "stop_time": repr(float(times[-1])),
        "step_size": repr(float(times[1] - times[0])),
        "tolerance": repr(tolerance) if tolerance else "the FMU's own",
    }
    units = {
        n: str(v.unit or getattr(v.declaredType, "unit", "") or "") for n, v in variables.items()
    }
    chunk = min(MOST, max(1, -(-len(varied) // FEWEST)))
    return Study(path, plan, Layout(varied, kept, units, facts), chunk)


def _assembled(study: Study, parts: Parts, out: Path | None) -> Any:
    """The Dataset of all runs, written if it is asked for."""
    layout = study.layout
    if out is not None and out.suffix in ROWS:
        write_rows(parts, out, layout)
    whole = parts.trajectories() if layout.kept.trajectories else None
    found = dataset(layout, list(parts.tables()), study.plan.times, whole)
    found.attrs["refused"] = int((found["status"].values != "ok").sum())
    if out is not None and out.suffix not in ROWS:
        _save(found, out)
    return found


def _run(
    study: Study,
    parts: Parts,
    on: Any,
    workers: int | None,
    limit: float | None,
    progress: Progress | None,
) -> None:
    """What is not yet there.  Raises KeyboardInterrupt, when all that is finished is kept."""
    layout, chunk = study.layout, study.chunk
    total, done, refused = len(layout.design), parts.done, 0
    rules = described_rules(read_description(study.path))
    columns = zip(layout.design.names, layout.design.table.T, strict=True)
    table = np.column_stack([_asked(rules[n], column) for n, column in columns])
    left = [
        (n, table[n * chunk : (n + 1) * chunk]) for n in range(-(-total // chunk)) if n not in done
    ]
    finished = total - sum(len(v) for _, v in left)

    def tell(under_way: int = 0) -> None:
        if progress is not None:
            progress(finished + under_way, total, refused)

    with contextlib.ExitStack() as stack:
        client, ours = (None, False) if on is None else connected(on)
        if client is not None and ours:
            stack.callback(closed, client)
        folder = unpack(study.path)
        stack.callback(shutil.rmtree, folder, ignore_errors=True)
        tell()
        if client is None:
            stop = stack.enter_context(asked_to_stop())
            cores = workers or os.cpu_count() or 1
            results = local(folder, study.plan, left, cores, limit, stop, tell)
        else:
            stop = threading.Event()
            results = distributed(client, study.path, study.plan, left, limit)
        with contextlib.closing(results):
            for number, outcome in results:
                first = number * chunk
                parts.write(number, layout.part(first, outcome), layout.trajectories(outcome))
                refused += len(outcome.reasons)
                finished += len(outcome.status)
                tell()
        if stop.is_set() and finished < total:
            raise KeyboardInterrupt


def memory() -> float:
    """Bytes that one table may have."""
    try:
        return MEMORY * os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return 4e9


def _require() -> None:
    missing = []
    for name in ("pandas", "pyarrow", "xarray"):
        try:
            __import__(name)
        except ImportError:
            missing.append(name)
    if missing:
        raise SimulationError(
            f"a sweep needs {', '.join(missing)}: pip install {' '.join(missing)}"
        )


def _design(
    vary: Mapping[str, Sequence[float] | Values] | None,
    sample: Mapping[str, Any] | None,
    runs: int | None,
    seed: int,
    sampling: str,
    rows: Any,
) -> Design:
    table = None
    if rows is not None:
        names = tuple(rows.dtype.names if isinstance(rows, np.ndarray) else rows.keys())
        table = (names, np.column_stack([_column(n, rows[n]) for n in names]))
    return design(vary, sample, runs, seed, sampling, table, memory())


def _column(name: str, values: Any) -> NDArray[np.float64]:
    """The numbers of a quantity; methods may be named."""
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        return np.array([number(str(v), name, f"rows: {name}") for v in values])


def _times(path: Path, stop_time: float | None, step_size: float | None) -> NDArray[np.float64]:
    for what, value in (("stop_time", stop_time), ("step_size", step_size)):
        if value is not None and not 0 < value < np.inf:
            raise SettingError(f"{what} = {value!r} s, expected a positive number")
    experiment = experiment_of(read_description(path), stop_time, step_size)
    return communication_points(experiment.stop_time, experiment.step_size)


def _check_options(
    workers: int | None,
    seed: int,
    tolerance: float | None,
    out: Path | None,
    resume: bool,
    timeout: float | None,
) -> None:
    """All problems at once."""
    problems = []
    if workers is not None and workers < 1:
        problems.append(f"workers = {workers}, expected a whole number from 1")
    if seed < 0:
        problems.append(f"seed = {seed}, expected a whole number from 0")
    if tolerance is not None and (problem := tolerance_problem(tolerance)):
        problems.append(problem)
    if timeout is not None and not 0 < timeout < float("inf"):
        problems.append(f"timeout = {timeout!r} s, expected a positive number")
    if resume and out is None:
        problems.append("resume needs the out of the sweep that was interrupted")
    if out is not None and out.suffix not in SUFFIXES:
        problems.append(f"out {str(out)!r}: expected a file {', '.join(SUFFIXES)}")
    if problems:
        raise SettingError("; ".join(problems))


def _check(varied: Design, rules: Mapping[str, Rule], driven: Collection[str]) -> None:
    """Every varied name is something that the FMU lets be set before it starts, to values of its kind; what
    else it refuses of them is told of the runs that have them."""
    problems: list[str] = []
    for name, column in zip(varied.names, varied.table.T, strict=True):
        problems += filter(None, [unsettable(rules, name)])
        odd = column[column != np.round(column)]
        if name in rules and rules[name].kind != "Real" and odd.size:
            problems.append(rules[name].problem(float(odd[0])))
        if name in driven:
            problems.append(f"{name} varies and comes from the file of inputs")
    if problems:
        raise SettingError("; ".join(problems))


def _asked(rule: Rule, column: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values that vary as the FMU gets them."""
    meant = rule.follows or rule.begins
    return np.array([rule.asked(x) for x in column]) if meant else column


def _save(found: Any, out: Path) -> None:
    """netCDF or Zarr.  Raises SimulationError."""
    try:
        if out.suffix == ".zarr":
            write_whole(out, lambda place: found.to_zarr(place, mode="w"))
        else:
            write_whole(out, lambda place: found.to_netcdf(place, engine="h5netcdf"))
    except (ImportError, ModuleNotFoundError, ValueError) as error:
        raise SimulationError(
            f"cannot write {str(out)!r}: {error}: pip install xarray h5netcdf h5py zarr"
        ) from None
