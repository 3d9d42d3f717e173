"""Equations of motion -> model.c: their numeric form (parts.py) as `const System`, see
runtime/base/system.h.  Equations and patterns only; no solver text.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import accumulate
from textwrap import wrap
from typing import Any

import sympy as sp

from ...mechanics.equations import EquationsOfMotion
from ...mechanics.formulations import Form
from ...mechanics.jumps import with_switch_states
from ...model.elements import TIME, Expr
from ...model.model import Nonholonomic
from ...numeric.system import CONTACT
from ..parts import Function, Parts, parts_of
from . import bounds
from .function import FILL, FUNCTIONS, function
from .printer import HELPERS, identifiers, table_name, table_text
from .sparsity import accelerate_source, blocks, groups, joint_rates, solve_source
from .sparsity import plan as plan_of


class Tables:
    """Of one system, whose functions have these names: tables that are written, and the fields of its System
    that hold them.  A field that is not there is 0 or NULL.  `led`: nothing may be left to integrate."""

    def __init__(self, parts: Parts, functions: Collection[str] = (), led: bool = False) -> None:
        self.parts, self.eom, self.prefix, self.led = parts, parts.eom, parts.prefix, led
        self.mass, self.entries = parts.mass, parts.jacobian
        self.written = ""
        self.fields: dict[str, Any] = {f: f"{self.prefix}{f}" for f in sorted(functions)}

    def of_what_is_read(self) -> str:
        """A System of coordinates that are only read: names, and the energies if they are read."""
        self._layout()
        self._outputs()
        return self._system()

    def text(self) -> str:
        """The tables, the elimination's plan, and the System."""
        self._layout()
        self._sizes()
        self._rows()
        self._frictions()
        self._kinematics()
        self._starts()
        self._lookups()
        self._outputs()
        self._solution()
        if self.prefix:
            self.fields |= {"embed": "embed", "full": "&equations"}
            if "tangent" in self.fields:
                self.fields["embed_tangent"] = "embed_tangent"
        return self._system()

    def _system(self) -> str:
        lines = "".join(f"    .{name} = {value},\n" for name, value in self.fields.items())
        return f"{self.written}static const System {self.prefix}equations = {{\n{lines}}};\n"

    def groups(self) -> str:
        """COLUMN_GROUPS of the system that is stepped."""
        found = groups(self.parts)
        text = self._integers("groups", found) if found else ""
        place = f"{self.prefix}groups" if found else "NULL"
        return f"{text}SHARED_VALUE const int *const COLUMN_GROUPS = {place};\n"

    def _layout(self) -> None:
        """How many coordinates and speeds there are, and their names."""
        self.fields |= {"nq": self.eom.nq, "nv": self.eom.nv}
        self._pair(
            "const char *const",
            coordinates=_quoted(self.eom.q),
            speeds=_quoted(self.eom.directions),
        )

    def _sizes(self) -> None:
        """The dimensions of coordinates and speeds, and what in its rows tells how large a coordinate is."""
        of = self.parts.dimensions
        self.fields |= {"parameters": len(self.eom.p), "angles": of.angles}
        self._pair("const int", dimension=of.coordinates, speed_dimension=of.speeds)
        extents, folded = self.parts.extents
        self._hold("const int", extent=[i for own in extents for i in own])
        starts = [0, *accumulate(map(len, extents))]
        self._hold("const int", extent_start=starts)
        self._hold("const double", folded=folded if any(folded) else ())

    def _rows(self) -> None:
        """The constraints, where M and G are not zero, and what stands in u."""
        parts, m = self.parts, self.eom.m
        contacts = [k for k, row in enumerate(parts.rows) if row.kind == CONTACT]
        items = []
        for row in parts.rows:
            gate = -1 if row.while_closed is None else row.while_closed
            owner = 0 if row.friction is None else row.friction + 1
            items.append(f'{{"{row.name}", {row.kind.upper()}, {gate}, {owner}}}')
        self.fields |= {
            "m": m,
            "contacts": len(contacts),
            "inputs": len(self.eom.u),
            "switches": len(parts.at_integers),
            "masses": len(self.mass),
            "entries": len(self.entries),
            "prescribed_count": len(parts.prescribed),
            "estimated_count": len(parts.estimated),
        }
        self._hold("const Row", rows=items)
        self._hold(
            "const int",
            contact=contacts,
            mass_row=[i for i, _ in self.mass],
            mass_column=[j for _, j in self.mass],
            entry_row=[k for k, _ in self.entries],
            entry_column=[j for _, j in self.entries],
            row_start=[bisect_left(self.entries, (k,)) for k in range(m + 1)],
            prescribed=parts.prescribed,
            estimated=parts.estimated,
            at_integers=[int(x) for x in parts.at_integers],
        )

    def _frictions(self) -> None:
        """Friction and NormalPart of system.h, and the rows whose multipliers make up the normal forces."""
        laws: list[str] = []
        parts: list[str] = []
        rows: list[int] = []
        for law in self.parts.frictions:
            own, count = ", ".join(map(str, law.rows)), sum(map(len, law.norms))
            laws.append(
                f'{{"{law.name}", {len(law.rows)}, {{{own}}}, {len(parts)}, {count}, '
                f"{len(rows)}, {len(law.normal)}, {int(law.gated)}}}"
            )
            for norm in law.norms:
                for i, of in enumerate(norm):
                    parts.append(f"{{{len(rows)}, {len(of)}, {int(i == 0)}}}")
                    rows += of
        self._hold("const Friction", friction=laws)
        self._hold("const NormalPart", normal_part=parts)
        self._hold("const int", normal_row=rows)
        self.fields |= {
            "frictions": len(laws),
            "normal_parts": len(parts),
            "normal_rows": len(rows),
        }

    def _kinematics(self) -> None:
        """The pattern of B, the unit quaternions and unwrapped angles."""
        if "kinematics" not in self.fields:
            return
        eom, rates, four = self.eom, self.parts.rates, self.eom.quaternions
        q = {str(s) for s in eom.q}
        self._hold(
            "const int",
            rate_row=[j for j, _ in rates],
            rate_column=[i for _, i in rates],
            own_speed=[int(s not in q) for s in eom.directions],
            quaternion=[j for places in four for j in places],
            unwrapped=[*eom.unwrapped],
        )
        self.fields |= {
            "rates": len(rates),
            "quaternions": len(four),
            "unwrapped_count": len(eom.unwrapped),
        }

    def _starts(self) -> None:
        """Starts by formulas, sides of joints, and the joint coordinates by which a start may be given."""
        if "starts" in self.fields:
            self.fields["started_count"] = len(self.parts.formulas)
            self._hold("const int", started=[*self.parts.formulas])
        if "sides" in self.fields:
            self.fields["side_count"] = len(self.eom.sides)
            self._hold("const int", sided=[*self.eom.sides])
        joints = self.eom.joint_coordinates
        if joints and not self.prefix and self.parts.reduction is None:
            items: list[str] = []
            held: list[tuple[int, int]] = []
            for c, own in zip(joints, joint_rates(self.parts), strict=True):
                numbers = (*c[1:], len(held), len(held) + len(own))
                items.append(f'{{"{c.name}", {", ".join(str(int(x)) for x in numbers)}}}')
                held += own
            self.fields |= {
                "joint_count": len(items),
                "joint_rates": len(held),
                "joint_groups": 1 + max((group for _, group in held), default=-1),
            }
            self._hold("const JointCoordinate", joint=items)
            self._hold("const JointRate", joint_rate=[f"{{{i}, {group}}}" for i, group in held])

    def _lookups(self) -> None:
        """The names and ends of the tables that are looked up."""
        if "lookups" not in self.fields:
            return
        tables = [s for s, _ in self.eom.lookups]
        self.fields["lookup_count"] = len(tables)
        self._hold("const char *const", lookup_names=_quoted([s.name for s in tables]))
        self._hold(
            "const double",
            lookup_first=[s.x[0] for s in tables],
            lookup_last=[s.x[-1] for s in tables],
        )

    def _outputs(self) -> None:
        """The model's own outputs."""
        if "outputs" not in self.fields:
            return
        outputs = self.eom.outputs
        unique = [k for k, o in enumerate(outputs) if o.unique]
        self.fields |= {"output_count": len(outputs), "unique_count": len(unique)}
        self._hold("const char *const", output_names=_quoted([o.name for o in outputs]))
        self._hold(
            "const int",
            guarded=[int(o.otherwise is not None) for o in outputs],
            unique_output=unique,
        )

    def _solution(self) -> None:
        """How the accelerations and multipliers are solved for."""
        eom, parts, p = self.eom, self.parts, self.prefix
        plan = plan_of(eom.nv, eom.m, self.mass, self.entries)
        self.written += "\n" + plan.c_text(f"{p}plan") + "\n"
        self.fields |= {
            "formulation": parts.formulation.upper(),
            "separable": int(not entanglements(eom, parts.formulation)),
            "plan": f"&{p}plan",
        }
        if self.led and eom.m == eom.nv:
            self._square(blocks(eom.nv, self.entries))
        if parts.formulation == "nullspace":
            return
        solve = solve_source(f"{p}solve", eom.nv, self.entries, plan)
        if not solve:
            return
        self.written += f"{solve}\n"
        self.fields["solve"] = f"{p}solve"
        if not eom.u:
            counts = (len(self.mass), eom.nv, len(self.entries), eom.m, eom.m)
            self.written += accelerate_source(p, counts) + "\n"
            self.fields["accelerate"] = f"{p}accelerate"

    def _square(self, found: Sequence[tuple[Sequence[int], Sequence[int]]]) -> None:
        """The blocks by which square.c solves."""
        if not found:
            return
        members = [f".{of} = square_{of}" for of in ("layout", "factor", "solve", "sign")]
        tables = {
            "start": [*accumulate((len(rows) for rows, _ in found), initial=0)],
            "rows": [r for rows, _ in found for r in rows],
            "columns": [c for _, columns in found for c in columns],
        }
        for name, values in tables.items():
            self.written += self._integers(f"block_{name}", values)
            members.append(f".{name} = {self.prefix}block_{name}")
        members += [
            f".count = {len(found)}",
            f".small = {int(max(len(r) for r, _ in found) <= 12)}",
        ]
        lines = "".join(f"    {member},\n" for member in members)
        self.written += f"static const Square {self.prefix}blocks = {{\n{lines}}};\n"
        self.fields["square"] = f"&{self.prefix}blocks"

    def _pair(self, kind: str, **tables: Sequence[Any]) -> None:
        """A table for coordinates and one for speeds; one for both where they are alike."""
        (first, items), (second, others) = tables.items()
        self._hold(kind, **{first: items})
        if items == others:
            self.fields[second] = self.prefix + first
        else:
            self._hold(kind, **{second: others})

    def _hold(self, kind: str, **tables: Sequence[Any]) -> None:
        """Tables of the System; an empty one is not there."""
        for name, items in tables.items():
            if items:
                self.written += self._array(kind, name, [*map(str, items)])
                self.fields[name] = self.prefix + name

    def _array(self, kind: str, name: str, items: Sequence[str]) -> str:
        head = f"static {kind} {self.prefix}{name}[] = {{"
        body = ", ".join(items)
        if len(head) + len(body) + 2 <= 100:
            return f"{head}{body}}};\n"
        lines = wrap(body, 96, break_long_words=False, break_on_hyphens=False)
        return head + "\n" + "".join(f"    {line}\n" for line in lines) + "};\n"

    def _integers(self, name: str, values: Sequence[int]) -> str:
        return self._array("const int", name, [*map(str, values)])


