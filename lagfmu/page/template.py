"""Jinja's templates of this package."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import jinja2


@cache
def template(path: str) -> jinja2.Template:
    """The one at `path` in the package; what it is given is escaped, and what it is not given an error."""
    environment = jinja2.Environment(
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
        loader=jinja2.FunctionLoader(_text),
    )
    return environment.get_template(path)


def _text(path: str) -> str:
    return files("lagfmu").joinpath(path).read_text(encoding="utf-8")
