"""The closed forms that an FMU carries, compiled once, with the error that each is allowed.

A closed form `actual = expected` that follows the motion (it knows the start, the time or an event, or
says that something is conserved) may be off by

    LEEWAY * within * tol * max(1, N) * A * size,    at least    LEEWAY * rounding * max(1, N) * A * size

where `within` and `rounding` are the closed form's own, N counts the natural times of the motion that have
passed, in units of those in the FMU's default experiment, and `size` is
the largest over the run of the closed form's scale and of the sum of the magnitudes of its terms: an error of
tol in a state is one of tol * |term| in each term, and no sum can be better than its terms.  A is the
largest angle so far [rad], at least 1: its error is tol * |angle|, that of its sine too.  LEEWAY, because
`within` holds at the default tolerance, and errors are proportional to the tolerance only roughly.

A closed form among the outputs of one instant has nothing to do with the integration: whatever the tolerance,
it may be off by  LEEWAY * rounding * size,  with the size at that instant.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from ... import names
from ...fmu.closed_forms import CarriedForm
from ...fmu.read import Trajectory
from ...model.elements import Expr
from ...verification.closed_forms import applies
from ...verification.evaluate import Compiled
from .player import Run

LEEWAY = 10.0
EQUATION = "Lagrange's equation of "  # what the laws of a model begin with (lagrange.py), ...
MASSLESS = EQUATION + "massless "  # ... of a coordinate that has no place in the metric of M, ...
RATE = "d2/dt2 of "  # ... of a constraint
SLOW = 1e-9  # of the fastest slip: one that has no direction yet
Column = NDArray[np.float64]


def magnitude(e: Expr) -> Expr:
    """The sum of the magnitudes of an expression's terms; f(x): |f(x)| + |x f'(x)|, of each argument."""
    if e.is_Atom:
        return sp.Abs(e)
    if e.is_Add:
        return sp.Add(*(magnitude(a) for a in e.args))
    if e.is_Mul:
        return sp.Mul(*(magnitude(a) for a in e.args))
    if e.is_Pow and e.exp.is_number:
        if e.exp.is_positive:
            return magnitude(e.base) ** e.exp
        return sp.Abs(e) * magnitude(e.base) / sp.Abs(e.base)
    if isinstance(e, sp.Function) and not e.has(sp.Piecewise, sp.floor):
        arguments = {sp.Dummy(f"x{k}", real=True): a for k, a in enumerate(e.args)}
        slopes = {x: e.func(*arguments).diff(x) for x in arguments}
        if not any(s.has(sp.Derivative, sp.Subs, sp.DiracDelta) for s in slopes.values()):
            shaken = (
                sp.Abs(s.xreplace(arguments)) * magnitude(arguments[x]) for x, s in slopes.items()
            )
            return sp.Add(sp.Abs(e), *shaken)  # else a jump or no formula
    return sp.Abs(e)


@dataclass(frozen=True)
class JudgedForm:
    """A closed form ready to be judged; `pointwise`: it holds at each instant, whatever the inputs did.

    `instantaneous`: it relates the outputs of one instant, so that no error of the integration enters;
    `law`: an equation that is solved at that instant, so that nothing but its own terms is its size;
    `scale` is a further size: of an equation what its terms do not show, of a RATE relative to S.
    """

    closed_form: CarriedForm
    actual: Compiled
    expected: Compiled | None
    sizes: tuple[Compiled, ...]
    pointwise: bool
    instantaneous: bool
    law: bool
    scale: Compiled | None = None

    @property
    def in_metric(self) -> bool:
        """Whether it is one of the equations of which S is made."""
        name = self.closed_form.name
        return name.startswith(EQUATION) and not name.startswith(MASSLESS)

    def terms(self, run: Run) -> Column:
        """What it adds to S at each row."""
        return self._terms(run.rows, run) if self.in_metric else np.zeros(len(run.rows))

    def _terms(self, rows: Trajectory, run: Run) -> Column:
        parts = [*self.sizes, *filter(None, [self.scale])]
        found = (np.abs(s.at(rows, run.rows, run.values)) for s in parts)
        return sum(found, np.zeros(len(rows)))

    def judge(
        self,
        run: Run,
        growth: Column,
        undisturbed: NDArray[np.bool_],
        floors: Mapping[str, float],
        S: Column,
    ) -> tuple[float, float, int]:
        """(largest error, what is allowed there, points).

        `growth` is max(1, N) at each row; `undisturbed` are the rows before the first impact, where
        also that may be judged which speaks of the start; `floors` as in Compiled.at; `S` is the sum of the
        equations' terms.
        """
        chosen = applies(self.closed_form, run.rows, run.values)
        if not self.instantaneous:
            chosen = chosen & undisturbed
        chosen = chosen & ~self._barely_slips(run)
        rows, result, values = run.rows[chosen], run.rows, run.values
        actual = self.actual.at(rows, result, values)
        if len(actual) == 0:
            return 0.0, 1.0, 0
        first = np.full_like(actual, actual[0])
        expected = first if self.expected is None else self.expected.at(rows, result, values)
        known = np.isfinite(expected) & np.isfinite(actual)  # elsewhere the form is not defined
        if not known.any():
            return 0.0, 1.0, 0
        least = None if self.law else floors
        sizes = [np.abs(s.at(rows, result, values, least)) for s in self.sizes]
        sizes.append(np.abs(expected))
        if self.closed_form.name.startswith(EQUATION):
            sizes.append(S[chosen] if self.in_metric else self._terms(rows, run))
        elif self.scale is not None:
            within = S[chosen] if self.closed_form.name.startswith(RATE) else 1.0
            sizes.append(np.abs(self.scale.at(rows, result, values, least)) * within)
        for s in sizes:
            known &= np.isfinite(s)
        if not known.any():
            return 0.0, 1.0, 0
        size = np.maximum.reduce(sizes)
        relative = np.full(len(actual), LEEWAY * self.closed_form.rounding)
        if not self.instantaneous:
            size = np.full(len(actual), size[known].max())
            tolerance = LEEWAY * self.closed_form.within * run.tolerance
            relative = np.maximum(relative, tolerance) * growth[chosen]
        allowed = relative * size + np.finfo(float).tiny
        error = np.abs(actual - expected)
        worst = int(np.argmax(np.where(known, error / allowed, -1.0)))
        return float(error[worst]), float(allowed[worst]), int(known.sum())

    def _barely_slips(self, run: Run) -> NDArray[np.bool_]:
        """Where a slip of which it speaks is so slow, beside the fastest of the run, that rounding gives it
        its direction: at the instant at which it begins, or turns round."""
        when = sp.sympify(0 if self.closed_form.when is None else self.closed_form.when)
        slips = [n for n in map(str, when.free_symbols) if names.read(n).quantity == names.SLIP]
        if not slips:
            return np.zeros(len(run.rows), dtype=bool)
        speed = np.sqrt(sum(run.rows[n] ** 2 for n in slips))
        return np.asarray(speed <= SLOW * speed.max(initial=0.0))


def judged(closed_forms: tuple[CarriedForm, ...], inputs: set[str]) -> tuple[JudgedForm, ...]:
    """Every closed form, compiled."""
    found = []
    for c in closed_forms:
        parts = [c.actual] + ([] if c.expected is None else [c.expected])
        used = {str(s) for e in parts for s in sp.sympify(e).free_symbols}
        follows = any(
            u == "time" or names.initially(u) or names.read(u).head in names.EVENTS for u in used
        )
        instantaneous = c.expected is not None and not follows
        found.append(_judged(c, instantaneous, False, inputs))
    return tuple(found)


def laws(closed_forms: tuple[CarriedForm, ...]) -> tuple[JudgedForm, ...]:
    """Lagrange's equations (lagrange.py), compiled: instantaneous even where time stands in them.

    One value that has to vanish, or that projection makes vanish, is rounding of the run, not of itself; so
    is the margin of a joint that carries nothing.
    """
    alone = [
        names.read(c.name).quantity in (names.RESIDUAL, names.MARGIN)
        or (c.expected == 0 and sp.sympify(c.actual).is_Symbol)
        for c in closed_forms
    ]
    return tuple(_judged(c, True, not a, set()) for c, a in zip(closed_forms, alone, strict=True))


def _judged(c: CarriedForm, instantaneous: bool, law: bool, inputs: set[str]) -> JudgedForm:
    parts = [c.actual] + ([] if c.expected is None else [c.expected])
    scale = None if c.scale is None else sp.sympify(c.scale)
    if scale is not None and not law:
        # a difference of velocities is not one of the magnitudes that they have at least (Compiled.at)
        scale = magnitude(scale)
    return JudgedForm(
        c,
        Compiled(c.actual, c.name),
        None if c.expected is None else Compiled(c.expected, c.name),
        tuple(Compiled(magnitude(e), c.name) for e in map(sp.sympify, parts)),
        instantaneous or not inputs,
        instantaneous,
        law,
        None if scale is None else Compiled(scale, c.name),
    )
