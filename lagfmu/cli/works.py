"""What a study is given: FMUs as they are, and the scenes of model files, each to be built."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

from ..errors import LagfmuError
from ..model.file import ModelFile, load
from ..model.scene import Scene

Make = Callable[[], Path]


def works(
    paths: Sequence[Path], scenes: Sequence[str], build: Callable[[ModelFile, Scene], Path]
) -> Iterator[tuple[str, Make]]:
    """What is to be studied, by name, and what makes its FMU or raises LagfmuError; `scenes`: only these."""
    for path in paths:
        if path.suffix != ".py":
            yield str(path), partial(Path, path)
            continue
        try:
            file = load(path)
        except LagfmuError as error:
            yield str(path), partial(_refuse, error)
            continue
        for scene in file.scenes:
            if not scenes or scene.name in scenes:
                yield f"{path} ({scene.name})", partial(build, file, scene)


def _refuse(error: LagfmuError) -> Path:
    raise error
