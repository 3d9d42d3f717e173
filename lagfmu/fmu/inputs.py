"""Tables of inputs over time: a structured array with 'time' [s] and a field an input."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import LagfmuWarning, SettingError
from ..interface.variables import problems_of
from ..model.rule import Rule, missing
from ..names import rate_of
from .read import Trajectory


def check_inputs(table: Trajectory | None, rules: Mapping[str, Rule], known: Sequence[str]) -> None:
    """A table of inputs, if there is one, has rising times and columns of those that are `known`, with values
    that the rules allow.  Raises SettingError."""
    if table is None:
        return
    found = table.dtype.names or ()
    problems = [missing(n, known, "is no input") for n in found if n != "time" and n not in known]
    if "time" not in found:
        problems.append("there is no column 'time'")
    elif not (np.isfinite(table["time"]).all() and (np.diff(table["time"]) >= 0).all()):
        problems.append("the times are not sorted, expected rising seconds")
    for end in (np.min, np.max):
        values = {n: end(table[n]) for n in found if n in known and len(table)}
        problems += [text for text in problems_of(rules, values) if text not in problems]
    if problems:
        raise SettingError(f"inputs: {'; '.join(problems)}")


def warn_of_rates(table: Trajectory | None, rules: Mapping[str, Rule]) -> None:
    """Warns of motions in a table whose rates it leaves out, and which move otherwise than these begin: for
    runs whose FMU nobody hears."""
    if table is None:
        return
    fields, apart = table.dtype.names or (), np.diff(table["time"])
    left = {}
    for n in fields:
        rate = rate_of(n)
        if n != "time" and rate in rules and rate not in fields:
            slopes = np.diff(table[n])[apart > 0] / apart[apart > 0]
            if not np.allclose(slopes, float(rules[rate].start or 0.0)):
                left[n] = rate
    if left:
        warnings.warn(
            f"inputs: {', '.join(left)} moves, and the table leaves out {', '.join(left.values())}, so that "
            "the forces of constraint are wrong: add these columns, or build the FMU with "
            'Input(..., rates="estimated")',
            LagfmuWarning,
            stacklevel=3,
        )


def columns_at(
    table: Trajectory | None, times: NDArray[np.float64], rules: Mapping[str, Rule]
) -> dict[str, list[float]]:
    """The inputs at these times: interpolated linearly, held where they are no Reals; at a jump (two rows of
    one time) the value after it."""
    if table is None:
        return {}
    at = np.clip(np.searchsorted(table["time"], times, "right") - 1, 0, None)
    return {
        n: (
            np.interp(times, table["time"], table[n]) if rules[n].kind == "Real" else table[n][at]
        ).tolist()
        for n in table.dtype.names or ()
        if n != "time"
    }


def jumps(table: Trajectory | None, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """The times between the first and the last of `times` at which inputs jump, and that are none of them."""
    if table is None or len(table) < 2:
        return np.empty(0)
    found = np.unique(table["time"][:-1][np.diff(table["time"]) == 0])
    found = found[(found > times[0]) & (found < times[-1])]
    near = np.abs(found[:, None] - times[None, :]).min(axis=1, initial=np.inf)
    apart: NDArray[np.float64] = found[near > 1e-9 * np.abs(found)]
    return apart
