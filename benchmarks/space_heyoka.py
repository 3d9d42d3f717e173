"""The mechanisms of space.py in heyoka, which compiles and integrates what is written out for it.

Written out are the equations in joint coordinates q of the tree, and the rows J q' = 0 of what closes a loop:
    M q'' = t - h + J^T l ,   J q'' = -J' q' ,
from places and rotations, which heyoka differentiates, solved by elimination.  Of rows that depend on others
at the start the first are taken; nothing corrects a drift.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from rigid import cross
from rods_elsewhere import Run
from space import Space
from system import G

Array = Any  # of heyoka's expressions, or of numbers


class Tree:
    """Where bodies are, and how they turn, in expressions of q and v = q'."""

    def __init__(self, problem: Space) -> None:
        import heyoka as hy

        n, self.problem, self.diff = len(problem.tree), problem, hy.diff
        self.q, self.v = (np.array([hy.expression(f"{x}{k}") for k in range(n)]) for x in "qv")
        self.zero = 0.0 * self.q[0]  # added to a number makes an expression of it
        self.turn: dict[str, Array] = {"ground": np.eye(3)}
        self.place: dict[str, Array] = {"ground": np.zeros(3)}
        self.spin: dict[str, Array] = {"ground": np.zeros((3, n), dtype=object)}  # by the rates
        for k, tie in enumerate(problem.tree):
            e, of, at = np.asarray(tie.axis), tie.second, self.at(tie.first, tie.point)
            self.turn[of], self.spin[of] = self.turn[tie.first], self.spin[tie.first].copy()
            if tie.kind == "hinge":
                K, angle = cross(e), self.q[k]
                self.spin[of][:, k] += self.turn[of] @ e
                self.turn[of] = self.turn[of] @ (
                    np.eye(3) + K * hy.sin(angle) + K @ K * (1.0 - hy.cos(angle))
                )
            else:
                at = at + self.turn[of] @ e * self.q[k]
            self.place[of] = at - self.turn[of] @ problem.linkage.arm(of, tie.point)

    def at(self, body: str, point: Any) -> Array:
        """A place of the start that moves with a body."""
        return self.place[body] + self.turn[body] @ self.problem.linkage.arm(body, point)

    def slope(self, x: Array) -> Array:
        """dx/dq (len(x), n)."""
        return np.array([[self.diff(self.zero + row, z) for z in self.q] for row in x])

    def bias(self, J: Array) -> Array:
        """J' q'."""
        return self.slope(J @ self.v) @ self.v

    def equations(self) -> tuple[Array, Array]:
        """M, and t - h: Newton's and Euler's equations along the coordinates."""
        linkage, n = self.problem.linkage, len(self.q)
        M, force = np.zeros((n, n)), np.zeros(n)
        for name, (mass, _) in linkage.bodies.items():
            J, S = self.slope(self.place[name]), self.spin[name]
            tensor, w = self.turn[name] @ mass.J @ self.turn[name].T, S @ self.v
            M = M + mass.m * J.T @ J + S.T @ tensor @ S
            force = force - mass.m * J.T @ (self.bias(J) + np.array([0.0, 0.0, G]))
            force = force - S.T @ (tensor @ self.bias(S) + np.cross(w, tensor @ w))
        for s in linkage.springs:
            d = self.at(s.second, s.other) - self.at(s.first, s.point)
            J, size = self.slope(d), (d @ d) ** 0.5
            pull = s.k * (size - s.length) + s.c * (d @ J @ self.v) / size
            force = force - J.T @ d * pull / size
        return M, force

    def rows(self) -> Array:
        """J: two points of each closing axis stay together."""
        found = [
            self.at(tie.second, point) - self.at(tie.first, point)
            for tie in self.problem.closing
            for point in (np.asarray(tie.point), np.add(tie.point, tie.axis))
        ]
        return self.slope([row for point in found for row in point]).reshape(-1, len(self.q))

    def felt(self, a: Array) -> Array:
        """Accelerations of the bodies' centres of mass, of q'' = a."""
        slopes = [self.slope(self.place[name]) for name in self.problem.linkage.bodies]
        return np.concatenate([J @ a + self.bias(J) for J in slopes])


def independent(J: Array) -> list[int]:
    """The first rows of a matrix that do not depend on those before."""
    kept: list[int] = []
    for k in range(len(J)):
        if np.linalg.matrix_rank(J[[*kept, k]], tol=1e-9) > len(kept):
            kept.append(k)
    return kept


def solved(rows: Array) -> list[Any]:
    """x of linear equations whose last column is the right-hand side, by elimination in the given order."""
    n, found = len(rows), np.zeros(len(rows), dtype=object)
    for k in range(n):
        for i in range(k + 1, n):
            rows[i, k:] = rows[i, k:] - rows[i, k] / rows[k, k] * rows[k, k:]
    for k in reversed(range(n)):
        found[k] = (rows[k, n] - rows[k, k + 1 : n] @ found[k + 1 :]) / rows[k, k]
    return found


def heyoka_tree(problem: Space, tolerance: float) -> Run:
    """Taylor's method on joint coordinates, in its compact mode (the other takes minutes to compile)."""
    import heyoka as hy

    tree = Tree(problem)
    n, state = len(tree.q), [*tree.q, *tree.v]
    (M, force), J = tree.equations(), tree.rows()
    if len(J):
        at_start = hy.cfunc(list(J.ravel()), list(tree.q))(np.zeros(n))
        J = J[independent(at_start.reshape(J.shape))]
    m = len(J)
    rows = np.full((n + m, n + m + 1), tree.zero)
    rows[:n] = np.hstack([M, J.T, force[:, None]]) + tree.zero
    if m:
        rows[n:] = np.hstack([J, np.zeros((m, m)), -tree.bias(J)[:, None]]) + tree.zero
    a = solved(rows)[:n]
    read = hy.cfunc(list(tree.felt(a)), state)
    y0 = np.array([*np.zeros(n), *problem.rates()])
    equations = [*zip(tree.q, tree.v, strict=True), *zip(tree.v, a, strict=True)]
    solver = hy.taylor_adaptive(equations, y0, tol=tolerance, compact_mode=True)

    def run() -> Any:
        solver.time = 0.0
        solver.state[:] = y0
        found = np.empty((len(problem.times), 2 * n))
        for row, t in zip(found, problem.times, strict=True):
            solver.propagate_until(t)
            row[:] = solver.state
        return problem.read(read(np.ascontiguousarray(found.T)).T)

    return run
