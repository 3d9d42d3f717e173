"""The `lagfmu` command: build, show, verify, simulate.  Errors are one message, never a traceback."""

from __future__ import annotations

import contextlib
import difflib
import enum
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from ..api import package
from ..errors import CannotStartError, LagfmuError, SimulationError, VerificationError
from ..fmu.compiler import HOST, NAMES
from ..fmu.described import read_description
from ..fmu.native import takes_long
from ..fmu.write import write_whole
from ..interface.variables import VariableTable
from ..live.command import write_page
from ..live.playable import told_by
from ..model.file import ModelFile, load
from ..model.formula import with_outputs
from ..model.goal import parse
from ..model.library import known, new
from ..model.model import Model
from ..model.scene import Scene
from ..model.units import for_reading
from ..names import DEPARTURE_TIME, METHOD, SLIP_TIME, those
from ..page.table import new_table, print_whole
from ..page.text import show as show_prepared
from ..page.text import show_what_is_known
from ..prepare.prepare import prepare
from ..study.tradeoff.page import section
from ..verification.crosscheck import as_csv, write_crosscheck
from ..verification.pipeline import Report, UsageError, as_json, as_junit, exit_code
from ..verification.plot import default_names
from ..verification.reference import read_table
from ..verification.result import NOT_YET, Result, as_text
from ..verification.simulate import simulate
from ..verification.verify import Verification
from . import say_version
from .film import film
from .options import (
    NARROWING,
    OPTIONS,
    AddOutput,
    Arguments,
    ErrorBars,
    InputFile,
    Needs,
    StepSize,
    StopTime,
    Tolerance,
    narrowed,
    takes,
)
from .stress import LIMIT
from .stress import stress as stress_fmus
from .sweep import sweep
from .terminal import console, errors, plainly, prepare_streams
from .tradeoff import chosen_for, compare
from .verify import examine

app = typer.Typer(
    help="Lagrange's equations with multipliers, from SymPy to FMUs that report forces of constraint.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


def _version(wanted: bool) -> None:
    if wanted:
        say_version()
        raise typer.Exit


@app.callback()
def prepared_streams(
    _: Annotated[
        bool,
        typer.Option("--version", callback=_version, is_eager=True, help="Print the version."),
    ] = False,
) -> None:
    """Lagrange's equations with multipliers, from SymPy to FMUs that report forces of constraint."""
    prepare_streams()


class Target(enum.StrEnum):
    """What an FMU is made of."""

    python = "python"
    native = "native"


ModelPath = Annotated[Path, typer.Argument(help="A Python file that defines a Model.")]
FmuPath = Annotated[Path, typer.Argument(help="An FMU built by lagfmu.")]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="A parameter or start value; repeatable."),
]
JsonFile = Annotated[Path | None, typer.Option(help="Write everything as JSON.")]
JunitFile = Annotated[Path | None, typer.Option(help="Write JUnit's XML, a suite an FMU.")]


