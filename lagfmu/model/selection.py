"""Names and patterns that a user gives -> the names they mean.  All that mean nothing are told at once."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from fnmatch import fnmatchcase


def select(
    wanted: Iterable[str], known: Sequence[str], what: str, problems: list[str]
) -> tuple[str, ...]:
    """Those of `known`, in their order, that a name or pattern (* and ?) of `wanted` means.

    A name that means nothing is added to `problems`; `what` says what it should be, e.g. 'parameter'.
    """
    found: set[str] = set()
    for name in wanted:
        meant = [k for k in known if k == name or fnmatchcase(k, name)]
        found.update(meant)
        if not meant and name != "*":
            near = difflib.get_close_matches(name, known, 3, 0.5) or list(known[:8])
            hint = f"; did you mean {', '.join(map(repr, near))}?" if near else "; there is none"
            problems.append(f"{what} {name!r} is unknown{hint}")
    return tuple(k for k in known if k in found)


def listed(text: str) -> tuple[str, ...]:
    """NAME,NAME as names; a comma within parentheses belongs to the name, as in der(x,2)."""
    found: list[str] = []
    depth, word = 0, ""
    for letter in f"{text},":
        depth += (letter == "(") - (letter == ")")
        if letter == "," and depth <= 0:
            found.append(word.strip())
            word = ""
        else:
            word += letter
    return tuple(w for w in found if w)
