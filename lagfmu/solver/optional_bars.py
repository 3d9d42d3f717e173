"""What an FMU with error bars needs; one without holds none of it."""

from .bars import (
    after_step,
    begun,
    followed,
    halved,
    paired_settings,
    restored_bars,
    to_list,
    widened,
)

__all__ = [
    "after_step",
    "begun",
    "followed",
    "halved",
    "paired_settings",
    "restored_bars",
    "to_list",
    "widened",
]
