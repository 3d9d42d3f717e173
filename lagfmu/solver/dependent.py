"""The rungs of linear.py that only constraints need; in an FMU without constraints: None."""

from .nullspace import nullspace
from .orthogonal import orthogonal

__all__ = ["nullspace", "orthogonal"]
