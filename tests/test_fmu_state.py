"""Rollback, serialization, several FMUs and instances in one process."""

from __future__ import annotations

import os
import platform
import subprocess
import sys

import fmpy
import pytest
from instance import instance
from zoo.pendulums import on_hemisphere

from lagfmu import Scene, build_fmu

STEP = 0.05


def run(one, steps):
    record = []
    for _ in range(steps):
        one.step(STEP)
        record.append(one.outputs())
    return record


@pytest.mark.parametrize("method", ["dop853", "radau"])
@pytest.mark.parametrize("before", [pytest.param(10, marks=pytest.mark.thorough), 31])
def test_a_restored_state_repeats_the_motion_bit_for_bit(fmu, method, before):
    """From one state there is one future: also across the departure at 1.64 s, from a saved state and
    from its bytes in a fresh instance."""
    with instance(fmu("Hemisphere")) as one, instance(fmu("Hemisphere"), "fresh") as fresh:
        one.start({"solver.method": method, "theta": 0.02, "a": 1.5, "r": 1.5})
        run(one, before)
        state, moment = one.fmu.getFMUState(), one.time
        saved = one.fmu.serializeFMUState(state)
        first = run(one, 40)
        assert any(v["departure.surface.count"] == 1 for v in first)

        one.fmu.setFMUState(state)
        one.time = moment
        assert run(one, 40) == first
        one.fmu.freeFMUState(state)

        fresh.start()
        restored = fresh.fmu.deSerializeFMUstate(saved)
        fresh.fmu.setFMUState(restored)
        fresh.time = moment
        assert run(fresh, 40) == first


def test_every_state_of_a_run_can_be_restored(fmu):
    """Sliding, just departed, in flight: each moment, saved as bytes, has the same future in a fresh
    instance."""
    with instance(fmu("Hemisphere")) as one, instance(fmu("Hemisphere"), "fresh") as fresh:
        one.start({"theta": 0.3})
        fresh.start()
        saved = []
        for _ in range(12):
            state = one.fmu.getFMUState()
            saved.append((one.time, one.fmu.serializeFMUState(state)))
            one.fmu.freeFMUState(state)
            one.step(0.1)
        last = one.outputs()
        assert last["departure.surface.count"] == 1
        for moment, data in saved:
            fresh.fmu.setFMUState(fresh.fmu.deserializeFMUState(data))
            fresh.time = moment
            while fresh.time < one.time - 0.05:
                fresh.step(0.1)
            assert fresh.outputs() == last


def test_the_state_of_another_fmu_is_refused(fmu):
    """A saved state belongs to one system: Atwood's cannot become Hemisphere's."""
    with instance(fmu("Hemisphere")) as one, instance(fmu("Atwood")) as other:
        one.start()
        other.start()
        saved = other.fmu.serializeFMUState(other.fmu.getFMUState())
        with pytest.raises(Exception, match="failed with status"):
            one.fmu.setFMUState(one.fmu.deSerializeFMUstate(saved))
        assert any("belongs to another FMU" in message for _, _, message in one.log)


def test_two_versions_with_one_file_name_are_both_right(tmp_path):
    """lambda at the top is m g cos(theta0), then 2 m g cos(theta0) in doubled gravity: two FMUs of the
    same name in one process do not serve each other's equations."""
    paths = []
    for factor in (1.0, 2.0):
        paths.append(
            build_fmu(
                on_hemisphere("Same", 0.1, weight=factor),
                tmp_path / f"v{factor:g}",
                Scene("Same"),
                check=False,
            )
        )
    weights = []
    for path in (*paths, *paths):
        result = fmpy.simulate_fmu(str(path), stop_time=0.01, output_interval=0.01)
        weights.append(result["lambda.surface"][0])
    assert weights == pytest.approx([9.81 * 0.995004, 19.62 * 0.995004] * 2, rel=1e-6)


BLOCKED = """
import sys
class Block:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("sympy", "pint", "lagfmu", "typer", "rich", "matplotlib"):
            raise ImportError(f"{name} is not there")
sys.meta_path.insert(0, Block())
import fmpy
result = fmpy.simulate_fmu(sys.argv[1], stop_time=2.0, output_interval=0.1)
assert result["departure.surface.count"][-1] == 1
assert not [m for m in sys.modules if m == "sympy" or m == "lagfmu"]
"""


def test_an_fmu_needs_no_sympy_and_no_lagfmu(fmu):
    """The importing side has Python, NumPy and SciPy: the particle still leaves the hemisphere."""
    subprocess.run([sys.executable, "-c", BLOCKED, str(fmu("Hemisphere"))], check=True)


REUSED = """
import ctypes, sys
libc = ctypes.CDLL(None)
libc.wcsdup.restype = ctypes.c_void_p
ones = ctypes.c_void_p(libc.wcsdup(ctypes.c_wchar_p("\\1" * 31)))  # with its end, 128 bytes
for _ in range(64):
    libc.__cxa_atexit(libc.wcsdup, ones, None)
import fmpy
fmpy.simulate_fmu(sys.argv[1], stop_time=0.1, output_interval=0.1)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="looks into the heap of glibc")
def test_the_end_of_the_process_touches_no_freed_memory(fmu):
    """The handlers run after those of the FMU's library and take the blocks that it has just freed, full
    of ones: a second release finds a count of 1 and calls a destructor at an address that is none."""
    environment = {**os.environ, "GLIBC_TUNABLES": "glibc.malloc.tcache_count=65535"}
    command = [sys.executable, "-c", REUSED, str(fmu("Hemisphere"))]
    subprocess.run(command, env=environment, check=True)
