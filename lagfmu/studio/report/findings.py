"""What a report is made of: one FMU, what it tells of itself, a run, a closer run, its verification.

Its tables: forces with their extremes, events, parameters, accuracy.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import os
import platform
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ... import names
from ...errors import VerificationError
from ...fmu.archive import tool
from ...fmu.read import experiment_of, kind_of, read_description
from ...model.units import for_reading
from ...verification.check import Verification
from ...verification.closed_forms import alone
from ...verification.plot import SAID, moments
from ...verification.reference import Driven, Reference
from ...verification.simulate import Result, as_text, simulate
from ...verification.verify import verify
from ..live.play import Told, told_by

CLOSER = 1e-2  # of the tolerance: the run that this one is compared with
CLOSEST = 1e-13
PACKAGES = ("fmpy", "numpy", "scipy", "sympy")


@dataclass(frozen=True)
class Findings:
    """`run` at the relative `tolerance`, and `closer` at a hundredth of it (None where the FMU takes none);
    `given`: what was set; `verification`, or `unverified`: why there is none; `source`: the file that was
    named, `digest` its SHA-256."""

    source: Path
    digest: str
    description: Any
    told: Told
    given: Mapping[str, Any]
    run: Result
    closer: Result | None
    tolerance: float
    verification: Verification | None
    unverified: str

    @property
    def units(self) -> Mapping[str, str]:
        """Of the columns of the run."""
        return self.run.units

    def provenance(self) -> list[tuple[str, str]]:
        """What made this: files, versions, hashes."""
        d = self.description
        kinds = {"co-simulation": d.coSimulation, "model exchange": d.modelExchange}
        rows = [
            ("File", self.source.name),
            ("SHA-256", self.digest),
            ("FMI", f"{d.fmiVersion}, {', '.join(k for k, v in kinds.items() if v is not None)}"),
            ("FMU made by", d.generationTool or "not told"),
            ("Report made by", tool()),
            ("With", ", ".join(f"{p} {importlib.metadata.version(p)}" for p in PACKAGES)),
            ("On", f"Python {sys.version.split()[0]}, {platform.system()} {platform.machine()}"),
        ]
        if d.guid:
            rows.insert(2, ("GUID", d.guid))
        return rows


def findings(
    fmu: Path,
    source: Path,
    *,
    start_values: Mapping[str, Any] | None = None,
    stop_time: float | None = None,
    step_size: float | None = None,
    tolerance: float | None = None,
    inputs: Driven | None = None,
    reference: Reference | None = None,
    statements: str | os.PathLike[str] | None = None,
) -> Findings:
    """Run and verify an FMU that was named, or made from, `source`.  Raises SimulationError."""
    description = read_description(fmu)
    given = dict(start_values or {})
    used = tolerance or experiment_of(description).tolerance
    run = simulate(fmu, stop_time, step_size, used, given, inputs)
    closer = None
    if names.TOLERANCE not in given:
        close = max(CLOSER * used, CLOSEST)
        closer = simulate(fmu, stop_time, step_size, close, given, inputs)
    found, why = None, ""
    try:
        found = verify(fmu, given, stop_time, step_size, tolerance, inputs, reference, statements)
    except VerificationError as error:
        why = str(error)
    digest = hashlib.sha256(source.read_bytes()).hexdigest()
    return Findings(source, digest, description, told_by(fmu), given, run, closer, used, found, why)


def obtained(run: Result, closer: Result) -> dict[str, float]:
    """How far each Real of a run is from the closer one, relative to its largest magnitude; points beside
    which modes differ, by the error of an event's time, are left out."""
    known = run.dtype.names or ()
    modes = [n for n in known if run.dtype[n].kind == "b"] + names.those(known, *names.COUNTS)
    count = min(len(run), len(closer))
    differ = np.zeros(count, dtype=bool)
    for n in modes:
        differ |= run[n][:count] != closer[n][:count]
    kept = ~alone(differ)
    found = {}
    for n in known:
        if run.dtype[n].kind != "f" or n == "time" or names.counted(n):
            continue
        expected = closer[n][:count][kept]
        size = float(np.abs(expected).max(initial=0.0))
        if size > 0:
            found[n] = float(np.abs(run[n][:count][kept] - expected).max()) / size
    return found


