"""A PD controller moves the cart of CartPendulum.fmu: in Python through fmpy, and as an FMU beside it (SSP).

The controller sees the cart at the communication points alone.  It holds its force between them, or passes on
how the force changes (fmi2SetRealInputDerivatives); the errors are those of s against the loop as one model.

    python docs/closed_loop.py
"""

from __future__ import annotations

import runpy
import shutil
import tempfile
import zipfile
from dataclasses import replace
from pathlib import Path
from xml.sax.saxutils import quoteattr

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from fmpy.ssp.simulation import simulate_ssp
from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Input, Model, Output, Parameter, build_fmu, simulate

KP, KD, GOAL = 40.0, 20.0, 0.5  # N/m, N.s/m, m: of the controller, and where it brings the cart
FILTER = 100.0  # 1/s: of the controller that is an FMU
STOP = 4.0  # s
STEPS = 0.04, 0.02, 0.01, 0.005  # s
PARTS = "plant", "controller"
WIRES = (("plant", "s"), ("controller", "u")), (("controller", "force"), ("plant", "F"))


kp, kd, goal = symbols("kp kd goal", positive=True)
LAW = [Parameter(kp, KP, "N/m"), Parameter(kd, KD, "N.s/m"), Parameter(goal, GOAL, "m")]


def plant() -> Model:
    """Of models/cart_pendulum.py."""
    file = Path(__file__).parent.parent / "models" / "cart_pendulum.py"
    return runpy.run_path(str(file))["model"]


def whole(by: Model | None = None) -> Model:
    """The plant with the law in its equations, or with the controller `by`."""
    model = plant()
    s, F, x = (dynamicsymbols(name) for name in ("s", "F", "seen"))
    seen, more = (s, []) if by is None else (x, by.parameters)
    force = kp * (goal - seen) - kd * seen.diff()
    forces = {q: f.subs(F, force) for q, f in model.forces.items()}
    coordinates, energy, start = model.coordinates, model.kinetic_energy, model.start
    if by is not None:  # its mass follows s without a push back, as over a wire
        m, w = (p.symbol for p in by.parameters[:2])
        coordinates = {**coordinates, x: "m"}
        energy += m * x.diff() ** 2 / 2
        forces[x] = -2 * m * w * x.diff() - m * w**2 * (x - s)
    return replace(
        model,
        name="Loop",
        kinetic_energy=energy,
        coordinates=coordinates,
        forces=forces,
        parameters=[*model.parameters, *(more or LAW)],
        inputs=[],
        outputs=[],
        start=start,
    )


def controller() -> Model:
    """The same law of a filtered measurement: a mass on a spring and a damper follows u."""
    x, u = dynamicsymbols("seen u")
    m, w = symbols("own w", positive=True)
    return Model(
        name="Controller",
        lagrangian=m * x.diff() ** 2 / 2 - m * w**2 * (x - u) ** 2 / 2,
        forces={x: -2 * m * w * x.diff()},
        coordinates={x: "m"},
        inputs=[Input(u, "m")],
        parameters=[Parameter(m, 1.0, "kg"), Parameter(w, FILTER, "1/s"), *LAW],
        outputs=[Output("force", kp * (goal - x) - kd * x.diff(), "N")],
    )


def run(fmu: str, step: float, passes_on: bool) -> np.ndarray:
    """s at the communication points; call by call, as an importer makes them."""
    told = fmpy.read_model_description(fmu)
    reference = {v.name: v.valueReference for v in told.modelVariables}
    one = FMU2Slave(
        guid=told.guid,
        unzipDirectory=fmpy.extract(fmu),
        modelIdentifier=told.coSimulation.modelIdentifier,
        instanceName="plant",
    )
    one.instantiate()
    one.setupExperiment(startTime=0.0, stopTime=STOP, tolerance=1e-10)
    one.enterInitializationMode()
    one.exitInitializationMode()
    places = [reference[n] for n in ("s", "der(s)", "der(s,2)")]
    F, found = [reference["F"]], []
    for k in range(round(STOP / step)):
        s, v, _ = one.getReal(places)
        found.append(s)
        one.setReal(F, [KP * (GOAL - s) - KD * v])
        if passes_on:
            a = one.getReal(places[2:])[0]  # with the new force
            one.setRealInputDerivatives(F, [1], [-KP * v - KD * a])
        one.doStep(k * step, step)
    found.append(one.getReal(places[:1])[0])
    one.terminate()
    one.freeInstance()
    return np.array(found)


