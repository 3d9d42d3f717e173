"""The live page: one HTML file that holds an FMU as WebAssembly, and asks nobody for anything.

What it may do is said in its content security policy: the scripts of this file by their hashes, and no
connection at all.
"""

from __future__ import annotations

import base64
import hashlib
import re
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from markupsafe import Markup

from ...page.template import template
from .facts import lean
from .markup import Section, as_json

APPLICATION = (
    "api.js",
    "format.js",
    "settings.js",
    "controls.js",
    "trajectory.js",
    "charts.js",
    "lead.js",
    "expression.js",
    "labels.js",
    "solids.js",
    "flat.js",
    "picture.js",
    "player.js",
    "accuracy.js",
    "main.js",
)
IN_SPACE = ("meshes.js", "space.js", "orbit.js")  # before the last, if the picture is in space
OF_MODES = ("modes.js",)  # likewise, if there are modes
WORKER = ("fmu.js", "worker.js")
COMMENT = re.compile(r"^[ \t]*/\*.*?\*/[ \t]*\n", re.MULTILINE | re.DOTALL)
REMARK = re.compile(r"[ \t]+// [^\"'`\n]*$", re.MULTILINE)  # behind code, not within a string
INDENTATION = re.compile(r"^\s+", re.MULTILINE)  # and empty lines
LIBRARY, LIBRARY_STYLE, LICENCE = "uPlot.iife.min.js", "uPlot.min.css", "uPlot.LICENSE"
SPACE, SPACE_LICENCE = "three.min.js", "three.LICENSE"


@dataclass(frozen=True)
class Playable:
    """What a page is made of: facts (facts.py), equations to read, and the compiled module; or in its
    place runs that were recorded (recording.py), of `modes` one for each, with what there is to read."""

    facts: dict[str, Any]
    equations: Sequence[Section]
    module: bytes = b""
    recording: bytes = b""
    modes: dict[str, Any] | None = None

    @property
    def name(self) -> str:
        """The FMU's name."""
        return str(self.facts["name"])


def render(playable: Playable) -> str:
    """The HTML text; the same for the same parts."""
    picture = playable.facts["picture"]
    in_space = picture is not None and picture["dimensions"] == 3
    *parts, main = APPLICATION
    parts += [*(IN_SPACE if in_space else ()), *(OF_MODES if playable.modes else ())]
    application = _script(_joined((*parts, main)))
    library = _script(f"/*\n{_text('vendor', LICENCE)}*/\n{_text('vendor', LIBRARY)}")
    style = _text("vendor", LIBRARY_STYLE) + _lean(_text("page.css"))
    scripts = [library, application]
    if in_space:
        library = _script(f"/* three.js\n{_text('vendor', SPACE_LICENCE)}*/\n{library}")
        scripts = [library, application, _text("vendor", SPACE)]
        style += _lean(_text("space.css"))
    return template("studio/live/web/page.html.j2").render(
        name=playable.name,
        description=playable.facts["description"],
        equations=playable.equations,
        picture=picture is not None,
        modes=playable.modes,
        space=_packed(_text("vendor", SPACE).encode()) if in_space else "",
        facts=as_json(lean(playable.facts)),
        module=_packed(playable.module),
        recording=_packed(playable.recording),
        style=Markup(style),
        library=Markup(library),
        application=Markup(application),
        worker=_packed(_joined(WORKER).encode()),
        hashes=" ".join(f"'sha256-{_hash(text)}'" for text in scripts),
    )


def _packed(content: bytes) -> str:
    return base64.b64encode(zlib.compress(content, 9)).decode() if content else ""


def _joined(names: Sequence[str]) -> str:
    """Scripts that share one scope of their own."""
    body = "\n".join(_lean(_text(name)) for name in names)
    return f'\n(() => {{\n"use strict";\n{body}}})();\n'


def _lean(text: str) -> str:
    """Without comments, empty lines and indentation: a fifth of the scripts."""
    return INDENTATION.sub("", REMARK.sub("", COMMENT.sub("", text)))


def _script(text: str) -> str:
    if "</script" in text.lower() or "<!--" in text:
        raise ValueError("a script of the page would end its own element")
    return text


def _hash(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


@cache
def _text(*parts: str) -> str:
    return files("lagfmu").joinpath("studio", "live", "web", *parts).read_text(encoding="utf-8")
