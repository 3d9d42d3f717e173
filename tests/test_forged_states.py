"""Saved states come back from files, and anyone can write a file with the right checksum."""

from __future__ import annotations

import json
import math
import random
import struct
import subprocess
import sys
import zlib
from ctypes import c_double
from pathlib import Path

import pytest
from fmi2 import EXCHANGE, Library, Single
from fmpy.fmi1 import FMICallException
from instance import instance
from single import OK
from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Holonomic, Input, Model, Parameter

HEAD = 80  # bytes before the record: magic, layout, byte order, size, checksum, GUID
SUM = 24  # where the checksum stands
INTS = (-1, 2, 7, 2**31 - 1, -(2**31), 0x3FFFFFFF)
DOUBLES = (math.nan, math.inf, -math.inf, -1.0, 0.0, 5e-324, 1e300, -1e300, 1e9, 3.5)


def forged(saved: bytes, offset: int, word: bytes) -> bytes:
    """Other bytes at a place of the record, and the checksum that belongs to them (FNV-1a)."""
    record = saved[HEAD:offset] + word + saved[offset + len(word) :]
    total = 14695981039346656037
    for byte in record:
        total = (total ^ byte) * 1099511628211 % 2**64
    return saved[:SUM] + struct.pack("=Q", total) + saved[SUM + 8 : HEAD] + record


def use(one: Single, exchange: bool) -> None:
    """What an importer does next; each call may be refused, none may take the process down."""
    one.call("GetFMUstate", one.spare)
    names = [n for n, v in one.library.variables.items() if v.type == "Real"]
    for _ in range(2):
        if exchange:
            one.call("EnterEventMode")
            one.call("EnterContinuousTimeMode")
            values = (c_double * 20)()
            one.call("GetDerivatives", values, len(one.library.states))
        else:
            one.call("DoStep", c_double(one.time), c_double(0.02), 1)
            one.time += 0.02
        found = (c_double * len(names))()
        if one.call("GetReal", one.references(names), len(names), found) == OK:
            assert all(map(math.isfinite, found)), "not finite, with fmi2OK"
    one.call("SetFMUstate", one.good)


