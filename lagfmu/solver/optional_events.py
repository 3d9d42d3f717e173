"""How events are found; an FMU without anything to watch carries none of it, and this file empty."""

from .events import first_event

__all__ = ["first_event"]
