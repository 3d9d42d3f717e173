"""Equations of motion -> their numeric form (parts.py) as a System, by way of generated Python source."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from ...mechanics.equations import EquationsOfMotion
from ...mechanics.formulations import Form
from ...mechanics.jumps import with_switch_states
from ...model.elements import TIME, Expr
from ...numeric.functions import OPERATIONS, Cubic
from ...numeric.system import System
from ..parts import Function, Parts, parts_of
from .function import function, identifiers, in_loops, table_name

OBSERVED = ("t", "q", "v", "vdot", "u", "p", "lam", "Q")  # what outputs are functions of


def source(form: Form) -> str:
    """Python text that defines SYSTEM, the numeric form of the equations.

    It needs the names System, Row, Own, Friction, Lookups and Embedding of `lagfmu.numeric.system`, and Cubic
    where there are tables, and the functions of numeric/functions.py where there are bodies in space.
    """
    form, jumps = with_switch_states(form)
    whole = parts_of(form, jumps)
    pieces = [piece for parts in whole for piece in (*_embedding(parts), *_system(parts))]
    text = "\n\n".join([*pieces, f"SYSTEM = {_label(whole[-1])}\n"])
    return _imported(_tables(form.equations, text) + text)


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
    from ...numeric import system as vocabulary

    scope: dict[str, Any] = {
        "System": vocabulary.System,
        "Own": vocabulary.Own,
        "Lookups": vocabulary.Lookups,
        "Cubic": Cubic,
        "Row": vocabulary.Row,
        "Embedding": vocabulary.Embedding,
        "Friction": vocabulary.Friction,
        **OPERATIONS,
    }
    exec(compile(text, "<lagfmu equations>", "exec"), scope)
    system: System = scope["SYSTEM"]
    return system


def lower(form: Form) -> System:
    """The numeric form, ready for the solver."""
    return compile_system(source(form))


def _label(parts: Parts) -> str:
    return f"SYSTEM_OF_{parts.prefix.upper()}COORDINATES"


def _names(*groups: Sequence[Expr]) -> dict[Expr, str]:
    return {**identifiers([s for group in groups for s in group]), TIME: "t"}


def _define(f: Function, names: Mapping[Expr, str], prefix: str = "") -> str:
    results = {label: [x.expression for x in group] for label, group in f.results.items()}
    return in_loops(f, names, prefix) or function(
        prefix + f.name, f.doc, f.arguments, results, names
    )


def _embedding(parts: Parts) -> list[str]:
    eom = parts.eom
    return [_define(f, _names(eom.q, eom.v, eom.driven, eom.p)) for f in parts.embedding]


def _functions(parts: Parts) -> dict[str, str]:
    """The text of each function but those of the model's outputs; the energies of the full system serve the
    reduced one too."""
    eom, found = parts.eom, {}
    names = _names(eom.q, eom.v, eom.driven, eom.p)
    for f in parts.functions:
        if f.name != "outputs" and not (f.name == "energies" and parts.prefix):
            found[f.name] = _define(f, names, parts.prefix)
    return found


def _system(parts: Parts) -> list[str]:
    """The functions, then the System that holds them."""
    eom, p, own, texts = parts.eom, parts.prefix, _outputs(parts), _functions(parts)
    fields = {
        "coordinates": _strings(eom.q),
        "speeds": _strings(eom.v),
        "rows": "()" if eom.bare else _rows(parts),
        "mass": _pattern(parts.mass),
        "jacobian": _pattern(parts.jacobian),
        **{
            name: f"{p}{name}" if name in texts else "None"
            for name in ("dynamics", "residual", "energies", "restitution")
        },
        "parameters": _strings(eom.p),
    }
    if not eom.bare:
        dimensions = parts.dimensions
        embedding = "Embedding(embed, SYSTEM_OF_COORDINATES)" if parts.reduction else "None"
        fields |= {
            "prescribed": repr(parts.prescribed),
            "dimension": repr(dimensions.coordinates),
            "speed_dimension": repr(dimensions.speeds),
            "extent_dimension": repr(dimensions.parameters),
            "angle_dimension": repr(dimensions.angles),
            "folded": repr(parts.extents[1]),
            "extents": repr(parts.extents[0]),
            "speed_folded": repr(parts.speed_folded),
            "embedding": embedding,
            "formulation": repr(parts.formulation),
        }
    if parts.estimated:
        fields["estimated"] = repr(parts.estimated)
    if parts.at_integers:
        fields |= {"switches": repr(parts.at_integers), "driven": str(len(eom.driven))}
    if parts.formulas:
        fields["started"] = repr(tuple(parts.formulas))
    if parts.frictions:
        fields["frictions"] = _frictions(parts)
    if "kinematics" in texts:
        fields["rates"] = _pattern(parts.rates)
        fields["quaternions"] = repr(eom.quaternions)
        fields["unwrapped"] = repr(tuple(eom.unwrapped))
    if "sides" in texts:
        fields["sided"] = repr(tuple(eom.sides))
    for name in (
        "surfaces",
        "starts",
        "coulomb",
        "kinematics",
        "unwrapped_angles",
        "sides",
        "terms",
    ):
        if name in texts:
            fields[name] = f"{p}{name}"
    if "lookups" in texts:
        reach = tuple((s.name, s.x[0], s.x[-1]) for s, _ in eom.lookups)
        fields["lookups"] = f"Lookups({p}lookups, {reach!r})"
    if own:
        fields["outputs"] = "".join(["(\n", *(f"        {made},\n" for made in own), "    )"])
    lines = "".join(f"    {name}={value},\n" for name, value in fields.items())
    return [*texts.values(), *own.values(), f"{_label(parts)} = System(\n{lines})\n"]


def _outputs(parts: Parts) -> dict[str, str]:
    """What makes each of the model's own outputs in the System -> the text of its functions."""
    eom, found = parts.eom, {}
    names = _names(eom.q, eom.v, eom.vdot, eom.driven, eom.p, eom.lam, eom.Q)
    for f in parts.functions:
        if f.name != "outputs":
            continue
        given = {**f.arguments, "lam": f.arguments["lambda"]}
        place = {s: (a, k) for a in OBSERVED for k, s in enumerate(given[a])}
        for k, o in enumerate(eom.outputs):
            w, other = f.results["w"][k], f.results["other"][k]
            made = {f"output_{k}": (f"{w.place}.", w)}
            if o.otherwise is not None:
                made[f"otherwise_{k}"] = (f"{o.name} where it has no value.", other)
            said = [repr(o.name), *made, *(["unique=True"] if o.unique else [])]
            found[f"Own({', '.join(said)})"] = "\n\n".join(
                _output(name, doc, x.expression, place, names) for name, (doc, x) in made.items()
            )
    return found