def _quoted(items: Sequence[Any]) -> list[str]:
    return [f'"{s}"' for s in items]


def entanglements(eom: EquationsOfMotion, formulation: str) -> list[str]:
    """Why a method of separable equations cannot step these; nothing if it can.

    It needs M of parameters, forces without velocities, position constraints that no input moves, and
    the formulation 'multipliers'.
    """
    velocities, inputs = set(eom.v), set(eom.u)
    found = []
    if formulation != "multipliers":
        found.append(f"the formulation is {formulation!r}, expected 'multipliers'")
    if not eom.moves_plainly:
        found.append("speeds are other than the rates of coordinates")
    if not _constant_mass(eom):
        found.append("the mass matrix holds more than parameters")
    found += [f"the friction {law.name!r} jumps" for law in eom.frictions]
    moved = [
        q
        for q, e in zip(eom.directions, eom.F, strict=True)
        if not e.free_symbols.isdisjoint(velocities)
    ]
    if moved:
        found.append(f"the forces on {', '.join(moved)} hold velocities")
    found += [
        f"the constraint {c.name!r} is nonholonomic"
        for c in eom.constraints
        if isinstance(c, Nonholonomic)
    ]
    if any(not e.free_symbols.isdisjoint(inputs) for e in eom.G.todok().values()):
        found.append("an input stands in the constraint matrix")
    return found


