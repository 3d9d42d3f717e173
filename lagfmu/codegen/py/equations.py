"""Equations of motion -> the solver's numeric form, by way of generated Python source."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

import sympy as sp

from ...mechanics.equations import TIME, EquationsOfMotion, formulas_of
from ...mechanics.form import Form
from ...mechanics.jumps import NONE, Jumps, levelled
from ...model.elements import Expr
from ...model.model import Contact, Nonholonomic
from ...numeric.cubic import Cubic
from ...numeric.system import CONTACT, HOLONOMIC, NONHOLONOMIC, System
from .. import bounds
from .function import function, identifiers, table_name


def source(form: Form) -> str:
    """Python text that defines SYSTEM, the numeric form of the equations.

    It needs the names System, Row, Own, Friction, Lookups and Embedding of `lagfmu.numeric.system`, and Cubic
    where there are tables.
    """
    form, jumps = levelled(form)
    eom, reduction = form.equations, form.reduction
    if reduction is None:
        text = (
            _system(eom, "", form.formulation, jumps=jumps) + "\n\nSYSTEM = SYSTEM_OF_COORDINATES\n"
        )
        return _imported(_tables(eom, text) + text)
    parts = [_bare_system(eom) if eom.bare else _system(eom, "", "multipliers")]
    names = identifiers([*reduction.s, *reduction.sdot, *reduction.reduced.driven, *eom.p, TIME])
    names[TIME] = "t"
    parts.append(
        function(
            "embed",
            "q = phi(s, t) and v = J sdot + dphi/dt.",
            {"t": (), "s": reduction.s, "sdot": reduction.sdot, "u": eom.driven, "p": eom.p},
            {"q": reduction.phi, "v": reduction.vel},
            names,
        )
    )
    rows = tuple(reduction.rows)
    parts.append(
        _system(
            reduction.reduced,
            "reduced_",
            "minimal",
            rows,
            "Embedding(embed, SYSTEM_OF_COORDINATES)",
            jumps,
        )
    )
    text = "\n\n".join(parts) + "\n\nSYSTEM = SYSTEM_OF_REDUCED_COORDINATES\n"
    return _imported(_tables(eom, text) + text)


def _tables(eom: EquationsOfMotion, text: str) -> str:
    """The tables that the text looks up."""
    lines = []
    for s in eom.model.splines:
        name, table = table_name(s), s.table
        if f"{name}(" in text:
            rows = "".join(f"        {row!r},\n" for row in table.coefficients)
            lines.append(
                f"{name} = Cubic(\n    {table.knots!r},\n    (\n{rows}    ),\n"
                f"    {table.periodic!r},\n)\n\n\n"
            )
    return "".join(lines)


def _imported(text: str) -> str:
    """The text under an import of the functions of `math` that it calls."""
    called = sorted(
        name for name in set(re.findall(r"(?<!\.)\b([a-z]\w*)\(", text)) if hasattr(math, name)
    )
    return (f"from math import {', '.join(called)}\n\n\n" if called else "") + text


def compile_system(text: str) -> System:
    """Run generated source in memory and take its SYSTEM."""
    from ...numeric import interval
    from ...numeric import system as vocabulary

    scope: dict[str, Any] = {
        "interval": interval,
        "System": vocabulary.System,
        "Own": vocabulary.Own,
        "Lookups": vocabulary.Lookups,
        "Cubic": Cubic,
        "Row": vocabulary.Row,
        "Embedding": vocabulary.Embedding,
        "Friction": vocabulary.Friction,
    }
    exec(compile(text, "<lagfmu equations>", "exec"), scope)
    system: System = scope["SYSTEM"]
    return system


def lower(form: Form) -> System:
    """The numeric form, ready for the solver."""
    return compile_system(source(form))


def _system(
    eom: EquationsOfMotion,
    prefix: str,
    formulation: str,
    rows: Sequence[int] | None = None,
    embedding: str = "None",
    jumps: Jumps = NONE,
) -> str:
    names = identifiers([*eom.q, *eom.v, *eom.driven, *eom.p])
    names[TIME] = "t"
    lower_triangle = sorted((i, j) for i, j in eom.M.todok() if i >= j)
    jacobian = sorted(eom.G.todok())
    state = {"t": (), "q": eom.q, "v": eom.v, "u": eom.driven, "p": eom.p}
    still = {"t": (), "q": eom.q, "u": eom.driven, "p": eom.p}
    parts = [
        function(
            f"{prefix}dynamics",
            "M (lower triangle), F, G, nu, gamma of  M vdot = F + G^T lambda,  G vdot = gamma.",
            state,
            {
                "M": [eom.M[i, j] for i, j in lower_triangle],
                "F": eom.F,
                "G": [eom.G[k, j] for k, j in jacobian],
                "nu": eom.nu,
                "gamma": eom.gamma,
            },
            names,
        ),
        function(
            f"{prefix}residual",
            "f of each constraint f(q, t) = 0; 0 for a nonholonomic one.",
            still,
            {"f": [sp.S.Zero if f is None else f for f in eom.f]},
            names,
        ),
    ]
    restitution = [
        eom.plain(c.restitution) if isinstance(c, Contact) else sp.S.Zero
        for c in _constraints(eom, rows)
    ]
    rebounds = any(isinstance(c, Contact) for c in _constraints(eom, rows))
    if rebounds:
        text = "Newton's coefficient of restitution of each row; 0 for one that is no contact."
        arguments, results = {"p": eom.p}, {"e": restitution}
        parts.append(function(f"{prefix}restitution", text, arguments, results, names))
    if eom.frictions:
        parts.append(_coulomb(eom, state, names))
    energies = []
    if rows is None:  # the energies of the full system serve the reduced one too
        energies = _energies(eom, names)
    parts += energies
    if jumps.surfaces:
        text, found = "h of each jump: where it passes 0, or a whole number.", jumps.surfaces
        parts.append(function(f"{prefix}surfaces", text, still, {"h": [s.h for s in found]}, names))
    started = formulas_of(eom)
    if started:
        text = "Start values that are expressions of parameters."
        values = {"w": list(started.values())}
        parts.append(function(f"{prefix}starts", text, {"p": eom.p}, values, names))
    changing = bounds.rates(eom, _constraints(eom, rows), jumps)
    if changing:
        parts.append(_bounds(prefix, eom, changing))
    own = _outputs(eom) if rows is None else []
    parts += [text for _, text in own]
    looked_up = ""
    if eom.lookups:
        text = "Where tables are looked up."
        places = {"w": [x for _, x in eom.lookups]}
        parts.append(function(f"{prefix}lookups", text, state, places, names))
        reach = [(s.name, s.x[0], s.x[-1]) for s, _ in eom.lookups]
        looked_up = f"    lookups=Lookups({prefix}lookups, {tuple(reach)!r}),\n"
    label = f"SYSTEM_OF_{prefix.upper()}COORDINATES"
    parts.append(
        f"{label} = System(\n"
        f"    coordinates={_strings(eom.q)},\n"
        f"    rows={_rows(eom, rows)},\n"
        f"    mass={_pattern(lower_triangle)},\n"
        f"    jacobian={_pattern(jacobian)},\n"
        f"    dynamics={prefix}dynamics,\n"
        f"    residual={prefix}residual,\n"
        f"    energies={'energies' if energies else None},\n"
        f"    restitution={f'{prefix}restitution' if rebounds else None},\n"
        f"    prescribed={_prescribed(eom)!r},\n"
        f"{_estimated(eom)}"
        f"    like={_like(eom)!r},\n"
        f"    extent={_extent(eom)!r},\n"
        f"    folded={tuple(eom.folded(unit) for unit in _units(eom))!r},\n"
        f"    angles={_angles(eom)!r},\n"
        f"    embedding={embedding},\n"
        f"    formulation={formulation!r},\n"
        f"    parameters={_strings(eom.p)},\n"
        f"{_surfaces(prefix, jumps, len(eom.driven))}"
        + (f"    started={tuple(started)!r},\n    starts={prefix}starts,\n" if started else "")
        + (f"    bounds={prefix}bounds,\n" if changing else "")
        + (f"    frictions={_frictions(eom)},\n    coulomb=coulomb,\n" if eom.frictions else "")
        + f"{_listed(own)}{looked_up})\n"
    )
    return "\n\n".join(parts)


def _bounds(prefix: str, eom: EquationsOfMotion, changing: Sequence[Expr]) -> str:
    """Bounds on the rates of the indicators, in interval arithmetic."""
    groups = {"q": eom.q, "v": eom.v, "u": eom.u}
    places = {s: f"{a}[{j}]" for a, group in groups.items() for j, s in enumerate(group)}
    places |= {p: f"interval.of(p[{k}])" for k, p in enumerate(eom.p)}
    places[TIME] = "t"
    lines, values = bounds.body(changing, places, bounds.PYTHON)
    text = "".join(f"    {line}\n" for line in lines)
    return (
        f"def {prefix}bounds(t, q, v, u, p):\n"
        '    """How fast the indicators of events can change: f of contacts, h of jumps."""\n'
        f"{text}    return [{', '.join(values)}]\n"
    )


def _coulomb(eom: EquationsOfMotion, state: Any, names: dict[Expr, str]) -> str:
    """The function that gives each friction's coefficients and normal force."""
    laws = eom.frictions
    return function(
        "coulomb",
        "Coefficients (static, kinetic) of each friction; N = load + sum of normal * lambda [N].",
        state,
        {
            "static": [law.static for law in laws],
            "kinetic": [law.kinetic for law in laws],
            "load": [law.load for law in laws],
            "normal": [c for law in laws for c in law.normal.values()],
        },
        names,
    )


