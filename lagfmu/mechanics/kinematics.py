"""How coordinates move: q' = B(q, t) v + b(q, t), and the terms that this gives to Lagrange's equations.

In speeds that are no rates of coordinates Lagrange's equations are those of Boltzmann and Hamel (Poincare
1901; Hamel, Theoretische Mechanik, sect. 4; Greenwood, Advanced Dynamics, eq. 4.35):

    d/dt dL/dv_i - X_i L - sum_kr c^r_ki v_k dL/dv_r = Q_i + (G^T lambda)_i

X_i = sum_j B_ji d/dq_j is the derivative along speed i, X_0 = d/dt + sum_j b_j d/dq_j that along time with
v_0 = 1, and [X_k, X_i] = sum_r c^r_ki X_r defines the coefficients c.  For the rates of coordinates they
are 0.  With the angular velocity in the frame of the body, c = +1 for (k, i, r) = (1, 2, 3) and its cycles:
the term is Pi x omega, and J omega' = (J omega) x omega + tau.

Rotation matrices and vectors that are fixed on bodies, as quantities with rates of their own.

    R' = R [w]x ,   (R s)' = R (w x s) ,   (R (w x s))' = R (w x (w x s))   while w does not change

w is the angular velocity in the frame of the body, of which the kinematics of the unit quaternion are made
(Goldstein, Classical Mechanics, sect. 4.9).
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import sympy as sp
from sympy.polys.matrices import DomainMatrix
from sympy.polys.matrices.exceptions import DMNonInvertibleMatrixError

from ..model.attitude import Attitude, Carried, ClosedFunction, pattern, quaternion_rates
from ..model.differential import Differential
from ..model.elements import Expr, Output, Tie
from ..model.model import Model
from ..model.speeds import quaternions
from ..names import derivative, read

UNITS = ((1, 0, 0), (0, 1, 0), (0, 0, 1))


@dataclass(frozen=True)
class Closed:
    """What is closed -> symbols, and the rates of these; `positions`: those of coordinates alone, whose rates
    are linear in the speeds.  `carried`: of fixed vectors these rates as one symbol, which has a
    rate itself."""

    symbols: dict[Expr, Expr] = field(default_factory=dict)
    positions: dict[Expr, Expr] = field(default_factory=dict)
    rates: dict[Expr, Expr] = field(default_factory=dict)
    carried: dict[Expr, Expr] = field(default_factory=dict)

    def matrix(self, k: int, e: tuple[Expr, ...], w: tuple[Expr, ...]) -> None:
        """R and its rate."""
        x, y, z = w
        R = [[sp.Symbol(f"R{i}{j} of {k}", real=True) for j in range(3)] for i in range(3)]
        for i, row in enumerate(R):
            self.symbols.update({Attitude(i, j, *e): s for j, s in enumerate(row)})
            turned = row[1] * z - row[2] * y, row[2] * x - row[0] * z, row[0] * y - row[1] * x
            self.positions.update(zip(row, turned, strict=True))

    def vector(self, a: Carried, w: tuple[Expr, ...]) -> None:
        """A component, its slope by each speed, its rate and its bend."""
        order, i, e, s, by = a.parts
        if s == w:  # the angular velocity along the ground's axes: R w' is its rate
            self.rates[self._symbol(a)] = sp.S.Zero
        elif not order or by == w:
            value = self._symbol(Carried(0, i, *e, *s, 0, 0, 0))
            slopes = [self._symbol(Carried(1, i, *e, *s, *unit)) for unit in UNITS]
            rate, bend = (self._symbol(Carried(k, i, *e, *s, *w)) for k in (1, 2))
            self.positions[value] = sp.Add(*map(sp.Mul, slopes, w))
            self.rates[rate], self.carried[value] = bend, rate

    def _symbol(self, a: Expr) -> Expr:
        if a == 0:
            return a
        return self.symbols.setdefault(a, sp.Symbol(f"fixed {len(self.symbols)}", real=True))


def attitudes(model: Model, table: Mapping[Expr, Expr]) -> Closed:
    """Of the unit quaternions whose kinematics are e' = e (0, w) / 2; with symbols for those whose rotation
    matrix or vector stands in the energy, a rate, or a constraint that brings no rates of its own.  `table`:
    dynamicsymbols -> plain symbols."""
    expressions = [model.energy_expression, *map(sp.sympify, model.kinematics.values())]
    expressions += [sp.sympify(c.expression) for c in model.constraints if not isinstance(c, Tie)]
    found = set().union(*(e.atoms(ClosedFunction) for e in expressions))
    fixed: dict[tuple[Expr, ...], dict[Carried, None]] = {}
    of_quaternions = {a.quaternion for a in found}
    for a in sorted((a for a in found if isinstance(a, Carried)), key=str):
        fixed.setdefault(a.quaternion, {})[a] = None
    made = Closed()
    for k, four in enumerate(quaternions(model)):
        w = angular_velocity(model, four) if four in of_quaternions else None
        if w is not None:
            e, w = tuple(table[s] for s in four), tuple(s.xreplace(table) for s in w)
            made.matrix(k, e, w)
            for a in fixed.get(four, ()):
                made.vector(a.xreplace(table), w)
    made.rates.update(made.positions)
    return made


def angular_velocity(model: Model, four: tuple[Expr, ...]) -> tuple[Expr, ...] | None:
    """w (3) in the frame of the body; None if the kinematics are others."""
    if not all(s in model.kinematics for s in four):
        return None
    given = [sp.expand(model.kinematics[s]) for s in four]
    w = tuple(2 * rate.diff(four[0]) for rate in given[1:])
    expected = quaternion_rates(four, w)
    alike = all(sp.expand(a - b) == 0 for a, b in zip(given, expected, strict=True))
    return w if alike else None


TRIALS = 3
Turning = list[list[tuple[int, Expr]]]  # of each speed r: (i, sum_k c^r_ki v_k)


@dataclass(frozen=True)
class Kinematics:
    """q' = B v + b of coordinates q (nq) and speeds v (nv), in plain symbols.

    `rates` (nq) are the expressions of q', `time` is the symbol of time, `drift` the rates of prescribed
    inputs. `unwrapped` are the places of what follows from other coordinates.
    """

    q: tuple[Expr, ...]
    v: tuple[Expr, ...]
    rates: tuple[Expr, ...]
    time: Expr
    drift: Mapping[Expr, Expr]
    unwrapped: frozenset[int] = frozenset()

    def beside(self, more: Mapping[Expr, Expr]) -> Kinematics:
        """The same with quantities that follow from the coordinates as further coordinates: their rates."""
        follow = frozenset(range(len(self.q), len(self.q) + len(more)))
        q, rates = (*self.q, *more), (*self.rates, *more.values())
        return replace(self, q=q, rates=rates, unwrapped=self.unwrapped | follow)

    @cached_property
    def place(self) -> dict[Expr, int]:
        """Of each coordinate."""
        return {s: j for j, s in enumerate(self.q)}

    @cached_property
    def B(self) -> dict[tuple[int, int], Expr]:
        """The non-zeros of B (nq, nv)."""
        place = {s: i for i, s in enumerate(self.v)}
        slope = [Differential({s: sp.S.One}) for s in self.v]
        found = {}
        for j, rate in enumerate(self.rates):
            for i in sorted(place[s] for s in rate.free_symbols & place.keys()):
                found[j, i] = slope[i](rate)
        return found

    @cached_property
    def b(self) -> tuple[Expr, ...]:
        """b (nq)."""
        still = dict.fromkeys(self.v, sp.S.Zero)
        return tuple(rate.xreplace(still) for rate in self.rates)

    @cached_property
    def columns(self) -> list[dict[int, Expr]]:
        """X_i as {coordinate: B_ji} for each speed."""
        found: list[dict[int, Expr]] = [{} for _ in self.v]
        for (j, i), a in self.B.items():
            found[i][j] = a
        return found

    def along(self, i: int, expression: Expr) -> Expr:
        """X_i of an expression of q and t."""
        present = expression.free_symbols
        parts = [
            a * expression.diff(self.q[j])
            for j, a in self.columns[i].items()
            if self.q[j] in present
        ]
        return sp.Add(*parts)

    def along_time(self, expression: Expr) -> Expr:
        """X_0 of an expression: what changes while the speeds are 0."""
        present = expression.free_symbols
        parts = [
            b * expression.diff(s)
            for s, b in zip(self.q, self.b, strict=True)
            if s in present and b != 0
        ]
        parts += [rate * expression.diff(u) for u, rate in self.drift.items() if u in present]
        if expression.has(self.time):
            parts.append(expression.diff(self.time))
        return sp.Add(*parts)

    @cached_property
    def rows(self) -> list[dict[int, Expr]]:
        """Row j of B as {speed: B_ji} for each coordinate."""
        found: list[dict[int, Expr]] = [{} for _ in self.q]
        for (j, i), a in self.B.items():
            found[j][i] = a
        return found

    @cached_property
    def commutators(self) -> tuple[Turning, list[str]]:
        """What multiplies dL/dv_r in equation i, sum_k c^r_ki v_k, for each r; and where there is none.

        There is none where the speeds are fewer than the directions that their commutators reach: then the
        kinematics restrict the motion as a nonholonomic constraint does.
        """
        found: Turning = [[] for _ in self.v]
        known: dict[object, dict[int, Expr]] = {}  # of a kind
        for group in self._groups():
            solve, kind = self._solver(group), self._kind(group)
            for i in group:
                for k in (None, *group):
                    case = kind, group.index(i), k if k is None else group.index(k)
                    c: dict[int, Expr] | None
                    if kind is not None and case in known:
                        c = {group[r]: x for r, x in known[case].items()}
                    else:
                        bracket = self._bracket(k, i) if k != i else {}
                        c = solve(bracket) if bracket else {}
                        if c is not None and all(x.is_number for x in c.values()):
                            known[case] = {group.index(r): x for r, x in c.items()}
                    if c is None:
                        names = " and ".join(
                            "time" if x is None else str(self.v[x]) for x in (k, i)
                        )
                        return found, [
                            f"the directions of {names} lead out of those that the kinematics allow, which "
                            "so restrict the motion: take a speed for each direction, and a Nonholonomic "
                            "constraint for what is not allowed"
                        ]
                    for r, x in c.items():
                        found[r].append((i, x if k is None else x * self.v[k]))
        return found, []

    def _kind(self, group: list[int]) -> object:
        """What groups have in common whose coefficients are the same numbers: bodies; None if they drift."""
        rows = sorted({j for i in group for j in self.columns[i]} - self.unwrapped)
        values = [self.columns[i].get(j, sp.S.Zero) for i in group for j in rows]
        if self._drifting or not values:
            return None
        place = {s: ("q", j) for j, s in enumerate(self.q)}
        found = pattern(values, place.get, "")
        if found is None:
            return None
        numbers = {s: k for k, s in enumerate(found.inputs)}
        return found.kind, tuple(numbers.get(self.q[j]) for j in rows)

    def _groups(self) -> list[list[int]]:
        """Speeds that share coordinates in B, or one of which moves what B of another or b of its coordinates
        depends on; without those that are rates and meet no other."""
        plain = {i for i, column in enumerate(self.columns) if list(column.values()) == [sp.S.One]}
        of = {s: j for j, s in enumerate(self.q)}
        kept = [
            {j: a for j, a in column.items() if j not in self.unwrapped} for column in self.columns
        ]
        inside = [{of[s] for a in c.values() for s in a.free_symbols if s in of} for c in kept]
        dependent = set().union(*inside)
        touched = [
            ({i}, {*kept[i]} | inside[i] | (column.keys() & dependent))
            for i, column in enumerate(self.columns)
            if i not in plain
        ]
        drifts = {j: {of[s] for s in self.b[j].free_symbols if s in of} for j in self._drifting}
        touched += [(set(), {j} | others) for j, others in drifts.items() if others]
        groups: dict[int, tuple[set[int], set[int]]] = {}
        group_of: dict[int, int] = {}  # of each place
        for number, (speeds, places) in enumerate(touched):
            for other in sorted({group_of[j] for j in places if j in group_of}):
                more, others = groups.pop(other)
                speeds, places = speeds | more, places | others
            groups[number] = speeds, places
            group_of |= dict.fromkeys(places, number)
        rates = {j: i for i in plain for j in self.columns[i]}
        return [sorted(s | {rates[j] for j in p if j in rates}) for s, p in groups.values()]

    @cached_property
    def _drifting(self) -> list[int]:
        """The coordinates with a b: without those that no speed moves, which are no directions of motion."""
        free = [j for j, row in enumerate(self.rows) if row and j not in self.unwrapped]
        return [j for j in free if self.b[j] != 0]

    def _bracket(self, k: int | None, i: int) -> dict[int, Expr]:
        """[X_k, X_i] by coordinate."""
        rows = {*self.columns[i], *(self._drifting if k is None else self.columns[k])}
        found = {}
        for j in sorted(rows - self.unwrapped):
            first = self.columns[i].get(j, sp.S.Zero)
            second = self.b[j] if k is None else self.columns[k].get(j, sp.S.Zero)
            forward = self.along_time(first) if k is None else self.along(k, first)
            entry = sp.expand(forward - self.along(i, second))
            if entry != 0:
                found[j] = entry
        return found

    def _solver(self, group: list[int]) -> Callable[[Mapping[int, Expr]], dict[int, Expr] | None]:
        """bracket -> {r: c^r} of the group's speeds; None for a bracket that is none of theirs."""
        rows = sorted({j for i in group for j in self.columns[i]} - self.unwrapped)
        B = sp.Matrix(
            len(rows), len(group), lambda a, c: self.columns[group[c]].get(rows[a], sp.S.Zero)
        )

        def solve(bracket: Mapping[int, Expr]) -> dict[int, Expr] | None:
            right = sp.Matrix([bracket.get(j, sp.S.Zero) for j in rows])
            if set(bracket) - set(rows):
                return None
            c = _constant(B, right)
            if c is None:
                c = _symbolic(B, right)
            return None if c is None else {group[r]: x for r, x in enumerate(c) if x != 0}

        return solve


