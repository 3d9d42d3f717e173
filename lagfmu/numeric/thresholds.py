"""What a start is decided by, read from the C runtime's thresholds.h: each value stands once.

`from .thresholds import RANK` gives the number; its meaning stands beside it there.
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


def __getattr__(name: str) -> Any:
    try:
        return _VALUES[name]
    except KeyError:
        raise AttributeError(f"{HEADER.name} defines no {name}") from None
