"""How well what was fitted is known: standard errors, correlations, and what the data do not determine.

With the residuals' Jacobian J, in standard deviations, the covariance of the values is (J^T J)^-1 (Bard,
Nonlinear Parameter Estimation, 1974, sec. 7-5).  Its singular values say which combinations are determined.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from .problem import Problem

Floats = NDArray[np.float64]
LOOSE = 1.0  # relative uncertainty from which on a combination is not determined
SMALL = 0.05  # part in a combination that is not told
LEVEL = 0.95


@dataclass(frozen=True)
class Combination:
    """Relative changes of values that hardly change the residuals: all together by one part in 100 change
    them by `felt` standard deviations."""

    changes: dict[str, float]
    felt: float


@dataclass(frozen=True)
class Certainty:
    """Standard `errors` (free,), infinite where the data say nothing and NaN at a bound; `half` (free,): the
    half widths of the intervals of 95 %; `correlation` (free, free); `loose` combinations; `bounds`: -1 or 1
    of a value at its lower or upper one."""

    errors: Floats
    half: Floats
    correlation: Floats
    loose: tuple[Combination, ...]
    bounds: tuple[int, ...]


def certainty(
    problem: Problem,
    x: Floats,
    jacobian: Floats,
    active: Sequence[int],
    dof: int | None,
    noise: float,
) -> Certainty:
    """`jacobian` (points, free) in standard deviations, and the part of its largest singular value that is
    `noise`; `active`: see Certainty.bounds; `dof`: degrees of freedom from which the deviations are
    estimated, None where they are known."""
    inside = np.asarray(active) == 0
    scale = np.array([f.scale(v) for f, v in zip(problem.free, x, strict=True)])[inside]
    names = [f.name for f, free in zip(problem.free, inside, strict=True) if free]
    _, size, directions = np.linalg.svd(jacobian[:, inside] * scale, full_matrices=False)
    told = size > noise * (size[0] if len(size) else 0.0)
    loose = []
    for s, v in zip(size, directions, strict=True):
        if s * LOOSE < 1:
            v = v / v[np.argmax(np.abs(v))]
            changes = {n: float(c) for n, c in zip(names, v, strict=True) if abs(c) > SMALL}
            loose.append(Combination(changes, float(s) / 100 * float(np.linalg.norm(v))))
    part = directions[told] / size[told][:, None]
    covariance = part.T @ part
    blind = (np.abs(directions[~told]) > SMALL).any(axis=0)
    errors = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        inner = covariance / np.outer(errors, errors)
    errors = np.where(blind, np.inf, errors * scale)
    count = len(inside)
    all_errors, correlation = np.full(count, np.nan), np.full((count, count), np.nan)
    all_errors[inside] = errors
    correlation[np.ix_(inside, inside)] = inner
    quantile = stats.norm.ppf((1 + LEVEL) / 2) if dof is None else stats.t.ppf((1 + LEVEL) / 2, dof)
    return Certainty(
        all_errors, all_errors * quantile, correlation, tuple(loose), tuple(int(a) for a in active)
    )
