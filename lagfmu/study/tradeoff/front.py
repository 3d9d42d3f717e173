"""The Pareto front of a set of measurements: what no other setting beats in both error and cost."""

from __future__ import annotations

from collections.abc import Sequence


def front(points: Sequence[tuple[float, float]]) -> list[int]:
    """Indices of the (error, cost) pairs that no other pair dominates, cheapest first.

    A pair is dominated by another that is no worse in both and better in one; of equal pairs the
    first stands.  Pairs that are not finite never stand.
    """
    order = sorted(
        (k for k, (e, c) in enumerate(points) if e < float("inf") and c < float("inf")),
        key=lambda k: (points[k][1], points[k][0], k),
    )
    chosen: list[int] = []
    best = float("inf")
    for k in order:
        if points[k][0] < best:
            chosen.append(k)
            best = points[k][0]
    return chosen
