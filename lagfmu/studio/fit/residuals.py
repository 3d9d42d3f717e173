"""How far runs are from what was measured, and how that changes with what is free."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ... import names
from ...errors import SimulationError
from ...fmu.inputs import columns_at, jumps
from ...fmu.read import communication_points
from ...fmu.session import RefusalError, Session
from .experiment import Series
from .problem import Problem

Floats = NDArray[np.float64]


class Residuals:
    """Runs of one FMU: of values x of what is free, the numbers that were measured as the FMU has them.

    `given`: what is set besides; `step` [s]: of inputs, which an FMU gets as straight pieces; `difference`:
    the part of its magnitude by which a free value is changed to find derivatives (central differences);
    `runs`: how many there were; `moved`: start values that the latest moved, as the FMU says it; `ended`: in
    one of them the FMU's own derivatives did not exist throughout.
    """

    def __init__(
        self,
        problem: Problem,
        session: Session,
        tolerance: float,
        step: float,
        given: Mapping[str, Any],
    ) -> None:
        self.problem, self.session, self.given = problem, session, given
        self.tolerance, self.step = tolerance, step
        self.difference = tolerance ** (1 / 3)
        self.runs = 0
        self.moved: tuple[str, ...] = ()
        self.own: set[str] = set()
        self.ended = False
        self.measured = np.concatenate(
            [c[np.isfinite(c)] for s in problem.series for c in s.measured.values()]
        )
        self.of = np.concatenate(  # the name of the output of each number
            [[n] * int(np.isfinite(c).sum()) for s in problem.series for n, c in s.measured.items()]
        )

    def at(self, x: Sequence[float] | Floats) -> Floats:
        """The numbers (points,) of the FMU.  Raises RefusalError where a run ends early."""
        found = []
        for one in self.problem.series:
            rows = self._run(one, x)
            found += [rows[n][np.isfinite(c)].astype(float) for n, c in one.measured.items()]
        return np.concatenate(found)

    def jacobian(self, x: Floats, weights: Floats) -> Floats:
        """The derivatives (points, free), times `weights`: the FMU's own where it has them, else central
        differences, one-sided at a bound or beside a run that ends early.  What these do not tell from 0 is
        0, so that a search leaves it alone.  Raises SimulationError where there is a run on neither side."""
        told = self._told(x)
        columns = [
            told[f.name] if f.name in told else self._difference(x, k)
            for k, f in enumerate(self.problem.free)
        ]
        found = np.column_stack(columns) * weights[:, None]
        scale = np.array([f.scale(v) for f, v in zip(self.problem.free, x, strict=True)])
        left, size, right = np.linalg.svd(found * scale, full_matrices=False)
        scatter = self.tolerance / (1.0 if self.own else self.difference)
        least = max(self.noise * size[0], scatter * np.linalg.norm(self.measured * weights))
        size[size < least] = 0.0
        kept = (left * size) @ right
        kept[:, np.linalg.norm(kept, axis=0) < least] = 0.0
        return np.asarray(kept / scale)

    def _told(self, x: Floats) -> dict[str, Floats]:
        """The derivatives (points,) by those values by which the FMU tells them of all that was measured,
        and as long as it does."""
        rules, outputs = self.session.rules, self.problem.deviations
        free = [f.name for f in self.problem.free if not f.of]
        free = [p for p in free if all(_derivative(o, p) in rules for o in outputs)]
        if not free:
            return {}
        found: dict[str, list[Floats]] = {p: [] for p in free}
        for one in self.problem.series:
            more = [_derivative(o, p) for p in free for o in one.measured]
            rows = self._run(one, x, [*more, names.SENSITIVITY_VALID])
            if not rows[names.SENSITIVITY_VALID].all():
                self.ended = True
                return {}
            for p in free:
                for o, c in one.measured.items():
                    found[p].append(rows[_derivative(o, p)][np.isfinite(c)])
        self.own |= set(free)
        return {p: np.concatenate(parts) for p, parts in found.items()}

    def _difference(self, x: Floats, k: int) -> Floats:
        """The derivatives (points,) by free value k."""
        f = self.problem.free[k]
        h = self.difference * max(abs(x[k]), 1e-3 * f.scale(x[k]))
        sides = []
        for value in (max(x[k] - h, f.low), min(x[k] + h, f.high)):
            moved = np.array(x)
            moved[k] = value
            try:
                sides.append((value, self.at(moved)))
            except RefusalError as error:
                refusal = error
        if len(sides) == 1:
            sides.append((x[k], self.at(x)))
        if len(sides) < 2 or sides[0][0] == sides[1][0]:
            raise SimulationError(
                f"the run at {f.name} = {x[k]!r} has no neighbours: {refusal.message}"
            )
        return np.asarray((sides[1][1] - sides[0][1]) / (sides[1][0] - sides[0][0]))

    @property
    def noise(self) -> float:
        """The part of the largest singular value of a Jacobian that differences do not tell from 0."""
        return float(10 * self.difference**2)

    def _run(self, one: Series, x: Sequence[float] | Floats, more: Sequence[str] = ()) -> Any:
        """The rows at the times of one experiment."""
        own = dict(zip(self.problem.free, x, strict=True))
        values = dict(self.given) | dict(one.values)
        values |= {f.name: float(v) for f, v in own.items() if not f.of}
        shift = sum(float(v) for f, v in own.items() if f.of == one.name)
        clock = np.unique(
            np.concatenate([[shift], one.time])
        )  # the table's, in which its jumps are exact
        drive: Mapping[str, Sequence[float]] = {}
        if one.inputs is not None:
            points = shift + communication_points(float(clock[-1] - shift), self.step)
            clock = np.union1d(clock, points[points < clock[-1]])
            clock = np.union1d(clock, jumps(one.inputs, clock))
            drive = columns_at(one.inputs, clock, self.session.rules)
        times = clock - shift
        if len(times) == 1:
            times = np.array([0.0, self.step])
        self.runs += 1
        run = self.session.run(
            times.tolist(), values, self.tolerance, [*one.measured, *more], drive, late=True
        )
        if run.refusal is not None:
            raise run.refusal
        self.moved = run.moved
        return run.rows[np.searchsorted(clock, one.time)]


def _derivative(output: str, by: str) -> str:
    return names.name(names.SENSITIVITY, by, output)
