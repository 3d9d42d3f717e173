"""What an impact is held against, straight from the model: its mass matrix, and the gaps f, the speeds
s = G v - nu and the coefficients of restitution of its constraints, as functions of what an FMU reports."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from lagfmu import ClosedForm, Contact, Model, Nonholonomic, names
from lagfmu.names import read
from lagfmu.testing import (
    TIME,
    Expr,
    Prepared,
    function,
    name_of,
    pack_closed_forms,
    reactions_in,
    unpack_closed_forms,
)

Column = NDArray[np.float64]
Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class Collision:
    """At one state: M (n, n), G (m, n), f (m; 0 for constraints on velocities), s, e and nu (m)."""

    M: Matrix
    G: Matrix
    f: Column
    s: Column
    e: Column
    nu: Column


class Geometry:
    """`contacts`, `bilateral`: which constraints are; the others, `rough`, hold by friction, or while a
    contact is closed: by those that `gates` (m, m) names."""

    def __init__(self, forms: Mapping[str, Expr]) -> None:
        kinds = [n.split(":") for n in forms if n.startswith("kind:")]
        self.coordinates = [n.split(":")[1] for n in forms if n.startswith("coordinate:")]
        self.names = [name for _, name, _ in kinds]
        self.contacts, self.bilateral, rough = (
            np.array([k == kind for *_, k in kinds], dtype=bool)
            for kind in ("contact", "bilateral", "rough")
        )
        self.rough = bool(rough.any())
        pairs = [n.split(":")[1:] for n in forms if n.startswith("gate:")]
        self.gates = np.array([[[c, by] in pairs for by in self.names] for c in self.names], float)
        self.forms = forms
        self.symbols = sorted({s for e in forms.values() for s in e.free_symbols}, key=str)
        self.needs = [str(s) for s in self.symbols]
        self.function = function(self.symbols, list(forms.values()))

    def at(self, values: Mapping[str, float]) -> Collision:
        """`values` holds coordinates, velocities, parameters, inputs and time."""
        numbers = self.function(*(values[n] for n in self.needs))
        known = dict(zip(self.forms, map(float, numbers), strict=True))
        n, m = len(self.coordinates), len(self.names)
        M, G, each = np.zeros((n, n)), np.zeros((m, n)), np.zeros((3, m))
        for i, a in enumerate(self.coordinates):
            for j, b in enumerate(self.coordinates):
                M[i, j] = known.get(f"mass:{a}:{b}", 0.0)
            for k, c in enumerate(self.names):
                G[k, i] = known.get(f"row:{c}:{a}", 0.0)
        for k, c in enumerate(self.names):
            each[:, k] = [known.get(f"{what}:{c}", 0.0) for what in ("gap", "speed", "restitution")]
        v = np.array([values[names.derivative(n)] for n in self.coordinates])
        f, s, e = each
        return Collision(M, G, f, s, e, G @ v - s)


def lay_geometry(fmu: Path, prepared: Prepared) -> None:
    """Write it to where the judge of the FMU looks for it."""
    known = {v.name for v in prepared.table.variables}
    forms = [ClosedForm(n, e, sp.S.Zero) for n, e in _forms(prepared.model, known).items()]
    _beside(fmu).write_bytes(pack_closed_forms(prepared.scene, forms, prepared.table))


def geometry_of(fmu: Path) -> Geometry | None:
    """What was laid beside it; None if that is not all that an impact is made of."""
    file = _beside(fmu)
    if not file.exists():
        return None
    closed_forms = unpack_closed_forms(file.read_bytes(), str(file))
    forms = {c.name: sp.sympify(c.expected) for c in closed_forms}
    return Geometry(forms) if forms.get("count") == len(forms) - 1 else None


def twin(fmu: Path) -> Path:
    """Where the same model lies with its constraints declared in the opposite order."""
    return fmu.with_suffix(".reversed.fmu")


def _beside(fmu: Path) -> Path:
    return fmu.with_suffix(".impacts.json")


def _forms(model: Model, known: set[str]) -> dict[str, Expr]:
    forms: dict[str, Expr] = {}
    rates = {q: q.diff(TIME) for q in model.coordinates}
    for q, v in rates.items():
        forms[f"coordinate:{name_of(q)}"] = sp.S.One
        for p, w in rates.items():
            forms[f"mass:{name_of(q)}:{name_of(p)}"] = model.energy_expression.diff(v, w)
    by_friction = {name: law for law in model.frictions for name in law.of}
    for c in model.constraints:
        f = sp.sympify(c.expression)
        speed = f if isinstance(c, Nonholonomic) else f.diff(TIME)
        gate = None if isinstance(c, Contact) else c.while_closed
        kind = "rough" if gate is not None or c.name in by_friction else "bilateral"
        if isinstance(c, Contact):
            kind = "contact"
        forms[f"kind:{c.name}:{kind}"] = sp.S.One
        gates = set() if gate is None else {gate}
        if c.name in by_friction:
            normal = sp.sympify(by_friction[c.name].normal)
            gates |= {read(str(s)).constraint for s in reactions_in(normal)}
        forms |= {f"gate:{c.name}:{by}": sp.S.One for by in gates}
        forms[f"gap:{c.name}"] = sp.S.Zero if isinstance(c, Nonholonomic) else f
        forms[f"speed:{c.name}"] = speed
        for q, v in rates.items():
            forms[f"row:{c.name}:{name_of(q)}"] = speed.diff(v)
        if isinstance(c, Contact):
            forms[f"restitution:{c.name}"] = sp.sympify(c.restitution)
    forms = {n: e for n, e in forms.items() if e != 0}
    if any(names.derivative(name_of(q)) not in known for q in rates):
        forms = {}
    return forms | {"count": sp.Integer(len(forms))}
