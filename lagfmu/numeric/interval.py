"""Interval arithmetic, to rounding: what an expression can be while its arguments stay in (low, high).

R. E. Moore, Interval Analysis, 1966, chs. 2 and 3.  Where a result has no bounds it is `ALL`.
"""

from __future__ import annotations

import math
from collections.abc import Callable

Interval = tuple[float, float]
ALL: Interval = (-math.inf, math.inf)


def of(x: float) -> Interval:
    """The number x."""
    return x, x


def unknown() -> Interval:
    """Nothing can be said, of no box."""
    return math.nan, math.nan


def _checked(low: float, high: float) -> Interval:
    return (low, high) if low <= high else ALL  # a NaN: inf - inf, or outside the domain


def add(a: Interval, b: Interval) -> Interval:
    """a + b."""
    return _checked(a[0] + b[0], a[1] + b[1])


def mul(a: Interval, b: Interval) -> Interval:
    """a b, with 0 times infinity as 0."""
    ends = [x * y if x != 0 and y != 0 else 0.0 for x in a for y in b]
    return min(ends), max(ends)


def power(a: Interval, n: int) -> Interval:
    """a^n for a whole n."""
    if n < 0:
        low, high = power(a, -n)
        if low <= 0 <= high:
            return (1 / high if high > 0 else 0.0, math.inf) if low == 0 else ALL
        return 1 / high, 1 / low
    try:
        low, high = a[0] ** n, a[1] ** n
    except OverflowError:
        return ALL
    if n % 2 == 1:
        return low, high
    return (0.0 if a[0] <= 0 <= a[1] else min(low, high)), max(low, high)


def hull(a: Interval, b: Interval) -> Interval:
    """What is in a or b."""
    return min(a[0], b[0]), max(a[1], b[1])


def choose(h: Interval, a: Interval, b: Interval) -> Interval:
    """a where h > 0, b where h < 0."""
    return a if h[0] > 0 else b if h[1] < 0 else hull(a, b)


def _rising(f: Callable[[float], float], a: Interval, low: float, high: float) -> Interval:
    """f rises from `low` at the left end of its domain to `high` at the right one."""
    ends = []
    for x, limit in zip(a, (low, high), strict=True):
        try:
            ends.append(f(x))
        except (ValueError, OverflowError):
            ends.append(limit)
    return _checked(ends[0], ends[1])


def exp(a: Interval) -> Interval:
    """e^a."""
    return _rising(math.exp, a, 0.0, math.inf)


def log(a: Interval) -> Interval:
    """ln a."""
    return _rising(math.log, a, -math.inf, math.inf)


def sqrt(a: Interval) -> Interval:
    """The square root, of what is not negative in a."""
    return _rising(math.sqrt, a, 0.0, math.inf)


def atan(a: Interval) -> Interval:
    """Arc tangent."""
    return math.atan(a[0]), math.atan(a[1])


def asin(a: Interval) -> Interval:
    """Arc sine."""
    return _rising(math.asin, a, -math.pi / 2, math.pi / 2)


def acos(a: Interval) -> Interval:
    """Arc cosine."""
    low, high = asin(a)
    return math.pi / 2 - high, math.pi / 2 - low


def atan2(_: Interval, __: Interval) -> Interval:
    """An angle."""
    return -math.pi, math.pi


def sinh(a: Interval) -> Interval:
    """Hyperbolic sine."""
    return _rising(math.sinh, a, -math.inf, math.inf)


def cosh(a: Interval) -> Interval:
    """Hyperbolic cosine."""
    low, high = exp(magnitude(a))
    return (low + 1 / low) / 2, (high + 1 / high) / 2


def tanh(a: Interval) -> Interval:
    """Hyperbolic tangent."""
    return math.tanh(a[0]), math.tanh(a[1])


def asinh(a: Interval) -> Interval:
    """Inverse hyperbolic sine."""
    return math.asinh(a[0]), math.asinh(a[1])


def sin(a: Interval) -> Interval:
    """Sine: its ends, and 1 or -1 where a crest or a trough lies between."""
    if not (a[1] - a[0] < 2 * math.pi and a[0] > -1e15 and a[1] < 1e15):
        return -1.0, 1.0
    ends = math.sin(a[0]), math.sin(a[1])
    quarter = math.pi / 2
    crest = math.floor((a[1] - quarter) / (2 * math.pi)) >= math.ceil(
        (a[0] - quarter) / (2 * math.pi)
    )
    trough = math.floor((a[1] + quarter) / (2 * math.pi)) >= math.ceil(
        (a[0] + quarter) / (2 * math.pi)
    )
    return (-1.0 if trough else min(ends)), (1.0 if crest else max(ends))


def cos(a: Interval) -> Interval:
    """Cosine."""
    return sin((a[0] + math.pi / 2, a[1] + math.pi / 2))


def tan(a: Interval) -> Interval:
    """Tangent."""
    return mul(sin(a), power(cos(a), -1))


def smaller(a: Interval, b: Interval) -> Interval:
    """The smaller of the two."""
    return min(a[0], b[0]), min(a[1], b[1])


def larger(a: Interval, b: Interval) -> Interval:
    """The larger of the two."""
    return max(a[0], b[0]), max(a[1], b[1])


def magnitude(a: Interval) -> Interval:
    """|a|."""
    return max(a[0], -a[1], 0.0), max(-a[0], a[1])


def sign(a: Interval) -> Interval:
    """-1, 0 or 1."""
    return float((a[0] > 0) - (a[0] < 0)), float((a[1] > 0) - (a[1] < 0))


def heaviside(a: Interval) -> Interval:
    """0 to 1."""
    return float(a[0] > 0), float(a[1] >= 0)


def floor(a: Interval) -> Interval:
    """The whole numbers below."""
    return _rising(math.floor, a, -math.inf, math.inf)