JOINTS = ("force", "torque")  # first words of outputs that are a joint's wrench
BOOKKEEPING = (names.PEAK, names.UNIQUE, names.RESIDUAL, names.SOLVER)
TOLD = 6  # times of events of one kind that are listed
FIRST = 12  # quantities whose accuracy is listed

Row = tuple[str, ...]


def forces(found: Findings) -> list[str]:
    """Names of what joints transmit, and of the multipliers that are no part of it, among the columns of the
    run."""
    known = [n for n in found.run.dtype.names or () if found.run.dtype[n].kind == "f"]
    joints = [
        n for n in known if n.split(".")[0] in JOINTS and names.read(n).quantity == names.VALUE
    ]
    told = {n.split(".")[1] for n in joints}
    rows = names.those(known, names.MULTIPLIER)
    return [n for n in rows if names.read(n).constraint.split(".")[0] not in told] + joints


def uncovered(found: Findings) -> list[str]:
    """Outputs of which no statement says anything, but for bookkeeping."""
    outputs = () if found.verification is None else found.verification.uncovered
    return [n for n in outputs if names.read(n).head not in BOOKKEEPING]


def extremes(found: Findings) -> tuple[list[Row], bool]:
    """A row a force: name, smallest and largest value with times, unit, remark; and whether all are those of
    the continuous motion."""
    run, rows, continuous = found.run, [], True
    for n in forces(found):
        cells: list[str] = []
        for end in ("min", "max"):
            peak = (
                names.name(f"{names.PEAK}.{end}", "", n),
                names.name(f"{names.PEAK}.{end}_time", "", n),
            )
            if set(peak) <= set(run.dtype.names or ()):
                value, when = (float(run[p][-1]) for p in peak)
            else:
                continuous = False
                k = int(run[n].argmin() if end == "min" else run[n].argmax())
                value, when = float(run[n][k]), float(run["time"][k])
            cells += [as_text(value), as_text(when, 5)]
        rows.append((n, *cells, for_reading(found.units.get(n)), _remark(run, n)))
    return rows, continuous


def _remark(run: Result, name: str) -> str:
    """Where redundant constraints leave a force open."""
    of = names.read(name)
    unique = (
        names.name(names.UNIQUE, of.constraint)
        if of.quantity == names.MULTIPLIER
        else f"{names.UNIQUE}.{name}"
    )
    if unique not in (run.dtype.names or ()) or bool(np.all(run[unique])):
        return ""
    return "not unique: redundant constraints share it with the least norm"


def events(found: Findings) -> list[Row]:
    """A row a kind of event of a contact or friction: what happens, how often, when [s]."""
    run = found.run
    rows: list[Row] = []
    for kind, (words, _) in SAID.items():
        for of in names.constraints(run.dtype.names or (), kind):
            count = int(run[names.name(kind, of)][-1])
            if not count:
                continue
            times = [f"{t:.9g}" for t in moments(run, kind, of)]
            more = ", ..." if count > TOLD or count > len(times) else ""
            rows.append((words.format(of), str(count), ", ".join(times[:TOLD]) + more))
    return rows


def constraints(found: Findings) -> list[Row]:
    """A row a multiplier: name, unit, what its constraint is."""
    rows: list[Row] = []
    for v in found.description.modelVariables:
        if names.read(v.name).quantity == names.MULTIPLIER:
            rows.append((v.name, for_reading(v.unit) or "1", v.description or ""))
    return rows


def settings(found: Findings) -> list[Row]:
    """A row a parameter and start value: name, value, unit, description."""
    rows: list[Row] = []
    for v in found.description.modelVariables:
        settable = v.causality in ("parameter", "input") or v.initial == "exact"
        if not settable or kind_of(v) != "Real" or names.read(v.name).head == names.SOLVER:
            continue
        value = found.given.get(v.name, v.start)
        if value is None:
            continue
        text = as_text(float(value)) + (" (set)" if v.name in found.given else "")
        rows.append((v.name, text, for_reading(v.unit), v.description or ""))
    return rows


def accuracy(found: Findings) -> list[Row]:
    """A row a quantity, the worst first: its largest relative difference to the closer run."""
    if found.closer is None:
        return []
    off = obtained(found.run, found.closer)
    chosen = [n for n in (*forces(found), *names.of_interest(off)) if n in off]
    rows = sorted(((off[n], n) for n in dict.fromkeys(chosen)), reverse=True)
    return [(n, f"{error:.1e}") for error, n in rows[:FIRST]]
