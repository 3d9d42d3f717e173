"""A mechanism in words: a line for each body, joint and load."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from .body import Body, Marker


def lines_of(bodies: Sequence[Body], parts: Sequence[Any]) -> list[tuple[str, str]]:
    """The name of each, and what it is: what kind of joint it is, of which bodies."""
    lines = [
        (body.name, f"body{f': {body.description}' if body.description else ''}") for body in bodies
    ]
    return lines + [(part.name, _line(part)) for part in parts]


def _line(part: Any) -> str:
    """The kind, and what it takes hold of: the second first, which receives what is reported."""
    fields = ("second", "first", "joint", "at", "on")
    held = [getattr(part, field) for field in fields if getattr(part, field, None) is not None]
    kind, of = _words(type(part).__name__), " on ".join(map(_name, held))
    return f"{kind}: {of}" if of else kind


def _name(of: Any) -> str:
    """Of a body, of that of a marker, or of a joint, which may be given by its name."""
    of = of.body if isinstance(of, Marker) else of
    return of if isinstance(of, str) else str(of.name)


def _words(name: str) -> str:
    """SpringDamper -> spring damper."""
    return "".join(f" {c.lower()}" if c.isupper() and k else c.lower() for k, c in enumerate(name))
