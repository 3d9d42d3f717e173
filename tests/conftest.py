"""FMUs for the tests: each is built once a test process, from the model files as a user has them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from lagfmu.build import write
from lagfmu.modelfile import load
from lagfmu.prepare import Prepared, prepare

MODELS = Path(__file__).parent.parent / "models"
FILES = {
    "Hemisphere": "hemisphere",
    "InclineDisk": "incline_disk",
    "InclineDiskMinimal": "incline_disk",
    "PendulumCartesian": "pendulum",
    "PendulumAngle": "pendulum",
    "PendulumNullspace": "pendulum",
    "RotatingWire": "rotating_wire",
    "KnifeEdge": "knife_edge",
    "Atwood": "atwood",
    "CartPendulum": "cart_pendulum",
}


@pytest.fixture(scope="session")
def prepared() -> Callable[[str], Prepared]:
    """prepared(NAME): model and equations behind an FMU of models/, derived once."""
    made: dict[str, Prepared] = {}

    def get(name: str) -> Prepared:
        if name not in made:
            file = load(MODELS / f"{FILES[name]}.py")
            scene = next(s for s in file.scenes if s.name == name)
            made[name] = prepare(file.model, scene)
        return made[name]

    return get


@pytest.fixture(scope="session")
def fmu(
    prepared: Callable[[str], Prepared], tmp_path_factory: pytest.TempPathFactory
) -> Callable[[str], Path]:
    """fmu(NAME): path of the FMU, built once."""
    folder = tmp_path_factory.mktemp("fmus")
    made: dict[str, Path] = {}

    def get(name: str) -> Path:
        if name not in made:
            forms = load(MODELS / f"{FILES[name]}.py").closed_forms
            made[name] = write(prepared(name), folder, forms)
        return made[name]

    return get
