"""What is known about a model in a scene -> one FMU file, replaced whole and never half-written."""

from __future__ import annotations

import contextlib
import importlib.metadata
import logging
import os
import tempfile
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from .. import names
from ..errors import BuildError, DerivationError, ModelError, RequestError
from ..files import write_whole
from ..interface.table import with_further
from ..model.closed_form import ClosedForm, Conserved
from ..model.file import fmu_at, in_scene
from ..model.model import Contact, Model, Peak
from ..model.scene import Scene, select
from ..page import picture as pictures
from ..page.documentation import page, with_figures
from ..prepare.consistency import values_at_start
from ..prepare.prepare import prepare
from ..prepare.starts import check_given, tell
from ..prepare.steps import Prepared
from . import native, python
from .archive import pack
from .closed_forms import pack_closed_forms
from .compiler import HOST
from .dae import MANIFEST, check_dae, manifest, multiplier_sizes
from .described import IN_FMU, offers_exchange, terminals, untold
from .target import NATIVE, USUAL, Face, target_of

LOG = logging.getLogger("lagfmu")
SMALLEST_NOMINAL = 1e-30  # what is smaller is no size, but what neither moves nor is pushed
PAGE = "documentation/index.html"
LIVE = "documentation/play.html"  # beside it, which has a link to it
REFERENCES = "documentation/fmi-ls-ref.txt"  # likewise, as FMI-LS-REF recommends
LICENSE = "documentation/licenses/license.txt"


def write(
    prepared: Prepared,
    out: str | os.PathLike[str] = ".",
    closed_forms: Sequence[ClosedForm | Conserved] = (),
    target: str | None = None,
    platforms: Sequence[str] = (HOST,),
    choice: str = "",
    live: str = "",
    sources: bool = True,
    face: Face = USUAL,
    icon: Mapping[str, bytes] = MappingProxyType({}),
) -> Path:
    """Package what `prepare` made into the folder `out`, or to `out` itself if it ends in .fmu.

    `choice` is HTML on how the solver settings were chosen, `live` the page in which the FMU runs, `icon` the
    files of its icon; without `sources` a native FMU carries no C files.  For the rest see api.build_fmu.
    Warns of each start value that is moved onto the constraints.  Raises
    ModelError if one in the model's `start` moves by more than 1e-6 of its coordinate's size.
    """
    target = face.target(target)
    moved, missed = prepared.structure.start.moved, prepared.structure.missed
    check_given(prepared.model.name, moved, missed)
    tell(moved)
    prepared = as_built(prepared, target, face)
    if said := untold(prepared.table):
        LOG.info(said)
    extra = {
        PAGE: page(prepared, choice, bool(live)).encode(),
        "resources/lagfmu.json": pack_closed_forms(
            prepared.scene,
            closed_forms,
            prepared.table,
            prepared.numbers,
            prepared.held,
            prepared.model.splines,
            [c.name for c in prepared.equations.constraints if isinstance(c, Contact)],
            prepared.model.laws,
        ),
    }
    extra[LICENSE] = license_of(target, sources).encode()
    extra |= icon
    if (found := terminals(prepared, bool(icon))) is not None:
        extra[IN_FMU] = found
    if face.dae:
        extra[MANIFEST] = manifest(prepared)
    if live:
        extra[LIVE] = live.encode()
    if (picture := pictures.picture_of(prepared)) is not None:
        extra[pictures.PICTURE] = pictures.picture_bytes(picture)
    if (preset := pictures.preset_of(prepared)) is not None:
        extra[pictures.PRESET] = pictures.preset_bytes(preset)
    if target == NATIVE:
        content = native.build(prepared, extra, platforms, sources, face)
    else:
        content = python.build(prepared, extra)
    path = Path(out)
    if path.suffix != ".fmu":
        path = path / f"{prepared.scene.name}.fmu"
    write_whole(path, content)
    return path


@contextlib.contextmanager
def as_fmu(
    source: Model | str | os.PathLike[str],
    scene: Scene | str | None = None,
    closed_forms: Sequence[ClosedForm | Conserved] = (),
    peaks: Sequence[str] = (),
    sensitivities: Sequence[str] = (),
) -> Iterator[Path]:
    """An FMU as it is; of a model, or a model file, one that is built (natively where a compiler is at hand)
    into a folder that goes again.  `scene`: of a file also by name, else its first.  `peaks`: outputs whose
    extremes a native FMU that is built shall tell; `sensitivities`: see Scene, what it can tell of them."""
    if (path := fmu_at(source, scene)) is not None:
        yield path
        return
    chosen = in_scene(source, scene)
    kind = target_of()
    with tempfile.TemporaryDirectory(prefix="lagfmu_") as folder:
        prepared = prepare(chosen.model, chosen.scene)
        if kind == NATIVE:
            prepared = with_sensitivities(with_peaks(prepared, peaks), sensitivities)
        yield write(prepared, folder, closed_forms or chosen.closed_forms, kind)


