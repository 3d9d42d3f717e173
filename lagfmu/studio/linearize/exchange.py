"""One instance of an FMU for model exchange: rates and outputs at a state that is set, and their Jacobians.

Jacobians are the FMU's directional derivatives.  Where it has none (frictions) they are central differences,
extrapolated: with D(h) = (8 (f(h) - f(-h)) - (f(2h) - f(-2h)))/(12 h) of fourth order,

    f' = D(h) + (D(h) - D(2h))/15 ,   error about |D(h) - D(2h)|/15

(Hairer, Norsett & Wanner I, sect. II.9), h a thousandth of the size of what is displaced.
"""

from __future__ import annotations

import contextlib
import ctypes
import itertools
import re
import shutil
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from fmpy.fmi1 import FMICallException
from numpy.typing import NDArray

from ... import names
from ...errors import SimulationError
from ...fmu.archive import unpack
from ...fmu.binary import exchanging, listen
from ...fmu.read import described_rules, kind_of, units_of

Floats = NDArray[np.float64]
LEAST = 1e-3  # of the largest size of a unit
PART = 1e-3  # of a size, by which a difference displaces
ROUNDS = 100  # of the discrete states at one instant
TYPES = {"Real": "Float64", "Integer": "Int32", "Boolean": "Boolean"}  # of FMI 3.0
DIRECTIONAL = re.compile(r'<ModelExchange\b[^>]*\bprovidesDirectionalDerivatives?="true"')
TELLS = 1e-6  # part of a value over a step, that a change of it is at least, to tell of errors


