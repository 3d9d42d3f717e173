"""Contacts of bodies: a point or a wheel on a line; in space a point or a ball on a plane.

A point on a curve of the first marker's frame, c(s) with a parameter s that is a coordinate without mass:

    f_k = e_k . (p2 - p1) - c_k(s) = 0 ,   whose multipliers F obey   0 = -F . c'(s)

the equation of s: the force across the curve is what is left.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp
from sympy.physics.vector import dynamicsymbols

from ..model import elements
from ..model.elements import TIME, Expr, Friction, Nonholonomic
from ..model.picture import Track
from ..model.reactions import multiplier, norm
from ..model.spline import Spline
from .body import Marker, Number
from .draft import Curve, Draft
from .guess import Guess, Reach
from .joints import Touch, model_number, places
from .motion import Timed, between, length, product


@dataclass(frozen=True, eq=False)
class Contact:
    """The second marker (with `radius` [m]: a wheel, in space a ball about it) stays on the y side of the
    first marker's x axis, in space on the z side of its plane xy.

    The multiplier of NAME.y (NAME.z) [N] pushes and never pulls; `restitution` is Newton's.  With `friction`
    (static, or static and kinetic coefficient) NAME.x (and NAME.y) [N] is the force along the line (in the
    plane): it sticks or slips by Coulomb's law.
    """

    name: str
    first: Marker
    second: Marker
    radius: Number = 0.0
    friction: Number | Sequence[Number] | None = None
    restitution: Number = 0.0

    def add(self, draft: Draft) -> None:
        """A contact, and the friction of the velocity along the line while it is closed."""
        name = self.name
        a, b = places(draft, self)
        r = draft.number(self.radius, f"{name}.radius", "m", f"radius of {name}")
        e = draft.number(self.restitution, f"{name}.restitution", "1", f"restitution of {name}")
        touch = Touch(draft, name, a, b, r)
        text = f"{name} touches"
        draft.constraints.append(elements.Contact(touch.normal, touch.gap.value, text, e))
        if self.friction is None:
            touch.transmit(draft.wrench(name), [])
            return
        coefficients = draft.coefficients(self.friction, name)
        rows = list(touch.slips)
        draft.constraints += [
            *(
                elements.Nonholonomic(row, slip, f"{name} does not slip", while_closed=touch.normal)
                for row, slip in touch.slips.items()
            ),
            elements.Friction(name, rows, multiplier(touch.normal), *coefficients),
        ]
        touch.transmit(draft.wrench(name), rows)


PLACES = 65  # along the curve, at which it is tried where the point may begin


@dataclass(frozen=True, eq=False)
class PointOnCurve:
    """The second marker's origin stays on a curve of the first marker's frame.

    `curve` is a Track, whose points are expressions of its symbol, or in the plane a Spline, y(x).  The
    symbol is the coordinate NAME.curve.s in `unit` (of a Spline its x).  Expressions that hold numbers alone
    are taken times the parameter NAME.size = 1 m.  The multipliers of NAME.x, NAME.y, NAME.z [N] are the
    force that the second body receives, across the curve; `friction` (a coefficient, or the static and the
    kinetic one) rubs along it with the norm of these.
    """

    name: str
    first: Marker
    second: Marker
    curve: Track | Spline
    unit: str = "1"
    friction: Number | Sequence[Number] | None = None

    def along(self) -> tuple[Sequence[Expr], Expr, tuple[Expr, Expr], str]:
        """The points, their symbol, its first and last value, its unit."""
        curve = self.curve
        if isinstance(curve, Track):
            return curve.point, curve.over, (curve.first, curve.last), self.unit
        s = sp.Symbol(f"{self.name}.x", real=True)
        ends = sp.Float(curve.x[0], 17), sp.Float(curve.x[-1], 17)
        return (s, curve(s)), s, ends, curve.x_unit.name

    def lengths(self, draft: Draft) -> list[Expr]:
        """The points [m]."""
        points, over, _, _ = self.along()
        free = {x for e in points for x in sp.sympify(e).free_symbols}
        if free - {over} or isinstance(self.curve, Spline):
            return [draft.number(e, f"{self.name}.point", "m") for e in points]
        text = f"size of the curve of {self.name}"
        size = draft.number(1.0, f"{self.name}.size", "m", text, positive=True)
        return [size * e for e in points]

    def add(self, draft: Draft) -> None:
        """A row for each component, and friction along the curve."""
        a, b = places(draft, self)
        _, over, _, unit = self.along()
        s = dynamicsymbols(f"{self.name}.curve.s")
        rate, force = s.diff(TIME), draft.wrench(self.name).force
        mass = b.motion.mass + a.motion.mass
        points = [sp.sympify(e).xreplace({over: s}) for e in self.lengths(draft)]
        draft.curves[s] = Curve(unit, mass, f"where {self.name} is on its curve")
        slopes, ways = [c.diff(s) for c in points], []
        for k, x in enumerate(draft.components):
            d = product(a.axes[k], between(a, b))
            ways.append(d.rate)
            bend = slopes[k].diff(s) * rate**2
            f = Timed(d.value - points[k], d.rate - slopes[k] * rate, d.bend - bend)
            draft.hold(f"{self.name}.{x}", f, f"{self.name} stays on its curve, {x}")
            force[k] += multiplier(f"{self.name}.{x}")
        if self.friction is None:
            return
        size, row = length((*slopes, sp.S.Zero)[:3]), f"{self.name}.along"
        t = [slope / size for slope in slopes]
        slip = sp.Add(*(e * way for e, way in zip(t, ways, strict=True)))
        normal = norm(*(multiplier(f"{self.name}.{x}") for x in draft.components))
        coefficients = draft.coefficients(self.friction, self.name)
        draft.constraints += [
            Nonholonomic(row, slip, f"{self.name} does not slide"),
            Friction(self.name, [row], normal, *coefficients),
        ]
        for k, e in enumerate(t):
            force[k] += e * multiplier(row)

    def relative_pose(self, guess: Guess) -> Reach:
        """The second marker on the curve, where the start says or in its middle."""
        places, values = self.tried(guess)
        given = guess.given.get(f"{self.name}.curve.s", places[len(places) // 2])
        return Reach(values[int(np.argmin(np.abs(places - given)))].tolist())

    def tried(self, guess: Guess) -> tuple[Any, Any]:
        """Values of the parameter (PLACES) and the points there (PLACES, 3) [m]."""
        _, over, ends, _ = self.along()
        first, last = (model_number(guess.model, end) for end in ends)
        values = np.linspace(first, last, PLACES)
        known = {p.symbol: sp.Float(p.value, 17) for p in guess.model.parameters}
        points = [sp.sympify(e).xreplace(known) for e in self.lengths(guess.draft)]
        found = np.zeros((PLACES, 3))
        for k, e in enumerate(points):
            with np.errstate(all="ignore"):
                found[:, k] = sp.lambdify(over, e, "numpy")(values)
        return values, np.nan_to_num(found, nan=0.0, posinf=0.0, neginf=0.0)
