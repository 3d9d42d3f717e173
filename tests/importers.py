"""FMUs in engines that are not fmpy: `run` hands a job of tests/engines.py to one of them."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import engines
import numpy as np
import pytest
from engines import EngineError
from fmpy import read_model_description

TYPES = {"Float64": "Real", "Int32": "Integer"}  # of FMI 3.0
Values = Mapping[str, Mapping[str, Any]]  # instance -> variable -> value


def run(
    engine: str,
    fmus: Mapping[str, Path],
    record: Sequence[tuple[str, str]],
    step: float,
    steps: int,
    values: Values | None = None,
    connections: Sequence[tuple[str, str, str, str]] = (),
    drive: Values | None = None,
    rates: bool = False,
) -> dict[tuple[str, str], np.ndarray]:
    """(instance, variable) -> values after each step.  The engine has a process of its own: if that
    crashes, it is an EngineError with all that was said, as for a call that the FMU refuses."""
    package = engines.PACKAGES[engine]
    if importlib.util.find_spec(package) is None:
        pytest.skip(f"the engine {package} is not installed")
    job = {
        "fmus": {instance: _described(path) for instance, path in fmus.items()},
        "values": values or {},
        "connections": connections,
        "drive": drive or {},
        "step": step,
        "steps": steps,
        "record": record,
        "rates": rates,
    }
    with tempfile.TemporaryDirectory() as folder:
        question, answer = Path(folder, "job.json"), Path(folder, "answer.json")
        question.write_text(json.dumps(job))
        command = [sys.executable, engines.__file__, engine, str(question), str(answer)]
        ended = subprocess.run(
            command,
            env={**os.environ, "TMPDIR": folder},  # where engines leave what they unpack
            capture_output=True,
            text=True,
            timeout=200,
            check=False,
        )
        found = json.loads(answer.read_text()) if answer.exists() else {"error": "a crash"}
    said = ended.stdout + ended.stderr
    if "absent" in found:
        pytest.skip(f"{package} cannot be loaded: {found['absent']}")
    if (
        "error" in found
        or ended.returncode != 0
        or "] fmi2Error" in said
        or "] fmi2Discard" in said
    ):
        raise EngineError(f"exit code {ended.returncode}, {found.get('error')}\n{said}")
    columns = np.array(found["rows"]).T
    return dict(zip(record, columns, strict=True))


def _described(path: Path) -> dict[str, Any]:
    description = read_model_description(str(path))
    return {
        "path": str(path),
        "guid": description.guid,
        "identifier": description.coSimulation.modelIdentifier,
        "variables": {
            v.name: (v.valueReference, TYPES.get(v.type, v.type))
            for v in description.modelVariables
        },
    }
