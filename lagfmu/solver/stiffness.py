"""Is the explicit method held back by stiffness, and does the implicit one pay?  The method `auto`.

Stages 12 and 13 of dop853 belong to one time.  With the differences of their arguments (dq, dv) and
of their rates (dv, da), and those of the solution over the step (Dq, Dv), (Dv, Da), weighted by the
coordinates' magnitudes alone (so that no unit of time enters), the fastest rate in the equations and
that of the motion are estimated as

    rho^2 = |da| / |dq|   (but at most  |da| / |dv|) ,   sigma^2 = |Da| / |Dq|

as J = [0 1; -omega^2 -d] gives |da| = omega^2 |dq| for an oscillation and |da| = d |dv| for damping.
A step is stiff if h rho > 6.1, beyond which dop853 is unstable (Hairer & Wanner II, sect. IV.2, eqs.
2.3 to 2.6), or if the motion is far slower than what shortens the step, sigma << rho: a tight
tolerance stops an explicit method before its stability does, by terms h^p (h rho)^k of its error.
An oscillation that has to be resolved is part of the motion: there rho = sigma.

After 15 stiff steps without 6 others in a row radau5 takes over.  Where its steps are not longer by
what they cost, dop853 comes back, and more stiff steps are asked for the next time; from time to time
it is tried again, since only its own steps show that the stiffness is gone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..numeric.system import Vector
from ..numeric.thresholds import (
    BOUND,
    SLOWER,
    STABLE,
    STIFF_BRIEF,
    STIFF_EVERY,
    STIFF_OTHER,
    STIFF_RETRY,
    STIFF_ROUNDING,
    STIFF_ROUNDING_FORCE,
    STIFF_STEPS,
)

PRICE = 1.5  # cost of a step of radau5 in steps of dop853
DEARER, MOST = (
    4,
    8,
)  # factor of the stiff steps asked for after radau5 did not pay; its power at most
LATEST = 20  # doublings of the steps of radau5 before dop853 is tried again, at most


@dataclass(frozen=True)
class Choice:
    """What the choice between dop853 and radau5 remembers.

    implicit: radau5 is at work; unseen: dop853's steps since one was judged; stiff, other: its stiff
    steps, and others in a row; longest [s]: the longest of the stiff ones; taken, span [s], short:
    radau5's steps, the time that they covered, and those in a row that did not pay; failures: how
    often in a row radau5 did not pay; retries: how often dop853 was tried again; time [s], product,
    ratio: when radau5 first took over, h rho and rho / sigma then (product 0: it never did; ratio 0:
    the motion's own rate was not known).
    """

    implicit: bool = False
    unseen: int = 0
    stiff: int = 0
    other: int = 0
    longest: float = 0.0
    taken: int = 0
    span: float = 0.0
    short: int = 0
    failures: int = 0
    retries: int = 0
    time: float = 0.0
    product: float = 0.0
    ratio: float = 0.0

    def message(self) -> str:
        """What there is to say when radau5 takes over for the first time."""
        slower = f", which is {self.ratio:.3g} times slower" if self.ratio else ""
        return (
            f"stiff at t = {self.time!r} s: dop853's steps are bound by the fastest rate rho in the "
            f"equations, h rho = {self.product:.3g}, and not by the motion{slower}: going on with "
            "radau5 (solver.method = radau5 saves the detection, dop853 forbids the change)"
        )


@dataclass(frozen=True)
class Slope:
    """Two states (2 n) and their rates of change (2 n)."""

    y0: Vector
    f0: Vector
    y1: Vector
    f1: Vector

    def rate(self, size: Vector) -> tuple[float, float]:
        """|Da| / |Dv| and sqrt(|Da| / |Dq|) [1/s]; 0 where rounding hides them."""
        n = len(size)

        def norm(y0: Vector, y1: Vector, rounding: float) -> float:
            change = np.abs(y1 - y0)
            seen = np.where(change > rounding * np.abs(y1), change, 0.0)
            return float(np.linalg.norm(seen / size))

        dq = norm(self.y0[:n], self.y1[:n], STIFF_ROUNDING)
        dv = norm(self.y0[n:], self.y1[n:], STIFF_ROUNDING)
        da = norm(self.f0[n:], self.f1[n:], STIFF_ROUNDING_FORCE)
        if not (dv > 0 and da > 0):
            return 0.0, 0.0
        return da / dv, math.sqrt(da / dq) if dq > 0 else math.inf


def is_due(choice: Choice) -> bool:
    """True if the next step of dop853 is to be judged."""
    return choice.stiff > 0 or choice.unseen + 1 >= STIFF_EVERY


def unjudged_step(choice: Choice) -> Choice:
    """The choice after a step of dop853 that was not due."""
    return replace(choice, unseen=choice.unseen + 1)


def explicit_step(
    choice: Choice, t: float, h: float, stages: Slope, step: Slope, size: Vector
) -> Choice:
    """The choice after a step of dop853 of length h [s] that ended at t [s]."""
    choice = replace(choice, unseen=0)
    rho, sigma = min(stages.rate(size)), step.rate(size)[1]
    slow = sigma > 0 and rho > SLOWER * PRICE * sigma
    if not (h * rho > STABLE or (h * rho > BOUND and slow)):
        other = choice.other + 1
        return replace(choice, other=other, stiff=0 if other >= STIFF_OTHER else choice.stiff)
    longest = max(h, choice.longest if choice.stiff else 0.0)
    choice = replace(choice, stiff=choice.stiff + 1, other=0, longest=longest)
    if choice.stiff < STIFF_STEPS * DEARER**choice.failures:
        return choice
    if not choice.product:
        choice = replace(choice, time=t, product=h * rho, ratio=rho / sigma if slow else 0.0)
    return replace(choice, implicit=True, taken=0, span=0.0, short=0)


def implicit_step(choice: Choice, h: float) -> Choice:
    """The choice after a step of radau5 of length h [s]."""
    enough = PRICE * choice.longest
    choice = replace(
        choice,
        taken=choice.taken + 1,
        span=choice.span + h,
        short=choice.short + 1 if h < enough else 0,
    )
    if choice.short >= STIFF_BRIEF:
        return replace(explicit(choice, choice.span >= enough * choice.taken), retries=0)
    if choice.taken >= STIFF_RETRY * 2**choice.retries:
        return replace(explicit(choice, paid=True), retries=min(choice.retries + 1, LATEST))
    return choice


def explicit(choice: Choice, paid: bool) -> Choice:
    """The choice when dop853 comes back: if radau5 did not pay, or failed, it has to wait longer."""
    failures = 0 if paid else min(choice.failures + 1, MOST)
    return replace(choice, implicit=False, stiff=0, other=0, failures=failures)
