"""A system at one time, with its inputs and parameters: the equations as functions of the motion alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .failure import evaluated
from .system import Sparse, System, Vector


@dataclass(frozen=True)
class Instant:
    """`system` at time t [s] under u, the inputs with the switch states behind them, and the parameters p."""

    system: System
    t: float
    u: Sequence[float]
    p: Sequence[float]

    def equations(self, q: Vector, v: Vector) -> tuple[Sparse, Vector, Sparse, Vector, Vector]:
        """M (nv, nv), F (nv), G (m, nv), nu (m), gamma (m).  Raises StepFailureError where they have no
        value."""
        found: tuple[Sparse, Vector, Sparse, Vector, Vector] = evaluated(
            "the equations", self.t, self.system.assemble_sparse, self.t, q, v, self.u, self.p
        )
        return found

    def residual(self, q: Vector) -> Vector:
        """f (m): how far each position constraint is missed; 0 for nonholonomic rows.  Raises likewise."""
        assert self.system.residual is not None
        arguments = self.t, q.tolist(), self.u, self.p
        f = evaluated("the constraints", self.t, self.system.residual, *arguments)
        return np.array(f, dtype=float)

    def terms(self, q: Vector) -> Vector:
        """(m): the largest magnitude among the terms of each f, of which f is rounding; 0 without f."""
        if self.system.terms is None:
            return np.zeros(self.system.m)
        arguments = self.t, q.tolist(), self.u, self.p
        found = np.array(
            evaluated("the constraints", self.t, self.system.terms, *arguments), dtype=float
        )
        return np.where(np.isfinite(found), found, 0.0)

    def moved(self, q: Vector, w: Vector) -> Vector:
        """q (nq) after a displacement w (nv) in speeds.  Raises likewise."""
        arguments = self.t, q, w, self.u, self.p
        found: Vector = evaluated("the kinematics", self.t, self.system.moved, *arguments)
        return found


def at_start(
    system: System, q: Vector, u: Sequence[float], p: Sequence[float], t: float = 0.0
) -> Instant:
    """The instant t [s] at which the inputs u are set, with the switch states that belong to q."""
    inputs = system.inputs_at(u, 0.0)
    return Instant(system, t, [*inputs, *switch_states(system, t, q, inputs, p)], p)


def switch_states(
    system: System, t: float, q: Vector, u: Sequence[float], p: Sequence[float]
) -> tuple[float, ...]:
    """On which side of its surface h(t, q, u, p) each force that jumps there is evaluated, by h alone: its
    sign, or, where it jumps wherever h is a whole number, n + 1/2 for n <= h < n + 1."""
    if system.surfaces is None:
        return ()
    padded = [*u, *(0.0,) * (system.driven - len(u))]
    values = system.surfaces(t, q.tolist(), padded, p)
    return tuple(_side(h, whole) for h, whole in zip(values, system.switches, strict=True))


def _side(h: float, whole: bool) -> float:
    if whole:
        return math.floor(h) + 0.5 if math.isfinite(h) else h
    return float(np.sign(h))


def expanded(at: Instant, s: Vector, sdot: Vector) -> tuple[Instant, Vector, Vector]:
    """The instant of the full system, with its q (n) and v (n), from the coordinates that are stepped."""
    embedding = at.system.embedding
    if embedding is None:
        return at, s, sdot
    q, v = embedding.embed(at.t, s.tolist(), sdot.tolist(), at.u, at.p)
    full = Instant(embedding.full, at.t, at.u, at.p)
    return full, np.array(q, dtype=float), np.array(v, dtype=float)