def _constant_mass(eom: EquationsOfMotion) -> bool:
    parameters = set(eom.p)
    return all(e.free_symbols <= parameters for e in eom.M.todok().values())


HEAD = """/* model.c -- {name}{description}
 *
 *   M(q,t) vdot = F(q,v,t,u) + G^T lambda ,  G v = nu(q,t,u) ,  G vdot = gamma(q,v,t,u) ,  f(q,t) = 0
 *
 * lambda stands on the side of the forces: +G^T lambda is the generalized force of constraint.
 * Generated by lagfmu from the model; SI units.  der_x is the velocity of x, d_x its change along the
 * direction in which a tangent is taken.
 *
{index} */
#include <math.h>
#include <stddef.h>

#include "system.h"
#include "variables.h"
"""
POINTER = "\nSHARED_VALUE const System *const MODEL_SYSTEM = &{}equations;\n"


def model_source(
    form: Form,
    tangents: bool = True,
    by: frozenset[str] = frozenset(),
    grouped: bool = False,
    led: bool = False,
) -> str:
    """C text that defines MODEL_SYSTEM, the numeric form of the equations.

    `tangents`: with the derivatives that directional derivatives and radau need; `by`: parameters by which
    they are taken as well; `grouped`: with the groups of their columns, for FMI 3.0; `led`: nothing may be
    left to integrate.

    Raises DerivationError if a function or a number has no counterpart in C.
    """
    form, jumps = with_switch_states(form)
    given = form.equations
    symbols = _real([*given.q, *given.v, *given.u, *given.p, TIME])
    time = symbols.get(TIME, TIME)
    whole = parts_of(_in_reals(form), jumps.mapped(symbols), tangents, time, by)
    eom = whole[0].eom
    index = _index("coordinates", eom.q)
    if not eom.moves_plainly:
        index += _index("speeds", eom.v)
    index += _index("constraints", [c.name for c in eom.constraints])
    if len(whole) > 1:
        index += _index("coordinates that are stepped", whole[-1].eom.q)
    text = "\n".join(
        piece for parts in whole for piece in (*_embedding(parts), _system(parts, led))
    )
    text += POINTER.format(whole[-1].prefix)
    if grouped:
        text += Tables(whole[-1]).groups()
    helpers = [
        code for name, code in {**HELPERS, **FUNCTIONS, "fill": FILL}.items() if f"{name}(" in text
    ]
    helpers += [table_text(s) for s in eom.model.splines if f"&{table_name(s)}," in text]
    model = eom.model
    description = f": {model.description}" if model.description else ""
    head = HEAD.format(name=model.name, description=_comment(description), index=index)
    if ".square = &" in text:
        head += '#include "square.h"\n'
    if grouped:
        head += '#include "dependencies.h"\n'
    return "\n".join([head, *helpers, text])


