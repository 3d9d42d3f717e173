"""Families of models: a file whose function `family` makes a model from arguments.

    def family(n=4, length=0.25):
        return model, scenes, closed_forms          # or the model alone

Each argument has a default, which says of what type it is; `lagfmu build FILE.py -p n=8` gives another.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from types import ModuleType
from typing import Any

from ..errors import ModelError, RequestError
from .model import Model

FUNCTION = "family"
HINT = f"def {FUNCTION}(n=4): ... return model, scenes, closed_forms"
TRUE, FALSE = ("true", "yes", "1"), ("false", "no", "0")


def made(
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
