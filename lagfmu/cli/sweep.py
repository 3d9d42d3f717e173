"""`lagfmu sweep`: many runs, with progress, a summary of what was refused, and a figure."""

from __future__ import annotations

import re
import shlex
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from ..errors import LagfmuError, SettingError
from ..study.sweep.design import axis, distribution, from_file
from ..study.sweep.plot import plot
from ..study.sweep.sweep import sweep
from ..verification.reference import read_table

FIGURES = (".svg", ".png", ".pdf")
SHOWN = 5  # reasons in the summary
NUMBER = re.compile(r"[-+]?\d[\d.]*(?:e[-+]?\d+)?")


def run_sweep(
    target: Path,
    console: Console,
    vary: Sequence[str],
    sample: Sequence[str],
    runs: int | None,
    seed: int,
    sampling: str,
    rows: Path | None,
    keep: Sequence[str],
    stop_time: float | None,
    step_size: float | None,
    tolerance: float | None,
    inputs: Path | None,
    scene: str | None,
    out: Path | None,
    on: str | None,
    workers: int | None,
    resume: bool,
    figure: Path | None,
) -> None:
    """Do it, print what came of it.  Raises LagfmuError."""
    axes, laws = dict(map(axis, vary)), dict(map(distribution, sample))
    if len(axes) < len(vary) or len(laws) < len(sample):
        raise SettingError(f"a quantity varies in two ways: {', '.join((*vary, *sample))}")
    if figure is not None and figure.suffix not in FIGURES:
        raise SettingError(f"--plot {str(figure)!r}: expected a file {', '.join(FIGURES)}")
    table = None
    if rows is not None:
        names, values = from_file(rows)
        table = {n: values[:, k] for k, n in enumerate(names)}
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(compact=True),
        TextColumn("{task.fields[refused]}"),
    )
    shown = console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=not shown) as progress:
        task = progress.add_task("runs", total=None, rate="", refused="")
        milestones = iter(range(10, 101, 10))
        told = [next(milestones)]

        def tell(done: int, total: int, refused: int) -> None:
            spent = progress.tasks[0].elapsed or 0.0
            rate = f"{done / spent:.3g}/s" if spent > 0 else ""
            more = f"{refused} refused" if refused else ""
            progress.update(task, completed=done, total=total, rate=rate, refused=more)
            if not shown and total and 100 * done >= told[0] * total:
                while 100 * done >= told[0] * total and told[0] < 100:
                    told[0] = next(milestones)
                console.print(f"{done} of {total} runs {more}".rstrip(), highlight=False)

        try:
            found = sweep(
                target,
                axes,
                sample=laws,
                runs=runs,
                seed=seed,
                sampling=sampling,
                rows=table,
                keep=keep,
                stop_time=stop_time,
                step_size=step_size,
                tolerance=tolerance,
                inputs=None if inputs is None else read_table(inputs),
                scene=scene,
                out=out,
                on=on,
                workers=workers,
                resume=resume,
                progress=tell,
                command=shlex.join(["lagfmu", *sys.argv[1:]]),
            )
        except KeyboardInterrupt:
            where = f"{out}.parts" if out is not None else None
            raise LagfmuError(
                f"interrupted: what is finished is in {where}; go on with the same command and --resume"
                if where
                else "interrupted: nothing was kept, because there is no --out"
            ) from None
    _print(console, found)
    if out is not None:
        console.print(f"[green]wrote[/] {escape(str(out))}", soft_wrap=True)
    if figure is not None:
        console.print(f"[green]wrote[/] {escape(str(plot(found, figure)))}", soft_wrap=True)


def _print(console: Console, found: Any) -> None:
    """A line a kept quantity, and the causes of what was refused."""
    status = found["status"].values.ravel()
    good = int((status == "ok").sum())
    console.print(f"{len(status)} runs, {len(status) - good} refused", highlight=False)
    for name, array in found.data_vars.items():
        values = array.values
        if values.dtype.kind != "f" or name == "reached":
            continue
        values = values[np.isfinite(values)]
        unit = array.attrs.get("units", "")
        text = f"{values.min():.6g} ... {values.max():.6g} {unit}" if len(values) else "nothing"
        console.print(f"  {escape(str(name))}: {text}".rstrip(), highlight=False, soft_wrap=True)
    texts = [str(r) for r in found["reason"].values.ravel() if r]
    first = {
        NUMBER.sub("#", r): r for r in reversed(texts)
    }  # reasons that differ in numbers are one
    reasons = Counter(NUMBER.sub("#", r) for r in texts)
    for kind, count in reasons.most_common(SHOWN):
        text = first[kind] if count == 1 else f"{first[kind]}, and {count - 1} like it"
        console.print(f"  {count} refused: {escape(text)}", highlight=False, soft_wrap=True)
    if len(reasons) > SHOWN:
        rest = sum(reasons.values()) - sum(c for _, c in reasons.most_common(SHOWN))
        console.print(f"  {rest} refused for {len(reasons) - SHOWN} other reasons", highlight=False)
