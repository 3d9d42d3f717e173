"""What is large and what is small comes from the motion and its rows: not from a parameter that happens to
have the same unit, an origin, or a coordinate that has nothing to do with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from instance import instance
from runs import simulate_fmu
from sympy import cos, symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass

from lagfmu import Contact, Friction, Model, Nonholonomic, Parameter, multiplier
from lagfmu.bodies import Body, Ground, Prismatic, SpringDamper, mechanism

t = dynamicsymbols._t
x, z = dynamicsymbols("x z")
m, g, e, Re, mu, F, w = symbols("m g e Re mu F w", positive=True)
X0 = symbols("X0", real=True)
BALL = [Parameter(m, 1.0, "kg"), Parameter(g, 9.81, "m/s^2"), Parameter(e, 0.5, "1")]


def far_centre(height: float = 1.0) -> Model:
    return point_mass(
        "FarCentre",
        "z",
        [Contact("floor", z, restitution=e)],
        energy=m * g * Re**2 / (Re + z),
        parameters=[*BALL, Parameter(Re, 6.378e6, "m")],
        start={z: height},
    )


def near_floor(near: float = 1e-9, place: float = 0.0, speed: float = 10.0) -> Model:
    return point_mass(
        "NearFloor",
        "x z",
        [Contact("floor", z - X0, restitution=e)],
        up=z,
        parameters=[*BALL, Parameter(X0, near, "m")],
        start={x: place, z: 1.0, x.diff(): speed},
    )


SHAKEN = [Parameter(m, 1.0, "kg"), Parameter(F, 1.0, "N"), Parameter(w, 1000.0, "rad/s")]
TARGETS = pytest.mark.parametrize("target", ["native", "python"])


def fall(path, height: float, **values: float) -> None:
    """From rest at `height` [m]: 15 impacts with e = 0.5, the last after (3 - 2^-13) sqrt(2 h/g)."""
    first = np.sqrt(2 * height / 9.81)
    with instance(path) as one:
        one.start(values)
        assert not one.get("contact.floor")
        one.step(1.9 * first)
        assert one.get("closing.floor.count") == 1
        one.step(1.9 * first)
        assert one.get("closing.floor.count") == 15
        assert one.get("closing.floor.time") == pytest.approx((3 - 2.0**-13) * first, rel=1e-6)
        assert one.get("contact.floor")


@TARGETS
@pytest.mark.parametrize("height", [1.0, 1e-3, 1e-6])
def test_a_length_in_a_force_ends_no_bounce(built, target, height):
    """Earth's radius beside a ball that falls from 1 um, 1 mm or 1 m: 15 impacts, as without it."""
    fall(built(far_centre(height), target=target), height)


@TARGETS
@pytest.mark.parametrize("near", [1e-12, 1e-9, 1e-6])
@pytest.mark.parametrize("place", [0.0, 1e-9, 1e-3])
def test_motion_along_a_floor_ends_no_bounce(built, target, near, place):
    """A ball at 10 m/s along a floor at 1 pm to 1 um bounces as one that falls straight."""
    fall(built(near_floor(), target=target), 1.0, X0=near, x=place)


def shifted(height: float, by: float) -> Model:
    """A ball `height` above a floor at `by`."""
    return point_mass(
        "Shifted",
        "z",
        [Contact("floor", z - X0, restitution=e)],
        up=z - X0,
        parameters=[*BALL, Parameter(X0, by, "m")],
        start={z: height + by},
    )


@TARGETS
@pytest.mark.parametrize("by", [0.0, 1.0, -1e3, 1e5])
def test_another_origin_gives_the_same_bounces(built, target, by):
    """A ball from 1 m above floors at 0, 1 m, -1 km and 100 km: 15 impacts."""
    fall(built(shifted(1.0, by), target=target), 1.0)


@TARGETS
def test_a_ball_just_above_a_far_floor_falls(built, target):
    """1 mm above a floor at Earth's radius is open at the start and bounces until rounding ends it."""
    with instance(built(shifted(1e-3, 6.378e6), target=target)) as one:
        one.start()
        assert not one.get("contact.floor")
        first = np.sqrt(2e-3 / 9.81)
        one.step(1.01 * first)
        assert one.get("closing.floor.count") == 1
        assert one.get("closing.floor.time") == pytest.approx(first, rel=1e-6)
        one.step(2 * first)
        assert one.get("contact.floor")
        assert one.get("closing.floor.count") >= 5


@pytest.mark.parametrize("place", [0.0, 1e6])
@pytest.mark.parametrize(
    ("target", "unused"),
    [
        *(("native", length) for length in (1e-12, 1.0, 1e6, 1e12)),
        *(
            pytest.param("python", length, marks=() if length == 1e12 else pytest.mark.thorough)
            for length in (1e-12, 1.0, 1e6, 1e12)
        ),
    ],
)
def test_a_fast_force_beside_a_long_length(built, target, unused, place):
    """F cos(w t) on a free mass moves it by F/(m w^2) (1 - cos(w t)), whatever length stands in the model and
    wherever it begins."""
    rate = 1000.0
    model = point_mass(
        "Shaken",
        "x",
        energy=0 * X0,
        parameters=[*SHAKEN, Parameter(X0, unused, "m")],
        forces={x: F * cos(w * t)},
        start={x: place},
    )
    with instance(built(model, target=target)) as one:
        one.start()
        for k in range(1, 4):
            one.step(0.5)
            expected = (1 - np.cos(rate * 0.5 * k)) / rate**2
            assert abs(one.get("x") - place - expected) < 1e-4 / rate**2 + 1e-10 * place


