"""What goes on from one call to the next: input derivatives, what a saved state holds of the experiment,
values that are read and then set in initialization mode."""

from __future__ import annotations

from functools import partial

from lagfmu.testing import (
    EPS,
    Bench,
    Check,
    Facts,
    Finding,
    Probe,
    RefusalError,
    Run,
    Session,
    differ,
)
from lagfmu.testing import table_of_run as table

FAMILY = "calls"
STEPS = (0.11, 0.23, 0.07, 0.31, 0.05, 0.23)  # parts of the default experiment
SAVED = 2  # steps after which the state is handed on


def probes(facts: Facts, quick: bool) -> list[Probe]:
    """The probes of this family."""
    found = [
        Probe(FAMILY, "read, then set, in initialization mode", _initialization, False),
        Probe(FAMILY, "the stop time belongs to a saved state", _stop_time, False),
    ]
    if facts.description.coSimulation.canInterpolateInputs:
        inputs = [i.name for i in facts.inputs if i.name not in facts.motions]
        for name in inputs[:1] if quick else inputs:
            text = f"{name} goes on by its derivatives"
            found.append(Probe(FAMILY, text, partial(_goes_on, name), False))
    return found


def _initialization(bench: Bench) -> Finding:
    """What was read before does not outlive what is set: as if it had been set at once."""
    others = [
        {p.name: factor * p.start for p in bench.facts.parameters if p.allows(factor * p.start)}
        for factor in (1.1, 0.8)
    ]
    ordinary = {p.name: p.start for p in bench.facts.parameters}
    h, checks = bench.facts.step_size, []
    with bench.another("at once") as one, bench.another("one after another") as two:
        for values in (*others, ordinary):
            one.begin(values, None)
            right = one.read()
            two.prepare({}, None)
            for before in (others[1], others[0], values):
                two.read()
                two.give(before)
            shown = two.read()
            two.call("exitInitializationMode")
            checks.append(differ(right, shown, "shown:"))
            checks.append(differ(right, two.read(), "begun:"))
            for each in (one, two):
                each.step(h)
            checks.append(differ(one.read(), two.read(), "after a step:"))
    return Finding(tuple(checks))


def _passes(session: Session, size: float) -> bool:
    """True if it steps so far; False if it names the stop time.  Raises RefusalError."""
    try:
        session.step(size)
    except RefusalError as error:
        if "stop time" not in error.message:
            raise
        return False
    return True


def _stop_time(bench: Bench) -> Finding:
    """A state goes past the stop time of the experiment that it was saved in nowhere, and one of an endless
    experiment goes everywhere past it; either with the same bits as where it was saved."""
    h = bench.facts.step_size
    passed, checks = {}, []
    for stop in (2 * h, None):
        with bench.another("saves") as one, bench.another("takes over") as two:
            one.begin({}, None, stop)
            one.step(h)
            two.begin({}, None, None if stop else 2 * h)
            one.hand(two)
            for each in (one, two):
                each.step(h)
            checks.append(differ(one.read(), two.read(), "same bits up to it:"))
            passed[stop] = _passes(two, h)
            if stop is None:
                one.step(h)
                checks.append(differ(one.read(), two.read(), "same bits behind it:"))
    return Finding(
        (
            Check("stops where it was to stop", float(passed[2 * h]), 0.5),
            Check("goes on where nothing stops it", float(not passed[None]), 0.5),
            *checks,
        )
    )


def _polynomial(bench: Bench, name: str, elapsed: float) -> tuple[float, float, float]:
    """The input and its two derivatives: of the order of its start, or of one unit."""
    stop = bench.facts.stop_time
    (start,) = (i.start for i in bench.facts.inputs if i.name == name)
    first, second = 0.7 / stop, 1.9 / stop**2
    return (
        start + first * elapsed + second * elapsed**2 / 2,
        first + second * elapsed,
        second,
    )


def _push(session: Session, name: str, values: tuple[float, float, float]) -> None:
    value, first, second = values
    references = session.references([name, name])
    session.give({name: value})
    session.call("setRealInputDerivatives", references, [1, 2], [first, second])


def _goes_on(name: str, bench: Bench) -> Finding:
    """An input that was set once with two derivatives goes on by them over several steps, through a saved
    state that another instance takes over at another time; as if it were set anew at each point."""
    facts, begin = bench.facts, 0.1 * bench.facts.stop_time
    checks, runs = [], []
    for anew in (True, False):
        rows, fed = table(facts, len(STEPS)), bench.facts.inputs
        with bench.another("first") as one, bench.another("second") as two:
            one.begin({}, None)
            one.step(begin)
            _push(one, name, _polynomial(bench, name, 0.0))
            for k, part in enumerate(STEPS):
                if k == SAVED and not anew:
                    two.begin({}, None)
                    two.step(0.5 * begin)
                    one.hand(two)
                    one, two = two, one
                one.step(part * facts.stop_time)
                values = _polynomial(bench, name, one.time - begin)
                seen = one.read(one.inputs)
                size = max(abs(x) for x in (values[0], 1.0))
                checks.append(
                    Check(f"{name} itself", abs(seen[name] - values[0]), 100 * EPS * size)
                )
                if anew:
                    _push(one, name, values)
                rows[k]["time"] = one.time
                for column, value in (one.read() | seen).items():
                    rows[column][k] = value
        known = {s.name: s.start for s in (*facts.parameters, *facts.starts, *fed)}
        runs.append(Run(rows, known, facts.tolerance, None, True))
    renewed, carried = runs
    growth = bench.amplified({}, bench.ordinary)[-1] + 0 * renewed.rows["time"]
    checks += bench.agreement(renewed, carried, growth, "as if set anew")
    return Finding((*checks, *bench.checks(carried)))
