"""Equations and texts of an FMU as safe HTML: what an FMU says is shown, and never becomes markup."""

from __future__ import annotations

import json
import re
from typing import Any

import lxml.html
from lxml import etree
from markupsafe import Markup, escape

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


def as_json(value: Any) -> Markup:
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
    for heading in root.xpath("//section[@aria-labelledby='equations']//h3"):
        remark, equations = "", []
        for element in heading.itersiblings():
            if element.tag == "h3":
                break
            if element.tag == "p":
                remark = element.text_content().strip()
            for item in element.xpath("self::ul/li"):
                label = "".join(s.text_content() for s in item.xpath("./span")).strip()
                for box in item.xpath("./div"):
                    formula = Markup("").join(_mathml(m) for m in box.xpath("./math"))
                    equations.append((label, formula, box.get("aria-label") or ""))
        found.append((heading.text_content().strip(), remark, equations))
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