def _frictions(eom: EquationsOfMotion) -> str:
    """Name, rows that are limited, rows whose multipliers press, and is the normal force a contact's."""
    position = {c.name: k for k, c in enumerate(eom.constraints)}
    items = []
    for law in eom.frictions:
        rows = tuple(position[name] for name in law.of)
        normal = tuple(position[name] for name in law.normal)
        gated = law.load == 0 and all(isinstance(eom.constraints[k], Contact) for k in normal)
        items.append(f"Friction({law.name!r}, {rows!r}, {normal!r}, {gated and bool(normal)!r}),")
    return f"({' '.join(items)})"


def _surfaces(prefix: str, jumps: Jumps, count: int) -> str:
    if not jumps.surfaces:
        return ""
    floors = tuple(s.floor for s in jumps.surfaces)
    return f"    surfaces={prefix}surfaces,\n    floors={floors!r},\n    driven={count},\n"


def _bare_system(eom: EquationsOfMotion) -> str:
    """Coordinates that are only read, and the energies of them if these are."""
    names = identifiers([*eom.q, *eom.v, *eom.driven, *eom.p])
    names[TIME] = "t"
    energies, own = _energies(eom, names), _outputs(eom)
    system = (
        "SYSTEM_OF_COORDINATES = System(\n"
        f"    coordinates={_strings(eom.q)},\n"
        "    rows=(),\n"
        "    mass=((), ()),\n"
        "    jacobian=((), ()),\n"
        "    dynamics=None,\n"
        "    residual=None,\n"
        f"    energies={'energies' if energies else None},\n"
        "    restitution=None,\n"
        f"    parameters={_strings(eom.p)},\n"
        f"{_listed(own)})\n"
    )
    return "\n\n".join([*energies, *(text for _, text in own), system])