@app.command()
@takes(*OPTIONS)
def build(
    model: ModelPath,
    out: Annotated[Path, typer.Option("--out", "-o", help="Output folder.")] = Path("dist"),
    scene: Annotated[
        list[str] | None, typer.Option(help="Only these FMUs of the file; repeatable.")
    ] = None,
    arguments: Arguments = None,
    check: Annotated[bool, typer.Option(help="Verify each FMU after building it.")] = True,
    reference: Annotated[
        bool, typer.Option("--reference", help="Put reference results inside (FMI-LS-REF).")
    ] = False,
    target: Annotated[
        Target, typer.Option(help="python: needs Python where it runs. native: compiled C.")
    ] = Target.python,
    platforms: Annotated[
        list[str] | None,
        typer.Option(
            "--platforms",
            metavar="all|host|NAME...",
            help=f"Where a native FMU can run: host, all, or some of {', '.join(NAMES)}; repeatable.",
        ),
    ] = None,
    accuracy: Annotated[
        str | None,
        typer.Option(
            metavar="ERROR[:OUTPUT,...]",
            help="Measure, and build with the cheapest solver settings and formulation that hold this "
            "relative error, e.g. 1e-6 or 1e-6:lambda.surface.",
        ),
    ] = None,
    page_: Annotated[
        bool,
        typer.Option("--page", help="Put the page in which the FMU runs into its documentation."),
    ] = False,
    *,
    needs: Needs,
    add_output: AddOutput = None,
) -> None:
    """Build the FMUs of a model file into OUT/python/NAME.fmu or OUT/native/NAME.fmu, and verify them."""
    failed = False
    kind = target.value
    places = tuple(n for text in platforms or [HOST] for n in text.replace(",", " ").split())
    with plainly():
        if platforms and target is Target.python:
            raise LagfmuError(
                "--platforms is for --target native: a python FMU has no binaries of ours"
            )
        file = _load(model, add_output, arguments)
        for s in narrowed(_chosen(file, scene), {**needs, "accuracy": accuracy}):
            choice = ""
            if s.accuracy is not None:
                chosen = chosen_for(file, s, parse(s.accuracy), kind, console)
                s, choice = chosen.scene, section(chosen)
            with console.status(
                f"building {'and verifying ' if check else ''}{s.name}{_first_time(target, places)}"
            ):
                prepared = prepare(file.model, s)
                less = any(needs[n] is not None for n in NARROWING)
                if less and needs["name"] is None:
                    _keep_the_full_one(out / kind / f"{s.name}.fmu", prepared.table)
                built = package(
                    prepared,
                    out / kind,
                    file.closed_forms,
                    kind,
                    places,
                    choice,
                    check,
                    reference,
                    page_,
                )
            path, found = built.path, built.verification
            console.print(
                f"[green]built[/] {escape(str(path))} ({path.stat().st_size / 1e3:.0f} kB)",
                soft_wrap=True,
            )
            if found is not None:
                _print(found)
                failed |= not found.passed
    if failed:
        raise typer.Exit(1)


def _keep_the_full_one(path: Path, table: VariableTable) -> None:
    """Refuse to replace an FMU by one of the same name that shows less."""
    if not path.is_file():
        return
    with contextlib.suppress(VerificationError):  # what is no FMU may be replaced
        shown = {v.name for v in read_description(path).modelVariables}
        lost = sorted(shown - {v.name for v in table.variables})
        if lost:
            more = f", and {len(lost) - 3} more" if len(lost) > 3 else ""
            raise LagfmuError(
                f"{path} is there and shows more than this scene ({', '.join(lost[:3])}{more}): give "
                "this one a name of its own with --name, or another folder with --out"
            )


def _first_time(target: Target, platforms: tuple[str, ...]) -> str:
    """A word of patience where the runtime has to be compiled first."""
    if target is Target.native and takes_long(platforms):
        return " (the runtime is compiled first: for Windows the C library too, about a minute)"
    return ""


@app.command(name="new")
def new_command(
    file: Annotated[Path, typer.Argument(help="The Python file to write.")],
    source: Annotated[
        str | None, typer.Option("--from", help=f"Copy a model: {', '.join(known())}.")
    ] = None,
) -> None:
    """Write a commented model to start from."""
    with plainly():
        path = new(file, source)
        console.print(f"[green]wrote[/] {escape(str(path))}", soft_wrap=True)
        console.print(f"next: lagfmu show {escape(str(path))}", soft_wrap=True, highlight=False)


@app.command()
@takes(*(n for n in OPTIONS if n != "name"))
def show(
    model: ModelPath,
    scene: Annotated[str | None, typer.Option(help="Which FMU of the file.")] = None,
    arguments: Arguments = None,
    *,
    needs: Needs,
    add_output: AddOutput = None,
) -> None:
    """Print equations of motion, classification of constraints, degrees of freedom and units.

    Of a scene that needs less than everything, also what was pruned and what that saved.
    """
    with plainly():
        file = _load(model, add_output, arguments)
        for s in narrowed(_chosen(file, None if scene is None else [scene]), needs):
            try:
                prepared = prepare(file.model, s)
            except CannotStartError as error:
                show_what_is_known(error.known, console)
                raise
            show_prepared(prepared, console)


