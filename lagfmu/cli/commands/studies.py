"""Commands that ask more of an FMU than one run: at extremes, in other settings, over a design, until it
fits; or what is linear beside a state.
"""

from __future__ import annotations

import math
import os
import shlex
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from ...errors import SettingError, UsageError
from ..options import (
    InputFile,
    JsonFile,
    JunitFile,
    Plot,
    Runnable,
    Runnables,
    SceneName,
    SceneNames,
    Settings,
    StepSize,
    StopTime,
    Target,
    Tolerance,
    assignments,
    once,
)
from ..terminal import console, plainly, say, say_wrote


def stress(
    targets: Runnables,
    target: Target = None,
    scene: SceneNames = None,
    quick: Annotated[bool, typer.Option("--quick", help="Half of the probes.")] = False,
    limit: Annotated[float, typer.Option(help="Time limit of one probe in s.")] = 60.0,
    json: JsonFile = None,
    junit: JunitFile = None,
) -> None:
    """Try FMUs at extreme values: each probe is right, refused with a reason, or wrong."""
    from ..progress import finish
    from ..studies import stress as probed

    with plainly():
        done = probed(targets, console, target, scene or (), quick, limit=limit)
        finish("stress", done, json, junit)


def tradeoff(
    targets: Runnables,
    out: Annotated[Path, typer.Option("--out", "-o", help="Output folder.")] = Path(
        "dist/tradeoff"
    ),
    target: Target = None,
    scene: SceneNames = None,
    step_size: Annotated[
        float | None, typer.Option(help="Communication step in s (default: the FMU's own).")
    ] = None,
    tolerance: Annotated[
        list[float] | None, typer.Option(help="Relative tolerance; repeatable.")
    ] = None,
    method: Annotated[list[str] | None, typer.Option(help="Solver method; repeatable.")] = None,
    repeats: Annotated[int | None, typer.Option(help="Timed runs of each setting.")] = None,
    full: Annotated[
        bool,
        typer.Option("--full", help="Every decade of the tolerance, not every other one."),
    ] = False,
    json: JsonFile = None,
    junit: JunitFile = None,
) -> None:
    """Measure the error of lambda and the wall time of each method and tolerance.

    The table marks a closed form that a setting misses; the exit code does not judge it.
    """
    from ..progress import finish
    from ..studies import compare

    with plainly():
        done = compare(
            targets,
            out,
            console,
            target,
            step_size,
            tolerance or (),
            method or (),
            repeats,
            scene or (),
            full,
        )
        finish("tradeoff", done, json, junit)


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


def fit(
    target: Runnable,
    measured: Annotated[
        list[Path],
        typer.Argument(
            metavar="MEASURED.csv...",
            help="Tables with a column time and one for each measured output, input and parameter of the "
            "experiment; 'force.A.x \\[kN]' has a unit of its own, empty cells are gaps.",
        ),
    ],
    free: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME[=LOW:HIGH[:START]]",
            help="A parameter or start value to be found; repeatable.",
        ),
    ] = None,
    measure: Annotated[
        list[str] | None,
        typer.Option(
            metavar="OUTPUT[:DEVIATION]",
            help="An output that was measured, and its standard deviation (else it is estimated); repeatable "
            "(default: every column that is an output).",
        ),
    ] = None,
    offset: Annotated[
        float, typer.Option(help="The clocks may be wrong by up to this many s, and are set right.")
    ] = 0.0,
    loss: Annotated[
        str, typer.Option(help="linear; soft_l1, huber, cauchy, arctan against outliers.")
    ] = "linear",
    set_: Settings = None,
    tolerance: Annotated[
        float | None, typer.Option(help="Relative tolerance of the runs (default 1e-9).")
    ] = None,
    step_size: StepSize = None,
    scene: SceneName = None,
    json: JsonFile = None,
    figure: Plot = None,
) -> None:
    """Find the values of parameters and start values that explain what was measured.

    Exit code 1 if the search does not converge.
    """
    from ...files import write_whole
    from ...fmu.read import read_description, units_of
    from ...fmu.write import as_fmu
    from ...page.table import print_whole
    from ...studio.fit.problem import bounds_of, derivatives_of, deviation_of, named
    from ...studio.fit.solve import TOLERANCE
    from ...studio.fit.solve import fit as found_by
    from ...verification.pipeline import FAILS, text_of

    with plainly():
        sought, wanted = once(named(free or (), "=")), once(named(measure or (), ":"))
        with as_fmu(target, scene, sensitivities=derivatives_of(sought, wanted)) as fmu:
            units = units_of(read_description(fmu).modelVariables)
            found = found_by(
                fmu,
                [str(p) for p in measured],
                {n: bounds_of(n, text, units) for n, text in sought.items()},
                {n: deviation_of(n, text, units) for n, text in wanted.items()},
                start_values=assignments(set_, lambda: units),
                offset=offset,
                loss=loss,
                tolerance=TOLERANCE if tolerance is None else tolerance,
                step_size=step_size,
            )
        say(found.summary())
        print_whole(console, found.table())
        for text in found.remarks():
            say(text, "note:", "yellow")
        if json is not None:
            write_whole(json, text_of(found.to_dict()).encode())
            say_wrote(json)
        if figure is not None:
            say_wrote(found.plot(figure))
        if not found.converged:
            raise typer.Exit(FAILS)


