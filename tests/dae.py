"""An importer of FMI-LS-DAE.

It reads the manifest of an FMU, and nothing else of lagfmu, and lets IDA (SUNDIALS) solve for states and
algebraic variables together,

    0 = y' - f(t, y, z) ,   0 = g(t, y, z)

y the states, z the algebraic variables, g of each residual the formulation of index 1.  That of the positions
and of the velocities are left to drift with the solver's tolerance.
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
from fmpy.fmi3 import FMU3Model
from numpy.typing import NDArray

MANIFEST = "extra/org.fmi-standard.fmi-ls-dae/fmi-ls-manifest.xml"
NAMESPACE = "{http://fmi-standard.org/fmi-ls-manifest}"

Vector = NDArray[np.float64]


class Manifest:
    """`algebraic`: value references; `residuals`: of each (index, reference, those that it depends on)."""

    def __init__(self, path: Path) -> None:
        with zipfile.ZipFile(path) as archive:
            self.text = archive.read(MANIFEST)
        self.root = fromstring(self.text)
        self.algebraic = [int(v.get("valueReference", "")) for v in self._all("AlgebraicVariable")]
        self.derivatives = [
            int(v.get("valueReference", "")) for v in self._all("ContinuousStateDerivative")
        ]
        self.residuals = [
            [
                (int(f.get("index", "")), int(f.get("valueReference", "")), _listed(f))
                for f in residual
            ]
            for residual in self._all("Residual")
        ]
        self.of_index_1 = [
            next(reference for index, reference, _ in formulations if index == 1)
            for formulations in self.residuals
        ]

    def _all(self, kind: str) -> list[Element]:
        return list(self.root.iter(NAMESPACE + kind))

    def knowns(self, kind: str) -> dict[int, list[int]]:
        """What the elements of a kind depend on, by value reference."""
        return {int(u.get("valueReference", "")): _listed(u) for u in self._all(kind)}


def _listed(element: Element) -> list[int]:
    return [int(k) for k in element.get("dependencies", "").split()]


class Importer:
    """One instance for model exchange in continuous-time mode."""

    def __init__(self, path: Path, folder: Path) -> None:
        description = fmpy.read_model_description(str(path))
        of = {int(v.valueReference): v for v in description.modelVariables}
        self.names = {k: v.name for k, v in of.items()}
        self.kinds = {k: v.type for k, v in of.items()}
        self.manifest = Manifest(path)
        self.unzipped = fmpy.extract(str(path), str(folder))
        self.fmu = FMU3Model(
            guid=description.guid,
            unzipDirectory=self.unzipped,
            modelIdentifier=description.modelExchange.modelIdentifier,
            instanceName="dae",
        )
        self.fmu.instantiate()
        self.fmu.enterInitializationMode(tolerance=1e-12, startTime=0.0)
        self.fmu.exitInitializationMode()
        self.fmu.updateDiscreteStates()
        self.fmu.enterContinuousTimeMode()
        self.states = [int(of[k].derivative.valueReference) for k in self.manifest.derivatives]
        self.count = len(self.states)

    def close(self) -> None:
        """The instance and its files go."""
        self.fmu.terminate()
        self.fmu.freeInstance()
        shutil.rmtree(self.unzipped, ignore_errors=True)

    def get(self, references: Sequence[int]) -> Vector:
        """Float64 variables."""
        return np.array(self.fmu.getFloat64(list(references)))

    def begin(self) -> Vector:
        """States and multipliers as the FMU itself starts with them."""
        return self.get([*self.states, *self.manifest.algebraic])

    def put(self, t: float, y: Vector) -> None:
        """States and algebraic variables at a time."""
        self.fmu.setTime(t)
        self.fmu.setContinuousStates(
            (fmpy.fmi3.fmi3Float64 * self.count)(*y[: self.count]), self.count
        )
        self.fmu.setFloat64(self.manifest.algebraic, y[self.count :].tolist())

    def right_sides(self, t: float, y: Vector) -> Vector:
        """f, then g."""
        self.put(t, y)
        return self.get([*self.manifest.derivatives, *self.manifest.of_index_1])

    def jacobian(self, t: float, y: Vector) -> Vector:
        """Of f and g by y and z, as the FMU's directional derivatives tell it, a column a call."""
        self.put(t, y)
        unknown = [*self.manifest.derivatives, *self.manifest.of_index_1]
        known = [*self.states, *self.manifest.algebraic]
        columns = [self.fmu.getDirectionalDerivative(unknown, [k], [1.0]) for k in known]
        return np.array(columns).T


def solve(importer: Importer, times: Vector, tolerance: float) -> Any:
    """IDA's states and algebraic variables at these times."""
    from sksundae.ida import IDA

    n, y0 = importer.count, importer.begin()

    def residual(t: float, y: Vector, yp: Vector, res: Vector) -> None:
        found = importer.right_sides(t, y)
        res[:n] = yp[:n] - found[:n]
        res[n:] = found[n:]

    def jacobian(t: float, y: Vector, yp: Vector, res: Vector, cj: float, J: Vector) -> None:
        J[:] = importer.jacobian(t, y)
        J[:n] = cj * np.eye(n, len(y)) - J[:n]

    yp0 = np.zeros_like(y0)
    yp0[:n] = importer.right_sides(times[0], y0)[:n]
    ida = IDA(
        residual,
        algebraic_idx=list(range(n, len(y0))),
        jacfn=jacobian,
        rtol=tolerance,
        atol=tolerance,
        max_num_steps=100_000,
    )
    return ida.solve(times, y0, yp0)
