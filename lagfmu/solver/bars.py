"""Error bars: how far the values of a run may be off, estimated by a companion run beside it.

The companion steps the same equations from the same consistent start under the same inputs, at a tolerance
that is COARSER times the delivered one's.  With x of the delivered run and y of the companion, at the
communication points t_k so far,

    bar = max( max_k s_k d_k ,  rounding of max_k |x(t_k)| ) ,   d_k = |x(t_k) - y(t_k)| ,
    s_k = min(1, MARGIN / r_k) (1 + FEW / N_k) :

d is the companion's error, which is r times the delivered one's if local errors were all there is: r is the
ratio of the sums of h^(p + 1) of both.  N is the companion's sum in its largest part: where a few steps
decide, their errors may cancel by chance.  Where d is no longer small beside |x| the motions part, and all of
it is the bar: s is at least min(1, s + d / max |x|)  (docs/error_bars.md).

Events pair by their count: while one of the runs has met an event that the other has not, a difference says
nothing and the bar is infinite, for which the largest double stands.  A method of fixed steps delivers twice
as many steps as were asked for, and its companion takes those that were.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

from ..names import COUNT_OF, motion, read
from ..names import name as name_of
from ..numeric.failure import StepFailureError
from ..numeric.system import System
from ..numeric.thresholds import FEWEST_STEPS_RK4
from .advance import advance
from .observe import Values, observe
from .restored import restored
from .state import Local, Settings, State

COARSER = 100.0  # the companion's tolerance, in those of the delivered run
MARGIN = 5.0  # a bar is so many times what the ratio of local errors leaves of a difference, ...
FEW = 3.0  # ... and 1 + FEW times as much where a single step decides
ROUNDING = (
    4.0  # bars are no smaller than this times eps, sqrt(steps) and the largest magnitude so far
)
EPS, INFINITE = sys.float_info.epsilon, sys.float_info.max


@dataclass(frozen=True)
class Bars:
    """What is remembered of the companion: its state (None: it could not follow), and of each variable that
    has a bar the largest one, but for rounding, and magnitude so far."""

    state: State | None
    worst: tuple[float, ...]
    size: tuple[float, ...]


def begun(state: State, names: Sequence[str]) -> Bars:
    """The companion stands where the delivered run starts; `names` are the variables that have a bar."""
    return Bars(state, (0.0,) * len(names), (0.0,) * len(names))


def asked_step(settings: Settings, rate: float, span: float) -> float:
    """The fixed step [s] that was asked for: solver.step, or what the motion's natural rate says."""
    known = 0 < rate < math.inf
    return settings.step or (1 / (FEWEST_STEPS_RK4 * rate) if known else span / FEWEST_STEPS_RK4)


def paired_settings(settings: Settings, state: State, t_end: float) -> tuple[Settings, Settings]:
    """Those of the delivered run and of its companion, on the way to t_end [s]."""
    coarse = replace(settings, tolerance=settings.tolerance * COARSER)
    span = t_end - state.t
    if settings.method != "rk4" or not 0 < span < math.inf:
        return settings, coarse
    steps = max(math.ceil(span / asked_step(settings, state.rate, span) * (1 - 1e-12)), 1)
    return replace(settings, step=span / (2 * steps)), replace(coarse, step=span / steps)


def halved(settings: Settings, state: State) -> str:
    """What there is to tell of a fixed step; nothing of a method that controls its error."""
    step = asked_step(settings, state.rate, 0.0)
    if settings.method != "rk4" or not step:
        return ""
    return (
        f"error bars: {settings.method} delivers a run of half the step, {step / 2!r} s in place of "
        f"{step!r} s, which the companion takes"
    )


def followed(
    system: System,
    coarse: Settings,
    bars: Bars,
    u: Sequence[float],
    p: Sequence[float],
    t_end: float,
) -> tuple[Bars, str]:
    """The companion at t_end [s], by its settings; and why it could not follow, or nothing."""
    if bars.state is None:
        return bars, ""
    try:
        state = advance(system, coarse, bars.state, u, p, t_end, coarsened)
    except StepFailureError as error:
        return _lost(bars, coarse, t_end, error)
    return replace(bars, state=state), ""


def _lost(bars: Bars, coarse: Settings, t: float, error: Exception) -> tuple[Bars, str]:
    """Without a companion from here on, and what there is to tell."""
    return replace(bars, state=None), (
        f"error bars: the companion run at the tolerance {coarse.tolerance!r} cannot follow to t = {t!r} s, "
        f"all bars are infinite ({INFINITE!r}) from here: {error}"
    )


def paired(a: State, b: State) -> bool:
    """True if both runs have met the same events, and stand in the same modes."""
    if (a.strikes, a.closed, a.levels) != (b.strikes, b.closed, b.levels):
        return False
    counts = [[d.count for d in (*x.departures, *x.slippings)] for x in (a, b)]
    if counts[0] != counts[1]:
        return False
    for one, other in zip(a.slides, b.slides, strict=True):
        turn = sum(x * y for x, y in zip(one.direction, other.direction, strict=True))
        if one.sticks != other.sticks:
            return False
        if not one.sticks and (one.sign != other.sign or turn < 0):
            return False
    return True


