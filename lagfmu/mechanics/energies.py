"""The energies of a model, as far as it has them."""

from __future__ import annotations

import sympy as sp

from ..model.elements import Expr
from ..model.model import Model


def energies(
    model: Model,
    energy: Expr,
    M: dict[tuple[int, int], Expr],
    v: tuple[Expr, ...],
    table: dict[Expr, Expr],
) -> tuple[Expr, Expr | None]:
    """v^T M v / 2, and minus the part of L without velocities (or the forces' potential)."""
    kinetic = sp.Add(*(m * v[i] * v[j] / 2 for (i, j), m in sorted(M.items())))
    standing = -energy.xreplace(dict.fromkeys(v, sp.S.Zero))
    if model.lagrangian is not None:
        return kinetic, standing
    return kinetic, _potential(model, standing, table)


def _potential(model: Model, standing: Expr, table: dict[Expr, Expr]) -> Expr | None:
    """V of the forces that depend on q alone, where they are a gradient of polynomials and sines.

    Each force is split into the terms that hold coordinates and parameters only, and the rest.
    None if the first have a curl, or act on speeds: then there is no potential energy to report.
    """
    if model.forces.keys() & model.speeds.keys():
        return None
    q = tuple(table[c] for c in model.coordinates)
    allowed = set(q) | {p.symbol for p in model.parameters}
    forces = []
    for coordinate in model.coordinates:
        force = sp.expand(sp.sympify(model.forces.get(coordinate, 0)).xreplace(table))
        forces.append(sp.Add(*(a for a in sp.Add.make_args(force) if a.free_symbols <= allowed)))
    if any(
        sp.simplify(forces[i].diff(q[j]) - forces[j].diff(q[i])) != 0
        for i in range(len(q))
        for j in range(i)
    ):
        return None
    V = sp.S.Zero
    for force, s in zip(forces, q, strict=True):
        rest = sp.expand(force + V.diff(s))
        integral = sp.integrate(rest, s)
        if integral.has(sp.Integral):
            return None
        V -= integral
    if any(sp.simplify(f + V.diff(s)) != 0 for f, s in zip(forces, q, strict=True)):
        return None
    return V + standing
