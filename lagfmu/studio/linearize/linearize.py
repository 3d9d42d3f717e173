"""`linearize`: the linear system beside an equilibrium of an FMU, or a state of its motion."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ... import names
from ...errors import SettingError, SimulationError, UsageError
from ...files import write_whole
from ...fmu.read import described_rules, kind_of, read_description
from ...fmu.session import Session
from ...fmu.target import NATIVE, missing_for_native
from ...fmu.write import write
from ...interface.variables import problems_of
from ...model.file import fmu_at, in_scene
from ...model.model import Model
from ...model.scene import EVERYTHING, Scene, select
from ...prepare.prepare import prepare
from ..live.page import render
from ..live.play import told_by
from .chart import Chart, Rows, acting, chart, check_contacts, check_sliding
from .equilibrium import find
from .exchange import Exchange
from .modes import modes
from .result import ZERO, Linearization, poles

ROUNDING = 1e-14  # part of the largest rate, that is none in A
DEPENDENT = 1e-9  # likewise where rows depend on each other, whose accelerations the FMU takes differences of
SKIPPED = (names.RESIDUAL, names.EQUATION, names.SLIP, names.MARGIN, names.POWER)


def linearize(
    source: str | os.PathLike[str] | Model,
    *,
    at: float | None = None,
    equilibrium: bool = False,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    start_values: Mapping[str, Any] | None = None,
    scene: Scene | str | None = None,
    page: str | os.PathLike[str] | None = None,
) -> Linearization:
    """A, B, C, D of a model, a model file or an FMU, in coordinates that its constraints leave free.

    Beside its start; `at`: beside the state of its motion at that time [s]; `equilibrium`: beside the
    equilibrium that Newton's method finds from the start.  `inputs` and `outputs`: names and patterns (all
    Real ones; of outputs multipliers, forces of constraint and those of the model's own).  `page`: an HTML
    file to be written, on which the modes move.  Raises
    SettingError for names, SimulationError where there is no equilibrium, where a friction slides, a contact
    grazes, or has departed before `at`.
    """
    if equilibrium and at is not None:
        raise UsageError("an equilibrium has no time: give one of `equilibrium` and `at`")
    if at is not None and not (np.isfinite(at) and at >= 0):
        raise UsageError(f"at = {at!r}, expected a time of 0 s or later")
    given = dict(start_values or {})
    with made_for(source, scene) as path:
        description = read_description(path)
        driven, told = _asked(description, inputs, outputs, given)
        values = given if at is None else _state_at(path, at, given)
        if equilibrium:
            values = {**dict.fromkeys(_moved(description), 0.0), **values}
            values |= dict.fromkeys(_speeds(description), 0.0)
        known = [v.name for v in description.modelVariables if v.causality == "input"]
        fed = {n: values.pop(n) for n in known if n in values}
        with Exchange(path, description) as ex:
            ex.begin(values, fed, at or 0.0)
            check_sliding(ex)
            rows = acting(ex)
            if equilibrium:
                beside = find(ex, rows, driven, at or 0.0)
                check_contacts(ex)
            else:
                check_contacts(ex)
                beside = chart(ex, rows, driven)
            found = _made(
                ex,
                description,
                rows,
                beside,
                driven,
                told,
                at or 0.0,
                equilibrium,
                outputs is not None,
            )
            if page is not None:
                shown = modes(ex, rows, driven, beside, found, told_by(path))
                write_whole(Path(page), render(shown).encode())
            return found


@contextlib.contextmanager
def made_for(
    source: str | os.PathLike[str] | Model, scene: Scene | str | None = None
) -> Iterator[Path]:
    """An FMU as it is, if it can be linearized; of a model one that tells everything of its motion."""
    path = fmu_at(source, scene)
    if path is not None:
        _check_fmu(path)
        yield path
        return
    if missing := missing_for_native():
        raise SimulationError(f"a linearization needs a native FMU: {missing}")
    chosen = in_scene(source, scene)
    told = replace(
        chosen.scene,
        outputs=EVERYTHING,
        error_bars=False,
        sensitivities=(),
        derivatives=None,
        accuracy=None,
        reals_only=False,
    )
    with tempfile.TemporaryDirectory(prefix="lagfmu_") as folder:
        yield write(prepare(chosen.model, told), folder, (), NATIVE)


def _check_fmu(path: Path) -> None:
    """Raises SimulationError where an FMU does not tell enough."""
    description = read_description(path)
    if not (description.generationTool or "").startswith("lagfmu"):
        raise SimulationError(
            f"{str(path)!r} is of {description.generationTool or 'another tool'}, expected an FMU of lagfmu, "
            "which tells its constraints"
        )
    if description.modelExchange is None:
        raise SimulationError(
            f"{str(path)!r} has no model exchange, whose functions a linearization calls: build it natively, "
            "without --error-bars and --sensitivities, or give the model file"
        )
    if any(v.dimensions for v in description.modelVariables):
        raise SimulationError(
            f"{str(path)!r} tells its multipliers in arrays (--arrays), expected one by one: build it "
            "without, or give the model file"
        )
    states = [u.variable.derivative for u in description.derivatives]
    hidden = [v.name for v in states if v.causality == "local"]
    if hidden:
        raise SimulationError(
            f"{str(path)!r} was built for chosen outputs (--outputs) and does not tell "
            f"{', '.join(hidden[:3])} and its constraints: build it without --outputs, or give the model file"
        )


def _moved(description: Any) -> list[str]:
    """Rates of inputs that are prescribed motions: an importer drives them, and where it rests they are 0."""
    inputs = [v.name for v in description.modelVariables if v.causality == "input"]
    return [n for n in inputs if names.read(n).order > 0]


def _speeds(description: Any) -> list[str]:
    """Velocities that may be set."""
    rules = described_rules(description)
    found = [u.variable.derivative.name for u in description.derivatives]
    places = {names.rate_of(n) for n in found}
    return [
        n
        for n, rule in rules.items()
        if rule.begins and n != names.DISSIPATED and (n in places or _is_speed(description, n))
    ]


def _is_speed(description: Any, name: str) -> bool:
    return any(
        u.variable.derivative.name == name
        and not (u.variable.description or "").startswith(names.VELOCITY_OF)
        for u in description.derivatives
    )


def _asked(
    description: Any,
    inputs: Sequence[str] | None,
    outputs: Sequence[str] | None,
    given: Mapping[str, Any],
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of inputs and outputs.  Raises SettingError with every problem."""
    real = [v for v in description.modelVariables if kind_of(v) == "Real"]
    states = {u.variable.derivative.name for u in description.derivatives}
    known = [v.name for v in real if v.causality == "input"]
    told = [v.name for v in real if v.causality == "output" and v.variability == "continuous"]
    told = [n for n in told if n != names.DISSIPATED]
    usual = [n for n in told if n not in states and names.read(n).quantity not in SKIPPED]
    usual = [n for n in usual if names.read(n).order == 0 and names.read(n).head != names.ENERGY]
    usual = [
        n for n in usual if not (names.read(n).quantity == names.FORCE and names.read(n).constraint)
    ]
    problems = problems_of(described_rules(description), given)
    driven = tuple(known) if inputs is None else select(inputs, known, "input", problems)
    read = tuple(usual) if outputs is None else select(outputs, told, "output", problems)
    if problems:
        raise SettingError("; ".join(problems))
    return driven, read


