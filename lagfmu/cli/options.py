"""Options that several commands have: of a run, and what a scene needs, with the scene that they make."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from ..errors import LagfmuError
from ..model.scene import Scene

Names = list[str] | None
OUTPUTS = (
    "Only these variables as outputs, e.g. lambda.surface,Q.* or 'der(x)'; all else is pruned."
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
    typer.Option(help="The integrator by default.", rich_help_panel="What the scene needs"),
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
        help="An output besides those of the file, of the FMU's names: "
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
        help="Outputs error.NAME: an estimate of how far this run may be off. Co-simulation only.",
        rich_help_panel="What the scene needs",
    ),
]
Name = Annotated[
    str | None,
    typer.Option(help="Another name for the FMU.", rich_help_panel="What the scene needs"),
]

Tolerance = Annotated[
    float | None, typer.Option(help="Relative tolerance: speed against accuracy.")
]
StopTime = Annotated[float | None, typer.Option(help="Stop time in s.")]
StepSize = Annotated[float | None, typer.Option(help="Communication step in s.")]
InputFile = Annotated[
    Path | None, typer.Option("--input", help="CSV with a column time and one an input.")
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


def narrowed(scenes: Sequence[Scene], needs: Needs) -> list[Scene]:
    """The scenes with what was said on the command line; what was not said stays.

    Raises LagfmuError if one name is given to several, and ModelError for a scene that cannot be.
    """
    name = needs.get("name")
    if name is not None and len(scenes) > 1:
        raise LagfmuError(
            f"--name {name}: the file has {len(scenes)} FMUs, choose one of them with --scene: "
            f"{', '.join(s.name for s in scenes)}"
        )
    said = {k: v for k, v in needs.items() if v is not None}
    said |= {k: _split(said[k]) for k in LISTS if k in said}
    return [replace(s, **said) for s in scenes]


def _split(texts: Sequence[str]) -> tuple[str, ...]:
    """NAME,NAME as names; a comma within parentheses belongs to the name, as in der(x,2)."""
    found: list[str] = []
    for text in texts:
        depth, word = 0, ""
        for letter in f"{text},":
            depth += (letter == "(") - (letter == ")")
            if letter == "," and depth <= 0:
                found.append(word.strip())
                word = ""
            else:
                word += letter
    return tuple(w for w in found if w)
