"""What is wrong with a URDF or MJCF file, in words, before a body is made of it.



Of the elements of a URDF file those that a mechanism is made of; the others are counted.

What simulators add (colours, sensors, elements and attributes of other namespaces) is never read.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from . import markup

READ = ("include", "model")  # elements that name a file with elements of its own


def problems_of_files(path: Path) -> list[str]:
    """Of the file and of those that it includes; no file is opened but these, all in its folder."""
    return list(_of_file(path, path.parent.resolve(), (), {path.resolve()}))


def _of_file(path: Path, folder: Path, within: tuple[Path, ...], seen: set[Path]) -> Iterator[str]:
    name = path.name
    root, problem = markup.read(path)
    if root is None:
        yield problem
        return
    if not within and root.tag != "mujoco":
        yield f"the root of {name!r} is <{root.tag}>, expected <mujoco>: name an MJCF file"
        return
    if len(within) > markup.DEEPEST:
        yield f"{name!r} is included by {len(within)} files in turn: write them into one"
        return
    for element in (e for e in root.iter() if isinstance(e.tag, str)):
        yield from _of_named_file(element, name, folder, (*within, path.resolve()), seen)


def _of_named_file(
    e: Any, name: str, folder: Path, within: tuple[Path, ...], seen: set[Path]
) -> Iterator[str]:
    where = f"{name!r}: <{e.tag}> in line {e.sourceline}"
    if e.tag in ("plugin", "instance"):
        yield f"{where} runs code of a plugin, which nothing here does: leave it out"
    for key, value in e.attrib.items():
        if "nan" in value.lower().split():
            yield f"{where} has {key}={value!r}, expected finite numbers: correct it"
    named = [(k, v) for k, v in e.attrib.items() if k.startswith("file") or k.endswith("dir")]
    for key, value in named:
        target = (folder / value).resolve()
        if not target.is_relative_to(folder):
            yield (
                f"{where} names {value!r}, which is not in the folder of the file: copy it there, and "
                f"name it by a relative path in {key}="
            )
        elif e.tag in READ and target in within:
            yield f"{where} includes {value!r}, which includes it: leave out one of the two"
        elif e.tag in READ and target not in seen:
            seen.add(target)
            yield from _of_file(target, folder, within, seen)


# What an element must have: attributes, and elements in it.
NEEDED: dict[str, tuple[Sequence[str], Sequence[str]]] = {
    "robot": (("name",), ("link",)),
    "link": (("name",), ()),
    "joint": (("name", "type"), ("parent", "child")),
    "parent": (("link",), ()),
    "child": (("link",), ()),
    "mimic": (("joint",), ()),
    "inertial": ((), ("mass", "inertia")),
    "mass": (("value",), ()),
    "inertia": (("ixx", "iyy", "izz"), ()),
    "visual": ((), ("geometry",)),
    "collision": ((), ("geometry",)),
    "box": (("size",), ()),
    "cylinder": (("radius", "length"), ()),
    "sphere": (("radius",), ()),
    "mesh": (("filename",), ()),
}
COUNTS = {  # how many numbers an attribute holds
    "origin": {"xyz": 3, "rpy": 3},
    "axis": {"xyz": 3},
    "mass": {"value": 1},
    "inertia": dict.fromkeys(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), 1),
    "limit": {"lower": 1, "upper": 1},
    "dynamics": {"damping": 1, "friction": 1},
    "mimic": {"multiplier": 1, "offset": 1},
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
}
SHAPES = ("box", "cylinder", "sphere", "mesh")
SIZES = (*SHAPES, "mass", "dynamics")  # no number of theirs is below 0
MACROS = ("${", "$(")


def problems_of_text(name: str, root: Any) -> list[str]:
    """What the elements of the file of that name lack, what is no number, or written by macros."""
    elements = [e for e in root.iter() if isinstance(e.tag, str)]
    for e in elements:
        if "xacro" in e.tag or any(x in value for value in e.attrib.values() for x in MACROS):
            tag = e.tag.rpartition("}")[2]
            return [f"<{tag}> in line {e.sourceline} is a macro: expand the file first, by xacro"]
    if root.tag != "robot":
        return [f"the root of {name!r} is <{root.tag}>, expected <robot>: name a URDF file"]
    problems = list(_of_element("the file", root))
    joints = [j for j in root.iterfind("joint") if j.get("type") != "fixed"]
    movers = {child.get("link") for joint in joints for child in joint.iter("child")}
    for part in root:
        if part.tag in ("link", "joint"):
            what = f"{part.tag} {part.get('name', '')!r}"
            merged = part.tag == "link" and part.get("name") not in movers
            found = [e for e in part.iter(*NEEDED, *COUNTS) if not (merged and e.tag == "inertial")]
            problems += [p for e in found for p in _of_element(what, e)]
            problems += [
                f"{what}: <geometry> in line {geometry.sourceline} is empty, expected "
                f"{', '.join(SHAPES)}: leave it out"
                for geometry in part.iter("geometry")
                if geometry.find("*") is None
            ]
    return problems


def _of_element(what: str, element: Any) -> Iterator[str]:
    attributes, children = NEEDED.get(element.tag, ((), ()))
    for name in attributes:
        if not element.get(name):
            yield f"{what}: <{element.tag}> in line {element.sourceline} lacks {name}=: give it one"
    for name in children:
        if element.find(name) is None:
            yield f"{what}: <{element.tag}> in line {element.sourceline} lacks <{name}>: give it one"
    for name, count in COUNTS.get(element.tag, {}).items():
        text, size = element.get(name), element.tag in SIZES
        if text and not _are_numbers(text, count, 0.0 if size else -math.inf):
            wanted = "a finite number" if count == 1 else f"{count} finite numbers"
            least = ", none below 0" if size else ""
            yield f"{what}: <{element.tag} {name}> is {text!r}, expected {wanted}{least}: correct it"


def _are_numbers(text: str, count: int, least: float) -> bool:
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        return False
    plain = "_" not in text  # which float lets pass
    return plain and len(values) == count and all(math.isfinite(x) and x >= least for x in values)


def problems_of_tree(robot: Any) -> list[str]:
    """What is no tree of known links with one root."""
    links, joints = ([thing.name for thing in things] for things in (robot.links, robot.joints))
    known = set(links)
    problems = [f"two links are called {name!r}: rename one" for name in _twice(links)]
    problems += [f"two joints are called {name!r}: rename one" for name in _twice(joints)]
    parents: dict[str, list[str]] = defaultdict(list)
    children: dict[str, list[str]] = defaultdict(list)
    for joint in robot.joints:
        for end, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in known:
                problems.append(
                    f"joint {joint.name!r}: its {end} {link!r} is no link of the file: correct it"
                )
        parents[joint.child].append(joint.name)
        children[joint.parent].append(joint.child)
    problems += [
        f"link {link!r} is the child of {' and '.join(map(repr, of))}, expected one joint: URDF has trees "
        "only; close a loop by a joint of your own beside those of the file"
        for link, of in parents.items()
        if len(of) > 1
    ]
    if problems:
        return problems
    roots = [link for link in links if link not in parents]
    if len(roots) > 1:
        return [
            f"the file has the root links {', '.join(map(repr, roots))}, expected one: "
            "tie them together by fixed joints"
        ]
    reached, further = set(roots), roots
    while further:
        further = [c for link in further for c in children[link]]
        reached.update(further)
    if round_ := [repr(link) for link in links if link not in reached]:
        return [
            f"the joints of the links {', '.join(round_)} form a cycle: URDF has trees "
            "only; leave out one of them, and close the loop by a joint of your own"
        ]
    return []


def problems_of_parts(robot: Any, kinds: Collection[str], limits: bool) -> Iterator[str]:
    """Joints of another kind than these, or that follow, stop or rub as none can."""
    moving = {j.name: j for j in robot.joints if j.type in ("revolute", "continuous", "prismatic")}
    for joint in robot.joints:
        what = f"joint {joint.name!r}"
        if joint.type not in kinds:
            yield (
                f"{what} is of the type {joint.type!r}, expected one of {', '.join(kinds)}: build it from "
                "bodies and joints of lagfmu"
            )
        if joint.mimic is not None and joint.type != "fixed":
            if joint.mimic.joint not in moving or joint.name not in moving:
                yield (
                    f"{what} mimics {joint.mimic.joint!r}, expected a hinge or a slide that follows another "
                    "of this file: correct the name"
                )
            elif joint.name in _followed(moving, joint):
                yield f"{what} mimics itself: leave out the <mimic> of one joint"
            if not joint.mimic.multiplier:
                yield f"{what} mimics with the multiplier 0: make it a fixed joint"
        if joint.type != "fixed" and joint.axis is not None and not np.linalg.norm(joint.axis) > 0:
            yield f"{what} has the axis {joint.axis.tolist()}, expected a direction: correct it"
        stops = joint.limit if joint.name in moving and joint.type != "continuous" else None
        if limits and stops and (stops.lower or 0.0) > (stops.upper or 0.0):
            yield (
                f"{what} has the limits {stops.lower!r}, {stops.upper!r}, expected the smaller first: "
                "exchange them, or read it with limits=False"
            )


def _followed(moving: Mapping[str, Any], joint: Any) -> set[str]:
    """The joints that a joint follows."""
    found: set[str] = set()
    while joint is not None and joint.mimic is not None and joint.mimic.joint not in found:
        found.add(joint.mimic.joint)
        joint = moving.get(joint.mimic.joint)
    return found


def number_of_dynamics(joint: Any, name: str) -> float:
    """A number of <dynamics>, which yourdfpy hands on as text."""
    return float(getattr(joint.dynamics, name, None) or 0.0)


def _twice(names: Sequence[str]) -> list[str]:
    return sorted(n for n, count in Counter(names).items() if count > 1)


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
