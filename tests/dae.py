"""An importer of FMI-LS-DAE 1.0.0-alpha.1.

It reads modelDescription.xml and the manifest of an FMU, and nothing else of lagfmu, and lets IDA (SUNDIALS)
solve for states and algebraic variables together,

    0 = y' - f(t, y, z) ,   0 = g(t, y, z)

y the states, z the algebraic variables, with event indicators of both as roots.  The calls are those that
the standard lays down: DAE mode in configuration mode, states and algebraic variables by one
fmi3SetFloat64, event mode where a root, the FMU or the start asks for it.
"""

from __future__ import annotations

import shutil
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, fromstring

import fmpy
import numpy as np
from fmpy.fmi3 import FMU3Model, fmi3Float64
from numpy.typing import NDArray

MANIFEST = "extra/org.fmi-standard.fmi-ls-dae/fmi-ls-manifest.xml"
NAMESPACE = "{http://fmi-standard.org/fmi-ls-manifest}"
ROOT_FOUND = 2  # of IDA's return values
MOST_EVENTS = 1000

Vector = NDArray[np.float64]


class Manifest:
    """Value references: `enable`; `algebraic`, `derivatives`, `residuals`, in order."""

    def __init__(self, path: Path) -> None:
        with zipfile.ZipFile(path) as archive:
            self.text = archive.read(MANIFEST)
        self.root = fromstring(self.text)
        (self.enable,) = self._references("EnableDAEParameter")
        self.algebraic = self._references("AlgebraicVariable")
        self.derivatives = self._references("ContinuousStateDerivative")
        self.residuals = self._references("Residual")

    def _references(self, kind: str) -> list[int]:
        return [int(v.get("valueReference", "")) for v in self.root.iter(kind)]

    def knowns(self, kind: str) -> dict[int, list[int] | None]:
        """What the elements of a kind depend on, by value reference; None: on all."""
        return {int(u.get("valueReference", "")): _listed(u) for u in self.root.iter(kind)}


def _listed(element: Element) -> list[int] | None:
    found = element.get("dependencies")
    return None if found is None else [int(k) for k in found.split()]


