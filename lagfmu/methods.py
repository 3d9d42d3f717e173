"""The menu of integration methods: the one list of their names, numbers and kinds.  Imports nothing.

`solver.method` offers them by name; its numbers are given once for ever, so that an FMU built later means
the same by them: a method that goes leaves a gap.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass


@dataclass(frozen=True)
class Method:
    """One entry of the menu.

    `made_of` are the integrators behind it where it is not one itself, the explicit one first; `remark`:
    what the description of `solver.method` says of it; `use`: what it is for, as docs/accuracy.md says it;
    `differentiated`: a run by it has derivatives; `tangents`: it needs the equations' own; `separable`: it
    steps equations of position constraints alone, with a constant mass matrix and forces without velocities;
    `colour`, `marker`: in a figure.
    """

    name: str
    number: int
    remark: str = ""
    use: str = ""
    fixed_step: bool = False
    native_only: bool = False
    made_of: tuple[str, ...] = ()
    explicit: bool = False
    differentiated: bool = False
    tangents: bool = False
    separable: bool = False
    colour: str = ""
    marker: str = ""


MENU = (
    Method(
        *("auto", 1, "dop853, but radau where it is stiff"),
        "`dop853`, and `radau` while stiffness holds it back; the log says when. Python target: `dop853`",
        made_of=("dop853", "radau"),
    ),
    Method(
        *("dop853", 2, "", "almost everything"),
        explicit=True,
        differentiated=True,
        colour="#0b6e99",
        marker="o",
    ),
    Method(
        *("rk4", 3, "fixed step", "a constant cost for each step, without error control"),
        fixed_step=True,
        native_only=True,
        explicit=True,
        differentiated=True,
        colour="#0f7b6c",
        marker="D",
    ),
    Method(
        *("radau", 4, "stiff", "stiff springs and dampers: order 9; Python target: 5"),
        differentiated=True,
        tangents=True,
        colour="#6940a5",
        marker="^",
    ),
    Method(
        *("rattle", 5, "fixed step"),
        "long horizons: no drift of the energy. Fixed steps, symmetric, order 6; constant M and forces of "
        "the position only",
        fixed_step=True,
        native_only=True,
        separable=True,
        colour="#ad1a72",
        marker="v",
    ),
)
INSTEAD = {  # SciPy's names, and a method that was offered once -> the one to take
    **dict.fromkeys(("dopri5", "RK23", "RK45", "DOP853"), "dop853"),
    **dict.fromkeys(("radau5", "Radau", "BDF"), "radau"),
    "LSODA": "auto",
}
METHODS = tuple(m.name for m in MENU)
NUMBERS = {m.name: m.number for m in MENU}
IN_PYTHON = tuple(m.name for m in MENU if not m.native_only)
INTEGRATORS = tuple(m.name for m in MENU if not m.made_of)
EXPLICIT = tuple(m.name for m in MENU if m.explicit)
DIFFERENTIATED = tuple(m.name for m in MENU if m.differentiated)
SEPARABLE = tuple(m.name for m in MENU if m.separable)
WITH_TANGENTS = tuple(m.name for m in MENU if m.tangents)
AUTO, UNLESS_STIFF, STIFF = MENU[0].name, *MENU[0].made_of
FIXED_STEP = tuple(m.name for m in MENU if m.fixed_step)


def integrators(methods: Collection[str]) -> tuple[str, ...]:
    """The integrators behind `methods`, in the menu's order."""
    wanted = {part for m in MENU if m.name in methods for part in m.made_of or (m.name,)}
    return tuple(m for m in INTEGRATORS if m in wanted)


def described(methods: Collection[str]) -> str:
    """The description of `solver.method` where `methods` are offered."""
    found = [m.name + (f" ({m.remark})" if m.remark else "") for m in MENU if m.name in methods]
    *most, last = found
    return f"integrator: {', '.join(most)} or {last}" if most else f"integrator: {last}"


def unknown(method: object, offered: Collection[str] = METHODS) -> str:
    """What to say of a method that is none of those `offered`."""
    text = f"method {method!r} is unknown, expected one of {', '.join(offered)}"
    instead = INSTEAD.get(str(method))
    return text if instead is None or instead not in offered else f"{text}: take {instead}"
