"""Coulomb's law with its normal force in the multipliers of the equations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import sympy as sp

from ..model.elements import Expr, Friction
from ..model.norms import norm, norms_of
from ..model.reactions import multiplier, reactions_in
from ..names import read


@dataclass(frozen=True)
class NormalPart:
    """load + sum_k c[k] lambda_k, with names of constraints: a normal force, or one of its components."""

    load: Expr
    c: Mapping[str, Expr]

    @property
    def force(self) -> Expr:
        """In the multipliers' symbols."""
        return sp.Add(self.load, *(c * multiplier(k) for k, c in self.c.items()))


@dataclass(frozen=True)
class FrictionLaw:
    """|lambda| of the rows `of` is at most static * N, and kinetic * N while they slip.

    N is the sum of `norms`, each of one component or several; in plain symbols.
    """

    name: str
    of: tuple[str, ...]
    norms: tuple[tuple[NormalPart, ...], ...]
    static: Expr
    kinetic: Expr
    description: str = ""

    @property
    def parts(self) -> tuple[NormalPart, ...]:
        """The components of all norms."""
        return tuple(part for parts in self.norms for part in parts)

    @property
    def normal(self) -> Expr:
        """The normal force; where it is of one component, that with its sign."""
        if len(self.parts) == 1:
            return self.parts[0].force
        return sp.Add(*(norm(*(part.force for part in parts)) for parts in self.norms))

    @property
    def normal_rows(self) -> tuple[str, ...]:
        """The constraints whose multipliers make up the normal force, as often as they stand in it."""
        return tuple(name for part in self.parts for name in part.c)

    @property
    def expressions(self) -> tuple[Expr, ...]:
        """All of its expressions."""
        of_parts = (e for part in self.parts for e in (part.load, *part.c.values()))
        return (self.static, self.kinetic, *of_parts)

    def mapped(self, change: Callable[[Expr], Expr]) -> FrictionLaw:
        """The same with `change` done to every expression."""

        def moved(part: NormalPart) -> NormalPart:
            return NormalPart(change(part.load), {k: change(c) for k, c in part.c.items()})

        return replace(
            self,
            norms=tuple(tuple(map(moved, parts)) for parts in self.norms),
            static=change(self.static),
            kinetic=change(self.kinetic),
        )


def friction_law(f: Friction, table: dict[Expr, Expr]) -> FrictionLaw:
    """A friction in plain symbols, its normal force by components."""

    def part(component: Expr) -> NormalPart:
        component = sp.sympify(component).xreplace(table)
        symbols = reactions_in(component)
        return NormalPart(
            component.xreplace(dict.fromkeys(symbols, sp.S.Zero)),
            {read(str(s)).constraint: component.diff(s) for s in symbols},
        )

    norms = norms_of(f.normal)
    assert norms is not None  # checked with the model
    return FrictionLaw(
        name=f.name,
        of=tuple(f.of),
        norms=tuple(tuple(map(part, components)) for components in norms),
        static=sp.sympify(f.static).xreplace(table),
        kinetic=sp.sympify(f.sliding).xreplace(table),
        description=f.description,
    )
