"""unique.CONSTRAINT: whether lambda_k is the only one, told apart by the model's own G and M.

lambda_k is unique if and only if component k of every vector of null(G^T) vanishes, G of the rows that act
(Wojtyra 2005); the rows in units of  g M^-1 g^T = 1 , so that what is zero has a measure.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from stress_geometry import Collision, Geometry, geometry_of

from lagfmu.names import UNIQUE, name
from lagfmu.testing import Bench, Check, Facts, Finding, Probe, acts

FAMILY = "unique"
ZERO, SURE = 1e-12, 1e-5  # singular values in between say nothing
POINTS = 12


def probes(facts: Facts, quick: bool) -> list[Probe]:
    """One, where G is known and it is clear which rows act."""
    geometry = geometry_of(facts.path)
    if geometry is None or geometry.rough or set(geometry.names) != set(facts.constraints):
        return []
    return [Probe(FAMILY, "lambda of each constraint", lambda b: _told(geometry, b), False)]


def _told(geometry: Geometry, bench: Bench) -> Finding:
    run, checks = bench.ordinary, []
    acting = {c: acts(bench.facts, run, c) for c in geometry.names}
    for k in np.linspace(0, len(run.rows) - 1, POINTS).astype(int):
        here = {n: float(run.rows[n][k]) for n in run.rows.dtype.names or ()}
        rows = [i for i, c in enumerate(geometry.names) if acting[c][k]]
        right = _unique(geometry.at({**run.values, **here}), rows)
        if right is None:
            continue
        wrong = [
            geometry.names[i]
            for i, known in zip(rows, right, strict=True)
            if bool(run.rows[name(UNIQUE, geometry.names[i])][k]) != known
        ]
        checks.append(Check("unique" + "".join(f" {c}" for c in wrong), float(len(wrong)), 0.5))
    note = "" if checks else "G is too near to a change of rank to be sure"
    return Finding(tuple(checks) or (Check("unique", 0.0, 1.0),), None, note)


def _unique(now: Collision, rows: list[int]) -> list[bool] | None:
    """Of each of the rows; None where that is not sure."""
    if not rows:
        return []
    try:
        W: Any = np.linalg.solve(np.linalg.cholesky(now.M), now.G[rows].T)
    except np.linalg.LinAlgError:  # a coordinate without mass
        return None
    size = np.sqrt((W * W).sum(axis=0))
    _, values, V = np.linalg.svd(W / np.where(size > 0, size, 1.0), full_matrices=True)
    values = np.concatenate([values, np.zeros(len(V) - len(values))])
    weights = np.abs(V[values < ZERO]).max(axis=0, initial=0.0)
    if ((values >= ZERO) & (values < SURE)).any() or ((weights > ZERO) & (weights < SURE)).any():
        return None
    return [bool(w <= ZERO) for w in weights]
