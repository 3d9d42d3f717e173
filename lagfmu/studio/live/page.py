"""The live page: one HTML file that holds an FMU as WebAssembly, and asks nobody for anything.

What it may do is said in its content security policy: the scripts of this file by their hashes, and no
connection at all.

What it has to know of an FMU comes from the variables of modelDescription.xml, as any importer sees them,
so that a page can be made of an FMU alone, and new kinds of outputs need nothing here.  What an FMU says is
shown as safe HTML, and never becomes markup.
"""

from __future__ import annotations

import base64
import hashlib
import io
import json
import re
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

import fmpy
import lxml.html
from lxml import etree
from markupsafe import Markup, escape

from ... import names
from ...fmu.archive import pack
from ...fmu.read import described_rules, experiment_of, kind_of
from ...model.rule import MESSAGES, Rule
from ...model.units import for_reading
from ...page.documentation import heading, template
from ...page.picture import SETTABLE

# of a variable; `reference`: its place.  What is seldom usual comes first
USUAL: dict[str, Any] = {
    **dict.fromkeys(("name", "description", "group", "unit"), ""),
    **{"discrete": False, "counted": "", "type": "Real", "role": "output", "column": True},
    **dict.fromkeys(("start", "min", "max")),
    **{"event": False, "items": [], "reference": None},
}
NUMBERS = ("Real", "Integer", "Boolean")


def facts(
    description: bytes, picture: dict[str, Any] | None, preset: dict[str, Any] | None = None
) -> dict[str, Any]:
    """The facts as the page's scripts read them (web/api.js); numbers in SI, times in s."""
    archive = io.BytesIO(pack({"modelDescription.xml": description}))  # fmpy reads archives only
    read = fmpy.read_model_description(archive, validate=False)
    experiment = experiment_of(read)
    named = {v.name for v in read.modelVariables}
    first = names.of_interest(v.name for v in read.modelVariables)
    joints = any(
        n.startswith("force.") for n in first
    )  # elsewhere the page begins with whole groups
    given = preset or {"sliders": [], "curves": first if joints else [], "ranges": {}}
    settable = {v.name for v in read.modelVariables if _role(v) in SETTABLE}
    columns = {v.name for v in read.modelVariables if _is_column(v)}
    rules = described_rules(read)
    variables = [_variable(v, rules[v.name], named) for v in read.modelVariables]
    return {
        "name": read.modelName,
        "description": read.description or "",
        "experiment": {
            "stopTime": experiment.stop_time,
            "stepSize": experiment.step_size,
            "tolerance": experiment.tolerance,
        },
        "variables": variables,
        "rules": MESSAGES,
        "picture": picture,
        "preset": {
            "sliders": [n for n in given["sliders"] if n in settable],
            "curves": [n for n in given["curves"] if n in columns],
            "ranges": {n: ends for n, ends in given["ranges"].items() if n in settable},
        },
    }


def lean(found: dict[str, Any]) -> dict[str, Any]:
    """The facts as they stand in a page: a variable is a row beside `usual`, null where it is so, up to
    the last that is not; its group is a place in `groups` (web/api.js)."""
    groups, rows = [*dict.fromkeys(v["group"] for v in found["variables"])], []
    for place, v in enumerate(found["variables"]):
        told, usual = {**v, "group": groups.index(v["group"])}, {**USUAL, "reference": place}
        row = [None if told[key] == x else told[key] for key, x in usual.items()]
        while row[-1] is None:
            row.pop()
        rows.append(row)
    return {**found, "variables": rows, "usual": [*USUAL.items()], "groups": groups}


def _variable(v: Any, rule: Rule, named: set[str]) -> dict[str, Any]:
    """One variable.  `column`: a run records it; `event`: the count of an event whose time is known;
    `counted`: the count without which it says nothing (names.counted)."""
    role = _role(v)
    return {
        "name": v.name,
        "reference": int(v.valueReference),
        "type": kind_of(v),
        "role": role,
        "group": heading(v.name, role, named),
        "unit": for_reading(v.unit),
        "start": _number(v),
        "items": [{"name": item, "value": number} for item, number in rule.items.items()],
        "min": rule.minimum,
        "max": rule.maximum,
        "description": v.description or "",
        "column": _is_column(v),
        "discrete": v.variability == "discrete",
        "event": names.read(v.name).quantity in names.COUNTS,
        "counted": count if (count := names.counted(v.name)) in named else "",
    }


