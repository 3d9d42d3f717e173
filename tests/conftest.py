"""FMUs for the tests, from the model files as a user has them: each is built once, for all processes.

How builds and runs are shared:

- `native_fmu`, `python_fmu`, `fmu` (both), `fmi3_fmu`, `library`, `prepared`, `playable`, `page_file`: of
  models/;
- `built`: models of a test's own, and scenes of models/ that it changes (`scene_of`);
- `shared_folder` with `once(folder, make)` of once.py, for what tests in several files build;
- `objects` and `compile_library` of runtime.py: the runtime's C files, compiled once for what they hold, also
  with SANITIZE;
- `simulate_fmu` of runs.py: an FMU that runs many times is unpacked once.

What is no fact about one model, but about what lagfmu makes of any, is tried on one of each kind (KINDS).
What an FMU tells is told by native FMUs; the python target is tried by the contract, by what it refuses, by
its states, and against native on every scene (test_targets_agree.py).
"""

from __future__ import annotations

import gc
import os
import pickle
import sys
from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from functools import cache
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy: the processes share the cores

import fmi3
import pytest
import typer.testing
from browser import Page, chromium
from fmi2 import Library
from once import once

from lagfmu import Model, Scene, build_fmu
from lagfmu.testing import (
    Face,
    ModelFile,
    Playable,
    Prepared,
    archive,
    find_compiler,
    load,
    prepare,
    render,
    write,
)
from lagfmu.testing import playable as playable_of

gc.set_threshold(100_000, 20, 20)  # as the command has it
typer.testing._get_command = cache(typer.testing._get_command)  # put together once a process
SMALL, archive.LEVEL = (
    archive.LEVEL,
    1,
)  # a fifth of the work: as users have them are those of models/

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
BOTH = tuple(name for name in FILES if name != "SlippingSphere")  # what either target runs
EVERY = {  # what is tried of every FMU of models/: that its page is the native FMU
    **FILES,
    "Belt": "belt",
    "Bowling": "bowling",
    "CrankWithBearingFriction": "crank_with_bearing_friction",
    "FallingRod": "falling_rod",
    "FrictionOscillator": "friction_oscillator",
    "Hoop": "hoop",
    "InclineFriction": "incline_friction",
    "RoughHemisphere": "rough_hemisphere",
    "Arm": "arm",
    "Bennett": "bennett",
    "Cat": "cat",
    "Door": "door",
    "DoubleWishbone": "double_wishbone",
    "Gyroscope": "gyroscope",
    "SliderCrankBodies": "slider_crank_bodies",
    "SliderCrankSpace": "slider_crank_space",
    "SphereInCylinder": "sphere_in_cylinder",
    "Stewart": "stewart",
}
# one of each kind: forces alone, multipliers eliminated, a contact and velocities, an input, a table and an
# output and a prescribed motion, nothing left to integrate by rows
KINDS = ("PendulumAngle", "Hemisphere", "KnifeEdge", "CartPendulum", "HalfCar", "BouncingBall")


def of_each_kind(
    names: Iterable[str], *values: Any, label: str = "", kinds: Container[str] = KINDS
) -> list[Any]:
    """Parameters (name, *values): those of `kinds` always, the others where there is time."""
    return [
        pytest.param(
            *(name, *values),
            id=f"{name}-{label}" if label else name,
            marks=() if name in kinds else pytest.mark.thorough,
        )
        for name in names
    ]


@contextmanager
def as_small_as_can_be() -> Iterator[None]:
    """FMUs are packed as users have them."""
    with pytest.MonkeyPatch.context() as packing:
        packing.setattr(archive, "LEVEL", SMALL)
        yield


@contextmanager
def without_a_page() -> Iterator[None]:
    """FMUs are packed without the page of equations, which those of models/ have."""
    with pytest.MonkeyPatch.context() as packing:
        packing.setattr(sys.modules[write.__module__], "page", lambda *_: "")
        yield


@cache
def model_file(name: str) -> ModelFile:
    """A file of models/, or of the zoo, loaded once."""
    path = MODELS / f"{name}.py"
    return load(path if path.exists() else Path(__file__).parent / "zoo" / path.name)


def scene_of(name: str) -> tuple[ModelFile, Scene]:
    """The model file and the scene of an FMU of models/."""
    file = model_file(EVERY[name])
    return file, next(s for s in file.scenes if s.name == name)


@pytest.fixture(scope="session")
def prepared() -> Callable[[str], Prepared]:
    """prepared(NAME): model and equations behind an FMU of models/, derived once."""

    def get(name: str) -> Prepared:
        file, scene = scene_of(name)
        return prepare(file.model, scene)

    return cache(get)


Fmu = Callable[[str], Path]


