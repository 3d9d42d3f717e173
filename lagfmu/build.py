"""What is known about a model in a scene -> one FMU file, replaced whole and never half-written."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from .closed_form import ClosedForm, Conserved
from .compiler import HOST
from .documentation import page
from .errors import BuildError
from .fmu import native, python
from .prepare import Prepared
from .proof import pack_closed_forms
from .starts import check_given, tell

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

    `choice` is HTML on how the solver settings were chosen.  For the rest see make.build_fmu.  Warns of
    each start value that is moved onto the constraints.  Raises ModelError if one in the model's `start`
    moves by more than 1e-6 of its coordinate's size.
    """
    if target not in TARGETS:
        raise BuildError(f"target {target!r} is unknown, expected one of {', '.join(TARGETS)}")
    if target == "python":  # it has no model exchange
        prepared = replace(prepared, table=prepared.table.without_local_derivatives())
    check_given(prepared.model.name, prepared.structure.start.moved)
    tell(prepared.structure.start.moved)
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
