"""What URDF and MJCF files have in common.

An XML file that others wrote: read within bounds, its entities never.

Names of a file as names of an FMU: one word each, by one rule.

The inertia of what is one body, though a file tells of its parts.

What a file that is a model by itself is asked for: NAME=VALUE, a start by names of the FMU, motors.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from ..errors import RequestError
from ..names import RESERVED
from .joints import Gear, Joint
from .loads import Motor

LARGEST = 32 * 2**20  # bytes of a file
DEEPEST = 200  # elements within each other
MOST = 200_000  # elements of a file
# What readers of robots let pass: <?xml version="0.0"?>, a blank line before it, a prefix of no namespace.
FORGIVEN = {"ERR_UNKNOWN_VERSION", "ERR_RESERVED_XML_NAME", "NS_ERR_UNDEFINED_NAMESPACE"}


def read(path: Path) -> tuple[Any, str]:
    """The root element and "", or None and what is wrong, by the name of the file."""
    name = path.name
    try:
        size = path.stat().st_size
        if not path.is_file():
            return None, f"{str(path)!r} is no file: name one"
        if size > LARGEST:
            what = f"{name!r} has {size} bytes, expected at most {LARGEST}"
            return None, f"{what}: leave out what is no mechanism"
        content = path.read_bytes()
    except OSError as error:
        return (
            None,
            f"{str(path)!r} cannot be read ({error.strerror or error}): correct the path",
        )
    if not any(content.replace(b"\0", b"").split(None, 1)):
        return None, f"{name!r} is empty: export it again"
    doctype = (
        f"{name!r} has a DOCTYPE, whose entities are not read: write what they stand for in place"
    )
    if b"<!DOCTYPE" in content.replace(b"\0", b""):  # in UTF-16, too
        return None, doctype
    if (count := content.count(b"<")) > 2 * MOST:
        what = f"{name!r} has {count} tags, expected at most {2 * MOST}"
        return None, f"{what}: leave out what is no mechanism"
    root, problem = _parsed(content.rstrip(b"\0\r\n\t "))
    if root is None:
        return None, f"{name!r} is no XML: {problem}: correct it there"
    if root.getroottree().docinfo.doctype:
        return None, doctype
    if (count := sum(1 for _ in root.iter())) > MOST:
        what = f"{name!r} has {count} elements, expected at most {MOST}"
        return None, f"{what}: leave out what is no mechanism"
    if _depth(root) > DEEPEST:
        return None, f"{name!r} has elements deeper than {DEEPEST}: hang them on fewer others"
    return root, ""


def _parsed(content: bytes) -> tuple[Any, str]:
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, recover=True)
    try:
        root = etree.fromstring(content, parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        return None, str(error)
    wrong = [e for e in parser.error_log if e.type_name not in FORGIVEN]
    if root is None or wrong:
        told = f"{wrong[0].message}, line {wrong[0].line}" if wrong else "it has no element"
        return None, told.replace("\n", " ")
    return root, ""


def _depth(root: Any) -> int:
    deepest, waiting = 0, [(root, 1)]
    while waiting:
        element, depth = waiting.pop()
        deepest = max(deepest, depth)
        waiting += [(child, depth + 1) for child in element]
    return deepest


def letters(name: str) -> str:
    """What is no letter, digit or underscore becomes _; a leading digit gets one before it."""
    made = re.sub(r"[^A-Za-z0-9_]", "_", name) or "_"
    return f"_{made}" if made[0].isdigit() else made


def _word(name: str) -> str:
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
        return _word(name)

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
    of_links = {name: _word(name) for name in links}
    taken = {*of_links.values()}
    of_joints = {n: f"{_word(n)}_joint" if _word(n) in taken else _word(n) for n in joints}
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


Array = NDArray[np.float64]
PLACES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # xx, yy, zz, xy, xz, yz


def together(parts: Sequence[tuple[float, Array, Array]]) -> tuple[float, Array, Array]:
    """Mass [kg], centre [m] (3,) and inertia about it [kg.m^2] (3, 3) of parts of which each is given by
    the same, in one frame (Steiner's theorem)."""
    if len(parts) == 1:
        return parts[0]
    mass = sum(m for m, _, _ in parts)
    J = sum((J for _, _, J in parts), np.zeros((3, 3)))
    if not mass > 0:
        return 0.0, np.zeros(3), J
    center = sum((m * c for m, c, _ in parts), np.zeros(3)) / mass
    for m, c, _ in parts:
        d = c - center
        J = J + m * (d @ d * np.eye(3) - np.outer(d, d))
    return mass, center, J


def components(J: Array) -> tuple[float, ...]:
    """xx, yy, zz, xy, xz, yz."""
    return tuple(float(J[place]) for place in PLACES)


BY_KIND: dict[str, dict[str, Any]] = {"torque": {}, "motion": {"motion": True}}


def chosen(
    path: Path, arguments: Sequence[str], choices: Mapping[str, Sequence[str]]
) -> tuple[dict[str, str], dict[str, float]]:
    """The value of each of `choices`, whose first is that without an argument (of one that lists no other
    any text is taken), and the start.

    Raises RequestError with all problems at once.
    """
    found, start, problems = {name: values[0] for name, values in choices.items()}, {}, []
    for text in arguments:
        name, sign, value = (part.strip() for part in text.partition("="))
        if sign and name in choices and (value in choices[name] or len(choices[name]) == 1):
            found[name] = value
        elif name in choices:
            known = " or ".join(choices[name]) if len(choices[name]) > 1 else "..."
            problems.append(f"{text!r}: expected {name}={known}")
        elif sign and "." in name:
            try:
                start[name] = float(value)
            except ValueError:
                problems.append(f"{text!r}: {value!r} is no number, expected one in SI")
        else:
            problems.append(
                f"{text!r}: expected {', '.join(f'{n}=...' for n in choices)}, or a start by the name of the "
                "FMU, e.g. angle.j2=0.5"
            )
    if problems:
        raise RequestError(str(path), problems)
    return found, start


def motors(joints: Sequence[Any], kind: str, start: Mapping[str, Any]) -> list[Motor]:
    """One on each motion of a joint that follows no other, by kind: torque, motion, else none."""
    followers = {p.first for p in joints if isinstance(p, Gear)}
    found = []
    for joint in joints if kind in BY_KIND else ():
        measures = joint.measures if isinstance(joint, Joint) else []
        for measure in measures:
            name = measure.partition(".")[2]
            if not {name, measure} & followers:
                begin = float(start.get(measure, 0.0)) if kind == "motion" else 0.0
                of = joint if len(measures) == 1 else measure
                found.append(Motor(f"{name}_motor", of, start=begin, **BY_KIND[kind]))
    return found
