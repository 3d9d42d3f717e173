"""What is known about a model in a scene -> one FMU file, replaced whole and never half-written."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from ..errors import BuildError
from ..model.closed_form import ClosedForm, Conserved
from ..page.documentation import page
from ..prepare.prepare import Prepared
from . import native, python
from .claims import pack_closed_forms
from .compiler import HOST

TARGETS = ("python", "native")


def write(
    prepared: Prepared,
    out: str | os.PathLike[str] = ".",
    closed_forms: Sequence[ClosedForm | Conserved] = (),
    figures: Sequence[tuple[str, ...]] = (),
    target: str = "python",
    platforms: Sequence[str] = (HOST,),
    choice: str = "",
) -> Path:
    """Package what `prepare` made into the folder `out`, or to `out` itself if it ends in .fmu.

    `choice` is HTML on how the solver settings were chosen.  For the rest see make.build_fmu.
    """
    if target not in TARGETS:
        raise BuildError(f"target {target!r} is unknown, expected one of {', '.join(TARGETS)}")
    if target == "python":  # it has no model exchange
        prepared = replace(prepared, table=prepared.table.without_local_derivatives())
    extra = {
        "documentation/index.html": page(prepared, figures, choice).encode(),
        "resources/lagfmu.json": pack_closed_forms(
            prepared.scene, closed_forms, prepared.table, prepared.numbers, prepared.held
        ),
    }
    equations = (prepared.coded, prepared.coded_reduction)
    made = (*equations, prepared.scene, prepared.table, prepared.system, extra)
    content = native.build(*made, platforms) if target == "native" else python.build(*made)
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
