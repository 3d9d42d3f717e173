"""What must hold in every run, whatever its parameters: the invariants of Lagrange's equations.

  finite       every output that a successful call gave is a finite number
  shares       Q.q = sum of Q.c.q over the constraints c, to rounding of the summands
  residual     |f| (or |G v - nu|) of what acts is at rounding: at most ROUNDING of its own size,
               the sum over q of |G_q| max(|q| so far, its start, parameters of its unit), with
               G_q = Q.c.q / lambda.c as the FMU itself reports it, or df/dq of the model's f; of
               velocities: the largest of the unit
  push         lambda >= 0 while a contact is closed, within 10 tol of the largest |lambda|
  no pull      lambda = 0, exactly, while it is open: f lambda = 0
  outside      f >= 0 while it is open, within 1e-9 of f's own size
  closed_forms       the closed forms and conserved quantities that an FMU carries

Each comes as an error and what is allowed; the run is right if no error exceeds what it is allowed.

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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from ... import names
from ...fmu.closed_forms import CarriedForm
from ...fmu.read import Trajectory
from ...model.elements import Expr
from ...numeric import thresholds
from ...verification.closed_forms import Compiled, applies, landed
from .specimen import Facts, Run

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


EPS = float(np.finfo(float).eps)
ROUNDING = 200 * EPS  # of a residual, relative to its own size
TIED = 14 * 3**0.5  # of the largest length: what the size of a joint's row is at most (_size)
NOTHING = EPS**2 / ROUNDING  # of the usual place: the square of its rounding is nothing
GAP = 4 * thresholds.TOUCH  # of f's own size: nearer than a quarter of that a contact touches


@dataclass(frozen=True)
class Check:
    """An error, and the largest one that is right; `instant`: it knows nothing of the motion's course."""

    what: str
    error: float
    allowed: float
    instant: bool = False

    @property
    def ratio(self) -> float:
        """Error over what is allowed: above 1 it is wrong."""
        if not np.isfinite(self.error):
            return float("inf")
        return self.error / self.allowed if self.allowed > 0 else float(self.error > 0) * np.inf


def invariants(facts: Facts, run: Run, forms: Sequence[JudgedForm], elapsed: Column) -> list[Check]:
    """All checks of a run, at the points that were reached; `elapsed` as N above."""
    if len(run.rows) == 0:
        return []
    bad = [n for n in run.rows.dtype.names or () if not np.isfinite(run.rows[n]).all()]
    checks = [Check("finite" + "".join(f" {n}" for n in bad), float(len(bad)), 0.5)]
    if bad:
        return checks
    checks += _shares(facts, run)
    sizes = sizes_of(facts, run, forms)
    checks += _residuals(facts, run, sizes)
    checks += _contacts(facts, run, sizes)
    checks = [replace(c, instant=True) for c in checks]
    digits = not lost(facts, run)
    before, floors = ~landed(run.rows), _magnitudes(facts, run)
    S = sum((form.terms(run) for form in forms), np.zeros(len(run.rows)))
    for form in forms:
        if run.driven and not form.pointwise:  # it says something of the motion without inputs
            continue
        if not (digits or form.instantaneous):
            continue
        error, allowed, points = form.judge(
            run, np.maximum(1.0, elapsed) * _wound(facts, run), before, floors, S
        )
        if points:
            checks.append(Check(form.closed_form.name, error, allowed, form.instantaneous))
    return checks


def lost(facts: Facts, run: Run) -> str:
    """The coordinate so large that its rounding is above the tolerance of the motion, or nothing.

    There a motion has no digits, and what it should be cannot be said: only what holds at each instant.
    """
    for q in facts.coordinates:
        largest = float(np.abs(run.rows[q]).max(initial=abs(run.values.get(q, 0.0))))
        angle = facts.dimensions[q][-1] == 1
        way = float(np.ptp(run.rows[q])) if len(run.rows) else 0.0
        size = 1.0 if angle else max(facts.same_unit(q, run.values) or facts.usual(q), way)
        if EPS * largest > max(run.tolerance, 1e-13) * size:
            return q
    return ""


def _wound(facts: Facts, run: Run) -> Column:
    """The largest angle so far [rad], at least 1: its error is relative, that of its sine is not."""
    largest = np.ones(len(run.rows))
    for q in facts.coordinates:
        if facts.dimensions[q][-1] == 1:
            largest = np.maximum(largest, np.maximum.accumulate(np.abs(run.rows[q])))
    return largest


