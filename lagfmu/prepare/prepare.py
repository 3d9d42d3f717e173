"""A model in a scene, with all that is known about it before anything is packaged or simulated."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from .. import names
from ..codegen.py.equations import compile_system, lower, source
from ..errors import CannotStartError, DerivationError, ModelError, RequestError
from ..interface.table import variable_table
from ..interface.variables import VariableTable
from ..mechanics import fold, prune
from ..mechanics.equations import EquationsOfMotion, derive
from ..mechanics.form import Form
from ..mechanics.formulations.minimal import reduce
from ..mechanics.jumps import with_jumps
from ..model.model import Contact, Model, Peak, name_of
from ..model.scene import EVERYTHING, Scene
from ..model.selection import select
from ..model.stuck import stuck
from ..numeric.system import System
from .consistency import Structure, check_embedding, check_held, examine
from .reduced import check_branch, misses, restarted, told_apart


@dataclass(frozen=True)
class Derived:
    """What is known of a model before it is tried whether it can start."""

    model: Model
    scene: Scene
    form: Form
    whole: VariableTable

    @property
    def equations(self) -> EquationsOfMotion:
        """Those of the scene."""
        return self.form.equations


@dataclass(frozen=True)
class Prepared:
    """All that is known about a model in a scene before anything is packaged, each thing made once.

    `form` is that of the scene, in symbols, for people to read; `coded` is what code is printed from:
    numbers put in, and of the full equations only what is read; `text` is its Python, `system` what that
    defines.  `whole` are all variables of the first, `table` those of the FMU.  For a scene that asks for
    everything they are the same.  `asked` is the scene as it was given, `scene` the same with its
    formulation; `derived` are the equations of the model, whatever the scene.
    """

    model: Model
    asked: Scene
    scene: Scene
    form: Form
    coded: Form
    whole: VariableTable
    table: VariableTable
    text: str
    system: System
    structure: Structure
    derived: EquationsOfMotion

    @property
    def equations(self) -> EquationsOfMotion:
        """Those of the scene."""
        return self.form.equations

    @property
    def formulation(self) -> str:
        """The formulation that the scene has in the end."""
        return self.form.formulation

    @property
    def numbers(self) -> dict[str, Any]:
        """The values of the parameters and inputs that are numbers in the code, by name."""
        return {str(s): n for s, n in self.coded.equations.numbers.items()}

    @property
    def held(self) -> tuple[str, ...]:
        """The contacts that cannot open."""
        contacts = {c.name for c in self.model.constraints if isinstance(c, Contact)}
        acting = self.equations.constraints
        return tuple(c.name for c in acting if c.name in contacts and not isinstance(c, Contact))


def prepare(
    model: Model, scene: Scene | None = None, derived: EquationsOfMotion | None = None
) -> Prepared:
    """Derive, prune, reduce, lower and examine.  Raises ModelError (RequestError for what the
    scene asks for and the model does not have) or DerivationError.

    `derived`: the equations of the model, where they are known from another scene.
    """
    asked = scene = scene or Scene(model.name)
    problems: list[str] = []
    model = stuck(model, scene.frictions, problems)
    if problems:
        raise RequestError(scene.name, problems)
    if derived is None or derived.model is not model:
        derived = with_jumps(derive(model))
    equations = prune.held(derived, scene, problems)
    numbers = fold.numbers_of(derived, scene, problems)
    laid = Laid()
    scene, form, outputs = _asked(equations, scene, problems, laid)
    if problems:
        raise RequestError(scene.name, problems)
    _check_peaks(model, scene, (laid.table(Form(derived), scene), laid.table(form, scene)))
    asked_for, outputs = outputs, _with_measured(outputs)
    if equations is not derived:
        may_open = {c.name for c in equations.constraints if isinstance(c, Contact)}
        every = Form(derived)
        check_held(derived, laid.table(every, scene), lower(every), numbers, may_open)
    coded = form
    if not scene.complete:
        coordinates, rows = prune.needed(_with_numbers(form, numbers), outputs)
        equations = prune.only(equations, coordinates, rows)
        reduction = form.reduction
        if reduction is not None and equations is not form.equations:
            reduction = reduce(equations)
        own = tuple(o for o in equations.outputs if o.name in outputs)
        if own != equations.outputs:
            equations = replace(equations, outputs=own)
        form = replace(form, equations=equations, reduction=reduction)
        coded = replace(form, equations=prune.silent(equations, outputs))
        coded = prune.read_only(coded, outputs)
        numbers |= fold.values(fold.idle(_with_numbers(coded, numbers)), model)
        damped = fold.damped(coded.equations, numbers)
        if scene.method == "auto" and scene.methods is None and not damped:
            scene = replace(scene, method="dop853")
    coded = fold.folded_form(coded, numbers)
    check_embedding(form)
    table, text = laid.table(coded, scene), source(coded)
    system = compile_system(text)
    whole, lowered = table, system
    if coded is not form:  # rank and start before anything was left out of the code
        whole, lowered = laid.table(form, scene), lower(form)
    try:
        structure = examine(form.equations, whole, lowered, numbers)
    except ModelError as error:
        problems = [*error.problems, *_resting_motions(form.equations)]
        known = Derived(model, scene, form, whole)
        raise CannotStartError(error.name, problems, known) from error
    given = derived.starts(embedded=False)
    wanted = {name: derived.at_parameters(e, numbers) for name, e in given.items()}
    missed = misses(form, whole, lowered, numbers, structure.start, wanted)
    if missed and not told_apart(form, missed):
        every = Form(derived)
        try:
            structure = examine(derived, laid.table(every, scene), lower(every), numbers)
            started = restarted(model, form, structure, missed)
        except ModelError as error:
            known = Derived(model, scene, form, whole)
            raise CannotStartError(error.name, error.problems, known) from error
        again = prepare(started, asked)
        laid_again = again.form, again.whole, lower(again.form)
        check_branch(model, misses(*laid_again, numbers, again.structure.start, wanted))
        return again
    return Prepared(
        model=model,
        asked=asked,
        scene=scene,
        form=form,
        coded=coded,
        whole=whole,
        table=table.keeping(asked_for),
        text=text,
        system=system,
        structure=structure,
        derived=derived,
    )


def with_peaks(prepared: Prepared, wanted: Sequence[str]) -> Prepared:
    """The same with the extremes of those of its outputs that these names and patterns mean."""
    more = select(wanted, [v.name for v in prepared.table.measurable], "", [])
    if not more:
        return prepared
    model, asked = prepared.model, prepared.asked
    model = replace(model, peaks=(*model.peaks, *map(Peak, more)))
    if not asked.complete:
        told = [names.name(quantity, "", name) for name in more for quantity in names.PEAKS]
        asked = replace(asked, outputs=(*asked.outputs, *told))
    return prepare(model, asked, replace(prepared.derived, model=model))


def _with_numbers(form: Form, numbers: dict[Any, Any]) -> Form:
    """With numbers in the equations, for asking what depends on what."""
    return replace(form, equations=fold.folded(form.equations, numbers))


class Laid:
    """The variable tables of forms in scenes, each laid once."""

    def __init__(self) -> None:
        self.known: list[tuple[Form, Scene, VariableTable]] = []

    def table(self, form: Form, scene: Scene) -> VariableTable:
        """See interface/table.py."""
        for other, there, table in self.known:
            same = other.equations is form.equations and other.reduction is form.reduction
            if same and there == scene:
                return table
        table = variable_table(form, scene)
        self.known.append((form, scene, table))
        return table


def _resting_motions(eom: EquationsOfMotion) -> list[str]:
    """Prescribed motions that start at 0 because nobody said otherwise: a likely cause."""
    return [
        f"the prescribed motion {name_of(i.symbol)!r} starts at 0 {i.unit}, as no start is given: if the "
        f"constraints need another value, write Input({name_of(i.symbol)}, {i.unit!r}, start=...)"
        for i in eom.model.prescribed
        if float(i.start) == 0
    ]


def _asked(
    eom: EquationsOfMotion, scene: Scene, problems: list[str], laid: Laid
) -> tuple[Scene, Form, tuple[str, ...]]:
    """The scene with its formulation, the form that this gives, and the outputs by name."""
    movable = any(e.free_symbols for e in eom.starts().values())  # follows what is set
    if eom.frictions:
        problems += _refused_with_friction(eom, scene)
    chosen = replace(scene, formulation=scene.formulation or "multipliers")
    form = Form(eom, None, chosen.formulation or "multipliers")
    if form.formulation == "minimal" and not eom.frictions:
        try:
            form = replace(form, reduction=reduce(eom))
        except DerivationError as error:
            raise DerivationError(f"scene {scene.name!r}: {error}") from error
    elif scene.formulation is None and not scene.complete and not eom.frictions and not movable:
        try:
            reduced = Form(eom, reduce(eom), "minimal")
        except DerivationError:
            reduced = form
        if reduced.reduction is not None and not reduced.reduction.rows:
            ignored: list[str] = []
            least = replace(scene, formulation="minimal")
            outputs = _outputs(laid.table(reduced, least), scene, ignored)
            if prune.read_only(reduced, _with_measured(outputs)) is not reduced and not ignored:
                return least, reduced, outputs
    return chosen, form, _outputs(laid.table(form, chosen), scene, problems)


def _refused_with_friction(eom: EquationsOfMotion, scene: Scene) -> list[str]:
    """What a scene of a model with friction cannot ask for."""
    names = ", ".join(repr(law.name) for law in eom.frictions)
    problems = []
    if scene.formulation == "minimal":
        problems.append(
            f"formulation 'minimal' with friction ({names}): the normal force is needed in every mode, "
            "and the reduction eliminates it: choose 'multipliers' or 'nullspace'"
        )
    if scene.derivatives:
        problems.append(
            f"derivatives with friction ({names}): directional derivatives do not know the force of "
            "sliding: leave `derivatives` out"
        )
    return problems


def _with_measured(outputs: tuple[str, ...]) -> tuple[str, ...]:
    """With the quantities whose extremes are read, which are computed for that."""
    measured = [names.measured(name) for name in outputs]
    return tuple(dict.fromkeys((*outputs, *(name for name in measured if name))))


def _check_peaks(model: Model, scene: Scene, tables: Iterable[VariableTable]) -> None:
    """Each Peak is of a Real output of the FMU that has everything.  Raises ModelError."""
    known = list(dict.fromkeys(v.name for table in tables for v in table.measurable))
    problems: list[str] = []
    select([peak.of for peak in model.peaks], known, "Peak: the Real output", problems)
    if problems and tuple(scene.frictions) == EVERYTHING:
        raise ModelError(model.name, problems)


def _outputs(table: VariableTable, scene: Scene, problems: list[str]) -> tuple[str, ...]:
    known = [v.name for v in table.outputs]
    found = set(select(scene.outputs, known, "output", problems))
    found |= {names.barred(name) for name in found}  # a bar is of an output, ...
    found |= {names.bar(name) for name in found}  # ... and an output has its own
    return tuple(name for name in known if name in found)
