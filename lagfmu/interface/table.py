"""(form, scene) -> the FMU's variable table.

Names, order, references, causality, units, start values and dependencies are decided in this room only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from .. import names
from ..errors import ModelError
from ..mechanics.form import Form
from ..model.scene import Scene
from ..model.units import DisplayUnit, parse_scaled
from ..names import derivative
from .dependencies import Dependencies
from .outputs import Outputs
from .sensitivities import differentiated
from .settable import drives, parameters, solver_settings
from .variables import Variable, VariableTable


def variable_table(form: Form, scene: Scene) -> VariableTable:
    """All variables of the FMU.  Raises ModelError if names collide or a unit cannot be written."""
    table = _table(form, scene)
    if scene.reals_only:
        table = table.as_reals()
    problems = collisions([v.name for v in table.variables])
    for v in table.variables:
        if v.unit is not None and any(e.denominator != 1 for e in v.unit.exponents):
            problems.append(
                f"the unit {v.unit.name} of {v.name!r} has fractional exponents, which FMI cannot "
                "express: write the constraint in another power"
            )
    if problems:
        raise ModelError(form.equations.model.name, problems)
    return table


def _table(form: Form, scene: Scene) -> VariableTable:
    eom, behind = form.equations, Dependencies(form)
    alone = not (scene.error_bars or scene.sensitivities or eom.estimated)
    loses = bool(eom.frictions) and alone
    outputs = Outputs(behind, loses)
    variables = [
        *parameters(eom),
        *solver_settings(scene),
        *drives(eom, behind.inputs),
        *outputs.all(),
    ]
    if scene.error_bars:
        variables += outputs.error_bars(variables)
    measurable = VariableTable(tuple(variables), (), ()).measurable
    variables += outputs.peaks(measurable)
    variables += outputs.sensitivities(differentiated(variables, scene.sensitivities, []))
    shown = eom.model.display_units
    variables = [replace(v, display=_displayed(v, shown.get(v.of.coordinate))) for v in variables]
    states = outputs.behind.states
    if eom.moves_plainly:  # each coordinate with its velocity
        states = [derivative(str(q), k) for q in form.stepped.q for k in (0, 1)]
    derivatives = [names.rate_of(s) for s in states]
    if loses:
        states.append(names.DISSIPATED)
        derivatives.append(names.DISSIPATION)
    return VariableTable(tuple(variables), tuple(states), tuple(derivatives))


def _displayed(v: Variable, text: str | None) -> DisplayUnit | None:
    """The unit in which the model gives what the variable is of."""
    if text is None or v.unit is None:
        return None
    shown: DisplayUnit | None = parse_scaled(text, v.name)
    for _ in range(v.of.order):
        shown = None if shown is None else shown.per_second()
    return shown if shown is not None and shown.unit.same_dimension(v.unit) else None


def collisions(known: Sequence[str]) -> list[str]:
    """What is wrong with these names: two that are the same, or a variable that is a group too."""
    problems = []
    seen = set()
    for name in known:
        if name in seen:
            problems.append(f"two variables of the FMU would be called {name!r}: rename one")
        seen.add(name)
    for name in sorted(seen):
        parts = name.split(".")
        for k in range(1, len(parts)):
            if ".".join(parts[:k]) in seen:
                problems.append(
                    f"{'.'.join(parts[:k])!r} would be a variable and a group: rename it"
                )
    return problems