def sensitivity(
    target: Runnable,
    of: Annotated[
        list[str],
        typer.Option(
            metavar="OUTPUT,...",
            help="Outputs at the end of the run, such as departure.surface.time,peak.lambda.rod.max.",
        ),
    ],
    to: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME,...", help="Parameters and start values (default: all)."),
    ] = None,
    over: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=LOW:HIGH",
            help="Indices over ranges instead of derivatives, by SALib; repeatable.",
        ),
    ] = None,
    method: Annotated[
        str, typer.Option(help="With --over: sobol (parts of the variance) or morris.")
    ] = "sobol",
    samples: Annotated[
        int, typer.Option(help="With --over: of Sobol's plan, or Morris's trajectories.")
    ] = 256,
    seed: Annotated[int, typer.Option(help="With --over: of the samples.")] = 0,
    set_: Settings = None,
    stop_time: StopTime = None,
    step_size: StepSize = None,
    tolerance: Annotated[
        float | None, typer.Option(help="Relative tolerance of the runs (default 1e-11).")
    ] = None,
    inputs: InputFile = None,
    scene: SceneName = None,
    on: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="With --over: a Dask scheduler.")
    ] = None,
    json: JsonFile = None,
    figure: Plot = None,
) -> None:
    """How outputs change with parameters: derivatives at the given values, or indices over ranges."""
    from ...files import write_whole
    from ...fmu.read import read_description, units_of
    from ...model.scene import listed
    from ...page.table import print_whole
    from ...studio.sensitivity.local import ALL, TOLERANCE, made_for
    from ...studio.sensitivity.local import sensitivity as found_by
    from ...studio.sensitivity.ranges import over_ranges
    from ...verification.pipeline import text_of

    outputs = [n for text in of for n in listed(text)]
    by = [n for text in to or () for n in listed(text)] or ALL
    with plainly(), made_for(target, outputs, by, scene) as fmu:
        units = units_of(read_description(fmu).modelVariables)
        given = assignments(set_, lambda: units)
        run: dict[str, Any] = {"stop_time": stop_time, "step_size": step_size, "inputs": inputs}
        found: Any
        if over:
            if to or given:
                raise UsageError(
                    "--to and --set are for derivatives; --over says itself what varies"
                )
            ranges = once(_range(text) for text in over)
            found = over_ranges(
                fmu,
                list(outputs),
                ranges,
                method,
                samples,
                seed,
                tolerance=tolerance,
                on=on,
                **run,
            )
        else:
            if on is not None:
                raise UsageError("--on is for --over")
            found = found_by(
                fmu,
                outputs,
                by,
                start_values=given,
                tolerance=TOLERANCE if tolerance is None else tolerance,
                **run,
            )
        for table in found.tables():
            print_whole(console, table)
        for text in found.remarks():
            say(text, "note:", "yellow")
        if json is not None:
            write_whole(json, text_of(found.to_dict()).encode())
            say_wrote(json)
        if figure is not None:
            say_wrote(found.plot(figure))


def _range(text: str) -> tuple[str, tuple[float, float]]:
    name, sign, ends = (part.strip() for part in text.partition("="))
    try:
        low, high = (float(part) for part in ends.split(":"))
    except ValueError:
        sign = ""
    if not sign or not math.isfinite(low + high):
        raise UsageError(f"--over {text!r}: expected NAME=LOW:HIGH, finite numbers in SI")
    return name, (low, high)


def linearize(
    target: Runnable,
    at: Annotated[
        float | None,
        typer.Option(metavar="T", help="Beside the motion at this time in s (default: the start)."),
    ] = None,
    equilibrium: Annotated[
        bool,
        typer.Option(
            "--equilibrium", help="Beside the equilibrium that is found from the start, at rest."
        ),
    ] = False,
    inputs: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME,...", help="Inputs u (default: all); '' for none."),
    ] = None,
    outputs: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME,...",
            help="Outputs y (default: multipliers, forces of constraint, outputs of the model's own).",
        ),
    ] = None,
    set_: Settings = None,
    scene: SceneName = None,
    output: Annotated[
        list[Path] | None,
        typer.Option(help="Write A, B, C, D and all else: .json or .mat; repeatable."),
    ] = None,
    page: Annotated[
        Path | None, typer.Option(help="Write an HTML file on which the modes move.")
    ] = None,
) -> None:
    """A, B, C, D, poles and modes in coordinates that the constraints leave free."""
    from ...fmu.read import read_description, units_of
    from ...model.scene import listed
    from ...page.table import print_whole
    from ...studio.linearize.linearize import linearize as found_by
    from ...studio.linearize.linearize import made_for

    def names(given: list[str] | None) -> list[str] | None:
        return None if given is None else [n for text in given for n in listed(text)]

    with plainly(), made_for(target, scene) as fmu:
        found = found_by(
            fmu,
            at=at,
            equilibrium=equilibrium,
            inputs=names(inputs),
            outputs=names(outputs),
            start_values=assignments(set_, lambda: units_of(read_description(fmu).modelVariables)),
            page=page,
        )
        say(found.summary())
        for table in found.tables():
            print_whole(console, table)
        for text in found.remarks():
            say(text, "note:", "yellow")
        for path in output or ():
            say_wrote(found.save(path))
        if page is not None:
            say_wrote(page)
