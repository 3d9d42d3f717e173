"""lagfmu's own arithmetic at the ends of the doubles, in any units, through forged bytes and many instances;
what a user's model does at its own values is for `lagfmu stress`."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from functools import partial

import pytest

from lagfmu.testing import (
    REFUSED,
    RIGHT,
    WRONG,
    Bench,
    Finding,
    Probe,
    Run,
    attempt,
    clear,
    departures,
    find_compiler,
    lay_beside,
    session_of,
    started,
    verdict,
)

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
NAMES = ("Hemisphere", "PendulumCartesian", "KnifeEdge", "CartPendulum", "Bowling")
ENDS = (5e-324, 1e-300, 1e300)


@pytest.fixture(scope="module", params=NAMES)
def bench(request, native_fmu, prepared, tmp_path_factory) -> Iterator[Bench]:
    """A native FMU with Lagrange's equations of its model beside it."""
    path = tmp_path_factory.mktemp("lawful") / f"{request.param}.fmu"
    shutil.copy(native_fmu(request.param), path)
    lay_beside(path, prepared(request.param))
    with Bench(path, quick=True) as one:
        yield one


def told(bench: Bench, do: Callable[[Bench], Finding], may_refuse: bool = True) -> str:
    """The verdict; of a wrong one the reason."""
    found = verdict(Probe("", "", do, may_refuse), attempt(Probe("", "", do), bench), 0.0)
    return f"{found.verdict}: {found.detail}" if found.verdict == WRONG else found.verdict


@pytest.mark.thorough
def test_no_parameter_or_start_is_too_small_or_too_large(bench):
    """5e-324, 1e-300 and 1e300: every output is a finite number, or it is refused with the reason."""
    settable = [*bench.facts.parameters, *bench.facts.starts]
    for s in settable:
        for value in ENDS if s in bench.facts.parameters else ENDS[2:]:
            if s in bench.facts.starts or s.allows(value):
                found = attempt(Probe("", "", partial(started, {s.name: value})), bench)
                assert not [c for c in found.checks if c.what.startswith("finite") and c.ratio > 1]
                assert found.refusal is None or clear(found.refusal), f"{s.name} = {value}"


@pytest.mark.thorough
@pytest.mark.parametrize("power", [-60, -10, 10, 60])
def test_other_units_give_the_same_motion(bench, power):
    """In units of mass, length or time scaled by 2^power, and in all three at once, everything is the same
    number times the scale of its unit: no threshold has a dimension."""
    for axis in (0, 1, 2, None):
        if abs(power) == 10 or axis is not None:
            must = abs(power) == 10
            found = told(bench, partial(scaled, axis, power), not must)
            assert found in ((RIGHT,) if must else (RIGHT, REFUSED)), f"{axis}: {found}"


def scaled(axis: int | None, power: int, bench: Bench) -> Finding:
    """The default experiment in other units, and back."""
    facts = bench.facts

    def factor(name: str) -> float:
        exponents = facts.dimensions[name]
        if axis is None:  # kg, m and s at once, by different powers
            return float(2.0 ** (power * (exponents[0] + 2 * exponents[1] - exponents[2])))
        return float(2.0 ** (power * exponents[axis]))

    base = bench.ordinary
    settable = (*facts.parameters, *facts.starts, *facts.inputs)
    values = {s.name: s.start * factor(s.name) for s in settable}
    run = bench.run(values, [t * factor("time") for t in base.rows["time"].tolist()])
    checks = bench.checks(run, facts.stop_time * factor("time"))
    rows = run.rows.copy()
    for name in set(rows.dtype.names or ()) & set(facts.dimensions):
        rows[name] = rows[name] / factor(name)
    back = Run(rows, base.values, run.tolerance, run.refusal)
    growth = bench.amplification
    checks += bench.agreement(base, back, growth, "same in the old units", facts.stop_time)
    checks += departures(bench, base, back, float(growth[-1]))
    return Finding(tuple(checks), run.refusal)


def test_twenty_instances_do_not_meet(bench):
    """Each with parameters of its own, stepped in turns: each as if it were alone."""
    facts, some = bench.facts, []
    times = bench.times(facts.stop_time, 6)
    values = [
        {p.name: p.start * x for p in facts.parameters if p.allows(p.start * x)}
        for x in (1 + 0.01 * k for k in range(20))
    ]
    alone = [bench.run(v, times) for v in values]
    try:
        for k, v in enumerate(values):
            some.append(session_of(facts, bench.folder, f"instance {k}"))
            some[k].begin(v, None, times[-1])
        for j, t in enumerate(times):
            for k, one in enumerate(some):
                if j:
                    one.step(t - one.time)
                row = alone[k].rows[j]
                assert not [n for n, value in one.read().items() if value != row[n]]
    finally:
        for one in some:
            one.close()
