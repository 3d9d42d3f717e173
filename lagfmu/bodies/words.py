"""Names of a file as names of an FMU: one word each, by one rule."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from ..names import RESERVED


def letters(name: str) -> str:
    """What is no letter, digit or underscore becomes _; a leading digit gets one before it."""
    made = re.sub(r"[^A-Za-z0-9_]", "_", name) or "_"
    return f"_{made}" if made[0].isdigit() else made


def word(name: str) -> str:
    """Its letters; what the FMU or the mechanism reserves gets a _ behind it."""
    made = letters(name)
    return f"{made}_" if made in RESERVED or made == "ground" else made


@dataclass(frozen=True)
class Words:
    """The word for the name of each link, and of each joint."""

    links: dict[str, str]
    joints: dict[str, str]

    def name(self, name: str) -> str:
        """That of the whole."""
        return word(name)

    def told(self) -> Iterator[str]:
        """The names that are others than those of the file."""
        kinds = {"link": self.links, "joint": self.joints}
        others = [
            f"{made} is the {kind} {name!r}"
            for kind, words in kinds.items()
            for name, made in words.items()
            if made != name
        ]
        if others:
            yield f"names: {', '.join(others)}"


def words_of(links: Sequence[str], joints: Sequence[str]) -> tuple[Words, list[str]]:
    """A word for each; a joint that is called like a link gets _joint.  Then what is wrong: names that become
    one word."""
    of_links = {name: word(name) for name in links}
    taken = {*of_links.values()}
    of_joints = {n: f"{word(n)}_joint" if word(n) in taken else word(n) for n in joints}
    problems: list[str] = []
    seen: dict[str, str] = {}
    named = [("link", n, w) for n, w in of_links.items()]
    named += [("joint", n, w) for n, w in of_joints.items()]
    for kind, name, made in named:
        if made in seen:
            problems.append(
                f"{seen[made]} and the {kind} {name!r} would both be called {made!r}: rename one in the file"
            )
        seen[made] = f"the {kind} {name!r}"
    return Words(of_links, of_joints), problems