class Exchange:
    """An instance in continuous-time mode.

    `states`, `rates`: names, in the order of the FMU, without the heat; `coordinate`: which states are
    coordinates (the others are velocities); `size`: of each; `unit`: of variables; `derivatives`: whether it
    has directional ones; `error`: the largest estimated relative error of a difference so far.
    """

    def __init__(self, path: Path, description: Any) -> None:
        self.description, self.rules = description, described_rules(description)
        self._unpacked = "" if path.is_dir() else unpack(path)
        self.reference = {v.name: int(v.valueReference) for v in description.modelVariables}
        found = [(u.variable.derivative.name, u.variable) for u in description.derivatives]
        self.all = [n for n, _ in found]
        found = [(n, v) for n, v in found if n != names.DISSIPATED]
        self.states, self.rates = [n for n, _ in found], [v.name for _, v in found]
        self.coordinate = np.array(
            [(v.description or "").startswith(names.VELOCITY_OF) for _, v in found], dtype=bool
        )
        self.three = description.fmiVersion != "2.0"
        self.error, self.size = 0.0, np.ones(len(self.states))
        self.unit = units_of(description.modelVariables)
        self._said: list[str] = []
        with self._refusing():
            self.fmu = exchanging(folder := Path(self._unpacked or path), description, "linearize")
        told = (folder / "modelDescription.xml").read_text(encoding="utf-8")
        self.derivatives = DIRECTIONAL.search(told) is not None  # fmpy does not say it of FMI 3.0

    def __enter__(self) -> Exchange:
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(FMICallException):
            self.fmu.freeInstance()
        shutil.rmtree(self._unpacked, ignore_errors=True)

    def begin(self, values: Mapping[str, Any], inputs: Mapping[str, float], t: float) -> None:
        """Start at t [s] with these values; then the modes of contacts and frictions stand."""
        with self._refusing():
            if not self.three:
                self.fmu.setupExperiment(startTime=t)
            self._set(values)
            self.fmu.enterInitializationMode(**({"startTime": t} if self.three else {}))
            self._set(inputs)
            self.fmu.exitInitializationMode()
            update = self.fmu.updateDiscreteStates if self.three else self.fmu.newDiscreteStates
            for _ in range(ROUNDS):
                if not update()[0]:
                    break
            self.fmu.enterContinuousTimeMode()
            nominals = self._array("getNominalsOfContinuousStates")
            self.size = self._sizes(
                np.maximum(nominals, np.abs(self._array("getContinuousStates")))
            )

    def _sizes(self, found: Floats) -> Floats:
        """Of the states of the motion: none below a thousandth of the largest of its unit."""
        found = found[self.kept]
        units = np.array([self.unit.get(n) or "1" for n in self.states])
        for unit in set(units.tolist()):
            alike = units == unit
            found[alike] = np.maximum(found[alike], LEAST * found[alike].max())
        return found

    @contextlib.contextmanager
    def _refusing(self) -> Iterator[None]:
        self._said.clear()
        listen(lambda status, text: self._said.append(text) if status > 1 else None)
        try:
            yield
        except FMICallException as error:
            raise SimulationError("; ".join(self._said) or str(error)) from None

    def _set(self, values: Mapping[str, Any]) -> None:
        for n, value in values.items():
            rule = self.rules[n]
            kind = "Integer" if rule.kind == "Enumeration" else rule.kind
            if self.three:
                kind = "Int64" if rule.kind == "Enumeration" else TYPES[kind]
            getattr(self.fmu, f"set{kind}")([self.reference[n]], [rule.number(value)])

    def _array(self, call: str, count: int | None = None) -> Floats:
        found = (ctypes.c_double * (len(self.all) if count is None else count))()
        getattr(self.fmu, call)(found, len(found))
        return np.array(found)

    # ------------------------------------------------------------------ at a state

    @property
    def kept(self) -> NDArray[np.bool_]:
        """Which of the FMU's states are those of the motion."""
        return np.array([n != names.DISSIPATED for n in self.all], dtype=bool)

    def state(self) -> Floats:
        """Of the motion."""
        with self._refusing():
            return self._array("getContinuousStates")[self.kept]

    def put(self, x: Floats) -> None:
        """Set the states of the motion."""
        with self._refusing():
            whole = self._array("getContinuousStates")
            whole[self.kept] = x
            self.fmu.setContinuousStates((ctypes.c_double * len(whole))(*whole), len(whole))

    def go(self, x: Floats, dx: Floats, by: Sequence[str], u: Floats, du: Floats, h: float) -> None:
        """Set the states x + h dx, and of the inputs `by` those that du moves to u + h du."""
        self.put(x + h * dx)
        moved = [(n, float(a + h * d)) for n, a, d in zip(by, u, du, strict=True) if d != 0]
        with self._refusing():
            self._set(dict(moved))

    def at(self, t: float) -> None:
        """Set the time [s]."""
        with self._refusing():
            self.fmu.setTime(t)

    def rate(self) -> Floats:
        """Derivatives of the states of the motion."""
        call = "getContinuousStateDerivatives" if self.three else "getDerivatives"
        with self._refusing():
            return self._array(call)[self.kept]

    def indicators(self) -> Floats:
        """Signs tell contacts and frictions."""
        count = int(self.description.numberOfEventIndicators or 0)
        with self._refusing():
            return self._array("getEventIndicators", count)

    def read(self, wanted: Sequence[str]) -> Floats:
        """Values; of a Boolean 1 or 0."""
        kinds = {v.name: kind_of(v) for v in self.description.modelVariables}
        found = np.empty(len(wanted))
        with self._refusing():
            for kind, group in itertools.groupby(range(len(wanted)), lambda k: kinds[wanted[k]]):
                places = list(group)
                get = getattr(self.fmu, f"get{TYPES[kind] if self.three else kind}")
                found[places] = get([self.reference[wanted[k]] for k in places])
        return found

    # ------------------------------------------------------------------ Jacobians

    def along(
        self, of: Sequence[str], by: Sequence[str], dx: Floats, du: Floats | None = None
    ) -> Floats:
        """(of, k): how Real variables change along k directions: dx (states, k), and du of inputs `by`."""
        du = np.zeros((len(by), dx.shape[1])) if du is None else du
        if not of or not dx.shape[1]:
            return np.zeros((len(of), dx.shape[1]))
        step = self._directional if self.derivatives else self._difference
        return np.array([step(of, by, dx[:, k], du[:, k]) for k in range(dx.shape[1])]).T

    def _directional(self, of: Sequence[str], by: Sequence[str], dx: Floats, du: Floats) -> Floats:
        knowns = [(n, d) for n, d in zip([*self.states, *by], [*dx, *du], strict=True) if d != 0]
        if not knowns:
            return np.zeros(len(of))
        references = [[self.reference[n] for n in those] for those in (of, [n for n, _ in knowns])]
        with self._refusing():
            found = self.fmu.getDirectionalDerivative(*references, [d for _, d in knowns])
        return np.array(found)

    def _difference(self, of: Sequence[str], by: Sequence[str], dx: Floats, du: Floats) -> Floats:
        x, u = self.state(), self.read(by)
        sizes = np.concatenate([self.size, np.where(u == 0, 1.0, np.abs(u))])
        reach = float((np.abs(np.concatenate([dx, du])) / sizes).max(initial=0.0))
        if reach == 0:
            return np.zeros(len(of))
        h = PART / reach

        def side(steps: float) -> Floats:
            self.go(x, dx, by, u, du, steps * h)
            return self.read(of)

        near, wide, far = (side(s) - side(-s) for s in (1, 2, 4))
        rest = np.abs(side(0))
        fine, coarse = (8 * near - wide) / (12 * h), (8 * wide - far) / (24 * h)
        off = (fine - coarse) / 15
        tells = np.abs(fine) > TELLS * rest / h
        if tells.any():
            self.error = max(self.error, float((np.abs(off[tells]) / np.abs(fine[tells])).max()))
        return np.asarray(fine + off)
