"""What a report is made of: one FMU, what it tells of itself, a run, a closer run, its verification."""

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
from ...fmu.read import experiment_of, read_description
from ...verification.check import Verification
from ...verification.evaluate import alone
from ...verification.reference import Driven, Reference
from ...verification.result import Result
from ...verification.simulate import simulate
from ...verification.verify import verify
from ..live.playable import Told, told_by

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