def _constant(B: Expr, right: Expr) -> Expr | None:
    """The c of B c = right that is the same at random points, as those of rotations are; None where there is
    none, or B is no polynomial."""
    symbols = sorted(B.free_symbols | right.free_symbols, key=str)
    if not all(e.is_polynomial(*symbols) for e in (*B, *right)):
        return None
    generator, found = random.Random(3), None
    for _ in range(TRIALS):
        at = {s: sp.Rational(generator.randint(100, 999), 331) for s in symbols}
        here, b = B.xreplace(at), right.xreplace(at)
        gram = here.T * here
        if gram.det() == 0:
            return None
        c = gram.LUsolve(here.T * b)
        if here * c != b or (found is not None and c != found):
            return None
        found = c
    return found


def _symbolic(B: Expr, right: Expr) -> Expr | None:
    """The c of B c = right, of more rows than columns by (B^T B)^-1 B^T; None where there is none."""
    if B.is_square:
        left, over = B, right
    else:
        left, over = (B.T * B).applyfunc(sp.factor), B.T * right
    fields = (DomainMatrix.from_Matrix(part).to_field() for part in (left, over))
    try:
        c = DomainMatrix.lu_solve(*DomainMatrix.unify(*fields)).to_Matrix()
    except DMNonInvertibleMatrixError:
        return None
    c = c.applyfunc(lambda e: sp.cancel(sp.trigsimp(e)))
    return c if _vanishes(B * c - right) else None


