"""What goes on from one call to the next: what is right passes, and an FMU that is slightly wrong is found.

The FMU is right; between it and the probe stands an importer that alters one answer.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import fmpy
import pytest
import stress_calls as calls
import stress_derivatives as derivatives
import stress_unique as unique
from stress_geometry import lay_geometry

from lagfmu.testing import (
    RIGHT,
    WRONG,
    Bench,
    Probe,
    Session,
    Verdict,
    attempt,
    exchange,
    find_compiler,
    lay_beside,
    verdict,
)

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
FAMILIES = (calls, derivatives, unique)
EXCHANGE = Probe("model exchange", "the default experiment", exchange.compared, False)


@pytest.fixture(scope="module")
def bench(native_fmu, prepared, tmp_path_factory) -> Iterator[Bench]:
    """A cart with a pendulum in points, driven by a force."""
    path = tmp_path_factory.mktemp("cart") / "CartPendulum.fmu"
    shutil.copy(native_fmu("CartPendulum"), path)
    lay_beside(path, prepared("CartPendulum"))
    lay_geometry(path, prepared("CartPendulum"))
    with Bench(path, quick=True) as one:
        yield one


def rows(bench: Bench) -> dict[str, Verdict]:
    """Every row of the families, by the probe's name."""
    found = [p for family in FAMILIES for p in family.probes(bench.facts, bench.quick)]
    return {p.name: verdict(p, attempt(p, bench), 0.0) for p in [*found, EXCHANGE]}


def test_what_is_right_passes(bench):
    """Six probes, each of which found something to check."""
    found = rows(bench)
    assert {row.verdict for row in found.values()} == {RIGHT}
    assert len(found) == 6
    assert found["along each state and input"].checks > 100


def altered(name: str, change: Callable[..., Any]) -> Callable[[pytest.MonkeyPatch], None]:
    """An importer whose calls of `name` go through `change`."""
    call = Session.call

    def instead(self: Session, what: str, *arguments: Any, **named: Any) -> Any:
        return change(call, self, what, *arguments, **named) if what == name else call(
            self, what, *arguments, **named
        )  # fmt: skip

    return lambda patch: patch.setattr(Session, "call", instead)


def too_large(call: Any, *arguments: Any) -> list[float]:
    first, *others = call(*arguments)
    return [first * (1 + 1e-9) + 1e-9, *others]


def without_second(call: Any, self: Session, what: str, *arguments: Any) -> None:
    references, orders, (first, _) = arguments
    call(self, what, references, orders, [first, 0.0])


def without_end(call: Any, self: Session, what: str, **named: Any) -> None:
    call(self, what, **named | {"stopTime": None})


def stale(patch: pytest.MonkeyPatch) -> None:
    """What has been read once is shown until the next step."""
    read = Session.read

    def again(self: Session, names: Any = None) -> dict[str, Any]:
        if self.time > 0 or not hasattr(self, "shown"):
            self.shown = read(self)
        return self.shown if names is None else read(self, names)

    patch.setattr(Session, "read", again)


def another_motion(patch: pytest.MonkeyPatch) -> None:
    """An importer that comes a little too far."""
    simulate = fmpy.simulate_fmu

    def too_far(*arguments: Any, **named: Any) -> Any:
        found = simulate(*arguments, **named)
        found["s"] *= 1 + 1e-4
        return found

    patch.setattr(fmpy, "simulate_fmu", too_far)


DEFECTS = {
    "along each state and input": altered("getDirectionalDerivative", too_large),
    "F goes on by its derivatives": altered("setRealInputDerivatives", without_second),
    "the stop time belongs to a saved state": altered("setupExperiment", without_end),
    "read, then set, in initialization mode": stale,
    "the default experiment": another_motion,
}


@pytest.mark.parametrize("probe", DEFECTS)
def test_what_is_wrong_is_found(bench, probe, monkeypatch):
    """A derivative off by 1e-9, a second input derivative that is dropped, a stop time that is forgotten,
    values of the start before, a motion of the importer's that is off by 1e-4."""
    DEFECTS[probe](monkeypatch)
    assert rows(bench)[probe].verdict == WRONG


def test_an_error_of_the_importers_integrator_is_none_of_the_fmus(bench, monkeypatch):
    """What an integrator misses grows with its tolerance (a rotor that turns over, by 7e-4 at 1e-9 and by
    3e-6 at 1e-11); what is missed at every tolerance, as above, is the FMU's."""
    simulate = fmpy.simulate_fmu

    def by_tolerance(*arguments: Any, **named: Any) -> Any:
        found = simulate(*arguments, **named)
        found["s"] *= 1 + 1e5 * named["relative_tolerance"]
        return found

    monkeypatch.setattr(fmpy, "simulate_fmu", by_tolerance)
    row = verdict(EXCHANGE, attempt(EXCHANGE, bench), 0.0)
    assert row.verdict == RIGHT
    assert "the importer's integrator at 1e-11" in row.detail


def test_a_multiplier_that_is_called_unique_and_is_not_is_found(bench, monkeypatch):
    """unique.rod is told the other way round at one point."""
    wrong = bench.ordinary.rows.copy()
    wrong["unique.rod"][0] = not wrong["unique.rod"][0]
    monkeypatch.setitem(vars(bench), "ordinary", replace(bench.ordinary, rows=wrong))
    assert rows(bench)["lambda of each constraint"].verdict == WRONG
