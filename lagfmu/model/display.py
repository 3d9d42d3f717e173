"""What notebooks ask a thing for: its mathematics.  Who typesets it is said by lagfmu/__init__.py."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

Typesetter = Callable[[Any], str]
_TYPESETTERS: dict[str, Typesetter] = {}  # html, latex -> what makes it of a thing


def register(**typesetters: Typesetter) -> None:
    """Say what makes `html` and `latex` of a model, of equations, of a classification."""
    _TYPESETTERS.update(typesetters)


class Displayed:
    """A mixin for what typesets itself in a notebook."""

    def _repr_html_(self) -> str:
        return _TYPESETTERS["html"](self)

    def _repr_latex_(self) -> str:
        return _TYPESETTERS["latex"](self)
