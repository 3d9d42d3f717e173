"""An FMU under probes: what it says of itself, and its runs with what the judge has to know of them."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ... import names
from ...errors import VerificationError
from ...fmu.closed_forms import CarriedForm, unpack_closed_forms
from ...fmu.read import (
    Trajectory,
    experiment_of,
    file_stem,
    joint_starts,
    kind_of,
    read_description,
    target_in,
)
from ...fmu.session import RefusalError, Session
from ...methods import integrators
from ...verification.verify import closed_forms_in

Dimension = tuple[int, ...]  # exponents of kg, m, s, A, K, mol, cd, rad
BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


@dataclass(frozen=True)
class Settable:
    """A Real that the importer may set before the initialization: its start and its bounds."""

    name: str
    start: float
    minimum: float | None
    maximum: float | None

    def allows(self, value: float) -> bool:
        """True if the value is inside the bounds, which themselves do not count as inside."""
        low = self.minimum is None or value > self.minimum
        return low and (self.maximum is None or value < self.maximum)


@dataclass(frozen=True)
class Facts:
    """An FMU of lagfmu as its modelDescription.xml and resources/lagfmu.json describe it."""

    name: str
    target: str
    description: Any
    variables: Mapping[str, Any]
    outputs: tuple[Any, ...]
    parameters: tuple[Settable, ...]
    starts: tuple[Settable, ...]
    inputs: tuple[Settable, ...]
    coordinates: tuple[str, ...]
    constraints: tuple[str, ...]
    contacts: tuple[str, ...]
    closed_forms: tuple[CarriedForm, ...]
    laws: tuple[CarriedForm, ...]
    dimensions: Mapping[str, Dimension]
    stop_time: float
    step_size: float
    tolerance: float
    motions: frozenset[str] = frozenset()  # inputs that are prescribed motions and their rates
    estimated: tuple[
        str, ...
    ] = ()  # rates of inputs that the FMU estimates: read, not set; 0 at first

    @property
    def methods(self) -> tuple[str, ...]:
        """The integrators that it offers."""
        return integrators([item.name for item in self.variables[names.METHOD].declaredType.items])

    def share(self, constraint: str, coordinate: str) -> str | None:
        """The output with the constraint's share in Q, if it acts on the coordinate."""
        name = names.name(names.FORCE, constraint, coordinate)
        return name if name in self.variables else None

    def rates(self, constraint: str) -> bool:
        """True if the residual is a velocity: lambda times it is a power (W), else an energy (J)."""
        lam = self.dimensions[names.name(names.MULTIPLIER, constraint)]
        left = self.dimensions[names.name(names.RESIDUAL, constraint)]
        return lam[2] + left[2] == -3

    def alike(self, one: str, other: str) -> bool:
        """True if they have the same unit."""
        return self.dimensions[one] == self.dimensions[other]

    def usual(self, coordinate: str) -> float:
        """The largest default start among the coordinates of the same unit, or 1."""
        peers = (abs(s.start) for s in self.starts if self.alike(s.name, coordinate))
        return max(peers, default=0.0) or 1.0

    def nominal(self, name: str) -> float:
        """The largest nominal among variables of the same unit, to which the tolerance is relative, or 0."""
        peers = (
            float(v.nominal)
            for v in self.variables.values()
            if v.nominal is not None and self.alike(v.name, name)
        )
        return max(peers, default=0.0)

    def same_unit(self, name: str, values: Mapping[str, float]) -> float:
        """The largest magnitude among the parameters that have the dimension of `name`, or 0."""
        peers = (abs(values[p.name]) for p in self.parameters if self.alike(p.name, name))
        return max(peers, default=0.0)


