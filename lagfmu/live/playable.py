"""A model in a scene, or an FMU with C sources -> what its live page is made of."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import BuildError
from ..fmu.native import IDENTITY, sources_of
from ..page.documentation import mathml
from ..page.picture import IN_FMU, picture_of, read_picture
from ..page.typeset import typeset
from ..prepare.prepare import Prepared
from .facts import facts
from .markup import Section, equations_of, safe_mathml
from .render import Playable
from .wasm import compile_module


def of_prepared(prepared: Prepared) -> Playable:
    """The page's parts of a model in a scene.  Raises BuildError without ziglang."""
    made = sources_of(
        prepared.coded, prepared.coded_reduction, prepared.scene, prepared.table, prepared.system
    )
    sections: list[Section] = [
        (s.title, s.remark, [(e.label, safe_mathml(mathml(e.latex)), e.text) for e in s.equations])
        for s in typeset(prepared.equations, prepared.reduction, prepared.formulation)
    ]
    sources = {**made.runtime, **made.generated}
    return _playable(made.description, sections, sources, picture_of(prepared))


def of_fmu(path: Path) -> Playable:
    """The page's parts of an FMU; every text in it is taken as text.

    Raises BuildError for a file that is no FMU, or holds no C sources.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
            sources = {
                Path(n).name: archive.read(n)
                for n in names
                if n.startswith("sources/") and n.endswith((".c", ".h"))
            }
            description = archive.read("modelDescription.xml")
            documented = "documentation/index.html"
            page = archive.read(documented) if documented in names else b""
            picture = read_picture(archive.read(IN_FMU)) if IN_FMU in names else None
    except (zipfile.BadZipFile, KeyError, OSError) as error:
        raise BuildError(
            f"{str(path)!r} is no FMU, expected a zip archive with modelDescription.xml ({error})"
        ) from None
    if not {"model.c", "variables.c", "fmi2.c"} <= sources.keys():
        raise BuildError(
            f"{str(path)!r} holds no C sources of lagfmu, which a page is compiled from: build it with "
            "--target native, or make the page from the model file"
        )
    return _playable(description, equations_of(page), sources, picture)


def _playable(
    description: bytes,
    equations: list[Section],
    sources: Mapping[str, bytes],
    picture: dict[str, Any] | None,
) -> Playable:
    # the page's instance is its own: one GUID for all, so that the same equations are the same bytes
    sources = {**sources, "identity.h": IDENTITY.format(guid="{page}").encode()}
    found = facts(description, picture)
    module = compile_module(found["name"], sources)
    return Playable(found, equations, module)
