"""Bodies and joints of a kind as Python: one function of each kind, called for every place in a table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import sympy as sp

from ...model.attitude import ClosedFunction
from ...model.elements import Expr
from ..alike import DATA, Kind, data_of, kinds, runs
from ..parts import Arguments, Function
from .function import Printer, function


def in_loops(f: Function, names: Mapping[Expr, str], prefix: str) -> str | None:
    """Source of the function with a loop for each kind of what is alike; None where nothing is closed, or
    alike."""
    whole = [value for group in f.results.values() for value in group]
    if not any(value.expression.has(ClosedFunction) for value in whole):
        return None
    found = kinds(f.arguments, f.results, lambda e: False)
    if not found:
        return None
    name, told = prefix + f.name, {place for kind in found for place in kind.told}
    rest = {
        label: [sp.S.Zero if (label, k) in told else x.expression for k, x in enumerate(group)]
        for label, group in f.results.items()
    }
    arguments = ", ".join(f.arguments)
    lines = [f"def {name}({arguments}):", f'    """{f.doc}"""']
    lines.append(f"    {', '.join(f.results)} = {name}_rest({arguments})")
    data = {x: k for k, x in enumerate(dict.fromkeys(data_of(found)))}
    if data:
        places = {s: f"{a}[{k}]" for a, group in f.arguments.items() for k, s in enumerate(group)}
        numbers = ", ".join(map(Printer(places).doprint, data))
        lines.append(f"    {DATA} = [{numbers}]")
    pieces = [
        function(f"{name}_rest", f"What is alike of no other in {name}.", f.arguments, rest, names)
    ]
    for number, kind in enumerate(found, 1):
        title = f"{name}_kind_{number}"
        local = {s: str(s) for s in kind.inputs}
        doc = f"Of {', '.join(kind.owners)}."
        pieces.append(function(title, doc, {"a": kind.inputs}, {"y": kind.values}, local))
        pieces.append(f"{title}_places = (\n{''.join(_rows(kind, data))})\n")
        read = [
            _read(array, first, end, f.arguments, names) for array, first, end in runs(kind.reads)
        ]
        lines.append(f"    for source, target in {title}_places:")
        lines.append(f"        y = {title}([{', '.join(read)}])")
        for array, first, end in runs(kind.writes):
            lines.append(f"        for k, value in zip(target[{first}:{end}], y[{first}:{end}]):")
            lines.append(f"            {array}[k] = value")
    lines.append(f"    return {', '.join(f.results)}")
    return "\n\n".join([*pieces, "\n".join(lines) + "\n"])


def _rows(kind: Kind, data: Mapping[Expr, int]) -> Iterator[str]:
    """What each owner reads, and what it writes."""
    for source, target in zip(kind.sources, kind.targets, strict=True):
        read = (data[x] if a == DATA else x for x, a in zip(source, kind.reads, strict=True))
        yield f"    ({tuple(read)!r}, {target!r}),\n"


def _read(array: str, first: int, end: int, arguments: Arguments, names: Mapping[Expr, str]) -> str:
    """The elements of an array at these places of a row; of a scalar itself."""
    group = arguments.get(array, ())
    if len(group) == 1 and names[group[0]] == array:
        return f"*[{array}] * {end - first}"
    return f"*[{array}[k] for k in source[{first}:{end}]]"