def with_sensitivities(prepared: Prepared, wanted: Sequence[str]) -> Prepared:
    """With derivatives where the model and the scene have them; else it is said why without."""
    if not wanted:
        return prepared
    try:
        asked = replace(prepared.asked, sensitivities=(*prepared.asked.sensitivities, *wanted))
        return prepare(prepared.model, asked, prepared.derived)
    except RequestError:
        pass  # who asked for names that there are not hears of it from the one who reads them
    except (ModelError, DerivationError) as error:
        LOG.info("%s is built without derivatives: %s", prepared.scene.name, error)
    return prepared


def with_peaks(prepared: Prepared, wanted: Sequence[str]) -> Prepared:
    """What was prepared with the extremes of those of its outputs that these names and patterns mean."""
    more = select(wanted, [v.name for v in prepared.table.measurable], "", [])
    if not more:
        return prepared
    model, asked = prepared.model, prepared.asked
    model = replace(model, peaks=(*model.peaks, *map(Peak, more)))
    if not asked.complete:
        told = [names.name(quantity, "", name) for name in more for quantity in names.PEAKS]
        asked = replace(asked, outputs=(*asked.outputs, *told))
    return prepare(model, asked, replace(prepared.derived, model=model))


def license_of(target: str, sources: bool) -> str:
    """Of what lagfmu itself puts into an FMU; the model is under the one that its author says, if any."""
    what = "resources/ but for the generated script, its tables and what they describe"
    if target == NATIVE:
        what = "the compiled library"
        what += f", and sources/ but for {', '.join(native.GENERATED)}" * sources
    text = importlib.metadata.distribution("lagfmu").read_text("licenses/LICENSE")
    if text is None:
        raise BuildError(
            "lagfmu is not installed as a whole, its licence is missing: install it anew"
        )
    return (
        f"This is the licence of the part of the FMU that comes with lagfmu: {what}.\n"
        "The model is under the licence that modelDescription.xml names, if it names one.\n\n"
        + text
    )


def put(path: Path, more: Mapping[str, bytes], figures: Sequence[tuple[str, ...]] = ()) -> None:
    """Put files, and the figures of a verification, into an FMU that stands at `path`."""
    with zipfile.ZipFile(path) as archive:
        contents = {name: archive.read(name) for name in archive.namelist()} | dict(more)
    told = Path(REFERENCES).name if REFERENCES in more else ""
    if figures or told:
        contents[PAGE] = with_figures(contents[PAGE].decode(), figures, told).encode()
    write_whole(path, pack(contents))


def as_built(prepared: Prepared, target: str, face: Face = USUAL) -> Prepared:
    """With the nominal values of states, and what the interface has variables for; a python FMU has no model
    exchange and no native variables."""
    table = prepared.table if target == NATIVE else python.offered(prepared)
    table = table.with_nominals(_nominals(prepared))
    exchanged = target == NATIVE and offers_exchange(prepared)
    if not exchanged:
        table = table.without_local_derivatives()
    if face.fmi == 3:
        model, more = prepared.model.name, (exchanged, face.clocks, face.arrays, face.dae)
        if face.dae:
            check_dae(prepared)
            table = table.with_nominals(_rounded(multiplier_sizes(prepared)))
        table = with_further(table, prepared.system, model, *more)
    return replace(prepared, table=table)


def _nominals(prepared: Prepared) -> dict[str, float]:
    """The sizes of coordinates at the described start, and times the natural rate those of velocities."""
    begun, system = prepared.structure.start, prepared.examined
    sizes = dict(zip(system.coordinates, begun.size, strict=True))
    rates = dict(zip(system.speeds, begun.span * begun.rate, strict=True))
    energy = (
        {names.DISSIPATED: _energy(prepared)} if names.DISSIPATED in prepared.table.states else {}
    )
    return _rounded(sizes | rates | energy)


def _rounded(sizes: Mapping[str, float]) -> dict[str, float]:
    """To two digits; what is next to nothing is no size."""
    return {n: float(f"{x:.1e}") for n, x in sizes.items() if x > SMALLEST_NOMINAL}


def _energy(prepared: Prepared) -> float:
    """Kinetic energy of coordinates that move through their sizes at the natural rate; 0 if not known."""
    begun, system, eom = prepared.structure.start, prepared.system, prepared.coded.equations
    if system.nv != len(begun.span) or system.dynamics is None:
        return 0.0
    u, p = values_at_start(eom, prepared.whole, eom.numbers)
    M, *_ = system.assemble_sparse(0.0, begun.q, begun.v, [*u, *begun.switch_states], p)
    speeds = np.maximum(begun.span * begun.rate, np.abs(begun.v))
    return float(M.diagonal() @ speeds**2 / 2)
