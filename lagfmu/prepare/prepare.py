"""A model in a scene, with all that is known about it before anything is packaged or simulated."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from ..codegen.py.equations import lower
from ..errors import CannotStartError, DerivationError, ModelError
from ..interface.table import variable_table
from ..interface.variables import VariableTable
from ..mechanics import fold, prune
from ..mechanics.equations import EquationsOfMotion, derive
from ..mechanics.formulations.minimal import Reduction, reduce
from ..mechanics.jumps import with_jumps
from ..model.frictions import stuck
from ..model.model import Contact, Model, name_of
from ..model.scene import Scene
from ..model.selection import select
from ..solver.system import System
from .consistency import Structure, check_embedding, check_held, examine


@dataclass(frozen=True)
class Derived:
    """What is known of a model before it is tried whether it can start."""

    model: Model
    scene: Scene
    equations: EquationsOfMotion
    reduction: Reduction | None
    whole: VariableTable

    @property
    def formulation(self) -> str:
        """The formulation that the scene has in the end."""
        return self.scene.formulation or "multipliers"


@dataclass(frozen=True)
class Prepared:
    """All that is known about a model in a scene before anything is packaged.

    `equations` and `reduction` are those of the scene, in symbols, for people to read; `coded` and
    `coded_reduction` are what code is printed from: numbers put in, and of the full equations only
    what is read.  `whole` are all variables of the first, `table` those of the FMU.  For a scene that
    asks for everything they are the same.  `asked` is the scene as it was given, `scene` the same with
    its formulation.
    """

    model: Model
    asked: Scene
    scene: Scene
    equations: EquationsOfMotion
    reduction: Reduction | None
    coded: EquationsOfMotion
    coded_reduction: Reduction | None
    whole: VariableTable
    table: VariableTable
    system: System
    structure: Structure

    @property
    def formulation(self) -> str:
        """The formulation that the scene has in the end."""
        return self.scene.formulation or "multipliers"

    @property
    def numbers(self) -> dict[str, Any]:
        """The values of the parameters and inputs that are numbers in the code, by name."""
        return {str(s): n for s, n in self.coded.numbers.items()}

    @property
    def held(self) -> tuple[str, ...]:
        """The contacts that cannot open."""
        contacts = {c.name for c in self.model.constraints if isinstance(c, Contact)}
        acting = self.equations.constraints
        return tuple(c.name for c in acting if c.name in contacts and not isinstance(c, Contact))


def prepare(model: Model, scene: Scene | None = None) -> Prepared:
    """Derive, prune, reduce, lower and examine.  Raises ModelError or DerivationError."""
    asked = scene = scene or Scene(model.name)
    problems: list[str] = []
    model = stuck(model, scene.frictions, problems)
    if problems:
        raise ModelError(scene.name, problems)
    derived = with_jumps(derive(model))
    equations = prune.held(derived, scene, problems)
    numbers = fold.numbers_of(derived, scene, problems)
    scene, reduction, outputs = _asked(equations, scene, problems)
    if problems:
        raise ModelError(scene.name, problems)
    if equations is not derived:
        may_open = {c.name for c in equations.constraints if isinstance(c, Contact)}
        every = variable_table(derived, None, scene)
        check_held(derived, every, lower(derived), numbers, may_open)
    coded, coded_reduction = equations, reduction
    if not scene.complete:
        coordinates, rows = prune.needed(fold.folded(equations, numbers), reduction, outputs)
        equations = prune.only(equations, coordinates, rows)
        if reduction is not None and equations is not coded:
            reduction = reduce(equations)
        asked_for = tuple(o for o in equations.outputs if o.name in outputs)
        if asked_for != equations.outputs:
            equations = replace(equations, outputs=asked_for)
        coded, coded_reduction = prune.silent(equations, outputs), reduction
        if coded_reduction is not None:
            coded, coded_reduction = prune.read_only(coded, coded_reduction, outputs)
        numbers |= fold.values(fold.idle(fold.folded(coded, numbers), coded_reduction), model)
        if scene.method == "auto" and scene.methods is None and not fold.damped(coded, numbers):
            scene = replace(scene, method="dop853")
    coded = fold.folded(coded, numbers)
    if coded_reduction is not None:
        coded_reduction = fold.folded_reduction(coded_reduction, numbers)
    if reduction is not None:
        check_embedding(equations, reduction)
    table = variable_table(coded, coded_reduction, scene)
    system = lower(coded, coded_reduction, scene.formulation or "multipliers")
    whole, lowered = table, system
    if coded is not equations:  # rank and start before anything was left out of the code
        whole = variable_table(equations, reduction, scene)
        lowered = lower(equations, reduction, scene.formulation or "multipliers")
    try:
        structure = examine(equations, whole, lowered, numbers)
    except ModelError as error:
        known = Derived(model, scene, equations, reduction, whole)
        problems = [*error.problems, *_resting_motions(equations)]
        raise CannotStartError(error.name, problems, known) from error
    return Prepared(
        model=model,
        asked=asked,
        scene=scene,
        equations=equations,
        reduction=reduction,
        coded=coded,
        coded_reduction=coded_reduction,
        whole=whole,
        table=table.keeping(outputs),
        system=system,
        structure=structure,
    )


def _resting_motions(eom: EquationsOfMotion) -> list[str]:
    """Prescribed motions that start at 0 because nobody said otherwise: a likely cause."""
    return [
        f"the prescribed motion {name_of(i.symbol)!r} starts at 0 {i.unit}, as no start is given: if the "
        f"constraints need another value, write Input({name_of(i.symbol)}, {i.unit!r}, start=...)"
        for i in eom.model.prescribed
        if float(i.start) == 0
    ]


def _asked(
    eom: EquationsOfMotion, scene: Scene, problems: list[str]
) -> tuple[Scene, Reduction | None, tuple[str, ...]]:
    """The scene with its formulation, the reduction to it, and the outputs by name."""
    if eom.frictions:
        problems += _refused_with_friction(eom, scene)
        scene = replace(scene, formulation=scene.formulation or "multipliers")
        return scene, None, _outputs(eom, None, scene, problems)
    if scene.formulation is not None:
        reduction = reduce(eom) if scene.formulation == "minimal" else None
        return scene, reduction, _outputs(eom, reduction, scene, problems)
    chosen = replace(scene, formulation="multipliers")
    if not scene.complete:
        try:
            reduction = reduce(eom)
        except DerivationError:
            reduction = None
        if reduction is not None and not reduction.rows:
            ignored: list[str] = []
            outputs = _outputs(eom, reduction, scene, ignored)
            reads_only = prune.read_only(eom, reduction, outputs)[0] is not eom
            if reads_only and not ignored:
                return replace(scene, formulation="minimal"), reduction, outputs
    return chosen, None, _outputs(eom, None, chosen, problems)


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


def _outputs(
    eom: EquationsOfMotion, reduction: Reduction | None, scene: Scene, problems: list[str]
) -> tuple[str, ...]:
    known = [v.name for v in variable_table(eom, reduction, scene).outputs]
    return select(scene.outputs, known, "output", problems)
