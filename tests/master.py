"""A Gauss-Seidel master for the two FMUs of coupled_belt.py, by FMI 3.0.

Over a step h from t the drive moves under a force that is linear in time, from F(t) to F(t + h); then the
block moves on a belt that follows the drive, its velocity the cubic through s' and s'' at both ends.  Both
start anew from their saved states until F(t + h) is what the block then exerts.  What remains is the error of
a straight line through F: of order 2 in h where F is smooth.

With event mode and early return the block stops where it begins to slip or to stick: the drive is stepped to
that time too, and the line through F ends there.  Without, the line leads over the jump of F.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from ctypes import byref, c_double, c_size_t, c_void_p

import numpy as np
from fmi3 import Library, Single, Step
from numpy.polynomial import Polynomial

MOTION = ("s", "der(s)", "der(s,2)")  # of the drive
MOVED = ("u", "der(u)", "der(u,2)")  # the block's inputs
AGREED, SIMULTANEOUS = 1e-7, 1e-12  # N, s
SWEEPS = 30


class Side:
    """One of the coupled FMUs: what acts on it within a step, and the state from which it steps anew."""

    def __init__(self, library: Library, inputs: tuple[str, ...], events: bool) -> None:
        self.state, self.time = c_void_p(), 0.0
        self.signals: Callable[[float], list[float]] | None = None
        self.one: Single = library(events=events, early=events, between=self._given, named=inputs)
        self.one.start(tolerance=1e-11)
        self.references = self.one.references(inputs)
        if events:
            self.one.does("EnterStepMode")

    def _given(self, _: Single, time: float, asked: bool, returns: bool) -> None:
        if asked:
            self.set(self.signals(time - self.time))

    def set(self, values: list[float]) -> None:
        """The inputs, at the time where it stands."""
        size = c_size_t(len(values))
        given = (c_double * len(values))(*values)
        self.one.does("SetFloat64", self.references, size, given, size)

    def save(self) -> None:
        """What `steps` begins with."""
        self.one.does("GetFMUState", byref(self.state))
        self.time = self.one.time

    def steps(self, h: float, *signals: Polynomial) -> Step:
        """From the saved state, under inputs that are polynomials in the time since then."""
        self.one.does("SetFMUState", self.state)
        self.one.time = self.time
        self.signals = lambda since: [p(since) for p in signals]
        return self.one.step(h)


class Coupling:
    """Drive and block side by side; `met` holds the times of the events that both have stopped at."""

    def __init__(self, drive: Library, block: Library, events: bool) -> None:
        self.met: list[float] = []
        self.drive, self.block = Side(drive, ("F",), events), Side(block, MOVED, events)
        self.exchange()

    @property
    def force(self) -> float:
        """Friction on the belt [N]."""
        force: float = self.block.one.get("lambda.belt")
        return force

    def exchange(self) -> None:
        """At one instant: while the block rides, F and s'' depend on each other."""
        for _ in range(SWEEPS):
            force = self.force
            self.drive.set([force])
            self.block.set(self.drive.one.floats(MOTION))
            if abs(self.force - force) < AGREED:
                break

    def advance(self, h: float) -> None:
        """A step of h, or to the event that comes before its end."""
        for side in (self.drive, self.block):
            side.save()
        start, force = self.drive.one.floats(MOTION), self.force
        reached, end = h, force
        for _ in range(SWEEPS):  # reached [s] and end [N] are sought: how far both go, F there
            before = reached, end
            line = Polynomial([force, (end - force) / reached])
            self.drive.steps(reached, line)
            step = self.block.steps(h, *between(start, self.drive.one.floats(MOTION), reached))
            reached, end = step.time - self.block.time, self.force
            if abs(reached - before[0]) < SIMULTANEOUS and abs(end - before[1]) < AGREED:
                break
        self.drive.steps(reached, line)
        if step.event:
            self.meet()
        self.exchange()

    def meet(self) -> None:
        """The event at the end of a step, in both FMUs."""
        self.met.append(self.block.one.time)
        pair = self.drive.one, self.block.one
        for one in pair:
            one.does("EnterEventMode")
        while True:
            self.exchange()
            if True not in [one.updates()[0] for one in pair]:
                break
        for one in pair:
            one.does("EnterStepMode")

    def run(self, stop: float, h: float, first: float) -> None:
        """To `stop` by steps of h, after a shorter first one."""
        for end in (*np.arange(first, stop - SIMULTANEOUS, h), stop):
            while self.block.one.time < end - SIMULTANEOUS:
                self.advance(end - self.block.one.time)


def between(start: list[float], end: list[float], h: float) -> tuple[Polynomial, ...]:
    """Position, velocity and acceleration of the belt over h: the velocity is cubic."""
    (s, w, a), (_, w1, a1) = start, end
    rise, bend = (w1 - w) / h - a, a1 - a
    velocity = Polynomial([w, a, (3 * rise - bend) / h, (bend - 2 * rise) / h**2])
    return velocity.integ(k=s), velocity, velocity.deriv()


def error(
    sides: tuple[Library, Library], x: float, stop: float, h: float, events: bool, places: int
) -> float:
    """Error of the block's place at `stop`, where it should be x [m]: root mean square over runs whose
    communication points lie at so many places beside the events."""
    squares = []
    for k in range(places):
        coupling = Coupling(*sides, events)
        coupling.run(stop, h, first=h * (k + 1) / places)
        squares.append((coupling.block.one.get("x") - x) ** 2)
    return math.sqrt(sum(squares) / places)
