"""What comes with fmi2OK is a number, and what an FMU saves it takes back, whatever was set."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from ctypes import byref, c_double, c_size_t
from pathlib import Path

import pytest
from fmi2 import CO_SIMULATION, EXCHANGE, Library, Single
from single import DISCARD, OK

from lagfmu import Scene
from lagfmu.testing import find_compiler, load

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
UNSEEN = Path(__file__).parent / "unseen"
HEAD = 80  # bytes before the record: magic, layout, byte order, size, checksum, GUID
EXTREME = (1e300, -1e300, 1e308, -1e308, 1e150, -1e150, 1e-300, 1e100, 1.0, 0.0, 5e-324, -1e20)


@pytest.fixture
def rough(built: Callable[..., Path], library: Callable[..., Library]) -> Callable[..., Library]:
    """rough(NAME): the native FMU of unseen/NAME.py, of friction and forces from outside."""

    def get(name: str, error_bars: bool = False) -> Library:
        model = load(UNSEEN / f"{name}.py").model
        return library(built(model, Scene(model.name, error_bars=error_bars)))

    return get


def check(one: Single) -> None:
    """All that can be read is finite or refused; the state that is saved comes back."""
    for name, variable in one.library.variables.items():
        value = c_double()
        if (
            variable.type == "Real"
            and one.call("GetReal", *one.set_call(name, 0.0)[:2], byref(value)) == OK
        ):
            assert math.isfinite(value.value), name
    state = one.saved()
    one.does("SetFMUstate", state)
    one.does("FreeFMUstate", byref(state))


def check_arrays(one: Single) -> None:
    description = one.library.description
    sizes = dict.fromkeys(("Derivatives", "ContinuousStates"), description.numberOfContinuousStates)
    for name, size in (sizes | {"EventIndicators": description.numberOfEventIndicators}).items():
        values = (c_double * size)()
        if one.call(f"Get{name}", values, c_size_t(size)) == OK:
            assert all(map(math.isfinite, values)), name


@pytest.mark.parametrize("kind", [CO_SIMULATION, EXCHANGE])
@pytest.mark.parametrize("name", ["pushed_block", "guided_slider", "clamped_puck"])
def test_extremes_are_finite_or_refused(
    rough: Callable[..., Library], name: str, kind: int
) -> None:
    """Parameters, starts and forces up to 1e308 and down to 5e-324, at random."""
    library, chance = rough(name), random.Random(2)
    settable = [
        n
        for n, v in library.variables.items()
        if v.type == "Real" and v.start is not None and not n.startswith("solver")
    ]
    forces = [n for n, v in library.variables.items() if v.causality == "input"]
    for _ in range(60):
        one = library(kind=kind)
        for variable in chance.sample(settable, chance.choice([0, 1, 1, 2])):
            one.call("SetReal", *one.set_call(variable, chance.choice(EXTREME)))
        one.does("EnterInitializationMode")
        check(one)
        if kind == EXCHANGE:
            check_arrays(one)
        if one.call("ExitInitializationMode") == OK and kind == CO_SIMULATION:
            for h in (1e-3, 1e-9, 1.0):
                for variable in forces:
                    one.call("SetReal", *one.set_call(variable, chance.choice(EXTREME)))
                check(one)
                if one.call("DoStep", c_double(one.time), c_double(h), 1) == OK:
                    one.time += h
                check(one)


def test_a_step_that_fails_leaves_the_saved_state_as_it_was(rough: Callable[..., Library]) -> None:
    """Error bars widen with a step that is done; of one that is discarded only the mode is left."""
    one = rough("pushed_block", error_bars=True)().start({"der(x)": 1.0}, tolerance=1e-6)
    one.step(0.1)
    one.set("F", 2.0)
    one.step(0.3)
    one.set("F", 1e300)
    one.set("P", -1e300)
    before = one.bytes_of(one.saved())
    one.refuses("DoStep", c_double(one.time), c_double(1.0), 1, status=DISCARD)
    after = one.bytes_of(one.saved())
    words = range(HEAD, len(before), 4)
    assert sum(before[k : k + 4] != after[k : k + 4] for k in words) == 1
