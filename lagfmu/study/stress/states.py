"""Rollback across events, serialized states, reset, and many instances interleaved."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ... import names
from ...fmu.session import RefusalError
from .bench import Bench, Finding
from .facts import Facts
from .judge import Check, differ
from .player import Player, clear, play, table
from .probe import Probe

FAMILY = "states"
PARTS = 7


def probes(facts: Facts, quick: bool) -> list[Probe]:
    """The probes of this family."""
    found = [
        Probe("rollback", f"across the departure from {c}", partial(_across, c), False)
        for c in facts.contacts
    ]
    for part in (0.5,) if quick else (0.0, 0.1, 0.35, 0.5, 0.8):
        name = f"at {part:g} of the default experiment"
        found.append(Probe("rollback", name, partial(_rollback, part), False))
    found.append(Probe("rollback", "bytes cut short, altered, of another", _corrupt))
    found.append(Probe("instances", "reset in the middle", _reset, False))
    count = 4 if quick else 20 if facts.target == "native" else 6
    name = f"{count} interleaved"
    found.append(Probe("instances", name, partial(_interleaved, count), False))
    return found


def _across(contact: str, bench: Bench) -> Finding:
    last = bench.ordinary.rows[-1]
    if last[names.name(names.DEPARTURES, contact)] == 0:
        return bench.judged(bench.ordinary, None, "no departure in the default experiment")
    return _window(bench, float(last[names.name(names.DEPARTURE_TIME, contact)]))


def _rollback(part: float, bench: Bench) -> Finding:
    return _window(bench, max(part, 1e-3) * bench.facts.stop_time)


def _window(bench: Bench, middle: float) -> Finding:
    """Save before, step across, restore: the same bits the same way, in pieces within tolerance."""
    facts = bench.facts
    h = min(5 * facts.step_size, middle)
    begin = middle - 0.4 * h
    with bench.another("rolled back") as one, bench.another("taken over") as two:
        one.begin({}, None)
        one.step(begin)
        before = one.read()
        state = one.save()
        one.step(h)
        right = one.read()
        one.step(h)
        beyond = one.read()
        one.restore(state, begin)
        checks = [differ(before, one.read(), "restored as it was:")]
        one.step(h)
        checks.append(differ(right, one.read(), "same bits when repeated:"))
        one.step(h)
        checks.append(differ(beyond, one.read(), "same bits after that:"))
        one.restore(state, begin)
        for _ in range(PARTS):
            one.step(h / PARTS)
        checks += _near(bench, right, one.read(), begin + h)
        two.begin({}, None)
        one.hand(two, state, begin)
        checks.append(differ(before, two.read(), "as serialized:"))
        two.step(h)
        checks.append(differ(right, two.read(), "same bits from the bytes:"))
        one.call("freeFMUstate", state)
    return Finding(tuple(checks), None, f"t = {middle:.6g} s")


def _near(bench: Bench, right: dict[str, Any], other: dict[str, Any], time: float) -> list[Check]:
    """One step or seven: the same within what the problem makes of the tolerance."""
    runs = []
    for seen in (right, other):
        rows = table(bench.facts, 1)
        for name, value in seen.items():
            rows[name][0] = value
        rows["time"] = time
        runs.append(rows)
    base = bench.ordinary
    one, two = (replace(base, rows=rows) for rows in runs)
    grown = np.interp(time, base.rows["time"], bench.amplification)
    checks = bench.agreement(one, two, np.array([grown]), "in pieces", bench.facts.stop_time)
    tolerance = 30 * base.tolerance * (1 + float(grown)) * time
    for c in bench.facts.contacts:
        count, at = names.name(names.DEPARTURES, c), names.name(names.DEPARTURE_TIME, c)
        checks.append(Check(f"{count} in pieces", abs(right[count] - other[count]), 0.5))
        if right[count] == other[count]:
            checks.append(Check(f"{at} in pieces", abs(right[at] - other[at]), tolerance))
    return checks


def _corrupt(bench: Bench) -> Finding:
    """Bytes that are no state are refused, when read or when set, and nothing changes."""
    refusal, checks = None, []
    for what in ("cut", "altered", "foreign"):
        with bench.another("corrupted") as one:
            one.begin({}, None)
            one.step(bench.facts.step_size)
            before = one.read()
            state = one.save()
            data = bytearray(one.call("serializeFMUstate", state))
            one.call("freeFMUstate", state)
            if what == "cut":
                data = data[: len(data) // 2]
            elif what == "altered":
                data[len(data) * 2 // 3] ^= 0x55
            else:
                data = bytearray(b"\x01" * len(data))
            try:
                one.restore(one.call("deSerializeFMUstate", bytes(data)), one.time)
                checks.append(Check(f"{what} bytes refused", 1.0, 0.5))
            except RefusalError as error:
                refusal = error if refusal is None or clear(refusal) else refusal
                if error.status != 4:
                    checks.append(differ(before, one.read(), f"as before, {what}:"))
    return Finding(tuple(checks), refusal)


def _reset(bench: Bench) -> Finding:
    """After a reset it is as new: same bits, also after another run with other parameters."""
    times = bench.times(bench.facts.stop_time, 10)
    other = {p.name: p.start * 1.1 for p in bench.facts.parameters if p.allows(p.start * 1.1)}
    with bench.another("fresh") as one:
        first = play(one, {}, times)
        play(one, other, times[:6])
        again = play(one, {}, times)
        checks = bench.checks(again)
        same = first.rows.tobytes() == again.rows.tobytes()
        checks.append(Check("same bits after a reset", float(not same), 0.5))
    return Finding(tuple(checks), again.refusal)


def _interleaved(count: int, bench: Bench) -> Finding:
    """Each with parameters of its own, stepped in turns: each as if it were alone."""
    facts = bench.facts
    values = []
    for k in range(count):
        wanted = {p.name: p.start * (1 + 0.01 * k) for p in facts.parameters}
        values.append(
            {p.name: wanted[p.name] for p in facts.parameters if p.allows(wanted[p.name])}
        )
    times = bench.times(facts.stop_time, 10)
    alone = [bench.run(v, times) for v in values]
    some: list[Player] = []
    wrong = 0
    try:
        for k, v in enumerate(values):
            some.append(Player(facts, bench.folder, f"instance {k}"))
            some[k].begin(v, None)
        for j, t in enumerate(times):
            for k, one in enumerate(some):
                if j:
                    one.step(t - one.time)
                if j < len(alone[k].rows):
                    row = alone[k].rows[j]
                    wrong += any(value != row[n] for n, value in one.read().items())
    finally:
        for one in some:
            one.close()
    checks = [Check("points that differ from a run alone", float(wrong), 0.5)]
    return Finding((*checks, *(c for run in alone for c in bench.checks(run))))
