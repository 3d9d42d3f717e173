"""What variables depend on where an importer solves for the multipliers: these are then known, as states and
inputs are, and accelerations follow from  M vdot = F + G^T lambda  alone."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

from .. import names
from ..mechanics.coupling import sharing_inertia
from ..mechanics.form import Form
from .dependencies import Dependencies, Names
from .outputs import Outputs
from .variables import VariableTable


class GivenMultipliers(Dependencies):
    """Of the variables of a form whose multipliers are known."""

    def __init__(self, form: Form) -> None:
        super().__init__(form)
        self.multipliers = [names.name(names.MULTIPLIER, c.name) for c in self.eom.constraints]
        self.known |= {*self.multipliers}
        self._order |= {name: len(self._order) + k for k, name in enumerate(self.multipliers)}

    @cached_property
    def _groups_of(self) -> tuple[dict[int | None, Names], dict[int, Names]]:
        eom = self.eom
        of_speeds: dict[int | None, Names] = {}
        for speeds in sharing_inertia(eom):
            M = [m for (i, _), m in eom.M.todok().items() if i in speeds]
            G = {(k, j): a for (k, j), a in eom.G.todok().items() if j in speeds}
            symbols = self.symbols(*M, *G.values(), *(eom.F[i] for i in speeds))
            symbols |= {self.multipliers[k] for k, _ in G}
            of_speeds |= dict.fromkeys(speeds, symbols)
        return of_speeds, {k: frozenset([name]) for k, name in enumerate(self.multipliers)}

    def accelerations(self, k: int) -> Names:
        """The symbols behind G vdot - gamma of a row."""
        own = self._rows[k]
        return self.symbols(*own.values(), self.eom.gamma[k]).union(
            *(self.group(speed=j) for j in own)
        )


def known_with_multipliers(form: Form, table: VariableTable) -> Mapping[str, tuple[str, ...]]:
    """Inputs, states, multipliers and the time behind each variable, by name."""
    behind = GivenMultipliers(form)
    found = {v.name: v.depends for v in Outputs(behind, loses=False).all()}
    rows = {c.name: k for k, c in enumerate(behind.eom.constraints)}
    last = {v.of.constraint: v for v in table.those(names.RESIDUAL_RATE)}  # the highest order
    for v in table.variables:
        if v.of.quantity == names.RESIDUAL_RATE:
            k = rows[v.of.constraint]
            held = behind.accelerations(k) if v is last[v.of.constraint] else behind.rates(k)
            found[v.name] = behind.at_points(held)
        elif v.members:
            found[v.name] = tuple(dict.fromkeys(n for m in v.members for n in found[m]))
    return found
