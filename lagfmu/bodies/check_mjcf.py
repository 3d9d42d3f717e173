"""What is wrong with an MJCF file, before MuJoCo compiles it: its text, and the files that it names."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

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
        yield from _of_element(element, name, folder, (*within, path.resolve()), seen)


def _of_element(
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
