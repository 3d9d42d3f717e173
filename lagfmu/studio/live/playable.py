"""A model in a scene, or an FMU with C sources -> what its live page is made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...errors import BuildError
from ...fmu.archive import entry, opened
from ...fmu.bundle import unbundled
from ...fmu.native import GENERATED, IDENTITY, sources_of
from ...fmu.read import read_description
from ...fmu.write import PAGE
from ...page import preset as presets
from ...page.documentation import mathml
from ...page.picture import IN_FMU, picture_of, read_picture
from ...page.typeset import typeset
from ...prepare.prepare import Prepared
from .facts import facts
from .markup import Section, equations_of, safe_mathml
from .render import Playable
from .wasm import compile_module


@dataclass(frozen=True)
class Told:
    """What an FMU, or a model that would become one, tells of itself without being run."""

    description: bytes
    equations: list[Section]
    picture: dict[str, Any] | None
    preset: dict[str, Any] | None
    sources: Mapping[str, bytes]


def told_by(target: Prepared | Path) -> Told:
    """What a model in a scene, or the FMU at a path, tells; every text of an FMU is taken as text.

    Raises BuildError for a file that is no FMU.
    """
    return _told_by_fmu(target) if isinstance(target, Path) else _told_by_prepared(target)


def playable(target: Prepared | Path) -> Playable:
    """The parts of the page in which the FMU runs.

    Raises BuildError without ziglang, and for an FMU that holds no C sources.
    """
    told = told_by(target)
    if not {*GENERATED} <= told.sources.keys():
        raise BuildError(
            f"{str(target)!r} holds no C sources of lagfmu, which a page is compiled from: build it with "
            "--target native, or make the page from the model file"
        )
    # the page's instance is its own: one GUID for all, so that the same equations are the same bytes
    sources = {**told.sources, "identity.h": IDENTITY.format(guid="{page}").encode()}
    found = facts(told.description, told.picture, told.preset)
    return Playable(found, told.equations, compile_module(found["name"], sources))


def _told_by_prepared(prepared: Prepared) -> Told:
    made = sources_of(prepared)
    sections: list[Section] = [
        (s.title, s.remark, [(e.label, safe_mathml(mathml(e.latex)), e.text) for e in s.equations])
        for s in typeset(prepared.form)
    ]
    preset = presets.preset_of(prepared)
    return Told(
        made.description, sections, picture_of(prepared), preset, {**made.runtime, **made.generated}
    )


def _told_by_fmu(path: Path) -> Told:
    read_description(path)  # that it is an FMU
    with opened(path) as archive:
        names = archive.namelist()
        carried = {
            Path(n).name: entry(archive, n)
            for n in names
            if n.startswith("sources/") and n.endswith((".c", ".h"))
        }
        page = entry(archive, PAGE) if PAGE in names else b""
        picture = read_picture(entry(archive, IN_FMU)) if IN_FMU in names else None
        own = presets.IN_FMU
        preset = presets.read_preset(entry(archive, own)) if own in names else None
        description = entry(archive, "modelDescription.xml")
        return Told(description, equations_of(page), picture, preset, unbundled(carried))
