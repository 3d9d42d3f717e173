"""Error bars: how far a run's values may be off, estimated by a companion run at a coarser tolerance."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
import pytest
from conftest import FILES, MODELS
from fmi2 import ERROR, EXCHANGE, OK, Library
from fmpy.fmi1 import FMICallException
from instance import instance
from scipy.special import ellipj, ellipk

from lagfmu.errors import BuildError, ModelError, SimulationError
from lagfmu.fmu.compiler import find_compiler
from lagfmu.fmu.write import write
from lagfmu.model.file import load
from lagfmu.prepare.prepare import prepare
from lagfmu.verification.plot import figure_of
from lagfmu.verification.simulate import ErrorBarWarning, simulate

INFINITE = np.finfo(float).max
Barred = Callable[[str], Path]


@pytest.fixture(scope="module")
def barred(target: str, prepared, tmp_path_factory: pytest.TempPathFactory) -> Barred:
    """barred(NAME): an FMU of models/ with error bars, built once a target."""
    if target == "native" and find_compiler() is None:
        pytest.skip("no C compiler on this machine")
    folder, made = tmp_path_factory.mktemp("barred"), {}

    def get(name: str) -> Path:
        if name not in made:
            file = load(MODELS / f"{FILES[name]}.py")
            scene = replace(prepared(name).asked, error_bars=True)
            made[name] = write(prepare(file.model, scene), folder, target=target)
        return made[name]

    return get


def run(fmu: Path, stop: float, step: float, **options):
    """All outputs at the communication points."""
    return fmpy.simulate_fmu(
        str(fmu), stop_time=stop, step_size=step, output_interval=step, **options
    )


def multiplier(t: np.ndarray) -> np.ndarray:
    """lambda of x^2 + y^2 = L^2 from rest at 1 rad: -T/(2 L), T = m g (3 cos theta - 2 cos theta0)."""
    k = math.sin(0.5)
    sn = ellipj(math.sqrt(9.81) * t + ellipk(k**2), k**2)[0]
    return -9.81 * (3 * (1 - 2 * (k * sn) ** 2) - 2 * math.cos(1.0)) / 2