def _magnitudes(facts: Facts, run: Run) -> dict[str, float]:
    """The magnitude that an error is relative to, at the least: of coordinates, velocities, forces, energy.

    A coordinate is known to the rounding of the value that it was given at the start, however small the
    one is onto which that was projected; a velocity to what would move the coordinate by its rounding within
    the run, or the default experiment if that is shorter (forces balance no better for lasting longer); one
    that stays within the tolerance of rest is measured by its nominal; the energy to the work of Q over the
    rounding of the sizes.
    """
    found = {}
    work, span = 0.0, float(run.rows["time"][-1] - run.rows["time"][0])
    for q in facts.coordinates:
        rounding = max(EPS * abs(run.values.get(q, 0.0)), NOTHING * facts.usual(q))
        found[q] = max(facts.same_unit(q, run.values), rounding)
        peers = [p for p in facts.coordinates if facts.dimensions[p] == facts.dimensions[q]]
        fastest = max(float(np.abs(run.rows[names.derivative(p)]).max()) for p in peers)
        size = max(found[q] or facts.usual(q), float(np.abs(run.rows[q]).max()))
        creep = EPS * (size / min(span, facts.stop_time)) if span > 0 else 0.0
        nominal = facts.nominal(names.derivative(q))
        rests = fastest <= run.tolerance * nominal
        found[names.derivative(q)] = nominal if rests else max(fastest, creep)
        if names.name(names.FORCE, "", q) in facts.variables:
            work += EPS * size * float(np.abs(run.rows[names.name(names.FORCE, "", q)]).max())
    moved = [n for n in facts.dimensions if names.derivative(n) in facts.dimensions]
    for own in set(moved) - set(facts.coordinates) - set(facts.motions):  # speeds, quaternions
        alike = [n for n in moved if facts.alike(n, own) and n in (run.rows.dtype.names or ())]
        found[own] = max((float(np.abs(run.rows[n]).max()) for n in alike), default=0.0)
    pushes = [names.name(names.MULTIPLIER, c) for c in facts.constraints]
    for push in pushes:  # they are solved for together
        alike = [p for p in pushes if facts.alike(p, push)]
        found[push] = EPS / ROUNDING * max(float(np.abs(run.rows[p]).max()) for p in alike)
    if names.POTENTIAL in facts.variables:
        parts = np.abs(run.rows[names.KINETIC]) + np.abs(run.rows[names.POTENTIAL])
        found[names.TOTAL] = found[names.DISSIPATED] = max(float(parts.max()), work)
    return found


def _worst(what: str, error: Column, allowed: Column) -> Check:
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(error > 0, error / allowed, 0.0)
    k = int(np.argmax(ratio))
    return Check(what, float(error[k]), float(allowed[k]))


def _shares(facts: Facts, run: Run) -> list[Check]:
    checks = []
    for q in facts.coordinates:
        whole = names.name(names.FORCE, "", q)
        if whole not in facts.variables or not all(names.shared(c, q) for c in facts.constraints):
            continue
        found = [facts.share(c, q) for c in facts.constraints]
        shares = [run.rows[name] for name in found if name is not None]
        none = np.zeros(len(run.rows))
        allowed = 4 * (1 + len(shares)) * EPS * sum(map(np.abs, shares), none)
        error = np.abs(run.rows[whole] - sum(shares, none))
        checks.append(_worst(f"shares of Q.{q}", error, allowed + np.finfo(float).tiny))
    return checks


def sizes_of(facts: Facts, run: Run, forms: Sequence[JudgedForm]) -> dict[str, Column | None]:
    """Of each constraint the size of f, or of G v - nu, up to each row; None where nothing shows it."""
    laws = {form.closed_form.name: form.expected for form in forms}
    reach = {n: _reach(facts, run, n) for n in _moving(facts)}
    return {
        c: _size(facts, run, c, laws.get(names.name(names.RESIDUAL, c)), reach)
        for c in facts.constraints
    }


