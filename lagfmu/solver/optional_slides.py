"""What happens where frictions stick and slip; an FMU without frictions holds none of it."""

from .rubbing import rubbed
from .slides import Contacts, begun, renewed, settle, switched_slides, turned
from .slipping import dissipated, indicators, observed, ranges

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