def _output(
    name: str, doc: str, value: Expr, place: Mapping[Expr, tuple[str, int]], names: dict[Expr, str]
) -> str:
    """A function of one value, which reads few of its many arguments."""
    arguments: dict[str, dict[int, Expr]] = {a: {} for a in OBSERVED}
    for s in sorted(value.free_symbols, key=place.__getitem__):
        argument, k = place[s]
        arguments[argument][k] = s
    used = {s: names[s] for s in value.free_symbols}
    return function(name, doc, arguments, {"w": [value]}, used)


def _rows(parts: Parts) -> str:
    items = []
    for row in parts.rows:
        said = [row.name, row.kind, row.while_closed, row.friction]
        while said[-1] is None:
            said.pop()
        items.append(f"Row({', '.join(map(repr, said))}),")
    return f"({' '.join(items)})"


def _frictions(parts: Parts) -> str:
    items = [f"Friction({f.name!r}, {f.rows}, {f.norms}, {f.gated})," for f in parts.frictions]
    return f"({' '.join(items)})"


def _strings(symbols: Sequence[Expr]) -> str:
    return repr(tuple(str(s) for s in symbols))


def _pattern(indices: Sequence[tuple[int, int]]) -> str:
    return repr((tuple(i for i, _ in indices), tuple(j for _, j in indices)))
