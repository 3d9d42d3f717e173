"""The rotation matrix of a unit quaternion, and vectors that are fixed on a body, which stay closed.

A point of a body is r + R s.  Were R written out, each derivative of a joint's condition would multiply
polynomials of eight quaternion components; closed, R' = R [w]x keeps a joint's equations as short as on paper
(mechanics/equations.py), and joints of a kind have the same expressions, whatever s is.  The numeric code
computes each matrix and each vector once; `written_out` gives the polynomials.

Expressions that are alike up to the names of their symbols, and to the vectors that are fixed on bodies.

The rows of two hinges differ in which bodies they tie, and in points and directions on these.  Written in
symbols that are numbered by their places, with the vectors of closed functions as data, they
are the same expressions: one of each kind is differentiated, printed and compiled.

What is closed -> steps that compute it: matrices, then vectors, each once.

rotation           R of e                          across             x = w x s
rotation_change    dR of e and de                  across_change      dw x s + w x ds
turned             u = R s                         levers             R (e_k x s) of the three axes k
turned_change      u = dR s + R ds
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import sympy as sp

from ..numeric.functions import OPERATIONS, across, rotation
from .elements import Expr

Change = Callable[[Expr], Expr]


class ClosedFunction(sp.Function):  # type: ignore[misc]
    """What numeric code computes by itself: a component of a matrix or a vector, by its arguments."""

    is_real = True
    is_commutative = True

    @property
    def vector(self) -> tuple[Expr, ...]:
        """What of its arguments is data, whatever the motion: none, or three."""
        return ()

    @property
    def quaternion(self) -> tuple[Expr, ...]:
        """e0, e1, e2, e3."""
        return tuple(self.args[2:6])

    def __new__(cls, *args: Any) -> ClosedFunction:
        """Of those arguments: nothing is evaluated."""
        made: ClosedFunction = sp.Expr.__new__(cls, *map(sp.sympify, args))
        return made

    @property
    def free_symbols(self) -> set[Expr]:
        """Found once."""
        return set(_symbols(self))

    def _xreplace(self, rule: Any) -> tuple[Expr, bool]:
        """Most rules hold nothing of what it is of."""
        if self in rule:
            return rule[self], True
        return super()._xreplace(rule) if any(e in rule for e in _inside(self)) else (self, False)

    @abstractmethod
    def opened(self) -> Expr:
        """One level further down: in elements of rotation matrices, or as a polynomial."""

    @abstractmethod
    def changed(self, d: Change) -> Expr:
        """Its change for those of its arguments."""

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        text = rf"\left({printer.doprint(self.opened())}\right)"
        return f"{text}^{{{exp}}}" if exp else text

    def _eval_derivative(self, s: Expr) -> Expr:
        along = self.changed(lambda x: x.diff(s))
        return self.opened().diff(s) if along.has(AttitudeChange, CarriedChange) else along


@lru_cache(maxsize=65536)
def _inside(e: Expr) -> frozenset[Expr]:
    """All expressions in its arguments."""
    return frozenset().union(*map(sp.preorder_traversal, e.args))


@lru_cache(maxsize=65536)
def _symbols(e: Expr) -> frozenset[Expr]:
    return frozenset().union(*(a.free_symbols for a in e.args))


class Attitude(ClosedFunction):
    """Element (i, j) of R(e0, e1, e2, e3): takes components in a body's frame to those in space."""

    nargs = 6

    @property
    def place(self) -> tuple[int, int]:
        """The row and the column."""
        return int(self.args[0]), int(self.args[1])

    def changed(self, d: Change) -> Expr:
        """For a change of the quaternion."""
        de = [d(x) for x in self.quaternion]
        return AttitudeChange(*self.args, *de) if any(x != 0 for x in de) else sp.S.Zero

    def opened(self) -> Expr:
        """The element written out: R' = R [w]x of whatever norm."""
        i, j = self.place
        return _written(self.quaternion)[3 * i + j]

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        i, j = self.place
        of = printer.doprint(self.quaternion[0])
        text = f"R_{{{i + 1}{j + 1}}}\\left({of}\\right)"
        return f"{text}^{{{exp}}}" if exp else text

    def _sympystr(self, printer: Any) -> str:
        i, j = self.place
        return f"R{i + 1}{j + 1}({printer.doprint(self.quaternion[0])})"


@lru_cache(maxsize=1024)
def _written(quaternion: tuple[Expr, ...]) -> list[Expr]:
    return rotation(quaternion)


