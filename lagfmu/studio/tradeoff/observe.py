"""One session of an FMU, run again and again in other settings: what it reports, and how long it takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ...errors import SimulationError, VerificationError
from ...fmu.read import Trajectory, communication_points, kind_of
from ...fmu.session import RefusalError, Run, Session
from ...names import TOLERANCE
from .setting import Setting


def opened(fmu: Path) -> Session:
    """A session of an FMU that lagfmu has built.  Raises VerificationError, SimulationError."""
    try:
        session = Session(fmu, "tradeoff")
    except RefusalError as error:
        raise SimulationError(f"{str(fmu)!r}: {error}") from None
    if TOLERANCE in session.rules:
        return session
    session.close()
    raise VerificationError(
        f"{str(fmu)!r} has no parameter {TOLERANCE!r}: it was not built by lagfmu, and there is no setting "
        "to vary"
    )


def observe(
    session: Session,
    setting: Setting,
    values: Mapping[str, Any] | None = None,
    stop: float | None = None,
) -> Trajectory:
    """All outputs and local variables at every communication point.  Raises SimulationError with the FMU's
    reason."""
    read = [v.name for v in session.description.modelVariables if _is_read(v)]
    run = _run(session, setting, read, values, stop)
    if run.refusal is not None:
        raise SimulationError(f"{session.description.modelName}, {setting}: {run.refusal.message}")
    return run.rows


def seconds(session: Session, setting: Setting, names: Sequence[str]) -> float:
    """Wall time [s] of stepping and of reading `names`, of a run that is known to succeed."""
    return _run(session, setting, names, None, None).seconds


def _run(
    session: Session,
    setting: Setting,
    read: Sequence[str],
    values: Mapping[str, Any] | None,
    stop: float | None,
) -> Run:
    times = communication_points(stop or session.experiment.stop_time, setting.communication)
    given = setting.values | dict(values or {})
    return session.run(times.tolist(), given, setting.tolerance or None, read)


def _is_read(v: Any) -> bool:
    return v.causality in ("output", "local") and kind_of(v) in ("Real", "Integer", "Boolean")
