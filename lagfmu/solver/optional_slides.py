"""What happens where frictions stick and slip; an FMU without frictions holds none of it."""

from .rubbing import rubbed
from .slides import (
    Contacts,
    begun,
    dissipated,
    indicators,
    observed,
    ranges,
    renewed,
    settle,
    switched_slides,
    turned,
)

__all__ = [
    "Contacts",
    "begun",
    "dissipated",
    "indicators",
    "observed",
    "ranges",
    "renewed",
    "rubbed",
    "settle",
    "switched_slides",
    "turned",
]
