"""What a scene leaves out of an FMU, and what that saves: operations, and bytes of generated code."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import sympy as sp

from ..codegen.c.equations import model_source
from ..codegen.c.interface import needs_tangents
from ..codegen.c.sparsity import plan
from ..codegen.py.equations import source
from ..mechanics.equations import EquationsOfMotion
from ..mechanics.prune import idle as idle_parameters
from ..model.elements import Expr
from ..model.units import Unit
from ..prepare.prepare import prepare
from ..prepare.steps import Prepared

PYTHON, NATIVE = "bytes of generated Python", "bytes of generated C"
OPERATIONS = "operations of the right-hand side"
Cost = dict[str, int]  # what an FMU holds and does


@dataclass(frozen=True)
class Savings:
    """The model's full FMU against the scene's; `left_out`: what is not there, in words."""

    full: Cost
    scene: Cost
    left_out: tuple[str, ...]

    def rows(self) -> list[tuple[str, int, int]]:
        """(what, full FMU, this scene)."""
        return [(what, self.full[what], self.scene[what]) for what in self.full]


def savings(prepared: Prepared) -> Savings | None:
    """None for a scene that asks for everything."""
    whole = prepared.asked.whole
    if whole == prepared.asked:
        return None
    full = prepare(prepared.model, whole, prepared.derived)
    return Savings(cost(full), cost(prepared), tuple(_left_out(full, prepared)))


def cost(prepared: Prepared) -> Cost:
    """Counted on the equations that code is printed from."""
    form, stepped = prepared.coded, prepared.coded.stepped
    tangents = needs_tangents(prepared.scene, prepared.system)
    return {
        "outputs": len(prepared.table.outputs),
        "adjustable parameters": len(form.equations.p),
        "inputs": len(form.equations.u),
        "coordinates that are integrated": stepped.nq,
        "constraints that are solved with them": stepped.m,
        "contacts that are watched": len(prepared.system.contacts),
        "methods to choose from": len(prepared.scene.selectable),
        OPERATIONS: operations(stepped),
        PYTHON: len(source(form).encode()),
        NATIVE: len(model_source(form, tangents).encode()),
    }


def operations(eom: EquationsOfMotion) -> int:
    """Of one evaluation of the right-hand side: of the equations, common subexpressions counted once, and the
    multiplications and divisions of the solution for accelerations and lambda."""
    mass, jacobian = eom.M.todok(), eom.G.todok()
    lower = sorted((i, j) for i, j in mass if i >= j)
    entries = sorted(jacobian)
    flat = [mass[ij] for ij in lower] + [jacobian[kj] for kj in entries]
    flat += [*eom.F, *eom.nu, *eom.gamma]
    common, rest = sp.cse(flat, order="none", list=True)
    equations = sum(int(sp.count_ops(e)) for e in (*(e for _, e in common), *rest))
    way = plan(eom.nv, eom.m, lower, entries)
    solve = 0
    for part in (way.mass, way.schur):
        rows = [set(part.row(p)) for p in range(part.size)]
        factor = sum(len(rows[q] & row) for row in rows for q in row)
        solve += factor + 4 * sum(map(len, rows)) + 2 * part.size  # L D, D^-1, and both sweeps
    if way.diagonal:
        solve += 2 * eom.nv  # M^-1 and M^-1 b
    return equations + solve + 4 * len(way.w_value) + len(way.pair_a)


def _left_out(full: Prepared, prepared: Prepared) -> Iterable[str]:
    scene, eom = prepared.scene, prepared.coded.equations
    derived = full.equations
    if prepared.formulation != full.formulation:
        chosen = "dependent coordinates are eliminated"
        solved = "" if eom.G.todok() else ": no multiplier is solved for"
        yield f"formulation {prepared.formulation}, {chosen}{solved}"
    gone = [str(q) for q in derived.q if q not in prepared.equations.q]
    if gone:
        yield f"coordinates on which no output depends: {', '.join(gone)}"
    kept = {c.name for c in prepared.equations.constraints}
    lost = [c.name for c in derived.constraints if c.name not in kept]
    if lost:
        yield f"constraints on which no output depends: {', '.join(lost)}"
    if prepared.held:
        yield f"contacts that cannot open, and no event code for them: {', '.join(prepared.held)}"
    elif full.system.contacts and not prepared.system.contacts:
        yield "event code: no contact is left"
    if full.system.is_constrained and not prepared.system.is_constrained:
        yield "the solution for constraints that depend on each other: none is solved with"
    named = {str(p): eom.units[str(p)] for p in derived.p}
    for title, names in _numbers(prepared):
        if names:
            values = ", ".join(_value(n, prepared.numbers[n], named[n]) for n in names)
            yield f"{title}: {values}"
    still = [str(u) for u in derived.u if str(u) in prepared.numbers]
    if still:
        values = ", ".join(_value(n, prepared.numbers[n], eom.units[n]) for n in still)
        yield f"inputs that keep their start values: {values}"
    dropped = [m for m in full.scene.selectable if m not in scene.selectable]
    if dropped:
        yield f"methods: {', '.join(dropped)}"
    if not needs_tangents(scene, full.system):
        yield "derivatives of the equations, and with them directional derivatives"


def _numbers(prepared: Prepared) -> list[tuple[str, list[str]]]:
    """Parameters that are numbers: those that the scene fixes, and those that nothing depends on."""
    idle = {str(p) for p in idle_parameters(prepared.form)}
    names = [str(p) for p in prepared.equations.p if str(p) in prepared.numbers]
    return [
        ("parameters that are numbers in the code", [n for n in names if n not in idle]),
        ("parameters on which no output depends", [n for n in names if n in idle]),
    ]


def _value(name: str, number: Expr, unit: Unit) -> str:
    return f"{name} = {float(number):g} {'' if unit.name == '1' else unit.name}".rstrip()
