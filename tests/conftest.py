"""FMUs for the tests: each is built once a test process, from the model files as a user has them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from browser import Page, chromium
from fmi2 import Library

from lagfmu.fmu.compiler import find_compiler
from lagfmu.fmu.write import write
from lagfmu.live.playable import playable as playable_of
from lagfmu.live.render import Playable, render
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
    "Crane": "crane",
    "HalfCar": "half_car",
    "SlippingSphere": "rolling_sphere",  # friction: it rolls, slips, leaves
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


@pytest.fixture(scope="session")
def playable(native_fmu: Fmu) -> Callable[[str], Playable]:
    """playable(NAME): the parts of the page of an FMU of models/, compiled once."""
    compiler = find_compiler()
    if compiler is None or not compiler.cross:
        pytest.skip("no ziglang: pip install -e '.[native]'")
    made: dict[str, Playable] = {}

    def get(name: str) -> Playable:
        if name not in made:
            made[name] = playable_of(native_fmu(name))
        return made[name]

    return get


@pytest.fixture(scope="session")
def page_file(playable: Callable[[str], Playable], tmp_path_factory: pytest.TempPathFactory) -> Any:
    """page_file(NAME): the page on disk."""
    folder = tmp_path_factory.mktemp("pages")

    def get(name: str) -> Path:
        path = folder / f"{name}.html"
        if not path.exists():
            path.write_text(render(playable(name)), encoding="utf-8")
        return path

    return get


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    with chromium() as found:
        yield found


@pytest.fixture
def opened(browser: Any, page_file: Any) -> Iterator[Callable[..., Page]]:
    """opened(NAME): its page in Chromium; at the end nothing must have gone wrong in it."""
    pages: list[Page] = []

    def get(name: str, **options: Any) -> Page:
        pages.append(Page(browser, page_file(name), **options))
        return pages[-1]

    yield get
    for page in pages:
        page.close()
        assert page.problems == []
        assert all(r.startswith(("file:", "blob:", "data:")) for r in page.requests)