@app.command(name="verify")
def verify_command(
    fmus: Annotated[list[Path], typer.Argument(metavar="FILE.fmu...", help="FMUs.")],
    set_: Settings = None,
    stop_time: StopTime = None,
    step_size: StepSize = None,
    tolerance: Tolerance = None,
    inputs: InputFile = None,
    reference: Annotated[
        Path | None, typer.Option(help="CSV of a run that this one is held against besides.")
    ] = None,
    rtol: Annotated[
        list[str] | None,
        typer.Option(
            metavar="RTOL|NAME=RTOL",
            help="Allowed part of a reference column's largest value (default 1e-6); repeatable.",
        ),
    ] = None,
    atol: Annotated[float, typer.Option(help="Allowed besides, in the column's unit.")] = 0.0,
    json: JsonFile = None,
    junit: JunitFile = None,
) -> None:
    """Simulate FMUs through fmpy and hold them against the closed forms that they carry.

    Exit codes: 0 all hold, 1 a statement fails, 2 wrong usage, 3 an FMU could not be run.
    """
    with plainly():
        done = examine(
            fmus,
            _assignments(set_),
            stop_time,
            step_size,
            tolerance,
            inputs,
            reference,
            rtol or (),
            atol,
        )
        for one in done:
            if one.found is not None:
                _print(one.found)
        _finish("verify", done, json, junit)


@app.command(name="reference")
def reference_command(
    fmu: FmuPath,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Folder (default: NAME).")] = None,
    stop_time: StopTime = None,
    step_size: StepSize = None,
    inputs: InputFile = None,
) -> None:
    """Write reference results of an FMU for other tools: the files of the FMI cross-check."""
    with plainly():
        signals = None if inputs is None else read_table(inputs)
        folder = out or Path(fmu.stem)
        for path in write_crosscheck(fmu, folder, stop_time, step_size, signals):
            console.print(f"[green]wrote[/] {escape(str(path))}", soft_wrap=True)


@app.command(name="simulate")
def simulate_command(
    target: Annotated[Path, typer.Argument(help="An FMU, or a model file.")],
    set_: Settings = None,
    stop_time: StopTime = None,
    step_size: StepSize = None,
    tolerance: Tolerance = None,
    scene: Annotated[str | None, typer.Option(help="Which FMU of a model file.")] = None,
    arguments: Arguments = None,
    plot_: Annotated[
        Path | None, typer.Option("--plot", help="Write a figure: .svg, .png or .pdf.")
    ] = None,
    variable: Annotated[
        list[str] | None,
        typer.Option("--variable", "-v", help="What to print and plot; repeatable."),
    ] = None,
    csv: Annotated[Path | None, typer.Option(help="Write all outputs as a CSV file.")] = None,
    animate: Annotated[
        Path | None,
        typer.Option(help="Write a film of the model's picture: .gif, .mp4 or .html."),
    ] = None,
    inputs: InputFile = None,
    error_bars: ErrorBars = None,
    add_output: AddOutput = None,
) -> None:
    """Simulate an FMU or a model; print the last values, plot or save the rest.

    With a figure, a table or a film only multipliers, coordinates and times of events are printed; -v names
    others.
    """
    with plainly():
        source: Any = target
        if target.suffix == ".py":
            file = _load(target, add_output, arguments)
            chosen = _chosen(file, None if scene is None else [scene])
            source = prepare(file.model, narrowed(chosen, {"error_bars": error_bars})[0])
            name = source.scene.name
            variables = source.table.variables
        elif arguments:
            raise LagfmuError(f"-p {arguments[0]} is for a model file: an FMU is one of its family")
        elif add_output:
            raise LagfmuError(
                "--add-output is for a model file: an FMU has the outputs it was built with"
            )
        else:
            description = read_description(target)
            name, variables = description.modelName, description.modelVariables
        known = {v.name: v.causality for v in variables if v.causality != "parameter"}
        besides = _besides(variable or (), known)
        given = _assignments(set_)
        with console.status(f"simulating {name}"):
            signals = None if inputs is None else read_table(inputs)
            result = simulate(
                source,
                stop_time,
                step_size,
                tolerance,
                given,
                signals,
                besides=besides,
                error_bars=bool(error_bars),
            )
        written = any(f is not None for f in (csv, plot_, animate))
        _print_last(name, result, variable or (_first_of(result) if written else ()))
        if csv is not None:
            _save(csv, result)
            console.print(f"[green]wrote[/] {escape(str(csv))}", soft_wrap=True)
        if plot_ is not None:
            console.print(
                f"[green]wrote[/] {escape(str(result.plot(*(variable or ()), out=plot_)))}",
                soft_wrap=True,
            )
        if animate is not None:
            with console.status(f"drawing {name}"):
                film(told_by(source), result, given, animate, name)
            console.print(f"[green]wrote[/] {escape(str(animate))}", soft_wrap=True)


