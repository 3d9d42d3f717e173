"""A model file or an FMU -> the file of its live page."""

from __future__ import annotations

from pathlib import Path

from ..fmu.write import write_whole
from ..model.file import load
from ..model.scene import Scene
from ..prepare.prepare import prepare
from .playable import playable
from .render import Playable, render

FOLDER = Path("dist/page")


def write_page(target: Path, out: Path | None = None, scene: Scene | None = None) -> Path:
    """Write the page of a model file (in `scene`, default: its first) or of a native FMU.

    `out` is the HTML file, by default dist/page/NAME.html.  Raises ModelError, DerivationError,
    VerificationError for a file that is no FMU, and BuildError where nothing can be compiled.
    """
    made = _playable(target, scene)
    path = out or FOLDER / f"{made.name}.html"
    write_whole(path, render(made).encode())
    return path


def _playable(target: Path, scene: Scene | None) -> Playable:
    if target.suffix != ".py":
        return playable(target)
    file = load(target)
    return playable(prepare(file.model, scene or file.scenes[0]))