def facts_of(path: Path) -> Facts:
    """Raises VerificationError if the file is no FMU of lagfmu for co-simulation."""
    description = read_description(path)
    closed_forms = closed_forms_in(path)
    variables = {v.name: v for v in description.modelVariables}
    if description.coSimulation is None or names.METHOD not in variables:
        raise VerificationError(
            f"{str(path)!r} was not built by lagfmu, or for a scene that leaves out what it would be "
            "judged by: stress the model's full FMU"
        )
    reals = [v for v in description.modelVariables if kind_of(v) == "Real"]
    bases = {
        u.name: tuple(int(getattr(u.baseUnit, b, 0) or 0) for b in BASE)
        for u in description.unitDefinitions
        if u.baseUnit is not None
    }
    experiment = experiment_of(description)
    coordinates = tuple(
        v.name for v in reals if names.derivative(v.name, 2) in variables and v.causality != "input"
    )
    moving = {*coordinates, *(names.derivative(c) for c in coordinates)}
    moving -= joint_starts(description)  # which speak for coordinates
    inputs = [v.name for v in reals if v.causality == "input"]
    rates = [names.derivative(name, k) for name in inputs for k in (1, 2)]
    estimated = tuple(n for n in rates if n in variables and n not in inputs)
    return Facts(
        name=file_stem(description),
        target=target_in(path),
        description=description,
        variables=variables,
        outputs=tuple(
            v
            for v in description.modelVariables
            if (v.causality == "output" and kind_of(v) in ("Real", "Integer", "Boolean"))
            or (v.causality == "local" and v.name in estimated)
        ),
        parameters=tuple(
            _settable(v)
            for v in reals
            if v.causality == "parameter" and names.read(v.name).head != names.SOLVER
        ),
        starts=tuple(_settable(v) for v in reals if v.name in moving and v.start is not None),
        inputs=tuple(_settable(v) for v in reals if v.causality == "input"),
        motions=_motions([*inputs, *estimated]),
        estimated=estimated,
        coordinates=coordinates,
        constraints=tuple(names.constraints((v.name for v in reals), names.MULTIPLIER)),
        contacts=tuple(names.constraints(variables, names.CONTACT)),
        closed_forms=tuple(closed_forms),
        laws=_beside(path),
        dimensions={v.name: bases.get(v.unit, (0,) * len(BASE)) for v in reals}
        | {"time": (0, 0, 1) + (0,) * (len(BASE) - 3)},
        stop_time=experiment.stop_time,
        step_size=experiment.step_size,
        tolerance=experiment.tolerance,
    )


def _motions(inputs: list[str]) -> frozenset[str]:
    rates = {n for n in inputs if names.read(n).order}
    moving = {names.read(n).coordinate for n in rates}
    return frozenset(rates | moving)


def beside(path: Path) -> Path:
    """Where the command that has the model writes Lagrange's equations for the judge."""
    return path.with_suffix(".lagrange.json")


def _beside(path: Path) -> tuple[CarriedForm, ...]:
    file = beside(path)
    return tuple(unpack_closed_forms(file.read_bytes(), str(file))) if file.exists() else ()


def _settable(v: Any) -> Settable:
    return Settable(
        v.name,
        float(v.start or 0.0),
        None if v.min is None else float(v.min),
        None if v.max is None else float(v.max),
    )


VAGUE = r"internal error|traceback|assert|unknown error|no message|\w+Error\(|<class"
Values = Mapping[str, float | str]
Drive = Callable[[float], Mapping[str, float]]  # time [s] -> inputs that hold until the next point


def clear(refusal: RefusalError) -> bool:
    """True for discard and error (fatal from pythonfmu) with a message that names a cause."""
    told = len(refusal.message) >= 15 and not re.search(VAGUE, refusal.message, re.IGNORECASE)
    return refusal.status in (2, 3, 4) and told


@dataclass(frozen=True)
class Run:
    """Outputs and inputs at the communication points that were reached, and what ended it early."""

    rows: Trajectory
    values: Mapping[str, float]
    tolerance: float
    refusal: RefusalError | None
    driven: bool = False


def opened(facts: Facts, folder: Path, name: str = "stress") -> Session:
    """A session of the FMU that lies unpacked in `folder`."""
    session = Session(folder, name)
    session.outputs = [v.name for v in facts.outputs]
    return session


def play(
    session: Session,
    facts: Facts,
    values: Values,
    times: Sequence[float],
    tolerance: float | None = None,
    drive: Drive | None = None,
    late: bool = False,
) -> Run:
    """A run over the communication points `times`, or as far as the FMU goes; `late`: inputs are set when all
    has been read."""
    known = {s.name: s.start for s in (*facts.parameters, *facts.inputs, *facts.starts)}
    known |= {n: float(v) for n, v in values.items() if not isinstance(v, str)}
    driven = [] if drive is None else [drive(t) for t in times]
    inputs = {n: [given[n] for given in driven] for n in (driven[0] if driven else ())}
    read = [*session.outputs, *(i.name for i in facts.inputs)]
    found = session.run(times, values, tolerance, read, inputs, late=late)
    used = float(known.get(names.TOLERANCE) or 0) or tolerance or facts.tolerance
    return Run(found.rows, known, used, found.refusal, drive is not None)
