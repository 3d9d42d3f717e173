"""Where no linear system holds on all sides of a state: frictions that slide, contacts about to change."""

from __future__ import annotations

import numpy as np

from ... import names
from ...errors import SimulationError
from .exchange import Exchange

GRAZES = 1e-9  # part of what a multiplier or a gap may be, that is none
TOUCHES = 1e-9  # m/s: a slip that is none


def check_sliding(ex: Exchange) -> None:
    """Raises SimulationError where a friction slides."""
    slips = [n for n in ex.rules if names.read(n).quantity == names.SLIP]
    forces = [names.name(names.MULTIPLIER, names.read(n).constraint) for n in slips]
    forces = [n if n in ex.rules else "" for n in forces]
    sticks = [n for n in ex.rules if names.read(n).quantity == names.STICKS]
    loose = [
        names.read(n).constraint for n, on in zip(sticks, ex.read(sticks), strict=True) if not on
    ]
    if not loose:
        return
    contacts = [n for n in ex.rules if names.read(n).quantity == names.CONTACT]
    alone = len(loose) == len(sticks) or bool(ex.read(contacts).all())  # no other row can be meant
    for n, force, slip in zip(slips, forces, ex.read(slips), strict=True):
        if force and (alone or abs(slip) > TOUCHES) and ex.read([force])[0] != 0:
            raise SimulationError(
                f"friction {' or '.join(loose)} slides ({n} = {slip:.6g}): its force has a kink where the "
                "slip stops, and no linear system holds across it: linearize where it sticks, or a scene in "
                "which it does (--frictions '')"
            )


def check_contacts(ex: Exchange) -> None:
    """Raises SimulationError where a contact would open or close, or is about to."""
    told = [n for n in ex.rules if names.read(n).quantity == names.CONTACT]
    closed = ex.read(told)
    of = [names.read(n).constraint for n in told]
    forces = [names.name(names.MULTIPLIER, n) for n in of]
    gaps = [names.name(names.RESIDUAL, n) for n in of]
    known = [n for n in ex.rules if names.read(n).quantity == names.MULTIPLIER]
    largest = float(np.abs(ex.read(known)).max(initial=0.0))
    wide = float(ex.size[ex.coordinate].max(initial=1.0))
    told_of = zip(of, closed, forces, ex.read(forces), gaps, ex.read(gaps), strict=True)
    for n, on, named, force, gap_named, gap in told_of:
        if on and force < -GRAZES * largest:
            raise SimulationError(
                f"contact {n!r} would have to pull ({named} = {force:.6g}): there is no such state with "
                "it closed: start where it is open, or press it on"
            )
        if (on and force <= GRAZES * largest) or (not on and abs(gap) <= GRAZES * wide):
            what = f"{named} = {force:.6g}" if on else f"{gap_named} = {gap:.6g}"
            raise SimulationError(
                f"contact {n!r} grazes ({what}): a little displacement opens or closes it, and no linear "
                "system holds on both sides: choose a state where it presses, or is apart"
            )
        if not on and gap < 0:
            raise SimulationError(
                f"contact {n!r} would be passed through ({gap_named} = {gap:.6g}): there is no such "
                "state with it open: start where it is closed"
            )
    sticks = [n for n in ex.rules if names.read(n).quantity == names.STICKS]
    for n, on in zip(sticks, ex.read(sticks), strict=True):
        margin = names.name(names.MARGIN, names.read(n).constraint)
        if on and margin in ex.rules and (left := ex.read([margin])[0]) < 0:
            raise SimulationError(
                f"friction {names.read(n).constraint!r} would slip ({margin} = {left:.6g}): there is no such "
                "state in which it sticks: start nearer to one, or raise its coefficient"
            )
