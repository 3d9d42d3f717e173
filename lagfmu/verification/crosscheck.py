"""Reference results of an FMU, as other tools read them.

- `write_crosscheck`: the files of the FMI cross-check, NAME_ref.csv, NAME_in.csv, NAME_ref.opt and a README;
- `layered`: the same for the inside of the FMU by the layered standard FMI-LS-REF 1.0.0-alpha.1, in
  extra/org.fmi-standard.fmi-ls-ref/.

Both come from a run at a relative tolerance of 1e-12.
"""

from __future__ import annotations

import io
import zlib
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

from .. import names
from ..errors import SimulationError
from ..files import write_whole
from ..fmu.read import Trajectory, communication_points, experiment_of, read_description
from ..fmu.write import REFERENCES
from .check import Verification
from .pipeline import as_json, report
from .simulate import simulate

TOLERANCE = 1e-12
DIGITS = 14
POINTS, BYTES = 200, 20_000  # of a reference that travels inside an FMU, its bytes as packed
PLACE = "extra/org.fmi-standard.fmi-ls-ref"
MANIFEST = {
    "xmlns:fmi-ls": "http://fmi-standard.org/fmi-ls-manifest",
    "fmi-ls:fmi-ls-name": "org.fmi-standard.fmi-ls-ref",
    "fmi-ls:fmi-ls-version": "1.0.0-alpha.1",
    "fmi-ls:fmi-ls-description": "Layered Standard providing information on related files included "
    "in an FMU.",
}
NOTE = """Reference results of {name} (FMI-LS-REF), in extra/org.fmi-standard.fmi-ls-ref/

One experiment: from the start values of modelDescription.xml to {stop!r} s, with a communication step of
{step!r} s.  {file} holds multipliers, generalized forces of constraint, coordinates, contacts and
events, made by this FMU in co-simulation at a relative tolerance of {tolerance:g}.

Expect each Real within ten times your tolerance of its column's largest magnitude; more in long runs and in
chaotic motions; single points beside an event may differ by the error of its time.  Look at the multipliers:
they are what this FMU is for.  verification.json tells how far the outputs were from their closed forms.
"""
README = """# {name}: reference results

Made by lagfmu with fmpy from `{file}` at a relative tolerance of {tolerance:g}: co-simulation from 0 to
{stop!r} s, a communication step of {step!r} s.

- `{name}_ref.csv`: time in s and all outputs at the communication points, in the units of the FMU
- `{name}_ref.opt`: the settings of the run
{inputs}
A result agrees if each Real differs by at most {close:g} of its column's largest magnitude. Where a
contact opens between two points, single points beside it may differ by the error of the event's time.
"""


def reference_run(
    fmu: Path,
    stop_time: float | None = None,
    step_size: float | None = None,
    inputs: Trajectory | None = None,
) -> tuple[Trajectory, float, float]:
    """The run, its stop time and its communication step [s].  Raises SimulationError."""
    experiment = experiment_of(read_description(fmu), stop_time, step_size)
    stop, step = experiment.stop_time, experiment.step_size
    return simulate(fmu, stop, step, TOLERANCE, inputs=inputs), stop, step


def as_csv(table: Trajectory, names: Sequence[str], digits: int = 17) -> str:
    """`time` and the named columns; Booleans as 0 and 1."""
    text = io.StringIO()
    text.write(",".join(f'"{n}"' for n in ("time", *names)) + "\n")
    for row in table:
        cells = [f"{float(row['time']):.{digits}g}"]
        for n in names:
            kind = table.dtype[n].kind
            cells.append(f"{float(row[n]):.{digits}g}" if kind == "f" else str(int(row[n])))
        text.write(",".join(cells) + "\n")
    return text.getvalue()


