"""How far a sweep has come, on a terminal and in a log."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from ..errors import UserInterruptError
from .terminal import console

QUIET = (
    5.0  # [s] at least, and a hundredth of the runs, between lines of progress without a terminal
)


@contextmanager
def told(out: Path | None) -> Iterator[Callable[[int, int, int], None]]:
    """Progress with rate and remaining time; after an interruption, what is left and how to go on."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(compact=True),
        TextColumn("{task.fields[refused]}"),
    )
    shown = console.is_terminal
    latest, said = time.monotonic(), 0
    with Progress(*columns, console=console, transient=True, disable=not shown) as progress:
        task = progress.add_task("runs", total=None, rate="", refused="")

        def tell(done: int, total: int, refused: int) -> None:
            nonlocal latest, said
            spent = progress.tasks[0].elapsed or 0.0
            rate = f"{done / spent:.3g}/s" if spent > 0 else ""
            more = f"{refused} refused" if refused else ""
            progress.update(task, completed=done, total=total, rate=rate, refused=more)
            if not shown and time.monotonic() - latest > QUIET and done >= said + 0.01 * total:
                latest, said = time.monotonic(), done
                console.print(f"{done} of {total} runs {more}".rstrip(), highlight=False)

        try:
            yield tell
        except KeyboardInterrupt:
            raise UserInterruptError(
                "interrupted: nothing was kept, because there is no --out"
                if out is None
                else f"interrupted: what is finished is in {out}.parts; go on with the same command and "
                "--resume"
            ) from None
