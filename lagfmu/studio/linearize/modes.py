"""The modes of a linearization as moving pictures, on one page that plays them.

A mode phi of the pole s moves the coordinates by

    q = q_e + eps Re(e^(i w t) phi) ,  w = |Im s| ,   one period, as if it were not damped
    q = q_e + eps e^(s t) phi                         a real pole, over a few of its times

and then onto f = 0.  eps is such that what moves furthest on the picture goes a tenth of the picture.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...errors import UsageError
from ...page.picture import names_in
from ..live.page import Playable
from ..live.play import Told, recorded
from ..live.shapes import Moving
from .chart import Chart, Rows
from .equilibrium import place
from .exchange import Exchange, Floats
from .result import HEAD, Complex, Linearization

FRAMES, FEW = 96, 8  # of a mode that is shown, and to find how far it goes
TIMES = 4  # of a real pole, that are shown
REACH, TRIAL = 0.1, 1e-3  # part of the picture; of a coordinate's size
MOST = 0.35  # rad, and of what has no unit: not further
QUICK, SLOW, LASTS = 1.0, 6.0, 2.5  # s: a mode of another length is shown within the last
FORCES = ("arrow",)


def modes(
    ex: Exchange,
    rows: Rows,
    inputs: Sequence[str],
    beside: Chart,
    found: Linearization,
    told: Told,
) -> Playable:
    """The page's parts: a run for each mode.  Raises UsageError where all poles are zero."""
    shown = [k for k, s in enumerate(found.poles.values) if s.imag >= 0]
    if not shown:
        raise UsageError(f"{found.name} has no modes to show: {found.stability}")
    picture = _still(told.picture, found.time)
    kept = {v.name for v in ex.description.modelVariables if v.causality == "output"}
    drawn = [s for s in picture["shapes"] if s["kind"] != "direction"] if picture else []
    columns = [*found.coordinates]
    columns += sorted(kept.intersection(*[set().union(*map(names_in, drawn))]) - {*columns})
    known = _known(ex)
    x, runs = ex.state(), []
    for k in shown:
        s, shape = found.poles.values[k], _phased(found, k)

        def frames(reach: float, count: int, s: complex = s, shape: Complex = shape) -> Any:
            ways = reach * np.real(np.exp(_exponents(s, count))[:, None] * shape)
            run = np.empty(count, [("time", float), *((n, float) for n in columns)])
            for row, way in zip(run, ways, strict=True):
                there = x.copy()
                there[ex.coordinate] += way
                place(ex, rows, inputs, beside, there)
                row["time"], *values = 0.0, *ex.read(columns)
                for n, value in zip(columns, values, strict=True):
                    row[n] = value
            run["time"] = np.linspace(0.0, _lasts(s), count)
            return run

        trial = TRIAL / float((np.abs(shape) / found.sizes).max())
        far = _part(drawn, frames(trial, FEW + 1), known)
        reach = min(trial * REACH / (far or TRIAL), _limit(found, shape))
        runs.append(frames(reach, FRAMES + 1))
    place(ex, rows, inputs, beside, x)
    made = recorded(replace(told, picture=picture), runs[0], known, runs[1:])
    made.facts["modes"] = [_words(found, k) for k in shown]
    made.facts["preset"]["curves"] = [*dict.fromkeys(m["curve"] for m in made.facts["modes"])]
    none = ["the model has no picture: its modes are shown as curves"] if picture is None else []
    words = {"summary": found.summary(), "remarks": [*none, *found.remarks()]}
    return replace(made, modes={**words, "head": HEAD, "rows": [found.row(k) for k in shown]})


def _still(picture: Mapping[str, Any] | None, t: float) -> dict[str, Any] | None:
    """Without forces, and as it is at t [s]."""
    if picture is None:
        return None
    return {**picture, "shapes": [_at(s, t) for s in picture["shapes"] if s["kind"] not in FORCES]}


def _at(shape: Any, t: float) -> Any:
    if isinstance(shape, Mapping):
        return {key: _at(value, t) for key, value in shape.items()}
    if isinstance(shape, list):
        return [_at(value, t) for value in shape]
    return t if shape == "time" else shape