def _state_at(path: Path, at: float, given: Mapping[str, Any]) -> dict[str, Any]:
    """The start values, with the state at `at` [s] in place of the start."""
    with Session(path) as session:
        counts = names.those(session.outputs, *names.COUNTS)
        settable = [n for n, rule in session.rules.items() if rule.begins]
        read = [*settable, *session.inputs, *counts]
        times = names.those(session.outputs, *names.COUNT_OF)
        run = session.run([0.0, at] if at > 0 else [0.0], given, None, [*read, *times])
        if run.refusal is not None:
            raise SimulationError(f"the run to t = {at:g} s fails: {run.refusal.message}")
        row = {n: run.rows[n][-1] for n in [*read, *times]}
    for n in times:
        event = names.read(n)
        if row[names.name(names.COUNT_OF[event.quantity], event.constraint)]:
            raise SimulationError(
                f"{n.removesuffix('.time')} is at {row[n]:.6g} s, before t = {at:g} s: the mechanism is no "
                "longer the one that starts: choose an earlier time, or start in the mode that is meant"
            )
    return {**given, **{n: float(row[n]) for n in [*settable, *session.inputs]}}


def _made(
    ex: Exchange,
    description: Any,
    rows: Rows,
    beside: Chart,
    inputs: Sequence[str],
    outputs: Sequence[str],
    t: float,
    equilibrium: bool,
    chosen: bool,
) -> Linearization:
    by = np.eye(len(inputs))
    redundant = _redundant(ex)
    least = DEPENDENT if redundant else 0.0 if ex.derivatives else 100 * ex.error
    A, B = beside.matrix(ex.size, max(ROUNDING, least)), beside.E @ beside.B
    outputs = _unique(outputs, redundant, chosen)
    C = ex.along(outputs, inputs, beside.T)
    D = ex.along(outputs, inputs, beside.K, by)
    found = poles(A, beside.names, max(ZERO, least))
    q = ex.coordinate
    point = dict(zip(ex.states, ex.state().tolist(), strict=True))
    rate = beside.E @ ex.rate()
    still = not (np.abs(ex.rate()) > 1e-9 * np.maximum(ex.size, 1e-300)).any()
    read = [*beside.names]
    places = {n: k for k, n in enumerate(ex.states)}
    shapes = beside.T[q] @ found.vectors
    sizes = ex.size[q]
    turning = 0.0 if still else _drift(ex, rows, inputs, beside)
    return Linearization(
        name=description.modelName,
        time=t,
        equilibrium=equilibrium or still,
        states=tuple(beside.names),
        inputs=tuple(inputs),
        outputs=tuple(outputs),
        A=A,
        B=B,
        C=C,
        D=D,
        point=point,
        at_states=np.array([point[n] if n in places else ex.read([n])[0] for n in read]),
        at_inputs=ex.read(inputs),
        at_outputs=ex.read(outputs),
        rates=rate,
        poles=found,
        coordinates=tuple(n for n, is_q in zip(ex.states, q, strict=True) if is_q),
        shapes=shapes,
        sizes=sizes,
        units={n: ex.unit.get(n) or "1" for n in ex.rules},
        redundant=redundant,
        stuck=tuple(rows.stuck),
        error=None if ex.derivatives else max(ex.error, 1e-15),
        drift=turning,
    )


