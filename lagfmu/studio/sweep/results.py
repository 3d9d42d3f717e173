"""The results of a study: an Arrow table a part, one file of all runs, an xarray Dataset.

A run is a row: its number, what varied, what was kept, `status` (ok, discard, error, fatal, crashed,
timeout), `reason`, start values that were `moved`, and the time that it reached.

What a study keeps of a run: NAME:last, :max, :min, :mean, :time-of-max, or all points, :trajectory.

What a sweep keeps of itself on disk: each finished chunk is a file; one that stopped goes on with them.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import sys
import tempfile
import warnings
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from ... import names
from ...errors import LagfmuWarning, SettingError, SimulationError
from ...files import content_of, foreign, json_of, parquet_of, write_whole
from ...fmu.session import KINDS, LAST, MAX, MEAN, MIN, STATUS, TIME_OF_MAX, Outcome
from ...model.rule import missing
from .design import Design
from .process import CRASHED, TIMED_OUT

REDUCTIONS = {"last": LAST, "max": MAX, "min": MIN, "mean": MEAN, "time-of-max": TIME_OF_MAX}
TRAJECTORY = "trajectory"
PEAKS = {"max": "peak.max", "min": "peak.min", "time-of-max": "peak.max_time"}
FOUND = {  # of the reductions that look for something: whether the FMU has found it
    True: "of the continuous motion, found by the FMU itself",
    False: "of the communication points",
}


@dataclass(frozen=True)
class Kept:
    """The reductions (variable, how) in the order asked for, and the variables kept at all points; `peaks`:
    those of the reductions that the FMU tells itself, by its `peak.*`."""

    numbers: tuple[tuple[str, str], ...]
    trajectories: tuple[str, ...]
    peaks: tuple[tuple[str, str], ...] = ()

    def about(self, column: str) -> str:
        """What a column NAME:HOW has been found in; empty where it is plain."""
        name, _, how = column.rpartition(":")
        return FOUND[(name, how) in self.peaks] if how in PEAKS else ""

    @property
    def columns(self) -> tuple[str, ...]:
        """NAME:HOW of each number."""
        return tuple(f"{name}:{how}" for name, how in self.numbers)

    @property
    def plan(self) -> tuple[tuple[str, int], ...]:
        """For the session: the numbers, then the variables whose trajectories are kept."""
        found = [
            (names.name(PEAKS[how], "", name), LAST)
            if (name, how) in self.peaks
            else (name, REDUCTIONS[how])
            for name, how in self.numbers
        ]
        return (*found, *((name, LAST) for name in self.trajectories))


def peaked(texts: Sequence[str]) -> list[str]:
    """The variables, or patterns of them, whose peaks are of use to what is to be kept."""
    asked = [text.rpartition(":") for text in texts] or [("lambda.*", ":", "max")]
    return list(dict.fromkeys(name for name, _, how in asked if how in PEAKS))


def kept(texts: Sequence[str], known: Mapping[str, str], outputs: Sequence[str]) -> Kept:
    """`known` maps the FMU's variables to their FMI types.  Without texts: the largest multipliers, and
    counts and times of departures and slips; of an FMU that has none of these all `outputs`, at the end.
    Raises SettingError with all problems at once."""
    if not texts:
        texts = [f"{n}:max" for n in names.those(known, names.MULTIPLIER)]
        events = names.those(
            known, names.DEPARTURES, names.DEPARTURE_TIME, names.SLIPS, names.SLIP_TIME
        )
        texts += [f"{n}:last" for n in events]
        if not texts:
            texts = [
                f"{n}:last"
                for n in outputs
                if known[n] in KINDS and names.read(n).head != names.SOLVER
            ]
    numbers, trajectories, problems = [], [], []
    if any(names.varied(text.rpartition(":")[0] or text) for text in texts):
        texts = [*texts, f"{names.SENSITIVITY_VALID}:last"]  # without it a 0 may be none
    for text in dict.fromkeys(texts):
        name, sign, how = text.rpartition(":")
        if not sign or (how not in REDUCTIONS and how != TRAJECTORY and text in known):
            name, how = text, "last"
        if how != TRAJECTORY and how not in REDUCTIONS:
            ways = ", ".join((*REDUCTIONS, TRAJECTORY))
            problems.append(f"{text!r}: {how!r} is unknown, expected one of {ways}")
        elif name not in known or known[name] not in KINDS:
            problems.append(missing(name, [n for n in known if known[n] in KINDS]))
        elif how == TRAJECTORY:
            trajectories.append(name)
        else:
            numbers.append((name, how))
    if problems:
        raise SettingError("keep: " + "; ".join(problems))
    peaks = [
        (n, how) for n, how in numbers if how in PEAKS and names.name(PEAKS[how], "", n) in known
    ]
    return Kept(tuple(numbers), tuple(trajectories), tuple(peaks))


RECORD, LARGEST_RECORD = "sweep.json", 1_000_000  # bytes


class PartWarning(LagfmuWarning):
    """A finished chunk that cannot be used, and is done again."""


class Parts:
    """The finished chunks of a sweep, each a file: what a client that stops leaves behind."""

    def __init__(self, folder: Path | None, identity: Mapping[str, Any], resume: bool) -> None:
        self.temporary = folder is None
        self.folder = Path(tempfile.mkdtemp(prefix="lagfmu_")) if folder is None else folder
        record = self.folder / RECORD
        if folder is not None and self.folder.exists() and any(self.folder.iterdir()):
            with foreign(
                lambda said: SettingError(
                    f"{str(folder)!r} is not the folder of a sweep ({RECORD} is missing or damaged: {said}): "
                    "choose another --out"
                )
            ):
                found = json_of(content_of(record, LARGEST_RECORD))
                differ = sorted(k for k in identity if found.get(k) != identity[k])
            if differ:
                raise SettingError(
                    f"{str(folder)!r} belongs to another sweep ({', '.join(differ)} differ): finish that "
                    "one, delete its folder, or choose another --out"
                )
            if self.done and not resume:
                raise SettingError(
                    f"{len(self.done)} finished chunks of this sweep are in {str(folder)!r}: go on with "
                    "--resume, or delete the folder"
                )
        write_whole(record, json.dumps(identity, indent=1).encode())
        self.release = _held(self.folder)

    @property
    def done(self) -> set[int]:
        """Numbers of the finished chunks."""
        return {int(p.stem.split("_")[1]) for p in self.folder.glob("part_*.parquet")}

    def check(
        self, design: Mapping[int, Mapping[str, Any]], points: tuple[int, ...] | None
    ) -> None:
        """Remove, with a PartWarning each, chunks that cannot be read whole, or are not of these runs.

        `design`: of each chunk the columns that are known before it is run, `run` among them; `points`: the
        shape of a run's trajectories, None where there are none.
        """
        for number in sorted(self.done):
            try:
                with foreign(SettingError):
                    if number not in design:
                        raise ValueError("the sweep has no such chunk")
                    self._check(number, design[number], points)
            except SettingError as error:
                place = self._place(number, "parquet")
                warnings.warn(
                    f"{str(place)!r} is not used, and its runs are done again: {error}",
                    PartWarning,
                    stacklevel=2,
                )
                for ending in ("parquet", "npz"):
                    self._place(number, ending).unlink(missing_ok=True)

    def _check(self, number: int, rows: Mapping[str, Any], points: tuple[int, ...] | None) -> None:
        table = self._table(self._place(number, "parquet"))
        for name, values in rows.items():
            if not np.array_equal(table[name].to_numpy(), values, equal_nan=True):
                raise ValueError(f"its column {name!r} is that of other runs")
        if points is not None:
            found = self._trajectories(number)
            if found.shape != (len(rows["run"]), *points):
                raise ValueError(f"its trajectories have the shape {found.shape}")

    def write(self, number: int, table: Any, trajectories: np.ndarray[Any, Any] | None) -> None:
        """Keep a chunk, at once or not at all."""
        import pyarrow.parquet as pq

        if trajectories is not None:

            def save(path: Path) -> None:
                with path.open("wb") as file:
                    np.savez(file, part=np.array(number), values=trajectories)

            write_whole(self._place(number, "npz"), save)
        write_whole(
            self._place(number, "parquet"),
            lambda path: pq.write_table(table, path, write_page_checksum=True),
        )

    def _place(self, number: int, ending: str) -> Path:
        return self.folder / f"part_{number:08d}.{ending}"

    def _table(self, path: Path) -> Any:
        return parquet_of(path, page_checksum_verification=True)

    def _trajectories(self, number: int) -> np.ndarray[Any, Any]:
        with np.load(self._place(number, "npz")) as found:
            if int(found["part"]) != number:
                raise ValueError(f"its trajectories are those of chunk {int(found['part'])}")
            values: np.ndarray[Any, Any] = found["values"]
            return values

    def tables(self) -> Iterator[Any]:
        """Arrow tables in the order of the design."""
        for number in sorted(self.done):
            yield self._table(self._place(number, "parquet"))

    def trajectories(self) -> np.ndarray[Any, Any]:
        """(runs, points, variables)."""
        return np.concatenate([self._trajectories(n) for n in sorted(self.done)])

    def remove(self) -> None:
        """When all is assembled."""
        self.release()
        shutil.rmtree(self.folder, ignore_errors=True)


def _held(folder: Path) -> Callable[[], object]:
    """Keep other sweeps out of a folder, until what this returns is called or this process ends.  Raises
    SettingError if another one is in it."""
    try:
        import fcntl
    except ImportError:
        return lambda: None
    opened = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(opened)
        raise SettingError(
            f"another sweep writes to {str(folder)!r} now: wait until it ends, or choose another --out"
        ) from None
    except OSError:  # a file system without locks
        pass
    return weakref.finalize(_held, os.close, opened)


INFINITE = sys.float_info.max  # stands for infinity where an FMU's Real must be finite: error bars
TEXTS = ("status", "reason", "moved")
LARGEST = 10_000_000  # bytes of what stands beside it
METADATA = "-metadata.json"  # of a CSV file, behind its name: W3C's tabular metadata


def _status_name(status: int) -> str:
    """ok, discard, error, fatal, crashed or timeout."""
    beyond = {CRASHED: "crashed", TIMED_OUT: "timeout"}
    return beyond.get(status) or ("ok" if status < 2 else STATUS[status])


@dataclass(frozen=True)
class Layout:
    """What stands in a table: the design, what is kept, units by variable, facts of the study by name."""

    design: Design
    kept: Kept
    units: Mapping[str, str]
    facts: Mapping[str, str]

    def unit(self, column: str) -> str:
        """The unit of a varied quantity or of NAME:HOW."""
        if column.endswith(":time-of-max"):
            return "s"
        return self.units.get(column.rpartition(":")[0] or column, "") or self.units.get(column, "")

    def about(self, column: str) -> dict[str, str]:
        """The unit of a column and, of an extreme, what it has been found in."""
        found = {"unit": "s" if column == "reached" else self.unit(column)}
        text = self.kept.about(column)
        return found | ({"description": text} if text else {})

    def part(self, first: int, outcome: Outcome) -> Any:
        """The runs from number `first` on as an Arrow table."""
        import pyarrow as pa

        count = len(outcome.status)
        rows = self.design.table[first : first + count]
        columns: list[tuple[str, Any]] = [("run", pa.array(np.arange(first, first + count)))]
        columns += [(n, pa.array(rows[:, k])) for k, n in enumerate(self.design.names)]
        columns += [(n, pa.array(outcome.result[:, k])) for k, n in enumerate(self.kept.columns)]
        columns += [
            ("status", pa.array([_status_name(s) for s in outcome.status.tolist()], pa.string())),
            *(
                (n, pa.array([told.get(k, "") for k in range(count)], pa.string()))
                for n, told in (("reason", outcome.reasons), ("moved", outcome.moved))
            ),
            ("reached", pa.array(outcome.reached)),
        ]
        fields = [pa.field(n, a.type, metadata=self.about(n)) for n, a in columns]
        schema = pa.schema(fields, metadata={"lagfmu": json.dumps(dict(self.facts))})
        return pa.table([a for _, a in columns], schema=schema)

    def trajectories(self, outcome: Outcome) -> np.ndarray[Any, Any] | None:
        """(runs, points, variables) of those kept at all points."""
        if outcome.trajectory is None:
            return None
        return outcome.trajectory[:, :, len(self.kept.numbers) :]


def write_rows(parts: Parts, path: Path, layout: Layout) -> None:
    """One .parquet or .csv file of all runs, written part by part; it replaces what was there when it is
    whole.  What a CSV file cannot say of itself stands beside it: see `_metadata`."""
    import pyarrow.csv as csv
    import pyarrow.parquet as pq

    write = csv.CSVWriter if path.suffix == ".csv" else pq.ParquetWriter

    def rows(place: Path) -> None:
        with contextlib.ExitStack() as last:
            writer: Any = None
            for table in parts.tables():
                if writer is None:
                    writer = last.enter_context(write(place, table.schema))
                    schema = table.schema
                writer.write_table(table)
        if path.suffix == ".csv":
            about = json.dumps(_metadata(path.name, schema, layout.facts), indent=1)
            write_whole(path.with_name(path.name + METADATA), about.encode())

    write_whole(path, rows)


def _metadata(name: str, schema: Any, facts: Mapping[str, str]) -> dict[str, Any]:
    """Units of the columns and facts of the study, by W3C's "Metadata Vocabulary for Tabular Data"."""
    columns = []
    for field in schema:
        kind = {"string": "string", "int64": "integer"}.get(str(field.type), "number")
        column = {"name": quote(field.name), "titles": field.name, "datatype": kind}
        if unit := field.metadata[b"unit"].decode():
            column["schema:unitText"] = unit
        if text := field.metadata.get(b"description", b"").decode():
            column["dc:description"] = text
        columns.append(column)
    return {
        "@context": "http://www.w3.org/ns/csvw",
        "url": name,
        "null": ["nan"],
        "schema:creator": f"lagfmu {facts['lagfmu']}",
        "notes": [dict(facts)],
        "tableSchema": {"columns": columns, "primaryKey": "run"},
    }