def _known(ex: Exchange) -> dict[str, float]:
    """Parameters and inputs."""
    told = [n for n, rule in ex.rules.items() if rule.kind == "Real" and n not in ex.states]
    causes = {v.name: v.causality for v in ex.description.modelVariables}
    told = [n for n in told if causes[n] in ("parameter", "input")]
    return dict(zip(told, ex.read(told).tolist(), strict=True))


def _phased(found: Linearization, k: int) -> Complex:
    """A mode that begins where the coordinate that moves furthest in its size turns round; there it is 1."""
    shape = found.shapes[:, k]
    return np.asarray(shape / shape[np.argmax(np.abs(shape) / found.sizes)])


def _lasts(s: complex) -> float:
    return 2 * np.pi / abs(s.imag) if s.imag else TIMES / abs(s)


def _exponents(s: complex, count: int) -> Complex:
    times = np.linspace(0.0, _lasts(s), count)
    if s.imag:
        return np.asarray(1j * abs(s.imag) * times)
    return np.asarray(s.real * (times if s.real < 0 else times - times[-1]), dtype=complex)


def _limit(found: Linearization, shape: Complex) -> float:
    """How far a mode may go at most."""
    turns = [found.units.get(n, "1") in ("rad", "1") for n in found.coordinates]
    return MOST / max(float(np.abs(shape[turns]).max(initial=0.0)), 1e-300)


def _part(drawn: Sequence[Mapping[str, Any]], run: Any, known: Mapping[str, float]) -> float:
    """How far the picture's points go, as part of its size; 0 without one."""

    def look(name: str) -> Any:
        return run[name] if name in run.dtype.names else known.get(name, np.nan)

    shapes = [Moving(s, look, len(run)) for s in drawn]
    paths = [np.array([*s.points, *_rims(s)]) for s in shapes]
    paths = [p[np.isfinite(p).all(axis=(1, 2))] for p in paths]
    moving = [p for p in paths if len(p) and np.ptp(p, axis=1).max() > 0]
    if not moving:
        return 0.0
    ends = np.concatenate([p[:, 0] for p in moving])
    size = np.ptp(ends, axis=0).max()
    if not size > 0:  # one point: it is seen with what is around it
        size = np.ptp(np.concatenate([p[:, 0] for p in paths]), axis=0).max()
    far = max(float(np.linalg.norm(p - p[:, :1], axis=2).max()) for p in moving)
    return far / float(size) if size > 0 else 0.0


def _rims(shape: Moving) -> list[Floats]:
    """Points on the rim of a disk that turn with it, or stay on its sides."""
    if shape.radius is None or shape.facets:
        return []
    angle = np.zeros(shape.frames) if shape.angle is None else shape.angle
    ways = [angle + turn for turn in (0, np.pi / 2, np.pi, 3 * np.pi / 2)]
    radius = np.abs(shape.radius)[:, None]
    return [shape.points[0] + radius * np.stack([np.cos(a), np.sin(a)], axis=1) for a in ways]


def _words(found: Linearization, k: int) -> dict[str, Any]:
    """What the page says of a mode, and how many seconds of it pass in one of the reader's."""
    _, frequency, damping, _, moves = found.row(k)
    s = found.poles.values[k]
    lasts = _lasts(s)
    pace = 1.0 if QUICK <= lasts <= SLOW else lasts / LASTS
    title = f"{float(frequency):.4g} Hz" if frequency else f"{s.real:.4g} 1/s"
    told = [f"damping {damping}, not shown" if frequency else _grows(s.real), moves]
    if pace != 1:
        times = float(f"{max(pace, 1 / pace):.2g}")
        told.append(f"shown {times:g} times {'slower' if pace < 1 else 'faster'}")
    first = next(iter(found.mode(k)))
    return {"title": title, "words": "; ".join(told), "pace": pace, "curve": first}


def _grows(rate: float) -> str:
    return f"{'grows' if rate > 0 else 'decays'} by e in {1 / abs(rate):.4g} s"
