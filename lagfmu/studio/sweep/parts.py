"""What a sweep keeps of itself on disk: each finished chunk is a file; one that stopped goes on with them."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
import warnings
import weakref
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import LagfmuWarning, SettingError
from ...files import content_of, foreign, json_of, parquet_of, write_whole

RECORD, LARGEST = "sweep.json", 1_000_000  # bytes


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
                found = json_of(content_of(record, LARGEST))
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
