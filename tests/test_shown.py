"""How a run is told: tables and figures for people, whatever the numbers are for machines."""

from __future__ import annotations

import re
import unicodedata
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import MODELS, model_file
from rich.cells import cell_len
from typer.testing import CliRunner

import lagfmu
from lagfmu import ClosedForm, Conserved, Result, Scene, output
from lagfmu.bodies import Body, Ground, Revolute, Rolling, mechanism
from lagfmu.testing import app, applies, carried, check_closed_form, console, moments, wrapped


def simulated(*words: object) -> dict[str, list[str]]:
    """The rows that lagfmu simulate prints, by variable."""
    done = CliRunner().invoke(app, ["simulate", *map(str, words)])
    assert done.exit_code == 0, done.output
    rows = [line.split() for line in done.output.splitlines() if line.strip()]
    return {row[0]: row[1:] for row in rows if len(row) in (2, 3) and row[0] != "wrote"}


def test_an_equation_is_broken_before_its_operators() -> None:
    """No word is lost or cut; a line begins with = + or -, inside of brackets only where it has to, and then
    further to the right."""
    text = "m x'' + c x' = 2 (x1 - x2) lambda_1 + (a + b + c + d + e + f + g + h + i) lambda_2"
    for width in (20, 30, 44, 60, 100):
        lines = wrapped(text, width)
        assert " ".join(line.strip() for line in lines) == text
        assert max(map(len, lines)) <= width
    assert wrapped(text, 44) == [
        "m x'' + c x' = 2 (x1 - x2) lambda_1",
        "+ (a + b + c + d + e + f + g + h + i)",
        "lambda_2",
    ]
    assert wrapped(text, 30)[-2:] == ["+ (a + b + c + d + e + f + g", "  + h + i) lambda_2"]
    assert wrapped("", 10) == [""]
    # one word longer than a line is left to the terminal
    assert wrapped("a" * 20, 10) == ["a" * 20]


