"""How far a sweep has come, on a terminal and in a log."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from ..errors import UserInterruptError
from .terminal import console

FIRST, QUIET = (
    2.0,
    10.0,
)  # [s] until the first line, and between lines, of progress without a terminal


@contextmanager
def told(out: Path | None, workers: int | None) -> Iterator[Callable[[int, int, int], None]]:
    """Progress with rate, remaining time and what a run costs on one of the `workers`; after an interruption,
    what is left and how to go on."""
    columns = (
        TextColumn("runs"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[pace]}"),
    )
    shown = console.is_terminal
    begun, due, first = time.monotonic(), FIRST, -1
    with Progress(*columns, console=console, transient=True, disable=not shown) as progress:
        task = progress.add_task("", total=None, pace="")

        def tell(done: int, total: int, refused: int) -> None:
            nonlocal begun, due, first
            now = time.monotonic()
            if first < 0:  # those of the sweep that goes on cost nothing here
                begun, first = now, done
            pace = _pace(done - first, total - done, now - begun, workers)
            pace += f", {refused} refused" if refused else ""
            progress.update(task, completed=done, total=total, pace=pace)
            if not shown and now - begun > due and done < total:
                due = now - begun + QUIET
                console.print(f"{done} of {total} runs: {pace}", highlight=False, soft_wrap=True)

        try:
            yield tell
        except KeyboardInterrupt:
            raise UserInterruptError(
                "interrupted: nothing was kept, because there is no --out"
                if out is None
                else f"interrupted: what is finished is in {out}.parts; go on with the same command and "
                "--resume"
            ) from None


def _pace(done: int, left: int, spent: float, workers: int | None) -> str:
    """Runs a second, the time that the rest will take, and what one costs a worker."""
    if not done or spent <= 0:
        return f"none done after {spent:.0f} s"
    rate = done / spent
    cost = "" if workers is None else f", {_time(workers / rate)} a run"
    return f"{rate:.3g}/s{cost}, {_time(left / rate)} left"


def _time(seconds: float) -> str:
    """With the unit in which it is read."""
    if seconds < 1:
        return f"{1e3 * seconds:.3g} ms"
    if seconds < 100:
        return f"{seconds:.2g} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 100 else f"{seconds / 3600:.1f} h"
