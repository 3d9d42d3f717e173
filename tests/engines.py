"""One job for three engines that import FMUs and share no code with fmpy or with each other.

    libcosim   C++ (libcosimpy): fixed communication steps, values exchanged between them
    ecos       C++ (ecospy): likewise
    fmuloader  ctypes: single calls of FMI; the communication steps are taken here

    python engines.py ENGINE JOB.json ANSWER.json

A job has `fmus` {instance: {path, guid, identifier, variables: {name: [reference, type]}}}, `values`
{instance: {variable: value}} for the initialization, `connections` [[from, variable, to, variable]],
`drive` {instance: {variable: [value for each step]}}, `step` [s], `steps`, and `record` [[instance,
variable]].  The answer is {rows: [[recorded values] after each step]}, {error} or {absent}.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib
import json
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

PACKAGES = {"libcosim": "libcosimpy", "ecos": "ecospy", "fmuloader": "fmuloader"}
Job = dict[str, Any]


class EngineError(Exception):
    """What the engine said when it could not go on."""


def type_of(job: Job, instance: str, name: str) -> str:
    """Real, Integer, Boolean or String."""
    return job["fmus"][instance]["variables"][name][1]


def reference(job: Job, instance: str, name: str) -> int:
    """Value reference."""
    return job["fmus"][instance]["variables"][name][0]


# ---------------------------------------------------------------------------- libcosim


def in_libcosim(job: Job) -> list[list[float]]:
    """Rows of recorded values; instances go by number, variables by value reference."""
    from libcosimpy._internal import get_last_error_message
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    def must(good: bool) -> None:
        if not good:
            raise EngineError(get_last_error_message())

    execution = CosimExecution.from_step_size(round(job["step"] * 1e9))  # nanoseconds
    observer, hand = CosimObserver.create_last_value(), CosimManipulator.create_override()
    must(execution.add_observer(observer))
    must(execution.add_manipulator(hand))
    number = {}
    for instance, fmu in job["fmus"].items():
        slave = CosimLocalSlave(fmu_path=fmu["path"], instance_name=instance)
        number[instance] = execution.add_local_slave(slave)
        must(number[instance] >= 0)
        found = execution.slave_variables(number[instance])
        known = {v.name.decode(): v.reference for v in found}
        told = {n: r for n, (r, kind) in fmu["variables"].items() if kind != "Enumeration"}
        must(known == told)  # libcosim ignores Enumerations, with a warning
    for instance, given in job["values"].items():
        for name, value in given.items():
            at = (number[instance], reference(job, instance, name), value)
            if isinstance(value, int):
                must(execution.integer_initial_value(*at))
            else:
                must(execution.real_initial_value(*at))
    for source, output, sink, taken in job["connections"]:
        ends = (number[source], reference(job, source, output))
        ends += (number[sink], reference(job, sink, taken))
        must(execution.connect_real_variables(*ends) == 0)
    look = {
        "Real": observer.last_real_values,
        "Integer": observer.last_integer_values,
        "Boolean": observer.last_boolean_values,
    }

    def value_of(instance: str, name: str) -> float:
        get = look[type_of(job, instance, name)]
        return float(get(number[instance], [reference(job, instance, name)])[0])

    rows = []
    for step in range(job["steps"]):
        for instance, driven in job["drive"].items():
            for name, values in driven.items():
                place = [reference(job, instance, name)]
                must(hand.slave_real_values(number[instance], place, [values[step]]))
        must(execution.step())
        rows.append([value_of(*variable) for variable in job["record"]])
    return rows


# ---------------------------------------------------------------------------- ecos


def in_ecos(job: Job) -> list[list[float]]:
    """Rows of recorded values; variables are `instance::name`.  ecos goes on whatever an FMU returns:
    what was refused stands in its log alone."""
    from ecospy import EcosSimulation, EcosSimulationStructure
    from ecospy.lib import EcosLib

    EcosLib.set_log_level("debug")
    start = {f"{i}::{n}": v for i, given in job["values"].items() for n, v in given.items()}
    with EcosSimulationStructure() as structure:
        for instance, fmu in job["fmus"].items():
            structure.add_model(instance, fmu["path"])
        for source, output, sink, taken in job["connections"]:
            structure.make_real_connection(f"{source}::{output}", f"{sink}::{taken}")
        structure.add_parameter_set("start", start)
        with EcosSimulation(structure=structure, step_size=job["step"]) as simulation:
            if not simulation.init(parameter_set="start"):
                raise EngineError(EcosLib.get_last_error())
            look = {
                "Real": simulation.get_real,
                "Integer": simulation.get_integer,
                "Boolean": simulation.get_bool,
            }
            rows = []
            for step in range(job["steps"]):
                for instance, driven in job["drive"].items():
                    for name, values in driven.items():
                        simulation.set_real(f"{instance}::{name}", values[step])
                simulation.step()
                rows.append(
                    [float(look[type_of(job, i, n)](f"{i}::{n}")) for i, n in job["record"]]
                )
            simulation.terminate()
    return rows


# ---------------------------------------------------------------------------- fmuloader


def in_fmuloader(job: Job) -> list[list[float]]:
    """Rows of recorded values.  With `rates` in the job a value that is passed on goes on, during the
    step, along the derivative that its source tells."""
    from fmuloader import fmi2

    slaves = {}
    for instance, fmu in job["fmus"].items():
        slave = slaves[instance] = fmi2.Fmi2Slave(fmu["path"], model_identifier=fmu["identifier"])
        slave.instantiate(
            instance,
            fmi2.Fmi2Type.CO_SIMULATION,
            guid=fmu["guid"],
            cannot_use_memory_management_functions=True,  # its own cut pointers to 32 bits
        )
        slave.setup_experiment(0.0)
        slave.enter_initialization_mode()
        for name, value in job["values"].get(instance, {}).items():
            give = slave.set_integer if isinstance(value, int) else slave.set_real
            give([reference(job, instance, name)], [value])

    def exchange(rates: bool) -> None:
        values = [
            slaves[source].get_real([reference(job, source, output)])
            for source, output, _, _ in job["connections"]
        ]
        for value, (source, output, sink, taken) in zip(values, job["connections"], strict=True):
            at, to = [reference(job, source, output)], [reference(job, sink, taken)]
            slaves[sink].set_real(to, value)
            if rates:
                slope = slaves[source].get_real_output_derivatives(at, [1])
                slaves[sink].set_real_input_derivatives(to, [1], slope)

    def value_of(instance: str, name: str) -> float:
        get = getattr(slaves[instance], f"get_{type_of(job, instance, name).lower()}")
        return float(get([reference(job, instance, name)])[0])

    for _ in range(2):  # an input may depend on one that was passed on before
        exchange(rates=False)
    for slave in slaves.values():
        slave.exit_initialization_mode()
    rows = []
    for step in range(job["steps"]):
        exchange(rates=job.get("rates", False))
        for instance, driven in job["drive"].items():
            for name, values in driven.items():
                slaves[instance].set_real([reference(job, instance, name)], [values[step]])
        for slave in slaves.values():
            status = slave.do_step(step * job["step"], job["step"])
            if status != fmi2.Fmi2Status.OK:
                raise EngineError(f"fmi2DoStep returned {status.name}")
        rows.append([value_of(*variable) for variable in job["record"]])
    for slave in slaves.values():
        slave.terminate()
        slave.free_instance()
    return rows


# ---------------------------------------------------------------------------- the process


def load(engine: str) -> None:
    """The engine's library; ecos needs that of oneTBB, which is the system's or in the package `tbb`."""
    if engine == "ecos":
        with contextlib.suppress(metadata.PackageNotFoundError):
            for file in metadata.files("tbb") or []:
                if file.name == "libtbb.so.12":
                    ctypes.CDLL(str(file.locate()), mode=ctypes.RTLD_GLOBAL)
    importlib.import_module(PACKAGES[engine])
    if engine == "libcosim":
        importlib.import_module("libcosimpy._internal").libcosimc()


def main(engine: str, question: str, answer: str) -> None:
    """Do the job in `question`, write {rows}, {error} or {absent} to `answer`."""
    job = json.loads(Path(question).read_text())
    found: dict[str, Any]
    try:
        load(engine)
    except (ImportError, OSError) as error:
        found = {"absent": str(error)}
    else:
        do = {"libcosim": in_libcosim, "ecos": in_ecos, "fmuloader": in_fmuloader}[engine]
        try:
            found = {"rows": do(job)}
        except Exception as error:
            found = {"error": f"{type(error).__name__}: {error}"}
    Path(answer).write_text(json.dumps(found))


if __name__ == "__main__":
    main(*sys.argv[1:])
