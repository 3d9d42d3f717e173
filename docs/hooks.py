"""What the site holds besides its texts: a live page and a moving thumbnail of every model, two films, the
tutorial and the chapter of mechanics as notebooks.

LAGFMU_GALLERY=hemisphere,belt builds the pages of these models alone, for a quick look at the site.
"""

from __future__ import annotations

import os
import re
import tempfile
from functools import partial
from pathlib import Path
from typing import Any

import jupytext
from mkdocs.structure.files import File, Files
from PIL import Image

import lagfmu
from lagfmu.model.file import load
from lagfmu.prepare.prepare import prepare
from lagfmu.studio.film import film
from lagfmu.studio.live.play import told_by

MODELS = Path(__file__).parent.parent / "models"
MODEL = re.compile(r"\[([^\]]+)\]\((?:\.\./)+models/(\w+)\.py\)")
ROWS = re.compile(r"(?:^\|.*\|\n)+", re.MULTILINE)
ROW = re.compile(rf"^\| {MODEL.pattern} \| (.*) \|$", re.MULTILINE)
# in place of a page's figure of this name
FILMS = {"index.md": "hemisphere", "mechanics.md": "hoop"}
STILL = 0.4  # of a film: the frame for those who want nothing to move
EMPTY_HEAD = re.compile(r"<thead>\s*<tr>(?:\s*<th[^>]*></th>)+\s*</tr>\s*</thead>")
EMPTY_HEADING = re.compile(r"<th[^>]*></th>")
FIGURE = r"!\[([^\]]+)\]\((NAME\.\w+)\)"
NOTEBOOK = (
    "`jupytext --set-kernel python3 --to ipynb docs/tutorial.md` makes a notebook of it "
    '(`pip install -e ".[docs]"`)'
)


def on_files(files: Files, config: Any) -> Files:
    """Adds gallery/NAME.html, .webp and .png for each model, the films of pages, and the notebooks."""
    for path in _models():
        page = lagfmu.play(path).text
        files.append(File.generated(config, f"gallery/{path.stem}.html", content=page))
        moving, still = filmed(path)
        files.append(File.generated(config, f"gallery/{path.stem}.webp", content=moving))
        files.append(File.generated(config, f"gallery/{path.stem}.png", content=still))
        if path.stem in FILMS.values():
            moving, _ = filmed(path, title=load(path).scenes[0].name)
            files.append(File.generated(config, f"{path.stem}.webp", content=moving))
    for page in files.documentation_pages():
        if page.src_uri == "tutorial.md" or page.src_uri.startswith("mechanics/"):
            name = str(Path(page.src_uri).with_suffix(".ipynb"))
            files.append(File.generated(config, name, content=notebook(page.content_string)))
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
    table of the gallery becomes cards, the figures of FILMS move, and a notebook can be fetched."""
    made = {p.stem for p in _models()}
    folder, _, name = page.file.src_uri.rpartition("/")
    if page.file.src_uri == "gallery.md":
        cards = [_card(*found) for found in ROW.findall(markdown) if found[1] in made]
        if cards:
            markdown = ROWS.sub(f'<ul class="gallery">{"".join(cards)}</ul>\n', markdown, count=1)
    if (moves := FILMS.get(page.file.src_uri)) in made:
        markdown = re.sub(FIGURE.replace("NAME", moves), partial(_film, page), markdown)
    if folder == "mechanics":
        markdown += (
            f"\n\nTake this page along as a notebook: [{name[:-3]}.ipynb]({name[:-3]}.ipynb)\n"
        )
    up = "../" if folder else ""

    def link(found: re.Match[str]) -> str:
        return f"[{found[1]}]({up}gallery/{found[2]}.html)" if found[2] in made else found[1]

    return MODEL.sub(link, markdown).replace(NOTEBOOK, "[tutorial.ipynb](tutorial.ipynb)")


def on_page_content(html: str, **_: Any) -> str:
    """A table whose head is empty has none, and an empty cell of a head is no heading."""
    return EMPTY_HEADING.sub("<td></td>", EMPTY_HEAD.sub("", html))


def _card(title: str, name: str, description: str) -> str:
    moving = _moving(f"{name}.webp", f"{name}.png", "")
    return f'<li><a href="{name}.html">{moving}<strong>{title}</strong></a><br>{description}</li>'


def _film(page: Any, found: re.Match[str]) -> str:
    """The figure of a page as a film that opens the live page; links in HTML start at the page's address."""
    name, up = Path(found[2]).stem, "../" if page.url else ""
    moving = _moving(f"{up}{name}.webp", f"{up}{found[2]}", found[1])
    return f'<a href="{up}gallery/{name}.html">{moving}</a>'


def _moving(film: str, still: str, text: str) -> str:
    """A film, or for those who want nothing to move one picture."""
    calm = f'<source media="(prefers-reduced-motion: reduce)" srcset="{still}">'
    return f'<picture>{calm}<img src="{film}" alt="{text}" loading="lazy"></picture>'


def notebook(text: str) -> str:
    """A text in Markdown as a notebook: its blocks of Python become cells."""
    cells = jupytext.reads(text, fmt="md")
    cells.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3"}
    return str(jupytext.writes(cells, fmt="ipynb"))


def _models() -> list[Path]:
    wanted = os.environ.get("LAGFMU_GALLERY")
    names = None if wanted is None else wanted.split(",")
    return [p for p in sorted(MODELS.glob("*.py")) if names is None or p.stem in names]