@pytest.mark.parametrize("far", [1e-9, 6.378e6])
def test_friction_sees_no_far_length_either(built, far):
    """The floor bears m g t in all, so that a ball that slips on it at 10 m/s has lost mu g t at rest."""
    model = point_mass(
        "Rough",
        "x z",
        [
            Contact("floor", z, restitution=e),
            Nonholonomic("foot", x.diff(), while_closed="floor"),
            Friction("grip", of=["foot"], normal=multiplier("floor"), static=mu),
        ],
        energy=m * g * Re**2 / (Re + z),
        parameters=[
            *BALL,
            Parameter(Re, 6.378e6, "m"),
            Parameter(mu, 0.2, "1"),
            Parameter(X0, far, "m"),
        ],
        start={x: 0.0, z: 1.0, x.diff(): 10.0},
    )
    with instance(built(model)) as one:
        one.start()
        one.step(2.0)
        assert one.get("contact.floor")
        assert one.get("closing.floor.count") == 15
        assert one.get("der(x)") == pytest.approx(10 - 0.2 * 9.81 * 2, rel=1e-4)


@pytest.mark.parametrize("far", [0.1, 1e5])
def test_a_far_anchor_ends_no_bounce_of_a_slide(built, far):
    """A slide between stops at -1 and 1 cm, drawn to the upper one with 10 N from 19 mm away: 16 impacts with
    e = 0.5, wherever the spring that draws is anchored."""
    ground, body = Ground(), Body("body", mass=1.0, inertia=0.01)
    ends = ground.at((0, 0)), body.at((0, 0))
    rail = Prismatic("rail", *ends, axis="x", limits=(-0.01, 0.01), restitution=0.5)
    pull = SpringDamper("pull", ground.at((far, 0)), ends[1], preload=10.0)
    parts = {"plane": "xy", "bodies": [body], "joints": [rail], "loads": [pull]}
    with instance(built(mechanism("Slide", start={"position.rail": -0.009}, **parts))) as one:
        one.start()
        one.step(1.0)
        assert one.get("closing.rail.upper.count") == 16
        assert one.get("contact.rail.upper")


@pytest.mark.parametrize("unused", [1e-12, 1e-3, 1.0, 1e12])
def test_a_parameter_that_stands_nowhere_changes_no_bit(built, unused):
    """A length in no row and no force, from 1 pm to 1e12 m: the same impacts to the last bit."""
    model = replace(
        near_floor(1e-3), parameters=[*near_floor(1e-3).parameters, Parameter(Re, unused, "m")]
    )
    seen = []
    for own in (near_floor(1e-3), model):
        with instance(built(own)) as one:
            one.start()
            for _ in range(20):
                one.step(0.1)
                seen.append([one.get(name) for name in ("x", "z", "der(z)", "closing.floor.time")])
    assert seen[:20] == seen[20:]


@pytest.mark.parametrize("unit", [1e-9, 1e-3, 1e6])
def test_another_unit_gives_the_same_impacts(built, unit):
    """Lengths in nanometres or in megametres, g with them: 15 impacts at the same times."""
    fall(built(shifted(1.0, 0.0)), 1.0)
    with instance(built(shifted(1.0, 0.0))) as one:
        one.start({"g": 9.81 / unit, "z": 1.0 / unit})
        one.step(2.0)
        assert one.get("closing.floor.count") == 15
        assert one.get("closing.floor.time") == pytest.approx(
            (3 - 2.0**-13) * np.sqrt(2 / 9.81), rel=1e-9
        )


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("model", [far_centre(), near_floor(place=1e-9)], ids=["far", "near"])
def test_an_importers_integrator_meets_the_same_impacts(built, fmi, model):
    """In model exchange f plus what touches is the indicator: 15 impacts too."""
    result = simulate_fmu(
        built(model, fmi=fmi),
        fmi_type="ModelExchange",
        stop_time=2.0,
        output_interval=0.01,
        relative_tolerance=1e-9,
        output=["contact.floor", "closing.floor.count", "closing.floor.time"],
    )
    assert not result["contact.floor"][0]
    assert result["contact.floor"][-1]
    assert result["closing.floor.count"][-1] == 15
    expected = (3 - 2.0**-13) * np.sqrt(2 / 9.81)
    assert result["closing.floor.time"][-1] == pytest.approx(expected, rel=1e-4)


@TARGETS
@pytest.mark.parametrize("speed", [1e-3, 1.0])
def test_a_ball_thrown_from_the_floor_bounces_by_the_way_it_makes(built, target, speed):
    """Thrown up from z = 0 it is back after 2 v/g and makes 15 impacts by the height v^2/(2 g)."""
    with instance(built(far_centre(0.0), target=target)) as one:
        one.start({"der(z)": speed})
        one.step(2.1 * speed / 9.81)
        assert one.get("closing.floor.count") == 1
        one.step(2 * speed / 9.81)
        assert one.get("closing.floor.count") == 15
        expected = (4 - 2.0**-13) * speed / 9.81
        assert one.get("closing.floor.time") == pytest.approx(expected, rel=1e-6)


@TARGETS
def test_a_contact_that_starts_closed_has_closed_at_no_time(built, target):
    """A ball that lies on the floor at the start is closed, has not been struck, and no log speaks of it."""
    with instance(built(far_centre(0.0), target=target)) as one:
        one.start()
        one.step(1.0)
        assert one.get("contact.floor")
        assert one.get("closing.floor.count") == 0
        assert not any("floor" in text for _, _, text in one.log)
