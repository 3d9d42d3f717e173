"""A model and a scene -> one FMU file, verified: what the commands and Python users call."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from .errors import VerificationError
from .fmu.compiler import HOST, chosen, host
from .fmu.native import try_start
from .fmu.target import NATIVE, PYTHON, USUAL, Face
from .fmu.write import put, write
from .model.closed_form import ClosedForm, Conserved
from .model.file import in_scene
from .model.model import Model
from .model.scene import Scene, parse
from .page.documentation import html
from .page.table import printed
from .page.text import show as show_prepared
from .page.text import show_besides
from .prepare.prepare import prepare
from .prepare.steps import Prepared
from .verification.check import Verification
from .verification.crosscheck import layered
from .verification.verify import verify

if TYPE_CHECKING:
    from .studio.tradeoff.choose import Choice, Tick


@dataclass(frozen=True)
class Built:
    """An FMU that stands at `path`; what its verification found (None where it was not asked for), and how
    its tolerance was chosen (None where the scene names no accuracy)."""

    path: Path
    verification: Verification | None
    choice: Choice | None


def build_fmu(
    model: Model,
    out: str | os.PathLike[str] = ".",
    scene: Scene | None = None,
    closed_forms: Sequence[ClosedForm | Conserved] = (),
    target: str | None = None,
    platforms: Sequence[str] = (HOST,),
    check: bool = True,
    reference: bool = False,
    page: bool = False,
    sources: bool = True,
    fmi: int = 2,
    clocks: bool = False,
    arrays: bool = False,
    dae: bool = False,
) -> Path:
    """Build `model` as an FMU into the folder `out` (or to `out` itself if it ends in .fmu), and verify it.

    `target` is 'native' or 'python'; without one it is native where a C compiler is at hand, else python,
    with a warning that names what to install.  A native FMU has binaries for `platforms`, see
    compiler.PLATFORMS.
    For a scene with an `accuracy` the tolerance is found by bisection, which takes some runs.

    The FMU carries the `closed_forms` for `lagfmu verify`.  With `check` it is simulated through fmpy and
    compared with them here, and its page shows the figures; a native FMU is simulated only if it has a
    binary for this machine.  With `reference` it carries the results of its default experiment at a
    tolerance of 1e-12 (FMI-LS-REF).

    Without `sources` a native FMU carries no C files: it is smaller, and no tool can compile it again.

    `fmi`: the version of FMI, 2 or 3, of a native FMU; 3 alone has `clocks`, `arrays` and `dae`
    (experimental: an importer of model exchange may solve for the multipliers, FMI-LS-DAE).

    With `page` its documentation holds its live page (documentation/play.html), which needs ziglang.

    Raises ModelError, DerivationError, BuildError; SimulationError if it cannot be simulated;
    VerificationError with the statements that do not hold.  After the last two the file is kept.
    """
    face = Face(fmi, clocks, arrays, dae)
    target = face.target(target)
    prepared = prepare(model, scene)
    built = package(
        prepared, out, closed_forms, target, platforms, check, reference, page, sources, face=face
    )
    found = built.verification
    if found is not None and not found.passed:
        failed = "; ".join(str(c) for c in found.checks if c.failed)
        raise VerificationError(f"{str(built.path)!r} was built, but does not hold: {failed}")
    return built.path


class Shown:
    """What `lagfmu show` prints, as text and, in a notebook, as a page."""

    def __init__(self, prepared: Prepared, untried: str = "") -> None:
        self.prepared, self.untried = prepared, untried

    def __repr__(self) -> str:
        return self._printed(show_prepared)

    def _repr_html_(self) -> str:
        return html(self.prepared.form) + f"<pre>{escape(self._printed(show_besides))}</pre>"

    def _printed(self, what: Callable[[Prepared, Console, str], None]) -> str:
        return printed(lambda console: what(self.prepared, console, self.untried), 100)


def show(model: Model | str | os.PathLike[str], scene: Scene | str | None = None) -> Shown:
    """Equations of motion, classes of constraints, degrees of freedom and units, to be printed or displayed.

    `model` may be a model file, and `scene` then a name.  Raises ModelError or DerivationError.
    """
    found = in_scene(model, scene)
    prepared = prepare(found.model, None if scene is None else found.scene)
    return Shown(prepared, try_start(prepared))


def package(
    prepared: Prepared,
    out: str | os.PathLike[str],
    closed_forms: Sequence[ClosedForm | Conserved] = (),
    target: str = NATIVE,
    platforms: Sequence[str] = (HOST,),
    check: bool = True,
    reference: bool = False,
    page: bool = False,
    sources: bool = True,
    tick: Tick | None = None,
    face: Face = USUAL,
) -> Built:
    """What `prepare` made as an FMU: with the tolerance that holds its accuracy, which `tick` hears being
    found, built once, verified once, its figures put in."""
    choice, asked = None, prepared.asked
    if asked.accuracy is not None:
        from .studio.tradeoff.choose import choose

        choice = choose(prepared.model, asked, parse(asked.accuracy), tick, target)
        prepared = prepare(prepared.model, choice.scene, prepared.derived)
    told, live, icon = _shown(prepared, choice, page)
    path = write(prepared, out, closed_forms, target, platforms, told, live, sources, face, icon)
    runs_here = target == PYTHON or host() in chosen(platforms)
    found = verify(path) if check and runs_here else None
    more = layered(path, found) if reference and runs_here else {}
    if found is not None or more:
        put(path, more, found.rows() if found is not None else ())
    return Built(path, found, choice)


def _shown(
    prepared: Prepared, choice: Choice | None, page: bool
) -> tuple[str, str, Mapping[str, bytes]]:
    """What the studio puts into an FMU: how its tolerance was chosen, its live page, its icon.

    Without the studio's folder an FMU has none of them, and is right all the same.
    """
    if find_spec(".studio", __package__) is None:
        return "", "", {}
    from .studio.live.page import render
    from .studio.live.play import playable
    from .studio.live.view import icon
    from .studio.tradeoff.choose import section

    told = section(choice) if choice else ""
    return told, render(playable(prepared)) if page else "", icon(prepared)
