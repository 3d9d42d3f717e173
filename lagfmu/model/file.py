"""Loading a model file: one Model, its scenes and closed forms.

Families of models: a file whose function `family` makes a model from arguments.

    def family(n=4, length=0.25):
        return model, scenes, closed_forms          # or the model alone

Each argument has a default, which says of what type it is; `lagfmu build FILE.py -p n=8` gives another.
"""

from __future__ import annotations

import ast
import importlib
import importlib.util
import inspect
import os
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import sympy as sp
from sympy.core.function import AppliedUndef

from ..errors import LagfmuError, ModelError, RequestError, SettingError
from .closed_form import ClosedForm, Conserved
from .elements import TIME
from .model import Model
from .scene import Scene


def _foreign_times(text: bytes, names: Mapping[str, Any]) -> list[str]:
    """Each X.diff(S), diff(X, S), Derivative(X, S) of the file that is 0; `names`: what its names are."""
    found = []
    for node in ast.walk(ast.parse(text)):
        if not isinstance(node, ast.Call):
            continue
        if isinstance(node.func, ast.Attribute) and node.func.attr == "diff":
            what, *by = node.func.value, *node.args
        elif (
            isinstance(node.func, ast.Name) and node.func.id in ("diff", "Derivative") and node.args
        ):
            what, *by = node.args
        else:
            continue
        moving = names.get(what.id) if isinstance(what, ast.Name) else None
        if not isinstance(moving, AppliedUndef) or not moving.has(TIME):
            continue
        for one in by:
            other = names.get(one.id) if isinstance(one, ast.Name) else None
            if isinstance(other, sp.Symbol) and not moving.has(other):
                found.append(
                    f"line {node.lineno}: {ast.unparse(node)} is 0, since the time of {moving.func} is "
                    f"dynamicsymbols._t and {one.id} is another symbol: write {moving.func}.diff()"  # type: ignore[attr-defined]
                )
    return found


FUNCTION = "family"
HINT = f"def {FUNCTION}(n=4): ... return model, scenes, closed_forms"
TRUE, FALSE = ("true", "yes", "1"), ("false", "no", "0")


def _made(
    file: str, module: ModuleType, given: Sequence[str], raised: Callable[[BaseException], str]
) -> dict[str, Any]:
    """What the family of a file's module makes of NAME=VALUE texts: `model`, `scenes`, `closed_forms`.

    `raised` says in words what an exception of the function was.  Raises RequestError for arguments that the
    function does not take, ModelError for what it returns or raises.
    """
    function = getattr(module, FUNCTION, None)
    if not inspect.isfunction(function):
        missing = f"-p {' -p '.join(given)}: the file has no function '{FUNCTION}', expected {HINT}"
        raise RequestError(file, [missing])
    arguments, problems = _arguments(inspect.signature(function), given)
    if problems:
        raise RequestError(file, problems)
    try:
        found = function(**arguments)
    except (Exception, SystemExit) as error:
        raise ModelError(file, [raised(error)]) from error
    parts = found if isinstance(found, tuple) else (found,)
    if not 1 <= len(parts) <= 3 or not isinstance(parts[0], Model):
        expected = f"expected a Model, or {HINT.split('return ')[1]}"
        raise ModelError(file, [f"{FUNCTION}() returns {found!r}, {expected}"])
    return dict(zip(("model", "scenes", "closed_forms"), parts, strict=False))


def _arguments(
    signature: inspect.Signature, given: Sequence[str]
) -> tuple[dict[str, Any], list[str]]:
    known = signature.parameters
    problems = [
        f"{FUNCTION}({signature_text}): the argument {name!r} has no default, expected one: {HINT}"
        for signature_text in (_told(signature),)
        for name, one in known.items()
        if one.default is inspect.Parameter.empty
    ]
    values: dict[str, Any] = {}
    for text in given:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not equals:
            problems.append(f"-p {text}: expected NAME=VALUE, e.g. -p n=8")
        elif name not in known:
            problems.append(
                f"-p {text}: {FUNCTION} has no argument {name!r}, only {_told(signature) or 'none'}"
            )
        elif name in values:
            problems.append(f"-p {text}: {name!r} is given twice")
        elif known[name].default is not inspect.Parameter.empty:
            try:
                values[name] = _read(value, known[name].default)
            except ValueError:
                default = known[name].default
                problems.append(
                    f"-p {text}: expected {_kind(default)} as the default {default!r} is, got {value!r}"
                )
    return values, problems


def _told(signature: inspect.Signature) -> str:
    return ", ".join(str(p) for p in signature.parameters.values())


def _kind(default: Any) -> str:
    kinds = {bool: "true or false", int: "an integer", float: "a number"}
    return kinds.get(type(default), "text")


def _read(value: str, default: Any) -> Any:
    """The text as a value of the default's type; ValueError if it is none."""
    if isinstance(default, bool):
        if value.lower() not in TRUE + FALSE:
            raise ValueError(value)
        return value.lower() in TRUE
    return type(default)(value) if isinstance(default, int | float) else value


# Files that are a model by themselves, by their ending: the module whose read(path, arguments) makes a Model,
# and whose PYTHON is the file that `new` writes of it.
READERS = {".urdf": "lagfmu.bodies.urdf", ".xml": "lagfmu.bodies.mjcf"}


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
    makes of them.  A file of another kind is read by its reader, and nothing in it is run.

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
    wrong = _foreign_times(file.read_bytes(), vars(module))
    if wrong:
        raise ModelError(str(file), wrong)
    if arguments:
        found = _made(str(file), module, arguments, lambda error: _where(error, file.absolute()))
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
