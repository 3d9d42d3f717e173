"""Options that several commands have: of files, of a run, and what a scene needs."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from ..errors import UnitError, UsageError
from ..fmu.target import TARGETS
from ..names import METHOD

Names = list[str] | None


OUTPUTS = (
    "Only these variables as outputs, e.g. lambda.surface,Q.* or 'der(x)'; all else is removed."
)
FIXED = "Parameters that become numbers: m,g at the model's values, g=1.62 at another; * all."
INPUTS = "Only these inputs are driven; the others keep their start values. '' for none."
CONTACTS = "Only these contacts may open; the others hold. '' for none."
FRICTIONS = "Only these frictions may slip; what the others limit sticks. '' for none."
METHODS = "Methods that solver.method can be set to (default with --outputs: one)."


def _option(text: str) -> Any:
    return typer.Option(metavar="NAME,...", help=text, rich_help_panel="What the scene needs")


Arguments = Annotated[
    Names,
    typer.Option(
        "-p",
        metavar="NAME=VALUE",
        help="An argument of the file's function 'family', e.g. -p n=8; repeatable.",
    ),
]
Outputs = Annotated[Names, _option(OUTPUTS)]
Fixed = Annotated[Names, _option(FIXED)]
Inputs = Annotated[Names, _option(INPUTS)]
Contacts = Annotated[Names, _option(CONTACTS)]
Frictions = Annotated[Names, _option(FRICTIONS)]
Methods = Annotated[Names, _option(METHODS)]
Method = Annotated[
    str | None,
    typer.Option(help="The default method.", rich_help_panel="What the scene needs"),
]
Formulation = Annotated[
    str | None,
    typer.Option(help="multipliers, nullspace or minimal.", rich_help_panel="What the scene needs"),
]
Derivatives = Annotated[
    bool | None,
    typer.Option(
        "--derivatives/--no-derivatives",
        help="Directional derivatives in a native FMU (default: unless --outputs).",
        rich_help_panel="What the scene needs",
    ),
]
AddOutput = Annotated[
    Names,
    typer.Option(
        "--add-output",
        metavar="'NAME = EXPRESSION [UNIT]'",
        help="A further output, in the FMU's variable names: "
        "'tension = -2*L*lambda.rod \\[N]'; repeatable.",
        rich_help_panel="What the scene needs",
    ),
]
RealsOnly = Annotated[
    bool | None,
    typer.Option(
        "--reals-only",
        help="Reals for Booleans and counts, and no solver.method: for importers that know Reals alone.",
        rich_help_panel="What the scene needs",
    ),
]
ErrorBars = Annotated[
    bool | None,
    typer.Option(
        "--error-bars",
        help="Outputs error.NAME: an estimate of how far a run is off. Co-simulation only.",
        rich_help_panel="What the scene needs",
    ),
]
Name = Annotated[
    str | None,
    typer.Option(help="Another name for the FMU.", rich_help_panel="What the scene needs"),
]

Target = Annotated[
    str | None,
    typer.Option(
        metavar="|".join(TARGETS),
        help="native: compiled C, the default where there is a C compiler. python: run by SciPy.",
    ),
]
ModelPath = Annotated[Path, typer.Argument(help="A Python file that defines a Model.")]
FmuPath = Annotated[Path, typer.Argument(help="An FMU built by lagfmu.")]
Settings = Annotated[
    Names,
    typer.Option("--set", metavar="NAME=VALUE", help="A parameter or start value; repeatable."),
]
JsonFile = Annotated[Path | None, typer.Option(help="Write everything as JSON.")]
JunitFile = Annotated[Path | None, typer.Option(help="Write JUnit XML, one suite for each FMU.")]
Tolerance = Annotated[
    float | None, typer.Option(help="Relative tolerance: speed against accuracy.")
]
StopTime = Annotated[float | None, typer.Option(help="Stop time in s.")]
StepSize = Annotated[float | None, typer.Option(help="Communication step in s.")]
InputFile = Annotated[
    Path | None, typer.Option("--input", help="CSV with a column time and one for each input.")
]


OPTIONS = {
    "outputs": Outputs,
    "fixed": Fixed,
    "inputs": Inputs,
    "contacts": Contacts,
    "frictions": Frictions,
    "methods": Methods,
    "method": Method,
    "formulation": Formulation,
    "derivatives": Derivatives,
    "reals_only": RealsOnly,
    "error_bars": ErrorBars,
    "name": Name,
}  # in the order of --help
LISTS = ("outputs", "fixed", "inputs", "contacts", "frictions", "methods")
NARROWING = (
    *LISTS,
    "method",
    "reals_only",
)  # an FMU with one of these shows less than the full one
Needs = Mapping[str, Any]


def takes(*names: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """The command has these options of a scene, which reach it together as its argument `needs`."""

    def with_options(command: Callable[..., None]) -> Callable[..., None]:
        @wraps(command)
        def called(**given: Any) -> None:
            command(needs={n: given.pop(n) for n in names}, **given)

        hints = get_type_hints(command, include_extras=True) | {n: OPTIONS[n] for n in names}
        kind = inspect.Parameter.KEYWORD_ONLY
        own = inspect.signature(command).parameters.values()
        parameters = []
        for p in own:
            options = names if p.name == "needs" else ()
            parameters += [inspect.Parameter(n, kind, default=None) for n in options]
            parameters += [] if options else [p.replace(kind=kind)]
        parameters = [p.replace(annotation=hints[p.name]) for p in parameters]
        called.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        called.__annotations__ = {p.name: p.annotation for p in parameters}
        return called

    return with_options


def assignments(texts: Names, units: Callable[[], Mapping[str, str | None]]) -> dict[str, Any]:
    """NAME=VALUE texts as a dict of numbers in SI; the value of solver.method stays text.

    `units` gives the unit of each variable; it is asked only where a value has one of its own, as m=200g.
    Raises UsageError.
    """
    values: dict[str, Any] = {}
    for text in texts or []:
        name, sign, value = (part.strip() for part in text.partition("="))
        if not sign or not name:
            raise UsageError(f"--set {text!r}: expected NAME=VALUE, e.g. --set theta=0.5")
        try:
            values[name] = float(value)
        except ValueError:
            values[name] = value if name == METHOD else _quantity(text, value, units().get(name))
    return values


def _quantity(text: str, value: str, unit: str | None) -> float:
    """A value that has a unit of its own, in SI."""
    from ..model.units import parse_quantity, parse_unit

    if unit is None:
        raise UsageError(f"--set {text!r}: {value!r} is no number")
    try:
        return parse_quantity(value, parse_unit(unit, text), f"--set {text!r}: value")
    except UnitError as error:
        raise UsageError(str(error)) from None
