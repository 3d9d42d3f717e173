"""Of the elements of a URDF file those that a mechanism is made of; the others are counted.

What simulators add (colours, sensors, elements and attributes of other namespaces) is never read.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

from lxml import etree

from .check_urdf import SHAPES

LINK = ("inertial", "visual", "collision")
JOINT = ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic")
KEPT: Mapping[str, tuple[str, ...]] = {
    "robot": ("link", "joint"),
    "link": LINK,
    "joint": JOINT,
    "inertial": ("origin", "mass", "inertia"),
    "visual": ("origin", "geometry"),
    "collision": ("origin", "geometry"),
    "geometry": SHAPES,
}
MESH = "link/visual/geometry/mesh"
COUNTED = {"transmission": "transmissions", "gazebo": "extensions of Gazebo"}
NAMES = ("meshes", "other shapes", *COUNTED.values())
TOLD = ("effort", "velocity")  # of a limit: nothing enforces them


def left_out(root: Any) -> str:
    """What the file has and a mechanism has not, with counts."""
    counts = Counter(COUNTED[e.tag] for e in root if e.tag in COUNTED)
    meshes, others = (sum(1 for _ in found) for found in (root.iterfind(MESH), _unknown(root)))
    counts |= Counter({"meshes": meshes, "other shapes": others})
    found = [f"{what} ({counts[what]})" for what in NAMES if counts[what]]
    return f"{', '.join(found)} are left out" if found else ""


def _unknown(root: Any) -> Iterator[Any]:
    """What looks like nothing that URDF has."""
    for look in root.iterfind("link/visual"):
        if look.find("geometry") is not None and not any(
            look.find(f"geometry/{s}") is not None for s in SHAPES
        ):
            yield look


def needed(root: Any) -> bytes:
    """The file without the rest; `root` is changed."""
    waiting = [root]
    while waiting:
        element = waiting.pop()
        for child in [*element]:
            if child.tag not in KEPT.get(element.tag, ()):
                element.remove(child)
        for name in [n for n in element.attrib if ":" in n or n[0] == "{"]:
            del element.attrib[name]
        waiting += element
    for geometry in [*root.iter("geometry")]:
        if len(geometry) == 0:
            look = geometry.getparent()
            look.getparent().remove(look)
    for limit in root.iter("limit"):
        for name in TOLD:
            if not _is_number(limit.get(name, "0")):
                del limit.attrib[name]
    text: bytes = etree.tostring(root)
    return text


def _is_number(text: str) -> bool:
    try:
        return bool(float(text) >= 0)
    except ValueError:
        return False
