"""Mathematics and words in lines that fit, broken before = + - if it can be."""

from __future__ import annotations

import re
from textwrap import TextWrapper

BEFORE_OPERATOR = re.compile(r"(?<![=≤≥<>≠+\-−±]) (?=[=≤≥<>≠+\-−±] )")
KEPT = "\0"  # a space at which no line breaks


def wrapped(text: str, width: int) -> list[str]:
    """The words of a text, all of them, in lines of at most `width` characters (longer if one word is)."""
    terms = "\n".join(BEFORE_OPERATOR.split(text)).replace(" ", KEPT).replace("\n", " ")
    fitting = TextWrapper(width, break_long_words=False, break_on_hyphens=False)
    lines = []
    for line in fitting.wrap(terms) or [""]:
        lines += fitting.wrap(line.replace(KEPT, " ")) or [""]
    return lines
