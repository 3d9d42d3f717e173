"""What the site holds besides its texts: a live page and a moving thumbnail of every model, the tutorial
as a notebook.

LAGFMU_GALLERY=hemisphere,belt builds the pages of these models alone, for a quick look at the site.
"""

from __future__ import annotations

import os
import re
import tempfile
from pathlib import Path
from typing import Any

import jupytext
from mkdocs.structure.files import File, Files
from PIL import Image

import lagfmu
from lagfmu.cli.film import film
from lagfmu.live.playable import told_by
from lagfmu.model.file import load
from lagfmu.prepare.prepare import prepare

MODELS = Path(__file__).parent.parent / "models"
MODEL = re.compile(r"\[([^\]]+)\]\(\.\./models/(\w+)\.py\)")
ROWS = re.compile(r"(?:^\|.*\|\n)+", re.MULTILINE)
ROW = re.compile(rf"^\| {MODEL.pattern} \| (.*) \|$", re.MULTILINE)
LANDING = "hemisphere"  # the model that moves on the first page
STILL = 0.4  # of a film: the frame for those who want nothing to move
EMPTY_HEAD = re.compile(r"<thead>\s*<tr>(?:\s*<th[^>]*></th>)+\s*</tr>\s*</thead>")
EMPTY_HEADING = re.compile(r"<th[^>]*></th>")
FIGURE = re.compile(r"!\[([^\]]+)\]\((hemisphere\.svg)\)")
NOTEBOOK = (
    '`jupytext --to ipynb docs/tutorial.md` makes a notebook of it (`pip install -e ".[docs]"`)'
)


def on_files(files: Files, config: Any) -> Files:
    """Adds gallery/NAME.html, .webp and .png for each model, landing.webp, and tutorial.ipynb."""
    for path in _models():
        page = lagfmu.play(path).text
        files.append(File.generated(config, f"gallery/{path.stem}.html", content=page))
        moving, still = filmed(path)
        files.append(File.generated(config, f"gallery/{path.stem}.webp", content=moving))
        files.append(File.generated(config, f"gallery/{path.stem}.png", content=still))
        if path.stem == LANDING:
            moving, _ = filmed(path, title=load(path).scenes[0].name)
            files.append(File.generated(config, "landing.webp", content=moving))
    text = files.get_file_from_path("tutorial.md").content_string
    files.append(File.generated(config, "tutorial.ipynb", content=notebook(text)))
    return files


def filmed(path: Path, title: str = "") -> tuple[bytes, bytes]:
    """The run of a model's first scene as a film, without a title as a thumbnail (film.py): WebP, and one
    frame of it as PNG."""
    file = load(path)
    scene = file.scenes[0]
    run = lagfmu.simulate(file.model, scene=scene)
    with tempfile.TemporaryDirectory() as folder:
        told = told_by(prepare(file.model, scene))
        moving, still = (
            film(told, run, {}, Path(folder, "film.webp"), title),
            Path(folder, "one.png"),
        )
        with Image.open(moving) as image:
            image.seek(round(STILL * (image.n_frames - 1)))
            image.save(still)
        return moving.read_bytes(), still.read_bytes()


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Links to model files, which the repository has, become links to the live pages, which the site has; the
    table of the gallery becomes cards, and the figure of the first page a film."""
    made = {p.stem for p in _models()}
    if page.file.src_uri == "gallery.md":
        cards = [_card(*found) for found in ROW.findall(markdown) if found[1] in made]
        if cards:
            markdown = ROWS.sub(f'<ul class="gallery">{"".join(cards)}</ul>\n', markdown, count=1)
    if page.file.src_uri == "index.md" and LANDING in made:
        markdown = FIGURE.sub(_film, markdown)

    def link(found: re.Match[str]) -> str:
        return f"[{found[1]}](gallery/{found[2]}.html)" if found[2] in made else found[1]

    return MODEL.sub(link, markdown).replace(NOTEBOOK, "[tutorial.ipynb](tutorial.ipynb)")


def on_page_content(html: str, **_: Any) -> str:
    """A table whose head is empty has none, and an empty cell of a head is no heading."""
    return EMPTY_HEADING.sub("<td></td>", EMPTY_HEAD.sub("", html))


def _card(title: str, name: str, description: str) -> str:
    moving = _moving(f"{name}.webp", f"{name}.png", "")
    return f'<li><a href="{name}.html">{moving}<strong>{title}</strong></a><br>{description}</li>'


def _film(found: re.Match[str]) -> str:
    return f'<a href="gallery/{LANDING}.html">{_moving("landing.webp", found[2], found[1])}</a>'


def _moving(film: str, still: str, text: str) -> str:
    """A film, or for those who want nothing to move one picture."""
    calm = f'<source media="(prefers-reduced-motion: reduce)" srcset="{still}">'
    return f'<picture>{calm}<img src="{film}" alt="{text}" loading="lazy"></picture>'


def notebook(text: str) -> str:
    """A text in Markdown as a notebook: its blocks of Python become cells."""
    return str(jupytext.writes(jupytext.reads(text, fmt="md"), fmt="ipynb"))


def _models() -> list[Path]:
    wanted = os.environ.get("LAGFMU_GALLERY")
    names = None if wanted is None else wanted.split(",")
    return [p for p in sorted(MODELS.glob("*.py")) if names is None or p.stem in names]
