"""What `linearize` found: matrices, poles and modes, as tables, words, JSON and MAT.

Poles and modes of z' = A z, its zero poles apart.

A zero pole of several steps (a coordinate that may stand anywhere, and drifts) is what rounding moves
furthest, like eps^(1/2).  So they are taken out first: the null space of A by singular values, then that of
what A does across it, and so on (the staircase of Golub & Van Loan, sect. 7.6.5), of a balanced A.  The rest
has the other poles, as exact as they are well conditioned.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.markup import escape
from rich.table import Table
from scipy.linalg import matrix_balance, qr

from ...errors import UsageError
from ...files import write_whole
from ...model.units import for_reading
from ...page.table import as_text, new_table
from .exchange import Floats

Complex = NDArray[np.complex128]
ZERO = 1e-9  # part of the norm of A, below which a singular value is none


@dataclass(frozen=True)
class Poles:
    """`values` [1/s] that are not zero, the slowest first, and their `vectors` in z (k, p); `indifferent`: of
    each step of zero poles the states that may be changed by it."""

    values: Complex
    vectors: Complex
    indifferent: tuple[tuple[str, ...], ...]

    @property
    def zeros(self) -> int:
        """How many poles are zero."""
        return sum(map(len, self.indifferent))


def poles(A: Floats, states: Sequence[str], least: float = ZERO) -> Poles:
    """Of A (k, k); `least`: the part of its norm that is 0."""
    if not len(A):
        return Poles(np.zeros(0, complex), np.zeros((0, 0), complex), ())
    block, (scale, _) = matrix_balance(A, permute=False, separate=True)
    norm = float(np.linalg.norm(block, 2)) or 1.0
    basis, steps = np.eye(len(A)), []
    found = []  # of each step: its null space, and the block before it
    while len(block):
        _, s, Vt = np.linalg.svd(block)
        rank = int((s > max(least, 0.0) * norm).sum())
        if rank == len(block):
            break
        null, across = Vt[rank:].T, Vt[:rank].T
        steps.append(_named(basis @ null, states))
        found.append((null, across, block))
        basis, block = basis @ across, across.T @ block @ across
    values, vectors = np.linalg.eig(block) if len(block) else (np.zeros(0), np.zeros((0, 0)))
    for null, across, before in reversed(found):
        lifted = across @ vectors
        part = (null.T @ before @ lifted) / values[None, :]
        vectors = lifted + null @ part
    order = np.lexsort((values.imag < 0, np.round(np.abs(values) / norm, 12)))
    whole = (scale[:, None] * vectors)[:, order]
    return Poles(values[order].astype(complex), whole.astype(complex), tuple(steps))


def _named(null: Floats, states: Sequence[str]) -> tuple[str, ...]:
    """The states of which as many as there are directions say where one stands among these."""
    _, order = qr(null.T, mode="r", pivoting=True)
    return tuple(states[k] for k in sorted(order[: null.shape[1]]))


LEAST = 1e-9  # part of the fastest pole, that is no growth and no damping
SHOWN, MOVES = (
    4,
    0.05,
)  # coordinates of a mode in words; part of the largest that one moves at least
HEAD = ("pole [1/s]", "frequency [Hz]", "damping", "time [s]", "moves")
CHANGES = 1e-3  # of A along the motion


@dataclass(frozen=True)
class Linearization:
    """z' = A z + B u, y = C z + D u beside a point: z, u and y are differences from their values there.

    `states` of z are coordinates and velocities that the constraints leave free, in SI (`units`);
    `at_states`, `at_inputs`, `at_outputs`: their values at the point, `point` those of all states of the FMU,
    `rates`: z' there, 0 at an `equilibrium`.  `poles.values` [1/s] with their `vectors`;
    `shapes` (coordinates, poles): how all `coordinates` move in each mode, `sizes` what is much of each.
    `redundant`: constraints whose multipliers are not unique; `stuck`: what friction holds; `error`: the
    estimated relative error of differences (None: derivatives are the FMU's own); `drift`: how much A changes
    along the motion, of itself, in the time of the fastest pole.
    """

    name: str
    time: float
    equilibrium: bool
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    A: Floats
    B: Floats
    C: Floats
    D: Floats
    point: Mapping[str, float]
    at_states: Floats
    at_inputs: Floats
    at_outputs: Floats
    rates: Floats
    poles: Poles
    coordinates: tuple[str, ...]
    shapes: Complex
    sizes: Floats
    units: Mapping[str, str]
    redundant: tuple[str, ...]
    stuck: tuple[str, ...]
    error: float | None
    drift: float

    @property
    def stability(self) -> str:
        """In words."""
        values, zeros = self.poles.values, self.poles.zeros
        least = LEAST * float(np.abs(values).max(initial=0.0))
        if self.error is not None:
            least *= max(1.0, self.error / 1e-12)
        growth = float(values.real.max(initial=-np.inf))
        if growth > least:
            return f"unstable: grows by e in {1 / growth:.6g} s"
        drifts = "; displaced, it drifts on" * (len(self.poles.indifferent) > 1)
        if len(values) == 0 and drifts:
            return drifts.removeprefix("; ")
        if growth > -least:
            return f"undamped: to first order neither stable nor unstable{drifts}"
        if zeros:
            return f"stable, but for what is indifferent{drifts}"
        return "asymptotically stable" if len(values) else "nothing moves"

    def mode(self, k: int) -> dict[str, complex]:
        """How coordinates move in the mode of pole k: that which moves furthest, in its size, by 1."""
        shape = self.shapes[:, k]
        order = np.argsort(-np.abs(shape) / self.sizes, kind="stable")
        if not len(order) or not np.abs(shape[order[0]]) > 0:
            return {}
        far = np.abs(shape) / self.sizes
        moving = [j for j in order if far[j] >= MOVES * far[order[0]]]
        return {self.coordinates[j]: complex(shape[j] / shape[order[0]]) for j in moving}

    def words(self, k: int) -> str:
        """That, the first few."""
        told = []
        for name, part in list(self.mode(k).items())[:SHOWN]:
            unit = for_reading(self.units.get(name, "1"))
            phase = round(float(np.degrees(np.angle(part))))
            way = {0: "", 180: " against", -180: " against"}.get(phase, f" at {phase} deg")
            told.append(f"{name} {abs(part):.3g}{f' {unit}' if unit else ''}{way}")
        return ", ".join(told)

    def summary(self) -> str:
        """One line."""
        what = "equilibrium" if self.equilibrium else f"state at t = {self.time:g} s"
        n, zeros = len(self.states), self.poles.zeros
        also = f", {zeros} of them 0" * bool(zeros)
        return f"{self.name}: {what}, {n} states, {n} poles{also}; {self.stability}"

    def tables(self) -> list[Table]:
        """The point, and the poles that are not zero, a conjugate pair once."""
        point = new_table("where", "state", "value", "unit", words=["state", "unit"])
        for name, value in zip(self.states, self.at_states, strict=True):
            point.add_row(
                escape(name), f"{_clean(value):.9g}", for_reading(self.units.get(name, "1"))
            )
        drawn = new_table("modes", *HEAD, text=HEAD[-1:])
        for k, s in enumerate(self.poles.values):
            if s.imag >= 0:
                drawn.add_row(*map(escape, self.row(k)))
        return [point, drawn]

    def row(self, k: int) -> tuple[str, str, str, str, str]:
        """Of the table of modes."""
        s = self.poles.values[k]
        waves = abs(s.imag) > 0
        real = s.real if abs(s.real) > LEAST * abs(s) else 0.0
        return (
            f"{real:.9g}" + (f" +- {s.imag:.9g}i" if waves else ""),
            f"{abs(s) / (2 * np.pi):.6g}" if waves else "",
            f"{-real / abs(s) + 0.0:.4f}",
            f"{1 / abs(real):.5g}" if real else "",
            self.words(k),
        )

    def remarks(self) -> list[str]:
        """What is indifferent, and what to know."""
        told = []
        if self.poles.indifferent:
            first, *later = self.poles.indifferent
            told.append(f"indifferent (zero poles): {', '.join(first)}")
            told += [
                f"zero poles behind these, which let them drift: {', '.join(more)}"
                for more in later
            ]
        if self.stuck:
            told.append(f"held by friction, wherever it sticks: {', '.join(self.stuck)}")
        if self.redundant:
            told.append(
                f"not unique: {', '.join(self.redundant)} (redundant constraints); they are no outputs"
            )
        if not self.equilibrium:
            least = np.abs(self.rates).max(initial=0.0)
            told.append(
                f"no equilibrium: rates up to {least:.6g} (SI); A, B, C, D are those of this instant"
            )
        if self.drift > CHANGES:
            told.append(
                f"A changes along the motion ({self.drift:.1g} of itself in the time of its fastest pole): "
                "its poles are no exponents of the motion"
            )
        if self.error is not None:
            told.append(
                "the FMU has no directional derivatives (frictions): differences of its functions, of sixth "
                f"order, a displacement is a thousandth of a size, estimated error {self.error:.1e}"
            )
        return told

    def to_dict(self) -> dict[str, Any]:
        """Everything, for JSON."""
        return {
            "fmu": self.name,
            "time": self.time,
            "equilibrium": self.equilibrium,
            "stability": self.stability,
            "states": self._listed(self.states, self.at_states),
            "inputs": self._listed(self.inputs, self.at_inputs),
            "outputs": self._listed(self.outputs, self.at_outputs),
            "rates": self.rates.tolist(),
            "point": dict(self.point),
            **{n: getattr(self, n).tolist() for n in "ABCD"},
            "poles": [
                {
                    "real": float(s.real),
                    "imag": float(s.imag),
                    "frequency_hz": abs(s) / (2 * np.pi),
                    "damping": float(-s.real / abs(s)),
                    "moves": {n: [x.real, x.imag] for n, x in self.mode(k).items()},
                }
                for k, s in enumerate(self.poles.values)
            ],
            "zero_poles": [list(step) for step in self.poles.indifferent],
            "redundant": list(self.redundant),
            "held_by_friction": list(self.stuck),
            "error_of_differences": self.error,
            "drift": self.drift,
        }

    def _listed(self, those: tuple[str, ...], values: Floats) -> list[dict[str, Any]]:
        return [
            {"name": n, "value": float(x), "unit": self.units.get(n, "1")}
            for n, x in zip(those, values, strict=True)
        ]

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write .json, or .mat (MATLAB: A, B, C, D, names, values, poles).  Raises UsageError for another."""
        out = Path(path)
        if out.suffix == ".json":
            from ...verification.pipeline import text_of

            write_whole(out, text_of(self.to_dict()).encode())
        elif out.suffix == ".mat":
            self._to_mat(out)
        else:
            raise UsageError(f"{str(out)!r} ends in {out.suffix!r}, expected .json or .mat")
        return out

    def _to_mat(self, out: Path) -> None:
        import io

        from scipy.io import savemat

        buffer = io.BytesIO()
        named: dict[str, Any] = {
            n: np.array(getattr(self, n), dtype=object) for n in ("states", "inputs", "outputs")
        }
        savemat(
            buffer,
            {n: getattr(self, n) for n in "ABCD"}
            | named
            | {"x0": self.at_states, "u0": self.at_inputs, "y0": self.at_outputs}
            | {"poles": self.poles.values, "zero_poles": float(self.poles.zeros)},
        )
        write_whole(out, buffer.getvalue())

    def to_scipy(self) -> Any:
        """scipy.signal.StateSpace.  Raises UsageError where nothing moves."""
        from scipy.signal import StateSpace

        if not self.states:
            raise UsageError(f"{self.name} has no states here: nothing moves")
        return StateSpace(*self._with_columns())

    def _with_columns(self) -> tuple[Floats, Floats, Floats, Floats]:
        """SciPy takes no system without inputs or outputs: one that does nothing stands for none."""
        n = len(self.states)
        B = self.B if self.inputs else np.zeros((n, 1))
        C = self.C if self.outputs else np.zeros((1, n))
        D = self.D if self.inputs and self.outputs else np.zeros((len(C), B.shape[1]))
        return self.A, B, C, D

    def to_control(self) -> Any:
        """control.StateSpace with these names, of python-control (`pip install control`)."""
        try:
            import control  # type: ignore[import-not-found, import-untyped, unused-ignore]
        except ImportError:
            raise UsageError("python-control is not installed: pip install control") from None
        return control.ss(
            *(self.A, self.B, self.C, self.D),
            states=[_plain(n) for n in self.states],
            inputs=[_plain(n) for n in self.inputs],
            outputs=[_plain(n) for n in self.outputs],
        )

    def __repr__(self) -> str:
        return "\n".join([self.summary(), as_text(*self.tables()), *self.remarks()])


def _clean(x: float) -> float:
    return 0.0 if abs(x) < 1e-15 else float(x)


def _plain(name: str) -> str:
    """python-control keeps the dot for systems of systems."""
    return name.replace(".", "_")
