"""What an FMU with error bars needs; one without holds none of it."""

from .bars import (
    begun,
    coarsened,
    followed,
    halved,
    paired_settings,
    restored_bars,
    to_list,
    widened,
)

__all__ = [
    "begun",
    "coarsened",
    "followed",
    "halved",
    "paired_settings",
    "restored_bars",
    "to_list",
    "widened",
]
