"""The bench on which probes run: instances, natural times, the ordinary run, comparisons.

The natural rate of the motion at a start is the largest of |v|/size and sqrt(|vdot|/size) over the
coordinates, size being the largest of |q| and the parameters of its unit.  A probe lasts as many natural
times as the FMU's default experiment does at its default values.

Two runs that must agree are compared with what the problem itself makes of small changes: a third
run, whose start values are shifted by SHIFT of their size, shows the amplification; a difference is
right up to SAFETY * tol * max(1, N) times (1 + amplification so far), relative to the largest
magnitude of the column.  N as in invariants.py.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ... import names
from ...fmu.archive import unpack
from ...fmu.session import RefusalError, Session
from ...fmu.target import PYTHON
from ...verification.closed_forms import alone, applies
from .invariants import EPS, EQUATION, ROUNDING, Check, invariants, judged, laws, lost
from .specimen import Drive, Facts, Run, Values, facts_of, opened, play

SHIFT = 1e-6
SAFETY = 30.0
REFERENCE = 1e-13


@dataclass(frozen=True)
class Finding:
    """What came of a probe: its checks, or what refused it; `note` for the reader."""

    checks: tuple[Check, ...]
    refusal: RefusalError | None = None
    note: str = ""


class Bench:
    """An FMU unpacked (`folder`: where it was already), with one instance for runs.  Use it in a `with`
    statement."""

    def __init__(self, path: Path, quick: bool, folder: Path | None = None) -> None:
        self.facts: Facts = facts_of(path)
        self.quick = quick
        self.forms = (
            *judged(self.facts.closed_forms, {i.name for i in self.facts.inputs}),
            *laws(self.facts.laws),
        )
        self._unpacked = "" if folder is not None else unpack(path)
        self.folder = folder or Path(self._unpacked)
        self._session: Session | None = None

    def __enter__(self) -> Bench:
        return self

    def __exit__(self, *_: object) -> None:
        if self._session is not None:
            self._session.close()
        shutil.rmtree(self._unpacked, ignore_errors=True)

    @property
    def session(self) -> Session:
        """The instance that runs, reset before each."""
        if self._session is None:
            self._session = opened(self.facts, self.folder)
        return self._session

    @property
    def points(self) -> int:
        """Communication steps of a run."""
        return 20 if self.quick or self.facts.target == PYTHON else 60

    # ------------------------------------------------------------------ natural times

    def rate(self, values: Values) -> float:
        """The natural rate [1/s] of the motion at these start values; 0 at rest.  Raises RefusalError."""
        run = self.run(values, [0.0, self.facts.step_size])
        if run.refusal is not None and len(run.rows) == 0:
            raise run.refusal
        rate = float(self._rates(run)[0])
        return rate if np.isfinite(rate) else 0.0

    @cached_property
    def ordinary_rate(self) -> float:
        """The natural rate [1/s] at the default values; of what rests, which has none, the experiment's."""
        return max(self.rate({}), 1.0 / self.facts.stop_time)

    def span(self, values: Values) -> float:
        """The time [s] in which at these values happens what the default experiment shows."""
        rate = self.rate(values) if values else 0.0
        return self.facts.stop_time * (self.ordinary_rate / rate if rate > 0 else 1.0)

    # ------------------------------------------------------------------ runs

    def times(self, stop: float, points: int | None = None) -> list[float]:
        """0 ... stop in equal steps."""
        count = points or self.points
        return [stop * k / count for k in range(count + 1)]

    def run(
        self,
        values: Values,
        times: list[float],
        tolerance: float | None = None,
        drive: Drive | None = None,
        late: bool = False,
    ) -> Run:
        """A run on the bench's instance; `late` as in play()."""
        return play(self.session, self.facts, values, times, tolerance, drive, late=late)

    def checks(self, run: Run, span: float | None = None) -> list[Check]:
        """The invariants; `span` [s] is what counts as the default experiment at these values."""
        return invariants(self.facts, run, self.forms, self.elapsed(run, span))

    def elapsed(self, run: Run, span: float | None = None) -> NDArray[np.float64]:
        """Natural times up to each point, in units of those of the default experiment."""
        steady = run.rows["time"] / (span or self.facts.stop_time)
        return np.maximum(steady, self._counted(run) / self._whole)

    @cached_property
    def _whole(self) -> float:
        try:
            count = float(self._counted(self.ordinary)[-1])
        except RefusalError:
            count = 0.0
        return max(count, 1.0)

    @cached_property
    def fastest_rate(self) -> float:
        """The largest natural rate [1/s] in the default experiment.  Raises RefusalError."""
        return max(float(self._rates(self.ordinary).max()), self.ordinary_rate)

    def _rates(self, run: Run) -> NDArray[np.float64]:
        """The natural rate at each point."""
        rate = np.zeros(len(run.rows))
        with np.errstate(all="ignore"):
            for q in self.facts.coordinates:
                place = np.abs(run.rows[q])
                # of a start that was projected onto 0, and of an angle between axes, which has none
                angle = self.facts.dimensions[q][-1] == 1
                rounding = ROUNDING * abs(run.values.get(q, float(angle)))
                place = np.where(place > rounding, place, 0.0)
                bare = not any(self.facts.dimensions[q])  # as the parts of a unit quaternion
                size = np.maximum(place, 1.0 if bare else self.facts.same_unit(q, run.values))
                size = np.where(size > 0, size, 1.0)
                v = np.abs(run.rows[names.derivative(q)])
                vdot = np.abs(run.rows[names.derivative(q, 2)])
                rate = np.maximum(rate, np.maximum(v / size, np.sqrt(vdot / size)))
        return rate

    def _counted(self, run: Run) -> NDArray[np.float64]:
        """The integral of the natural rate over time."""
        rate = self._rates(run)
        with np.errstate(all="ignore"):
            parts = np.diff(run.rows["time"]) * (rate[1:] + rate[:-1]) / 2
        counted: NDArray[np.float64] = np.concatenate([[0.0], np.cumsum(parts)])[: len(rate)]
        return np.where(np.isfinite(counted), counted, 0.0)

    def judged(self, run: Run, span: float | None = None, note: str = "") -> Finding:
        """Invariants of what was reached, and the refusal if there was one."""
        if len(run.rows) and (q := lost(self.facts, run)):
            note = f"{note}; {q} has no digits left to move in: judged at each instant only"
        return Finding(tuple(self.checks(run, span)), run.refusal, note.lstrip("; "))

    @cached_property
    def ordinary(self) -> Run:
        """The default experiment.  Raises RefusalError."""
        run = self.run({}, self.times(self.facts.stop_time))
        if run.refusal is not None:
            raise run.refusal
        return run

    @cached_property
    def amplification(self) -> NDArray[np.float64]:
        """Of the default experiment, at its points."""
        return self.amplified({}, self.ordinary)

    def amplified(self, values: Values, run: Run) -> NDArray[np.float64]:
        """How much a relative change of the start values by SHIFT has grown, up to each point."""
        given: dict[str, float | str] = dict(values)
        seen = {n: run.rows[n][0] for n in run.rows.dtype.names or ()}
        for k, s in enumerate(self.facts.starts):
            own = float(seen[s.name])
            peers = [
                abs(seen[p.name]) for p in self.facts.starts if self.facts.alike(p.name, s.name)
            ]
            size = max(*peers, self.facts.same_unit(s.name, run.values))
            given[s.name] = own + SHIFT * (1 - 0.3 * (k % 3)) * size
        other = self.run(given, run.rows["time"].tolist(), min(run.tolerance, REFERENCE))
        growth = np.ones(len(run.rows))
        common = min(len(other.rows), len(run.rows))
        if common == 0:
            return growth
        for error in self.differences(run, other, common).values():
            growth[:common] = np.maximum(growth[:common], error / SHIFT)
        return np.maximum.accumulate(growth)

    def differences(
        self, run: Run, other: Run, count: int | None = None
    ) -> dict[str, NDArray[np.float64]]:
        """Of coordinates, velocities, lambda and Q, relative to the largest magnitude of their unit.

        A Q is as large as the constraints' shares in it: what is left where they balance is rounding.
        Where contacts or their impacts differ beside an event only their own delay is seen: one such point is
        left out.  So is what stands on the surface of a jump, where either side is right.
        """
        facts, found = self.facts, {}
        n = len(run.rows) if count is None else count
        a, b = run.rows[:n], other.rows[:n]
        alike = np.ones(n, dtype=bool)
        for c in facts.contacts:
            differ = np.asarray(a[names.name(names.CONTACT, c)] != b[names.name(names.CONTACT, c)])
            struck = names.name(names.CLOSINGS, c)
            if struck in (a.dtype.names or ()):
                differ |= np.asarray(a[struck] != b[struck])
            alike &= ~alone(differ)
        for form in self.forms:
            if form.closed_form.name.startswith(EQUATION):
                alike &= applies(form.closed_form, a, run.values)
                alike &= applies(form.closed_form, b, run.values)
        groups = [facts.coordinates, [names.derivative(q) for q in facts.coordinates]]
        groups += [[names.name(names.MULTIPLIER, c) for c in facts.constraints]]
        forces = [names.name(names.FORCE, "", q) for q in facts.coordinates]
        groups += [[n for n in forces if n in facts.variables]]
        for group in groups:
            largest = {x: self._largest(run.rows[:n], x) for x in group}
            for x in group:
                peers = [largest[y] for y in group if facts.dimensions[y] == facts.dimensions[x]]
                usual = self._largest(self.ordinary.rows, x)
                scale = max(*peers, usual, facts.same_unit(x, run.values)) or 1.0
                error = np.where(alike, np.abs(a[x] - b[x]), 0.0)
                found[x] = np.where(error > self._rounding(x), error, 0.0) / scale
        return found

    def _largest(self, rows: NDArray[np.void], name: str) -> float:
        """The largest magnitude of a column, or of the shares whose sum it is."""
        of = names.read(name)
        shares = (
            [self.facts.share(c, of.coordinate) for c in self.facts.constraints]
            if of.quantity == names.FORCE
            else []
        )
        return max(float(np.abs(rows[x]).max(initial=0.0)) for x in (name, *filter(None, shares)))

    def _rounding(self, name: str) -> float:
        """A difference that is none: of a motion that is none (a rod that falls flat does not turn)."""
        of = names.read(name)
        if of.quantity != names.VALUE or of.coordinate not in self.facts.coordinates:
            return 0.0
        speed = self.ordinary_rate if of.order else 1.0
        return 100 * EPS * speed * self.facts.usual(of.coordinate)

    def agreement(
        self,
        run: Run,
        other: Run,
        growth: NDArray[np.float64],
        what: str,
        span: float | None = None,
        noise: Mapping[str, NDArray[np.float64]] | None = None,
    ) -> list[Check]:
        """Two runs over the same points, with the tolerances that they have; `noise`: by how much runs differ
        at the tightest of tolerances, through rounding alone."""
        common = min(len(run.rows), len(other.rows), len(growth))
        tolerance = max(run.tolerance, other.tolerance)
        grown = np.maximum(1.0, self.elapsed(run, span)[:common]) * (1 + growth[:common])
        allowed = SAFETY * max(tolerance, 1e-13) * grown
        worst = Check(what, 0.0, 1.0)
        if common == 0:
            return []
        for name, error in self.differences(run, other, common).items():
            least = SAFETY * float(noise[name].max(initial=0.0)) if noise is not None else 0.0
            k = int(np.argmax(error / (allowed + least)))
            one = Check(f"{what}: {name}", float(error[k]), float(allowed[k]) + least)
            worst = max(worst, one, key=lambda c: c.ratio)
        return [worst]
