"""What a study is given: FMUs as they are, and the scenes of model files, each to be built."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

from ..errors import LagfmuError, UsageError
from ..model.file import ModelFile, load
from ..model.scene import Scene
from ..verification.junit import Report, refused

Make = Callable[[], Path]


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
    for path in paths:
        for name, make in _works(path, scenes, build):
            try:
                done.append(study(name, make()))
            except LagfmuError as error:
                done.append(refused(name, error))
    if not done:
        raise UsageError(f"no FMU is called {', '.join(scenes) or 'anything'}")
    return done


def _works(
    path: Path, scenes: Sequence[str], build: Callable[[ModelFile, Scene], Path]
) -> Iterator[tuple[str, Make]]:
    """What is to be studied, by name, and what makes its FMU or raises LagfmuError."""
    if path.suffix != ".py":
        yield str(path), partial(Path, path)
        return
    try:
        file = load(path)
    except LagfmuError as error:
        yield str(path), partial(_refuse, error)
        return
    for scene in file.scenes:
        if not scenes or scene.name in scenes:
            yield f"{path} ({scene.name})", partial(build, file, scene)


def _refuse(error: LagfmuError) -> Path:
    raise error
