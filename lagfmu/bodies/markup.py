"""An XML file that others wrote: read within bounds, its entities never."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from lxml import etree

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
