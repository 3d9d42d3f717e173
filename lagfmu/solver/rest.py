"""Frictions at rest: which of them stick, and which begin to slip in which direction.

At s = 0 a friction sticks if the sticking solution lies within its cone, |lambda_t| <= mu_s N.  If not, it
slips in the direction in which it begins to move under the force of that very slip: s/|s| = s'/|s'| with
s' = G_t vdot - gamma_t of the equations of sliding.  For one row that is a choice of two; for two rows a
root on the circle, the one nearest to "against lambda_t".  All frictions that stand at s = 0 are settled
together: the worst slips first; where that goes wrong, every combination is tried, most sticking first
(Pfeiffer & Glocker 1996, chs. 5 and 6).
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..numeric.failure import StepFailureError
from ..numeric.system import Vector
from ..numeric.thresholds import (
    FRICTION_ANGLES,
    FRICTION_BACK,
    FRICTION_MOST,
    FRICTION_ROUNDS,
    FRICTION_SLACK,
)
from .instant import Instant, Motion
from .motion import motion
from .painleve import paradox
from .state import Slide


class Now:
    """Motions at one state in trial modes."""

    def __init__(self, at: Instant, q: Vector, v: Vector, active: Sequence[int]) -> None:
        self.at, self.q, self.v, self.active = at, q, v, active

    def motion(self, slides: Sequence[Slide]) -> Motion:
        return motion(replace(self.at, slides=tuple(slides)), self.q, self.v, self.active)


def signed(now: Now, slides: list[Slide]) -> tuple[Slide, ...]:
    """The slides with the signs of their normal forces.  Raises StepFailureError where neither fits."""
    for _ in range(len(slides) + 1):
        found = now.motion(slides)
        wrong = _pulling(now, found, slides)
        if not wrong:
            return tuple(slides)
        for i in wrong:
            slides[i] = replace(slides[i], sign=-slides[i].sign)
    raise paradox(now.at, wrong, -1.0)


def _pulling(now: Now, found: Motion, slides: Sequence[Slide]) -> list[int]:
    """Frictions that slip with a negative normal force which no contact could give up."""
    frictions = now.at.system.frictions
    return [
        i
        for i, slide in enumerate(slides)
        if not slide.sticks
        and not frictions[i].gated
        and found.press.normal[i] < -FRICTION_SLACK * abs(found.lam).max(initial=0.0)
    ]


class Rest:
    """The frictions `resting` at s = 0, settled together; the others slip as in `slides`."""

    def __init__(
        self, now: Now, resting: list[int], slides: list[Slide], begins: Collection[int]
    ) -> None:
        self.now, self.resting = now, resting
        self.slides, self.begins = slides, set(begins)
        self.rows = [list(f.rows) for f in now.at.system.frictions]

    def settled(self) -> tuple[Slide, ...]:
        stuck = self._with(self.resting, {})
        try:
            held = self.now.motion(stuck)
        except StepFailureError:  # what drives the bodies accelerates some of them
            ahead = {i: self.slides[i].direction for i in self.resting}
            driven = self._within_cones(ahead)
            if driven is None:
                raise
            return driven
        against = {i: self._against(held, i) for i in self.resting}
        sticking = [i for i in self.resting if i not in self.begins]
        if self.begins:  # beyond its cone it slips against lambda_t, or not at all
            signed(self.now, self._with(sticking, against))
        while True:  # the worst slips first
            found = self._trial(sticking, against)
            if found is None:
                break
            slides, now = found
            over = [i for i in sticking if now.press.reserve[i] < -FRICTION_SLACK]
            if not over:
                return slides
            worst = min(over, key=lambda i: now.press.reserve[i])
            against[worst] = self._against(now, worst)
            sticking = [i for i in sticking if i != worst]
        settled = self._within_cones(against)
        if settled is None:
            raise paradox(self.now.at, self.resting, 0.0)
        return settled

    def _within_cones(self, guess: dict[int, tuple[float, float]]) -> tuple[Slide, ...] | None:
        """The combination with most sticking in which all that stick are within their cones."""
        for slides, now in self._all(guess):
            if all(
                now.press.reserve[i] >= -FRICTION_SLACK for i in self.resting if slides[i].sticks
            ):
                return slides
        return None

    def _with(
        self, sticking: Collection[int], towards: dict[int, tuple[float, float]]
    ) -> list[Slide]:
        slides = list(self.slides)
        for i in self.resting:
            slides[i] = replace(slides[i], sticks=i in sticking)
            if i in towards and i not in sticking:
                slides[i] = replace(slides[i], direction=towards[i])
        return slides

    def _against(self, held: Motion, i: int) -> tuple[float, float]:
        """The direction in which the friction would begin to slip, opposite to lambda_t."""
        t = held.press.tangential[i]
        length = float(np.hypot(t[0], t[1]))
        if not length > 0:
            return self.slides[i].direction
        return float(-t[0] / length), float(-t[1] / length)

    def _trial(
        self, sticking: Collection[int], guess: dict[int, tuple[float, float]]
    ) -> tuple[tuple[Slide, ...], Motion] | None:
        """With these sticking, the others slipping each in a direction of its own acceleration."""
        towards = dict(guess)
        slipping = [i for i in self.resting if i not in sticking]
        slides = self._with(sticking, towards)
        for _ in range(FRICTION_ROUNDS):
            try:
                slides = list(signed(self.now, slides))
                turned = False
                for i in slipping:
                    new = self._steered(slides, i)
                    if new is None:
                        return None
                    turned |= new != slides[i].direction
                    slides[i] = replace(slides[i], direction=new)
                if not turned:
                    return tuple(slides), self.now.motion(slides)
            except StepFailureError:
                return None
            if len(slipping) == 1:
                slides = list(signed(self.now, slides))
                return tuple(slides), self.now.motion(slides)
        return None

    def _all(
        self, guess: dict[int, tuple[float, float]]
    ) -> Iterator[tuple[tuple[Slide, ...], Motion]]:
        """Every combination, those with most sticking first."""
        free = self.resting[:FRICTION_MOST]
        for count in range(len(free) + 1):
            for slipping in itertools.combinations(free, count):
                sticking = [i for i in self.resting if i not in slipping]
                for signs in itertools.product((1.0, -1.0), repeat=count):
                    towards = dict(guess)
                    for i, sign in zip(slipping, signs, strict=True):
                        towards[i] = (sign * guess[i][0], sign * guess[i][1])
                    found = self._trial(sticking, towards)
                    if found is not None:
                        yield found

    def _rate(self, slides: Sequence[Slide], i: int) -> tuple[Vector, float]:
        """s' = G_t vdot - gamma_t of a friction, and what of it is rounding."""
        now = self.now.motion(slides)
        rows = self.rows[i]
        rate = np.zeros(2)
        rate[: len(rows)] = now.G[rows] @ now.vdot - now.gamma[rows]
        mass = now.M.diagonal()
        forces = np.abs(now.F) + np.abs(now.G).T @ np.abs(now.lam)
        free = np.maximum(np.abs(now.vdot), forces / np.where(mass > 0, mass, np.inf))
        floor = FRICTION_BACK * (np.abs(now.gamma[rows]) + np.abs(now.G[rows]) @ free).sum()
        return rate, float(floor)

    def _steered(self, slides: list[Slide], i: int) -> tuple[float, float] | None:
        """The direction that agrees with the acceleration; None if there is none."""
        e = slides[i].direction
        if len(self.rows[i]) == 1:
            rate, floor = self._rate(slides, i)
            if rate[0] * e[0] >= -floor:
                return e
            back = (-e[0], 0.0)
            slides[i] = replace(slides[i], direction=back)
            rate, floor = self._rate(slides, i)
            return back if rate[0] * back[0] >= -floor else None
        return self._on_circle(slides, i)

    def _on_circle(self, slides: list[Slide], i: int) -> tuple[float, float] | None:
        begin = float(np.arctan2(slides[i].direction[1], slides[i].direction[0]))

        def across(turn: float) -> tuple[float, float, float]:
            """s' across and along the direction at that angle, and what is rounding."""
            e = (float(np.cos(begin + turn)), float(np.sin(begin + turn)))
            slides[i] = replace(slides[i], direction=e)
            rate, floor = self._rate(slides, i)
            return e[0] * rate[1] - e[1] * rate[0], float(rate @ e), floor

        def at(turn: float) -> tuple[float, float]:
            return float(np.cos(begin + turn)), float(np.sin(begin + turn))

        c, along, floor = across(0.0)
        if abs(c) <= floor and along >= -floor:
            return at(0.0)
        step = 2 * np.pi / FRICTION_ANGLES
        for k in range(FRICTION_ANGLES // 2 + 1):  # nearest first, both ways
            for side in (1.0, -1.0):
                low, high = side * k * step, side * (k + 1) * step
                f_low, f_high = across(low)[0], across(high)[0]
                if f_low * f_high > 0:
                    continue
                for _ in range(60):
                    middle = (low + high) / 2
                    f = across(middle)[0]
                    if f_low * f > 0:
                        low, f_low = middle, f
                    else:
                        high = middle
                _, along, floor = across(low)
                if along >= -floor:
                    return at(low)
        return None
