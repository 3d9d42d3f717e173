"""Newton's and Euler's laws of the bodies of a mechanism, in what its FMU tells.

    m r'' = sum F ,   J w' + w x J w = sum (T + (p - r) x F)

What acts is written down as it acts, part by part, from the wrenches, pulls and multipliers that the FMU
tells: nothing of it is what the equations of motion were made from.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from .elements import Expr

GROUND = -1  # instead of the number of a body


@dataclass(frozen=True)
class Where:
    """A marker: the number of its body, its `arm` from the centre of mass [m], and its `axes`, three columns
    one behind the other, all in the body's frame."""

    body: int
    arm: Sequence[Expr]
    axes: Sequence[Expr]


@dataclass(frozen=True)
class Act:
    """A force [N] and a torque [N.m] on the body of `on`, at its point, in the axes of `along`; the opposite
    is at the same point on the body `against`.

    `line`: the first component of the force is a pull from `on` towards the point of `along`.  `size`: of the
    terms that the force, or else the torque, was summed from.
    """

    on: Where
    along: Where
    against: int
    line: bool
    force: Sequence[Expr]
    torque: Sequence[Expr]
    size: Expr = 0

    @property
    def bodies(self) -> set[int]:
        """Those on which it acts."""
        return {self.on.body, self.against}

    @property
    def expressions(self) -> Iterator[Expr]:
        """All of them."""
        for where in (self.on, self.along):
            yield from (*where.arm, *where.axes)
        yield from (*self.force, *self.torque, self.size)


@dataclass(frozen=True)
class Laws:
    """Of the bodies `names`, with masses [kg] and inertias [kg.m^2] (one, or xx, yy, zz, xy, xz, yz), in a
    field of gravity [m/s^2]; `jumps`: where one of them is 0 a load jumps; `unknowns`: speeds and rows."""

    planar: bool
    unknowns: int
    names: Sequence[str]
    masses: Sequence[Expr]
    inertias: Sequence[Sequence[Expr]]
    gravity: Sequence[Expr]
    acts: Sequence[Act]
    jumps: Sequence[Expr] = ()

    @property
    def expressions(self) -> Iterator[Expr]:
        """All of them."""
        yield from (*self.masses, *(J for row in self.inertias for J in row))
        yield from (*self.gravity, *self.jumps)
        for act in self.acts:
            yield from act.expressions
