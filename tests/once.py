"""What several test processes need is made by one of them, and the others take it."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path


@contextlib.contextmanager
def _alone(file: Path) -> Iterator[None]:
    """One process at a time; the lock of one that dies is free."""
    try:
        import fcntl
    except ImportError:  # Windows: what is made twice is the same twice
        yield
        return
    with file.open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def once(place: Path, make: Callable[[Path], object]) -> Path:
    """The folder `place`, filled by make(folder) in the first process that asks for it."""
    if not place.is_dir():
        place.parent.mkdir(parents=True, exist_ok=True)
        with _alone(place.parent / f".{place.name}.lock"):
            if not place.is_dir():
                with tempfile.TemporaryDirectory(dir=place.parent) as folder:
                    made = Path(folder, "made")
                    made.mkdir()
                    make(made)
                    with contextlib.suppress(OSError):  # without a lock: another was faster
                        made.rename(place)
    return place
