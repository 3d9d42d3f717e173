"""A model in a scene, with all that is known about it before anything is packaged or simulated."""

from __future__ import annotations

from dataclasses import dataclass

from .consistency import Structure, check_embedding, examine
from .equations import EquationsOfMotion, derive
from .model import Model
from .numeric import lower
from .reduction import Reduction, reduce
from .scene import Scene
from .solver.system import System
from .variables import VariableTable, variable_table


@dataclass(frozen=True)
class Prepared:
    """All that is known about a model in a scene before anything is packaged."""

    model: Model
    scene: Scene
    equations: EquationsOfMotion
    reduction: Reduction | None
    table: VariableTable
    system: System
    structure: Structure


def prepare(model: Model, scene: Scene | None = None) -> Prepared:
    """Derive, reduce if asked, lower and examine.  Raises ModelError or DerivationError."""
    scene = scene or Scene(model.name)
    equations = derive(model)
    reduction = reduce(equations) if scene.formulation == "minimal" else None
    if reduction is not None:
        check_embedding(equations, reduction)
    table = variable_table(equations, reduction, scene)
    system = lower(equations, reduction, scene.formulation)
    structure = examine(equations, table, system)
    return Prepared(model, scene, equations, reduction, table, system, structure)
