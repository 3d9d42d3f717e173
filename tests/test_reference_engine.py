"""The engine of the python target where its own choices matter: redundant rows, impacts, sizes, events."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from sympy import exp, log, sin, sqrt, symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass

from lagfmu import (
    Contact,
    Friction,
    Holonomic,
    Model,
    Nonholonomic,
    Parameter,
    Peak,
    Scene,
    multiplier,
    simulate,
)
from lagfmu.errors import BuildError
from lagfmu.testing import load, prepare, write

UNSEEN = Path(__file__).parent / "unseen"
t = dynamicsymbols._t
x, z, theta = dynamicsymbols("x z theta")
m, g, L, w, F = symbols("m g L w F", positive=True)
PARAMETERS = [Parameter(m, 2.0, "kg"), Parameter(g, 9.81, "m/s^2"), Parameter(L, 1.0, "m")]


def swing(rods: int) -> Model:
    """A bob on a rod that is said as often."""
    return point_mass(
        "Swing",
        "x z",
        [Holonomic(f"rod{k}", x**2 + z**2 - L**2) for k in range(rods)],
        up=z,
        parameters=PARAMETERS,
        start={x: 0.6, z: -0.8},
    )


@pytest.mark.filterwarnings("ignore:.*follow")
def test_a_rod_that_is_said_twice_carries_half_each():
    """Of two rows alike the least norm is half of lambda each, neither is unique, and Q is that of the one:
    also within the steps, where the two rows differ by rounding in the step's error."""
    one, two = (simulate(swing(n), 2.0, 0.25, target="python") for n in (1, 2))
    for name in ("lambda.rod0", "lambda.rod1"):
        np.testing.assert_allclose(two[name], one["lambda.rod0"] / 2, rtol=1e-9)
    np.testing.assert_allclose(two["Q.x"], one["Q.x"], rtol=1e-9, atol=1e-9)
    assert not two["unique.rod0"].any()
    assert one["unique.rod0"].all()


def test_without_multipliers_the_rod_pulls_as_much():
    """By the null space of G lambda is found afterwards, from what the motion leaves of the forces:
    with v^2 = 2 g (z0 - z) and f = x^2 + z^2 - L^2 it is m (g z - v^2) / (2 L^2)."""
    scene = Scene("Swing", formulation="nullspace")
    run = simulate(swing(1), 2.0, 0.25, target="python", scene=scene)
    expected = 2.0 * 9.81 * (3 * run["z"] + 2 * 0.8) / 2
    np.testing.assert_allclose(run["lambda.rod0"], expected, rtol=1e-7)


def plank(z0: float, theta0: float, spread: float = 1 / 12, feet: int = 2) -> Model:
    """A plank on feet that rebound with e = 0.25; moment of inertia spread m L^2."""
    kinetic = m * z.diff() ** 2 / 2 + spread * m * L**2 * theta.diff() ** 2 / 2
    return Model(
        name="Plank",
        lagrangian=kinetic - m * g * z,
        coordinates={z: "m", theta: "rad"},
        constraints=[
            Contact(name, z + side * L * sin(theta) / 2, restitution=0.25)
            for name, side in (("left", -1), ("right", 1), ("middle", 0))[:feet]
        ],
        parameters=PARAMETERS,
        start={z: z0, theta: theta0},
    )


@pytest.mark.filterwarnings("ignore:.*follow")
def test_a_plank_on_three_feet_stands_on_all_of_them():
    """The middle foot could hold it alone.  Of all shares that balance, those of least norm in scaled rows,
    whose lengths are 2 : 2 : 1, are a sixth, a sixth and two thirds, and none of the feet departs."""
    end = simulate(plank(0.0, 0.0, feet=3), 0.1, 0.05, target="python")[-1]
    for foot, sixths in (("left", 1), ("right", 1), ("middle", 4)):
        np.testing.assert_allclose(end[f"lambda.{foot}"], sixths * 2.0 * 9.81 / 6, rtol=1e-12)
        assert end[f"contact.{foot}"]
        assert end[f"departure.{foot}.count"] == 0


