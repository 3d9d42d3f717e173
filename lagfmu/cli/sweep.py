"""`lagfmu sweep`: many runs, with progress, what came of them, and a figure."""

from __future__ import annotations

import re
import shlex
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from ..errors import LagfmuError, SettingError
from ..model.units import for_reading
from ..page.table import new_table, print_whole
from ..verification.reference import read_table
from .options import InputFile, StepSize, StopTime, Tolerance
from .terminal import console, plainly

SHOWN = 5  # reasons in the summary
FEW = 20  # runs that are shown each by itself
BROAD = 14  # letters of a name in a heading; a longer one is broken at its dots
QUIET = (
    5.0  # [s] at least, and a hundredth of the runs, between lines of progress without a terminal
)
NUMBER = re.compile(r"[-+]?\d[\d.]*(?:e[-+]?\d+)?")


def sweep(
    target: Annotated[Path, typer.Argument(help="An FMU, or a model file.")],
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=RANGE",
            help="A parameter, start value or solver setting; several are crossed. RANGE is "
            "FROM:TO:COUNT, FROM:TO:COUNT:log, or V,V,...",
        ),
    ] = None,
    sample: Annotated[
        list[str] | None,
        typer.Option(
            metavar="'NAME ~ LAW'",
            help="With --runs. LAW is uniform(low, high), loguniform(low, high), normal(mean, sd) or "
            "truncnormal(mean, sd, low, high).",
        ),
    ] = None,
    runs: Annotated[int | None, typer.Option(help="How many samples.")] = None,
    seed: Annotated[int, typer.Option(help="Of the samples.")] = 0,
    sampling: Annotated[str, typer.Option(help="latin-hypercube or sobol.")] = "latin-hypercube",
    rows: Annotated[
        Path | None,
        typer.Option("--from", help="A .csv or .parquet file, a row a run under the names."),
    ] = None,
    keep: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME:HOW",
            help="What to keep of each run, repeatable (default: largest multipliers, departures). HOW is "
            "last, max, min, mean, time-of-max or trajectory.",
        ),
    ] = None,
    stop_time: StopTime = None,
    step_size: StepSize = None,
    tolerance: Tolerance = None,
    inputs: InputFile = None,
    scene: Annotated[
        str | None, typer.Option(help="Which FMU of a model file (default: its first).")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="runs.parquet or .csv; .nc or .zarr with trajectories."),
    ] = None,
    on: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS", help="A Dask scheduler, tcp://HOST:PORT; else this machine."
        ),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(help="Processes of this machine (default: its cores).")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on where an interrupted sweep stopped.")
    ] = False,
    figure: Annotated[
        Path | None, typer.Option("--plot", help="Write a figure: .svg, .png or .pdf.")
    ] = None,
) -> None:
    """Run an FMU many times: parameters and start values crossed, sampled, or from a file."""
    from ..study.sweep.design import axis, distribution, from_file
    from ..study.sweep.plot import FIGURES, plot
    from ..study.sweep.sweep import sweep as run

    with plainly():
        axes, laws = _once(map(axis, vary or ())), _once(map(distribution, sample or ()))
        if figure is not None and figure.suffix not in FIGURES:
            raise SettingError(f"--plot {str(figure)!r}: expected a file {', '.join(FIGURES)}")
        table = None
        if rows is not None:
            names, values = from_file(rows)
            table = {n: values[:, k] for k, n in enumerate(names)}
        with _told(out) as tell:
            found = run(
                target,
                axes,
                sample=laws,
                runs=runs,
                seed=seed,
                sampling=sampling,
                rows=table,
                keep=keep or (),
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
        _print(found)
        if out is not None:
            console.print(f"[green]wrote[/] {escape(str(out))}", soft_wrap=True)
        if figure is not None:
            console.print(f"[green]wrote[/] {escape(str(plot(found, figure)))}", soft_wrap=True)


def _once(pairs: Iterator[tuple[str, Any]]) -> Mapping[str, Any]:
    """What is given for each name.  Raises SettingError."""
    found: dict[str, Any] = {}
    for name, value in pairs:
        if name in found:
            raise SettingError(f"{name} varies in two ways")
        found[name] = value
    return found


@contextmanager
def _told(out: Path | None) -> Iterator[Callable[[int, int, int], None]]:
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
    latest, told = time.monotonic(), 0
    with Progress(*columns, console=console, transient=True, disable=not shown) as progress:
        task = progress.add_task("runs", total=None, rate="", refused="")

        def tell(done: int, total: int, refused: int) -> None:
            nonlocal latest, told
            spent = progress.tasks[0].elapsed or 0.0
            rate = f"{done / spent:.3g}/s" if spent > 0 else ""
            more = f"{refused} refused" if refused else ""
            progress.update(task, completed=done, total=total, rate=rate, refused=more)
            if not shown and time.monotonic() - latest > QUIET and done >= told + 0.01 * total:
                latest, told = time.monotonic(), done
                console.print(f"{done} of {total} runs {more}".rstrip(), highlight=False)

        try:
            yield tell
        except KeyboardInterrupt:
            raise LagfmuError(
                "interrupted: nothing was kept, because there is no --out"
                if out is None
                else f"interrupted: what is finished is in {out}.parts; go on with the same command and "
                "--resume"
            ) from None


def _print(found: Any) -> None:
    """A row a run where there are few, else a line a kept quantity; the causes of what was refused."""
    from ..study.sweep.table import numbers, one_by_one

    runs = one_by_one(found)
    status = runs["status"].values
    refused = int((status != "ok").sum())
    title = f"{Path(found.attrs['fmu']).stem}: {len(status)} runs, {refused} refused"
    names = numbers(found)
    console.print(escape(title), highlight=False)
    if len(status) > FEW or not names:
        for name in names:
            text = _range(runs, name, refused)
            console.print(f"  {escape(name)}: {escape(text)}", highlight=False, soft_wrap=True)
    else:
        _print_runs(runs, names, refused > 0)
    _print_reasons([str(r) for r in runs["reason"].values if r])


def _print_runs(runs: Any, names: Sequence[str], refused: bool) -> None:
    """What varied and what was kept, a row a run; `refused`: with the status of each."""
    from ..study.sweep.table import happened, varied

    causes = varied(runs)
    headings = [f"{_broken(n)}\n{escape(_unit(runs, n, True))}".rstrip() for n in causes]
    for name in names:
        of, _, how = name.rpartition(":")
        headings.append(f"{_broken(of)}\n{how} {escape(_unit(runs, name, True))}".rstrip())
    drawn = new_table("", *headings, *(["status"] if refused else []))
    columns = [runs[n].values for n in causes] + [happened(runs, n) for n in names]
    status = runs["status"].values
    for k in range(len(status)):
        good = status[k] == "ok"
        cells = [_number(c[k]) for c in columns[: len(causes)]]
        cells += [_number(c[k], "never") if good else "" for c in columns[len(causes) :]]
        drawn.add_row(*cells, *([str(status[k])] if refused else []))
    print_whole(console, drawn)


def _broken(name: str) -> str:
    """A name that makes no column wide by itself, for a heading."""
    return escape("\n".join(re.findall(r"[^.]+\.?", name)) if len(name) > BROAD else name)


def _range(runs: Any, name: str, refused: int) -> str:
    """From the least to the largest value, of the runs in which there is one."""
    from ..study.sweep.table import INFINITE, happened

    values = happened(runs, name)
    finite = values[np.isfinite(values) & (np.abs(values) < INFINITE)]
    never = int(np.isnan(values).sum()) - refused
    notes = [f"never in {never} runs"] if never else []
    if endless := int((np.abs(values) >= INFINITE).sum()):
        notes.append(f"infinite in {endless} runs")
    if not len(finite):
        return ", ".join(notes) or "nothing"
    unit = _unit(runs, name, False)
    text = f"{_number(finite.min())} ... {_number(finite.max())} {unit}".rstrip()
    return ", ".join([text, *notes])


def _unit(runs: Any, name: str, bracketed: bool) -> str:
    unit = for_reading(str(runs[name].attrs.get("units", "")))
    return f"[{unit}]" if unit and bracketed else unit


def _number(value: float, none: str = "") -> str:
    """Six digits; of what has no value, `none`."""
    from ..study.sweep.table import INFINITE

    if np.isnan(value):
        return none
    return "infinite" if abs(value) >= INFINITE else f"{value:.6g}"


def _print_reasons(texts: Sequence[str]) -> None:
    """Those that differ in numbers are one."""
    first = {NUMBER.sub("#", r): r for r in reversed(texts)}
    reasons = Counter(NUMBER.sub("#", r) for r in texts)
    for kind, count in reasons.most_common(SHOWN):
        text = first[kind] if count == 1 else f"{first[kind]}, and {count - 1} like it"
        console.print(f"  {count} refused: {escape(text)}", highlight=False, soft_wrap=True)
    if len(reasons) > SHOWN:
        rest = sum(reasons.values()) - sum(c for _, c in reasons.most_common(SHOWN))
        console.print(f"  {rest} refused for {len(reasons) - SHOWN} other reasons", highlight=False)
