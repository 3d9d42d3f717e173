"""The tables of model.c: index patterns, names, dimensions, flags, and the System that holds them."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Collection, Mapping, Sequence
from textwrap import wrap
from typing import Any

from ...mechanics.equations import EquationsOfMotion
from ...model.model import Nonholonomic
from ...numeric.system import CONTACT
from ..columns import groups
from ..parts import Function, Parts
from . import elimination
from . import solve as csolve

TRANSPOSED = {  # what is taken along a direction at once
    "motion": ("tangent", "kinematics_tangent"),
    "unwrapped": ("unwrapped_tangent",),
    "outputs": ("outputs_tangent",),
    "embed": ("embed_tangent",),
}


class Tables:
    """Of one system."""

    def __init__(self, parts: Parts) -> None:
        self.parts, self.eom, self.prefix = parts, parts.eom, parts.prefix
        self.mass, self.entries = parts.mass, parts.jacobian

    def of_what_is_read(self, functions: Collection[str]) -> str:
        """A System of coordinates that are only read: names, and the energies if they are read."""
        names, fields = self._layout()
        own, more = self._outputs(functions)
        fields |= {name: f"{self.prefix}{name}" for name in sorted(functions)} | more
        lines = "".join(f"    .{name} = {value},\n" for name, value in fields.items())
        return f"{names}{own}static const System {self.prefix}equations = {{\n{lines}}};\n"

    def text(self, functions: Collection[str]) -> str:
        """The tables, the elimination's plan, and the System with these functions."""
        parts, eom = self.parts, self.eom
        start = [bisect_left(self.entries, (k,)) for k in range(eom.m + 1)]
        contacts = [k for k, row in enumerate(parts.rows) if row.kind == CONTACT]
        prescribed, estimated = parts.prescribed, parts.estimated
        names, layout = self._layout()
        sizes, measures = self._sizes()
        tables = [
            names,
            self._array("const Row", "rows", self._rows()),
            self._integers("contact", contacts),
            self._integers("mass_row", [i for i, _ in self.mass]),
            self._integers("mass_column", [j for _, j in self.mass]),
            self._integers("entry_row", [k for k, _ in self.entries]),
            self._integers("entry_column", [j for _, j in self.entries]),
            self._integers("row_start", start),
            self._integers("prescribed", prescribed),
            *([self._integers("estimated", estimated)] if estimated else []),
            sizes,
        ]
        frictions, normal_parts, normal_rows = self._frictions()
        if frictions:
            tables.append(self._array("const Friction", "frictions", frictions))
            tables.append(self._array("const NormalPart", "normal_part", normal_parts))
            tables.append(self._integers("normal_row", normal_rows))
        if parts.at_integers:
            tables.append(self._integers("at_integers", [int(x) for x in parts.at_integers]))
        p = self.prefix
        plan = elimination.plan(eom.nv, eom.m, self.mass, self.entries)
        tables.append("\n" + plan.c_text(f"{p}plan") + "\n")
        solve = None
        if parts.formulation != "nullspace":
            solve = csolve.solve_source(f"{p}solve", eom.nv, self.entries, plan)
            tables.append(f"{solve}\n" if solve else "")
        quick = solve is not None and not eom.u
        if quick:
            counts = (len(self.mass), eom.nv, len(self.entries), eom.m, eom.m)
            tables.append(csolve.accelerate_source(p, counts) + "\n")
        own, more = self._outputs(functions)
        reach, ends = self._lookups(functions)
        kinematics, moving = self._kinematics(functions)
        begins, joints = self._joints()
        tables += [own, reach, kinematics, begins]
        more |= ends | moving | joints
        if "starts" in functions:
            started = list(parts.formulas)
            tables.append(self._integers("started", started))
            more |= {
                "started_count": len(started),
                "started": f"{p}started",
                "starts": f"{p}starts",
            }
        fields = {
            **layout,
            "m": eom.m,
            "contacts": len(contacts),
            "inputs": len(eom.u),
            "switches": len(parts.at_integers),
            "at_integers": f"{p}at_integers" if parts.at_integers else "NULL",
            "parameters": len(eom.p),
            "masses": len(self.mass),
            "entries": len(self.entries),
            **{
                name: p + name
                for name in (
                    *("rows", "contact", "mass_row", "mass_column"),
                    *("entry_row", "entry_column", "row_start"),
                )
            },
            "prescribed_count": len(prescribed),
            "prescribed": f"{p}prescribed",
            **(
                {"estimated_count": len(estimated), "estimated": f"{p}estimated"}
                if estimated
                else {}
            ),
            **measures,
            "formulation": parts.formulation.upper(),
            "separable": int(not entanglements(eom, parts.formulation)),
            "plan": f"&{p}plan",
            "solve": f"{p}solve" if solve else "NULL",
            "accelerate": f"{p}accelerate" if quick else "NULL",
            **{
                name: p + name if name in functions else "NULL"
                for name in (
                    *("dynamics", "residual", "surfaces", "bounds"),
                    *("energies", "restitution", "tangent"),
                )
            },
            "embed": "embed" if p else "NULL",
            "embed_tangent": "embed_tangent" if p and "tangent" in functions else "NULL",
            "full": "&equations" if p else "NULL",
            **{name: name for name in ("outputs", "outputs_tangent") if name in functions},
            **more,
        }
        if frictions:
            fields |= {
                "frictions": len(frictions),
                "normal_parts": len(normal_parts),
                "normal_rows": len(normal_rows),
                "friction": f"{p}frictions",
                "normal_part": f"{p}normal_part",
                "normal_row": f"{p}normal_row",
                "coulomb": f"{p}coulomb",
            }
            if "coulomb_tangent" in functions:
                fields["coulomb_tangent"] = f"{p}coulomb_tangent"
        lines = "".join(f"    .{name} = {value},\n" for name, value in fields.items())
        return "".join(tables) + f"static const System {p}equations = {{\n{lines}}};\n"

    def adjoints(self, tangents: Mapping[str, Function]) -> str:
        """The Adjoint of these: the groups of their columns."""
        p, text, fields = self.prefix, "\n", {"full": "&adjoints" if self.prefix else "NULL"}
        for field, names in TRANSPOSED.items():
            if found := groups([tangents[name] for name in names if name in tangents]):
                text += self._integers(f"{field}_groups", found)
                fields[field] = f"{p}{field}_groups"
        lines = "".join(f"    .{name} = {value},\n" for name, value in fields.items())
        return f"{text}static const Adjoint {p}adjoints = {{\n{lines}}};\n"

    def _outputs(self, functions: Collection[str]) -> tuple[str, dict[str, Any]]:
        """Tables of the model's own outputs, and the System's fields that hold them."""
        if "outputs" not in functions:
            return "", {}
        outputs = self.eom.outputs
        text = self._array("const char *const", "output_names", [f'"{o.name}"' for o in outputs])
        text += self._integers("guarded", [int(o.otherwise is not None) for o in outputs])
        fields: dict[str, Any] = {"output_count": len(outputs)}
        fields |= {name: name for name in ("output_names", "guarded")}
        unique = [k for k, o in enumerate(outputs) if o.unique]
        if unique:
            text += self._integers("unique_output", unique)
            fields |= {"unique_count": len(unique), "unique_output": "unique_output"}
        return text, fields

    def _joints(self) -> tuple[str, dict[str, Any]]:
        """The joint coordinates by which a start may be given, and the System's fields for them."""
        joints = self.eom.joint_coordinates
        if not joints or self.prefix or self.parts.reduction is not None:
            return "", {}
        items = [f'{{"{c.name}", {", ".join(str(int(x)) for x in c[1:])}}}' for c in joints]
        text = self._array("const JointCoordinate", "joints", items)
        return text, {"joint_count": len(joints), "joint": "joints"}

    def _lookups(self, functions: Collection[str]) -> tuple[str, dict[str, Any]]:
        """The names and ends of the tables that are looked up, and the System's fields for them."""
        if "lookups" not in functions:
            return "", {}
        tables, p = [s for s, _ in self.eom.lookups], self.prefix
        text = self._array("const char *const", "lookup_names", [f'"{s.name}"' for s in tables])
        text += self._array("const double", "lookup_first", [repr(s.x[0]) for s in tables])
        text += self._array("const double", "lookup_last", [repr(s.x[-1]) for s in tables])
        names = ("lookup_names", "lookup_first", "lookup_last", "lookups")
        return text, {"lookup_count": len(tables), **{name: p + name for name in names}}

    def _kinematics(self, functions: Collection[str]) -> tuple[str, dict[str, Any]]:
        """The pattern of B, the unit quaternions and unwrapped angles, and the System's fields for them."""
        if "kinematics" not in functions:
            return "", {}
        rates, four, p = self.parts.rates, self.eom.quaternions, self.prefix
        text = self._integers("rate_row", [j for j, _ in rates])
        text += self._integers("rate_column", [i for _, i in rates])
        q = {str(s) for s in self.eom.q}
        text += self._integers("own_speed", [int(s not in q) for s in self.eom.directions])
        fields: dict[str, Any] = {"rates": len(rates), "quaternions": len(four)}
        fields |= {
            name: p + name for name in ("rate_row", "rate_column", "own_speed", "kinematics")
        }
        if four:
            text += self._integers("quaternion", [j for places in four for j in places])
            fields["quaternion"] = f"{p}quaternion"
        if self.eom.unwrapped:
            text += self._integers("unwrapped", [*self.eom.unwrapped])
            fields |= {name: p + name for name in ("unwrapped", "unwrapped_angles")}
            fields["unwrapped_count"] = len(self.eom.unwrapped)
        for name in ("kinematics_tangent", "unwrapped_tangent"):
            if name in functions:
                fields[name] = p + name
        return text, fields

    def _layout(self) -> tuple[str, dict[str, Any]]:
        """How many coordinates and speeds there are, and their names."""
        names = [[f'"{s}"' for s in self.eom.q], [f'"{s}"' for s in self.eom.directions]]
        text, fields = self._pair("const char *const", ("coordinates", "speeds"), names)
        return text, {"nq": self.eom.nq, "nv": self.eom.nv, **fields}

    def _sizes(self) -> tuple[str, dict[str, Any]]:
        """The dimensions of coordinates, speeds and parameters, and the largest of them that are numbers."""
        of, p = self.parts.dimensions, self.prefix
        numbers = [[str(k) for k in group] for group in (of.coordinates, of.speeds)]
        text, fields = self._pair("const int", ("dimension", "speed_dimension"), numbers)
        text += self._integers("extent_dimension", of.parameters)
        fields |= {"extent_dimension": f"{p}extent_dimension", "angles": of.angles}
        folded, _ = self.parts.folded
        if not any(folded):
            return text, fields | {"folded": "NULL"}
        text += self._array("const double", "folded", [*map(repr, folded)])
        return text, fields | {"folded": f"{p}folded"}

    def _pair(
        self, kind: str, names: tuple[str, str], items: Sequence[Sequence[str]]
    ) -> tuple[str, dict[str, Any]]:
        """A table for coordinates and one for speeds; one for both where they are alike."""
        first, second = names
        text = self._array(kind, first, items[0])
        if items[0] == items[1]:
            return text, dict.fromkeys(names, self.prefix + first)
        text += self._array(kind, second, items[1])
        return text, {name: self.prefix + name for name in names}

    def _array(self, kind: str, name: str, items: Sequence[str]) -> str:
        head = f"static {kind} {self.prefix}{name}[] = {{"
        body = ", ".join(items)
        if len(head) + len(body) + 2 <= 100:
            return f"{head}{body}}};\n"
        lines = wrap(body, 96, break_long_words=False, break_on_hyphens=False)
        return head + "\n" + "".join(f"    {line}\n" for line in lines) + "};\n"

    def _integers(self, name: str, values: Sequence[int]) -> str:
        return self._array("const int", name, [str(k) for k in values] or ["0"])

    def _rows(self) -> list[str]:
        items = []
        for row in self.parts.rows:
            gate = -1 if row.while_closed is None else row.while_closed
            owner = 0 if row.friction is None else row.friction + 1
            items.append(f'{{"{row.name}", {row.kind.upper()}, {gate}, {owner}}}')
        return items or ['{"", HOLONOMIC, -1, 0}']

    def _frictions(self) -> tuple[list[str], list[str], list[int]]:
        """Friction and NormalPart of system.h, and the rows whose multipliers make up the normal forces."""
        items: list[str] = []
        parts: list[str] = []
        normal_rows: list[int] = []
        for law in self.parts.frictions:
            rows = ", ".join(map(str, law.rows))
            count = sum(map(len, law.norms))
            items.append(
                f'{{"{law.name}", {len(law.rows)}, {{{rows}}}, {len(parts)}, {count}, '
                f"{len(normal_rows)}, {len(law.normal)}, {int(law.gated)}}}"
            )
            for norm in law.norms:
                for i, of in enumerate(norm):
                    parts.append(f"{{{len(normal_rows)}, {len(of)}, {int(i == 0)}}}")
                    normal_rows += of
        return items, parts, normal_rows


def entanglements(eom: EquationsOfMotion, formulation: str) -> list[str]:
    """Why the method rattle cannot step these equations; nothing if it can.

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
