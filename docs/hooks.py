"""What the site holds besides its texts: a live page for every model, and the tutorial as a notebook.

LAGFMU_GALLERY=hemisphere,belt builds the pages of these models alone, for a quick look at the site.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import jupytext
from mkdocs.structure.files import File, Files

import lagfmu
from lagfmu.model.file import load

MODELS = Path(__file__).parent.parent / "models"
PLACE = "<!-- models -->"


def on_files(files: Files, config: Any) -> Files:
    """Adds gallery/NAME.html for each model, and tutorial.ipynb."""
    for path in _models():
        page = lagfmu.play(path).text
        files.append(File.generated(config, f"gallery/{path.stem}.html", content=page))
    text = files.get_file_from_path("tutorial.md").content_string
    files.append(File.generated(config, "tutorial.ipynb", content=notebook(text)))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """The table of models in gallery.md."""
    if PLACE not in markdown:
        return markdown
    rows = ["| | |", "| --- | --- |"]
    for path in _models():
        what = load(path).model.description
        rows.append(f"| [{path.stem.replace('_', ' ')}](gallery/{path.stem}.html) | {what} |")
    return markdown.replace(PLACE, "\n".join(rows))


def notebook(text: str) -> str:
    """A text in Markdown as a notebook: its blocks of Python become cells."""
    return str(jupytext.writes(jupytext.reads(text, fmt="md"), fmt="ipynb"))


def _models() -> list[Path]:
    wanted = os.environ.get("LAGFMU_GALLERY")
    names = None if wanted is None else wanted.split(",")
    return [p for p in sorted(MODELS.glob("*.py")) if names is None or p.stem in names]
