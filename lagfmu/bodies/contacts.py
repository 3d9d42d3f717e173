"""Contacts of bodies: a point or a wheel on a line; in space a point or a ball on a plane."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..model import elements
from ..model.reactions import multiplier
from .body import Marker, Number
from .draft import Draft
from .joints import Touch, places


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