def _vanishes(entries: Expr) -> bool:
    """Zero at random points."""
    generator = random.Random(11)
    symbols = sorted(entries.free_symbols, key=str)
    for _ in range(TRIALS):
        at = {s: sp.Rational(generator.randint(100, 999), 331) for s in symbols}
        if any(abs(sp.N(e.xreplace(at), 30)) > sp.Float("1e-20") for e in entries):
            return False
    return True


class JointCoordinate(NamedTuple):
    """Its value and its rate are outputs of the model's own, by number; or it is a coordinate, with its rate:
    otherwise that is -1.  `within_turn`: the output is known modulo 2 pi alone."""

    name: str
    coordinate: int
    value: int
    rate: int
    within_turn: bool


def joint_coordinates(
    model: Model, q: Sequence[Expr], outputs: Sequence[Output]
) -> tuple[JointCoordinate, ...]:
    """Those of the model's joint_starts that are there, with their rates."""
    places = {str(s): j for j, s in enumerate(q)}
    own = {o.name: k for k, o in enumerate(outputs)}
    found = []
    for name in (n for n in model.joint_starts if not read(n).order):
        rate = derivative(name)
        if name in places:
            found.append(JointCoordinate(name, places[name], -1, -1, False))
        elif name in own and rate in own:
            o = outputs[own[name]]
            turns = sp.sympify(o.expression).has(sp.atan2)
            found.append(JointCoordinate(name, -1, own[name], own[rate], turns))
    return tuple(found)


def start_names(found: Sequence[JointCoordinate]) -> list[str]:
    """Of what start values are given besides coordinates and speeds: the value and the rate of each."""
    return [derivative(c.name, order) for c in found for order in (0, 1)]
