"""fit(): the values of parameters and starts with which an FMU explains what was measured."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from ... import names
from ...errors import SettingError, SimulationError
from ...fmu.read import columns_at, communication_points, jumps, warn_of_rates
from ...fmu.session import RefusalError, Session
from ...fmu.write import as_fmu
from ...model.model import Model
from ...model.scene import Scene
from ...numeric.thresholds import tolerance_problem
from ...prepare.starts import tell
from .problem import LOSSES, Problem, Series, derivatives_of, experiments_of, problem_of
from .result import Fit, certainty

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


TOLERANCE = 1e-9  # of the runs: their noise limits the differences
ROUNDS = 10  # of estimating standard deviations
SETTLED = 1e-3  # relative change of them that ends it
EVALUATIONS = 100  # of a search
HOLD = (
    1e-4  # standard deviations by which a change of 100 % is felt besides: what no data move stays
)
OF_NORMAL = 1.4826  # standard deviations in a median of magnitudes


def fit(
    source: str | os.PathLike[str] | Model,
    measured: Any,
    free: Mapping[str, Any] | Sequence[str],
    measure: Mapping[str, float | None] | Sequence[str] = (),
    *,
    start_values: Mapping[str, Any] | None = None,
    offset: float = 0.0,
    loss: str = "linear",
    tolerance: float = TOLERANCE,
    step_size: float | None = None,
    scene: Scene | str | None = None,
) -> Fit:
    """Find the values of `free` with which an FMU (or a model, or a model file) is nearest to what was
    `measured`: least squares of (FMU - measured)/deviation, by SciPy's trust region.

    `measured`: one table over time or several (experiment.Experiment).  `free` maps names of parameters
    and start values to None, (low, high) or (low, high, start), in SI units.  `measure` maps outputs to
    standard deviations, None where one is unknown: then it is estimated from the residuals of that output.
    Without it every column that is an output counts.

    `offset` [s]: the clock of each experiment may be wrong by up to that much, and is set right.  `loss`
    ('soft_l1', 'huber', 'cauchy', 'arctan') gives outliers less weight; residuals count in standard
    deviations.
    `step_size` [s]: pieces in which inputs are handed over.

    Derivatives are the FMU's own where it has them (`sensitivity.*`; a model whose outputs are named in
    `measure` is built with them), else central differences of runs at the relative `tolerance`, with a step
    of its third root.
    Raises SettingError with all that is wrong with what was given, SimulationError for a first run that
    fails.
    """
    if loss not in LOSSES:
        raise SettingError(f"loss {loss!r}, expected one of {', '.join(LOSSES)}")
    if problem := tolerance_problem(tolerance):
        raise SettingError(problem)
    sought = free if isinstance(free, Mapping) else dict.fromkeys(free)
    wanted = measure if isinstance(measure, Mapping) else dict.fromkeys(measure)
    told = derivatives_of(sought, wanted)
    with as_fmu(source, scene, sensitivities=told) as path, Session(path) as session:
        given = dict(start_values or {})
        asked = problem_of(
            session.description.modelVariables,
            session.rules,
            experiments_of(measured),
            sought,
            wanted,
            given,
            offset,
        )
        step = step_size or session.experiment.step_size
        for one in asked.series:
            warn_of_rates(one.inputs, session.rules)
        residuals = Residuals(asked, session, tolerance, step, given)
        found = _solve(session.description.modelName, asked, residuals, loss)
        tell(residuals.moved)
        return found


def _solve(name: str, problem: Problem, residuals: Residuals, loss: str) -> Fit:
    x = np.array([f.start for f in problem.free])
    try:
        residuals.at(x)
    except RefusalError as error:
        values = ", ".join(f"{f.name} = {f.start!r}" for f in problem.free)
        raise SimulationError(f"the first run ({values}) fails: {error.message}") from None
    deviations = _first(problem, residuals)
    for _ in range(ROUNDS):
        found = _least_squares(problem, residuals, deviations, x, loss)
        x, before = found.x, deviations
        deviations = _estimated(problem, residuals, residuals.at(x), before, loss)
        settled = all(abs(deviations[n] / before[n] - 1) <= SETTLED for n in before)
        if settled or found.status <= 0:
            break
    known = all(d is not None for d in problem.deviations.values())
    dof = problem.points - len(x)
    return Fit(
        name=name,
        problem=problem,
        x=x,
        certainty=certainty(
            problem,
            x,
            found.jac[: problem.points],
            found.active_mask,
            None if known else dof,
            residuals.noise,
        ),
        deviations=before,
        predicted=residuals.at(x),
        measured=residuals.measured,
        of=residuals.of,
        converged=found.status > 0,
        cost=float(found.cost),
        runs=residuals.runs,
        difference=residuals.difference,
        own=frozenset(residuals.own),
        ended=residuals.ended,
    )


def _least_squares(
    problem: Problem, residuals: Residuals, deviations: Mapping[str, float], x: Floats, loss: str
) -> Any:
    weights = 1 / np.array([deviations[n] for n in residuals.of])
    start = np.array([f.start for f in problem.free])
    scale = np.array([f.scale(v) for f, v in zip(problem.free, start, strict=True)])

    def misfit(values: Floats) -> Floats:
        try:
            off = (residuals.at(values) - residuals.measured) * weights
        except RefusalError:
            return np.full(len(weights) + len(start), np.inf)  # the trust region shrinks
        return np.concatenate([off, HOLD * (values - start) / scale])

    def jacobian(values: Floats) -> Floats:
        return np.vstack([residuals.jacobian(values, weights), np.diag(HOLD / scale)])

    return optimize.least_squares(
        misfit,
        x,
        jacobian,
        bounds=([f.low for f in problem.free], [f.high for f in problem.free]),
        x_scale=scale,
        loss=loss,
        ftol=1e-12,
        xtol=max(residuals.tolerance, 1e-12),
        gtol=1e-12,
        max_nfev=EVALUATIONS,
    )


def _first(problem: Problem, residuals: Residuals) -> dict[str, float]:
    """Where no deviation is known: that of the measured numbers themselves."""
    found = {}
    for name, known in problem.deviations.items():
        numbers = residuals.measured[residuals.of == name]
        found[name] = known or float(numbers.std()) or float(np.abs(numbers).max()) or 1.0
    return found


def _estimated(
    problem: Problem,
    residuals: Residuals,
    predicted: Floats,
    before: Mapping[str, float],
    loss: str,
) -> dict[str, float]:
    """Unknown deviations by the residuals of their outputs, each with its part of the degrees of freedom; not
    below the accuracy of a run."""
    found = {}
    share = max(problem.points - len(problem.free), 1) / problem.points
    for name, known in problem.deviations.items():
        own = residuals.of == name
        off = np.abs(predicted[own] - residuals.measured[own])
        least = residuals.tolerance * float(np.abs(residuals.measured[own]).max())
        middle = OF_NORMAL * float(np.median(off))
        spread = float(np.sqrt(np.mean(off**2) / share)) if loss == "linear" else middle
        found[name] = known or max(spread, least) or before[name]
    return found