@app.command()
@takes("outputs", "fixed", "inputs")
def page(
    target: Annotated[
        Path, typer.Argument(metavar="MODEL.py|FILE.fmu", help="A model file, or a native FMU.")
    ],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="The file; default dist/page/NAME.html.")
    ] = None,
    scene: Annotated[str | None, typer.Option(help="Which FMU of a model file.")] = None,
    arguments: Arguments = None,
    *,
    needs: Needs,
    add_output: AddOutput = None,
) -> None:
    """Write one HTML file in which the FMU runs: offline, with sliders, curves and the mechanism."""
    given = {"scene": scene, "p": arguments, **needs, "add-output": add_output}
    with plainly():
        source: Model | Path = target
        chosen = None
        if target.suffix == ".py":
            file = _load(target, add_output, arguments)
            source = file.model
            scenes = _chosen(file, None if scene is None else [scene])
            chosen = narrowed(scenes[:1], needs)[0]
        elif said := [
            f"{'--' if len(n) > 1 else '-'}{n}" for n, value in given.items() if value is not None
        ]:
            raise LagfmuError(
                f"{' and '.join(said)}: an FMU is one scene with outputs of its own; leave it out, or "
                "make the page from the model file"
            )
        with console.status("compiling to WebAssembly"):
            path = write_page(source, out, chosen)
        console.print(
            f"[green]wrote[/] {escape(str(path))} ({path.stat().st_size / 1e3:.0f} kB)",
            soft_wrap=True,
        )


@app.command()
def tradeoff(
    targets: Annotated[
        list[Path], typer.Argument(metavar="MODEL.py|FILE.fmu...", help="Model files and FMUs.")
    ],
    out: Annotated[Path, typer.Option("--out", "-o", help="Output folder.")] = Path(
        "dist/tradeoff"
    ),
    target: Annotated[
        Target | None,
        typer.Option(
            help="What is built of model files: native where there is a compiler, else python."
        ),
    ] = None,
    scene: Annotated[
        list[str] | None, typer.Option(help="Only these FMUs of model files; repeatable.")
    ] = None,
    step_size: Annotated[
        list[float] | None, typer.Option(help="Communication step in s; repeatable.")
    ] = None,
    tolerance: Annotated[
        list[float] | None, typer.Option(help="Relative tolerance; repeatable.")
    ] = None,
    method: Annotated[list[str] | None, typer.Option(help="Solver method; repeatable.")] = None,
    repeats: Annotated[int | None, typer.Option(help="Timed runs of each setting.")] = None,
    full: Annotated[
        bool,
        typer.Option("--full", help="The whole grid: minutes instead of half a minute an FMU."),
    ] = False,
    json: JsonFile = None,
    junit: JunitFile = None,
) -> None:
    """Measure error against wall time over methods, tolerances and communication steps.

    A closed form that is missed at a tolerance is marked in the table.  Exit codes: 0 measured, 2 wrong
    usage, 3 an FMU could not be built or run.
    """
    with plainly():
        done = compare(
            targets,
            out,
            console,
            None if target is None else target.value,
            step_size or (),
            tolerance or (),
            method or (),
            repeats,
            scene or (),
            full,
        )
        _finish("tradeoff", done, json, junit)


