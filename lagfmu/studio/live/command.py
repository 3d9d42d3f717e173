"""A model, a model file or an FMU -> its live page: as a file, or shown in a notebook."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

from ...files import write_whole
from ...model.file import fmu_at, in_scene
from ...model.model import Model
from ...model.scene import Scene
from ...prepare.prepare import prepare
from ...prepare.starts import check_given, tell
from .playable import playable
from .render import Playable, render

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
