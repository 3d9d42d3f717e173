"""OUTPUT:PARAMETER,... of a scene -> of what derivatives are taken, and by what."""

from __future__ import annotations

from collections.abc import Sequence

from .. import names
from ..model.selection import listed, select
from .variables import Variable

NOT_DIFFERENTIATED = (names.RESIDUAL, names.ERROR, names.STEPS, *names.COUNTS)


def differentiated(
    variables: Sequence[Variable], asked: Sequence[str], problems: list[str]
) -> list[tuple[Variable, Variable]]:
    """Each output with a parameter or start value by which its derivative is asked for, by these in order.

    What names nothing is added to `problems`.
    """
    of = {v.name: v for v in variables if _is_differentiable(v)}
    others = {v.name for v in variables} - of.keys()
    by = {v.name: v for v in variables if v.role in ("parameter", "start")}
    pairs: set[tuple[str, str]] = set()
    for text in asked:
        outputs, _, numbers = text.partition(":")
        wanted = listed(outputs)
        problems += [
            f"sensitivities: {name!r} is not differentiated: expected an output of the motion or of its "
            "events, or an extreme of one, but no residual or count, and no energy that frictions dissipate"
            for name in wanted
            if name in others
        ]
        known = [name for name in wanted if name not in others]
        rows = select(known, list(of), "sensitivities: the output", problems)
        rows = tuple(row for row in rows if _is_meant(row, known))
        columns = select(
            listed(numbers), list(by), "sensitivities: the parameter or start value", problems
        )
        pairs |= {(row, column) for row in rows for column in columns}
    rows_of = {name: k for k, name in enumerate(of)}
    columns_of = {name: k for k, name in enumerate(by)}
    ordered = sorted(pairs, key=lambda pair: (columns_of[pair[1]], rows_of[pair[0]]))
    return [(of[a], by[b]) for a, b in ordered]


def named(asked: Sequence[str]) -> set[str]:
    """The parameters and start values that are named, not meant by a pattern."""
    found = {number for text in asked for number in listed(text.partition(":")[2])}
    return {number for number in found if not {"*", "?"} & set(number)}


def _is_meant(output: str, asked: Sequence[str]) -> bool:
    """Not the time of an extreme by a pattern of everything: at a start from rest it has no derivative."""
    if not names.read(output).quantity.endswith("_time"):
        return True
    return bool(select([text for text in asked if text.startswith(names.PEAK)], [output], "", []))


def _is_differentiable(v: Variable) -> bool:
    """What is reported of the motion, and of its events; and their extremes."""
    if v.measured is not None:
        return _is_differentiable(v.measured)
    if v.of.quantity == names.DISSIPATED and v.variability == "continuous":
        return False  # the work of frictions is summed up, not integrated
    calculated = v.role in ("output", "start") and v.kind == "Real"
    return calculated and v.of.quantity not in NOT_DIFFERENTIATED