@pytest.mark.parametrize("width", [60, 80, 120])
def test_no_line_that_show_prints_is_longer_than_the_terminal_is_wide(
    width: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The kinetic energy of eight bobs and the accelerations of their links are 120 to 160 letters long; what
    is printed is the same at every width, to the last word."""
    words = ["show", str(MODELS / "chain.py"), "-p", "n=8"]
    monkeypatch.setattr(console, "width", width)
    said = CliRunner().invoke(app, words)
    assert said.exit_code == 0
    lines = said.output.splitlines()
    assert max(cell_len(line.rstrip()) for line in lines) <= width
    assert "…" not in said.output
    whole = unicodedata.normalize("NFC", " ".join(said.output.split()))
    squares = " + ".join(f"ẋ{k}² + ẏ{k}²" for k in "₁₂₃₄₅₆₇₈")
    assert f"T = m ({squares})/2" in whole
    right = "4 ẋ₇ ẋ₈ + 4 ẏ₇ ẏ₈ - 2 ẋ₇² - 2 ẏ₇² - 2 ẋ₈² - 2 ẏ₈²"
    assert f"2 (x₈ - x₇) ẍ₈ + 2 (y₈ - y₇) ÿ₈ = {right}" in whole


def test_a_departure_that_has_not_been_has_no_time(native_fmu: Any) -> None:
    """The particle leaves the hemisphere at 1.64 s: a run of 1 s knows no time and no place of it, one of 2 s
    does; nor does the table count the 0 before it as the smallest time."""
    model = native_fmu("Hemisphere")
    early, late = simulated(model, "--stop-time", 1), simulated(model)
    for n in ("departure.surface.time", "departure.surface.theta"):
        assert early[n][0] == "none"
        assert float(late[n][0]) > 0.8
    assert early["departure.surface.count"][0] == "0"
    run = lagfmu.simulate(model, 2.0, 0.01)
    row = next(r for r in run._rows() if r[0] == "departure.surface.time")
    assert row[1] == row[2] == row[3]
    assert float(row[1]) == pytest.approx(1.641, abs=1e-3)


def test_units_are_written_as_people_write_them(native_fmu: Any) -> None:
    """N·m, kg·m²: the same in tables, figures and pages; names for machines stay as FMI has them."""
    run = lagfmu.simulate(native_fmu("InclineDisk"), 1.0, 0.25)
    assert run.units["Q.theta"] == "N.m"
    assert "N·m" in repr(run)
    assert "N·m" in run._repr_html_()
    axes = run.plot("Q.theta", "y").axes
    assert [a.get_ylabel() for a in axes] == ["[N·m]", "[m]"]
    assert axes[-1].get_xlabel() == "time [s]"
    assert simulated(native_fmu("InclineDisk"))["Q.theta"][1] == "N·m"


def test_a_zero_has_no_sign() -> None:
    """-0.0 is rounding's way to say 0."""
    table = np.zeros(2, dtype=[("time", float), ("x", float)])
    table["x"] = -0.0
    assert "-0" not in repr(Result(table, {"x": "m"}, "Zero", "native"))


def test_every_slip_is_marked_in_the_figure(native_fmu: Any) -> None:
    """The block on the belt slips again and again: a dashed line at each of the times that the run tells."""
    run = lagfmu.simulate(native_fmu("Belt"), 3.0, 0.01)
    told = moments(run, "slipping.count", "grip")
    assert len(told) == run["slipping.grip.count"][-1] > 3
    assert told == sorted(set(told))
    (axes,) = run.plot("lambda.ride").axes
    dashed = [line.get_xdata()[0] for line in axes.lines if line.get_linestyle() == "--"]
    assert dashed == told


def test_with_a_film_the_table_is_short(native_fmu: Any, tmp_path: Path) -> None:
    """What one looks for first; every row only without a file, and what -v names."""
    model = native_fmu("Hemisphere")
    whole = simulated(model, "--stop-time", 0.1)
    short = simulated(model, "--stop-time", 0.1, "--animate", tmp_path / "a.html")
    assert {"lambda.surface", "theta", "departure.surface.time"} <= short.keys() < whole.keys()
    assert "energy.total" not in short
    named = simulated(model, "--stop-time", 0.1, "--csv", tmp_path / "a.csv", "-v", "energy.total")
    assert "energy.total" in named


def test_a_landing_without_rebound_takes_energy(native_fmu: Any) -> None:
    """A ball that falls 1 m and stays: m g h is gone at sqrt(2 h/g) = 0.4515 s.  What is said of the energy
    holds until then where the losses are not known, at 46 points; who says himself where it holds (always)
    hears when it was missed first, and what happened there."""
    file = model_file("bouncing_ball")
    run = lagfmu.simulate(native_fmu("BouncingBall"), start_values={"e": 0.0})
    energy = output("energy.total")
    forms = [Conserved("energy", energy), Conserved("always", energy, when=1 + output("time"))]
    until, always = (
        check_closed_form(form, run, {"m": 1.0, "g": 9.81, "e": 0.0}, 1e-8)
        for form in carried(file.scenes[0], forms)
    )
    assert (until.points, until.verdict) == (46, "pass")
    assert always.failed
    assert always.error == pytest.approx(1.0)
    assert "first missed at t = 0.46 s, where contact 'floor' has just closed" in str(always)


def test_energy_and_what_was_lost_are_conserved() -> None:
    """A statement on a part of the energy takes the same part of the losses; one that names them, one that is
    no linear function of the energy, and a closed form stay as they are."""
    energy, losses, g = output("energy.total"), output("energy.dissipated"), output("g")
    before = {"part": g * energy / 2, "named": energy + losses, "square": energy**2, "other": g}
    scene = model_file("bouncing_ball").scenes[0]
    made = carried(scene, [Conserved(name, e) for name, e in before.items()])
    after = {form.name: form.with_losses().actual for form in made}
    assert after == before | {"part": g * energy / 2 + g * losses / 2}
    (form,) = carried(scene, [ClosedForm("energy.total", g)])
    assert form.with_losses() == form


def test_an_invariant_ends_where_a_contact_closes() -> None:
    """Seen as closed, or opened once more than it was closed: a bounce between two communication points.  A
    contact that was closed at the start and opens has not landed."""
    kinds = [("time", float), ("contact.a", bool), ("departure.a.count", int)]
    (form,) = carried(Scene("X"), [Conserved("spin", output("time"))])

    def holds(closed: list[int], opened: list[int]) -> list[bool]:
        rows = np.array(list(zip(range(4), closed, opened, strict=True)), dtype=kinds)
        return list(applies(form, rows, {}))

    assert holds([1, 0, 0, 0], [0, 1, 1, 1]) == [True] * 4
    assert holds([0, 0, 1, 1], [0, 0, 0, 0]) == [True, True, False, False]
    assert holds([0, 0, 0, 0], [0, 0, 1, 1]) == [True, True, False, False]
    assert holds([1, 0, 0, 0], [0, 2, 2, 2]) == [True, False, False, False]
    assert holds([0, 0, 0, 0], [1, 1, 1, 1]) == [True] * 4
    kinds[2] = ("closing.a.count", int)
    assert holds([0, 0, 0, 0], [0, 0, 1, 1]) == [True, True, False, False]


def test_degrees_of_freedom_are_counted_with_the_contacts_closed() -> None:
    """On the sphere the particle has one; the line says so, since in flight it has two."""
    shown = CliRunner().invoke(app, ["show", str(MODELS / "hemisphere.py")]).output
    assert "N = n - rank G = 2 - 1 = 1, with every contact closed" in shown


def test_show_prints_coulombs_law() -> None:
    """A mass that slides on the floor: what holds while it sticks is a bound, and then a force against its
    velocity; a bowling ball's slip is that of the point where it touches."""
    shown = CliRunner().invoke(app, ["show", str(MODELS / "friction_oscillator.py")]).output
    assert "grip sticks   |λ_rest| ≤ μ_s |λ_floor|" in shown
    assert "grip slips    λ_rest = -μ_k |λ_floor| ẋ/|ẋ|" in shown
    shown = CliRunner().invoke(app, ["show", str(MODELS / "bowling.py")]).output
    assert "grip slips    λ_touch = -μ |λ_lane| (ẋ - R φ̇)/|ẋ - R φ̇|" in shown


def test_what_joints_let_go_is_told_without_an_elimination() -> None:
    """A rubbing hinge between two bodies in space and a ball that rolls: rows on velocities, whose slip is
    told by the FMU's name.  Whether they are integrable on thirteen surfaces would take minutes."""
    one, two, ball = (Body(name, 1.0, (0.1, 0.1, 0.1)) for name in ("one", "two", "ball"))
    joints = [
        Revolute("A", Ground().at((0, 0, 0)), one.at((0, 0, 0)), axis="y"),
        Revolute("B", one.at((1, 0, 0)), two.at((0, 0, 0)), axis="y", friction=0.1, radius=0.01),
        Rolling("R", one.at((0, 0, 0)), ball.at((0, 0, 0)), radius=0.1),
    ]
    told = str(lagfmu.show(mechanism("Arms", bodies=[one, two, ball], joints=joints)))
    assert re.search(r"B\.ry +on velocities: B does not turn\n", told)
    assert re.search(r"R\.x +on velocities: R rolls without slipping\n", told)
    assert "slip.B.ry/|slip.B.ry|" in told
    assert "ball.orientation.w = 1.0: assembled\n  the others as given: " in told


def test_show_refuses_a_start_that_build_refuses(tmp_path: Path) -> None:
    """A bob given at 1.6 m on a rod of 1 m: the equations, then the message of `build`, with status 3."""
    source = (MODELS / "pendulum.py").read_text(encoding="utf-8")
    (tmp_path / "off.py").write_text(
        source + "\nfrom dataclasses import replace\n"
        "model = replace(model, start={**model.start, next(iter(model.coordinates)): 1.6})\n",
        encoding="utf-8",
    )
    told = {c: CliRunner().invoke(app, [c, str(tmp_path / "off.py")]) for c in ("show", "build")}
    for done in told.values():
        assert done.exit_code == 3
        assert "misses the constraints ('rod' by 1.85 m²)" in done.stderr
    assert "λ_rod" in told["show"].output
