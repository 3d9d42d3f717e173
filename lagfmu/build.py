"""One model and one scene -> one FMU file.  Nothing is left half-written: a file is replaced whole."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from pathlib import Path

from .closed_form import ClosedForm, Conserved
from .compiler import HOST
from .documentation import page
from .errors import BuildError
from .fmu import native, python
from .model import Model
from .prepare import Prepared, prepare
from .proof import pack_closed_forms
from .scene import Scene

TARGETS = ("python", "native")


def build_fmu(
    model: Model,
    out: str | os.PathLike[str] = ".",
    scene: Scene | None = None,
    closed_forms: Sequence[ClosedForm | Conserved] = (),
    figures: Sequence[tuple[str, ...]] = (),
    target: str = "python",
    platforms: Sequence[str] = (HOST,),
) -> Path:
    """Build `model` as an FMU into the folder `out` (or to `out` itself if it ends in .fmu).

    `target` is 'python' or 'native'; a native FMU has binaries for `platforms`, see compiler.PLATFORMS.

    `closed_forms` travel in the FMU, so that `lagfmu verify` can hold it against them; `figures` are
    verification results for its documentation page.  Raises ModelError, DerivationError, BuildError.
    """
    return write(prepare(model, scene), out, closed_forms, figures, target, platforms)


def write(
    prepared: Prepared,
    out: str | os.PathLike[str] = ".",
    closed_forms: Sequence[ClosedForm | Conserved] = (),
    figures: Sequence[tuple[str, ...]] = (),
    target: str = "python",
    platforms: Sequence[str] = (HOST,),
    choice: str = "",
) -> Path:
    """Package what `prepare` made; `choice` is HTML on how the solver settings were chosen."""
    if target not in TARGETS:
        raise BuildError(f"target {target!r} is unknown, expected one of {', '.join(TARGETS)}")
    extra = {
        "documentation/index.html": page(prepared, figures, choice).encode(),
        "resources/lagfmu.json": pack_closed_forms(prepared.scene, closed_forms, prepared.table),
    }
    made = (prepared.equations, prepared.reduction, prepared.scene, prepared.table)
    if target == "native":
        content = native.build(*made, prepared.system, extra, platforms)
    else:
        content = python.build(*made, extra)
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
