"""Can it start?  Asked of the native library itself, by initializing it as it is described.

Whether frictions and contacts have one solution at the start (Painleve's paradox, no consistent mode) nothing
but the simulation's own code decides.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from ..errors import CannotStartError
from ..prepare.prepare import Prepared
from .session import RefusalError, Session


def check_start(prepared: Prepared, description: bytes, library: bytes, path: str) -> None:
    """Initialize an instance of `library`, that of this machine, whose place in the FMU is `path`.  Raises
    CannotStartError with its reason."""
    with tempfile.TemporaryDirectory(prefix="lagfmu_") as folder:
        lay_out(Path(folder), description, library, path)
        try:
            with Session(folder) as session:
                session.begin()
        except RefusalError as error:
            raise CannotStartError(prepared.model.name, [error.message], prepared) from error


def lay_out(folder: Path, description: bytes, library: bytes, path: str) -> None:
    """An FMU as it lies unpacked, of its description and a library alone."""
    (folder / "modelDescription.xml").write_bytes(description)
    place = folder / path
    place.parent.mkdir(parents=True)
    place.write_bytes(library)
