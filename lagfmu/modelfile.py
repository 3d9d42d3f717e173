"""Loading a model file: one Model, its scenes and closed forms."""

from __future__ import annotations

import importlib.util
import os
import sys
import traceback
from dataclasses import dataclass
from pathlib import Path

from .closed_form import ClosedForm, Conserved
from .errors import LagfmuError, ModelError
from .model import Model
from .scene import Scene


@dataclass(frozen=True)
class ModelFile:
    """What a model file defines: a Model; `scenes` (default: one, named as the model), closed forms."""

    path: Path
    model: Model
    scenes: tuple[Scene, ...]
    closed_forms: tuple[ClosedForm | Conserved, ...]


def load(path: str | os.PathLike[str]) -> ModelFile:
    """Run a model file and take its model.

    Raises ModelError if the file is missing, raises, or does not define exactly one Model.
    """
    file = Path(path)
    if not file.is_file():
        raise ModelError(str(file), ["there is no such file"])
    spec = importlib.util.spec_from_file_location(f"_lagfmu_model_{file.stem}", file)
    if spec is None or spec.loader is None:
        raise ModelError(str(file), ["expected a Python file that defines a Model, NAME.py"])
    module = importlib.util.module_from_spec(spec)
    folder = str(file.resolve().parent)
    sys.path.insert(0, folder)
    try:
        spec.loader.exec_module(module)
    except LagfmuError:
        raise
    except Exception as error:
        raise ModelError(str(file), [_where(error, file)]) from error
    finally:
        sys.path.remove(folder)
    models = {id(v): (k, v) for k, v in vars(module).items() if isinstance(v, Model)}
    if len(models) != 1:
        names = ", ".join(k for k, _ in models.values()) or "none"
        raise ModelError(
            str(file),
            [f"the file defines {len(models)} models ({names}), expected one: model = Model(...)"],
        )
    ((_, model),) = models.values()
    scenes = tuple(getattr(module, "scenes", ())) or (Scene(model.name),)
    forms = tuple(getattr(module, "closed_forms", ()))
    return ModelFile(file, model, scenes, forms)


def _where(error: Exception, file: Path) -> str:
    """The file's own line at which it raised, and what it raised."""
    if isinstance(error, SyntaxError):
        return f"line {error.lineno}: syntax error, {error.msg}"
    frames = [f for f in traceback.extract_tb(error.__traceback__) if f.filename == str(file)]
    place = f"line {frames[-1].lineno} ({frames[-1].line}): " if frames else ""
    return f"{place}raises {type(error).__name__}: {error}"
