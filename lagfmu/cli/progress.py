"""How far a study has come, on a terminal and in a log."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    TextColumn,
)

from ..errors import UserInterruptError
from .terminal import console, say

FIRST, QUIET = 2.0, 10.0  # [s] until the first line, and between lines, without a terminal
Tick = Callable[[str, int, int], None]  # what is done, how far, of how many


@contextmanager
def progress(console: Console, title: str) -> Iterator[Tick]:
    """A bar that goes when the work is done; what it yields is told how far it has come.  Without a terminal
    the title alone."""
    if not console.is_terminal:
        say(f"{title} ...", on=console)
    with _bar(console, title, SpinnerColumn()) as tick:
        yield tick


@contextmanager
def _bar(console: Console, title: str, *first: ProgressColumn) -> Iterator[Tick]:
    what = TextColumn("{task.fields[what]}", markup=False)
    columns = (*first, TextColumn(title, markup=False), BarColumn(), MofNCompleteColumn(), what)
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as shown:
        task = shown.add_task("", total=None, what="")

        def tick(what: str, done: int, total: int) -> None:
            shown.update(task, completed=done, total=total, what=what)

        yield tick


@contextmanager
def told(out: Path | None, workers: int | None) -> Iterator[Callable[[int, int, int], None]]:
    """Progress with rate, remaining time and what a run costs on one of the `workers`; after an interruption,
    what is left and how to go on."""
    begun, due, first = time.monotonic(), FIRST, -1
    with _bar(console, "runs") as tick:

        def tell(done: int, total: int, refused: int) -> None:
            nonlocal begun, due, first
            now = time.monotonic()
            if first < 0:  # those of the sweep that goes on cost nothing here
                begun, first = now, done
            pace = _pace(done - first, total - done, now - begun, workers)
            pace += f", {refused} refused" if refused else ""
            tick(pace, done, total)
            if not console.is_terminal and now - begun > due and done < total:
                due = now - begun + QUIET
                say(f"{done} of {total} runs: {pace}")

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
