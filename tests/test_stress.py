"""`lagfmu stress`: what is right passes, what is not is found, and a crash is one wrong row."""

from __future__ import annotations

import io
import json
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from lagfmu.stress import command, worker
from lagfmu.stress.bench import Bench, Finding
from lagfmu.stress.claims import magnitude
from lagfmu.stress.command import stress
from lagfmu.stress.judge import Check
from lagfmu.stress.player import RefusalError
from lagfmu.stress.probe import REFUSED, RIGHT, UNFINISHED, WRONG, Probe, attempt, verdict


@pytest.fixture(scope="module")
def bench(native_fmu):
    with Bench(native_fmu("Hemisphere"), quick=True) as one:
        yield one


def judged(bench, change):
    """Names of the checks that fail after `change` has altered the rows of the default run."""
    rows = bench.ordinary.rows.copy()
    change(rows)
    return [c.what for c in bench.checks(replace(bench.ordinary, rows=rows)) if c.ratio > 1]


def test_the_hemisphere_is_never_wrong(native_fmu, tmp_path):
    """Every quick probe is right or refused; the summary is a table, a JSON file and a Markdown file."""
    text = io.StringIO()
    (found,) = stress([native_fmu("Hemisphere")], tmp_path, Console(file=text), quick=True)
    assert [r for r in found.rows if r.verdict in (WRONG, UNFINISHED)] == []
    assert found.count(RIGHT) > 50
    assert found.count(REFUSED) > 10
    families = {"parameters", "scaling", "starts", "communication step", "tolerance", "long run"}
    assert families | {"rollback", "instances"} <= set(found.families)
    data = json.loads((tmp_path / "native" / "Hemisphere.json").read_text())
    assert data["verdicts"] == {v: found.count(v) for v in (RIGHT, REFUSED, WRONG, UNFINISHED)}
    page = (tmp_path / "native" / "Hemisphere.md").read_text()
    assert f"`{data['sha256']}`" in page
    assert "| parameters | m = " in page
    assert "Hemisphere (native)" in text.getvalue()


def test_the_default_run_passes_every_check(bench):
    assert judged(bench, lambda rows: None) == []


@pytest.mark.parametrize(
    ("column", "factor", "what"),
    [
        ("Q.r", 1 + 1e-12, "shares of Q.r"),
        ("lambda.surface", 1 + 1e-5, "lambda.surface"),
        ("energy.total", 1.001, "energy"),
    ],
)
def test_a_small_error_of_an_output_is_found(bench, column, factor, what):
    """Q that is not the sum of its shares by 1e-12, lambda off by 1e-5, energy that drifts."""

    def change(rows):
        rows[column][len(rows) // 2] *= factor

    assert what in judged(bench, change)


def test_a_surface_that_pulls_is_found(bench):
    """lambda < 0 while closed; lambda != 0 in flight; r < a in flight; r = a + 1e-12 while closed."""
    closed = bench.ordinary.rows["contact.surface"]
    first, last = int(np.argmax(closed)), len(closed) - 1
    assert closed[first]
    assert not closed[last]
    for column, row, value, what in (
        ("lambda.surface", first, -1e-3, "push of surface"),
        ("lambda.surface", last, 1e-200, "no pull of surface in the open"),
        ("residual.surface", last, -1e-6, "outside of surface"),
        ("residual.surface", first, 1e-12, "residual.surface"),
        ("der(theta,2)", last, np.nan, "finite der(theta,2)"),
    ):

        def change(rows, column=column, row=row, value=value):
            rows[column][row] = value

        assert what in judged(bench, change), what


def test_a_refusal_needs_a_cause():
    """discard with a reason is refused; without one, or where it has to work, it is wrong."""
    reason = RefusalError("doStep", 2, "the mass matrix is singular at t = 0 s")
    for refusal, may_refuse, answer in (
        (reason, True, REFUSED),
        (reason, False, WRONG),
        (RefusalError("doStep", 2, "no message"), True, WRONG),
        (RefusalError("doStep", 3, "internal error 17 in the solver"), True, WRONG),
    ):
        probe = Probe("", "", lambda bench, r=refusal: Finding((), r), may_refuse)
        assert verdict(probe, attempt(probe, None), 0.0).verdict == answer
    wrong = Finding((Check("x", 2.0, 1.0),), reason)
    assert verdict(Probe("", "", lambda bench: wrong), wrong, 0.0).verdict == WRONG
    assert verdict(Probe("", "", lambda bench: Finding(())), Finding(()), 0.0).verdict == WRONG


def test_a_crash_is_one_wrong_row(native_fmu, monkeypatch, tmp_path):
    """The probe that takes the process down is wrong, one that hangs is unfinished, the rest goes on."""
    program = tmp_path / "worker.py"
    program.write_text(
        "import os, sys, time\n"
        "import lagfmu.stress.worker as w\n"
        "from lagfmu.stress.bench import Finding\n"
        "from lagfmu.stress.judge import Check\n"
        "from lagfmu.stress.probe import Probe\n"
        "good = Finding((Check('x', 0.0, 1.0),))\n"
        "w.probes = lambda *_: [Probe('f', 'good', lambda b: good),\n"
        "    Probe('f', 'crash', lambda b: os.abort()), Probe('f', 'hang', lambda b: time.sleep(99)),\n"
        "    Probe('f', 'last', lambda b: good)]\n"
        "w.main(*sys.argv[1:])\n"
    )
    popen = command.subprocess.Popen

    def start(arguments, **named):
        return popen([arguments[0], str(program), *arguments[3:]], **named)

    monkeypatch.setattr(command.subprocess, "Popen", start)
    out = Console(file=io.StringIO())
    (found,) = stress([native_fmu("Hemisphere")], tmp_path, out, quick=True, limit=1.0)
    assert [r.verdict for r in found.rows] == [RIGHT, WRONG, UNFINISHED, RIGHT]
    assert "SIGABRT" in found.rows[1].detail


def test_terms_count_in_full():
    """magnitude(a - b) = |a| + |b|: what cancels is no more accurate than its terms."""
    from sympy import cos, symbols

    a, b, x = symbols("a b x", real=True)
    assert magnitude(a - b).subs({a: 3, b: 3}) == 6
    assert float(magnitude(1 - cos(x)).subs(x, 1e-3)) == pytest.approx(2, rel=1e-5)
    assert float(magnitude(a**2 * b).subs({a: -2, b: -3})) == 12


def test_probes_cover_the_ranges(bench):
    """Each parameter, both ends of steps and tolerances, every contact."""
    names = [f"{p.family}: {p.name}" for p in worker.probes(bench.facts, quick=False)]
    for wanted in ("communication step: 1e-09 natural", "communication step: 1e+06 natural"):
        assert any(n.startswith(wanted) for n in names)
    assert {"tolerance: 1e-1", "tolerance: 1e-14"} <= set(names)
    assert "rollback: across the departure from surface" in names
    for p in "mga":
        assert sum(n.startswith(f"parameters: {p} = ") for n in names) >= 8
    assert len(names) == len(set(names))
