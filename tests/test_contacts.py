"""Contacts that open and close, with constraints that act while they are closed, and several together; one
alone on the models (test_bouncing_ball.py, test_hemisphere.py, test_nonsmooth.py)."""

from __future__ import annotations

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from instance import instance
from sympy import Rational, cos, pi, sin, sqrt, symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass

from lagfmu import Contact, Holonomic, Model, Nonholonomic, Parameter, simulate

G = 9.81
t = dynamicsymbols._t
x, y, phi = dynamicsymbols("x y phi")
m, g, a, e, R = symbols("m g a e R", positive=True)
MASS = Parameter(m, 2.0, "kg")
GRAVITY = Parameter(g, G, "m/s^2")


def kinetic(*coordinates):
    return m * sum(q.diff() ** 2 for q in coordinates) / 2


@pytest.mark.parametrize("kind", ["holonomic", "nonholonomic"])
def test_a_ball_that_lands_begins_to_roll(built, kind):
    """A sliding ball that falls on a rough floor rolls from the landing on: the impact takes
    two sevenths of its speed, x' = (5/7) v = R phi', as angular momentum about the point demands."""
    slip = x - R * phi
    roll = {
        "holonomic": Holonomic("roll", slip, while_closed="floor"),
        "nonholonomic": Nonholonomic("roll", slip.diff(t), while_closed="floor"),
    }[kind]
    model = Model(
        name="Landing",
        lagrangian=kinetic(x, y) + Rational(1, 5) * m * R**2 * phi.diff() ** 2 - m * g * y,
        coordinates={x: "m", y: "m", phi: "rad"},
        constraints=[Contact("floor", y - R), roll],
        parameters=[MASS, GRAVITY, Parameter(R, 0.2, "m")],
        start={x: 0.0, y: 1.2, phi: 0.3, x.diff(): 1.4},
    )
    result = simulate(built(model), 1.0, 0.01, 1e-10)
    landing = np.sqrt(2 / G)
    on = result["time"] > landing
    after = result["time"][on] - landing
    assert (result["contact.floor"] == on).all()
    np.testing.assert_allclose(result["der(x)"][~on], 1.4, rtol=1e-14)
    np.testing.assert_allclose(result["der(phi)"][~on], 0, atol=1e-14)
    np.testing.assert_allclose(result["der(x)"][on], 1.0, rtol=1e-12)
    np.testing.assert_allclose(result["der(phi)"][on], 5.0, rtol=1e-12)
    np.testing.assert_allclose(result["x"][on], 1.4 * landing + after, atol=1e-11)
    np.testing.assert_allclose(result["phi"][on], 0.3 + 5 * after, atol=1e-10)
    np.testing.assert_allclose(result["lambda.floor"][on], 2 * G, rtol=1e-12)
    assert np.abs(result["residual.roll"][on]).max() < 1e-12


def corner(start, tilt=pi / 6):
    """A particle in a corner of two walls, n . (x, y) >= 0: gravity down, walls at `tilt` and at
    pi/2 + tilt from the horizontal."""
    walls = [
        Contact("low", -x * sin(tilt) + y * cos(tilt)),
        Contact("high", x * cos(tilt) + y * sin(tilt)),
    ]
    return Model(
        name="Corner",
        lagrangian=kinetic(x, y) - m * g * y,
        coordinates={x: "m", y: "m"},
        constraints=walls,
        parameters=[MASS, GRAVITY],
        start=start,
    )


@pytest.mark.parametrize("method", ["auto", "rk4"])
def test_a_particle_slides_into_the_corner(built, method):
    """Let go on the slope at a distance s it slides with g sin 30 deg, meets the other wall after
    sqrt(2 s/(g sin 30 deg)), and stays: both contacts closed, the weight on both."""
    s = 0.5
    model = corner({x: float(s * sqrt(3) / 2), y: s / 2})
    result = simulate(built(model), 1.0, 0.01, 1e-10, {"solver.method": method})
    before = result["time"] < np.sqrt(2 * s / (G / 2))
    assert result["contact.low"].all()
    assert (result["contact.high"] == ~before).all()
    along = result["x"] * np.cos(np.pi / 6) + result["y"] * np.sin(np.pi / 6)
    np.testing.assert_allclose(along[before], s - G / 4 * result["time"][before] ** 2, atol=1e-12)
    np.testing.assert_allclose(result["lambda.low"], 2 * G * np.cos(np.pi / 6), rtol=1e-12)
    np.testing.assert_allclose(result["lambda.high"][~before], G, rtol=1e-12)
    assert (result["lambda.high"][before] == 0).all()
    assert np.abs(along[~before]).max() < 1e-14


def test_contacts_open_together_where_they_cannot_help_each_other(built):
    """A particle thrown out of the corner along its bisector leaves both walls at the start and falls
    back into it."""
    v = 2.0
    start = {x: 0.0, y: 0.0, y.diff(): v}
    result = simulate(built(corner(start, pi / 4)), 1.0, 0.01, 1e-10)
    time = result["time"]
    up = time < 2 * v / G
    assert (result["contact.low"] == ~up).all()
    assert (result["contact.high"] == ~up).all()
    np.testing.assert_allclose(result["y"][up], (v * time - G * time**2 / 2)[up], atol=1e-12)
    for name in ("low", "high"):
        np.testing.assert_allclose(result[f"lambda.{name}"][~up], 2 * G / np.sqrt(2), rtol=1e-12)
    assert np.abs(result["y"][~up]).max() < 1e-14