def _comment(text: str) -> str:
    """Text that cannot end a comment or begin another one, on one line."""
    for bad, good in (("*/", "* /"), ("/*", "/ *"), ("??", "? ?")):
        text = text.replace(bad, good)
    return " ".join(text.split())


def _index(what: str, names: Sequence[Any]) -> str:
    items = ", ".join(f"{k} {name}" for k, name in enumerate(names)) or "none"
    lines = wrap(
        f"{what}: {items}",
        96,
        initial_indent=" * ",
        subsequent_indent=" *     ",
        break_long_words=False,
        break_on_hyphens=False,
    )
    return "\n".join(lines) + "\n"


def _real(symbols: Sequence[Expr]) -> dict[Expr, Expr]:
    return {s: sp.Symbol(str(s), real=True) for s in symbols if s.is_real is None}


def _in_reals(form: Form) -> Form:
    """The same with every symbol real, so that |x| and its like have real derivatives."""
    reduction = form.reduction
    if reduction is not None:
        reduced = _equations_in_reals(reduction.reduced)
        table = reduced.symbols
        phi, vel = (
            tuple(sp.sympify(e).xreplace(table) for e in group)
            for group in (reduction.phi, reduction.vel)
        )
        reduction = replace(reduction, phi=phi, vel=vel, reduced=reduced)
    return replace(form, equations=_equations_in_reals(form.equations), reduction=reduction)


