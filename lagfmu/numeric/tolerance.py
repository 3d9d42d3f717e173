"""The relative tolerance of a simulation: the default, its limits, and what is said beyond them."""

from __future__ import annotations

from .thresholds import LARGEST_TOLERANCE

DEFAULT_TOLERANCE = 1e-8
MAXIMUM_STEPS = 5000.0  # that make no headway, in one communication step


def tolerance_problem(tolerance: float) -> str:
    """Why no step can be taken at this relative tolerance; nothing if one can."""
    if not isinstance(tolerance, str) and 0 < tolerance <= LARGEST_TOLERANCE:
        return ""
    return (
        f"tolerance = {tolerance!r}, expected a positive number of at most {LARGEST_TOLERANCE:g} (an error "
        "relative to each value), e.g. 1e-8"
    )
