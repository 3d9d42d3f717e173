"""What is read after a force was set and before the next step: the values with which that step begins, by
the laws of contact and friction (`unseen/`); a look, which leaves no trace."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from instance import Instance, instance
from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass

from lagfmu import Contact, Holonomic, Input, Model, Parameter, Scene
from lagfmu.testing import find_compiler, load

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
UNSEEN = Path(__file__).parent / "unseen"
G = 9.81
Built = Callable[[str], Path]


def box() -> Model:
    """A box of 2 kg on two smooth feet, 0.3 m on either side and 0.4 m below its middle."""
    z, tilt, F, T = dynamicsymbols("z tilt F T")
    m, J, g, b, h = symbols("m J g b h", positive=True)
    return Model(
        name="Box",
        lagrangian=(m * z.diff() ** 2 + J * tilt.diff() ** 2) / 2 - m * g * z,
        coordinates={z: "m", tilt: "rad"},
        forces={z: F, tilt: T},
        constraints=[
            Contact("left", z - h * cos(tilt) - b * sin(tilt)),
            Contact("right", z - h * cos(tilt) + b * sin(tilt)),
        ],
        parameters=[
            Parameter(m, 2.0, "kg"),
            Parameter(J, 0.1, "kg.m^2"),
            Parameter(g, G, "m/s^2"),
            Parameter(b, 0.3, "m"),
            Parameter(h, 0.4, "m"),
        ],
        inputs=[Input(F, "N"), Input(T, "N.m")],
        start={z: 0.4, tilt: 0.0},
    )


def tied() -> Model:
    """A block of 1 kg on a floor that rises by 1/4 of y, with x = 2 y tied."""
    x, y, z, P = dynamicsymbols("x y z P")
    return point_mass(
        "Tied",
        "x y z",
        [Holonomic("tie", x - 2 * y), Contact("floor", z - y / 4)],
        up=z,
        gravity=G,
        forces={z: P},
        inputs=[Input(P, "N")],
        start={z: 0.0},
    )


def model_of(name: str) -> Model:
    """Of unseen/, or of this file."""
    own: dict[str, Callable[[], Model]] = {"box": box, "tied": tied}
    return own[name]() if name in own else load(UNSEEN / f"{name}.py").model


@pytest.fixture(scope="module")
def built(built: Callable[..., Path]) -> Built:
    """built(NAME): its native FMU; with an option of the scene after a blank."""
    options = {"": {}, "nullspace": {"formulation": "nullspace"}, "bars": {"error_bars": True}}

    def get(name: str) -> Path:
        stem, _, option = name.partition(" ")
        model = model_of(stem)
        return built(model, Scene(model.name, **options[option]))

    return get


def setting(one: Instance, **values: float) -> None:
    for name, value in values.items():
        one.set(name, value)


@pytest.mark.parametrize("name", ["pushed_block", "pushed_block bars"])
def test_a_pull_beyond_the_cone_is_read_as_a_slide(built: Built, name: str) -> None:
    """5 N on a block of 1 kg, mu = 0.3: lambda.hold = -2.943 N at once, x'' = 2.057 m/s^2, whichever way;
    within the cone it sticks again.  Nothing is counted before the step, which counts one, at its start."""
    with instance(built(name)) as one:
        one.start()
        one.step(0.1)
        for F in (5.0, -5.0, 2.0, 5.0):
            setting(one, F=F)
            slides = abs(F) > 0.3 * G
            hold = -np.sign(F) * 0.3 * G if slides else -F
            assert one.get("lambda.hold") == pytest.approx(hold, rel=1e-12)
            assert one.get("der(x,2)") == pytest.approx(F + hold, abs=1e-12)
            assert bool(one.get("sticks.grip")) != slides
            assert one.get("margin.grip") == pytest.approx(0.3 * G - abs(hold), abs=1e-12)
            assert one.get("slipping.grip.count") == 0
        messages = len(one.log)
        one.step(0.1)
        assert one.get("slipping.grip.count") == 1
        assert one.get("slipping.grip.time") == pytest.approx(0.1, abs=1e-15)
        assert "began to slip" in one.log[messages][2]


@pytest.mark.parametrize(
    ("name", "floor"), [("pushed_block", "floor"), ("tied", "floor"), ("tied nullspace", "floor")]
)
def test_a_lift_beyond_the_weight_is_read_as_a_departure(
    built: Built, name: str, floor: str
) -> None:
    """20 N up on 1 kg: lambda.floor = 0, open, z'' = 10.19 m/s^2; without it the floor carries the weight
    again, as if nobody had lifted."""
    with instance(built(name)) as one:
        one.start()
        carried = one.get(f"lambda.{floor}")
        for P in (20.0, 0.0, 20.0):
            setting(one, P=P)
            lifted = P > G
            assert bool(one.get(f"contact.{floor}")) != lifted
            assert one.get(f"lambda.{floor}") == pytest.approx(0 if lifted else carried, rel=1e-12)
            if lifted:
                assert one.get("der(z,2)") == pytest.approx(P - G, rel=1e-12)
            assert one.get(f"departure.{floor}.count") == one.get(f"closing.{floor}.count") == 0
        one.step(1e-3)
        assert one.get(f"departure.{floor}.count") == 1
        assert one.get(f"departure.{floor}.time") == 0.0


def test_a_force_that_comes_and_goes_before_the_first_step(built: Built) -> None:
    """Open at the start by 20 N, sliding by 5 N: without them the block stands and sticks at once."""
    with instance(built("pushed_block")) as one:
        one.start({"P": 20.0})
        assert not one.get("contact.floor")
        setting(one, P=0.0)
        assert one.get("contact.floor")
        assert one.get("lambda.floor") == pytest.approx(G, rel=1e-12)
        one.step(0.1)
        assert one.get("z") == pytest.approx(0.1, abs=1e-15)
    with instance(built("pushed_block")) as one:
        one.start({"F": 5.0})
        assert not one.get("sticks.grip")
        for F, hold in ((-5.0, 0.3 * G), (1.0, -1.0)):
            setting(one, F=F)
            assert one.get("lambda.hold") == pytest.approx(hold, rel=1e-12)
        one.step(0.1)
        assert one.get("x") == 0.0


def test_a_guide_that_bears_on_the_other_side_brakes_too(built: Built) -> None:
    """0.5 kg at 1 m/s: lambda.guide = m g + P, and friction takes mu |m g + P| x' whatever its sign."""
    with instance(built("guided_slider")) as one:
        one.start()
        one.step(0.01)
        speed = one.get("der(x)")
        for P in (-50.0, 30.0, -4.0, -1e6):
            setting(one, P=P)
            assert one.get("lambda.guide") == pytest.approx(0.5 * G + P, rel=1e-9)
            assert one.get("power.grip") == pytest.approx(-0.2 * abs(0.5 * G + P) * speed, rel=1e-9)