def _size(
    facts: Facts,
    run: Run,
    constraint: str,
    law: Compiled | None,
    reach: Mapping[str, Column],
) -> Column | None:
    """G is shown by lambda and its shares, of names of one word; of a joint's row by the model's `law`.

    Without that it is known to be e . (p2 - p1) with p = r + R s, or a2 . b1 of unit vectors.  A unit
    quaternion moves R s by 2 |s| for each of its components, the sum of which is at most 2: with no place or
    length above L that is sqrt(3) L for each r, 4 sqrt(3) L for each s, and 4 sqrt(3) L for e, whose lever is
    p2 - p1; in the plane |s| for each radian that the angle has.
    """
    rows, lam = run.rows, run.rows[names.name(names.MULTIPLIER, constraint)]
    shares = {q: facts.share(constraint, q) for q in facts.coordinates}
    size = np.zeros(len(rows))
    if any(shares.values()):
        acting = np.abs(lam) > np.finfo(float).tiny / EPS
        if not acting.any():
            return None
        for q, share in shares.items():
            if share is not None:
                G = np.abs(rows[share] / np.where(acting, lam, 1.0))
                moved = reach[names.derivative(q) if facts.rates(constraint) else q]
                size += np.where(acting, G, G[acting].max()) * moved
    elif law is not None:
        size = law.shaken(rows, rows, run.values, reach)
    else:
        residual = names.name(names.RESIDUAL, constraint)
        least = max(facts.same_unit(residual, run.values), NOTHING * facts.usual(residual))
        if not any(facts.dimensions[residual][:-1]):
            least = max(least, 1.0)  # of axes of length 1, and of angles
        size = TIED * np.maximum(_largest_peer(facts, run, residual), least) * _wound(facts, run)
    return np.where(size > 0, size, 1.0)


def _reach(facts: Facts, run: Run, name: str) -> Column:
    """How large a coordinate has been so far, at least its start and the parameters of its unit; velocities
    are found together: as large as the fastest of them."""
    peers = _largest_peer(facts, run, name)
    least = max(facts.same_unit(name, run.values), abs(run.values.get(name, 0.0)))
    if name not in facts.coordinates:
        return np.maximum(peers, least)
    least = max(least, NOTHING * max(facts.usual(name), float(peers[-1])))
    if not any(facts.dimensions[name][:-1]):
        least = max(least, 1.0)  # sines and cosines of angles stand beside 1
    return np.maximum(np.maximum.accumulate(np.abs(run.rows[name])), least)


def _moving(facts: Facts) -> set[str]:
    """Coordinates, velocities and speeds."""
    speeds = [v.name for v in facts.outputs if names.derivative(v.name) in facts.variables]
    return {*names.motion(facts.coordinates), *speeds} & facts.dimensions.keys()


def _largest_peer(facts: Facts, run: Run, name: str) -> Column:
    """The largest magnitude so far among the coordinates, velocities or speeds of the same unit."""
    same = [n for n in _moving(facts) if facts.dimensions[n] == facts.dimensions[name]]
    largest = np.maximum.reduce([np.zeros(len(run.rows)), *(np.abs(run.rows[n]) for n in same)])
    return np.asarray(np.maximum.accumulate(largest))


def _acts(facts: Facts, run: Run, constraint: str) -> NDArray[np.bool_]:
    """A contact acts while it is closed; what goes with a contact has no multiplier otherwise; what holds
    by friction is judged by its law (lagrange.py)."""
    if names.name(names.SLIP, constraint) in facts.variables:
        return np.zeros(len(run.rows), dtype=bool)
    if constraint in facts.contacts:
        return np.asarray(run.rows[names.name(names.CONTACT, constraint)], dtype=bool)
    if facts.contacts:
        return np.asarray(run.rows[names.name(names.MULTIPLIER, constraint)] != 0)
    return np.ones(len(run.rows), dtype=bool)


def _residuals(facts: Facts, run: Run, sizes: Mapping[str, Column | None]) -> list[Check]:
    checks = []
    for c in facts.constraints:
        where, size = _acts(facts, run, c), sizes[c]
        if size is not None and where.any():
            error = np.where(where, np.abs(run.rows[names.name(names.RESIDUAL, c)]), 0.0)
            checks.append(_worst(names.name(names.RESIDUAL, c), error, ROUNDING * size))
    return checks


def _contacts(facts: Facts, run: Run, sizes: Mapping[str, Column | None]) -> list[Check]:
    checks = []
    for c in facts.contacts:
        closed = np.asarray(run.rows[names.name(names.CONTACT, c)], dtype=bool)
        lam, f = (run.rows[names.name(n, c)] for n in (names.MULTIPLIER, names.RESIDUAL))
        largest = float(np.abs(lam).max())
        push = float(np.maximum(-lam[closed], 0.0).max(initial=0.0))
        allowed = (10 * run.tolerance + 1e-12) * largest + np.finfo(float).tiny
        checks.append(Check(f"push of {c}", push, allowed))
        pull = float(np.abs(lam[~closed]).max(initial=0.0))
        checks.append(Check(f"no pull of {c} in the open", pull, np.finfo(float).tiny))
        size = sizes[c]
        if size is not None and (~closed).any():
            inside = np.where(closed, 0.0, np.maximum(-f, 0.0))
            checks.append(_worst(f"outside of {c}", inside, GAP * size))
    return checks
