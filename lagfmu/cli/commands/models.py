"""Commands for a model file: to start one, to show it, to play it, to build its FMUs."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...errors import UsageError, VerificationError
from ...fmu.compiler import HOST, NAMES
from ...fmu.target import NATIVE, PYTHON, Face
from ...model.library import known
from ...model.library import new as written
from ...verification.pipeline import FAILS
from ..options import (
    NARROWING,
    OPTIONS,
    AddOutput,
    Arguments,
    ModelPath,
    Needs,
    SceneName,
    Target,
    takes,
)
from ..terminal import console, kilobytes, plainly, say, say_wrote

if TYPE_CHECKING:
    from ...interface.variables import VariableTable
    from ...model.model import Model


def new(
    file: Annotated[Path, typer.Argument(help="The Python file to write.")],
    source: Annotated[
        str | None,
        typer.Option(
            "--from", help=f"A URDF or MJCF file, or a model to copy: {', '.join(known())}."
        ),
    ] = None,
) -> None:
    """Write a commented model to start from."""
    with plainly():
        path = written(file, source)
        say_wrote(path)
        say(f"next: lagfmu show {path}")


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

    For a scene that needs less than everything, print also what is removed and what that saves.
    """
    from ...errors import CannotStartError
    from ...fmu.native import try_start
    from ...page.text import show as show_prepared
    from ...page.text import show_what_is_known
    from ...prepare.prepare import prepare
    from ...prepare.starts import check_given
    from ..options import loaded, narrowed

    with plainly():
        file = loaded(model, add_output, arguments)
        for s in narrowed(file.called(scene), needs):
            try:
                prepared = prepare(file.model, s)
                untried = try_start(prepared)
            except CannotStartError as error:
                show_what_is_known(error.known, console)
                raise
            show_prepared(prepared, console, untried)
            structure = prepared.structure
            check_given(file.model.name, structure.start.moved, structure.missed)


@takes("outputs", "fixed", "inputs")
def page(
    target: Annotated[
        Path, typer.Argument(metavar="MODEL.py|FILE.fmu", help="A model file, or a native FMU.")
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="The file, or its folder; default dist/page/NAME.html."),
    ] = None,
    scene: SceneName = None,
    arguments: Arguments = None,
    *,
    needs: Needs,
    add_output: AddOutput = None,
) -> None:
    """Write one HTML file in which the FMU runs: offline, with sliders, curves and the mechanism."""
    from ...model.file import is_model
    from ...studio.live.play import write_page
    from ..options import for_models, loaded, narrowed

    with plainly():
        source: Model | Path = target
        shown = None
        if is_model(target):
            file = loaded(target, add_output, arguments)
            source = file.model
            shown = narrowed(file.called(scene)[:1], needs)[0]
        else:
            for_models(target, scene=scene, p=arguments, **needs, add_output=add_output)
        with console.status("compiling to WebAssembly"):
            path = write_page(source, out, shown)
        say_wrote(path, kilobytes(path))


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
    target: Target = None,
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
            help="Find the coarsest tolerance that holds this relative error, and build with it, e.g. "
            "1e-6 or 1e-6:lambda.surface.",
        ),
    ] = None,
    page_: Annotated[
        bool,
        typer.Option("--page", help="Put the live page into the FMU's documentation."),
    ] = False,
    sources: Annotated[
        bool,
        typer.Option(help="Whether a native FMU carries its C sources."),
    ] = True,
    fmi: Annotated[
        int,
        typer.Option(
            metavar="2|3",
            help="The version of FMI; 3 is for native FMUs, which get a folder of their own.",
        ),
    ] = 2,
    clocks: Annotated[
        bool,
        typer.Option(
            "--clocks",
            help="FMI 3.0: a clock for each contact and friction; the importer must use event mode.",
        ),
    ] = False,
    arrays: Annotated[
        bool,
        typer.Option(
            "--arrays", help="FMI 3.0: lambda, Q and residuals of a unit as an array too."
        ),
    ] = False,
    dae: Annotated[
        bool,
        typer.Option(
            "--dae",
            help="FMI 3.0, experimental: an importer of model exchange may solve for the multipliers "
            "(FMI-LS-DAE).",
        ),
    ] = False,
    *,
    needs: Needs,
    add_output: AddOutput = None,
) -> None:
    """Build the FMUs of a model file into OUT/native/NAME.fmu or OUT/python/NAME.fmu, and verify them."""
    from ...api import package
    from ...prepare.prepare import prepare
    from ..options import loaded, narrowed
    from ..progress import print_verdicts, progress

    failed = False
    places = tuple(n for text in platforms or [HOST] for n in text.replace(",", " ").split())
    with plainly():
        if platforms and target == PYTHON:
            raise UsageError(
                "--platforms is for --target native: a python FMU has no binaries of ours"
            )
        face = Face(fmi, clocks, arrays, dae)
        kind = face.target(NATIVE if platforms else target)
        folder = out / face.folder(kind)
        file = loaded(model, add_output, arguments)
        for s in narrowed(file.called(scene), {**needs, "accuracy": accuracy}):
            what = (
                f"building {'and verifying ' if check else ''}{s.name}{_first_time(kind, places)}"
            )
            busy: Any = console.status(what) if s.accuracy is None else progress(console, s.name)
            with busy as shown:
                prepared = prepare(file.model, s)
                less = any(needs[n] is not None for n in NARROWING)
                if less and needs["name"] is None:
                    _keep_the_full_one(folder / f"{s.name}.fmu", prepared.table)
                built = package(
                    prepared,
                    folder,
                    file.closed_forms,
                    kind,
                    places,
                    check,
                    reference,
                    page_,
                    sources,
                    None if s.accuracy is None else shown,
                    face,
                )
            path, found = built.path, built.verification
            if built.choice is not None:
                from ..studies import say_chosen

                say_chosen(built.choice, console)
            say_wrote(path, kilobytes(path), "built")
            if found is not None:
                print_verdicts(found)
                failed |= not found.passed
    if failed:
        raise typer.Exit(FAILS)


def _keep_the_full_one(path: Path, table: VariableTable) -> None:
    """Refuse to replace an FMU by one of the same name that shows less."""
    from ...fmu.read import read_description

    if not path.is_file():
        return
    with contextlib.suppress(VerificationError):  # what is no FMU may be replaced
        shown = {v.name for v in read_description(path).modelVariables}
        lost = sorted(shown - {v.name for v in table.variables})
        if lost:
            more = f", and {len(lost) - 3} more" if len(lost) > 3 else ""
            raise UsageError(
                f"{path} is there and shows more than this scene ({', '.join(lost[:3])}{more}): give "
                "this one a name of its own with --name, or another folder with --out"
            )


def _first_time(target: str, platforms: tuple[str, ...]) -> str:
    """A word of patience where the runtime has to be compiled first."""
    from ...fmu.native import takes_long

    if target == NATIVE and takes_long(platforms):
        return " (the runtime is compiled first: for Windows the C library too, about a minute)"
    return ""