def test_a_puck_goes_where_it_is_pulled(built: Built) -> None:
    """Two rows: lambda_t against the pull, mu N long; the clamp's 10 N, which jump with an input, are in N at
    once, and hold what slid."""
    with instance(built("clamped_puck")) as one:
        one.start({"der(x)": 0.0})
        one.step(0.01)
        for F, W, clamp in itertools.product((3.0, -1.0), (4.0, -0.5), (1.0, -1.0, 1.0)):
            setting(one, F=F, W=W, c=clamp)
            N = 0.5 * G + 10.0 * (clamp > 0)
            pull = np.array([F, W])
            hold = -pull * min(1.0, 0.4 * N / np.hypot(F, W))
            assert one.get("lambda.table") == pytest.approx(N, rel=1e-12)
            found = [one.get("lambda.holdx"), one.get("lambda.holdy")]
            assert found == pytest.approx(hold.tolist(), rel=1e-9)
            assert bool(one.get("sticks.grip")) == (np.hypot(F, W) <= 0.4 * N)


def test_feet_are_settled_together(built: Built) -> None:
    """A torque of 7 N m, more than m g b = 5.886 N m, lifts one foot, the other carries on; with 15 N up as
    well both would pull if both stood, yet it turns about one; 25 N up leave none."""
    m, J, b = 2.0, 0.1, 0.3
    with instance(built("box")) as one:
        one.start()
        one.step(0.01)
        for F, T in ((0.0, 0.0), (0.0, 7.0), (0.0, -7.0), (15.0, 7.0), (25.0, 0.0), (0.0, 0.0)):
            setting(one, F=F, T=T)
            weight = m * G - F
            shares = np.array([weight + T / b, weight - T / b]) / 2
            if shares.min() < 0 < weight + abs(T) / b:
                # about one foot: z'' = -+ b a, J a = T -+ b N
                lone = (weight / m + b * abs(T) / J) / (1 / m + b**2 / J)
                shares = np.where(shares == shares.max(), max(lone, 0.0), 0.0)
            shares = np.maximum(shares, 0.0)
            found = [one.get("lambda.left"), one.get("lambda.right")]
            assert found == pytest.approx(shares.tolist(), rel=1e-9, abs=1e-12)
            assert [bool(one.get(f"contact.{c}")) for c in ("left", "right")] == (
                shares > 0
            ).tolist()
            assert one.get("departure.left.count") == one.get("departure.right.count") == 0


def settings(rng: np.random.Generator, one: Instance) -> Iterator[tuple[str, float]]:
    for name, variable in one.variables.items():
        if variable.causality == "input" and rng.random() < 0.7:
            yield name, rng.choice([0.0, 1.0, -1.0, 3.0, -8.0, 20.0, -20.0])


@pytest.mark.parametrize(
    "name", ["pushed_block", "pushed_block bars", "guided_slider", "clamped_puck", "box", "tied"]
)
def test_what_is_read_is_what_the_step_begins_with(built: Built, name: str) -> None:
    """Forces at random, from states at random: accelerations, lambda, margins, powers and modes as they are
    read before a step of 1e-9 s are those after it; and a run that was read everywhere, saved in between,
    ends bit for bit as one that was not."""
    ends = []
    for looks in (True, False):
        rng = np.random.default_rng(3)
        with instance(built(name)) as one:
            one.start(tolerance=1e-9)
            for _ in range(60):
                for _ in range(2):
                    for variable, value in settings(rng, one):
                        one.set(variable, value)
                    if looks:
                        one.outputs()
                before, state, time = {}, None, one.time
                if looks:
                    before, state = one.outputs(), one.fmu.getFMUstate()
                    one.step(1e-9)
                    after = one.outputs()
                    one.fmu.setFMUState(state)
                    one.time = time
                for variable in before:
                    kind, _, _ = variable.partition(".")
                    if kind in ("departure", "closing", "slipping", "sticking", "error", "solver"):
                        continue
                    assert before[variable] == pytest.approx(after[variable], rel=1e-5, abs=1e-5)
                one.step(rng.choice([1e-3, 0.02, 0.1]))
            ends.append(one.outputs())
    assert ends[0] == ends[1]
