"""The commands: options in, a call, tables and plots out."""

from .app import app

__all__ = ["app"]
