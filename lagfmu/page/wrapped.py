"""Mathematics and words in lines that fit, broken before = + - at the outermost level, if it can be."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from rich.cells import cell_len

# of breaks before operators; between factors or words: 5
KINDS = {"=≤≥<>≠": 0, "+-−±": 1, "/·∧": 4}
OPERATORS = "".join(KINDS)
OPEN, CLOSE = "([{", ")]}"
LEVEL = 4.0  # kinds of operators a level
EMPTY = 4.0  # what a line costs that is left empty, ...
SHORT, LEAST = 8.0, 0.3  # ... and what one costs of which less than this part is used


@dataclass(frozen=True)
class _Word:
    """`depth`: of the brackets around it; `kind`: of a break before it, the better the smaller."""

    text: str
    depth: int
    kind: int


def wrapped(text: str, width: int) -> list[str]:
    """The words of a text, all of them, in lines of at most `width` cells (longer if one word is); those that
    begin inside of brackets are indented."""
    words = list(_words(text))
    lines: list[str] = []
    while words:
        indent = "  " * min(words[0].depth, 3) if lines else ""
        count = _taken(words, width - len(indent))
        lines.append(indent + _joined(words[:count]))
        words = words[count:]
    return lines or [""]


def _joined(words: list[_Word]) -> str:
    return " ".join(word.text for word in words)


def _words(text: str) -> Iterator[_Word]:
    depth, before = 0, " "
    for word in text.split():
        kind = next((k for s, k in KINDS.items() if word in s), 5)
        stays = before in OPERATORS  # with the operator before it
        yield _Word(word, depth, kind + 8 * stays)
        depth += sum(word.count(c) for c in OPEN) - sum(word.count(c) for c in CLOSE)
        before = word


def _taken(words: list[_Word], width: int) -> int:
    """How many words, one at the least, make the best line."""
    used, found, best = cell_len(words[0].text), 1, float("inf")
    for count, word in enumerate(words[1:], 1):
        part = min(used / width, 1.0)
        cost = LEVEL * word.depth + word.kind + EMPTY * (1 - part) + SHORT * (part < LEAST)
        if cost <= best:
            found, best = count, cost
        used += 1 + cell_len(word.text)
        if used > width:
            return found
    return len(words)
