"""The FMU's own sources under the sanitizers and under valgrind: no byte outside the arrays, nothing
uninitialized, nothing undefined, nothing left behind, in a life with everything in it (scenario.c)."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import fmpy
import pytest
from conftest import of_each_kind
from redundant import platform
from runtime import FLAGS, RUNTIME_FILES, SANITIZE, compiler, objects
from test_extremes import isosceles
from test_jumps import MODELS as JUMPS
from test_speeds_native import ball, geared

from lagfmu import Peak, Scene, build_fmu
from lagfmu.testing import GENERATED, find_compiler, load

pytestmark = [
    pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine"),
    pytest.mark.filterwarnings("ignore::lagfmu.testing.RedundantConstraintWarning"),
]
SCENARIO = Path(__file__).parent / "scenario.c"
LIVES = {  # steps that reach the event or the singular point in between
    "Hemisphere": 0.07,  # a contact that opens
    "CartPendulum": 0.05,  # an input
    "PendulumAngle": 0.1,  # an embedding
    "BouncingBall": 0.1,  # impacts
    "HalfCar": 0.05,  # a table, outputs of the model, a prescribed motion
    "SlippingSphere": 0.1,  # friction
    "FallingRod": 0.05,  # friction in an impact
    "PendulumNullspace": 0.1,
    "Platform": 0.1,  # one constraint too many
    "Isosceles": 0.37,  # a step that fails
    "Gate": 0.2,  # forces that jump at two places, no contact
    "Lifted": 0.2,  # a force that jumps and opens a contact
    "Peaks": 0.1,  # extremes, across impacts
    "Thrown": 0.1,  # speeds of a model's own, with contact and friction
    "Geared": 0.1,  # an angle that is unwrapped
    "Normal": 0.07,  # a scene: lambda of the hemisphere alone, numbers for m and g
    "Places": 0.1,  # a scene: coordinates that are only read, nothing is solved for lambda
}
OWN = {**JUMPS, "Thrown": ball, "Geared": geared}
SCENES = {  # FMU, outputs, numbers
    "Normal": ("Hemisphere", ["lambda.surface"], ["m", "g"]),
    "Places": ("PendulumCartesian", ["x", "der(y)", "energy.total"], ["*"]),
}


@pytest.fixture(scope="module")
def unpacked(native_fmu, prepared, tmp_path_factory):
    """unpacked(NAME): folder of the FMU and its description."""
    folder = tmp_path_factory.mktemp("sources")

    def get(name: str):
        if name == "Platform":
            path = build_fmu(platform(True), folder, target="native", check=False)
        elif name == "FallingRod":
            file = load(Path(__file__).parent.parent / "models" / "falling_rod.py")
            path = build_fmu(file.model, folder, target="native", check=False)
        elif name == "Peaks":
            model = prepared("BouncingBall").model
            model = replace(model, name=name, peaks=(Peak("der(y)"), Peak("energy.*")))
            path = build_fmu(model, folder, target="native", check=False)
        elif name in OWN:
            path = build_fmu(OWN[name](), folder, target="native", check=False)
        elif name == "Isosceles":
            path = build_fmu(
                isosceles(),
                folder,
                Scene("Isosceles", tolerance=1e-9),
                target="native",
                check=False,
            )
        elif name in SCENES:
            model, outputs, numbers = SCENES[name]
            scene = replace(prepared(model).asked, name=name, outputs=outputs, fixed=numbers)
            path = build_fmu(prepared(model).model, folder, scene, target="native", check=False)
        else:
            path = native_fmu(name)
        return Path(fmpy.extract(str(path), str(folder / name))), fmpy.read_model_description(
            str(path)
        )

    return get


def program(folder: Path, name: str, flags: tuple[str, ...]) -> Path:
    """scenario.c with the FMU's generated sources and what it holds of the runtime, which is the same for
    every FMU."""
    sources = folder / "sources"
    carried = sorted(p for p in sources.glob("*.c") if p.name != "all.c")
    held = [p.name for p in carried if p.name not in GENERATED]
    generated = [str(p) for p in carried if p.name in GENERATED]
    target = folder / f"{name}_{len(flags)}"
    linked = objects([SCENARIO, *(RUNTIME_FILES[file] for file in held)], flags)
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
