"""One model and one scene -> one FMU file.  Nothing is left half-written: a file is replaced whole."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from pathlib import Path

from .closed_form import ClosedForm, Conserved
from .documentation import page
from .errors import BuildError
from .fmu import python
from .model import Model
from .prepare import Prepared, prepare
from .proof import pack_closed_forms
from .scene import Scene


def build_fmu(
    model: Model,
    out: str | os.PathLike[str] = ".",
    scene: Scene | None = None,
    closed_forms: Sequence[ClosedForm | Conserved] = (),
    figures: Sequence[tuple[str, ...]] = (),
) -> Path:
    """Build `model` as an FMU into the folder `out` (or to `out` itself if it ends in .fmu).

    `closed_forms` travel in the FMU, so that `lagfmu verify` can hold it against them; `figures` are
    verification results for its documentation page.  Raises ModelError, DerivationError, BuildError.
    """
    return write(prepare(model, scene), out, closed_forms, figures)


def write(
    prepared: Prepared,
    out: str | os.PathLike[str] = ".",
    closed_forms: Sequence[ClosedForm | Conserved] = (),
    figures: Sequence[tuple[str, ...]] = (),
) -> Path:
    """Package what `prepare` made."""
    extra = {
        "documentation/index.html": page(prepared, figures).encode(),
        "resources/lagfmu.json": pack_closed_forms(prepared.scene, closed_forms, prepared.table),
    }
    content = python.build(
        prepared.equations, prepared.reduction, prepared.scene, prepared.table, extra
    )
    path = Path(out)
    if path.suffix != ".fmu":
        path = path / f"{prepared.scene.name}.fmu"
    write_whole(path, content)
    return path


def write_whole(path: Path, content: bytes) -> None:
    """Write a file at once, or leave what was there.  Raises BuildError with the cause."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    except OSError as error:
        raise BuildError(
            f"cannot write {str(path)!r} ({error.strerror or error}): choose another output folder"
        ) from None
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.chmod(name, 0o644)
        os.replace(name, path)
    except OSError as error:
        Path(name).unlink(missing_ok=True)
        raise BuildError(
            f"cannot write {str(path)!r} ({error.strerror or error}): choose another output folder"
        ) from None