@pytest.mark.parametrize("step", [1.0, 20.0, 200.0])
def test_a_force_free_particle_does_not_fly_through_a_sphere(built, step):
    """Without forces a step may be as long as one likes; the particle that comes from x = -100 at the
    impact parameter 0.2 meets the unit sphere all the same, and slides off along the tangent."""
    model = Model(
        name="Shot",
        lagrangian=kinetic(x, y),
        coordinates={x: "m", y: "m"},
        constraints=[Contact("sphere", x**2 + y**2 - a**2)],
        parameters=[MASS, Parameter(a, 1.0, "m")],
        start={x: -100.0, y: 0.2, x.diff(): 1.0},
    )
    result = simulate(built(model), 200.0, step)
    # tangential speed 0.2 m/s on the circle from the point of impact; it never leaves: no force
    # pulls it off, and the sphere carries m v^2/a < 0: so it leaves at once, along the tangent
    rest = 200.0 - (100.0 - np.sqrt(1 - 0.04))
    assert result["x"][-1] == pytest.approx(-np.sqrt(0.96) + 0.2 * 0.2 * rest, abs=1e-6)
    assert result["y"][-1] == pytest.approx(0.2 + 0.2 * np.sqrt(0.96) * rest, abs=1e-6)


@pytest.mark.parametrize("restitution", [0.2, 0.5])
def test_two_balls_on_each_other_come_to_rest(built, restitution):
    """A ball falls on a ball that falls on the floor: infinitely many impacts in a finite time, after
    which the floor carries (m1 + m2) g and the lower ball m2 g."""
    z1, z2 = dynamicsymbols("z1 z2")
    m1, m2, d = symbols("m1 m2 d", positive=True)
    model = Model(
        name="Stack",
        lagrangian=(m1 * z1.diff() ** 2 + m2 * z2.diff() ** 2) / 2 - g * (m1 * z1 + m2 * z2),
        coordinates={z1: "m", z2: "m"},
        constraints=[
            Contact("floor", z1, restitution=e),
            Contact("between", z2 - z1 - d, restitution=e),
        ],
        parameters=[
            Parameter(m1, 1.0, "kg"),
            Parameter(m2, 0.5, "kg"),
            Parameter(d, 0.3, "m"),
            Parameter(e, 0.5, "1"),
            GRAVITY,
        ],
        start={z1: 1.0, z2: 1.6},
    )
    result = simulate(built(model), 3.0, 0.1, start_values={"e": restitution})
    assert result["lambda.floor"][-1] == pytest.approx(1.5 * G, rel=1e-9)
    assert result["lambda.between"][-1] == pytest.approx(0.5 * G, rel=1e-9)
    assert np.diff(result["energy.total"]).max() < 1e-9


def test_a_foot_too_far_out_for_a_double_is_refused_by_name(built):
    """The square of a lever of 1e300 m overflows: nothing says then whether its contact pushes, and the
    start is refused (a step began with the wrong contacts); a plate of 1 m stands on both alike."""
    z, lean = dynamicsymbols("z lean")
    half = symbols("b", positive=True)
    plate = point_mass(
        "Plate",
        "z",
        [
            Contact("left", z - half * sin(lean)),
            Contact("right", z + half * sin(lean)),
        ],
        angles="lean",
        up=z,
        energy=m * a**2 * lean.diff() ** 2 / 2,
        parameters=[MASS, GRAVITY, Parameter(a, 1.0, "m"), Parameter(half, 1.0, "m")],
        start={z: 0.0, lean: 0.0},
    )
    fmu = built(plate)
    with instance(fmu) as one:
        one.start()
        assert one.get("lambda.left") == pytest.approx(G, rel=1e-14)
    with instance(fmu) as one:
        with pytest.raises(FMICallException):
            one.start({"b": 1e300})
        told = " ".join(text for _, _, text in one.log)
    assert "derivative of 1e+300" in told
    assert "choose larger units" in told


@pytest.mark.thorough
def test_walls_that_meet_are_named(built):
    """A ball that loses nothing between walls x = +-(w - c t) gains 2 c at each impact: it is struck without
    end before they meet at t = w/c = 1 s."""
    w, c = symbols("w c", positive=True)
    model = Model(
        name="Meet",
        lagrangian=kinetic(x),
        coordinates={x: "m"},
        constraints=[
            Contact("left", w - c * t + x, restitution=1),
            Contact("right", w - c * t - x, restitution=1),
        ],
        parameters=[MASS, Parameter(w, 1.0, "m"), Parameter(c, 1.0, "m/s")],
        start={x.diff(): 3.0},
    )
    with instance(built(model)) as one:
        one.start({"solver.maximum_steps": 50})
        with pytest.raises(FMICallException):
            one.step(1.5)
        cause = next(text for status, _, text in one.log if status == 2)
        assert "contact 'left', contact 'right' change without end: do surfaces meet" in cause
    with instance(
        built(model)
    ) as one:  # told before as "about inf internal steps: take a shorter one"
        one.start({"w": 1e-9})
        with pytest.raises(FMICallException):
            one.step(1.5)
        cause = next(text for status, _, text in one.log if status == 2)
        assert "more than 1e+07 internal steps" in cause
        assert "contact 'left', contact 'right' change without end" in cause
