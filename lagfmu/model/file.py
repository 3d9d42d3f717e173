"""Loading a model file: one Model, its scenes and closed forms."""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from ..errors import LagfmuError, ModelError, SettingError
from .closed_form import ClosedForm, Conserved
from .family import made
from .model import Model
from .scene import Scene
from .times import foreign_times

# Files that are a model by themselves, by their ending: the module whose read(path, arguments) makes a Model,
# and whose PYTHON is the file that `new` writes of it.
READERS = {".urdf": "lagfmu.bodies.urdf_model", ".xml": "lagfmu.bodies.mjcf_model"}


def is_model(path: str | os.PathLike[str]) -> bool:
    """Whether a file is one that load() reads, by its ending."""
    return Path(path).suffix.lower() in (".py", *READERS)


@dataclass(frozen=True)
class ModelFile:
    """What a model file defines: a Model; `scenes` (default: one, named as the model), closed forms."""

    path: Path
    model: Model
    scenes: tuple[Scene, ...]
    closed_forms: tuple[ClosedForm | Conserved, ...]

    def called(self, names: Sequence[str] | str | None) -> list[Scene]:
        """The scenes that are called so; all of them without names.  Raises SettingError."""
        names = [names] if isinstance(names, str) else names
        known = [s.name for s in self.scenes]
        unknown = ", ".join(repr(n) for n in names or [] if n not in known)
        if unknown:
            raise SettingError(
                f"{self.path}: no FMU is called {unknown}; known: {', '.join(known)}"
            )
        return [s for s in self.scenes if names is None or s.name in names]


class Chosen(NamedTuple):
    """A model in one of its scenes, with the closed forms of its file."""

    model: Model
    scene: Scene
    closed_forms: tuple[ClosedForm | Conserved, ...] = ()


def in_scene(source: Model | str | os.PathLike[str], scene: Scene | str | None = None) -> Chosen:
    """A Model, or a model file, in `scene`; of a file also by its name, else its first.

    Raises SettingError for a name that no scene has, and ModelError as load().
    """
    if isinstance(source, Model):
        if isinstance(scene, str):
            raise SettingError(
                f"scene {scene!r}: only the scenes of a model file have names; of the model {source.name!r} "
                "give a Scene(...)"
            )
        return Chosen(source, scene or Scene(source.name))
    file = load(source)
    chosen = scene if isinstance(scene, Scene) else file.called(scene)[0]
    return Chosen(file.model, chosen, file.closed_forms)


def fmu_at(source: Model | str | os.PathLike[str], scene: Scene | str | None = None) -> Path | None:
    """The path, unless it is that of a model file.  Raises SettingError for a scene of an FMU."""
    if isinstance(source, Model) or is_model(source):
        return None
    if scene is not None:
        raise SettingError(
            f"scene {scene!r} is for a model file: {str(source)!r} is an FMU, built for its scene"
        )
    return Path(source)


def load(path: str | os.PathLike[str], arguments: Sequence[str] = ()) -> ModelFile:
    """Run a model file and take its model; with `arguments`, NAME=VALUE, that which its function `family`
    makes of them (family.py).  A file of another kind is read by its reader, and nothing in it is run.

    Raises ModelError if the file is missing, raises, or does not define exactly one Model.
    """
    file = Path(path)
    if file.is_dir():
        inside = ", ".join(str(p) for p in sorted(file.glob("*.py"))) or "none"
        raise ModelError(
            str(file), [f"this is a folder, expected a Python file; those in it: {inside}"]
        )
    if not file.is_file():
        raise ModelError(str(file), ["there is no such file"])
    if (reader := READERS.get(file.suffix.lower())) is not None:
        return _taken(file, importlib.import_module(reader).read(file, arguments), {})
    spec = importlib.util.spec_from_file_location(f"_lagfmu_model_{file.stem}", file)
    if spec is None or spec.loader is None:
        others = "".join(f", or NAME{ending}" for ending in READERS)
        raise ModelError(
            str(file), [f"expected a Python file that defines a Model, NAME.py{others}"]
        )
    module = importlib.util.module_from_spec(spec)
    folder = str(file.resolve().parent)
    sys.path.insert(0, folder)
    try:
        spec.loader.exec_module(module)
    except LagfmuError:
        raise
    except (Exception, SystemExit) as error:
        raise ModelError(str(file), [_where(error, file.absolute())]) from error
    finally:
        sys.path.remove(folder)
    wrong = foreign_times(file.read_bytes(), vars(module))
    if wrong:
        raise ModelError(str(file), wrong)
    if arguments:
        found = made(str(file), module, arguments, lambda error: _where(error, file.absolute()))
        return _taken(file, found["model"], found)
    models = {id(v): (k, v) for k, v in vars(module).items() if isinstance(v, Model)}
    if len(models) != 1:
        names = ", ".join(k for k, _ in models.values()) or "none"
        raise ModelError(
            str(file),
            [f"the file defines {len(models)} models ({names}), expected one: model = Model(...)"],
        )
    ((_, model),) = models.values()
    return _taken(file, model, vars(module))


def _taken(file: Path, model: Model, names: Mapping[str, Any]) -> ModelFile:
    """The model with the scenes and closed forms among the names beside it."""
    problems: list[str] = []
    scenes = _listed(names, "scenes", (Scene,), problems) or (Scene(model.name),)
    forms = _listed(names, "closed_forms", (ClosedForm, Conserved), problems)
    titles = [s.name for s in scenes if isinstance(s, Scene)]
    problems += [
        f"scenes hold the name {name!r} twice, so that one FMU would replace the other: rename one"
        for name in sorted({n for n in titles if titles.count(n) > 1})
    ]
    folded = [title.casefold() for title in dict.fromkeys(titles)]
    problems += [
        f"scenes hold names that differ by capitals alone ("
        f"{', '.join(sorted(t for t in set(titles) if t.casefold() == name))}), so that one FMU would "
        "replace the other on Windows and macOS: rename one"
        for name in sorted({n for n in folded if folded.count(n) > 1})
    ]
    if problems:
        raise ModelError(str(file), problems)
    return ModelFile(file, model, scenes, forms)


def _listed(
    names: Mapping[str, Any], name: str, types: tuple[type, ...], problems: list[str]
) -> tuple[Any, ...]:
    """The file's list of that name; what is no list, or stands in it wrongly, is a problem."""
    found = names.get(name, ())
    expected = f"expected a list of {types[0].__name__}(...)"
    if not isinstance(found, (list, tuple)):
        problems.append(f"{name} = {found!r}, {expected}")
        return ()
    problems += [f"{name} hold {x!r}, {expected}" for x in found if not isinstance(x, types)]
    return tuple(found)


def _where(error: BaseException, file: Path) -> str:
    """The file's own line at which it raised, and what it raised."""
    if isinstance(error, SyntaxError):
        place = f"line {error.lineno}: " if error.lineno else ""
        if error.filename and error.filename != str(file):
            place = f"{error.filename}, {place}"
        return f"{place}syntax error, {error.msg}"
    frames = [f for f in traceback.extract_tb(error.__traceback__) if f.filename == str(file)]
    place = f"line {frames[-1].lineno} ({frames[-1].line}): " if frames else ""
    return f"{place}raises {type(error).__name__}: {error}"
