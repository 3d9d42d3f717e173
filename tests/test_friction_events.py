"""When friction sticks, slips, turns round, lets go and is landed on: each time against its closed form, and
across each such instant a rollback that changes no bit."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import EVERY, model_file
from instance import Instance, instance
from mpmath import mp, mpf

Rubbing = Callable[[str], Path]
g = 9.81  # m/s^2


@pytest.fixture
def rubbing(native_fmu: Any, built: Any) -> Rubbing:
    """rubbing(FILE): the FMU of the model's last scene, in which friction slips."""

    def get(name: str) -> Path:
        file = model_file(name)
        scene = file.scenes[-1]
        return native_fmu(scene.name) if scene.name in EVERY else built(file.model, scene)

    return get


def integral(rate: Callable[[Any], Any], begin: Any, end: Any) -> Any:
    """The time [s] from one angle to another at the angular velocity `rate`; it may vanish at the ends."""
    with mp.workdps(30):
        return abs(mp.quad(lambda angle: 1 / rate(angle), [begin, (begin + end) / 2, end]))


def root(f: Callable[[Any], Any], low: float, high: float) -> Any:
    with mp.workdps(30):
        return mp.findroot(f, (mpf(low), mpf(high)), solver="anderson")


def rubbed(mu: Any, w0: Any, begin: Any) -> Callable[[Any], Any]:
    """w = v^2/(g r) of a slide down a sphere, dw/dtheta = 2 sin(theta) - 2 mu (cos(theta) - w)."""

    def particular(x: Any) -> Any:
        return ((4 * mu**2 - 2) * mp.cos(x) - 6 * mu * mp.sin(x)) / (1 + 4 * mu**2)

    return lambda x: particular(x) + (w0 - particular(begin)) * mp.exp(2 * mu * (x - begin))


def hemisphere_departs() -> Any:
    """From theta0 = 0.4 rad with 0.9 rad/s, mu_k = 0.3, a = 1 m: it leaves where w = cos(theta)."""
    w = rubbed(mpf("0.3"), mpf("0.9") ** 2 / mpf("9.81"), mpf("0.4"))
    end = root(lambda x: w(x) - mp.cos(x), 0.6, 1.5)
    return integral(lambda x: mp.sqrt(w(x) * mpf("9.81")), mpf("0.4"), end)


def sphere() -> tuple[Any, Any]:
    """A solid sphere that rolls from rest at 0.05 rad: when it slips, and when it leaves."""
    b, start, mu = mpf("1.2"), mpf("0.05"), mpf("0.4")

    def rolling(x: Any) -> Any:
        return mp.sqrt(10 * mpf("9.81") * (mp.cos(start) - mp.cos(x)) / (7 * b))

    slip = root(lambda x: mu * (17 * mp.cos(x) - 10 * mp.cos(start)) - 2 * mp.sin(x), 0.1, 1.2)
    first = integral(rolling, start, slip)
    w = rubbed(mpf("0.3"), b * rolling(slip) ** 2 / mpf("9.81"), slip)
    end = root(lambda x: w(x) - mp.cos(x), float(slip), 1.5)
    return first, first + integral(lambda x: mp.sqrt(w(x) * mpf("9.81") / b), slip, end)


def rod_slips() -> Any:
    """A rod (l = 1 m, mu = 0.3) that falls from rest at 1.2 rad about its foot, until |T| = mu N."""
    start = mpf("1.2")

    def square(x: Any) -> Any:
        return mpf("1.5") * mpf("9.81") * (mp.sin(start) - mp.sin(x))

    def beyond(x: Any) -> Any:
        rate = -mpf("0.75") * mpf("9.81") * mp.cos(x)
        N = mpf("9.81") + mp.cos(x) * rate - mp.sin(x) * square(x)
        return abs(mp.sin(x) * rate + mp.cos(x) * square(x)) - mpf("0.3") * N

    return integral(lambda x: mp.sqrt(square(x)), start, root(beyond, 1.15, 0.9))


D, OMEGA = 0.2 * g / 100, 10.0  # of the belt: (mu_s - mu_k) m g/k, and sqrt(k/m)
RIDES = 2 * D / 0.2
SLIDES = 2 / OMEGA * (np.pi - np.arctan(D * OMEGA / 0.2))


@dataclass(frozen=True)
class Event:
    """What changes between two times [s] in a model, and when by its closed form; `told`: the time that the
    FMU tells, if it does."""

    model: str
    between: tuple[float, float]
    reads: Callable[[Instance], Any]
    time: Callable[[], Any]
    values: Mapping[str, float] = field(default_factory=dict)
    told: Callable[[Instance], float] | None = None


def sticks(one: Instance) -> Any:
    return one.get("sticks.grip")


def direction(row: str) -> Callable[[Instance], Any]:
    return lambda one: np.sign(one.get(f"slip.{row}"))


def touches(contact: str) -> Callable[[Instance], Any]:
    return lambda one: one.get(f"contact.{contact}")


def slipped(one: Instance) -> float:
    return float(one.get("slipping.grip.time"))


def left(one: Instance) -> float:
    return float(one.get("departure.surface.time"))


def bounced(one: Instance) -> float:
    """When a body that falls from 0.2 m has struck the ground (e = 1/2), by its height z at 0.3 s:
    z = e v tau - g tau^2/2 with v = g (0.3 - tau), tau after the impact."""
    z, whole = one.get("z"), 0.3
    # (e/1 + 1/2) g tau^2 - e g whole tau + z = 0, the later of the two
    return whole - (whole / 2 + np.sqrt(whole**2 / 4 - 4 * z / g)) / 2


def strikes(one: Instance) -> Any:
    return one.get("der(z)") > 0


