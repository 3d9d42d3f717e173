"""Model exchange: an importer's own integrator has to come to the motion of the co-simulation.

fmpy's CVODE at TOLERANCES[0] moves the state between the events that it finds by the indicators; coordinates,
velocities, lambda and departures are those of the default experiment at REACHED, about what a multistep
method holds that knows no constraints and is started anew after each event.  Where it does not hold that, it
is asked again, at TOLERANCES[1]: its own error, unlike one of the FMU's derivatives, then goes away.
"""

from __future__ import annotations

from dataclasses import replace

from ...fmu.exchange import by_fmpy
from ...fmu.session import RefusalError
from .bench import Bench, Finding
from .judge import Check
from .player import Run, table
from .runs import departures

TOLERANCES, REACHED = (1e-9, 1e-11), 1e-7
POINTS = 40


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
    names, step = [v.name for v in facts.outputs], facts.stop_time / POINTS
    kind, stop = "ModelExchange", facts.stop_time
    run = by_fmpy(bench.folder, facts.description, stop, step, tolerance, read=names, kind=kind)
    bench.session.renew()  # fmpy's logger is one a process
    if run.refusal is not None:
        raise RefusalError(kind, run.refusal.status, run.refusal.message)
    found = run.rows
    rows = table(facts, len(found))
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