@pytest.fixture(scope="session")
def shared_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of this run, the same one in every process."""
    own = tmp_path_factory.getbasetemp()
    return (own.parent if "PYTEST_XDIST_WORKER" in os.environ else own) / "shared"


def _built(prepared: Callable[[str], Prepared], folder: Path, target: str, fmi: int = 2) -> Fmu:
    face = Face(fmi)

    def get(name: str) -> Path:
        forms = model_file(EVERY[name]).closed_forms

        def make(place: Path) -> None:
            with as_small_as_can_be():
                write(prepared(name), place, forms, target=target, face=face)

        return once(folder / f"{face.folder(target)}-{name}", make) / f"{name}.fmu"

    return cache(get)


@pytest.fixture(scope="session")
def python_fmu(prepared: Callable[[str], Prepared], shared_folder: Path) -> Fmu:
    """python_fmu(NAME): path of the FMU of the python target, built once."""
    return _built(prepared, shared_folder, "python")


@pytest.fixture(scope="session")
def native_fmu(prepared: Callable[[str], Prepared], shared_folder: Path) -> Fmu:
    """native_fmu(NAME): path of the compiled FMU for this machine, built once."""
    if find_compiler() is None:
        pytest.skip("no C compiler on this machine: native FMUs are not tested")
    return _built(prepared, shared_folder, "native")


@pytest.fixture(scope="session")
def fmi3_fmu(prepared: Callable[[str], Prepared], shared_folder: Path) -> Fmu:
    """fmi3_fmu(NAME): path of the native FMU of FMI 3.0, built once."""
    if find_compiler() is None:
        pytest.skip("no C compiler on this machine: native FMUs are not tested")
    return _built(prepared, shared_folder, "native", fmi=3)


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """built(model), built(model, scene, closed_forms, target, fmi=3): the FMU of a test's own model, built
    once; without page and C files, unless it is `whole`."""
    made: list[tuple[tuple[Any, ...], Path]] = []

    def get(
        model: Model,
        scene: Scene | None = None,
        closed_forms: Sequence[Any] = (),
        target: str = "native",
        whole: bool = False,
        **interface: Any,
    ) -> Path:
        if target == "native" and find_compiler() is None:
            pytest.skip("no C compiler on this machine: native FMUs are not tested")
        wanted = model, scene or Scene(model.name), tuple(closed_forms), target, whole, interface
        for known, path in made:
            if known == wanted:
                return path
        folder = tmp_path_factory.mktemp("own")
        with nullcontext() if whole else without_a_page():
            path = build_fmu(model, folder, *wanted[1:4], check=False, sources=whole, **interface)
        made.append((wanted, path))
        return made[-1][1]

    return get


@pytest.fixture(scope="session")
def library(
    native_fmu: Fmu, tmp_path_factory: pytest.TempPathFactory
) -> Callable[[str | Path], Library]:
    """library(NAME), library(path): a native FMU's binary, loaded once, for single calls."""

    def get(fmu: str | Path) -> Library:
        path = native_fmu(fmu) if isinstance(fmu, str) else fmu
        return Library(path, tmp_path_factory.mktemp("library"))

    return cache(get)


@pytest.fixture(scope="session")
def library3(
    fmi3_fmu: Fmu, tmp_path_factory: pytest.TempPathFactory
) -> Callable[[str | Path], fmi3.Library]:
    """library3(NAME), library3(path): the same of FMI 3.0."""

    def get(fmu: str | Path) -> fmi3.Library:
        path = fmi3_fmu(fmu) if isinstance(fmu, str) else fmu
        return fmi3.Library(path, tmp_path_factory.mktemp("library"))

    return cache(get)


@pytest.fixture(scope="session", params=["python", "native"])
def fmu(request: pytest.FixtureRequest) -> Fmu:
    """fmu(NAME): path of the FMU of either target: for what each has code of its own for."""
    made: Fmu = request.getfixturevalue(f"{request.param}_fmu")
    return made


@pytest.fixture(scope="session")
def playable(native_fmu: Fmu, shared_folder: Path) -> Callable[[str], Playable]:
    """playable(NAME): the parts of the page of an FMU of models/, compiled once."""
    compiler = find_compiler()
    if compiler is None or not compiler.cross:
        pytest.skip("no ziglang: pip install -e '.[native]'")

    def get(name: str) -> Playable:
        def make(place: Path) -> None:
            (place / "parts").write_bytes(pickle.dumps(playable_of(native_fmu(name))))

        made = once(shared_folder / f"playable-{name}", make) / "parts"
        found: Playable = pickle.loads(made.read_bytes())
        return found

    return cache(get)


@pytest.fixture(scope="session")
def page_file(playable: Callable[[str], Playable], shared_folder: Path) -> Any:
    """page_file(NAME): the page on disk."""

    def get(name: str) -> Path:
        def make(place: Path) -> None:
            (place / f"{name}.html").write_text(render(playable(name)), encoding="utf-8")

        return once(shared_folder / f"page-{name}", make) / f"{name}.html"

    return get


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    with chromium() as found:
        yield found


Tab = Callable[..., AbstractContextManager[Page]]
Opened = Callable[..., Page]


@pytest.fixture(scope="session")
def tab(browser: Any) -> Tab:
    """with tab(path, **options) as page: in Chromium; at the end nothing must have gone wrong in it.

    A page that is open already, and empty, takes a fifth of the work of a new one.
    """
    idle: dict[str, list[Page]] = {}

    @contextmanager
    def get(path: Path | str, **options: Any) -> Iterator[Page]:
        alike = idle.setdefault(repr(options), [])
        page = alike.pop() if alike else Page(browser, **options)
        page.goto(path)
        yield page
        problems, requests = [*page.problems], [*page.requests]
        page.clear()
        alike.append(page)
        assert problems == []
        assert all(r.startswith(("file:", "blob:", "data:")) for r in requests)

    return get


@pytest.fixture
def opened(tab: Tab, page_file: Any) -> Iterator[Opened]:
    """opened(NAME), opened(path): that page until the test ends."""
    with ExitStack() as stack:

        def get(what: str | Path, **options: Any) -> Page:
            path = page_file(what) if what in EVERY else what
            return stack.enter_context(tab(path, **options))

        yield get
