"""verify(): an FMU, simulated and held against the closed forms that it carries."""

from __future__ import annotations

import os
import time
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from fmpy.validation import validate_fmu

from .. import names
from ..errors import SettingError, SimulationError, VerificationError
from ..fmu.archive import opened
from ..fmu.closed_forms import (
    LARGEST_RECORD,
    CarriedForm,
    left_out_of,
    unpack_closed_forms,
    unpack_laws,
)
from ..fmu.read import SHOWN, Trajectory, experiment_of, kind_of, numbers_of, read_description
from ..fmu.write import as_fmu
from ..model.closed_form import ClosedForm, Conserved
from ..model.model import Model
from ..model.scene import Scene
from ..numeric.thresholds import SMALLEST_TOLERANCE
from .check import Against, Check, Verification
from .closed_forms import check_closed_form
from .laws import CarriedLaws
from .reference import Driven, Reference
from .simulate import simulate, steps_of
from .statements import read_statements

RECORD = "resources/lagfmu.json"
MODES = ("Boolean", "Real")  # what a mode may be: a Real where an FMU has Reals alone
NUMBERS = ("Real", "Integer")
# where a statement reads them, besides outputs
RECORDED = ("local", "input", "calculatedParameter")
VALID, FINITE, STARTS = "valid for fmpy", "all outputs finite", "starts as described"
FINER = 1e-2  # of the tolerance used, at which a statement that fails is tried again
OF_THE_FILE = (VALID, FINITE, STARTS)  # checks that come before the statements on its physics


def verify(
    source: Model | str | os.PathLike[str],
    start_values: Mapping[str, Any] | None = None,
    stop_time: float | None = None,
    step_size: float | None = None,
    tolerance: float | None = None,
    inputs: Driven | None = None,
    reference: Reference | None = None,
    statements: str | os.PathLike[str] | None = None,
    *,
    closed_forms: Sequence[ClosedForm | Conserved] = (),
    scene: Scene | str | None = None,
    validation: bool = True,
) -> Verification:
    """Simulate an FMU and evaluate its closed forms on what it returns; a model (with these `closed_forms`),
    or a model file, is built first, natively where a compiler is at hand.

    Also checks what FMU checkers do not: that every output is finite, and that the start values in
    modelDescription.xml are those that the binary starts with.  Parameters and start values may be
    changed; the closed forms follow.

    `inputs` drives the FMU, as in simulate().  A `reference` (reference.Reference) is a table of another run
    that this one is held against besides, `statements` a TOML file that says what must hold (statements.py);
    with one of them, an FMU of another tool will do.

    Without `validation` fmpy's own check of the file is left out, which refuses FMUs of some tools.

    A statement that fails is tried again at a hundredth of the tolerance, and says whether that cures it.
    An FMU that was built for an accuracy is held to that, as long as its solver settings are left alone.

    Raises VerificationError if the file is corrupt or carries no closed forms of lagfmu, and
    SimulationError if it cannot be simulated.
    """
    with as_fmu(source, scene, closed_forms) as path:
        description = read_description(path)
        against: list[Against] = [] if reference is None else [reference]
        if statements is not None:
            against += read_statements(Path(statements), description)
        ours = not against or is_ours(path)
        forms, left_out = (closed_forms_in(path), left_out_in(path)) if ours else ([], 0)
        laws = laws_in(path, description) if ours else None
        count = len(forms)
        if laws is not None:
            against.append(laws)
            left_out += laws.left_out
            count += 2 * len(laws.bodies)
        _check_texts(description, start_values or {})
        problems = validate_fmu(str(path)) if validation else []
        begun = time.perf_counter()
        said = set().union(*(form.variables for form in forms))
        said = said.union(*(one.variables for one in against))
        read = {v.name for v in description.modelVariables if v.causality in RECORDED}
        besides = sorted(read & said)
        if stop_time is None:
            stop_time = max((t for one in against if (t := one.stop_time)), default=None)

        def run(tolerance: float | None) -> Trajectory:
            asked = stop_time, step_size, tolerance, start_values, inputs
            return simulate(path, *asked, besides=besides)

        result = run(tolerance)
        seconds = time.perf_counter() - begun
        used = tolerance or experiment_of(description).tolerance
        values = numbers_of(description)
        values |= {k: float(v) for k, v in (start_values or {}).items() if not isinstance(v, str)}
        used = values.get(names.TOLERANCE) or used
        as_built = tolerance is None and not any(
            names.read(k).head == names.SOLVER for k in start_values or ()
        )

        def held(result: Trajectory) -> list[Check]:
            found = [check_closed_form(form, result, values, used, as_built) for form in forms]
            return found + [c for one in against for c in one.checks(result, values)]

        stated = held(result)
        if names.TOLERANCE not in (start_values or {}):
            stated = _with_cures(stated, used, lambda finer: held(run(finer)))
    checks = [
        *([Check(VALID, len(problems), 0, 1, "; ".join(problems))] if validation else []),
        _finite(result),
        _starts(description, start_values or {}, result),
        *stated,
    ]
    physics = [c for c in checks if c.name not in OF_THE_FILE]
    if physics and not any(c.points for c in physics):
        told = f"none of {len(physics)} was: nothing is known of its physics"
        checks.append(Check("statements reached", 1, 0, 1, told))
    span = float(result["time"][-1] - result["time"][0])
    steps = steps_of(result)
    outputs = [v.name for v in description.modelVariables if v.causality == "output"]
    return Verification(
        description.modelName,
        tuple(checks),
        span,
        seconds,
        steps,
        count,
        tuple(n for n in outputs if n not in said),
        left_out,
    )


