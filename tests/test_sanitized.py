"""The FMU's own sources under the sanitizers and under valgrind: no byte outside the arrays, nothing
uninitialized, nothing undefined, nothing left behind, in a life with everything in it (scenario.c)."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import runs
from conftest import of_each_kind, scene_of
from runtime import FLAGS, RUNTIME_FILES, SANITIZE, compiler, objects
from zoo import two_feet
from zoo.forces import JUMPS
from zoo.linkages import cart_arm, isosceles
from zoo.redundant import platform
from zoo.tops import geared, thrown_ball

from lagfmu import Model, Peak, Scene
from lagfmu.testing import GENERATED, unbundled

pytestmark = pytest.mark.filterwarnings("ignore::lagfmu.testing.RedundantConstraintWarning")
SCENARIO = Path(__file__).parent / "scenario.c"
MADE = (*GENERATED, "interface.c")  # for one FMU alone
RANDOM = Path(__file__).parent / "random3.c"
LIVES = {  # steps that reach the event or the singular point in between
    "Hemisphere": 0.07,  # a contact that opens
    "CartPendulum": 0.05,  # an input
    "PendulumAngle": 0.1,  # an embedding
    "BouncingBall": 0.1,  # impacts
    "HalfCar": 0.05,  # a table, outputs of the model, a prescribed motion
    "SlippingSphere": 0.1,  # friction
    "FallingRod": 0.05,  # friction in an impact
    "CrankWithBearingFriction": 0.05,  # friction of joints
    "PendulumNullspace": 0.1,
    "Platform": 0.1,  # one constraint too many
    "Isosceles": 0.37,  # a step that fails
    "Gate": 0.2,  # forces that jump at two places, no contact
    "Lifted": 0.2,  # a force that jumps and opens a contact
    "Peaks": 0.1,  # extremes, across impacts
    "Thrown": 0.1,  # speeds of a model's own, with contact and friction
    "Geared": 0.1,  # an angle that is unwrapped
    "CartArm": 0.1,  # a start by one
    "SliderCrankBodies": 0.1,  # by the angle of a joint that is no coordinate
    "Normal": 0.07,  # a scene: lambda of the hemisphere alone, numbers for m and g
    "Places": 0.1,  # a scene: coordinates that are only read, nothing is solved for lambda
}
FMI3_LIVES = (
    *("Hemisphere", "CartPendulum", "PendulumAngle", "BouncingBall", "HalfCar", "SlippingSphere"),
    *("SliderCrank", "Gyroscope", "CrankWithBearingFriction", "Crane"),
)
SCENES = {  # FMU, outputs, numbers
    "Normal": ("Hemisphere", ["lambda.surface"], ["m", "g"]),
    "Places": ("PendulumCartesian", ["x", "der(y)", "energy.total"], ["*"]),
}


def peaks() -> Model:
    """A ball whose extremes are told, across impacts."""
    model = scene_of("BouncingBall")[0].model
    return replace(model, name="Peaks", peaks=(Peak("der(y)"), Peak("energy.*")))


OWN = {
    "Platform": lambda: platform(True),
    "Isosceles": isosceles,
    "Peaks": peaks,
    "Thrown": thrown_ball,
    "Geared": geared,
    "CartArm": cart_arm,
    **JUMPS,
}


@pytest.fixture
def unpacked(native_fmu, built):
    """unpacked(NAME): folder of the FMU and its description."""

    def get(name: str) -> tuple[Path, Any]:
        if name in OWN:
            model = OWN[name]()
            path = built(model, Scene(model.name, tolerance=1e-9), whole=True)
        elif name in SCENES:
            fmu, outputs, numbers = SCENES[name]
            file, scene = scene_of(fmu)
            narrow = replace(scene, name=name, outputs=outputs, fixed=numbers)
            path = built(file.model, narrow, whole=True)
        else:
            path = native_fmu(name)
        folder, description = runs.unpacked(path, whole=True)
        return Path(folder), description

    return get


def program(folder: Path, name: str, flags: tuple[str, ...], importer: Path = SCENARIO) -> Path:
    """The importer with the FMU's generated sources and what it holds of the runtime, which is the same for
    every FMU."""
    sources = folder / "unbundled"
    sources.mkdir(exist_ok=True)
    files = unbundled({p.name: p.read_bytes() for p in (folder / "sources").iterdir()})
    for file, text in files.items():
        (sources / file).write_bytes(text)
    carried = sorted(f for f in files if f.endswith(".c") and f != "all.c")
    held = [f for f in carried if f not in MADE]
    generated = [str(sources / f) for f in carried if f in MADE]
    target = folder / f"{name}_{len(flags)}"
    linked = objects([importer, *(RUNTIME_FILES[file] for file in held)], flags)
    command = [compiler(), *FLAGS, *flags, "-Werror", f"-I{sources}", "-o", str(target)]
    run = subprocess.run(
        [*command, *generated, *linked, "-lm"], capture_output=True, text=True, timeout=300
    )
    assert run.returncode == 0, run.stderr[-2000:]
    return target


def arguments(description, step: float) -> list[str]:
    """The command line of scenario.c."""
    real = [v for v in description.modelVariables if v.type == "Real"]
    inputs = [str(v.valueReference) for v in real if v.causality == "input"]
    outputs = [str(v.valueReference) for v in real if v.causality == "output"]
    stop = description.defaultExperiment.stopTime
    sizes = description.numberOfContinuousStates, description.numberOfEventIndicators
    if description.modelName == "Isosceles":
        stop, inputs = 3.0, ["-2"]
    if description.modelName in ("CartArm", "SliderCrankBodies"):
        set_first = next(str(v.valueReference) for v in real if v.name in ("angle.B", "angle.A"))
        inputs, outputs = ["-3"], [set_first, *outputs]
    return [
        description.guid,
        str(stop),
        str(step),
        *map(str, sizes),
        *(inputs or ["-1"])[:1],
        *outputs,
    ]


@pytest.mark.parametrize(
    "name", of_each_kind(sorted(LIVES), kinds=("Hemisphere", "SlippingSphere"))
)
def test_nothing_is_undefined_and_no_byte_is_left_behind(unpacked, name):
    """AddressSanitizer, LeakSanitizer and UndefinedBehaviorSanitizer are silent."""
    folder, description = unpacked(name)
    made = program(folder, name, SANITIZE)
    run = subprocess.run(
        [str(made), *arguments(description, LIVES[name])],
        capture_output=True,
        text=True,
        timeout=120,
        env={"ASAN_OPTIONS": "detect_leaks=1", "UBSAN_OPTIONS": "print_stacktrace=1"},
    )
    assert run.returncode == 0, run.stderr[-3000:]
    assert run.stderr == ""


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["Hemisphere", "CartPendulum", "Isosceles"])
def test_valgrind_finds_nothing(unpacked, name):
    """No value is used before it is set, no block is left."""
    if shutil.which("valgrind") is None:
        pytest.skip("valgrind is not installed")
    folder, description = unpacked(name)
    made = program(folder, name, ())
    run = subprocess.run(
        [
            "valgrind",
            "--quiet",
            "--error-exitcode=99",
            "--leak-check=full",
            "--show-leak-kinds=all",
            str(made),
            *arguments(description, LIVES[name]),
        ],
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert run.returncode == 0, run.stderr[-3000:]


# ---------------------------------------------------------------------------- FMI 3.0


def random_calls(
    path: Path, flags: tuple[str, ...], lives: int, before: tuple[str, ...] = ()
) -> None:
    """random3.c with the FMU behind it."""
    unpacked_to, description = runs.unpacked(path, whole=True)
    made = program(Path(unpacked_to), f"{description.modelName}_random", flags, RANDOM)
    sizes = description.numberOfContinuousStates, len(description.eventIndicators)
    count = len(description.modelVariables)
    exchanged = description.modelExchange is not None
    clocks = any(v.type == "Clock" for v in description.modelVariables)
    given = [lives, 400, 0.07, count, *sizes, int(exchanged), int(clocks)]
    given += [v.valueReference for v in description.modelVariables if v.name == "solver.dae"]
    run = subprocess.run(
        [*before, str(made), description.instantiationToken, *map(str, given)],
        capture_output=True,
        text=True,
        timeout=300,
        env={"ASAN_OPTIONS": "detect_leaks=1", "UBSAN_OPTIONS": "print_stacktrace=1"},
    )
    assert run.returncode == 0, run.stderr[-3000:]
    assert run.stderr == ""
    assert int(run.stdout) > 100  # messages: much was refused, and told


@pytest.mark.parametrize(
    "name", of_each_kind(sorted(FMI3_LIVES), kinds=("Hemisphere", "SlippingSphere", "CartPendulum"))
)
def test_an_importer_may_call_anything_at_any_time(fmi3_fmu, name):
    """FMI 3.0: random calls in random lives, within steps too; the sanitizers are silent."""
    random_calls(fmi3_fmu(name), SANITIZE, 200)


def test_clocks_stand_random_calls_too(built):
    """The same of an FMU with clocks and event mode."""
    file, scene = scene_of("BouncingBall")
    random_calls(
        built(file.model, replace(scene, name="Clocked"), whole=True, fmi=3, clocks=True),
        SANITIZE,
        200,
    )


@pytest.mark.filterwarnings("ignore::lagfmu.testing.RedundantConstraintWarning")
def test_multipliers_that_are_given_stand_random_calls_too(built):
    """The same in DAE mode, of feet that stick together."""
    random_calls(built(two_feet.model, whole=True, fmi=3, dae=True), SANITIZE, 200)


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["Hemisphere", "CartPendulum"])
def test_valgrind_finds_nothing_in_random_calls(fmi3_fmu, name):
    """No value is used before it is set, no block is left."""
    if shutil.which("valgrind") is None:
        pytest.skip("valgrind is not installed")
    checked = ("valgrind", "--quiet", "--error-exitcode=99", "--leak-check=full")
    random_calls(fmi3_fmu(name), (), 30, checked)