def _unique(outputs: Sequence[str], redundant: Sequence[str], chosen: bool) -> tuple[str, ...]:
    """Outputs that have one value: without those that redundant constraints leave open.

    Raises SettingError where such a one was chosen."""
    forces = {names.name(names.MULTIPLIER, c) for c in redundant}
    gone = [n for n in outputs if n in redundant or n in forces]
    if gone and chosen:
        raise SettingError(
            f"{', '.join(gone)}: redundant constraints leave it open, and it has no derivative: choose other "
            "outputs, such as Q.*"
        )
    return tuple(n for n in outputs if n not in gone)


def _redundant(ex: Exchange) -> tuple[str, ...]:
    """Multipliers that are not unique."""
    told = [n for n in ex.rules if names.read(n).quantity == names.UNIQUE]
    return tuple(
        names.read(n).constraint for n, on in zip(told, ex.read(told), strict=True) if not on
    )


def _drift(ex: Exchange, rows: Rows, inputs: Sequence[str], beside: Chart) -> float:
    """How much A changes along the motion in the time of its fastest pole, relative to A."""
    A = beside.E @ beside.A
    if not len(A):
        return 0.0
    norm = float(np.abs(np.linalg.eigvals(A)).max(initial=0.0))
    rate, x = ex.rate(), ex.state()
    quick = max(norm, float((np.abs(rate) / ex.size).max(initial=0.0)))
    if quick == 0:
        return 0.0
    ex.put(x + 1e-3 / quick * rate)
    of_x = ex.along(ex.rates, inputs, beside.T)
    ex.put(x)
    return float(np.abs(beside.E @ of_x - A).max() / (1e-3 * max(float(np.abs(A).max()), 1e-300)))