@app.command()
def stress(
    targets: Annotated[
        list[Path], typer.Argument(metavar="MODEL.py|FILE.fmu...", help="Model files and FMUs.")
    ],
    out: Annotated[Path, typer.Option("--out", "-o", help="Output folder.")] = Path("dist/stress"),
    target: Annotated[Target, typer.Option(help="What is built of model files.")] = Target.python,
    scene: Annotated[
        list[str] | None, typer.Option(help="Only these FMUs of model files; repeatable.")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Some of the probes only.")] = False,
    limit: Annotated[float, typer.Option(help="Time limit of one probe in s.")] = LIMIT,
    json: JsonFile = None,
    junit: JunitFile = None,
) -> None:
    """Push FMUs to the extremes: each row is right, refused with a clear message, or wrong.

    Exit codes: 0 none is wrong, 1 a row is wrong, 2 wrong usage, 3 an FMU could not be built or run.
    """
    with plainly():
        done = stress_fmus(targets, out, console, target.value, scene or (), quick, limit)
        _finish("stress", done, json, junit)


def _finish(command: str, reports: Sequence[Report], json: Path | None, junit: Path | None) -> None:
    """Write what a pipeline reads, say what could not be run, and end with the exit code."""
    if json is not None:
        write_whole(json, as_json(reports).encode())
    if junit is not None:
        write_whole(junit, as_junit(f"lagfmu {command}", reports))
    for one in reports:
        if one.error:
            errors.print(
                f"[bold red]error:[/] {escape(one.error)}", highlight=False, soft_wrap=True
            )
    raise typer.Exit(exit_code(reports))


def _load(path: Path, added: list[str] | None, arguments: list[str] | None = None) -> ModelFile:
    """A model file, with further outputs; of a family the one of these arguments."""
    file = load(path, arguments or ())
    return replace(file, model=with_outputs(file.model, added or []))


app.command()(sweep)


def _chosen(file: ModelFile, names: list[str] | None) -> list[Scene]:
    """The scenes of a file that are called so; all of them without names."""
    known = [s.name for s in file.scenes]
    unknown = ", ".join(repr(n) for n in names or [] if n not in known)
    if unknown:
        raise LagfmuError(f"{file.path}: no FMU is called {unknown}; known: {', '.join(known)}")
    return [s for s in file.scenes if names is None or s.name in names]


def _assignments(texts: list[str] | None) -> dict[str, Any]:
    """NAME=VALUE texts as a dict of numbers; the value of solver.method stays text."""
    values: dict[str, Any] = {}
    for text in texts or []:
        name, sign, value = (part.strip() for part in text.partition("="))
        if not sign or not name:
            raise UsageError(f"--set {text!r}: expected NAME=VALUE, e.g. --set theta=0.5")
        try:
            values[name] = float(value)
        except ValueError:
            if name != METHOD:
                raise UsageError(f"--set {text!r}: {value!r} is no number") from None
            values[name] = value
    return values


def _print(found: Verification) -> None:
    title = f"{found.name}: {'pass' if found.passed else 'FAIL'}"
    table = new_table(title, "statement", "largest error", "allowed", "verdict", text=["statement"])
    for row, check in zip(found.rows(), found.checks, strict=True):
        colour = {"pass": "green", "FAIL": "bold red"}.get(check.verdict, "yellow")
        table.add_row(escape(row[0]), row[1], row[2], f"[{colour}]{row[3]}[/]")
    print_whole(console, table)
    if not found.closed_forms:
        console.print("[yellow]the FMU carries no closed forms: its physics was not checked[/]")
    for check in found.checks:
        if not check.passed and check.detail:
            errors.print(
                f"[red]{escape(check.name)}:[/] {escape(check.detail)}",
                highlight=False,
                soft_wrap=True,
            )


def _besides(names: Sequence[str], known: Mapping[str, str]) -> list[str]:
    """Those of the names that are no outputs: inputs, and local variables.

    Raises SimulationError with all that is unknown.
    """
    unknown = [n for n in names if n not in known and n != "time"]
    if unknown:
        near = {n: difflib.get_close_matches(n, known, 1) for n in unknown}
        hints = [f"{n!r} (did you mean {m[0]!r}?)" if (m := near[n]) else repr(n) for n in unknown]
        raise SimulationError(
            f"--variable: there is no {', '.join(hints)}, expected some of {', '.join(known)}"
        )
    return [n for n in names if n in known and known[n] != "output"]


def _first_of(result: Result) -> list[str]:
    """What one looks for first: multipliers, coordinates, the times of events."""
    known = list(result.dtype.names or ())
    return default_names(known) + those(known, DEPARTURE_TIME, SLIP_TIME)


def _print_last(name: str, result: Result, names: Sequence[str] = ()) -> None:
    """The last values of the named variables, of all outputs without names."""
    table = new_table(f"{name} at t = {result['time'][-1]:g} s", "variable", "value", "unit")
    table.columns[0].justify = table.columns[2].justify = "left"
    for n in names or list(result.dtype.names or ())[1:]:
        text = as_text(result[n][-1], 9) if result.known(n)[-1] else NOT_YET
        table.add_row(escape(n), text, escape(for_reading(result.units.get(n))))
    print_whole(console, table)


def _save(path: Path, result: Any) -> None:
    """All columns; names are quoted, because that of an acceleration holds a comma."""
    write_whole(path, as_csv(result, [n for n in result.dtype.names if n != "time"]).encode())
