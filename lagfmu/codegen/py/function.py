"""Equations -> Python source: short functions with common subexpressions, named as in the model.

The only Python printer.  The same text is run in memory by `simulate` and shipped in an FMU.

Of bodies and joints of a kind there is one function, called for every place in a table.
"""

from __future__ import annotations

import builtins
import keyword
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import count
from typing import Any

import sympy as sp
from sympy.printing.pycode import PythonCodePrinter

from ...errors import DerivationError
from ...model.attitude import VECTOR, ClosedFunction, Closing, Step
from ...model.elements import Expr
from ...numeric.functions import OPERATIONS
from ..alike import DATA, Kind, data_of, kinds, runs
from ..parts import Arguments, Function, identifier


def _calls(steps: Sequence[Step], printed: Callable[[Expr], str]) -> Iterator[str]:
    """Assignments, in order."""
    for step in steps:
        if step.operation == VECTOR:
            yield f"{step.name} = [{', '.join(map(printed, step.numbers))}]"
        else:
            yield f"{step.name} = {step.operation}({', '.join(step.arguments)})"


ARGUMENTS = (
    *("t", "q", "v", "u", "p", "s", "sdot", "M", "F", "G", "nu", "gamma", "f", "h", "e", "energy"),
    *("vdot", "lam", "Q", "w", "coefficients", "load", "normal", "places", *OPERATIONS),
)

TABLE = "table_of_"
MOST_TERMS = 500  # of a sum: Python's compiler goes as deep as there are terms, and refuses 3,000


class Printer(PythonCodePrinter):  # type: ignore[misc]
    """Numbers as doubles, functions without the module's name; unknown functions are refused."""

    def __init__(self, names: Mapping[Expr, str]) -> None:
        super().__init__({"fully_qualified_modules": False, "strict": True})
        self.names = names

    def _print_Symbol(self, symbol: Expr) -> str:
        return self.names.get(symbol) or str(symbol)

    def _double(self, number: Expr) -> str:
        return repr(float(number))

    _print_Rational = _print_Float = _print_NumberSymbol = _print_Pi = _print_Exp1 = _double  # noqa: N815

    def _print_SplineBase(self, call: Expr) -> str:
        order = f", {call.order}" if call.order else ""
        return f"{table_name(call.spline)}({self._print(call.args[0])}{order})"

    def _print_Add(self, total: Expr, order: str | None = None) -> str:
        terms = total.args
        if len(terms) <= MOST_TERMS:
            return str(super()._print_Add(total, order))
        parts = (terms[k : k + MOST_TERMS] for k in range(0, len(terms), MOST_TERMS))
        return " + ".join(f"({self._print(sp.Add(*part, evaluate=False))})" for part in parts)

    def _print_Largest(self, e: Expr) -> str:
        return f"max({', '.join(map(self._print, e.args))})"

    def _print_Integer(self, number: Expr) -> str:
        return str(number) if abs(int(number)) < 2**53 else repr(float(number))


def table_name(spline: Any) -> str:
    """The Python name of a table."""
    return f"{TABLE}{spline.name}"


def identifiers(symbols: Sequence[Expr]) -> dict[Expr, str]:
    """A distinct Python identifier for each symbol: theta, der_theta, der2_theta, m, ..."""
    taken = {*keyword.kwlist, *dir(math), *dir(builtins), *ARGUMENTS}
    names: dict[Expr, str] = {}
    for symbol in symbols:
        text = identifier(symbol)
        if text.startswith(TABLE):
            text = f"x_{text}"
        while text in taken:
            text += "_"
        taken.add(text)
        names[symbol] = text
    return names


def function(
    name: str,
    doc: str,
    arguments: Mapping[str, Sequence[Expr] | Mapping[int, Expr]],
    results: Mapping[str, Sequence[Expr]],
    names: Mapping[Expr, str],
) -> str:
    """Source of `name(*arguments)` that returns a tuple of the lists in `results`.

    `arguments` maps an argument to the symbols it is unpacked into, or to those that are read of it by their
    places; one that is passed as it is to the one symbol that has its name.
    """
    flat = [sp.sympify(e) for group in results.values() for e in group]
    used = set().union(*(e.free_symbols for e in flat)) if flat else set()
    taken = {*names.values(), *ARGUMENTS}
    closing = Closing(lambda letter: _array(letter, taken))
    flat, places = closing.opened(flat)
    printer = Printer({**names, **{s: f"{a}[{k}]" for s, (a, k) in places.items()}})
    common, reduced = sp.cse(flat, symbols=_fresh(taken), order="none", list=True)
    lines = [f"def {name}({', '.join(arguments)}):", f'    """{doc}"""']
    for argument, symbols in arguments.items():
        if isinstance(symbols, Mapping):
            read = ((names[s], k) for k, s in symbols.items() if names[s] != argument)
            lines += [f"    {name} = {argument}[{k}]" for name, k in read]
            continue
        if [names[s] for s in symbols] == [argument]:
            continue
        wanted = [names[s] if s in used else "_" for s in symbols]
        if any(w != "_" for w in wanted):
            lines.append(f"    {', '.join(wanted)}{',' if len(wanted) == 1 else ''} = {argument}")
    try:
        lines += [f"    {call}" for call in _calls(closing.steps, printer.doprint)]
        lines += [f"    {s} = {printer.doprint(e)}" for s, e in common]
        values = iter([printer.doprint(e) for e in reduced])
    except sp.printing.codeprinter.PrintMethodNotImplementedError as error:
        raise DerivationError(
            f"an expression cannot be written as numeric code: {str(error).splitlines()[0]}; use "
            "functions that Python's math module has"
        ) from error
    for label, group in results.items():
        items = [next(values) for _ in group]
        lines += _assignment(label, items)
    lines.append(f"    return {', '.join(results)}")
    return "\n".join(lines) + "\n"


def _assignment(label: str, items: Sequence[str]) -> list[str]:
    line = f"    {label} = [{', '.join(items)}]"
    if len(line) <= 100:
        return [line]
    return [f"    {label} = [", *(f"        {item}," for item in items), "    ]"]


def _array(letter: str, taken: set[str]) -> str:
    """A name for an array."""
    text = next(t for k in count() if (t := f"{letter}{k}") not in taken)
    taken.add(text)
    return text


def _fresh(taken: set[str]) -> Any:
    k = 0
    while True:
        if f"x{k}" not in taken:
            yield sp.Symbol(f"x{k}")
        k += 1


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