class AttitudeChange(ClosedFunction):
    """The change of element (i, j) of R(e) for the change de of the quaternion."""

    nargs = 10

    def changed(self, d: Change) -> Expr:
        """Of changes no changes are asked for."""
        raise NotImplementedError

    def _eval_derivative(self, s: Expr) -> Expr:
        return self.opened().diff(s)

    def opened(self) -> Expr:
        """2 of R's terms for each that is a square, and both orders of each that is a product."""
        symbols = sp.symbols("e0:4", real=True)
        turned = Attitude(*self.args[:2], *symbols).opened()
        slope = sum(turned.diff(s) * de for s, de in zip(symbols, self.args[6:], strict=True))
        return slope.xreplace(dict(zip(symbols, self.args[2:6], strict=True)))


class Carried(ClosedFunction):
    """Component i along the ground's axes of a vector s that is fixed on a body, and of what w makes of it.

    Of the order 0: R s; 1: R (w x s), its rate where w is the angular velocity; 2: R (w x (w x s)).  s and w
    (0 in the order 0) are components in the body's frame.
    """

    nargs = 12

    def __new__(cls, *args: Any) -> Expr:
        """0 where the vector is or, in the higher orders, w is 0 or, if it moves, the vector."""
        s, w = args[6:9], args[9:]
        nothing = args[0] != 0 and (not any(w) or (s == w and any(sp.sympify(s).free_symbols)))
        return sp.S.Zero if nothing or not any(s) else super().__new__(cls, *args)

    @property
    def vector(self) -> tuple[Expr, ...]:
        """s."""
        return tuple(self.args[6:9])

    @property
    def parts(self) -> tuple[int, int, tuple[Expr, ...], tuple[Expr, ...], tuple[Expr, ...]]:
        """The order, the component, the quaternion, s, w."""
        order, i, *rest = self.args
        return int(order), int(i), tuple(rest[:4]), tuple(rest[4:7]), tuple(rest[7:])

    def opened(self) -> Expr:
        """In elements of R."""
        order, i, e, s, w = self.parts
        for _ in range(order):
            s = tuple(across(w, s))
        return sp.Add(*(Attitude(i, j, *e) * x for j, x in enumerate(s) if x != 0))

    def changed(self, d: Change) -> Expr:
        """For changes of the quaternion and of w together, and of s, by which it is linear."""
        order, i, e, s, w = self.parts
        de, ds, dw = ([d(x) for x in part] for part in (e, s, w))
        found = []
        if any(x != 0 for x in de) or (order == 2 and any(x != 0 for x in dw)):
            found.append(CarriedChange(*self.args, *de, *dw))
        elif any(x != 0 for x in dw):
            found.append(Carried(order, i, *e, *s, *dw))
        if any(x != 0 for x in ds):
            found.append(Carried(order, i, *e, *ds, *w))
        return sp.Add(*found)

    def _sympystr(self, printer: Any) -> str:
        order, i, e, s, _ = self.parts
        of = ", ".join(map(printer.doprint, (e[0], *s)))
        return f"fixed{i + 1}{'_' * bool(order)}{'t' * order}({of})"


def carried(
    order: int, e: Sequence[Expr], s: Sequence[Expr], w: Sequence[Expr]
) -> tuple[Expr, Expr, Expr]:
    """The three components."""
    by = w if order else (0, 0, 0)
    x, y, z = (Carried(order, i, *e, *s, *by) for i in range(3))
    return x, y, z


class CarriedChange(ClosedFunction):
    """The change of Carried(order, i, e, s, w) for the changes de and dw."""

    nargs = 19

    @property
    def vector(self) -> tuple[Expr, ...]:
        """s."""
        return tuple(self.args[6:9])

    def changed(self, d: Change) -> Expr:
        """Of changes no changes are asked for."""
        raise NotImplementedError

    def _eval_derivative(self, s: Expr) -> Expr:
        return self.opened().diff(s)

    def opened(self) -> Expr:
        """In elements of R and of its change, by the product rule."""
        of = Carried(*self.args[:12])
        order, i, e, s, w = of.parts
        de, dw = self.args[12:16], tuple(self.args[16:])
        change = sp.S.Zero
        if order == 1:
            change = Carried(1, i, *e, *s, *dw).opened()
        if order == 2:
            twice = [
                a + b
                for a, b in zip(across(dw, across(w, s)), across(w, across(dw, s)), strict=True)
            ]
            change = Carried(0, i, *e, *twice, 0, 0, 0).opened()
        turned = of.opened()
        rates = {a: AttitudeChange(*a.args, *de) for a in turned.atoms(Attitude)}
        return turned.xreplace(rates) + change