def test_a_plank_that_falls_flat_rebounds_flat():
    """Both feet are struck together: v becomes e v, nothing turns, and (1 - e^2) m g h is lost."""
    run = simulate(plank(0.1, 0.0), 0.16, 0.02, target="python")
    assert run["closing.left.count"][-1] == run["closing.right.count"][-1] == 1
    fall = np.sqrt(2 * 0.1 / 9.81)
    np.testing.assert_allclose(run["closing.left.time"][-1], fall, rtol=1e-9)
    speed = 0.25 * np.sqrt(2 * 9.81 * 0.1) - 9.81 * (0.16 - fall)
    np.testing.assert_allclose(run["der(z)"][-1], speed, rtol=1e-8)
    assert np.abs(run["theta"]).max() < 1e-12
    lost = (1 - 0.25**2) * 2.0 * 9.81 * 0.1
    np.testing.assert_allclose(run["energy.dissipated"][-1], lost, rtol=1e-8)


def test_a_plank_that_rocks_comes_to_rest():
    """It strikes with one foot, then the other, ever faster, and ends: both feet carry half of it, and its
    energy is dissipated, that of the hops that are ended with it."""
    run = simulate(plank(0.1, 0.1), 1.5, 0.1, target="python", tolerance=1e-10)
    energy = run["energy.total"] + run["energy.dissipated"]
    np.testing.assert_allclose(energy, energy[0], rtol=1e-12)
    assert run["closing.left.count"][-1] > 5
    for foot in ("left", "right"):
        assert run[f"contact.{foot}"][-1]
        np.testing.assert_allclose(run[f"lambda.{foot}"][-1], 2.0 * 9.81 / 2, rtol=1e-9)


@pytest.fixture(scope="module", params=["python", "native"])
def wide_plank(request, built):
    """wide_plank(stop, step, start_values=...): runs of the one with J = m L^2 by either engine."""
    wide = plank(0.1, 0.0, 1.0)
    if request.param == "python":
        return partial(simulate, wide, tolerance=1e-10, target="python")
    return partial(simulate, built(wide), tolerance=1e-10)


def test_a_foot_that_the_other_foot_s_impact_lifts_has_departed(wide_plank):
    """With J = m L^2 a plank that tips about its left foot falls at w^2 = g sin(theta0)/(1.25 L); the impact
    of the right one is m w L and throws the left one up at 0.75 w L: it was closed, and departs at that
    instant with that speed.  The right one arrives at -w L, and its rebound is no departure."""
    run = wide_plank(0.4, 0.01, start_values={"z": np.sin(0.2) / 2, "theta": 0.2})
    last = run[int(np.flatnonzero(run["closing.right.count"])[0])]
    w = np.sqrt(9.81 * np.sin(0.2) / 1.25)
    assert last["departure.left.count"] == last["closing.right.count"] == 1
    assert last["departure.right.count"] == last["closing.left.count"] == 0
    assert last["departure.left.time"] == last["closing.right.time"]
    velocity = {
        e: [last[f"{e}.velocity.{q}"] for q in ("z", "theta")]
        for e in ("departure.left", "closing.right")
    }
    thrown = velocity["departure.left"] @ np.array([1, -0.5])
    arrived = velocity["closing.right"] @ np.array([1, 0.5])
    np.testing.assert_allclose([thrown, arrived], [0.75 * w, -w], rtol=1e-8)
    before = run["time"] < last["departure.left.time"]
    assert run["contact.left"][before].all()
    assert not last["contact.left"]


def test_a_foot_that_lands_with_the_other_may_be_thrown_off_by_it(wide_plank):
    """With J = m L^2 both feet land at once, at 1 m/s and at 0.2 m/s.  The impulse 1.25 m/s / (1.25/m) of the
    one gives the other 0.75 m/s, of which 0.55 m/s are left: the floor neither strikes it nor holds it."""
    fall = 0.02  # s
    high = {"z": 0.6 * fall - 9.81 * fall**2 / 2, "theta": -0.8 * fall}
    speeds = {"der(z)": -0.6 + 9.81 * fall, "der(theta)": 0.8}
    end = wide_plank(0.021, 0.021, start_values=high | speeds)[-1]
    np.testing.assert_allclose(end["closing.left.impulse"], 2.0, rtol=1e-8)
    assert end["closing.right.impulse"] == 0
    np.testing.assert_allclose(end["der(theta)"], 0.55 - 0.25, rtol=1e-8)
    np.testing.assert_allclose(end["der(z)"], (0.55 + 0.25) / 2 - 9.81 * 0.001, rtol=1e-8)


