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

    `made_of` are the integrators behind it where it is not one itself; `remark` is what the description of
    `solver.method` says of it.
    """

    name: str
    number: int
    remark: str = ""
    fixed_step: bool = False
    native_only: bool = False
    made_of: tuple[str, ...] = ()


MENU = (
    Method("auto", 1, "dop853, but radau5 where it is stiff", made_of=("dop853", "radau5")),
    Method("dop853", 2),
    Method("rk4", 3, "fixed step", fixed_step=True, native_only=True),
    Method("radau5", 4, "stiff"),
    Method("rattle", 5, "fixed step", fixed_step=True, native_only=True),
)
INSTEAD = {  # SciPy's names, and a method that was offered once -> the one to take
    **dict.fromkeys(("dopri5", "RK23", "RK45", "DOP853"), "dop853"),
    **dict.fromkeys(("Radau", "BDF"), "radau5"),
    "LSODA": "auto",
}
METHODS = tuple(m.name for m in MENU)
NUMBERS = {m.name: m.number for m in MENU}
IN_PYTHON = tuple(m.name for m in MENU if not m.native_only)
INTEGRATORS = tuple(m.name for m in MENU if not m.made_of)
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
