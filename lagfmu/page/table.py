"""Tables for the terminal: none is cut, however narrow the console."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from functools import partial

from rich.box import SIMPLE_HEAD
from rich.console import Console, RenderableType
from rich.table import Table
from rich.text import Text


def new_table(
    title: str, *columns: str, text: Sequence[str] = (), words: Sequence[str] = ()
) -> Table:
    """An empty table: columns of numbers to the right, in one piece; `words` to the left, and `text`, which
    may fold."""
    drawn = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for heading in columns:
        drawn.add_column(
            heading,
            justify="left" if heading in (*text, *words) else "right",
            no_wrap=heading not in text,
            overflow="fold",
        )
    return drawn


def _width(cell: RenderableType) -> int:
    """Of its longest line."""
    if not isinstance(cell, str):
        return 0
    return max((line.cell_len for line in Text.from_markup(cell, emoji=False).split()), default=0)


def printed(what: Callable[[Console], None], width: int) -> str:
    """What is printed on a console of that width, as plain text."""
    file = io.StringIO()
    what(Console(file=file, width=width, color_system=None, force_jupyter=False, emoji=False))
    return "\n".join(line.rstrip() for line in file.getvalue().strip("\n").splitlines())


def as_text(*drawn: Table) -> str:
    """Tables as plain text, as wide as they are."""
    return "\n".join(printed(partial(print_whole, drawn=table), 10_000) for table in drawn)


def print_whole(console: Console, drawn: Table) -> None:
    """Print a table without cutting anything: row by row in words where the console is too narrow."""
    for column in drawn.columns:
        if column.no_wrap:
            column.min_width = max(map(_width, (column.header, *column.cells)))
    unbounded = console.options.update(width=10_000)
    narrow = console.measure(drawn, options=unbounded).minimum > console.width
    if drawn.title or narrow:  # not by the table, which would fold it to its own width
        console.print(drawn.title or "", style="bold", highlight=False)
    if not narrow:
        title, drawn.title = drawn.title, None
        console.print(drawn)
        drawn.title = title
        return
    headings = [" ".join(str(c.header).split()) for c in drawn.columns]
    for cells in zip(*(c.cells for c in drawn.columns), strict=True):
        parts = [
            f"{heading} {cell}".strip()
            for heading, cell in zip(headings, cells, strict=True)
            if cell
        ]
        console.print("  " + ", ".join(parts), highlight=False)
