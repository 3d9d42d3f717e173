"""What happens where constraints hold by friction; an FMU without frictions holds none of it."""

from .friction import motion_with_friction, sticking
from .slides import begun, dissipated, indicators, is_slipping, ranges, renewed, settle, turned

__all__ = [
    "begun",
    "dissipated",
    "indicators",
    "is_slipping",
    "motion_with_friction",
    "ranges",
    "renewed",
    "settle",
    "sticking",
    "turned",
]