def _energies(eom: EquationsOfMotion, names: dict[Expr, str]) -> list[str]:
    """The function that gives the energies which can be read; nothing if none can."""
    group = {"kinetic": eom.kinetic, "potential": eom.potential}
    found = {name: e for name, e in group.items() if e is not None}
    if not found:
        return []
    state = {"t": (), "q": eom.q, "v": eom.v, "u": eom.driven, "p": eom.p}
    text = f"{' and '.join(found).capitalize()} energy [J]."
    values = {"energy": [found.get(name, sp.S.Zero) for name in group]}
    return [function("energies", text, state, values, names)]


def _outputs(eom: EquationsOfMotion) -> list[tuple[str, str]]:
    """The model's own outputs: what makes each in the System, and the text of its functions."""
    groups = (eom.q, eom.v, eom.vdot, eom.driven, eom.p, eom.lam, eom.Q)
    names = identifiers([s for group in groups for s in group])
    names[TIME] = "t"
    arguments = {
        "t": (),
        **dict(zip(("q", "v", "vdot", "u", "p", "lam", "Q"), groups, strict=True)),
    }
    found = []
    for k, o in enumerate(eom.outputs):
        parts = {f"output_{k}": (f"{o.name} [{o.unit}].", o.expression)}
        if o.otherwise is not None:
            parts[f"otherwise_{k}"] = (f"{o.name} where it has no value.", o.otherwise)
        text = "\n\n".join(
            function(name, doc, arguments, {"w": [e]}, names) for name, (doc, e) in parts.items()
        )
        found.append((f"Own({o.name!r}, {', '.join(parts)})", text))
    return found


