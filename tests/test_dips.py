"""Contacts that are touched and left again within one step: small obstacles, narrow bumps, grazing flights.

The particle flies freely, so that nothing but the contact could shorten a step.
"""

from __future__ import annotations

import numpy as np
import pytest
from instance import instance
from sympy import cos, exp, sqrt, symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass

from lagfmu import Contact, Parameter

x, y = dynamicsymbols("x y")
m, a, H, w, R = symbols("m a H w R", positive=True)
PULL = 9.81  # m/s^2, upwards: a flight that dips and comes back


def flight(name, constraint, parameters, pull=0, **start):
    """A particle of 1 kg under the acceleration `pull` upwards, over an obstacle without friction, e = 1."""
    return point_mass(
        name,
        "x y",
        [constraint],
        energy=m * pull * y,
        parameters=[*parameters],
        start={x: -0.5, y: 0.0, **start},
    )


def grain():
    """A sphere of 0.1 mm in the way of a particle at 10 m/s."""
    model = Contact("grain", sqrt(x**2 + y**2) - R, restitution=1)
    return flight("Grain", model, [Parameter(R, 1e-4, "m")])


def bump():
    """A hill of 1 cm, as wide, on a plain."""
    model = Contact("road", y - H * exp(-((x / w) ** 2)), restitution=1)
    return flight("Bump", model, [Parameter(H, 0.01, "m"), Parameter(w, 0.01, "m")])


def hills():
    """A row of hills of 2 cm, half a metre from each other."""
    model = Contact("road", y + H * cos(w * x), restitution=1)
    return flight("Hills", model, [Parameter(H, 0.01, "m"), Parameter(w, 4 * np.pi, "rad/m")])


def table():
    """A table from which everything is drawn upwards: what comes down dips and goes up again."""
    return flight("Dip", Contact("table", y), [Parameter(a, PULL, "m/s^2")], pull=a)


@pytest.mark.parametrize("radius", [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("offset", [0.0, 0.6])
def test_a_grain_in_the_way_is_hit(built, radius, offset):
    """A particle that flies 1 m a step meets a sphere of 1e-6 to 1e-2 m: head on it comes straight back; at
    0.6 R beside its centre it is turned as light is by a round mirror, by pi - 2 asin 0.6."""
    with instance(built(grain())) as one:
        one.start({"R": radius, "y": offset * radius, "der(x)": 10.0})
        one.step(0.1)
        turn = np.pi - 2 * np.arcsin(offset)
        assert one.get("der(x)") == pytest.approx(10 * np.cos(turn), abs=1e-4)
        assert one.get("der(y)") == pytest.approx(10 * np.sin(turn), abs=1e-4)


def test_a_flight_past_a_grain_is_not_turned(built):
    """At 1.001 R it passes by, at 10 m/s still, and the step is one."""
    with instance(built(grain())) as one:
        one.start({"y": 1.001e-4, "der(x)": 10.0})
        one.step(0.1)
        assert one.get("der(y)") == 0
        assert one.get("x") == pytest.approx(0.5, abs=1e-12)


@pytest.mark.parametrize("speed", [5.0, 50.0, 500.0])
def test_a_narrow_bump_is_not_tunnelled(built, speed):
    """At half the height of the bump the particle meets its slope where exp(-(x/w)^2) = 1/2, and is mirrored
    there: f is 0.5 m of flat road before and after, and nothing of the bump is seen from there."""
    with instance(built(bump())) as one:
        one.start({"y": 0.005, "der(x)": speed})
        meet = -0.01 * np.sqrt(np.log(2))
        slope = -2 * meet / 0.01**2 * 0.005
        normal = np.array([-slope, 1]) / np.hypot(slope, 1)
        mirrored = np.array([speed, 0]) - 2 * speed * normal[0] * normal
        one.step(0.6 / speed)
        found = np.array([one.get("der(x)"), one.get("der(y)")])
        np.testing.assert_allclose(found, mirrored, rtol=1e-6)


def test_of_many_hills_the_first_is_hit(built):
    """A flight that comes down by 5 mm a hill would pass through four of them, one after another: it stays on
    the road or above it at each point."""
    with instance(built(hills())) as one:
        one.start({"y": 0.05, "der(x)": 10.0, "der(y)": -0.1})
        for _ in range(350):
            one.step(0.002)
            assert one.get("residual.road") > -1e-9


@pytest.mark.parametrize("depth", [1e-3, 1e-6, 1e-8])
def test_a_grazing_dip_is_seen(built, depth):
    """Drawn upwards at 9.81 m/s^2 it would dip below the table by 1e-8 to 1e-3 m at t = 0.5 s, and be above
    at every look at a whole step: it stops at the table instead and leaves it with no speed."""
    touch = 0.5 - np.sqrt(2 * depth / PULL)
    with instance(built(table())) as one:
        one.start({"y": PULL / 8 - depth, "der(y)": -PULL / 2}, tolerance=1e-12)
        one.step(1.0)
        assert one.get("y") == pytest.approx(PULL * (1 - touch) ** 2 / 2, rel=1e-6)


def test_a_miss_stays_a_miss(built):
    """The same flight 1e-8 m above the table touches nothing."""
    with instance(built(table())) as one:
        one.start({"y": PULL / 8 + 1e-8, "der(y)": -PULL / 2}, tolerance=1e-12)
        one.step(1.0)
        assert one.get("y") == pytest.approx(PULL / 8 + 1e-8, rel=1e-10)


def test_a_narrow_bump_at_the_turn_of_a_flight_is_hit(built):
    """A particle that is thrown up to v^2/(2 g) turns round in a bump a thousandth as wide: between two
    samples it goes beyond both, and beyond the one in the middle, by what its path bends."""
    h = symbols("h", positive=True)
    model = point_mass(
        "Turn",
        "y",
        [Contact("bump", w - 2 * w * exp(-(((y - h) / w) ** 2)))],
        up=y,
        gravity=PULL,
        parameters=[Parameter(w, 1e-4, "m"), Parameter(h, 0.2, "m")],
        start={y.diff(): 2.0},
    )
    with instance(built(model)) as one:
        for speed in np.linspace(1.9, 2.4, 14):
            one.start({"der(y)": speed, "h": speed**2 / (2 * PULL)})
            one.step(0.5)
            assert one.get("closing.bump.count") == 1, speed
            one.fmu.reset()
