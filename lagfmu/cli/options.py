"""Options that several commands have: of a run, and what a scene needs, with the scene that they make."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

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


def narrowed(
    scenes: Sequence[Scene],
    outputs: Names = None,
    fixed: Names = None,
    inputs: Names = None,
    contacts: Names = None,
    frictions: Names = None,
    methods: Names = None,
    method: str | None = None,
    formulation: str | None = None,
    derivatives: bool | None = None,
    reals_only: bool | None = None,
    error_bars: bool | None = None,
    name: str | None = None,
    accuracy: str | None = None,
) -> list[Scene]:
    """The scenes with what was said on the command line; what was not said stays.

    Raises LagfmuError if one name is given to several, and ModelError for a scene that cannot be.
    """
    if name is not None and len(scenes) > 1:
        raise LagfmuError(
            f"--name {name}: the file has {len(scenes)} FMUs, choose one of them with --scene: "
            f"{', '.join(s.name for s in scenes)}"
        )
    lists = {"outputs": outputs, "fixed": fixed, "inputs": inputs, "contacts": contacts}
    lists["frictions"] = frictions
    said: dict[str, Any] = {k: _split(v) for k, v in lists.items() if v is not None}
    if methods is not None:
        said["methods"] = _split(methods)
    single = {"method": method, "formulation": formulation, "derivatives": derivatives}
    single |= {"reals_only": reals_only, "error_bars": error_bars}
    single |= {"name": name, "accuracy": accuracy}
    said |= {k: v for k, v in single.items() if v is not None}
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