def attack(path: str, folder: str, kind: str, seed: int, count: int = 500) -> None:
    """In a process of its own: hostile words at every place of states of each phase of a life."""
    import ctypes

    library = Library(Path(path), Path(folder))
    library.states = [v for v in library.variables.values() if v.derivative is not None]
    exchange = kind == "exchange"
    options = {"kind": EXCHANGE} if exchange else {}
    one = library(**options)
    one.spare = ctypes.byref(ctypes.c_void_p())
    lives = [(0.0, one.bytes_of(one.saved()))]
    one.start({}, tolerance=1e-8, stop=50.0)
    lives.append((0.0, one.bytes_of(one.saved())))
    if not exchange:
        for _ in range(3):
            one.step(0.05)
        lives.append((one.time, one.bytes_of(one.saved())))
    one.good = one.saved()
    good = one.outputs()
    chance, accepted, refused = random.Random(seed), 0, 0
    for moment, saved in lives:
        attacks = [(k, struct.pack("=i", i)) for k in range(HEAD, len(saved), 4) for i in INTS]
        attacks += [(k, struct.pack("=d", x)) for k in range(HEAD, len(saved), 8) for x in DOUBLES]
        for offset, word in chance.sample(attacks, count):
            state = ctypes.c_void_p()
            data = forged(saved, offset, word)
            if one.call("DeSerializeFMUstate", data, len(data), ctypes.byref(state)) != OK:
                continue
            one.time = moment
            if one.call("SetFMUstate", state) == OK:
                accepted += 1
                use(one, exchange)
            else:
                refused += 1
                assert "state" in one.log[-1][2], one.log[-1]
            one.does("FreeFMUstate", ctypes.byref(state))
            assert one.outputs() == good
    print(accepted, refused)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("BouncingBall", "steps"),
        ("Hemisphere", "exchange"),
        *(
            pytest.param(name, "steps", marks=pytest.mark.thorough)
            for name in ("Hemisphere", "CartPendulum", "Chain")
        ),
    ],
)
def test_a_forged_state_is_refused_or_harmless(native_fmu, tmp_path, name, kind):
    """Modes, counts, times and indices that no simulation has, with the right checksum: the process
    lives, nothing that is not finite comes with fmi2OK, and the instance is as it was before."""
    done = subprocess.run(
        [sys.executable, __file__, str(native_fmu(name)), str(tmp_path), kind, "1"],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, (done.returncode, done.stderr[-2000:])
    accepted, refused = map(int, done.stdout.split())
    assert refused > 200
    assert accepted > 100  # most doubles can be anything finite


def whole_words(saved: bytes) -> list[int]:
    """The record as whole numbers, four bytes each."""
    return list(struct.unpack(f"={(len(saved) - HEAD) // 4}i", saved[HEAD:]))


def reasons(one: Single, saved: bytes, places: list[int], word: bytes) -> list[str]:
    """What is said of the state with another word at each of the places."""
    found = []
    for place in places:
        state, data = one.loaded(forged(saved, place, word)), one.saved()
        found.append(one.refuses("SetFMUstate", state))
        one.does("SetFMUstate", data)
    return found


def test_a_method_that_the_fmu_does_not_hold_is_refused(library):
    """Wherever one state has the number of rk4 and the other that of radau, no other number will do."""
    states = []
    for method in ("rk4", "radau"):
        one = library("PendulumCartesian")()
        one.set("solver.method", method)
        states.append(one.bytes_of(one.saved()))
    pairs = enumerate(zip(*map(whole_words, states), strict=True))
    places = [HEAD + 4 * k for k, pair in pairs if pair == (3, 4)]
    for number in (-1, 0, 1_000_000):
        said = reasons(one, states[1], places, struct.pack("=i", number))
        assert said
        assert all("method" in text for text in said)


def test_a_contact_is_open_or_closed(library):
    """Of the numbers that a departure changes from 1 to 0 one is the contact's mode; 2 is none."""
    one = library("Hemisphere")().start()
    states = [one.bytes_of(one.saved())]
    while one.get("lambda.surface") > 0:
        one.step(0.5)
    states.append(one.bytes_of(one.saved()))
    pairs = enumerate(zip(*map(whole_words, states), strict=True))
    places = [HEAD + 4 * k for k, pair in pairs if pair == (1, 0)]
    one.does("SetFMUstate", one.loaded(states[0]))
    said = []
    for place in places:
        state = one.loaded(forged(states[0], place, struct.pack("=i", 2)))
        if one.call("SetFMUstate", state) != OK:
            said.append(one.log[-1][2])
    assert any("modes" in text for text in said)


@pytest.mark.parametrize("steps", [2**30, 2**31 - 2, 2**40])
def test_a_run_may_last(library, steps):
    """The state of a run of so many internal steps (2^31 in 60 h at 1e-4 s) is one: it goes on from there and
    saves itself again; `solver.steps` shows the most that an Integer holds."""
    one = library("CartPendulum")().start()
    while one.integer("solver.steps") < 137:
        one.step(0.1)
    before, saved = one.integer("solver.steps"), one.bytes_of(one.saved())
    word = struct.pack("=q", before)
    places = [k for k in range(HEAD, len(saved) - 7, 8) if saved[k : k + 8] == word]
    assert len(places) == 1
    one.step(0.1)
    more = one.integer("solver.steps") - before
    assert more > 2
    one.time -= 0.1
    one.does("SetFMUstate", one.loaded(forged(saved, places[0], struct.pack("=q", steps))))
    one.step(0.1)
    assert one.integer("solver.steps") == min(steps + more, 2**31 - 1)
    one.does("SetFMUstate", one.loaded(one.bytes_of(one.saved())))
    one.step(0.1)


def test_a_coordinate_is_a_number(library):
    """NaN in place of a coordinate, wherever the saved state holds it."""
    one = library("PendulumCartesian")().start()
    one.step(0.3)
    saved, value = one.bytes_of(one.saved()), struct.pack("=d", one.get("x"))
    saved = one.bytes_of(one.saved())  # as it was read
    places = [k for k in range(HEAD, len(saved) - 7, 8) if saved[k : k + 8] == value]
    said = reasons(one, saved, places, struct.pack("=d", math.nan))
    assert any("coordinates" in text for text in said)


def test_a_start_by_a_joint_coordinate_is_a_number(library):
    """NaN in place of the angle that was set, which no coordinate has yet."""
    one = library("SliderCrankBodies")()
    one.set("angle.A", 2.2)
    saved, value = one.bytes_of(one.saved()), struct.pack("=d", 2.2)
    places = [k for k in range(HEAD, len(saved) - 7, 8) if saved[k : k + 8] == value]
    (said,) = reasons(one, saved, places, struct.pack("=d", math.nan))
    assert "start values" in said


def test_an_estimated_motion_has_no_more_points_than_there_is_room_for(built, library):
    """One point more is kept at each step, up to four; five are refused."""
    place, drive = dynamicsymbols("x u")
    mass = symbols("m", positive=True)
    model = Model(
        name="Estimating",
        lagrangian=mass * place.diff() ** 2 / 2,
        coordinates={place: "m"},
        constraints=[Holonomic("held", place - drive)],
        parameters=[Parameter(mass, 1.0, "kg")],
        inputs=[Input(drive, "m", rates="estimated")],
        start={place: 0.0},
    )
    one, states = library(built(model))().start(), []
    for k in range(5):
        one.set("u", 0.01 * k)
        one.step(0.1)
        states.append(one.bytes_of(one.saved()))
    counts = enumerate(zip(*map(whole_words, states), strict=True))
    places = [HEAD + 4 * k for k, word in counts if word == (1, 2, 3, 4, 4)]
    said = reasons(one, states[-1], places, struct.pack("=i", 5))
    assert said
    assert all("past of an input" in text for text in said)


def forged_text(saved: bytes, change) -> bytes:
    """The same for a python FMU, whose states are JSON behind a CRC-32."""
    whole = json.loads(saved.rstrip(b"\0").partition(b" ")[2])
    change(whole, whole["state"])
    text = json.dumps(whole).encode()
    return b"%08x %s" % (zlib.crc32(text), text)


CHANGES = {
    "method": lambda whole, inner: whole["settings"].update(method="euler"),
    "another field": lambda whole, inner: whole["settings"].update(more=1),
    "tolerance": lambda whole, inner: whole["settings"].update(tolerance=0.0),
    "too large a tolerance": lambda whole, inner: whole["settings"].update(tolerance=1e3),
    "too large a tolerance of the experiment": lambda whole, inner: whole.update(
        experiment=[0.0, 1.0, 2.0]
    ),
    "not a number": lambda whole, inner: inner.update(t=math.nan),
    "one coordinate too few": lambda whole, inner: inner["q"].pop(),
    "one contact too many": lambda whole, inner: inner["closed"].append(True),
    "a text as a velocity": lambda whole, inner: inner["v"].__setitem__(0, "1"),
    "a number as a mode": lambda whole, inner: inner["closed"].__setitem__(0, 2),
    "a negative count": lambda whole, inner: inner["departures"][0].update(count=-1),
    "an endless number": lambda whole, inner: inner.update(steps=10**400),
    "a negative rate": lambda whole, inner: whole["settings"].update(rate=-1.0),
    "a size too few": lambda whole, inner: whole["settings"]["size"].pop(),
    "an event that never was": lambda whole, inner: inner["departures"][0].update(count=1),
    "a parameter out of bounds": lambda whole, inner: whole["values"].__setitem__(0, -1.0),
    "a parameter that is none": lambda whole, inner: whole["values"].__setitem__(0, None),
    "too few values": lambda whole, inner: whole["values"].pop(),
    "no state of a running FMU": lambda whole, inner: whole.update(state=None),
    "a mode": lambda whole, inner: whole.update(running="yes"),
    "an experiment": lambda whole, inner: whole.update(experiment=[0.0, -1.0, 0.0]),
    "half an experiment": lambda whole, inner: whole.update(experiment=[0.0]),
    "a field left out": lambda whole, inner: whole.pop("values"),
}


def test_a_forged_state_of_a_python_fmu_is_refused_in_words(python_fmu):
    """Other types, lengths and ranges than the FMU saves, with the right check sum: refused without an
    internal error, and the instance goes on as if nothing had been."""
    with (
        instance(python_fmu("Hemisphere")) as one,
        instance(python_fmu("Hemisphere"), "b") as other,
    ):
        for x in (one, other):
            x.start()
            x.step(0.05)
        saved = one.fmu.serializeFMUState(one.fmu.getFMUState())
        for name, change in CHANGES.items():
            count = len(one.log)
            with pytest.raises(FMICallException):
                one.fmu.setFMUState(one.fmu.deSerializeFMUstate(forged_text(saved, change)))
            told = " ".join(text for _, _, text in one.log[count:])
            assert "none of this FMU's" in told, (name, told)
            assert "internal error" not in told, (name, told)
        one.fmu.setFMUState(
            one.fmu.deSerializeFMUstate(forged_text(saved, lambda whole, inner: None))
        )
        one.step(0.05)
        other.step(0.05)
        assert one.outputs() == other.outputs()


def test_bytes_nested_without_end_are_refused(python_fmu):
    """JSON of 100,000 brackets: its reader gives up, the FMU says so and lives on."""
    text = b"[" * 100_000
    with instance(python_fmu("Hemisphere")) as one:
        one.start()
        with pytest.raises(FMICallException):
            one.fmu.setFMUState(one.fmu.deSerializeFMUstate(b"%08x %s" % (zlib.crc32(text), text)))
        one.step(0.05)


if __name__ == "__main__":
    attack(*sys.argv[1:4], *map(int, sys.argv[4:]))
