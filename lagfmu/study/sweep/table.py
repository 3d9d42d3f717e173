"""The results of a study: parts on disk as they are done, one Parquet file of all runs, an xarray Dataset.

A run is a row: its number, what varied, what was kept, `status` (ok, discard, error, fatal, crashed),
`reason` and the time that it reached.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from ... import names
from ...errors import SettingError, SimulationError
from ...fmu.session import STATUS, Outcome
from .design import Design
from .host import CRASHED
from .keep import Kept

RECORD = "sweep.json"
INFINITE = sys.float_info.max  # stands for infinity where an FMU's Real must be finite: error bars
METADATA = "-metadata.json"  # of a CSV file, behind its name: W3C's tabular metadata


def status_name(status: int) -> str:
    """ok, discard, error, fatal or crashed."""
    return "crashed" if status == CRASHED else "ok" if status < 2 else STATUS[status]


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
            ("status", pa.array([status_name(s) for s in outcome.status.tolist()], pa.string())),
            ("reason", pa.array([outcome.reasons.get(k, "") for k in range(count)], pa.string())),
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


class Parts:
    """The finished chunks of a sweep, each a file: what a client that stops leaves behind."""

    def __init__(self, folder: Path | None, identity: Mapping[str, Any], resume: bool) -> None:
        self.temporary = folder is None
        self.folder = Path(tempfile.mkdtemp(prefix="lagfmu_")) if folder is None else folder
        record = self.folder / RECORD
        if folder is not None and self.folder.exists() and any(self.folder.iterdir()):
            try:
                found = json.loads(record.read_text(encoding="utf-8"))
            except (OSError, ValueError):
                raise SettingError(
                    f"{str(folder)!r} is not the folder of a sweep ({RECORD} is missing): choose another "
                    "--out"
                ) from None
            differ = sorted(k for k in identity if found.get(k) != identity[k])
            if differ:
                raise SettingError(
                    f"{str(folder)!r} belongs to another sweep ({', '.join(differ)} differ): finish that "
                    "one, delete its folder, or choose another --out"
                )
            if not resume:
                raise SettingError(
                    f"{len(self.done)} finished chunks of this sweep are in {str(folder)!r}: go on with "
                    "--resume, or delete the folder"
                )
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            record.write_text(json.dumps(identity, indent=1), encoding="utf-8")
        except OSError as error:
            raise SimulationError(f"cannot write {str(record)!r}: {error.strerror}") from None

    @property
    def done(self) -> set[int]:
        """Numbers of the finished chunks."""
        return {int(p.stem.split("_")[1]) for p in self.folder.glob("part_*.parquet")}

    def write(self, number: int, table: Any, trajectories: np.ndarray[Any, Any] | None) -> None:
        """Keep a chunk, at once or not at all."""
        import pyarrow.parquet as pq

        if trajectories is not None:
            self._whole(f"part_{number:08d}.npy", lambda path: np.save(path, trajectories))
        self._whole(f"part_{number:08d}.parquet", lambda path: pq.write_table(table, path))

    def _whole(self, name: str, write: Any) -> None:
        unfinished = self.folder / f"unfinished_{name}"
        try:
            write(unfinished)
            os.replace(unfinished, self.folder / name)
        except OSError as error:
            raise SimulationError(f"cannot write {str(self.folder / name)!r}: {error}") from None

    def tables(self) -> Iterator[Any]:
        """Arrow tables in the order of the design."""
        import pyarrow.parquet as pq

        for path in sorted(self.folder.glob("part_*.parquet")):
            yield pq.read_table(path)

    def trajectories(self) -> np.ndarray[Any, Any]:
        """(runs, points, variables)."""
        return np.concatenate([np.load(p) for p in sorted(self.folder.glob("part_*.npy"))])

    def remove(self) -> None:
        """When all is assembled."""
        shutil.rmtree(self.folder, ignore_errors=True)


def write_rows(parts: Parts, path: Path, layout: Layout) -> None:
    """One .parquet or .csv file of all runs, written part by part; it replaces what was there when it is
    whole.  What a CSV file cannot say of itself stands beside it: see `_metadata`."""
    import pyarrow.csv as csv
    import pyarrow.parquet as pq

    unfinished = path.with_name(f".{path.name}.unfinished")
    write = csv.CSVWriter if path.suffix == ".csv" else pq.ParquetWriter
    writer: Any = None
    try:
        for table in parts.tables():
            if writer is None:
                writer = write(unfinished, table.schema)
                if path.suffix == ".csv":
                    about = json.dumps(_metadata(path.name, table.schema, layout.facts), indent=1)
                    path.with_name(path.name + METADATA).write_text(about, encoding="utf-8")
            writer.write_table(table)
        writer.close()
        os.replace(unfinished, path)
    except OSError as error:
        unfinished.unlink(missing_ok=True)
        raise SimulationError(f"cannot write {str(path)!r}: {error.strerror or error}") from None


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
    for n in ("status", "reason"):  # objects: of a fixed width, one long text would cost all runs
        data[n] = (dims, table[n].to_numpy().reshape(shape))
    if trajectories is not None:
        coords["time"] = ("time", times, {"units": "s"})
        for k, n in enumerate(layout.kept.trajectories):
            values = trajectories[:, :, k].reshape((*shape, len(times)))
            data[n] = ((*dims, "time"), values, {"units": layout.unit(n)})
    return xr.Dataset(data, coords, dict(layout.facts))