def quaternion_rates(e: Sequence[Expr], w: Sequence[Expr]) -> tuple[Expr, ...]:
    """e' (4) = e (0, w) / 2 of a unit quaternion; w (3): the angular velocity in the frame of the body."""
    e0, x, y, z = e
    across = y * w[2] - z * w[1], z * w[0] - x * w[2], x * w[1] - y * w[0]
    rest = ((e0 * along + turn) / 2 for along, turn in zip(w, across, strict=True))
    return (-(x * w[0] + y * w[1] + z * w[2]) / 2, *rest)


def rotation_matrix(quaternion: Sequence[Expr]) -> Expr:
    """R (3, 3) of the unit quaternion (e0, e1, e2, e3): components in a body's frame become those in
    space."""
    return sp.Matrix(3, 3, lambda i, j: Attitude(i, j, *quaternion))


def written_out(expression: Expr) -> Expr:
    """The expression with polynomials for all that is closed."""
    while found := expression.atoms(ClosedFunction):
        expression = expression.xreplace({a: a.opened() for a in found})
    return expression


Place = tuple[str, int]  # a group of symbols, and which of it


@dataclass(frozen=True)
class Pattern:
    """`values` in the symbols `symbols`, which stand for `inputs`: symbols of the `groups`, then components
    of vectors ("": numbers, or expressions of parameters)."""

    values: tuple[Expr, ...]
    symbols: tuple[Expr, ...]
    groups: tuple[str, ...]
    inputs: tuple[Expr, ...]

    @property
    def kind(self) -> object:
        """What those have in common that are alike."""
        return self.values, self.groups


@lru_cache(maxsize=1024)
def _text_of(number: Expr) -> str:
    """A number as text: few are many times."""
    return str(number)


def pattern(
    values: Sequence[Expr], place_of: Callable[[Expr], Place | None], data: str
) -> Pattern | None:
    """That of expressions in symbols that have a place; None where another symbol stands in them.  Vectors
    are data if their symbols are of the group `data`."""

    def known(x: Expr) -> bool:
        """A number, or of parameters."""
        symbols = [x] if place_of(x) else x.free_symbols
        return all((place := place_of(s)) is not None and place[0] == data for s in symbols)

    places: dict[Expr, Place] = {}
    spots: dict[tuple[Expr, ...], list[tuple[str, ...]]] = {}
    closed: dict[ClosedFunction, None] = {}
    made: dict[Expr, Expr] = {}
    for k, value in enumerate(values):
        stack, seen = [value], set[Expr]()
        while stack:
            e = stack.pop()
            if e in seen:
                continue
            seen.add(e)
            if (place := place_of(e)) is not None:
                places[e] = place
            elif isinstance(e, ClosedFunction):
                closed[e] = None
                is_data = e.vector and all(map(known, e.vector))
                stack.extend((*e.args[:6], *e.args[9:]) if is_data else e.args)
                if is_data:
                    numbers = (_text_of(x) for x in (*e.args[:2], *e.args[9:]) if x.is_number)
                    spots.setdefault(e.args[2:9], []).append((f"{k:6}", str(e.func), *numbers))
            elif e.is_Symbol:
                return None
            else:
                stack.extend(e.args)
    ordered = sorted(places, key=places.__getitem__)
    vectors = sorted(spots, key=lambda e: (places.get(e[0], ("", 0)), sorted(spots[e])))
    inputs = (*ordered, *(x for e in vectors for x in e[4:]))
    symbols = sp.symbols(f"a:{len(inputs)}", real=True)
    table: dict[Expr, Expr] = dict(zip(ordered, symbols, strict=False))
    vector_of = {e: symbols[len(ordered) + 3 * k :][:3] for k, e in enumerate(vectors)}
    for e in closed:
        args = [table[a] if a in table else a.xreplace(table) if a.args else a for a in e.args]
        if e.args[2:9] in vector_of:
            args[6:9] = vector_of[e.args[2:9]]
        made[e] = e.func(*args)
    table |= made
    groups = (*(places[s][0] for s in ordered), *("" for _ in range(3 * len(vectors))))
    return Pattern(tuple(v.xreplace(table) for v in values), symbols, groups, inputs)


VECTOR = "vector"
SIZES = {"rotation": 9, "rotation_change": 9, "levers": 9}  # of what a step computes; of others 3
AXES = ((1, 0, 0), (0, 1, 0), (0, 0, 1))


