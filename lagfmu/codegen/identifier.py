"""Symbol -> identifier, in C as in Python: theta, der_theta, der2_theta, lambda_rod, crank_mass, level_2."""

from __future__ import annotations

from typing import Any

from ..names import VALUE, read


def identifier(symbol: Any) -> str:
    """A word for a symbol, which may be taken."""
    text = str(symbol)
    if text.startswith("switch("):  # jumps.py
        return f"switch_{text[len('switch(') : -1]}"
    of = read(text)
    if of.quantity == VALUE and of.order:
        text = f"der{of.order if of.order > 1 else ''}_{of.coordinate}"
    return text.replace(".", "_")
