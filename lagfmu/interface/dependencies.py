"""What a variable depends on: inputs, states and the time at a communication point; what says its start."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from functools import cached_property

import sympy as sp

from .. import names
from ..mechanics.coupling import coupled
from ..mechanics.equations import TIME, EquationsOfMotion
from ..mechanics.form import Form
from ..model.elements import Expr


class Dependencies:
    """Of the variables of a form.

    `states`: names of the coordinates that are stepped, then of the speeds; `inputs`: names of what the
    importer drives; `known`: both; `given`: the states whose starts the model gives, and not roughly;
    `starts`: those of all.
    """

    def __init__(self, form: Form) -> None:
        eom, self.reduction, self.stepped = form.equations, form.reduction, form.stepped
        self.eom = eom
        self.states = [str(s) for s in (*self.stepped.q, *self.stepped.v)]
        hidden = {eom.u[eom.u.index(u) + k]: u for u in eom.estimated for k in (1, 2, 3)}
        self.into = hidden  # they follow from the values of the motion itself
        if (r := form.reduction) is not None:
            self.into = dict(zip((*eom.q, *eom.v), (*r.phi, *r.vel), strict=True)) | hidden
        self.inputs = [str(s) for s in eom.u if s not in hidden]
        self.known = {*self.states, *self.inputs}
        starts = eom.starts()
        self.given = starts.keys() - {str(eom.symbols[s]) for s in eom.model.rough}
        self.starts = {name: starts.get(name, sp.S.Zero) for name in self.states}

    def symbols(self, *expressions: Expr) -> set[str]:
        """Names of the symbols that the expressions hold, reduced coordinates put in; of the time, `time`."""
        found: set[str] = set()
        for e in expressions:
            if e is not None:
                held = sp.sympify(e).xreplace(self.into).free_symbols
                found |= {names.TIME if s == TIME else str(s) for s in held}
        return found

    def rates(self, k: int) -> set[str]:
        """The symbols behind G v - nu of a row."""
        own = {j: a for (i, j), a in self.eom.G.todok().items() if i == k}
        return self.symbols(*own.values(), self.eom.nu[k], *(self.eom.v[j] for j in own))

    def group(self, *, speed: int | None = None, row: int | None = None) -> set[str]:
        """Symbols behind the accelerations and multipliers that are solved together."""
        for speeds, rows, symbols in self.groups:
            if speed in speeds or (row is not None and row in rows):
                return symbols
        raise KeyError((speed, row))

    @cached_property
    def groups(self) -> list[tuple[frozenset[int], frozenset[int], set[str]]]:
        """The groups of `coupled`, with the symbols in their equations."""
        eom, found = self.eom, []
        for speeds, rows in coupled(eom):
            M = [m for (i, _), m in eom.M.todok().items() if i in speeds]
            G = [a for (k, _), a in eom.G.todok().items() if k in rows]
            rest = [eom.F[i] for i in speeds] + [eom.gamma[k] for k in rows]
            found.append((speeds, rows, self.symbols(*M, *G, *rest)))
        return found

    @cached_property
    def of_stepped(self) -> set[str]:
        """Symbols behind the accelerations of the stepped coordinates of a reduction."""
        eom = self.stepped
        return self.symbols(*eom.M.todok().values(), *eom.F, *eom.G.todok().values(), *eom.gamma)

    @cached_property
    def _stepped_groups(self) -> list[tuple[set[str], set[str]]]:
        """Of the coordinates that are stepped: the states of each group, the symbols of its start."""
        eom, found = self.stepped, []
        for speeds, rows in coupled(eom):
            own = _moved(eom, speeds) | {str(eom.v[i]) for i in speeds}
            behind = self.symbols(*(eom.f[k] for k in rows), *(eom.nu[k] for k in rows))
            behind |= self.symbols(*(a for (k, _), a in eom.G.todok().items() if k in rows))
            behind |= self.symbols(*(m for (i, _), m in eom.M.todok().items() if i in speeds))
            found.append((own, own | behind))
        return found

    @cached_property
    def movable(self) -> set[str]:
        """States that the projection of the start values can move."""
        moved: set[str] = set()
        eom = self.stepped
        for speeds, group in coupled(eom):
            rows = {k for k in group if eom.constraints[k].name not in eom.limited}
            if any(eom.f[k] is not None for k in rows):
                moved |= _moved(eom, speeds)
            if rows:
                moved |= {str(eom.v[i]) for i in speeds}
        settled = {j for places in eom.quaternions for j in places} | eom.unwrapped.keys()
        return moved | {str(eom.q[j]) for j in settled}

    def at_points(self, symbols: Iterable[str]) -> tuple[str, ...]:
        """Inputs, states and the time behind a value at a communication point."""
        return self._sorted((self.known | {names.TIME}).intersection(symbols))

    def at_start(self, symbols: Iterable[str]) -> tuple[str, ...]:
        """Inputs, parameters, exact start values and the time behind a value at the start."""
        found = set(symbols)
        for own, behind in self._stepped_groups:
            if found & own & self.movable:
                found |= behind
        parameters = {str(p) for p in self.eom.p}
        formulas = {name for name, e in self.starts.items() if e.free_symbols}
        found |= self.symbols(*(self.starts[name] for name in found & formulas))
        exact = set(self.states) - self.movable - formulas
        return self._sorted(found & (parameters | exact | {*self.inputs, names.TIME}))

    def _sorted(self, found: set[str]) -> tuple[str, ...]:
        order = [*(str(p) for p in self.eom.p), *self.inputs, *self.states, names.TIME]
        return tuple(n for n in order if n in found)


def _moved(eom: EquationsOfMotion, speeds: Collection[int]) -> set[str]:
    """The coordinates that these speeds move."""
    rows = eom.kinematics.rows
    return {str(q) for q, row in zip(eom.q, rows, strict=True) if row.keys() & set(speeds)}