def errors(folder: str) -> list[tuple[float, float, float]]:
    """Of each step: the largest error of s, relative to its largest value; held, and passed on."""
    fmu = str(build_fmu(plant(), folder, check=False))
    one = build_fmu(whole(), folder, check=False)
    rows = []
    for step in STEPS:
        exact = simulate(one, STOP, step_size=step, tolerance=1e-12)["s"]
        off = (np.abs(run(fmu, step, way) - exact).max() for way in (False, True))
        rows.append((step, *(float(x / np.abs(exact).max()) for x in off)))
    return rows


def ssp(folder: str) -> Path:
    """Both FMUs and their wires in one file, as the SSP standard has it."""
    fmus = [build_fmu(model, folder, check=False) for model in (plant(), controller())]
    inputs = {end for _, end in WIRES}
    components = "".join(
        f'<ssd:Component name="{part}" type="application/x-fmu-sharedlibrary" '
        f'source="resources/{fmu.name}"><ssd:Connectors>'
        + "".join(
            f'<ssd:Connector name="{name}" kind="{"input" if (of, name) in inputs else "output"}">'
            "<ssc:Real/></ssd:Connector>"
            for wire in WIRES
            for of, name in wire
            if of == part
        )
        + "</ssd:Connectors></ssd:Component>"
        for part, fmu in zip(PARTS, fmus, strict=True)
    )
    wires = "".join(
        f"<ssd:Connection startElement={quoteattr(a)} startConnector={quoteattr(x)} "
        f"endElement={quoteattr(b)} endConnector={quoteattr(y)}/>"
        for (a, x), (b, y) in WIRES
    )
    text = (
        '<?xml version="1.0" encoding="UTF-8"?>'
        '<ssd:SystemStructureDescription name="Loop" version="1.0" '
        'xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription" '
        'xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon">'
        f'<ssd:System name="Loop"><ssd:Elements>{components}</ssd:Elements>'
        f"<ssd:Connections>{wires}</ssd:Connections></ssd:System>"
        f'<ssd:DefaultExperiment startTime="0" stopTime="{STOP}"/></ssd:SystemStructureDescription>'
    )
    path = Path(folder) / "loop.ssp"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", text)
        for fmu in fmus:
            archive.write(fmu, f"resources/{fmu.name}")
    return path


def of_ssp(path: Path, folder: str) -> list[tuple[float, float]]:
    """Of each step: the largest error of s in fmpy's simulation of an SSP, against the loop as one model."""
    one = build_fmu(whole(controller()), folder, check=False)
    rows = []
    for step in (0.002, 0.001, 0.0005):
        exact = simulate(one, STOP, step_size=step, tolerance=1e-12)["s"]
        found = simulate_ssp(str(path), stop_time=STOP - step / 2, step_size=step)["plant.s"]
        rows.append((step, float(np.abs(found - exact[1:]).max() / np.abs(exact).max())))
    return rows


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        print("in Python  held     passed on")
        for step, held, passed in errors(folder):
            print(f"{step:<9g}  {held:.1e}  {passed:.1e}")
        print("as an SSP")
        path = ssp(folder)
        for step, off in of_ssp(path, folder):
            print(f"{step:<9g}  {off:.1e}")
        print("wrote", shutil.copy(path, path.name))
