"""Equations of motion -> their numeric form (parts.py) as a System, by way of generated Python source."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, partial
from typing import Any, TypeAlias

from ...mechanics.equations import EquationsOfMotion
from ...mechanics.formulations import Form
from ...mechanics.jumps import with_switch_states
from ...model.elements import TIME, Expr
from ...numeric.functions import OPERATIONS, Cubic
from ...numeric.system import System
from ..parts import Function, Parts, parts_of
from .function import function, identifiers, in_loops, table_name

Text: TypeAlias = Callable[[], str]
OBSERVED = ("t", "q", "v", "vdot", "u", "p", "lam", "Q")  # what outputs are functions of


def source(form: Form) -> str:
    """Python text that defines SYSTEM, the numeric form of the equations.

    It needs the names System, Row, Own, Friction, Lookups and Embedding of `lagfmu.numeric.system`, and Cubic
    where there are tables, and the functions of numeric/functions.py where there are bodies in space.
    """
    form, jumps = with_switch_states(form)
    pieces = []
    for parts in parts_of(form, jumps):
        pieces += [text() for text in _functions(parts).values()] + [_system(parts)]
    return _complete(form.equations, "\n\n".join([*pieces, f"SYSTEM = {_label(parts)}\n"]))


def lower(form: Form) -> System:
    """What that text defines, ready for the solver; each function is printed when it is called first."""
    form, jumps = with_switch_states(form)
    scope = _vocabulary()
    for parts in parts_of(form, jumps):
        for name, text in _functions(parts).items():
            scope[name] = _Function(form.equations, name, text)
        exec(_system(parts), scope)
    system: System = scope[_label(parts)]
    return system


class _Function:
    """A function that is printed and compiled when it is called first."""

    def __init__(self, eom: EquationsOfMotion, name: str, text: Text) -> None:
        self.eom, self.name, self.text = eom, name, text

    @cached_property
    def made(self) -> Callable[..., Any]:
        """What the text defines."""
        scope = _vocabulary()
        exec(compile(_complete(self.eom, self.text()), "<lagfmu equations>", "exec"), scope)
        found: Callable[..., Any] = scope[self.name]
        return found

    def __call__(self, *arguments: Any) -> Any:
        return self.made(*arguments)


def _complete(eom: EquationsOfMotion, text: str) -> str:
    """The text with what it imports and the tables that it looks up."""
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


def _vocabulary() -> dict[str, Any]:
    """The names that generated source needs."""
    from ...numeric import system as vocabulary

    return {
        "System": vocabulary.System,
        "Own": vocabulary.Own,
        "Lookups": vocabulary.Lookups,
        "Cubic": Cubic,
        "Row": vocabulary.Row,
        "Embedding": vocabulary.Embedding,
        "Friction": vocabulary.Friction,
        **OPERATIONS,
    }


def _label(parts: Parts) -> str:
    return f"SYSTEM_OF_{parts.prefix.upper()}COORDINATES"


def _names(*groups: Sequence[Expr]) -> dict[Expr, str]:
    return {**identifiers([s for group in groups for s in group]), TIME: "t"}


def _define(f: Function, names: Mapping[Expr, str], prefix: str = "") -> str:
    results = {label: [x.expression for x in group] for label, group in f.results.items()}
    return in_loops(f, names, prefix) or function(
        prefix + f.name, f.doc, f.arguments, results, names
    )


def _functions(parts: Parts) -> dict[str, Text]:
    """The functions by name, which the System holds; the energies of the full system serve the reduced one
    too."""
    eom, found = parts.eom, dict[str, Text]()
    names = _names(eom.q, eom.v, eom.driven, eom.p)
    for f in parts.embedding:
        found[f.name] = partial(_define, f, names)
    for f in parts.functions:
        if f.name != "outputs" and not (f.name == "energies" and parts.prefix):
            found[parts.prefix + f.name] = partial(_define, f, names, parts.prefix)
    return found | {name: text for of in _outputs(parts).values() for name, text in of.items()}


def _system(parts: Parts) -> str:
    """The System that holds the functions."""
    eom, p, own = parts.eom, parts.prefix, _outputs(parts)
    texts = {name.removeprefix(p) for name in _functions(parts)}
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
    return f"{_label(parts)} = System(\n{lines})\n"


def _outputs(parts: Parts) -> dict[str, dict[str, Text]]:
    """What makes each of the model's own outputs in the System -> its functions."""
    eom, found = parts.eom, dict[str, dict[str, Text]]()
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
            found[f"Own({', '.join(said)})"] = {
                name: partial(_output, name, doc, x.expression, place, names)
                for name, (doc, x) in made.items()
            }
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
