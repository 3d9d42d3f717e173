"""`lagfmu build`: the FMUs of a model file, verified."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...errors import UsageError, VerificationError
from ...fmu.compiler import HOST, NAMES
from ...fmu.face import Face
from ...fmu.target import NATIVE, PYTHON
from ...verification.exit_codes import FAILS
from .. import options
from ..terminal import console, kilobytes, plainly, say_wrote

if TYPE_CHECKING:
    from ...interface.variables import VariableTable


@options.takes(*options.OPTIONS)
def build(
    model: options.ModelPath,
    out: Annotated[Path, typer.Option("--out", "-o", help="Output folder.")] = Path("dist"),
    scene: Annotated[
        list[str] | None, typer.Option(help="Only these FMUs of the file; repeatable.")
    ] = None,
    arguments: options.Arguments = None,
    check: Annotated[bool, typer.Option(help="Verify each FMU after building it.")] = True,
    reference: Annotated[
        bool, typer.Option("--reference", help="Put reference results inside (FMI-LS-REF).")
    ] = False,
    target: options.Target = None,
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
    needs: options.Needs,
    add_output: options.AddOutput = None,
) -> None:
    """Build the FMUs of a model file into OUT/native/NAME.fmu or OUT/python/NAME.fmu, and verify them."""
    from ...api import package
    from ...prepare.prepare import prepare
    from ..finish import print_verdicts
    from ..progress import progress
    from ..scenes import loaded, narrowed

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
                less = any(needs[n] is not None for n in options.NARROWING)
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
                from ..tradeoff import say_chosen

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
