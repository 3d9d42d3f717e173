"""What frictions do while they slip, what they report, and what is watched for the end of it."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import names
from ..numeric.system import System, Vector
from ..numeric.thresholds import FRICTION_SLACK
from .flow import Flow
from .friction import loaded
from .instant import Motion
from .ranges import Range
from .state import State

NODES, WEIGHTS = np.polynomial.legendre.leggauss(5)  # of the work done by friction within a step


def is_slipping(flow: Flow) -> bool:
    """True if some friction does work."""
    on = loaded(flow.system, flow.rows)
    return any(presses and not s.sticks for presses, s in zip(on, flow.state.slides, strict=True))


def dissipated(flow: Flow, dense: Any, t0: float, t1: float) -> float:
    """- int sum lambda_t . s dt [J] over a part of a step (Gauss's rule of order 10).

    lambda_t dt is a momentum: lambda_t . s of g = 1e-300 m/s^2 is below the smallest double.
    """
    if not t1 > t0 or not is_slipping(flow):
        return 0.0
    work, half = 0.0, (t1 - t0) / 2
    for node, weight in zip(NODES, WEIGHTS, strict=True):
        t = t0 + half * (1 + node)
        q, v = flow.split(dense(t))
        press = flow.near(t, q, v).press
        work += float((weight * half * press.tangential * press.slip).sum())
    return -work


def power(now: Motion) -> Vector:
    """lambda_t . s [W] of each friction."""
    press = now.press
    return np.asarray((press.tangential * press.slip).sum(axis=1))


def observed(system: System, state: State, now: Motion) -> dict[str, float | int | bool]:
    """What frictions report, by name."""
    press, work = now.press, power(now)
    values: dict[str, float | int | bool] = {names.DISSIPATED: state.dissipated}
    for i, (f, slide) in enumerate(zip(system.frictions, state.slides, strict=True)):
        on = bool(press.loaded[i])
        force = float(np.hypot(*press.tangential[i]))
        values[names.name(names.STICKS, f.name)] = on and slide.sticks
        for j, k in enumerate(f.rows):
            values[names.name(names.SLIP, system.rows[k].name)] = float(press.slip[i, j])
        values[names.name(names.MARGIN, f.name)] = float(press.static[i] * press.normal[i]) - force
        values[names.name(names.POWER, f.name)] = 0.0 if slide.sticks else float(work[i])
        latest = state.slippings[i]
        values[names.name(names.SLIPS, f.name)] = latest.count
        values[names.name(names.SLIP_TIME, f.name)] = latest.time
        for j, name in enumerate(system.coordinates):
            values[names.name(names.SLIPPING, f.name, name)] = latest.q[j]
            values[names.name(names.SLIPPING, f.name, name, 1)] = latest.v[j]
    return values


def indicators(flow: Flow, now: Motion) -> list[float]:
    """Two a friction: the reserve of the cone while it sticks, the slip velocity along its direction
    while it slips; and the normal force while it slips on what is no contact."""
    press = now.press
    values = []
    for i, (f, slide) in enumerate(zip(flow.system.frictions, flow.state.slides, strict=True)):
        if not press.loaded[i]:
            values += [1.0, 1.0]
        elif slide.sticks:
            values += [float(press.reserve[i]), 1.0]
        else:
            values += [
                float(press.slip[i] @ np.array(slide.direction)),
                1.0 if f.gated else float(press.normal[i]),
            ]
    return values


def ranges(flow: Flow) -> list[Range]:
    """The range of each; what begins on the edge has to get inside before it can leave there."""
    found = []
    for slide in flow.state.slides:
        found += [
            Range(0.0, slack=FRICTION_SLACK if slide.sticks else slide.noise, rises=True),
            Range(0.0),
        ]
    return found
