"""Friction where redundant constraints share its normal force: one law in every mode and interface."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from instance import instance
from rich.console import Console
from runs import simulate_fmu
from sympy import Expr, Integer, cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Contact,
    Friction,
    Holonomic,
    Input,
    Model,
    Nonholonomic,
    Parameter,
    Scene,
    multiplier,
    simulate,
)
from lagfmu.testing import find_compiler, prepare
from lagfmu.testing import show_in as show

pytestmark = [
    pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine"),
    pytest.mark.filterwarnings("ignore::lagfmu.testing.RedundantConstraintWarning"),
]
x, z, theta, F = dynamicsymbols("x z theta F")
m, G, mu, a, J, alpha = symbols("m g mu a J alpha", nonnegative=True)
g, MU = 9.81, 0.2
PADS = {"lo": -1, "mid": 0, "hi": 1}
BODY = m * (x.diff() ** 2 + z.diff() ** 2) / 2 + J * theta.diff() ** 2 / 2
PARAMETERS = [
    Parameter(m, 1.0, "kg"),
    Parameter(G, g, "m/s^2"),
    Parameter(mu, MU, "1"),
    Parameter(a, 0.3, "m"),
    Parameter(J, 0.09, "kg.m^2"),  # m a^2: the pads outside count twice in the norm
]
SUM: Expr = sum((multiplier(pad) for pad in PADS), Integer(0))


def guided(normal: Expr) -> Model:
    """1 kg in a straight guide of three pads, one too many, pushed by F; `normal` presses."""
    return Model(
        name="Guided",
        lagrangian=BODY - m * G * z,
        coordinates={x: "m", z: "m", theta: "rad"},
        forces={x: F},
        inputs=[Input(F, "N")],
        constraints=[
            *(Holonomic(pad, z + side * a * theta) for pad, side in PADS.items()),
            Nonholonomic("rub", x.diff()),
            Friction("grip", of=["rub"], normal=normal, static=mu),
        ],
        parameters=PARAMETERS,
        start={x.diff(): 2.0},
    )


def standing() -> Model:
    """1 kg on three feet in line along an incline, one too many."""
    return Model(
        name="Standing",
        lagrangian=BODY - m * G * (z * cos(alpha) - x * sin(alpha)),
        coordinates={x: "m", z: "m", theta: "rad"},
        constraints=[
            *(Contact(foot, z + side * a * theta) for foot, side in PADS.items()),
            *(Nonholonomic(f"rub_{foot}", x.diff()) for foot in PADS),
            *(Friction(f"grip_{foot}", [f"rub_{foot}"], multiplier(foot), mu) for foot in PADS),
        ],
        parameters=[*PARAMETERS, Parameter(alpha, 0.1, "rad")],
    )


Make = Callable[[Model], Path]
NORMALS = {"one of them": multiplier("lo"), "their sum": SUM}


def model_of(which: str) -> Model:
    """The guide, or what stands."""
    return guided(NORMALS[which]) if which in NORMALS else standing()


def pressed(table: Any, which: str) -> Any:
    """N [N] of the multipliers that are read."""
    names = PADS if which == "their sum" else ("lo",)
    return sum(np.asarray(table[f"lambda.{pad}"]) for pad in names)


@pytest.mark.parametrize("which", NORMALS)
def test_both_interfaces_slide_by_the_multiplier_that_is_read(built: Make, which: str) -> None:
    """der(x) = v0 - mu N t, with N of the multipliers of least norm that add up to the weight, in
    co-simulation and in model exchange, and F = 3 N moves what that N cannot hold."""
    for values, v0 in (({}, 2.0), ({"der(x)": 0.0, "F": 3.0}, 0.0)):
        for kind in ("CoSimulation", "ModelExchange"):
            table = simulate_fmu(
                str(built(model_of(which))),
                fmi_type=kind,
                start_values=values,
                stop_time=0.5,
                output_interval=0.25,
                output=["der(x)", "lambda.rub", *(f"lambda.{pad}" for pad in PADS)],
            )
            N = pressed(table, which)
            force = values.get("F", 0.0) - MU * N
            assert pytest.approx(N, rel=1e-12) == (g if which == "their sum" else g / 4)
            assert table["lambda.rub"] == pytest.approx(-MU * N, rel=1e-12), kind
            assert table["der(x)"] == pytest.approx(v0 + force * table["time"], abs=1e-9), kind


def test_what_is_held_is_held_by_the_normal_force_that_is_read(built: Make) -> None:
    """No strain of the guide's own holds it: it sticks below mu N = 0.4905 N and slips above."""
    for push in (0.49, 0.5):
        with instance(built(model_of("one of them"))) as one:
            one.start({"der(x)": 0.0, "F": push})
            one.step(0.5)
            assert one.get("sticks.grip") == (push < 0.4905)
            assert one.get("lambda.lo") == pytest.approx(g / 4, rel=1e-12)
            assert one.get("der(x)") == pytest.approx(max(push - 0.4905, 0) * 0.5, abs=1e-12)


@pytest.mark.parametrize("part", [0.5, 0.99, 0.999999, 1.000001, 2.0])
def test_three_feet_in_line_hold_what_one_would(built: Make, part: float) -> None:
    """However they share the load: it stands for tan(alpha) < mu, every foot sticking, and slides with
    g (sin(alpha) - mu cos(alpha)) beyond; a foot that could as well be lifted is no paradox."""
    slope = float(np.arctan(MU * part))
    table = simulate(
        built(standing()), start_values={"alpha": slope}, stop_time=0.5, step_size=0.25
    )
    drive = max(g * (np.sin(slope) - MU * np.cos(slope)), 0.0)
    assert table["der(x)"] == pytest.approx(drive * table["time"], abs=1e-12)
    for foot in PADS:
        assert (table[f"sticks.grip_{foot}"] == (part < 1)).all()
        assert (table[f"margin.grip_{foot}"] >= -1e-12 * g).all()
    held = sum(table[f"lambda.rub_{foot}"] for foot in PADS)
    assert held == pytest.approx(drive - g * np.sin(slope), rel=1e-12)


@pytest.mark.parametrize("which", [*NORMALS, "standing"])
def test_a_normal_force_that_is_not_unique_is_told(built: Make, which: str) -> None:
    """By build, show and the log, with the remedy; not where the sum that presses is unique."""
    alone = which != "their sum"
    model = model_of(which)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        prepared = prepare(model, Scene(model.name))
    page = StringIO()
    show(prepared, Console(width=200, file=page))
    with instance(built(model)) as one:
        one.start({})
        told = [text for status, _, text in one.log if status == 1]
    texts = (
        " ".join(str(w.message) for w in said),
        " ".join(page.getvalue().split()),
        " ".join(told),
    )
    for text in texts:
        assert ("not unique, and the motion may depend on it" in text) == alone, text
        assert ("a sum of multipliers that is unique" in text) == alone
    assert len(told) == (0 if not alone else 3 if which == "standing" else 1)
