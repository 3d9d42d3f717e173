"""What the commands print on: a console that never crops, on any width and in any encoding."""

from __future__ import annotations

import codecs
import contextlib
import sys
import unicodedata
import warnings
from collections.abc import Iterator, Sequence
from typing import Any

import typer
from rich.box import SIMPLE_HEAD
from rich.console import Console, RenderableType
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from ..errors import LagfmuError, SettingError, TemporaryFolderError
from ..verification.pipeline import WRONG_USAGE, UsageError

console = Console()
errors = Console(stderr=True)

PLAIN = {"≤": "<=", "≥": ">=", "−": "-", "–": "-", "→": "->", "●": "*", "µ": "u", "√": "sqrt"}
ACCENTS = {"\u0307": "'", "\u0308": "''"}  # combining dots: derivatives


def spelled(text: str) -> str:
    """A text in ASCII as far as there are words for it: lambda for λ, theta' for θ̇, <= for ≤."""
    return "".join(_spelled(c) for c in text)


def _spelled(letter: str) -> str:
    known = PLAIN.get(letter) or ACCENTS.get(letter)
    if known:
        return known
    parts = unicodedata.normalize("NFKD", letter)
    if len(parts) > 1:
        return spelled(parts)
    name = unicodedata.name(letter, "")
    if name.startswith("GREEK "):
        word = name.split(" WITH ")[0].split()[-1].lower().replace("lamda", "lambda")
        return word.capitalize() if "CAPITAL" in name else word
    return letter if letter.isascii() else "?"


def _replace(error: UnicodeError) -> tuple[str, int]:
    """Error handler of a codec; see `spelled`."""
    assert isinstance(error, UnicodeEncodeError)
    return spelled(error.object[error.start : error.end]), error.end


codecs.register_error("lagfmu.spelled", _replace)


def prepare_streams() -> None:
    """Let stdout and stderr spell out what their encoding (cp1252, ASCII) does not have."""
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors="lagfmu.spelled")


def new_table(title: str, *columns: str, text: Sequence[str] = ()) -> Table:
    """An empty table: columns of numbers to the right, in one piece; those named in `text` may fold."""
    drawn = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for heading in columns:
        drawn.add_column(
            heading,
            justify="left" if heading in text else "right",
            no_wrap=heading not in text,
            overflow="fold",
        )
    return drawn


def _width(cell: RenderableType) -> int:
    """Of its longest line."""
    if not isinstance(cell, str):
        return 0
    return max((line.cell_len for line in Text.from_markup(cell).split()), default=0)


def print_whole(console: Console, drawn: Table) -> None:
    """Print a table without cutting anything: row by row in words where the console is too narrow."""
    for column in drawn.columns:
        if column.no_wrap:
            column.min_width = max(map(_width, (column.header, *column.cells)))
    unbounded = console.options.update(width=10_000)
    if console.measure(drawn, options=unbounded).minimum <= console.width:
        console.print(drawn)
        return
    console.print(drawn.title or "", style="bold", highlight=False)
    headings = [" ".join(str(c.header).split()) for c in drawn.columns]
    for cells in zip(*(c.cells for c in drawn.columns), strict=True):
        parts = [
            f"{heading} {cell}".strip()
            for heading, cell in zip(headings, cells, strict=True)
            if cell
        ]
        console.print("  " + ", ".join(parts), highlight=False)


@contextlib.contextmanager
def plainly() -> Iterator[None]:
    """Warnings and errors as one message each; exit status 1 after an error, 2 after wrong usage."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            yield
        except LagfmuError as error:
            errors.print(
                f"[bold red]error:[/] {escape(str(error))}", highlight=False, soft_wrap=True
            )
            misused = isinstance(error, (UsageError, SettingError))
            raise typer.Exit(WRONG_USAGE if misused else 1) from None
        except OSError as error:
            text = escape(str(TemporaryFolderError(error)))
            errors.print(f"[bold red]error:[/] {text}", highlight=False, soft_wrap=True)
            raise typer.Exit(1) from None
        finally:
            for message in dict.fromkeys(str(w.message) for w in caught if _ours(w)):
                errors.print(
                    f"[yellow]warning:[/] {escape(message)}", highlight=False, soft_wrap=True
                )


def _ours(warning: Any) -> bool:
    return str(getattr(warning.category, "__module__", "")).startswith("lagfmu")
