"""The manifest of the layered standard for differential-algebraic equations, and of what it cannot be had.

FMI-LS-DAE 1.0.0-alpha.1 (September 2026).  Its `ModelStructure` stands in the place of that of
modelDescription.xml while the structural parameter `EnableDAEParameter` is true.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from functools import cached_property
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from numpy.typing import NDArray

from .. import names
from ..errors import ModelError
from ..interface.dependencies import Dependencies, Names
from ..interface.outputs import Outputs
from ..interface.variables import VariableTable
from ..mechanics.equations import FrictionLaw
from ..mechanics.formulations import Form, sharing_inertia
from ..model.model import Contact
from ..prepare.consistency import posed
from ..prepare.steps import Prepared
from .described import Unknown, as_text, offers_exchange, structure_of


class GivenMultipliers(Dependencies):
    """Of the variables of a form whose multipliers are known."""

    def __init__(self, form: Form) -> None:
        super().__init__(form)
        self.multipliers = [names.name(names.MULTIPLIER, c.name) for c in self.eom.constraints]
        self.known |= {*self.multipliers}
        self._order |= {name: len(self._order) + k for k, name in enumerate(self.multipliers)}
        self.laws = {name: law for law in self.eom.frictions for name in law.of}

    @cached_property
    def _groups_of(self) -> tuple[dict[int | None, Names], dict[int, Names]]:
        eom = self.eom
        of_speeds: dict[int | None, Names] = {}
        for speeds in sharing_inertia(eom):
            M = [m for (i, _), m in eom.M.todok().items() if i in speeds]
            G = {(k, j): a for (k, j), a in eom.G.todok().items() if j in speeds}
            symbols = self.symbols(*M, *G.values(), *(eom.F[i] for i in speeds))
            symbols |= {self.multipliers[k] for k, _ in G}
            of_speeds |= dict.fromkeys(speeds, symbols)
        rows = [c.name for c in eom.constraints]
        return of_speeds, {
            k: self._of_law(self.laws[c]) if c in self.laws else frozenset([self.multipliers[k]])
            for k, c in enumerate(rows)
        }

    def _of_law(self, law: FrictionLaw) -> Names:
        """The multipliers of a friction, those of its normal force, and the symbols beside them."""
        rows = (names.name(names.MULTIPLIER, c) for c in (*law.of, *law.normal_rows))
        return self.symbols(*law.expressions).union(rows)

    def equation(self, k: int) -> Names:
        """The symbols behind what vanishes by the multiplier of a row: G vdot - gamma, the multiplier itself,
        what a law of friction makes of it by its slip."""
        own, c = self._rows[k], self.eom.constraints[k]
        found = self.symbols(*own.values(), self.eom.gamma[k]) | {self.multipliers[k]}
        found = found.union(*(self.group(speed=j) for j in own))
        if c.name in self.laws:
            rows = {name: j for j, name in enumerate(c.name for c in self.eom.constraints)}
            law = self.laws[c.name]
            found = (found | self._of_law(law)).union(*(self.rates(rows[name]) for name in law.of))
        return found

    def indicator(self, name: str) -> Names | None:
        """Behind that of a contact; of all others nothing is said."""
        for k, c in enumerate(self.eom.constraints):
            if isinstance(c, Contact) and c.name == name:
                return self.symbols(self.eom.f[k]) | {self.multipliers[k]}
        return None


def _known_with_multipliers(
    form: Form, table: VariableTable
) -> Mapping[str, tuple[str, ...] | None]:
    """Inputs, states, multipliers and the time behind each variable, by name; None: all may be."""
    behind = GivenMultipliers(form)
    outputs = Outputs(behind, loses=names.DISSIPATED in table.states)
    found: dict[str, tuple[str, ...] | None] = {v.name: v.depends for v in outputs.all()}
    rows = {c.name: k for k, c in enumerate(behind.eom.constraints)}
    for v in table.those(names.EQUATION):
        found[v.name] = behind.at_points(behind.equation(rows[v.of.constraint]))
    for v in table.those(names.INDICATOR):
        of = behind.indicator(v.of.constraint)
        found[v.name] = None if of is None else behind.at_points(of)
    return found


LOG = logging.getLogger("lagfmu")
STANDARD = "org.fmi-standard.fmi-ls-dae"
MANIFEST = f"extra/{STANDARD}/fmi-ls-manifest.xml"
HEAD = {
    "xmlns:fmi-ls": "http://fmi-standard.org/fmi-ls-manifest",
    "fmi-ls:fmi-ls-name": STANDARD,
    "fmi-ls:fmi-ls-version": "1.0.0-alpha.1",
    "fmi-ls:fmi-ls-description": "Layered standard for differential-algebraic equations",
}
SINGULAR = 1e-12  # of masses that are scaled to 1: the least eigenvalue that is none


def check_dae(prepared: Prepared) -> None:
    """Raises ModelError with all that stands against an importer that solves for the multipliers."""
    system, found = prepared.system, prepared.structure
    problems = []
    if not offers_exchange(prepared):
        problems.append(
            "--dae is for model exchange, which an FMU with error bars, sensitivities or estimated rates of "
            "inputs has not: build it without them"
        )
    if prepared.formulation != "multipliers":
        problems.append(
            f"--dae: the formulation {prepared.formulation!r} has no multipliers to solve for: take "
            "'multipliers'"
        )
    elif not system.rows:
        problems.append("--dae: there is no constraint, and no multiplier to solve for")
    if found.undecided:
        problems.append(
            f"--dae: constraints that follow from others ({', '.join(map(repr, found.redundant))}) share the "
            f"normal force of {', '.join(map(repr, found.undecided))}, which has no one value: leave them out"
        )
    problems += _massless(prepared)
    problems += [
        f"--dae: {name!r} is not among the outputs of the scene: ask for it too (--outputs)"
        for row in system.rows
        if (name := names.name(names.MULTIPLIER, row.name)) not in prepared.table
    ]
    if problems:
        raise ModelError(prepared.model.name, problems)
    if found.redundant:
        LOG.info(
            "--dae: %s follow from others: in DAE mode lambda of as many is 0, the others bear the forces",
            ", ".join(map(repr, found.redundant)),
        )


def _masses(prepared: Prepared) -> tuple[NDArray[np.float64], ...]:
    """M, F and G where it begins."""
    begun = prepared.structure.start
    u, p = posed(prepared).values
    M, F, G, *_ = prepared.examined.assemble(0.0, begun.q, begun.v, [*u, *begun.switch_states], p)
    return M, F, G


def _massless(prepared: Prepared) -> list[str]:
    """What has no mass of its own where it begins."""
    if prepared.formulation != "multipliers":
        return []
    M, *_ = _masses(prepared)
    scale = np.sqrt(np.maximum(np.diag(M), 0.0))
    speeds = prepared.examined.speeds
    bare = [name for name, size in zip(speeds, scale, strict=True) if not size > 0]
    if not bare and np.linalg.eigvalsh(M / np.outer(scale, scale))[0] <= SINGULAR:
        bare = list(speeds)
    return [
        f"--dae: M is singular ({', '.join(bare)}), and M^-1 (F + G^T lambda) does not exist: give every "
        "coordinate a mass of its own"
    ] * bool(bare)


def multiplier_sizes(prepared: Prepared) -> dict[str, float]:
    """What each multiplier is like: it holds back what forces at the start, or the motion in its own time,
    would accelerate,  G a / G M^-1 G^T."""
    begun = prepared.structure.start
    M, F, G = _masses(prepared)
    pulled = np.abs(np.linalg.solve(M, F))
    moved = np.asarray(begun.span) * begun.rate**2
    gives = np.einsum("ki,ki->k", G, np.linalg.solve(M, G.T).T)
    sizes = np.maximum(np.abs(G) @ pulled, np.abs(G) @ moved) / np.where(gives > 0, gives, np.inf)
    rows = [names.name(names.MULTIPLIER, row.name) for row in prepared.system.rows]
    return dict(zip(rows, sizes.tolist(), strict=True))


def manifest(prepared: Prepared) -> bytes:
    """The bytes of MANIFEST, of what as_built() has made with `dae`."""
    table = prepared.table
    root = Element("fmiDAEManifest", HEAD)
    places = table.position
    SubElement(root, "EnableDAEParameter", {"valueReference": str(places[names.DAE])})
    listed = SubElement(root, "AlgebraicVariables")
    for row in prepared.system.rows:
        name = names.name(names.MULTIPLIER, row.name)
        SubElement(listed, "AlgebraicVariable", {"valueReference": str(places[name])})
    _structure(root, table, _known_with_multipliers(prepared.coded, table))
    return as_text(root)


def _structure(
    root: Element, table: VariableTable, known: Mapping[str, tuple[str, ...] | None]
) -> None:
    """That of modelDescription.xml where the multipliers are known, with the residuals."""
    parent, found, places = SubElement(root, "ModelStructure"), structure_of(table), table.position
    told = found.entries > 0  # of large mechanisms they are left out

    def put(kind: str, u: Unknown) -> None:
        reference = {"valueReference": str(places[u.name])}
        SubElement(parent, kind, reference | u.attributes(places))

    def of(name: str) -> Unknown:
        if told and (members := table[name].members):
            behind = (known[m] or () for m in members)
            return Unknown(name, list(dict.fromkeys(n for group in behind for n in group)))
        return Unknown(name, known.get(name) if told else None)

    for u in found.outputs:
        put("Output", of(u.name))
    for u in found.derivatives:
        put("ContinuousStateDerivative", of(u.name))
    for u in found.initial:
        put("InitialUnknown", u)
    for v in table.those(names.INDICATOR):
        put("EventIndicator", of(v.name))
    for v in table.those(names.EQUATION):
        put("Residual", of(v.name))
