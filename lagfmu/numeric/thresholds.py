"""What a start is decided by, read from the C runtime's thresholds.h: each value stands once.

`from .thresholds import RANK` gives the number; its meaning stands beside it there.

The relative tolerance of a simulation: the default, its limits, and what is said beyond them.
"""

from __future__ import annotations

import math
import re
import sys
from pathlib import Path
from typing import Any

HEADER = Path(__file__).parent.parent / "runtime" / "base" / "thresholds.h"
COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
DEFINED = re.compile(r"(\w+) = ([^;,}\n]+)")


def _number(text: str) -> float | int:
    """The value of a product of literals and DBL_EPSILON."""
    if text.isdecimal():
        return int(text)
    factors = (part.strip() for part in text.split("*"))
    return math.prod(
        sys.float_info.epsilon
        if f == "DBL_EPSILON"
        else float.fromhex(f)
        if f.startswith("0x")
        else float(f)
        for f in factors
    )


_VALUES = {
    name: _number(value.strip())
    for name, value in DEFINED.findall(COMMENT.sub("", HEADER.read_text(encoding="utf-8")))
}
LARGEST = _VALUES["LARGEST_TOLERANCE"]

DEFAULT_TOLERANCE = 1e-8
MAXIMUM_STEPS = 5000.0  # that make no headway, in one communication step


def __getattr__(name: str) -> Any:
    try:
        return _VALUES[name]
    except KeyError:
        raise AttributeError(f"{HEADER.name} defines no {name}") from None


def tolerance_problem(tolerance: float) -> str:
    """Why no step can be taken at this relative tolerance; nothing if one can."""
    if not isinstance(tolerance, str) and 0 < tolerance <= LARGEST:
        return ""
    return (
        f"tolerance = {tolerance!r}, expected a positive number of at most {LARGEST:g} (an error "
        "relative to each value), e.g. 1e-8"
    )
