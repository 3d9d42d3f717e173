"""Model exchange on a bench: an error of the FMU is found, one of the integrator is none of its."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import fmpy
import pytest
from same_motion import compared

from lagfmu.testing import RIGHT, WRONG, Bench, Probe, attempt, find_compiler, verdict

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
EXCHANGE = Probe("model exchange", "the default experiment", compared, False)


@pytest.fixture(scope="module")
def bench(native_fmu: Any) -> Iterator[Bench]:
    """A cart with a pendulum in points, driven by a force."""
    with Bench(native_fmu("CartPendulum"), quick=True) as one:
        yield one


@pytest.mark.parametrize(
    ("error", "expected"),
    [(lambda _: 0.0, RIGHT), (lambda _: 1e-4, WRONG), (lambda tolerance: 1e5 * tolerance, RIGHT)],
    ids=["none", "the FMU's", "the integrator's"],
)
def test_what_an_integrator_misses_grows_with_its_tolerance(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, error: Callable[[float], float], expected: str
) -> None:
    """What is missed at every tolerance is the FMU's; what falls with it (a rotor that turns over: by 7e-4 at
    1e-9 and by 3e-6 at 1e-11) is the importer's, and the row says so."""
    simulate = fmpy.simulate_fmu

    def altered(*arguments: Any, **named: Any) -> Any:
        found = simulate(*arguments, **named)
        found["s"] *= 1 + error(named["relative_tolerance"])
        return found

    monkeypatch.setattr(fmpy, "simulate_fmu", altered)
    row = verdict(EXCHANGE, attempt(EXCHANGE, bench), 0.0)
    assert row.verdict == expected
    assert ("the importer's integrator at 1e-11" in row.detail) == (error(1.0) > 1)
