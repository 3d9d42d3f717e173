"""A run in model exchange, or of an FMU of another version of FMI: fmpy's integrator and its loop."""

from __future__ import annotations

import time as clock
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi1 import FMICallException

from .read import Trajectory
from .session import DISCARD, ERROR, WARNING, RefusalError, Run


def by_fmpy(
    fmu: Path,
    description: Any,
    stop_time: float,
    step_size: float,
    tolerance: float | None = None,
    values: Mapping[str, Any] | None = None,
    inputs: Trajectory | None = None,
    read: Sequence[str] = (),
    kind: str | None = None,
) -> Run:
    """A row every `step_size` [s] of an FMU, a file or an unpacked folder; `kind` as FMI calls it."""
    said: list[str] = []

    def log(*told: Any) -> None:
        status, message = told[-3], told[-1]
        if status > WARNING:
            said.append(message.decode(errors="replace").strip())

    begun, refusal = clock.perf_counter(), None
    rows: Trajectory = np.zeros(0, dtype=[("time", np.float64), *((n, np.float64) for n in read)])
    try:
        rows = fmpy.simulate_fmu(
            str(fmu),
            validate=False,
            fmi_type=kind,
            model_description=description,
            stop_time=stop_time,
            output_interval=step_size,
            step_size=step_size,
            relative_tolerance=tolerance,
            record_events=False,
            start_values=dict(values or {}),
            input=inputs,
            output=list(read),
            logger=log,
        )
        reached = float(rows["time"][-1])
        if reached < stop_time * (1 - 1e-9):  # fmpy ends a run that cannot go on without a word
            cause = "; ".join(said) or "no message was logged"
            refusal = RefusalError("doStep", DISCARD, cause, reached)
    except FMICallException as error:
        refusal = RefusalError(error.function, error.status, "; ".join(said) or str(error))
    except Exception as error:
        refusal = RefusalError("simulation", ERROR, "; ".join(said) or str(error))
    return Run(rows, rows[:0], refusal, clock.perf_counter() - begun)