def _with_cures(
    checks: list[Check], used: float, at: Callable[[float], list[Check]]
) -> list[Check]:
    """Those that fail say whether a finer tolerance than that used cures them; `at`: the checks of a run."""
    finer = max(FINER * used, SMALLEST_TOLERANCE)
    if not (finer < used and any(c.failed and c.allowed for c in checks)):
        return checks
    try:
        again = {c.name: c for c in at(finer)}
    except SimulationError:
        return checks
    return [_with_cure(c, again.get(c.name, c), finer) for c in checks]


def _with_cure(check: Check, then: Check, finer: float) -> Check:
    if not (check.failed and check.allowed and then.points > 0):
        return check  # a finer run that reaches none of its points says nothing of it
    cured = then.error <= check.allowed
    told = "it holds" if cured else "it fails too"
    told = f"at a tolerance of {finer:.0e} {told} ({then.error:.1e})"
    return replace(check, detail=f"{check.detail}; {told}" if check.detail else told)


def is_ours(path: Path) -> bool:
    """Whether a file carries closed forms of lagfmu."""
    with opened(path) as archive:
        return RECORD in archive.namelist()


def _check_texts(description: Any, given: Mapping[str, Any]) -> None:
    """A text is a value for an Enumeration only."""
    texts = {v.name for v in description.modelVariables if kind_of(v) == "Enumeration"}
    wrong = [f"{k} = {v!r}" for k, v in given.items() if isinstance(v, str) and k not in texts]
    if wrong:
        raise SettingError(f"{', '.join(wrong)}: expected a number")


def closed_forms_in(path: Path) -> list[CarriedForm]:
    """The closed forms that an FMU carries.  Raises VerificationError if it is none of lagfmu's."""
    variables = {v.name: v for v in read_description(path).modelVariables}
    with opened(path) as archive:
        if RECORD not in archive.namelist():
            raise VerificationError(
                f"{str(path)!r} carries no closed forms ({RECORD} is missing): it was not built "
                "by lagfmu, and there is nothing to hold it against: give it a --reference"
            )
        closed_forms = unpack_closed_forms(_record(archive), str(path))
    problems = []
    for closed_form in closed_forms:
        for name in sorted(closed_form.variables):
            v = variables.get(name)
            if v is None:
                problems.append(
                    f"closed form {closed_form.name!r} uses {name!r}, which is no variable"
                )
            elif kind_of(v) not in (MODES if names.read(name).quantity in names.MODES else NUMBERS):
                problems.append(
                    f"closed form {closed_form.name!r} uses {name!r}, which is a {kind_of(v)}"
                )
    if problems:
        more = f"; and {len(problems) - SHOWN} more" if len(problems) > SHOWN else ""
        raise VerificationError(
            f"{str(path)!r}: {'; '.join(problems[:SHOWN])}{more}: build the FMU anew"
        )
    return closed_forms


def laws_in(path: Path, description: Any) -> CarriedLaws | None:
    """The laws of the bodies of an FMU that closed_forms_in() reads; None if it is of no mechanism."""
    with opened(path) as archive:
        laws = unpack_laws(_record(archive), str(path))
    known = {v.name for v in description.modelVariables}
    return None if laws is None else CarriedLaws(laws, known)


def left_out_in(path: Path) -> int:
    """How many closed forms of its model an FMU of lagfmu leaves out."""
    with opened(path) as archive:
        return left_out_of(_record(archive))


def _record(archive: zipfile.ZipFile) -> bytes:
    """Its content, but no more of it than is ever looked at."""
    with archive.open(RECORD) as file:
        return file.read(LARGEST_RECORD + 1)


def _finite(result: Trajectory) -> Check:
    bad = [n for n in result.dtype.names or () if not np.isfinite(result[n]).all()]
    return Check(FINITE, len(bad), 0, len(result), ", ".join(bad))


def _starts(description: Any, given: Mapping[str, Any], result: Trajectory) -> Check:
    """Outputs with an exact start begin with it."""
    worst, count, missed = 0.0, 0, []
    for v in description.modelVariables:
        if v.initial == "exact" and v.causality == "output" and kind_of(v) == "Real":
            expected = float(given.get(v.name, v.start))
            error = abs(float(result[v.name][0]) - expected)
            count += 1
            if error > 0:
                missed.append(
                    f"{v.name} starts at {result[v.name][0]!r}, described as {expected!r}"
                )
            worst = max(worst, error)
    return Check(STARTS, worst, 0, max(count, 1), "; ".join(missed))