class Importer:
    """One instance for model exchange in continuous-time mode of DAE mode."""

    def __init__(self, path: Path, folder: Path, tolerance: float = 1e-12) -> None:
        description = fmpy.read_model_description(str(path))
        of = {int(v.valueReference): v for v in description.modelVariables}
        self.names = {k: v.name for k, v in of.items()}
        self.kinds = {k: v.type for k, v in of.items()}
        self.references = {v.name: k for k, v in of.items()}
        self.manifest = Manifest(path)
        self.unzipped = fmpy.extract(str(path), str(folder))
        self.fmu = FMU3Model(
            guid=description.guid,
            unzipDirectory=self.unzipped,
            modelIdentifier=description.modelExchange.modelIdentifier,
            instanceName="dae",
        )
        self.fmu.instantiate()
        self.fmu.enterConfigurationMode()
        self.fmu.setBoolean([self.manifest.enable], [True])
        self.fmu.exitConfigurationMode()
        self.fmu.enterInitializationMode(tolerance=tolerance, startTime=0.0)
        self.fmu.exitInitializationMode()
        self.states = [int(of[k].derivative.valueReference) for k in self.manifest.derivatives]
        self.count = len(self.states)
        self.known = [*self.states, *self.manifest.algebraic]
        self.unknown = [*self.manifest.derivatives, *self.manifest.residuals]
        self.indicators = len(self.manifest.knowns("EventIndicator"))
        self.nominals = np.array([float(of[k].nominal or 1.0) for k in self.known])
        self.events = 0
        self._rest()

    def _rest(self) -> None:
        """Event mode until nothing changes, then continuous-time mode."""
        while self.fmu.updateDiscreteStates()[0]:
            pass
        self.fmu.enterContinuousTimeMode()

    def close(self) -> None:
        """The instance and its files go."""
        self.fmu.terminate()
        self.fmu.freeInstance()
        shutil.rmtree(self.unzipped, ignore_errors=True)

    def get(self, references: Sequence[int]) -> Vector:
        """Float64 variables."""
        return np.array(self.fmu.getFloat64(list(references)))

    def value(self, name: str) -> float:
        """A Float64 variable by its name."""
        return float(self.get([self.references[name]])[0])

    def begin(self) -> Vector:
        """States and multipliers as the FMU itself has them."""
        return self.get(self.known)

    def put(self, t: float, y: Vector) -> None:
        """States and algebraic variables at a time."""
        self.fmu.setTime(t)
        self.fmu.setFloat64(self.known, y.tolist())

    def right_sides(self, t: float, y: Vector) -> Vector:
        """f, then g."""
        self.put(t, y)
        return self.get(self.unknown)

    def roots(self, t: float, y: Vector) -> Vector:
        """The event indicators."""
        self.put(t, y)
        found = (fmi3Float64 * max(self.indicators, 1))()
        self.fmu.getEventIndicators(found, self.indicators)
        return np.array(found[: self.indicators])

    def jacobian(self, t: float, y: Vector) -> Vector:
        """Of f and g by y and z, as the FMU's directional derivatives tell it, a column a call."""
        self.put(t, y)
        columns = [self.fmu.getDirectionalDerivative(self.unknown, [k], [1.0]) for k in self.known]
        return np.array(columns).T

    def accept(self, t: float, y: Vector, rooted: bool) -> bool:
        """A step is done; whether there was an event at its end, after which the FMU knows the state."""
        self.fmu.setTime(t)
        self.fmu.setContinuousStates((fmi3Float64 * self.count)(*y[: self.count]), self.count)
        self.fmu.setFloat64(self.manifest.algebraic, y[self.count :].tolist())
        asked, _ = self.fmu.completedIntegratorStep()
        if not (asked or rooted):
            return False
        self.fmu.enterEventMode()
        self._rest()
        self.events += 1
        assert self.events < MOST_EVENTS
        return True


def integrator(importer: Importer, tolerance: float) -> Any:
    """IDA for the residuals, roots and Jacobian of an importer."""
    from sksundae.ida import IDA

    n = importer.count

    def residual(t: float, y: Vector, yp: Vector, res: Vector) -> None:
        found = importer.right_sides(t, y)
        res[:n] = yp[:n] - found[:n]
        res[n:] = found[n:]

    def jacobian(t: float, y: Vector, yp: Vector, res: Vector, cj: float, J: Vector) -> None:
        J[:] = importer.jacobian(t, y)
        J[:n] = cj * np.eye(n, len(y)) - J[:n]

    def roots(t: float, y: Vector, yp: Vector, found: Vector) -> None:
        found[:] = importer.roots(t, y)

    roots.terminal = [True] * importer.indicators  # type: ignore[attr-defined]
    watched = {"eventsfn": roots, "num_events": importer.indicators} if importer.indicators else {}
    return IDA(
        residual,
        algebraic_idx=list(range(n, len(importer.known))),
        jacfn=jacobian,
        rtol=tolerance,
        atol=tolerance * importer.nominals,
        max_num_steps=100_000,
        **watched,
    )


def solve(importer: Importer, times: Vector, tolerance: float) -> Vector:
    """States and algebraic variables at these times, met one by one; the FMU stands at the last."""
    found, t = [importer.begin()], float(times[0])
    ida = None
    for end in times[1:]:
        while t < end:
            if ida is None:
                y = importer.begin()
                slopes = importer.right_sides(t, y)
                slopes[importer.count :] = 0.0
                ida = integrator(importer, tolerance)
                ida.init_step(t, y, slopes)
            step = ida.step(end, method="onestep", tstop=end)
            assert step.success, step.message
            t, y = float(step.t), np.array(step.y, dtype=float).reshape(-1)
            if importer.accept(t, y, step.status == ROOT_FOUND):
                ida = None
        found.append(importer.begin() if ida is None else y)
    return np.array(found)
