"""The motion of a bench's default experiment by other roads: from a saved state, by an importer's integrator.

Model exchange: fmpy's CVODE at TOLERANCES[0] moves the state between the events that it finds by the
indicators; coordinates, velocities, lambda and departures are those of the default experiment at REACHED,
about what a multistep method holds that knows no constraints and is started anew after each event.  Where
it does not hold that, it is asked again, at TOLERANCES[1]: its own error, unlike one of the FMU's
derivatives, then goes away.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi1 import FMICallException

from lagfmu.testing import (
    Bench,
    Check,
    Finding,
    RefusalError,
    Run,
    Session,
    departures,
    session_of,
)

PIECES = 7  # of a step that is repeated
TOLERANCES, REACHED = (1e-9, 1e-11), 1e-7
POINTS = 40


@contextlib.contextmanager
def another(bench: Bench, name: str = "another") -> Iterator[Session]:
    """A further instance."""
    one = session_of(bench.facts, bench.folder, name)
    try:
        yield one
    finally:
        one.close()


def differ(a: Mapping[str, Any], b: Mapping[str, Any], what: str) -> Check:
    """To the last bit; the first names of those that are not."""
    names = [n for n in a if a[n] != b[n]]
    return Check(what + "".join(f" {n}" for n in names[:3]), float(len(names)), 0.5)


def restore(session: Session, state: Any, time: float) -> None:
    """The session stands in a saved state, at `time` [s], again."""
    session.call("setFMUstate", state)
    session.time = time


def rolled_back(part: float, bench: Bench) -> Finding:
    """Save before a part of the default experiment, step across, restore: the same bits the same way, also
    from the state's bytes in another instance; in pieces within tolerance."""
    middle = part * bench.facts.stop_time
    h = min(5 * bench.facts.step_size, middle)
    begin, seen = middle - 0.4 * h, []
    with another(bench) as one, another(bench) as two:
        one.begin({}, None)
        one.step(begin)
        state = one.call("getFMUstate")
        for turn in range(2):
            if turn:
                restore(one, state, begin)
            seen.append(one.read())
            for _ in range(2):
                one.step(h)
                seen.append(one.read())
        two.begin({}, None)
        data = one.call("serializeFMUstate", state)
        restore(two, two.call("deSerializeFMUstate", data), begin)
        seen.append(two.read())
        two.step(h)
        seen.append(two.read())
        restore(one, state, begin)
        for _ in range(PIECES):
            one.step(h / PIECES)
        last = one.read()
        one.call("freeFMUstate", state)
    what = ("restored as it was:", "same bits when repeated:", "same bits after that:")
    checks = [differ(seen[k], seen[k + 3], text) for k, text in enumerate(what)]
    checks.append(differ(seen[0], seen[6], "as serialized:"))
    checks.append(differ(seen[1], seen[7], "same bits from the bytes:"))
    checks += _near(bench, seen[1], last, begin + h)
    return Finding(tuple(checks))


def _near(bench: Bench, right: dict[str, Any], other: dict[str, Any], time: float) -> list[Check]:
    """One step or seven: the same within what the problem makes of the tolerance."""
    one, two = (_end(bench, seen, time) for seen in (right, other))
    grown = np.interp([time], bench.ordinary.rows["time"], bench.amplification)
    checks = bench.agreement(one, two, grown, "in pieces", bench.facts.stop_time)
    return [*checks, *departures(bench, one, two, float(grown[0]))]


def _end(bench: Bench, seen: dict[str, Any], time: float) -> Run:
    """The default experiment's run, of one point alone."""
    rows = np.zeros(1, bench.ordinary.rows.dtype)
    for name, value in (seen | {"time": time}).items():
        rows[name][0] = value
    return replace(bench.ordinary, rows=rows)


def compared(bench: Bench) -> Finding:
    """The default experiment by an importer's integrator and by the FMU's own."""
    facts = bench.facts
    right = bench.run({}, bench.times(facts.stop_time, POINTS))
    if right.refusal is not None:
        raise right.refusal
    finding = _at(bench, right, TOLERANCES[0])
    if any(check.ratio > 1 for check in finding.checks):
        finding = _at(bench, right, TOLERANCES[1])
    return finding


def _at(bench: Bench, right: Run, tolerance: float) -> Finding:
    facts = bench.facts
    names = [v.name for v in facts.outputs]
    said: list[str] = []
    try:
        found = fmpy.simulate_fmu(
            str(bench.folder),
            validate=False,
            fmi_type="ModelExchange",
            model_description=facts.description,
            stop_time=facts.stop_time,
            output_interval=facts.stop_time / POINTS,
            relative_tolerance=tolerance,
            record_events=False,
            output=names,
            logger=lambda *told: said.append(told[-1].decode()) if told[-3] > 1 else None,
        )
    except FMICallException as error:
        raise RefusalError(error.function, error.status, "; ".join(said)) from None
    finally:
        bench.session.renew()  # fmpy's logger is one a process
    rows = np.zeros(len(found), right.rows.dtype)
    for name in rows.dtype.names or ():
        rows[name] = found[name] if name in names else right.rows[name][: len(found)]
    count = Check("points that were reached", float(len(right.rows) - len(rows)), 0.5)
    other = replace(right, rows=rows, tolerance=REACHED)
    growth = bench.amplification[-1] + 0 * right.rows["time"]
    checks = bench.agreement(right, other, growth, "as in co-simulation", facts.stop_time)
    note = "" if tolerance == TOLERANCES[0] else f"the importer's integrator at {tolerance:g}"
    return Finding(
        (count, *checks, *departures(bench, right, other, float(growth[-1]))), None, note
    )
