"""What does a gradient cost: by one adjoint derivative, and by as many directional ones as it has components?

    python benchmarks/adjoint.py [masses|bodies] [n ...]

For chains of n links (chain.py) in model exchange: the derivatives of the first multiplier by all states.
Prints the number of states, microseconds of processor time of one evaluation (states set, the multiplier
got), of the adjoint and of the directional derivatives, each the least of RUNS in turns; then the adjoint
over one evaluation and over the directional ones.
"""

from __future__ import annotations

import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from ctypes import c_double, c_uint32
from pathlib import Path
from typing import Any

import numpy as np
from chain import bodies, chain
from fmpy import extract, read_model_description
from fmpy.fmi3 import FMU3Model

from lagfmu import Scene, build_fmu

RUNS = 15


class Asked:
    """An FMU in continuous-time mode at its start, and the calls that are measured."""

    def __init__(self, path: Path) -> None:
        self.description = read_model_description(path)
        self.fmu = FMU3Model(
            guid=self.description.guid,
            unzipDirectory=extract(path),
            modelIdentifier=self.description.modelExchange.modelIdentifier,
        )
        self.fmu.instantiate()
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        self.fmu.enterContinuousTimeMode()
        states = [d.variable.derivative.valueReference for d in self.description.derivatives]
        self.n = len(states)
        first = next(
            v.valueReference
            for v in self.description.modelVariables
            if v.causality == "output" and v.name.startswith("lambda.")
        )
        self.knowns = (c_uint32 * self.n)(*states)
        self.each = [(c_uint32 * 1)(s) for s in states]
        self.unknown, self.one = (c_uint32 * 1)(first), (c_double * 1)(1.0)
        self.found, self.column = (c_double * self.n)(), (c_double * 1)()
        self.fmu.getContinuousStates(self.found, self.n)
        self.x = np.array(self.found)

    def state(self) -> None:
        """The states, a little off each time, so that everything is evaluated anew."""
        self.x *= 1 + 1e-15
        self.fmu.setContinuousStates((c_double * self.n)(*self.x), self.n)

    def evaluate(self) -> None:
        """The multiplier."""
        self.state()
        self.fmu.getFloat64(list(self.unknown))

    def adjoint(self) -> np.ndarray:
        """The gradient by one call."""
        call: Any = self.fmu.fmi3GetAdjointDerivative
        call(
            *(self.fmu.component, self.unknown, 1, self.knowns, self.n),
            *(self.one, 1, self.found, self.n),
        )
        return np.array(self.found)

    def directional(self) -> np.ndarray:
        """The gradient by as many calls as it has components."""
        call: Any = self.fmu.fmi3GetDirectionalDerivative
        found = []
        for known in self.each:
            call(self.fmu.component, self.unknown, 1, known, 1, self.one, 1, self.column, 1)
            found.append(self.column[0])
        return np.array(found)


def spent(call: Callable[[], object], repeat: int) -> float:
    """Microseconds of processor time of a call."""
    begun = time.process_time()
    for _ in range(repeat):
        call()
    return (time.process_time() - begun) / repeat * 1e6


def main() -> None:
    """A line a size."""
    words = sys.argv[1:] or ["masses"]
    kind = words.pop(0) if not words[0].isdigit() else "masses"
    warnings.simplefilter("ignore")
    print(f"{'n':>4} states  evaluation    adjoint  directional [us]  adjoint/ev.  adjoint/dir.")
    for n in [int(word) for word in words] or [16, 64]:
        model = (chain if kind == "masses" else bodies)(n)
        with tempfile.TemporaryDirectory() as out:
            scene = Scene(model.name, stop_time=1.0)
            asked = Asked(build_fmu(model, Path(out), scene, check=False, fmi=3))
            asked.evaluate()
            scale = abs(directional := asked.directional()).max()
            assert abs(asked.adjoint() - directional).max() <= 1e-9 * scale
            calls = (asked.evaluate, 20), (asked.adjoint, 5), (asked.directional, 1)
            runs = [[spent(*pair) for pair in calls] for _ in range(RUNS)]
        e, a, d = (min(times) for times in zip(*runs, strict=True))
        print(
            f"{n:4d} {asked.n:6d}  {e:10.1f} {a:10.1f}  {d:11.1f} {a / e:17.1f} {a / d:13.3f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