def _is_column(v: Any) -> bool:
    return v.causality == "output" and kind_of(v) in NUMBERS


def _role(v: Any) -> str:
    """What may set it: parameter, start, input, solver; or output: nothing."""
    if v.causality == "parameter":
        return "solver" if names.read(v.name).head == names.SOLVER else "parameter"
    if v.causality == "input":
        return "input"
    return "start" if v.initial in ("exact", "approx") else "output"


def _number(v: Any) -> float | str | None:
    if v.start is None or kind_of(v) == "String":
        return None if v.start is None else str(v.start)
    if kind_of(v) == "Boolean":
        return float(str(v.start).lower() in ("true", "1"))
    return float(v.start)


KNOWN_TAGS = (
    "math mrow mi mo mn ms mtext mspace msup msub msubsup mfrac msqrt mroot mover munder munderover "
    "mtable mtr mtd mstyle mpadded mphantom mfenced menclose"
)
KNOWN_ATTRIBUTES = (
    "display mathvariant stretchy fence separator form lspace rspace linethickness columnalign rowspacing "
    "columnspacing width height depth accent movablelimits displaystyle scriptlevel open close"
)
TAGS, ATTRIBUTES = frozenset(KNOWN_TAGS.split()), frozenset(KNOWN_ATTRIBUTES.split())
VALUE = re.compile(r"[\w .%+|(){}\[\]-]*\Z")

Section = tuple[str, str, list[tuple[str, Markup, str]]]  # title, remark, (label, MathML, text)


def _as_json(value: Any) -> Markup:
    """JSON that cannot end the script element that it stands in."""
    text = json.dumps(
        value, ensure_ascii=False, separators=(",", ":"), allow_nan=False, sort_keys=True
    )
    for sign in "<>&\u2028\u2029":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return Markup(text)


def equations_of(page: bytes) -> list[Section]:
    """The equations on a page that lagfmu made (documentation/index.html), rebuilt from known MathML.

    Of elements and attributes that are not MathML's nothing is kept but the text, escaped.
    """
    try:
        root = lxml.html.document_fromstring(page)
    except (etree.ParserError, ValueError):
        return []
    found: list[Section] = []
    for top in root.xpath("//section[@aria-labelledby='equations']//h3"):
        remark, equations = "", []
        for element in top.itersiblings():
            if element.tag == "h3":
                break
            if element.tag == "p":
                remark = element.text_content().strip()
            for item in element.xpath("self::ul/li"):
                label = "".join(s.text_content() for s in item.xpath("./span")).strip()
                for box in item.xpath("./div"):
                    formula = Markup("").join(_mathml(m) for m in box.xpath("./math"))
                    equations.append((label, formula, box.get("aria-label") or ""))
        found.append((top.text_content().strip(), remark, equations))
    return found


def safe_mathml(formula: str) -> Markup:
    """A formula in MathML, rebuilt like one from a page."""
    return _mathml(lxml.html.fragment_fromstring(formula))


def _mathml(element: Any) -> Markup:
    if not isinstance(element.tag, str):  # a comment
        return Markup("")
    inside = escape(element.text or "")
    for child in element:
        inside += _mathml(child) + escape(child.tail or "")
    tag = element.tag.lower()
    if tag not in TAGS:
        return Markup(inside)
    said = "".join(
        f' {key}="{escape(value)}"'
        for key, value in sorted(element.attrib.items())
        if key in ATTRIBUTES and VALUE.match(value)
    )
    return Markup(f"<{tag}{said}>{inside}</{tag}>")


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
    """What a page is made of: `facts`, equations to read, and the compiled module; or in its
    place runs that were recorded (play.py), of `modes` one for each, with what there is to read."""

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
        facts=_as_json(lean(playable.facts)),
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