def one_by_one(found: Any) -> Any:
    """The runs of a Dataset in their order, whatever was crossed."""
    return found if "run" in found.dims else found.stack(run=found["status"].dims)


def varied(found: Any) -> list[str]:
    """Names of what varied."""
    others = ("run", "time")
    return [str(n) for n, c in found.coords.items() if n not in others and c.dtype.kind == "f"]


def numbers(found: Any) -> list[str]:
    """Names of the numbers that were kept of each run."""
    return [
        str(n)
        for n, a in found.data_vars.items()
        if a.dtype.kind == "f" and n != "reached" and "time" not in a.dims
    ]


def happened(found: Any, column: str) -> np.ndarray[Any, Any]:
    """The values of a column; of an event that a run has not met NaN, where its FMU has zeros.

    Whether it has is known by its count where that was kept, and of a time also by its being 0.
    """
    values = np.array(found[column].values, dtype=float)
    of = column.rpartition(":")[0]
    count = f"{names.counted(of)}:last"
    if count in found:
        values[found[count].values == 0] = np.nan
    elif names.read(of).quantity in names.COUNT_OF:
        values[values == 0] = np.nan
    return values


def dataset(
    layout: Layout, tables: Sequence[Any], times: Any, trajectories: np.ndarray[Any, Any] | None
) -> Any:
    """An xarray.Dataset: over the crossed quantities if only axes vary, else over `run`."""
    import pyarrow as pa
    import xarray as xr

    table = pa.concat_tables(tables)
    axes = layout.design.axes
    dims = tuple(n for n, _ in axes) or ("run",)
    shape = tuple(len(v) for _, v in axes) or (len(layout.design),)
    coords: dict[str, Any] = {n: (n, v, {"units": layout.unit(n)}) for n, v in axes}
    if not axes:
        coords = {"run": np.arange(len(layout.design))}
        for k, n in enumerate(layout.design.names):
            coords[n] = ("run", layout.design.table[:, k], {"units": layout.unit(n)})
    data: dict[str, Any] = {}
    for n in (*layout.kept.columns, "reached"):
        about = layout.about(n)
        about["units"] = about.pop("unit")
        data[n] = (dims, table[n].to_numpy().reshape(shape), about)
    for n in TEXTS:  # objects: of a fixed width, one long text would cost all runs
        data[n] = (dims, table[n].to_numpy().reshape(shape))
    if trajectories is not None:
        coords["time"] = ("time", times, {"units": "s"})
        for k, n in enumerate(layout.kept.trajectories):
            values = trajectories[:, :, k].reshape((*shape, len(times)))
            called = f"{n}:trajectory" if n in coords else n  # its start value is what varies
            data[called] = ((*dims, "time"), values, {"units": layout.unit(n)})
    return xr.Dataset(data, coords, dict(layout.facts))


