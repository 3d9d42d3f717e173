"""One door for files that others wrote, and one for those that are written here."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import os
import re
import shutil
import stat
import tempfile
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from .errors import BuildError, LagfmuError, remedy_of

Write = Callable[[Path], object]
MOST, BATCH = 4 * 10**9, 4096  # bytes of a table, rows that are read at a time
ELEMENTS = 2_000_000  # of XML
PARTS = 20  # of a dotted key
LINE = 10_000_000  # letters of a line of CSV
BITS = 1023  # of an integer
DOTTED = re.compile(  # as many parts of a key of TOML; tomllib's time goes with their square
    rf"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){{{PARTS}}}"""
)


@contextlib.contextmanager
def foreign(refused: Callable[[str], LagfmuError]) -> Iterator[None]:
    """Where a library reads what others wrote: whatever it raises is `refused` with what it says."""
    try:
        yield
    except (LagfmuError, NameError, ImportError):
        raise
    except RecursionError:
        raise refused("it is nested too deeply") from None
    except MemoryError:
        raise refused("it needs more memory than there is") from None
    except OSError as error:
        raise refused(error.strerror or str(error)) from None
    except Exception as error:
        raise refused(" ".join(str(error).split()) or type(error).__name__) from None


def content_of(path: Path, most: int) -> bytes:
    """All of a file.  Raises OSError, and ValueError for one of more than `most` bytes, or without an end."""
    with path.open("rb") as file:
        found = file.read(most + 1)
    if len(found) > most:
        raise ValueError(f"it has more than {most} bytes")
    return found


def toml_of(content: bytes) -> dict[str, Any]:
    """A TOML file.  Raises ValueError or RecursionError."""
    text = content.decode("utf-8-sig")
    if long := DOTTED.search(text):
        line = text.count("\n", 0, long.start()) + 1
        raise ValueError(f"a key in line {line} has more than {PARTS} parts")
    found = tomllib.loads(text)
    _check(found)
    return found


def json_of(content: bytes | str) -> Any:
    """A JSON file.  Raises ValueError or RecursionError."""
    found = json.loads(content)
    _check(found)
    return found


def _check(value: Any) -> None:
    """Integers are what a double can be, too."""
    if isinstance(value, (dict, list)):
        for part in value.values() if isinstance(value, dict) else value:
            _check(part)
    elif isinstance(value, int) and value.bit_length() > BITS:
        raise ValueError(
            f"an integer of {value.bit_length()} bits, expected a number in double precision"
        )


def xml_of(content: bytes) -> Any:
    """The root of an XML file, of which no entity is expanded and nothing else opened.  Raises ValueError."""
    from lxml import etree

    if (count := content.count(b"<")) > ELEMENTS:
        raise ValueError(f"it has {count} elements, expected at most {ELEMENTS}: leave out some")
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False)
    try:
        root = etree.fromstring(content, parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        said = " ".join(str(error).replace(" (<string>,", " (").split())
        raise ValueError(f"it is no XML: {said}: correct it there") from None
    if root.getroottree().docinfo.doctype:
        raise ValueError(
            "it has a DOCTYPE, whose entities are not expanded: write out what they stand for"
        )
    return root


def csv_of(content: bytes) -> Iterator[list[str]]:
    """The rows of a CSV file that are not empty.  Raises ValueError or csv.Error."""
    lines = io.TextIOWrapper(io.BytesIO(content), encoding="utf-8-sig", newline="")
    return filter(None, csv.reader(map(_short, lines), skipinitialspace=True))


def _short(line: str) -> str:
    if len(line) > LINE:
        raise ValueError(f"a line has {len(line)} letters, expected at most {LINE}")
    return line


def parquet_of(path: Path, **options: Any) -> Any:
    """An Arrow table, of a file that others wrote: of no more than MOST bytes, packed though it may be."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    with pq.ParquetFile(path, **options) as file:
        count = file.metadata.num_rows * file.metadata.num_columns
        if count * 8 > MOST:
            raise ValueError(f"it says to have {count} numbers, expected at most {MOST // 8}")
        found: list[Any] = []
        size = 0
        for batch in file.iter_batches(BATCH):
            size += batch.nbytes
            if size > MOST:
                raise ValueError(f"it has more than {MOST} bytes, unpacked")
            found.append(batch)
        return pa.Table.from_batches(found, file.schema_arrow)


def write_whole(path: Path, content: bytes | Write) -> None:
    """Write a file at once, or leave what was there; `content` may be a function that writes a file, or a
    folder, to the path which it gets.  A device or a pipe is written to as it is.

    Two that write one file at a time leave that of one of them.  Raises BuildError with the cause.
    """
    write: Write = (
        (lambda place: place.write_bytes(content)) if isinstance(content, bytes) else content
    )
    path = Path(os.path.realpath(path)) if path.is_symlink() else path
    try:
        if path.exists() and not path.is_file() and not path.is_dir():
            write(path)
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        with _room_beside(path) as folder:
            made = Path(folder, path.name)
            write(made)
            if made.is_file():
                _synchronize(made)
                with contextlib.suppress(FileNotFoundError):
                    made.chmod(stat.S_IMODE(path.stat().st_mode))
            elif path.is_dir():
                path.rename(Path(folder, f"{path.name}.old"))
            made.replace(path)
    except OSError as error:
        there = path.is_dir() and error.errno is not None
        remedy = "a folder of that name is there" if there else remedy_of(error)
        remedy = remedy or "choose another output folder"
        raise BuildError(
            f"cannot write {str(path)!r} ({error.strerror or error}): {remedy}"
        ) from None


@contextlib.contextmanager
def _room_beside(path: Path) -> Iterator[str]:
    folder = tempfile.mkdtemp(dir=path.parent, prefix=".lagfmu_")
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        with contextlib.suppress(OSError):  # where no more files may be opened
            os.rmdir(folder)


def _synchronize(path: Path) -> None:
    """Wait until a file is on the disk, so that a name that it gets is never that of half of it."""
    with path.open("rb+") as file:
        os.fsync(file.fileno())
