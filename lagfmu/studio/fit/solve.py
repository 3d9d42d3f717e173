"""fit(): the values of parameters and starts with which an FMU explains what was measured."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from ...errors import SettingError, SimulationError
from ...fmu.inputs import warn_of_rates
from ...fmu.session import RefusalError, Session
from ...fmu.write import as_fmu
from ...model.model import Model
from ...model.scene import Scene
from ...numeric.tolerance import tolerance_problem
from ...prepare.starts import tell
from .certainty import certainty
from .experiment import experiments_of
from .problem import LOSSES, Problem, derivatives_of, problem_of
from .residuals import Residuals
from .result import Fit

Floats = NDArray[np.float64]
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
