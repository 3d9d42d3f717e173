"""What a study is given: FMUs as they are, and the scenes of model files, each to be built."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from ..errors import LagfmuError, UsageError
from ..model.file import ModelFile, is_model, load
from ..model.scene import Scene
from ..verification.junit import Report, refused


def studied(
    paths: Sequence[Path],
    scenes: Sequence[str],
    build: Callable[[ModelFile, Scene], Path],
    study: Callable[[str, Path], Report],
) -> list[Report]:
    """What came of `study` of each FMU, given what it is called; `scenes`: only these of model files.

    What cannot be built or run does not keep the others from it.  Raises UsageError.
    """
    done = []

    def tried(name: str, make: Callable[[], Path]) -> None:
        try:
            done.append(study(name, make()))
        except LagfmuError as error:
            done.append(refused(name, error))

    for path in paths:
        if not is_model(path):
            tried(str(path), partial(Path, path))
            continue
        try:
            file = load(path)
        except LagfmuError as error:
            done.append(refused(str(path), error))
            continue
        for scene in file.scenes:
            if not scenes or scene.name in scenes:
                tried(f"{path} ({scene.name})", partial(build, file, scene))
    if not done:
        raise UsageError(f"no FMU is called {', '.join(scenes) or 'anything'}")
    return done
