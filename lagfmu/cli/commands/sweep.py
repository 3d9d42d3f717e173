"""`lagfmu sweep`: many runs, with progress, what came of them, and a figure."""

from __future__ import annotations

import os
import shlex
import sys
from pathlib import Path
from typing import Annotated

import typer

from ...errors import SettingError
from ..options import InputFile, Plot, Runnable, SceneName, StepSize, StopTime, Tolerance, once
from ..terminal import plainly, say_wrote


def sweep(
    target: Runnable,
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
    runs: Annotated[int | None, typer.Option(help="Number of samples.")] = None,
    seed: Annotated[int, typer.Option(help="Seed of the samples.")] = 0,
    sampling: Annotated[str, typer.Option(help="latin-hypercube or sobol.")] = "latin-hypercube",
    rows: Annotated[
        Path | None,
        typer.Option(
            "--from", help="A .csv or .parquet file: a column for each name, a row for each run."
        ),
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
    scene: SceneName = None,
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
    timeout: Annotated[
        float | None,
        typer.Option(help="Time limit of one run in s; its row then has the status timeout."),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue an interrupted sweep.")
    ] = False,
    figure: Plot = None,
) -> None:
    """Run an FMU many times: parameters and start values crossed, sampled, or from a file."""
    from ...studio.sweep.design import axis, distribution, from_file
    from ...studio.sweep.plot import FIGURES, plot
    from ...studio.sweep.sweep import sweep as run
    from ..progress import told
    from ..swept import print_sweep

    with plainly():
        axes, laws = once(map(axis, vary or ())), once(map(distribution, sample or ()))
        if figure is not None and figure.suffix not in FIGURES:
            raise SettingError(f"--plot {str(figure)!r}: expected a file {', '.join(FIGURES)}")
        table = None
        if rows is not None:
            names, values = from_file(rows)
            table = {n: values[:, k] for k, n in enumerate(names)}
        with told(out, (workers or os.cpu_count() or 1) if on is None else None) as tell:
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
                inputs=inputs,
                scene=scene,
                out=out,
                on=on,
                workers=workers,
                resume=resume,
                timeout=timeout,
                progress=tell,
                command=shlex.join(["lagfmu", *sys.argv[1:]]),
            )
        print_sweep(found)
        if out is not None:
            say_wrote(out)
        if figure is not None:
            say_wrote(plot(found, figure))