def read_rows(path: Path) -> Any:
    """What `write_rows` wrote, as an xarray.Dataset over `run`, or over what varied if that is one axis.

    Raises SimulationError for a file that is none of a sweep's.
    """
    with foreign(
        lambda said: SimulationError(
            f"{str(path)!r} is no table that lagfmu sweep wrote ({said}): expected its .parquet file, or its "
            f".csv file with {path.name}{METADATA} beside it"
        )
    ):
        return _rows(path)


def _rows(path: Path) -> Any:
    import pandas as pd
    import xarray as xr

    if path.suffix == ".csv":
        rows = pd.read_csv(path, keep_default_na=False, na_values=["nan", ""])
        about = json_of(content_of(path.with_name(path.name + METADATA), LARGEST))
        facts = about["notes"][0]
        units = {c["titles"]: c.get("schema:unitText", "") for c in about["tableSchema"]["columns"]}
    else:
        table = parquet_of(path)
        facts = json_of(table.schema.metadata[b"lagfmu"])
        units = {f.name: f.metadata[b"unit"].decode() for f in table.schema}
        rows = table.to_pandas()
    names = [n for n in rows.columns if n not in ("run", "reached", *TEXTS)]
    causes = [n for n in names if ":" not in n]
    for n in causes:
        if not np.isfinite(rows[n].to_numpy(float)).all():
            raise ValueError(f"{n!r} varies through what is no finite number")
    dim = causes[0] if len(causes) == 1 and rows[causes[0]].is_monotonic_increasing else "run"
    made = xr.Dataset(
        {n: (dim, rows[n].to_numpy(float)) for n in (*names, "reached") if n not in causes},
        {n: (dim, rows[n].to_numpy(float)) for n in (*causes, "run") if n == dim or n in causes},
        {str(k): str(v) for k, v in dict(facts).items()},
    )
    for n in TEXTS:
        made[n] = (dim, rows[n].fillna("").astype(str).to_numpy(object))
    for n in made.variables:
        made[n].attrs["units"] = str(units.get(str(n), ""))
    return made