def _listed(own: Sequence[tuple[str, str]]) -> str:
    lines = "".join(f"        {made},\n" for made, _ in own)
    return f"    outputs=(\n{lines}    ),\n" if own else ""


def _constraints(eom: EquationsOfMotion, rows: Sequence[int] | None) -> list[Any]:
    chosen = range(len(eom.constraints)) if rows is None else rows
    return [eom.constraints[k] for k in chosen]


def _rows(eom: EquationsOfMotion, rows: Sequence[int] | None) -> str:
    constraints = _constraints(eom, rows)
    position = {c.name: k for k, c in enumerate(constraints)}
    owner = {name: i for i, law in enumerate(eom.frictions) for name in law.of}
    items = []
    for c in constraints:
        kind = HOLONOMIC
        if isinstance(c, Contact):
            kind = CONTACT
        elif isinstance(c, Nonholonomic):
            kind = NONHOLONOMIC
        closed = getattr(c, "while_closed", None)
        tail = "" if closed is None else f", {position[closed]}"
        if c.name in owner:
            tail = f", {None if closed is None else position[closed]}, {owner[c.name]}"
        items.append(f"Row({c.name!r}, {kind!r}{tail}),")
    return f"({' '.join(items)})"


def _strings(symbols: Sequence[Expr]) -> str:
    return repr(tuple(str(s) for s in symbols))


def _pattern(indices: Sequence[tuple[int, int]]) -> str:
    return repr((tuple(i for i, _ in indices), tuple(j for _, j in indices)))


def _estimated(eom: EquationsOfMotion) -> str:
    found = tuple(k for k, s in enumerate(eom.u) if s in eom.estimated)
    return f"    estimated={found!r},\n" if found else ""


def _prescribed(eom: EquationsOfMotion) -> tuple[int, ...]:
    """Where in u a prescribed motion begins: what has a rate that has a rate."""
    return tuple(k for k, s in enumerate(eom.u) if eom.rates.get(s) in eom.rates)


def _units(eom: EquationsOfMotion) -> list[Any]:
    return [eom.units[str(q)] for q in eom.q]


def _angles(eom: EquationsOfMotion) -> tuple[int, ...]:
    """The coordinates without dimension."""
    return tuple(j for j, unit in enumerate(_units(eom)) if unit.dimensionless)


def _like(eom: EquationsOfMotion) -> tuple[tuple[int, ...], ...]:
    """For each coordinate, the coordinates of the same dimension."""
    units = _units(eom)
    return tuple(
        tuple(i for i, other in enumerate(units) if other.same_dimension(unit)) for unit in units
    )


def _extent(eom: EquationsOfMotion) -> tuple[tuple[int, ...], ...]:
    """For each coordinate, the parameters of the same dimension (for an angle: none)."""

    def same(parameter: Expr, unit: Any) -> bool:
        return not unit.dimensionless and bool(eom.units[str(parameter)].same_dimension(unit))

    return tuple(tuple(i for i, p in enumerate(eom.p) if same(p, unit)) for unit in _units(eom))