def write_crosscheck(
    fmu: Path,
    out: Path,
    stop_time: float | None = None,
    step_size: float | None = None,
    inputs: Trajectory | None = None,
) -> list[Path]:
    """Write the files into the folder `out`.  Raises SimulationError or BuildError."""
    table, stop, step = reference_run(fmu, stop_time, step_size, inputs)
    name = fmu.stem
    known = [n for n in table.dtype.names or () if n != "time"]
    outputs = [n for n in known if names.read(n).head != names.SOLVER]
    options = {"StartTime": 0.0, "StopTime": stop, "StepSize": step, "RelTol": TOLERANCE}
    files = {
        f"{name}_ref.csv": as_csv(table, outputs),
        f"{name}_ref.opt": "".join(f"{k},{v!r}\n" for k, v in options.items()),
    }
    driven = ""
    if inputs is not None:
        files[f"{name}_in.csv"] = as_csv(
            inputs, [n for n in inputs.dtype.names or () if n != "time"]
        )
        driven = f"- `{name}_in.csv`: the inputs, between the rows linear\n"
    files["README.md"] = README.format(
        name=name,
        file=fmu.name,
        tolerance=TOLERANCE,
        stop=stop,
        step=step,
        inputs=driven,
        close=1e-6,
    )
    for file, text in files.items():
        write_whole(out / file, text.encode())
    return [out / file for file in files]


def layered(fmu: Path, found: Verification | None) -> dict[str, bytes]:
    """Path in the FMU -> content: manifest, experiment, result, and the report of the verification.

    The result has multipliers, generalized forces of constraint, coordinates, contacts and departures, at so
    many points that it stays small.  Raises SimulationError.
    """
    description = read_description(fmu)
    name = description.modelName
    table, stop, step = reference_run(fmu)
    stride = max(1, -(-(len(table) - 1) // (POINTS - 1)))
    while True:
        wide = min(stride * step, stop)
        chosen = at_points(fmu, stop, wide)
        text = as_csv(chosen, _told(chosen), DIGITS)
        if len(zlib.compress(text.encode(), 9)) <= BYTES or wide >= stop:
            break
        stride *= 2
    experiments = ET.Element("Experiments", name=f"{name}: default experiment")
    one = ET.SubElement(
        experiments,
        "Experiment",
        name="default",
        description=f"From the start values of modelDescription.xml; result at {TOLERANCE:g}",
        startTime="0.0",
        stopTime=repr(stop),
        stepSize=repr(wide),
        tolerance=repr(TOLERANCE),
    )
    ET.SubElement(one, "References", source=f"{name}_ref.csv", type="text/csv")
    manifest = ET.Element("fmiReferences", MANIFEST)
    related = [
        (
            "application/x-ma-hs-experiments",
            "experiments.xml",
            "experiment/validation",
            "Default experiment",
        ),
        ("text/csv", f"{name}_ref.csv", "result", "Output of the default experiment"),
    ]
    files = {f"{name}_ref.csv": text.encode(), "experiments.xml": _xml(experiments)}
    if found is not None:
        files["verification.json"] = _stable(found).encode()
        related.append(
            (
                "application/json",
                "verification.json",
                "report",
                "Closed forms that the FMU was held to",
            )
        )
    for kind, source, role, what in related:
        ET.SubElement(manifest, "Related", type=kind, source=source, role=role, description=what)
    files["fmi-ls-manifest.xml"] = _xml(manifest)
    told = NOTE.format(name=name, file=f"{name}_ref.csv", stop=stop, step=wide, tolerance=TOLERANCE)
    return {f"{PLACE}/{k}": v for k, v in sorted(files.items())} | {REFERENCES: told.encode()}


def at_points(fmu: Path, stop: float, step: float) -> Trajectory:
    """The reference run with communication points that far apart [s]."""
    count = len(communication_points(stop, step))
    if count > POINTS:
        raise SimulationError(f"{count} points, expected at most {POINTS}")
    return simulate(fmu, stop, step, TOLERANCE)


def _told(table: Trajectory) -> list[str]:
    """The columns of a result that travels: forces of constraint, motion, events."""
    known = [n for n in table.dtype.names or () if n != "time"]
    moving = names.coordinates(known)
    events = (names.DEPARTURES, names.DEPARTURE_TIME, names.SLIPS, names.SLIP_TIME)
    shares = {n for n in names.those(known, names.FORCE) if names.read(n).constraint}
    told = names.those(known, names.MULTIPLIER, names.FORCE, names.CONTACT, *events)
    return [n for n in known if n in moving or (n in told and n not in shares)]


def _stable(found: Verification) -> str:
    """The report without what differs from run to run, so that the FMU's bytes do not."""
    from dataclasses import replace

    return as_json([report(f"{found.name}.fmu", replace(found, seconds=0.0))])


def _xml(root: ET.Element) -> bytes:
    ET.indent(root, "  ")
    text: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"
