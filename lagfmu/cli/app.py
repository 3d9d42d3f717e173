"""The `lagfmu` command: what its commands are, and what is common to them."""

from __future__ import annotations

from typing import Annotated

import typer

from ..fmu.archive import tool
from ..verification.pipeline import EXIT_CODES
from .commands.models import build, new, page, show
from .commands.runs import reference, report, simulate, verify
from .commands.studies import fit, linearize, sensitivity, stress, sweep, tradeoff
from .terminal import prepare_streams

COMMANDS = (
    build,
    new,
    show,
    verify,
    reference,
    simulate,
    page,
    tradeoff,
    stress,
    sweep,
    fit,
    sensitivity,
    linearize,
    report,
)
EPILOG = "Exit codes: " + "; ".join(f"{code} {text}" for code, text in EXIT_CODES.items()) + "."

app = typer.Typer(no_args_is_help=True, pretty_exceptions_enable=False, epilog=EPILOG)
for _command in COMMANDS:
    app.command()(_command)


def _version(wanted: bool) -> None:
    if wanted:
        print(tool())
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
