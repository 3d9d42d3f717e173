"""Options that several commands have: of files, of a run, and what a scene needs.

The model files that a command names: loaded, and their scenes with what the command line says of them.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from ..errors import SettingError, UnitError, UsageError
from ..fmu.target import TARGETS
from ..names import METHOD

if TYPE_CHECKING:
    from ..model.file import ModelFile
    from ..model.scene import Scene


Names = list[str] | None


def _needed(text: str, *flags: str, metavar: str | None = None) -> Any:
    """An option that says what the scene needs."""
    panel = "What the scene needs"
    return typer.Option(*flags, metavar=metavar, help=text, rich_help_panel=panel)


def _listed(text: str) -> Any:
    return Annotated[Names, _needed(text, metavar="NAME,...")]


Arguments = Annotated[
    Names,
    typer.Option(
        "-p",
        metavar="NAME=VALUE",
        help="An argument of the file's function 'family', e.g. -p n=8; of a URDF or MJCF file "
        "-p base=floating, -p key=home, -p motors=torque, -p angle.j2=0.5; repeatable.",
    ),
]
AddOutput = Annotated[
    Names,
    _needed(
        "A further output, in the FMU's variable names: "
        "'tension = -2*L*lambda.rod \\[N]'; repeatable.",
        "--add-output",
        metavar="'NAME = EXPRESSION [UNIT]'",
    ),
]
ErrorBars = Annotated[
    bool | None,
    _needed(
        "Outputs error.NAME: an estimate of how far a run is off. Co-simulation only.",
        "--error-bars",
    ),
]
Target = Annotated[
    str | None,
    typer.Option(
        metavar="|".join(TARGETS),
        help="native: compiled C, the default where there is a C compiler. python: run by SciPy.",
    ),
]
ModelPath = Annotated[
    Path, typer.Argument(help="A Python file that defines a Model, or a URDF or MJCF file.")
]
FmuPath = Annotated[Path, typer.Argument(help="An FMU built by lagfmu.")]
Settings = Annotated[
    Names,
    typer.Option("--set", metavar="NAME=VALUE", help="A parameter or start value; repeatable."),
]
Runnable = Annotated[Path, typer.Argument(help="An FMU, or a model file.")]
Runnables = Annotated[
    list[Path], typer.Argument(metavar="MODEL.py|FILE.fmu...", help="Model files and FMUs.")
]
SceneName = Annotated[
    str | None, typer.Option(help="Which FMU of a model file (default: its first).")
]
SceneNames = Annotated[Names, typer.Option(help="Only these FMUs of model files; repeatable.")]
Plot = Annotated[Path | None, typer.Option("--plot", help="Write a figure: .svg, .png or .pdf.")]
ReferenceFile = Annotated[
    Path | None, typer.Option(help="CSV of reference results to compare with.")
]
StatementsFile = Annotated[
    Path | None, typer.Option(help="TOML of statements that must hold, for any FMU.")
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


OPTIONS = {  # of a scene, in the order of --help
    "outputs": _listed(
        "Only these variables as outputs, e.g. lambda.surface,Q.* or 'der(x)'; all else is removed."
    ),
    "fixed": _listed(
        "Parameters that become numbers: m,g at the model's values, g=1.62 at another; * all."
    ),
    "inputs": _listed(
        "Only these inputs are driven; the others keep their start values. '' for none."
    ),
    "contacts": _listed("Only these contacts may open; the others hold. '' for none."),
    "frictions": _listed(
        "Only these frictions may slip; what the others limit sticks. '' for none."
    ),
    "methods": _listed("Methods that solver.method can be set to (default with --outputs: one)."),
    "method": Annotated[str | None, _needed("The default method.")],
    "formulation": Annotated[str | None, _needed("multipliers, nullspace or minimal.")],
    "derivatives": Annotated[
        bool | None,
        _needed(
            "Directional derivatives in a native FMU (default: unless --outputs).",
            "--derivatives/--no-derivatives",
        ),
    ],
    "reals_only": Annotated[
        bool | None,
        _needed(
            "Reals for Booleans and counts, and no solver.method: for importers that know Reals alone.",
            "--reals-only",
        ),
    ],
    "error_bars": ErrorBars,
    "sensitivities": Annotated[
        Names,
        _needed(
            "Outputs sensitivity.OUTPUT.by.PARAMETER: derivatives along the run, e.g. "
            "departure.surface.time:theta,a or '*:a'; repeatable. Co-simulation only.",
            "--sensitivities",
            metavar="OUTPUT:PARAMETER,...",
        ),
    ],
    "name": Annotated[str | None, _needed("Another name for the FMU.")],
}
LISTS = ("outputs", "fixed", "inputs", "contacts", "frictions", "methods")
# an FMU with one of these shows less than the full one
NARROWING = (*LISTS, "method", "reals_only")
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


def once(pairs: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    """What is given for each name.  Raises SettingError for one that is given twice."""
    found: dict[str, Any] = {}
    for name, value in pairs:
        if name in found:
            raise SettingError(f"{name} is given twice: {found[name]}, {value}")
        found[name] = value
    return found


def loaded(path: Path, added: Names, arguments: Names = None) -> ModelFile:
    """A model file, with further outputs; of a family the one of these arguments."""
    from ..model.expression import with_outputs
    from ..model.file import load

    file = load(path, arguments or ())
    return replace(file, model=with_outputs(file.model, added or []))


def for_models(path: Path, **options: Any) -> None:
    """Refuse options that an FMU has no use for.  Raises UsageError with those that were given."""
    given = [n for n, value in options.items() if value is not None]
    if given:
        said = " and ".join(f"--{n.replace('_', '-')}" if len(n) > 1 else f"-{n}" for n in given)
        raise UsageError(
            f"{said}: for model files; {path} is an FMU, one scene that is built already"
        )


def narrowed(scenes: Sequence[Scene], needs: Needs) -> list[Scene]:
    """The scenes with what was said on the command line; what was not said stays.

    Raises UsageError if one name is given to several, and RequestError for a scene that cannot be.
    """
    from ..model.scene import listed

    name = needs.get("name")
    if name is not None and len(scenes) > 1:
        raise UsageError(
            f"--name {name}: the file has {len(scenes)} FMUs, choose one of them with --scene: "
            f"{', '.join(s.name for s in scenes)}"
        )
    said = {k: v for k, v in needs.items() if v is not None}
    said |= {
        k: tuple(name for text in said[k] for name in listed(text)) for k in LISTS if k in said
    }
    return [replace(s, **said) for s in scenes]