def widened(
    system: System,
    coarse: Settings,
    bars: Bars,
    names: Sequence[str],
    now: tuple[State, Values],
    u: Sequence[float],
    p: Sequence[float],
) -> tuple[Bars, list[float], str]:
    """With the differences at the present state in them; the values of the bars; and why the companion could
    not be observed, or nothing.  `now` are the delivered run's state and values."""
    (state, mine), companion = now, bars.state
    if companion is None:
        return bars, [INFINITE] * len(names), ""
    try:
        others = observe(system, companion, u, p)
    except StepFailureError as error:
        bars, told = _lost(bars, coarse, state.t, error)
        return bars, [INFINITE] * len(names), told
    all_paired = paired(state, companion)
    worst, size, found = list(bars.worst), list(bars.size), []
    share = 1.0 if coarse.method == "rk4" else _share(state, companion)
    states = motion(system.coordinates)
    natural = dict(zip(states, state.scale, strict=True))
    rounding = ROUNDING * EPS * math.sqrt(1 + state.steps)
    for k, name in enumerate(names):
        count = _count(name)
        pair = all_paired
        if count in mine:  # the time of an event
            size[k] = abs(state.t) if mine[count] else 0.0
            pair = mine[count] == others[count]
        else:
            size[k] = max(size[k], abs(mine[name]), natural.get(name, 0.0))
        if pair:
            off = abs(mine[name] - others[name])
            part = max(share, min(1.0, share + off / size[k])) if size[k] else 1.0
            worst[k] = min(max(worst[k], part * off), INFINITE)
        bar = max(worst[k], rounding * size[k]) if pair else INFINITE
        found.append(min(bar, INFINITE))
    return replace(bars, worst=tuple(worst), size=tuple(size)), found, ""


@lru_cache(maxsize=4096)
def _count(name: str) -> str:
    """The count of the events whose latest time this is; nothing of another variable."""
    of = read(name)
    count = COUNT_OF.get(of.quantity)
    return "" if count is None else name_of(count, of.constraint)


def _share(a: State, b: State) -> float:
    """The part of the difference between a run a and its companion b that is the bar."""
    pairs = zip(a.local[:2], b.local[:2], strict=True)
    ratio = min((y / x for x, y in pairs if x > 0), default=math.inf)
    sums = zip(b.local[:2], b.local[2:], strict=True)
    steps = min((all_ / most for all_, most in sums if most > 0), default=math.inf)
    return (min(1.0, MARGIN / ratio) if 0 < ratio < math.inf else 1.0) * (1 + FEW / steps)


def after_step(solver: Any, state: State, local: Local) -> Local:
    """The local errors with that of the step just taken.

    The local error of a method of order p grows with h^(p + 1); h in units of the motion's natural time.
    """
    h, implicit = (
        float(solver.t - solver.t_old) * state.rate,
        not hasattr(solver, "estimated_error"),
    )
    found = h ** (6 if implicit else 9)
    if not found <= EPS * INFINITE:
        return local
    whole = list(local)
    whole[implicit] += found
    whole[2 + implicit] = max(local[2 + implicit], found)
    return whole[0], whole[1], whole[2], whole[3]


def coarsened(solver: Any, state: State, local: Local) -> Local:
    """The same for a companion.  A step that the run beside it could take as well, since its end was given
    and not chosen (an input may change there), would not differ: its estimated error stays in it."""
    h = solver.t - solver.t_old
    if hasattr(solver, "estimated_error") and solver.h_abs >= 0.9 * COARSER ** (1 / 8) * h:
        solver.y = solver.y + solver.estimated_error(h)
    return after_step(solver, state, local)


def to_list(bars: Bars) -> list[Any]:
    """What a saved state keeps of them."""
    text = None if bars.state is None else bars.state.to_json()
    return [text, list(bars.worst), list(bars.size)]


def restored_bars(system: System, raw: Any, count: int, state: State) -> Bars:
    """What `to_list` made, beside the delivered run's state.  Raises ValueError with what cannot be."""
    if not isinstance(raw, list) or len(raw) != 3:
        raise ValueError("it holds no error bars")
    for values in raw[1:]:
        if not isinstance(values, list) or len(values) != count:
            raise ValueError("it has other error bars")
        if not all(type(x) in (int, float) and 0 <= x < math.inf for x in values):
            raise ValueError(f"its error bars are {json.dumps(values)}")
    companion = None if raw[0] is None else restored(system, raw[0])
    if companion is not None and companion.t != state.t:
        raise ValueError(f"its companion's time is {companion.t!r}")
    return Bars(companion, tuple(map(float, raw[1])), tuple(map(float, raw[2])))
