"""Every pair of features that a model may have, crossed (crossings.py): what holds of each holds of both.

Few models in which every pair stands go through a few checks; each pair by itself goes through the probes of
`lagfmu stress --quick` where there is time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from crossings import covering, model, pairs, together
from same_motion import compared, rolled_back

from lagfmu import simulate
from lagfmu.testing import (
    UNFINISHED,
    WRONG,
    Bench,
    attempt,
    find_compiler,
    landed,
    lay_beside,
    prepare,
    probes,
    runs,
    verdict,
    write,
)

pytestmark = [
    pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine"),
    pytest.mark.filterwarnings("ignore::lagfmu.errors.LagfmuWarning"),
]


def built(features: tuple[str, ...], folder: Path, turned: bool = False) -> Path:
    """The native FMU of these features, with the laws of its model beside it; `turned`: its constraints and
    coordinates are declared in the opposite order."""
    one, scene = model(features)
    if turned:
        order = dict(reversed(one.coordinates.items()))
        one = replace(one, constraints=tuple(reversed(one.constraints)), coordinates=order)
    prepared = prepare(one, scene)
    fmu = write(prepared, folder, (), target="native")
    lay_beside(fmu, prepared)
    return fmu


@pytest.fixture(scope="module", params=covering(), ids="+".join)
def crossed(request, tmp_path_factory) -> Iterator[tuple[tuple[str, ...], Bench]]:
    """Some features, and the bench of their model."""
    with Bench(built(request.param, tmp_path_factory.mktemp("crossed")), quick=True) as bench:
        yield request.param, bench


def test_every_pair_stands_in_a_model():
    """Of all pairs of features that a mechanism can have each is in one of a dozen models at most."""
    assert len(covering()) <= 12
    for pair in pairs():
        assert any({*pair} <= {*features} for features in covering())
    assert all(map(together, covering()))


def test_the_laws_hold_at_every_instant(crossed):
    """Lagrange's equations, complementarity, Coulomb's cones, residuals, shares, outputs: as described, and
    with a force that jumps, which is read before the FMU steps on."""
    _, bench = crossed
    checks = [*runs.started({}, bench).checks]
    for force, size in (("F", 1e3), ("P", 30.0)):
        checks += runs.driven(force, "jumps", size, bench).checks
    assert [c for c in checks if not c.ratio <= 1] == []
    assert len(checks) > 30


def test_energy_is_neither_made_nor_lost(crossed):
    """energy.total + energy.dissipated grows by the work of the forces that are no part of the Lagrangian,
    and of the floor where it moves, in an impact as well."""
    features, bench = crossed
    run = bench.run({}, bench.times(bench.facts.stop_time, 4000))
    assert run.refusal is None
    rows, t = run.rows, run.rows["time"]
    rises = 0.018 * np.cos(9 * t) if "rheonomic" in features else 0 * t  # of the floor, in m/s
    power = rows["drive"] + rows["lambda.floor"] * rises
    work = np.concatenate([[0.0], np.cumsum(np.diff(t) * (power[1:] + power[:-1]) / 2)])
    known, energy = np.ones(len(t), dtype=bool), rows["energy.total"].copy()
    if "energy.dissipated" in bench.facts.variables:
        struck = np.diff(rows["closing.floor.count"], prepend=0) > 0
        work += np.cumsum(struck * rows["closing.floor.impulse"] * rises)
        energy += rows["energy.dissipated"]
    else:  # what an impact takes is not told
        known = ~landed(run.rows)
    size = np.abs(rows["energy.kinetic"]).max() + np.ptp(rows["energy.potential"])
    assert known.sum() > 100
    assert np.abs(energy - energy[0] - work)[known].max() < 1e-3 * size


def test_a_saved_state_goes_on_with_the_same_bits(crossed):
    """Rollback, again, and through bytes in another instance, in the middle of the run."""
    _, bench = crossed
    checks = rolled_back(0.5, bench).checks
    assert [c for c in checks if not c.ratio <= 1] == []


def test_an_importers_integrator_comes_to_the_same_motion(crossed):
    """Model exchange, where nothing has to be moved by the importer."""
    _, bench = crossed
    if bench.facts.motions:
        pytest.skip("a prescribed motion needs an importer that moves it")
    assert [c for c in compared(bench).checks if not c.ratio <= 1] == []


@pytest.mark.thorough
def test_the_order_of_declaration_is_free(crossed, tmp_path):
    """Constraints and coordinates the other way round: the same motion, within the tolerance."""
    features, bench = crossed
    times = bench.times(bench.facts.stop_time)
    run = bench.run({}, times)
    with Bench(built(features, tmp_path, turned=True), quick=True) as turned:
        other = turned.run({}, times)
    assert other.refusal is None
    rows = run.rows.copy()
    for name in rows.dtype.names:
        rows[name] = other.rows[name]
    checks = bench.agreement(run, replace(run, rows=rows), bench.amplification, "as declared")
    checks += runs.departures(bench, run, replace(run, rows=rows), float(bench.amplification[-1]))
    assert [c for c in checks if not c.ratio <= 1] == []


def test_a_coordinate_that_passes_zero_is_known_no_better_than_its_neighbours(tmp_path):
    """A disk that rocks in a dip of a tabulated ground, 1.57 m to and fro and 2 cm up and down, passes z = 0
    with the error of x: no singular configuration, whatever the method and the tolerance."""
    one, scene = model(("contact", "spline"))
    fmu = write(prepare(one, scene), tmp_path, (), target="native")
    for method in ("dop853", "radau"):
        start = {"der(x)": 0.0, "der(phi)": 0.0, "solver.method": method}
        run = simulate(fmu, 20.0, 0.5, 1e-10, start)
        assert run["energy.total"] == pytest.approx(run["energy.total"][0], abs=1e-7)
        assert np.abs(run["x"]).max() == pytest.approx(1.569596, abs=1e-5)


def test_a_slip_that_has_to_pass_zero_is_not_stopped(tmp_path):
    """A knife edge turns across the line along which it rubs: at phi = pi/2 the slip x' = y' cot(phi)
    is 0 while y' is 0.526 m/s. Neither interface holds it there, and takes all of y' away."""
    with Bench(built(("friction", "blade"), tmp_path), quick=True) as bench:
        rows = bench.ordinary.rows
        turned = int(np.argmax(rows["phi"] > np.pi / 2))
        assert rows["der(x)"][turned - 1] > 0 > rows["der(x)"][turned]
        assert rows["der(y)"][turned] > 0.5
        assert not rows["sticks.grip"].any()
        assert [c for c in compared(bench).checks if not c.ratio <= 1] == []


@pytest.mark.thorough
@pytest.mark.parametrize("pair", pairs(), ids="+".join)
def test_no_probe_finds_a_pair_wrong(pair, tmp_path):
    """Each pair by itself through the probes of `lagfmu stress --quick`: none is wrong."""
    with Bench(built(pair, tmp_path), quick=True) as bench:
        rows = [verdict(p, attempt(p, bench), 0.0) for p in probes(bench.facts, True)]
    assert [r for r in rows if r.verdict in (WRONG, UNFINISHED)] == []
    assert len(rows) > 25
