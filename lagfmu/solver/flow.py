"""The flow between two events, a stretch of time in which the contact modes do not change: the equations

    q' = v ,   v' = vdot(t, q, v)   with   M vdot = F + G^T lambda ,  G vdot = gamma

as an ordinary differential equation, and its projection onto f = 0 and G v = nu after each accepted step
(Hairer & Wanner II, sect. VII.2).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..numeric.failure import StepFailureError, plain
from ..numeric.system import Matrix, System, Vector
from ..numeric.thresholds import BALANCED, FAR, FEWEST_STEPS_RK4, HOPELESS, LEAST_FAR
from .instant import Instant, Motion
from .magnitudes import shared
from .methods import share, stepper
from .motion import distance, independent, motion, project
from .state import NO_LOCAL, Local, Settings, State
from .stiffness import Choice
from .straight import solver_of

SHIFT = 2.0**-26  # of a size, for a difference quotient: half of a double's digits
AfterStep = Callable[[Any, State, Local], Local]


@dataclass
class Flow:
    """From one event to the next; `begun` [s]: the communication step began, from which inputs run on;
    `after_step`: see advance()."""

    system: System
    settings: Settings
    state: State
    u: Sequence[float]
    p: Sequence[float]
    begun: float
    after_step: AfterStep | None = None

    def __post_init__(self) -> None:
        self.rows = self.system.active(self.state.closed)
        self.take(self.rows)
        self.dependent = False
        self.held = [*self.u, *self.state.levels]
        self.offset = np.array(self.state.offset)
        self.scale = np.array(self.state.scale)
        self.size = np.array(self.state.size)
        self.cause = ""
        self.local = NO_LOCAL
        self.auto = self.settings.method == "auto"
        if self.auto:
            self.choose(self.state.choice)

    def take(self, basis: list[int]) -> None:
        """The rows of a step's stages, which lie off the constraints: those independent on them."""
        self.basis = basis
        self.written = None if self.system.frictions else solver_of(self.system, basis)

    def choose(self, choice: Choice) -> None:
        """The method of `auto` for the steps to come."""
        method = "radau5" if choice.implicit else "dop853"
        self.settings = replace(self.settings, method=method)

    def inputs_at(self, t: float) -> list[float]:
        """What drives the equations at t: inputs and the levels of jumps."""
        if not self.system.prescribed:
            return self.held
        return [*self.system.inputs_at(self.u, t - self.begun), *self.state.levels]

    def at(self, t: float) -> Instant:
        return Instant(self.system, t, self.inputs_at(t), self.p, self.state.slides)

    def split(self, y: Vector) -> tuple[Vector, Vector]:
        return y[: self.system.n], y[self.system.n :]

    def rate(self, t: float, y: Vector) -> Vector:
        """y' (2 n); not a number where the equations cannot be evaluated: the step is cut there."""
        found = self._rate_as_written(t, y)
        if found is not None:
            return found
        q, v = self.split(y)
        try:
            now = (
                self.near(t, q, v)
                if self.system.frictions
                else motion(self.at(t), q, v, self.basis)
            )
        except StepFailureError as error:
            self.cause = str(error)
            return np.full_like(y, np.nan)
        return np.concatenate([v, now.vdot])

    def _rate_as_written(self, t: float, y: Vector) -> Vector | None:
        """The same by straight.py; None where that does not answer."""
        if self.written is None or self.system.dynamics is None:
            return None
        values = y.tolist()
        q, v = values[: self.system.n], values[self.system.n :]
        try:
            M, F, G, _, gamma = self.system.dynamics(t, q, v, self.inputs_at(t), self.p)
            found = self.written(M, F, G, gamma)
        except (ArithmeticError, ValueError):
            return None
        return None if found is None else np.array(v + found[0])

    def accept(self, t: float, y: Vector) -> Vector:
        """y' (2 n) at a state on the constraints, where a step begins: by all rows, of which those that
        depend on others are then left out in its stages."""
        if len(self.rows) < 2 and not self.system.frictions:
            return self.rate(t, y)
        if self.written is not None:
            self.take(self.rows)
            found = self._rate_as_written(t, y)
            if found is not None:
                self.dependent = False
                return found
        q, v = self.split(y)
        try:
            now = motion(self.at(t), q, v, self.rows)
        except StepFailureError as error:
            self.cause = str(error)
            return np.full_like(y, np.nan)
        self.dependent = not now.unique.all()
        if not self.system.frictions:  # these need all rows: which of them press?
            self.take(independent(now, self.rows))
        return np.concatenate([v, now.vdot])

    def is_dependent(self) -> bool:
        """True if rows depended on each other at the latest state on the constraints."""
        return self.dependent

    def near(self, t: float, q: Vector, v: Vector) -> Motion:
        """Accelerations and all multipliers at a state that may lie off the constraints."""
        at = self.at(t)
        off = 0.0
        if self.is_dependent():
            G = at.evaluate(q, v)[2]
            off = distance(at, q, G, self.rows, self.offset, self.size)
        return motion(at, q, v, self.rows, off)

    def jacobian(self, t: float, y: Vector) -> Matrix:
        """d(y')/dy (2 n, 2 n) by differences over a part of each coordinate's size and natural speed."""
        n, f = self.system.n, self.rate(t, y)
        natural = np.concatenate([self.size, self.size * self.state.rate])
        found = np.zeros((2 * n, 2 * n))
        found[:n, n:] = np.eye(n)
        for j in np.flatnonzero(np.maximum(np.abs(y), natural)):
            moved = y.copy()
            moved[j] += SHIFT * max(abs(y[j]), natural[j])
            found[n:, j] = ((self.rate(t, moved) - f) / (moved[j] - y[j]))[n:]
        return found

    def project(self, t: float, y: Vector) -> Vector:
        q, v = self.split(y)
        return np.concatenate(
            project(self.at(t), q, v, self.rows, self.offset, self.size, self.is_dependent())
        )

    def check_projection(self, t0: float, t: float, y: Vector, projected: Vector) -> None:
        """Raises StepFailureError if the projection after an adaptive step from t0 to t moved the state by
        far more than its error can be: next to a singular configuration it leads to another branch."""
        far = max(FAR * self.settings.tolerance, LEAST_FAR)
        size = np.concatenate([self.size, self.size * self.state.rate])
        unit = np.maximum.reduce([np.abs(y), size, shared(self.system, self.scale, y)])
        moved = np.abs(projected - y)
        if self.settings.method == "rk4" or (moved <= far * unit).all():
            return
        M, F, *_ = self.at(t).evaluate(*self.split(y))
        mass, h = M.diagonal(), t - t0
        speed = BALANCED * h * np.abs(F) / np.where(mass > 0, mass, np.inf)
        if (moved <= np.maximum(far * unit, np.concatenate([speed * h, speed]))).all():
            return  # rounding of forces that others balance
        j = int((moved / unit).argmax())
        raise StepFailureError(
            f"the integration stops at t = {float(t)!r} s, the projection onto the constraints moves "
            f"{self.system.coordinates[j % self.system.n]} by {float(projected[j] - y[j]):.3g}: "
            "the configuration is singular, or nearly so"
        )

    def stepper(self, t: float, y: Vector, t_bound: float, first_step: float | None) -> Any:
        if self.settings.method == "rk4" and not self.settings.step:
            first_step = 1 / (FEWEST_STEPS_RK4 * self.state.rate)
        elif self.settings.method == "rk4":
            first_step = self.settings.step
        slope, scale = (self.rate, self.jacobian), shared(self.system, self.scale, y)
        return stepper(self.settings, slope, t, y, t_bound, scale, first_step)

    def step(self, solver: Any) -> None:
        """One accepted step, or the reason why there is none."""
        share(solver, self.settings, shared(self.system, self.scale, solver.y))
        try:
            message = solver.step()
        except (ArithmeticError, ValueError, np.linalg.LinAlgError) as error:
            raise self.failure(solver.t, plain(error)) from error
        if solver.status == "failed" or not np.isfinite(solver.y).all():
            raise self.failure(solver.t, message or "the state is not finite")
        if self.settings.method == "rk4":
            speed = self.size * self.state.rate
            unit = np.maximum(np.abs(solver.y), np.concatenate([self.size, speed]))
            if not (np.abs(solver.error) <= HOPELESS * unit).all():
                raise self.failure(
                    solver.t,
                    f"rk4's step of {solver.h_abs:.3g} s is far too large: reduce solver.step",
                )

    def failure(self, t: float, message: str) -> StepFailureError:
        if "step size" in message:
            message = "step size underflow"
        cause = f": {self.cause}" if self.cause else ""
        return StepFailureError(f"the integration stops at t = {float(t)!r} s, {message}{cause}")

    def reach(self, t: float, y: Vector, t1: float) -> Vector:
        """The state at t1, integrated from (t, y) and projected; the way goes on counting in `local`."""
        if t1 <= t:
            return y
        solver = self.stepper(t, y, t1, t1 - t)
        while solver.status == "running":
            self.step(solver)
            if self.after_step is not None:
                self.local = self.after_step(solver, self.state, self.local)
        return self.project(t1, solver.y)
