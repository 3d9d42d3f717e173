"""A model in a scene, an FMU with C sources, or a run that was computed elsewhere -> its live page."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import BuildError
from ...files import write_whole
from ...fmu.archive import entry, opened, unbundled
from ...fmu.compiler import WASM, compile_libraries, find_compiler
from ...fmu.native import ALL, GENERATED, IDENTITY, sources_of
from ...fmu.read import read_description
from ...fmu.write import PAGE
from ...model.file import fmu_at, in_scene
from ...model.model import Model
from ...model.scene import Scene
from ...page.documentation import mathml
from ...page.picture import PICTURE, PRESET, picture_of, preset_of, read_picture, read_preset
from ...page.typeset import typeset
from ...prepare.prepare import prepare
from ...prepare.starts import check_given, tell
from ...prepare.steps import Prepared
from .page import Playable, Section, equations_of, facts, render, safe_mathml

IMPORTER = "importer.c"


def _compile_module(name: str, sources: Mapping[str, bytes]) -> bytes:
    """The module of `sources` (file name -> text, as below sources/ of a native FMU).

    It imports nothing and exports what web/importer.c marks.  Of the runtime there are a few, by what a
    scene needs: each is compiled once.  Raises BuildError without ziglang, or with the compiler's first
    error.
    """
    compiler = find_compiler()
    if compiler is None or not compiler.cross:
        raise BuildError(
            "a page needs ziglang, which compiles the FMU's C sources to WebAssembly, and it is not "
            "installed: pip install ziglang"
        )
    own = {file: text for file, text in sources.items() if file in GENERATED}
    runtime = {file: text for file, text in sources.items() if file not in own and file != ALL}
    own[IMPORTER] = files("lagfmu").joinpath("studio/live/web", IMPORTER).read_bytes()
    return compile_libraries(name, own, runtime, [WASM])[WASM.folder]


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
    return Playable(found, told.equations, _compile_module(found["name"], sources))


def _told_by_prepared(prepared: Prepared) -> Told:
    made = sources_of(prepared)
    sections: list[Section] = [
        (s.title, s.remark, [(e.label, safe_mathml(mathml(e.latex)), e.text) for e in s.equations])
        for s in typeset(prepared.form)
    ]
    preset = preset_of(prepared)
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
        picture = read_picture(entry(archive, PICTURE)) if PICTURE in names else None
        own = PRESET
        preset = read_preset(entry(archive, own)) if own in names else None
        description = entry(archive, "modelDescription.xml")
        return Told(description, equations_of(page), picture, preset, unbundled(carried))


def recorded(told: Told, run: Any, given: Mapping[str, Any], more: Sequence[Any] = ()) -> Playable:
    """The page's parts with `run`, a structured array of time [s] and outputs: those of which it tells.

    `given` are the parameters and start values that were set; `more`: further runs of as many rows.
    """
    found = facts(told.description, told.picture, told.preset)
    found["variables"] = [
        v for v in found["variables"] if not v["column"] or v["name"] in run.dtype.names
    ]
    for v in found["variables"]:
        if v["name"] in given and v["type"] != "String":
            v["start"] = float(given[v["name"]])
    names = ["time", *(v["name"] for v in found["variables"] if v["column"])]
    told_of = {v["name"] for v in found["variables"]}
    for key in ("curves", "sliders"):
        found["preset"][key] = [n for n in found["preset"][key] if n in told_of]
    numbers = [np.asarray(one[n], dtype="<f8") for one in (run, *more) for n in names]
    return Playable(found, told.equations, recording=np.stack(numbers).tobytes())


FOLDER = Path("dist/page")
HEIGHT = 900  # CSS pixels of a page in a notebook


@dataclass(frozen=True)
class Played:
    """A live page that a notebook shows inline; `write` makes a file of it."""

    name: str
    text: str = field(repr=False)
    height: int = HEIGHT

    def _repr_html_(self) -> str:
        return (
            f'<iframe title="{escape(self.name)}: the page in which the FMU runs" '
            f'style="width: 100%; height: {self.height}px; border: 0" srcdoc="{escape(self.text)}"></iframe>'
        )

    def write(self, path: str | os.PathLike[str]) -> Path:
        """The page as an HTML file for a browser; in a folder it is called NAME.html."""
        file = Path(path)
        if file.is_dir():
            file /= f"{self.name}.html"
        write_whole(file, self.text.encode())
        return file


def play(
    target: Model | str | os.PathLike[str], scene: Scene | str | None = None, height: int = HEIGHT
) -> Played:
    """The page in which the FMU of a model, a model file or a native FMU runs; a notebook shows it, `height`
    pixels high.

    Raises ModelError, DerivationError, and BuildError where nothing can be compiled (ziglang).
    """
    made = _playable(target, scene)
    return Played(made.name, render(made), height)


def write_page(
    target: Model | Path, out: Path | None = None, scene: Scene | str | None = None
) -> Path:
    """Write the page of a model or a model file (in `scene`, default: its first) or of a native FMU.

    `out` is the HTML file, or a folder for it, by default dist/page/NAME.html.

    Raises ModelError, DerivationError, VerificationError for a file that is no FMU, and BuildError where
    nothing can be compiled.
    """
    page = play(target, scene)
    return page.write(out or FOLDER / f"{page.name}.html")


def _playable(target: Model | str | os.PathLike[str], scene: Scene | str | None) -> Playable:
    if (path := fmu_at(target, scene)) is not None:
        return playable(path)
    chosen = in_scene(target, scene)
    prepared = prepare(chosen.model, chosen.scene)
    moved = prepared.structure.start.moved
    check_given(chosen.model.name, moved, prepared.structure.missed)
    tell(moved)
    return playable(prepared)
