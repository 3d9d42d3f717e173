"""A model and a scene -> one FMU file, with solver settings that are measured if an accuracy is asked for."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from .fmu.compiler import HOST
from .fmu.write import write
from .model.closed_form import ClosedForm, Conserved
from .model.model import Model
from .model.scene import Scene
from .prepare.prepare import prepare
from .study.tradeoff.choose import choose
from .study.tradeoff.goal import parse
from .study.tradeoff.page import section


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
    A scene with an `accuracy` takes half a minute more: its settings and formulation are measured.

    `closed_forms` travel in the FMU, so that `lagfmu verify` can hold it against them; `figures` are
    verification results for its documentation page.  Raises ModelError, DerivationError, BuildError.
    """
    scene, choice = settled(model, scene or Scene(model.name), closed_forms, target)
    return write(prepare(model, scene), out, closed_forms, figures, target, platforms, choice)


def settled(
    model: Model, scene: Scene, closed_forms: Sequence[ClosedForm | Conserved], target: str
) -> tuple[Scene, str]:
    """The scene with the settings that hold its accuracy, and HTML on how they were chosen."""
    if scene.accuracy is None:
        return scene, ""
    chosen = choose(model, scene, closed_forms, parse(scene.accuracy), target=target)
    return chosen.scene, section(chosen)
