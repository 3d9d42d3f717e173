"""What a variable depends on: inputs, states and the time at a communication point; what says its start."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable
from functools import cached_property

import sympy as sp

from .. import names
from ..mechanics.equations import EquationsOfMotion
from ..mechanics.formulations import Form, coupled
from ..model.elements import TIME, Expr

Names = frozenset[str]


class Dependencies:
    """Of the variables of a form.

    `states`: names of the coordinates that are stepped, then of the speeds; `inputs`: names of what the
    importer drives; `known`: both; `given`: the states whose starts the model gives, and not roughly;
    `starts`: those of all.
    """

    def __init__(self, form: Form) -> None:
        eom, self.reduction, self.stepped = form.equations, form.reduction, form.stepped
        self.eom, self.joint_coordinates = eom, form.joint_coordinates
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
        self._order = {
            name: k
            for k, name in enumerate(
                [*(s.name for s in eom.p), *self.inputs, *self.states, names.TIME]
            )
        }
        self._sorted_at_points: dict[Names, tuple[str, ...]] = {}
        self._sorted_at_start: dict[Names, tuple[str, ...]] = {}

    def symbols(self, *expressions: Expr) -> Names:
        """Names of the symbols that the expressions hold, reduced coordinates put in; of the time, `time`."""
        held: set[Expr] = set()
        for e in expressions:
            if e is not None:
                held |= (sp.sympify(e).xreplace(self.into) if self.into else e).free_symbols
        return frozenset(names.TIME if s == TIME else s.name for s in held)

    def rates(self, k: int) -> Names:
        """The symbols behind G v - nu of a row."""
        own = self._rows[k]
        return self.symbols(*own.values(), self.eom.nu[k], *(self.eom.v[j] for j in own))

    @cached_property
    def _rows(self) -> dict[int, dict[int, Expr]]:
        found: dict[int, dict[int, Expr]] = defaultdict(dict)
        for (k, j), a in self.eom.G.todok().items():
            found[k][j] = a
        return found

    def group(self, *, speed: int | None = None, row: int | None = None) -> Names:
        """Symbols behind the accelerations and multipliers that are solved together; behind accelerations, as
        an importer integrates them, also what leads back onto the rows."""
        of_speeds, of_rows = self._groups_of
        return of_rows[row] if speed is None and row is not None else of_speeds[speed]

    @cached_property
    def _groups_of(self) -> tuple[dict[int | None, Names], dict[int, Names]]:
        of_speeds: dict[int | None, Names] = {}
        of_rows: dict[int, Names] = {}
        for speeds, rows, symbols in self.groups:
            of_rows |= dict.fromkeys(rows, symbols)
            back = self.symbols(*(self.eom.f[k] for k in rows)).union(*map(self.rates, rows))
            of_speeds |= dict.fromkeys(speeds, symbols | back)
        return of_speeds, of_rows

    @cached_property
    def groups(self) -> list[tuple[frozenset[int], frozenset[int], Names]]:
        """The groups of `coupled`, with the symbols in their equations."""
        eom, found = self.eom, []
        masses = eom.M.todok().items()
        for speeds, rows in coupled(eom):
            M = [m for (i, _), m in masses if i in speeds]
            G = [a for k in rows for a in self._rows[k].values()]
            rest = [eom.F[i] for i in speeds] + [eom.gamma[k] for k in rows]
            held = {eom.constraints[k].name for k in rows}
            rest += [e for law in eom.frictions if held & {*law.of} for e in law.expressions]
            found.append((speeds, rows, self.symbols(*M, *G, *rest)))
        return found

    @cached_property
    def of_stepped(self) -> Names:
        """Symbols behind the accelerations of the stepped coordinates of a reduction."""
        eom = self.stepped
        return self.symbols(*eom.M.todok().values(), *eom.F, *eom.G.todok().values(), *eom.gamma)

    @cached_property
    def _behind_start(self) -> dict[str, Names]:
        """Of each state that the projection can move: the symbols of the start of its group."""
        found: dict[str, Names] = {}
        eom = self.stepped
        for speeds, rows in coupled(eom):
            own = _moved(eom, speeds) | {eom.v[i].name for i in speeds}
            behind = self.symbols(*(eom.f[k] for k in rows), *(eom.nu[k] for k in rows))
            behind |= self.symbols(*(a for (k, _), a in eom.G.todok().items() if k in rows))
            behind |= self.symbols(*(m for (i, _), m in eom.M.todok().items() if i in speeds))
            found |= dict.fromkeys(own & self.movable, behind | own)
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

    @cached_property
    def _quaternions(self) -> list[Names]:
        """The four parts of each."""
        q = self.stepped.q
        return [frozenset(str(q[j]) for j in places) for places in self.stepped.quaternions]

    @cached_property
    def _angles(self) -> dict[str, Expr]:
        """What each angle that goes on over turns equals modulo 2 pi, by its name."""
        return {str(self.stepped.q[j]): e for j, e in self.stepped.unwrapped.items()}

    def at_points(self, symbols: Iterable[str]) -> tuple[str, ...]:
        """Inputs, states and the time behind a value at a communication point: states that are set are
        settled, so that each part of a quaternion is by all four."""
        asked = frozenset(symbols)
        if asked not in self._sorted_at_points:
            behind = asked | self.symbols(*(self._angles[n] for n in asked & self._angles.keys()))
            behind = behind.union(*(four for four in self._quaternions if four & behind))
            known = {n for n in behind if n in self.known or n == names.TIME}
            self._sorted_at_points[asked] = self._sorted(known)
        return self._sorted_at_points[asked]

    def at_start(self, symbols: Iterable[str]) -> tuple[str, ...]:
        """Inputs, parameters, exact start values and the time behind a value at the start."""
        asked = frozenset(symbols)
        if asked not in self._sorted_at_start:
            groups = {self._behind_start[n] for n in asked if n in self._behind_start}
            found = one_of(asked, groups)
            if found != asked:
                self._sorted_at_start[asked] = self.at_start(found)
            else:
                found |= self.symbols(*(self._formulas[n] for n in found if n in self._formulas))
                self._sorted_at_start[asked] = self._sorted(found & self._settable)
        return self._sorted_at_start[asked]

    @cached_property
    def _formulas(self) -> dict[str, Expr]:
        return {name: e for name, e in self.starts.items() if e.free_symbols}

    @cached_property
    def _settable(self) -> Names:
        """Parameters, exact start values, inputs and the time."""
        exact = set(self.states) - self.movable - self._formulas.keys()
        return frozenset({*(s.name for s in self.eom.p), *exact, *self.inputs, names.TIME})

    def _sorted(self, found: Collection[str]) -> tuple[str, ...]:
        return tuple(sorted((n for n in found if n in self._order), key=self._order.__getitem__))


def one_of(found: Names, groups: Collection[Names]) -> Names:
    """What is found with these groups; one of them itself if it holds all the others."""
    largest = max(groups, key=len, default=found)
    if all(part is largest or part <= largest for part in (found, *groups)):
        return largest
    return found.union(*groups)


def _moved(eom: EquationsOfMotion, speeds: Collection[int]) -> set[str]:
    """The coordinates that these speeds move."""
    rows = eom.kinematics.rows
    return {str(q) for q, row in zip(eom.q, rows, strict=True) if row.keys() & set(speeds)}