def test_a_fall_from_nothing_has_a_size():
    """From rest at 0, without a length in the model, the way itself is the size of z: z = -g t^2 / 2."""
    model = point_mass("Fall", "z", up=z, parameters=PARAMETERS[:2])
    run = simulate(model, 1.0, 0.1, target="python")
    np.testing.assert_allclose(run["z"], -9.81 * run["time"] ** 2 / 2, rtol=1e-12, atol=1e-15)


def test_what_hardly_moves_is_stepped():
    """A bead that drifts along its wire at 1e-154 m/s goes on so, though squares of its errors underflow."""
    model = point_mass(
        "Adrift",
        "x z",
        [Holonomic("wire", z - L)],
        parameters=PARAMETERS,
        start={x: 1.0, z: 1.0, x.diff(): 1e-154},
    )
    assert (simulate(model, 0.3, 0.1, target="python")["der(x)"] == 1e-154).all()


def test_a_dip_of_lambda_within_a_step_is_found():
    """A pull of F exp(-((t - 0.055)/w)^2) lifts a body off its floor, at t = 0.055 - w sqrt(ln(F/(m g))),
    though lambda is m g again at the end of the communication step."""
    pull = Parameter(F, 40.0, "N"), Parameter(w, 0.01, "s")
    T = symbols("T", positive=True)
    model = point_mass(
        "Lifted",
        "z",
        [Contact("floor", z)],
        up=z,
        parameters=[*PARAMETERS[:2], *pull, Parameter(T, 0.055, "s")],
        forces={z: F * exp(-(((t - T) / w) ** 2))},
    )
    run = simulate(model, 0.1, 0.1, target="python")
    assert run["departure.floor.count"][-1] == 1
    expected = 0.055 - 0.01 * float(sqrt(log(40.0 / (2.0 * 9.81))))
    np.testing.assert_allclose(run["departure.floor.time"][-1], expected, rtol=1e-6)


def test_all_that_native_fmus_alone_do_is_refused_at_once(tmp_path):
    """Friction, error bars, a peak, a method: one message, with the remedy."""
    mu = symbols("mu", positive=True)
    model = point_mass(
        "Block",
        "x z",
        [
            Contact("floor", z),
            Nonholonomic("hold", x.diff()),
            Friction("grip", of=["hold"], normal=multiplier("floor"), static=mu),
        ],
        up=z,
        parameters=[*PARAMETERS[:2], Parameter(mu, 0.5, "1")],
        outputs=[Peak("x")],
    )
    scene = Scene("Block", method="rk4", error_bars=True)
    with pytest.raises(BuildError) as refused:
        write(prepare(model, scene), tmp_path, target="python")
    for part in ("'grip'", "error bars", "peak.x", "'rk4'", "--target native"):
        assert part in str(refused.value)


@pytest.mark.parametrize("inertia", [3e-3, 1e-30, 1e-300])
def test_a_light_carrier_hides_no_teeth(inertia: float) -> None:
    """A planetary gear whose ring is held, with Willis' equation besides: J carrier'' = i tau - c carrier'
    with J = J_c + i^2 J_s + k^2 J_p and i = 3.5; a carrier next to no mass is the limit."""
    model = load(UNSEEN / "planetary_gear.py").model
    asked = {"stop_time": 0.05, "tolerance": 1e-10, "start_values": {"J_c": inertia}}
    run = simulate(model, target="python", **asked)
    J = inertia + 3.5**2 * 2e-4 + (7 / 3) ** 2 * 1e-4
    speed = 3.5 * 0.5 / 0.02 * (1 - np.exp(-0.02 / J * run["time"]))
    np.testing.assert_allclose(run["der(carrier)"], speed, rtol=0, atol=1e-9 * speed.max())
    np.testing.assert_allclose(run["der(sun)"], 3.5 * speed, rtol=0, atol=1e-9 * speed.max())
