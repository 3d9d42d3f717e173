"""What is wrong with an MJCF file, before MuJoCo compiles it: its text, and the files that it names."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from lxml import etree

LARGEST = 20_000_000  # bytes of the file and of each that it includes
DEEPEST = 200  # elements within each other
MOST = 200_000  # elements of all files
TEXT = "text of the file itself"


def problems_of_files(path: Path) -> list[str]:
    """Of the file and of those that it includes; no file is opened but these, all in its folder."""
    return list(_of_file(path, path.parent.resolve(), (), {path.resolve()}))


def _of_file(path: Path, folder: Path, within: tuple[Path, ...], seen: set[Path]) -> Iterator[str]:
    name = path.name
    try:
        if not path.is_file():
            raise OSError(None, "no such file")
        if path.stat().st_size > LARGEST:
            yield (
                f"{name!r} has {path.stat().st_size} bytes, expected at most {LARGEST}: leave out what is no "
                "mechanism"
            )
            return
        content = path.read_bytes()
    except OSError as error:
        yield f"{str(path)!r} cannot be read ({error.strerror or error}): correct the path"
        return
    if b"<!DOCTYPE" in content or b"<!ENTITY" in content:
        yield f"{name!r} has a DOCTYPE, whose entities are not expanded: write the {TEXT} in their place"
        return
    parser = etree.XMLParser(resolve_entities=False, no_network=True, huge_tree=False)
    try:
        root = etree.fromstring(content, parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        yield f"{name!r} is no XML: {error}"
        return
    if not within and root.tag != "mujoco":
        yield f"the root of {name!r} is <{root.tag}>, expected <mujoco>"
        return
    elements = [e for e in root.iter() if isinstance(e.tag, str)]
    if len(elements) > MOST:
        count = len(elements)
        yield f"{name!r} has {count} elements, expected at most {MOST}: leave out what is no mechanism"
        return
    if _depth(root) > DEEPEST:
        yield f"{name!r} has elements deeper than {DEEPEST}: hang bodies on fewer others"
        return
    for element in elements:
        yield from _of_element(element, name, folder, (*within, path.resolve()), seen)


def _of_element(
    e: Any, name: str, folder: Path, within: tuple[Path, ...], seen: set[Path]
) -> Iterator[str]:
    where = f"{name!r}: <{e.tag}> in line {e.sourceline}"
    if e.tag in ("plugin", "instance"):
        yield f"{where} runs code of a plugin, which nothing here does: leave it out"
    named = [(k, v) for k, v in e.attrib.items() if k.startswith("file") or k.endswith("dir")]
    for key, value in named:
        target = (folder / value).resolve()
        if not target.is_relative_to(folder):
            yield (
                f"{where} names {value!r}, which is not in the folder of the file: copy it there, and "
                f"name it by a relative path in {key}="
            )
        elif e.tag == "include" and target in within:
            yield f"{where} includes {value!r}, which includes it: leave out one of the two"
        elif e.tag == "include" and target not in seen:
            seen.add(target)
            yield from _of_file(target, folder, within, seen)


def _depth(root: Any) -> int:
    deepest, waiting = 0, [(root, 1)]
    while waiting:
        element, depth = waiting.pop()
        deepest = max(deepest, depth)
        waiting += [(child, depth + 1) for child in element]
    return deepest
