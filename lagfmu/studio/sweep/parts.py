"""What a sweep keeps of itself on disk: each finished chunk is a file; one that stopped goes on with them."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
import warnings
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import LagfmuWarning, SettingError, SimulationError

RECORD = "sweep.json"


class PartWarning(LagfmuWarning):
    """A finished chunk that cannot be used, and is done again."""


class Parts:
    """The finished chunks of a sweep, each a file: what a client that stops leaves behind."""

    def __init__(self, folder: Path | None, identity: Mapping[str, Any], resume: bool) -> None:
        self.temporary = folder is None
        self.folder = Path(tempfile.mkdtemp(prefix="lagfmu_")) if folder is None else folder
        record = self.folder / RECORD
        if folder is not None and self.folder.exists() and any(self.folder.iterdir()):
            try:
                found = json.loads(record.read_text(encoding="utf-8"))
                differ = sorted(k for k in identity if found.get(k) != identity[k])
            except (OSError, ValueError, AttributeError):
                raise SettingError(
                    f"{str(folder)!r} is not the folder of a sweep ({RECORD} is missing or damaged): choose "
                    "another --out"
                ) from None
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
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise SimulationError(f"cannot write {str(record)!r}: {error.strerror}") from None
        text = json.dumps(identity, indent=1)
        self._whole(RECORD, lambda path: path.write_text(text, encoding="utf-8"))

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
                if number not in design:
                    raise ValueError("the sweep has no such chunk")
                self._check(number, design[number], points)
            except (ValueError, KeyError, OSError, EOFError, zipfile.BadZipFile) as error:
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

            self._whole(self._place(number, "npz").name, save)
        name = self._place(number, "parquet").name
        self._whole(name, lambda path: pq.write_table(table, path, write_page_checksum=True))

    def _place(self, number: int, ending: str) -> Path:
        return self.folder / f"part_{number:08d}.{ending}"

    def _whole(self, name: str, write: Any) -> None:
        unfinished = self.folder / f"unfinished_{name}"
        try:
            write(unfinished)
            synchronize(unfinished)
            os.replace(unfinished, self.folder / name)
        except OSError as error:
            raise SimulationError(f"cannot write {str(self.folder / name)!r}: {error}") from None

    def _table(self, path: Path) -> Any:
        import pyarrow.parquet as pq

        return pq.read_table(path, page_checksum_verification=True)

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
        shutil.rmtree(self.folder, ignore_errors=True)


def synchronize(path: Path) -> None:
    """Wait until a file is on the disk, so that a name that it gets is never that of half of it."""
    with path.open("rb+") as file:
        os.fsync(file.fileno())
