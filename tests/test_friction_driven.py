"""A body whose motion is prescribed rubs on a floor: it cannot rest where its drive turns round."""

from __future__ import annotations

import numpy as np
import pytest
from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Contact,
    Friction,
    Holonomic,
    Input,
    Model,
    Nonholonomic,
    Parameter,
    multiplier,
    simulate,
)

x, y, z, u = dynamicsymbols("x y z u")
m, g, mu, A, w = symbols("m g mu A w", positive=True)
TIME = dynamicsymbols._t
M, G, MU = 2.0, 9.81, 0.3
MOTIONS = {"turns": (A * sin(w * TIME), 0.5), "starts from rest": (A * (1 - cos(w * TIME)), 0.0)}


def dragged(name: str, motion, speed: float, aside: float | None = None, inputs=()) -> Model:
    """A block on the floor z = 0 that a drive holds on x = motion; free in y if `aside` [m/s] is given."""
    rows = [Nonholonomic("rub", x.diff())]
    if aside is not None:
        rows.append(Nonholonomic("side", y.diff()))
    across = {y: "m"} if aside is not None else {}
    squares = sum(q.diff() ** 2 for q in (x, z, *across))
    return Model(
        name=name,
        lagrangian=m * squares / 2 - m * g * z,
        coordinates={x: "m", **across, z: "m"},
        constraints=[
            Holonomic("drive", x - motion),
            Contact("floor", z),
            *rows,
            Friction("grip", of=[r.name for r in rows], normal=multiplier("floor"), static=mu),
        ],
        parameters=[
            Parameter(m, M, "kg"),
            Parameter(g, G, "m/s^2"),
            Parameter(mu, MU, "1"),
            Parameter(A, 0.1, "m"),
            Parameter(w, 5.0, "1/s"),
        ],
        inputs=list(inputs),
        start={x.diff(): speed} | ({y.diff(): aside} if aside is not None else {}),
    )


@pytest.mark.parametrize("kind", MOTIONS)
def test_friction_turns_round_with_the_drive(kind, built):
    """lambda.rub = -mu m g sign(x') [N], and the drive gives m x'' and what friction takes."""
    model = dragged("Dragged", *MOTIONS[kind])
    run = simulate(built(model), stop_time=3.0, step_size=0.037)
    speed, pull = run["der(x)"], run["lambda.rub"]
    moving = np.abs(speed) > 1e-9
    assert (np.abs(np.diff(np.sign(speed[moving]))) > 0).sum() >= 4  # it does turn round
    assert np.abs(pull + MU * M * G * np.sign(speed))[moving].max() < 1e-12 * M * G
    needed = M * run["der(x,2)"] - pull
    assert np.abs(run["lambda.drive"] - needed).max() < 1e-12 * M * G
    assert not run["sticks.grip"][moving].any()


def test_what_is_dragged_slides_aside_more_easily(built):
    """Friction of two rows stands against the whole slip velocity (x', y'), at each reversal of x' too."""
    model = dragged("Aside", *MOTIONS["turns"], aside=0.4)
    run = simulate(built(model), stop_time=3.0, step_size=0.037)
    v = np.stack([run["der(x)"], run["der(y)"]])
    pull = np.stack([run["lambda.rub"], run["lambda.side"]])
    moving = np.hypot(*v) > 1e-6
    want = -MU * M * G * v[:, moving] / np.hypot(*v[:, moving])
    assert np.abs(pull[:, moving] - want).max() < 1e-9 * M * G


def test_an_input_drags_it_from_rest(built):
    """u rests, then goes as a (t - 1)^2/2: the block sticks, then slides, and that is counted once."""
    model = dragged("Input", u, 0.0, inputs=[Input(u, "m")])
    t = np.linspace(0, 2, 201)
    d = np.maximum(0, t - 1)
    columns = {"time": t, "u": 0.1 * d**2, "der(u)": 0.2 * d, "der(u,2)": np.where(d > 0, 0.2, 0.0)}
    signals = np.array(list(zip(*columns.values(), strict=True)), [(n, float) for n in columns])
    run = simulate(built(model), stop_time=2.0, step_size=0.01, inputs=signals)
    at = run["time"]
    assert run["sticks.grip"][at < 0.995].all()
    late = at > 1.03
    assert not run["sticks.grip"][late].any()
    assert run["slipping.grip.count"][-1] == 1
    assert np.abs(run["lambda.drive"][late] - (M * 0.2 + MU * M * G)).max() < 1e-9
