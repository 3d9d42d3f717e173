"""FMUs for the tests: each is built once a test process, from the model files as a user has them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from fmi2 import Library

from lagfmu.fmu.compiler import find_compiler
from lagfmu.fmu.write import write
from lagfmu.model.file import load
from lagfmu.prepare.prepare import Prepared, prepare

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
    "RollingSphere": "rolling_sphere",
    "Ladder": "ladder",
    "Loop": "loop",
    "Chain": "chain",
    "SliderCrank": "slider_crank",
    "DoublePendulum": "double_pendulum",
    "BouncingBall": "bouncing_ball",
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


Fmu = Callable[[str], Path]


def _built(prepared: Callable[[str], Prepared], folder: Path, target: str) -> Fmu:
    made: dict[str, Path] = {}

    def get(name: str) -> Path:
        if name not in made:
            forms = load(MODELS / f"{FILES[name]}.py").closed_forms
            made[name] = write(prepared(name), folder, forms, target=target)
        return made[name]

    return get


@pytest.fixture(scope="session")
def python_fmu(
    prepared: Callable[[str], Prepared], tmp_path_factory: pytest.TempPathFactory
) -> Fmu:
    """python_fmu(NAME): path of the FMU of the python target, built once."""
    return _built(prepared, tmp_path_factory.mktemp("python"), "python")


@pytest.fixture(scope="session")
def native_fmu(
    prepared: Callable[[str], Prepared], tmp_path_factory: pytest.TempPathFactory
) -> Fmu:
    """native_fmu(NAME): path of the compiled FMU for this machine, built once."""
    if find_compiler() is None:
        pytest.skip("no C compiler on this machine: native FMUs are not tested")
    return _built(prepared, tmp_path_factory.mktemp("native"), "native")


@pytest.fixture(scope="session")
def library(native_fmu: Fmu, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Library]:
    """library(NAME): the native FMU's binary, loaded once, for single calls."""
    folder = tmp_path_factory.mktemp("libraries")
    made: dict[str, Library] = {}

    def get(name: str) -> Library:
        if name not in made:
            made[name] = Library(native_fmu(name), folder / name)
        return made[name]

    return get


@pytest.fixture(scope="session", params=["python", "native"])
def target(request: pytest.FixtureRequest) -> str:
    """What holds for an FMU holds for both targets."""
    return str(request.param)


@pytest.fixture(scope="session")
def fmu(target: str, request: pytest.FixtureRequest) -> Fmu:
    """fmu(NAME): path of the FMU of the present target."""
    made: Fmu = request.getfixturevalue(f"{target}_fmu")
    return made
