"""Rates of prescribed motions: told where they are left alone, estimated where the model says so."""

from __future__ import annotations

import numpy as np
import pytest
from instance import instance

W = np.pi / 8.0


def motion(t: float) -> tuple[float, float, float]:
    """A smooth hoist by 4 m in 8 s: l, l', l''."""
    return (
        8.0 - 2.0 * (1 - np.cos(W * t)),
        -2.0 * W * np.sin(W * t),
        -2.0 * W**2 * np.cos(W * t),
    )


def told(path, h: float, connected: int, still: bool = False) -> list[str]:
    """The warnings of a run in which the first `connected` of l, l', l'' are set at each point."""
    with instance(path) as one:
        one.start({"der(l)": 0.0, "der(x)": 0.0, "der(y)": 0.0})
        for k in range(round(4.0 / h)):
            values = motion(0.0 if still else k * h)
            for name, value in list(zip(("l", "der(l)", "der(l,2)"), values, strict=True))[
                :connected
            ]:
                one.set(name, value)
            one.step(h)
        return [text for _, _, text in one.log if "rates" in text]


@pytest.mark.parametrize("target", ["python", "native"])
@pytest.mark.parametrize("connected", [1, 2])
def test_a_motion_that_is_half_connected_is_told(target, connected, native_fmu, python_fmu):
    """l alone, or l and l' without l'': one warning, that names the input and both remedies."""
    fmu = native_fmu if target == "native" else python_fmu
    (text,) = told(fmu("Crane"), 0.1, connected)
    for part in ("prescribed motion l has moved", "connect all three", 'rates="estimated"'):
        assert part in text


@pytest.mark.parametrize("h", [0.02, 0.1, 0.5, 1.0])
def test_a_motion_that_is_connected_is_not_told(native_fmu, h):
    """All three, at fine and coarse steps (a sixteenth of the period), and a rope that is held."""
    assert told(native_fmu("Crane"), h, 3) == []
    assert told(native_fmu("Crane"), h, 2, still=True) == []
