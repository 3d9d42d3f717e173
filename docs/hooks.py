"""What the site holds besides its texts: a live page for every model, and the tutorial as a notebook.

LAGFMU_GALLERY=hemisphere,belt builds the pages of these models alone, for a quick look at the site.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import jupytext
from mkdocs.structure.files import File, Files

import lagfmu

MODELS = Path(__file__).parent.parent / "models"
MODEL = re.compile(r"\[([^\]]+)\]\(\.\./models/(\w+)\.py\)")
EMPTY_HEAD = re.compile(r"<thead>\s*<tr>(?:\s*<th[^>]*></th>)+\s*</tr>\s*</thead>")
EMPTY_HEADING = re.compile(r"<th[^>]*></th>")
NOTEBOOK = (
    '`jupytext --to ipynb docs/tutorial.md` makes a notebook of it (`pip install -e ".[docs]"`)'
)


def on_files(files: Files, config: Any) -> Files:
    """Adds gallery/NAME.html for each model, and tutorial.ipynb."""
    for path in _models():
        page = lagfmu.play(path).text
        files.append(File.generated(config, f"gallery/{path.stem}.html", content=page))
    text = files.get_file_from_path("tutorial.md").content_string
    files.append(File.generated(config, "tutorial.ipynb", content=notebook(text)))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Links to model files, which the repository has, become links to the live pages, which the site has."""
    made = {p.stem for p in _models()}

    def link(found: re.Match[str]) -> str:
        return f"[{found[1]}](gallery/{found[2]}.html)" if found[2] in made else found[1]

    return MODEL.sub(link, markdown).replace(NOTEBOOK, "[tutorial.ipynb](tutorial.ipynb)")


def on_page_content(html: str, **_: Any) -> str:
    """A table whose head is empty has none, and an empty cell of a head is no heading."""
    return EMPTY_HEADING.sub("<td></td>", EMPTY_HEAD.sub("", html))


def notebook(text: str) -> str:
    """A text in Markdown as a notebook: its blocks of Python become cells."""
    return str(jupytext.writes(jupytext.reads(text, fmt="md"), fmt="ipynb"))


def _models() -> list[Path]:
    wanted = os.environ.get("LAGFMU_GALLERY")
    names = None if wanted is None else wanted.split(",")
    return [p for p in sorted(MODELS.glob("*.py")) if names is None or p.stem in names]
