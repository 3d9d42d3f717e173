"""Contacts of bodies: a point or a wheel on a line, with friction or without."""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from ..model import elements
from ..model.reactions import multiplier
from .body import Marker, Number
from .draft import Draft
from .joints import places, rolling


@dataclass(frozen=True, eq=False)
class Contact:
    """The second marker (with `radius` [m]: a wheel about it) stays above the x axis of the first.

    NAME.y [N] pushes and never pulls; `restitution` is Newton's.  With `friction` (static, or static and
    kinetic coefficient) NAME.x [N] is the force along the line: it sticks or slips by Coulomb's law.
    """

    name: str
    first: Marker
    second: Marker
    radius: Number = 0.0
    friction: Number | tuple[Number, Number] | None = None
    restitution: Number = 0.0

    def add(self, draft: Draft) -> None:
        """A contact, and the friction of the velocity along the line while it is closed."""
        name = self.name
        a, b = places(draft, self)
        r = draft.number(self.radius, f"{name}.radius", "m", f"radius of {name}")
        e = draft.number(self.restitution, f"{name}.restitution", "1", f"restitution of {name}")
        gap, slip = rolling(a, b, r)
        closed, row = f"{name}.y", f"{name}.x"
        draft.constraints.append(elements.Contact(closed, gap, f"{name} touches the line", e))
        wrench = draft.wrench(name)
        wrench.force[1] += multiplier(closed)
        if self.friction is None:
            return
        given = self.friction if isinstance(self.friction, tuple) else (self.friction,)
        words = ("friction",) if len(given) == 1 else ("static", "kinetic")
        coefficients = [
            draft.number(mu, f"{name}.{word}", "1", f"coefficient of friction of {name}, {word}")
            for mu, word in zip(given, words, strict=True)
        ]
        text = f"{name} does not slip"
        draft.constraints += [
            elements.Nonholonomic(row, slip, text, while_closed=closed),
            elements.Friction(name, [row], multiplier(closed), *coefficients),
        ]
        wrench.force[0] += multiplier(row)
        wrench.torque[2] += r * multiplier(row) if r != 0 else sp.S.Zero
