"""What variables depend on where an importer solves for the multipliers: these are then known, as states and
inputs are, and accelerations follow from  M vdot = F + G^T lambda  alone."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

from .. import names
from ..mechanics.coupling import sharing_inertia
from ..mechanics.form import Form
from ..mechanics.friction_law import FrictionLaw
from ..model.model import Contact
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
        self.laws = {name: law for law in self.eom.frictions for name in law.of}

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
        rows = [c.name for c in eom.constraints]
        return of_speeds, {
            k: self._of_law(self.laws[c]) if c in self.laws else frozenset([self.multipliers[k]])
            for k, c in enumerate(rows)
        }

    def _of_law(self, law: FrictionLaw) -> Names:
        """The multipliers of a friction, those of its normal force, and the symbols beside them."""
        rows = (names.name(names.MULTIPLIER, c) for c in (*law.of, *law.normal_rows))
        return self.symbols(*law.expressions).union(rows)

    def equation(self, k: int) -> Names:
        """The symbols behind what vanishes by the multiplier of a row: G vdot - gamma, the multiplier itself,
        what a law of friction makes of it by its slip."""
        own, c = self._rows[k], self.eom.constraints[k]
        found = self.symbols(*own.values(), self.eom.gamma[k]) | {self.multipliers[k]}
        found = found.union(*(self.group(speed=j) for j in own))
        if c.name in self.laws:
            rows = {name: j for j, name in enumerate(c.name for c in self.eom.constraints)}
            law = self.laws[c.name]
            found = (found | self._of_law(law)).union(*(self.rates(rows[name]) for name in law.of))
        return found

    def indicator(self, name: str) -> Names | None:
        """Behind that of a contact; of all others nothing is said."""
        for k, c in enumerate(self.eom.constraints):
            if isinstance(c, Contact) and c.name == name:
                return self.symbols(self.eom.f[k]) | {self.multipliers[k]}
        return None


def known_with_multipliers(
    form: Form, table: VariableTable
) -> Mapping[str, tuple[str, ...] | None]:
    """Inputs, states, multipliers and the time behind each variable, by name; None: all may be."""
    behind = GivenMultipliers(form)
    outputs = Outputs(behind, loses=names.DISSIPATED in table.states)
    found: dict[str, tuple[str, ...] | None] = {v.name: v.depends for v in outputs.all()}
    rows = {c.name: k for k, c in enumerate(behind.eom.constraints)}
    for v in table.those(names.EQUATION):
        found[v.name] = behind.at_points(behind.equation(rows[v.of.constraint]))
    for v in table.those(names.INDICATOR):
        of = behind.indicator(v.of.constraint)
        found[v.name] = None if of is None else behind.at_points(of)
    return found