@dataclass(frozen=True)
class Step:
    """`name` = operation(arguments), names of other steps; a "vector" consists of `numbers`."""

    name: str
    operation: str
    arguments: tuple[str, ...] = ()
    numbers: tuple[Expr, ...] = ()

    @property
    def size(self) -> int:
        """How many numbers it holds."""
        return len(self.numbers) or SIZES.get(self.operation, 3)


@dataclass
class Closing:
    """Collects the steps; `fresh` makes the name of an array from its first letter."""

    fresh: Callable[[str], str]
    _steps: dict[object, Step] = field(default_factory=dict)

    @property
    def steps(self) -> list[Step]:
        """In the order in which they are needed."""
        return list(self._steps.values())

    def opened(self, values: Sequence[Expr]) -> tuple[list[Expr], dict[Expr, Place]]:
        """The values with symbols for what is closed, and where each of these stands."""
        while flat := {a: a.opened() for a in _closed(values) if _flat(a)}:
            values = [e.xreplace(flat) for e in values]
        table = {a: sp.Symbol(f"closed {k:05}", real=True) for k, a in enumerate(_closed(values))}
        places = {s: self._place(a) for a, s in table.items()}
        return [e.xreplace(table) for e in values], places

    def _place(self, a: ClosedFunction) -> Place:
        if isinstance(a, Attitude | AttitudeChange):
            e, de = a.args[2:6], a.args[6:]
            matrix = self._matrix_change(e, de) if de else self._matrix(e)
            return matrix, 3 * int(a.args[0]) + int(a.args[1])
        order, i = map(int, a.args[:2])
        e, s, w, de, dw = (
            tuple(a.args[j:k]) for j, k in ((2, 6), (6, 9), (9, 12), (12, 16), (16, 19))
        )
        at = self._vector(s)
        if w in AXES and not any(dw):
            R = self._matrix_change(e, de) if de else self._matrix(e)
            return self._step("L", "levers", R, at), 3 * AXES.index(w) + i
        change = ""
        for _ in range(order):
            by = self._vector(w)
            if de:
                dby = self._vector(dw)
                before = change or self._vector((sp.S.Zero,) * 3)
                change = self._step("x", "across_change", by, dby, at, before)
            at = self._step("x", "across", by, at)
        if not de:
            return self._step("u", "turned", self._matrix(e), at), i
        dR = self._matrix_change(e, de)
        if not change:
            return self._step("u", "turned", dR, at), i
        return self._step("u", "turned_change", self._matrix(e), dR, at, change), i

    def _matrix(self, e: tuple[Expr, ...]) -> str:
        return self._step("R", "rotation", self._vector(e))

    def _matrix_change(self, e: tuple[Expr, ...], de: tuple[Expr, ...]) -> str:
        return self._step("R", "rotation_change", self._vector(e), self._vector(de))

    def _vector(self, numbers: tuple[Expr, ...]) -> str:
        if numbers not in self._steps:
            self._steps[numbers] = Step(self.fresh("s"), VECTOR, (), numbers)
        return self._steps[numbers].name

    def _step(self, letter: str, operation: str, *arguments: str) -> str:
        key = operation, arguments
        if key not in self._steps:
            self._steps[key] = Step(self.fresh(letter), operation, arguments)
        return self._steps[key].name


def _closed(values: Sequence[Expr]) -> Iterator[ClosedFunction]:
    """Each once, in a fixed order."""
    seen: set[Expr] = set()
    for e in values:
        stack = [e]
        while stack:
            node = stack.pop()
            if node in seen:
                continue
            seen.add(node)
            if isinstance(node, ClosedFunction):
                yield node
            else:
                stack.extend(node.args)


def _flat(a: ClosedFunction) -> bool:
    """A direction along an axis of the body: columns of R, which are there."""
    if not isinstance(a, Carried | CarriedChange) or (a.args[12:] and a.args[0] != 0):
        return False
    return all(x.is_number for x in a.vector) and sum(x != 0 for x in a.vector) == 1


def computed(steps: Sequence[Step], known: Mapping[Expr, Any]) -> dict[str, list[Any]]:
    """The arrays of steps without changes; `known`: what stands for the symbols, of which each number is
    one, or it is a number."""
    found: dict[str, list[Any]] = {}
    for step in steps:
        if step.operation == VECTOR:
            found[step.name] = [known[x] if x in known else float(x) for x in step.numbers]
        else:
            found[step.name] = OPERATIONS[step.operation](*map(found.__getitem__, step.arguments))
    return found
