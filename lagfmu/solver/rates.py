"""The rates of prescribed motions: whether they belong to the motion.

Between points that belong to one motion

    u1 - u0 = h (u0' + u1')/2 - h^2 (u1'' - u0'')/12 + O(h^5) ,  u1' - u0' = h (u0'' + u1'')/2 + O(h^3)

(Euler and Maclaurin).
"""

from __future__ import annotations

from collections.abc import Sequence

ROUNDING = 1e-9


def half_connected(u: Sequence[float], went: Sequence[float], h: float) -> bool:
    """True where u has moved over the last step h and u' has not moved accordingly, or u' and not u''.

    By more than half of the step's own size.  `u` are u, u', u'' as they are set, `went` where the rates
    have carried them to.
    """
    a = went[2]
    v = went[1] - h * a
    x = went[0] - h * (v + h * a / 2)
    way, speed, size = u[0] - x, u[1] - v, abs(x) + abs(u[0])
    miss = abs(way - h * (v + u[1]) / 2 + h * h * (u[2] - a) / 12)
    if miss > ROUNDING * size and miss > (abs(way) + h * (abs(v) + abs(u[1])) / 2) / 2:
        return True
    miss = abs(speed - h * (a + u[2]) / 2)
    return h * miss > ROUNDING * size and miss > (abs(speed) + h * (abs(a) + abs(u[2])) / 2) / 2