def _equations_in_reals(eom: EquationsOfMotion) -> EquationsOfMotion:
    table = _real([*eom.q, *eom.v, *eom.u, *eom.p, TIME])

    def real(e: Expr) -> Expr:
        return e.xreplace(table)

    return replace(
        eom.mapped(real),
        q=tuple(map(real, eom.q)),
        v=tuple(map(real, eom.v)),
        u=tuple(map(real, eom.u)),
        p=tuple(map(real, eom.p)),
        symbols={s: real(e) for s, e in eom.symbols.items()} | table,
    )


def _names(parts: Parts) -> dict[Expr, str]:
    """The C names of the symbols of a state, and of their changes."""
    eom, change = parts.eom, parts.change
    moving = [*eom.q, *eom.v, *eom.u]
    varied = [*moving, *parts.varied]
    names = identifiers([*moving, *eom.p, *eom.switch_states, *(change[s] for s in varied)])
    return names | {parts.time: "t", change[parts.time]: "dt"}


def _reported(parts: Parts, names: Mapping[Expr, str]) -> dict[Expr, str]:
    """Besides, those of what is solved for."""
    flat = [s for group in parts.solved.values() for s in group]
    more = identifiers([*flat, *(parts.change[s] for s in flat)], list(names.values()))
    return {**names, **more}


def _embedding(parts: Parts) -> list[str]:
    return [_define(f, _names(parts)) for f in parts.embedding]


def _define(f: Function, names: Mapping[Expr, str], prefix: str = "") -> str:
    return function(prefix + f.name, f.doc, f.arguments, f.results, names)


def _system(parts: Parts, led: bool) -> str:
    """Functions, then tables."""
    names = _names(parts)
    own = [f for f in parts.functions if f.name.startswith("outputs")]
    texts = {f.name: _define(f, names, parts.prefix) for f in parts.functions if f not in own}
    changing = [] if parts.eom.bare else bounds.rates(parts.eom, parts.constraints, parts.jumps)
    if changing:
        texts["bounds"] = _bounds(parts, changing)
    texts |= {f.name: _define(f, _reported(parts, names)) for f in own}
    tables = Tables(parts, texts, led)
    last = tables.of_what_is_read() if parts.eom.bare else tables.text()
    return "\n".join([*texts.values(), last])


def _bounds(parts: Parts, changing: Sequence[Expr]) -> str:
    """Bounds on the rates of the indicators, in interval arithmetic."""
    eom = parts.eom
    groups = {"q": eom.q, "v": eom.v, "u": eom.u}
    places = {s: f"{a}[{j}]" for a, group in groups.items() for j, s in enumerate(group)}
    places |= {p: f"interval_of(p[{k}])" for k, p in enumerate(eom.p)}
    places[parts.time] = "t"
    lines, found = bounds.body(changing, places)
    text = [f"    const Interval {line};\n" for line in lines]
    text += [f"    rate[{k}] = {value};\n" for k, value in enumerate(found)]
    whole = "".join(text)
    silence = [a for a in "tqvup" if not re.search(rf"\b{a}\b", whole)]
    head = (
        "/* Bounds on how fast the indicators of events change: f of contacts, h of jumps. */\n"
        f"static void {parts.prefix}bounds(Interval t, const Interval *q, const Interval *v, "
        "const Interval *u,\n                   const double *p, Interval *rate) {\n"
    )
    return head + "".join(f"    (void){a};\n" for a in silence) + whole + "}\n"
