"""What came of a sweep, for eyes: a row a run, or a line a quantity, and why runs were refused."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.markup import escape

from ..model.units import for_reading
from ..page.table import new_table, print_whole
from ..studio.sweep.results import INFINITE, happened, numbers, one_by_one, varied
from .terminal import console, say

SHOWN = 5  # reasons in the summary
FEW = 20  # runs that are shown each by itself
BROAD = 14  # letters of a name in a heading; a longer one is broken at its dots
NUMBER = re.compile(r"[-+]?\d[\d.]*(?:e[-+]?\d+)?")


def print_sweep(found: Any) -> None:
    """A row a run where there are few, else a line a kept quantity; why some were refused, which start values
    were moved."""
    runs = one_by_one(found)
    status = runs["status"].values
    refused = int((status != "ok").sum())
    title = f"{Path(found.attrs['fmu']).stem}: {len(status)} runs, {refused} refused"
    names = numbers(found)
    say(title)
    if len(status) > FEW or not names:
        for name in names:
            say(f"  {name}: {_range(runs, name, refused)}")
    else:
        _print_runs(runs, names, refused > 0)
    _print_reasons([str(r) for r in runs["reason"].values if r], "refused")
    _print_reasons([str(r) for r in runs["moved"].values if r], "begin elsewhere")


def _print_runs(runs: Any, names: Sequence[str], refused: bool) -> None:
    """What varied and what was kept, a row a run; `refused`: with the status of each."""
    causes = varied(runs)
    headings = [f"{_broken(n)}\n{escape(_unit(runs, n, True))}".rstrip() for n in causes]
    for name in names:
        of, _, how = name.rpartition(":")
        headings.append(f"{_broken(of)}\n{how} {escape(_unit(runs, name, True))}".rstrip())
    drawn = new_table("", *headings, *(["status"] if refused else []))
    columns = [runs[n].values for n in causes] + [happened(runs, n) for n in names]
    status = runs["status"].values
    for k in range(len(status)):
        good = status[k] == "ok"
        cells = [_number(c[k]) for c in columns[: len(causes)]]
        cells += [_number(c[k], "never") if good else "" for c in columns[len(causes) :]]
        drawn.add_row(*cells, *([str(status[k])] if refused else []))
    print_whole(console, drawn)


def _broken(name: str) -> str:
    """A name that makes no column wide by itself, for a heading."""
    return escape("\n".join(re.findall(r"[^.]+\.?", name)) if len(name) > BROAD else name)


def _range(runs: Any, name: str, refused: int) -> str:
    """From the least to the largest value, of the runs in which there is one."""
    values = happened(runs, name)
    finite = values[np.isfinite(values) & (np.abs(values) < INFINITE)]
    never = int(np.isnan(values).sum()) - refused
    notes = [f"never in {never} runs"] if never else []
    if endless := int((np.abs(values) >= INFINITE).sum()):
        notes.append(f"infinite in {endless} runs")
    if not len(finite):
        return ", ".join(notes) or "nothing"
    unit = _unit(runs, name, False)
    text = f"{_number(finite.min())} ... {_number(finite.max())} {unit}".rstrip()
    return ", ".join([text, *notes])


def _unit(runs: Any, name: str, bracketed: bool) -> str:
    unit = for_reading(str(runs[name].attrs.get("units", "")))
    return f"[{unit}]" if unit and bracketed else unit


def _number(value: float, none: str = "") -> str:
    """Six digits; of what has no value, `none`."""
    if np.isnan(value):
        return none
    return "infinite" if abs(value) >= INFINITE else f"{value:.6g}"


def _print_reasons(texts: Sequence[str], what: str) -> None:
    """Those that differ in numbers are one."""
    first = {NUMBER.sub("#", r): r for r in reversed(texts)}
    reasons = Counter(NUMBER.sub("#", r) for r in texts)
    for kind, count in reasons.most_common(SHOWN):
        text = first[kind] if count == 1 else f"{first[kind]}, and {count - 1} like it"
        say(f"  {count} {what}: {text}")
    if len(reasons) > SHOWN:
        rest = sum(reasons.values()) - sum(c for _, c in reasons.most_common(SHOWN))
        say(f"  {rest} {what} for {len(reasons) - SHOWN} other reasons")