EVENTS = {
    "the block on the belt slips": Event("belt", (0.1, 0.3), sticks, lambda: 0.5 * g / 100 / 0.2),
    "it rides again": Event("belt", (0.6, 0.8), sticks, lambda: 0.5 * g / 100 / 0.2 + SLIDES),
    "it slips for the fourth time": Event(
        "belt", (2.1, 2.4), sticks, lambda: 0.5 * g / 100 / 0.2 + 3 * (SLIDES + RIDES), told=slipped
    ),
    "the bowling ball rolls": Event("bowling", (1.5, 2.2), sticks, lambda: 16 / (7 * 0.12 * g)),
    "the puck bounces off the table": Event(
        "puck",
        (0.1, 0.3),
        strikes,
        lambda: np.sqrt(0.4 / g),
        {"z": 0.2, "alpha": 0.0, "e": 0.5},
        bounced,
    ),
    "the disk that slides down rolls": Event(
        "incline_friction",
        (0.1, 0.5),
        sticks,
        lambda: 1.5 / (3 * 0.3 * g * np.cos(0.2) - g * np.sin(0.2)),
        {"alpha": 0.2, "der(y)": 1.5},
    ),
    "the oscillator turns round": Event(
        "friction_oscillator", (0.2, 0.4), direction("rest"), lambda: np.pi / 10
    ),
    "the oscillator comes to rest": Event(
        "friction_oscillator", (1.4, 1.7), sticks, lambda: 5 * np.pi / 10
    ),
    "the particle leaves the rough hemisphere": Event(
        "rough_hemisphere",
        (0.2, 1.2),
        touches("surface"),
        hemisphere_departs,
        {"theta": 0.4, "der(theta)": 0.9, "mu_k": 0.3, "a": 1.0},
        told=left,
    ),
    "the sphere slips": Event(
        "rolling_sphere", (0.5, 1.45), sticks, lambda: sphere()[0], told=slipped
    ),
    "the sphere leaves": Event(
        "rolling_sphere", (1.0, 2.0), touches("surface"), lambda: sphere()[1], told=left
    ),
    "the foot of the rod slips": Event(
        "falling_rod", (0.1, 0.6), sticks, rod_slips, {"mu": 0.3}, slipped
    ),
}


def located(one: Instance, event: Event, tolerance: float) -> float:
    """The time [s] at which what is read changes: as told, or by bisection with steps that are undone."""
    begin, end = event.between
    one.start(event.values, tolerance=tolerance)
    one.fmu.doStep(0.0, begin)
    before, state = event.reads(one), one.fmu.getFMUState()
    low, high = 0.0, end - begin
    one.fmu.doStep(begin, high)
    assert event.reads(one) != before
    if event.told is not None:
        return event.told(one)
    while low < (middle := (low + high) / 2) < high:
        one.fmu.setFMUState(state)
        one.fmu.doStep(begin, middle)
        if event.reads(one) == before:
            low = middle
        else:
            high = middle
    one.fmu.freeFMUState(state)
    return begin + high


@pytest.mark.parametrize("name", sorted(EVENTS))
def test_each_event_is_when_its_closed_form_says(rubbing: Rubbing, name: str) -> None:
    """Within ten tolerances of the time that has passed, from 1e-8 to 1e-12."""
    event = EVENTS[name]
    expected = float(event.time())
    for tolerance in (1e-8, 1e-10, 1e-12):
        with instance(rubbing(event.model)) as one:
            time = located(one, event, tolerance)
        assert abs(time - expected) < 10 * tolerance * expected


TRANSITIONS = {
    "sticks, then slips": EVENTS["the block on the belt slips"],
    "slips, then sticks": EVENTS["it rides again"],
    "slides, then rolls": EVENTS["the bowling ball rolls"],
    "turns round": EVENTS["the oscillator turns round"],
    "turns round and sticks": EVENTS["the oscillator comes to rest"],
    "lands and slides on": Event("bowling", (0.1, 0.3), touches("lane"), lambda: 0.0, {"z": 0.2}),
    "bounces": EVENTS["the puck bounces off the table"],
    "opens as it slips": EVENTS["the sphere leaves"],
    "rolls, then slips": EVENTS["the sphere slips"],
    "its foot slips": EVENTS["the foot of the rod slips"],
    "two rows come to rest": Event("puck", (0.2, 2.5), sticks, lambda: 0.0),
    "one foot is lifted, or both slip": Event(
        "two_feet", (0.1, 0.5), touches("up"), lambda: 0.0, {"y": 1.0}
    ),
}


@pytest.mark.parametrize("name", sorted(TRANSITIONS))
def test_rollback_across_each_kind_of_transition_changes_no_bit(
    rubbing: Rubbing, name: str
) -> None:
    """A step across it that is taken, undone and taken again (saved, and from the serialized state), after a
    shorter one that ends before it: every output is the same to the bit."""
    event = TRANSITIONS[name]
    begin, end = event.between
    with instance(rubbing(event.model)) as one:
        one.start(event.values)
        one.fmu.doStep(0.0, begin)
        before, state = event.reads(one), one.fmu.getFMUState()
        written = one.fmu.serializeFMUState(state)
        one.fmu.doStep(begin, end - begin)
        assert event.reads(one) != before
        first = one.outputs()
        one.fmu.setFMUState(state)
        one.fmu.doStep(begin, 1e-3 * (end - begin))
        one.fmu.setFMUState(state)
        one.fmu.doStep(begin, end - begin)
        assert one.outputs() == first
        one.fmu.doStep(end, 0.05)
        later = one.outputs()
        one.fmu.setFMUState(one.fmu.deSerializeFMUstate(written))
        one.fmu.doStep(begin, end - begin)
        assert one.outputs() == first
        one.fmu.doStep(end, 0.05)
        assert one.outputs() == later
        one.fmu.freeFMUState(state)
