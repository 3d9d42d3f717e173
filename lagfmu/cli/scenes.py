"""The model files that a command names: loaded, and their scenes with what the command line says of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..errors import UsageError
from ..model.file import ModelFile, load
from ..model.formula import with_outputs
from ..model.scene import Scene
from ..model.selection import listed
from .options import LISTS, Names, Needs


def loaded(path: Path, added: Names, arguments: Names = None) -> ModelFile:
    """A model file, with further outputs; of a family the one of these arguments."""
    file = load(path, arguments or ())
    return replace(file, model=with_outputs(file.model, added or []))


def for_models(path: Path, **options: Any) -> None:
    """Refuse options that an FMU has no use for.  Raises UsageError with those that were given."""
    given = [n for n, value in options.items() if value is not None]
    if given:
        said = " and ".join(f"--{n.replace('_', '-')}" if len(n) > 1 else f"-{n}" for n in given)
        raise UsageError(
            f"{said}: for model files; {path} is an FMU, one scene that is built already"
        )


def narrowed(scenes: Sequence[Scene], needs: Needs) -> list[Scene]:
    """The scenes with what was said on the command line; what was not said stays.

    Raises UsageError if one name is given to several, and RequestError for a scene that cannot be.
    """
    name = needs.get("name")
    if name is not None and len(scenes) > 1:
        raise UsageError(
            f"--name {name}: the file has {len(scenes)} FMUs, choose one of them with --scene: "
            f"{', '.join(s.name for s in scenes)}"
        )
    said = {k: v for k, v in needs.items() if v is not None}
    said |= {
        k: tuple(name for text in said[k] for name in listed(text)) for k in LISTS if k in said
    }
    return [replace(s, **said) for s in scenes]
