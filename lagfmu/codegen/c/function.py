"""Lists of expressions -> C functions that compute them, named as in the model.

A function unpacks the symbols that it needs, computes common subexpressions, then the results, each
with a comment that says its place.  A long one is split into blocks of bounded length, each a function
of its own: eliminating common subexpressions, here and in a compiler, costs more than linearly.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
from textwrap import wrap

import sympy as sp
from sympy.logic.boolalg import Boolean

from ...model.attitude import VECTOR, ClosedFunction, Closing, Step
from ...model.elements import Expr
from ..alike import DATA, Kind, data_of, kinds, nodes_of, runs
from ..parts import Value
from .printer import POWER, Names, Printer, common_subexpressions

ROTATION = """/* R (3, 3) by rows, of a unit quaternion. */
static void rotation(const double *e, double *R) {
    const double w = e[0], x = e[1], y = e[2], z = e[3];
    R[0] = w * w + x * x - y * y - z * z;
    R[1] = 2.0 * (x * y - w * z);
    R[2] = 2.0 * (x * z + w * y);
    R[3] = 2.0 * (x * y + w * z);
    R[4] = w * w - x * x + y * y - z * z;
    R[5] = 2.0 * (y * z - w * x);
    R[6] = 2.0 * (x * z - w * y);
    R[7] = 2.0 * (y * z + w * x);
    R[8] = w * w - x * x - y * y + z * z;
}
"""
ROTATION_CHANGE = """/* Its change for that of the quaternion. */
static void rotation_change(const double *e, const double *d, double *R) {
    const double w = 2.0 * e[0], x = 2.0 * e[1], y = 2.0 * e[2], z = 2.0 * e[3];
    const double ww = w * d[0], xx = x * d[1], yy = y * d[2], zz = z * d[3];
    const double wx = w * d[1] + x * d[0], wy = w * d[2] + y * d[0], wz = w * d[3] + z * d[0];
    const double xy = x * d[2] + y * d[1], xz = x * d[3] + z * d[1], yz = y * d[3] + z * d[2];
    R[0] = ww + xx - yy - zz;
    R[1] = xy - wz;
    R[2] = xz + wy;
    R[3] = xy + wz;
    R[4] = ww - xx + yy - zz;
    R[5] = yz - wx;
    R[6] = xz - wy;
    R[7] = yz + wx;
    R[8] = ww - xx - yy + zz;
}
"""
TURNED = """/* u = R s. */
static void turned(const double *R, const double *s, double *u) {
    for (int i = 0; i < 3; i++) u[i] = R[3 * i] * s[0] + R[3 * i + 1] * s[1] + R[3 * i + 2] * s[2];
}
"""
TURNED_CHANGE = """/* u = dR s + R ds. */
static void turned_change(const double *R, const double *dR, const double *s, const double *ds,
                          double *u) {
    for (int i = 0; i < 3; i++) {
        u[i] = dR[3 * i] * s[0] + dR[3 * i + 1] * s[1] + dR[3 * i + 2] * s[2] + R[3 * i] * ds[0] +
               R[3 * i + 1] * ds[1] + R[3 * i + 2] * ds[2];
    }
}
"""
ACROSS = """/* x = w x s. */
static void across(const double *w, const double *s, double *x) {
    x[0] = w[1] * s[2] - w[2] * s[1];
    x[1] = w[2] * s[0] - w[0] * s[2];
    x[2] = w[0] * s[1] - w[1] * s[0];
}
"""
ACROSS_CHANGE = """/* x = dw x s + w x ds. */
static void across_change(const double *w, const double *dw, const double *s, const double *ds,
                          double *x) {
    x[0] = dw[1] * s[2] - dw[2] * s[1] + w[1] * ds[2] - w[2] * ds[1];
    x[1] = dw[2] * s[0] - dw[0] * s[2] + w[2] * ds[0] - w[0] * ds[2];
    x[2] = dw[0] * s[1] - dw[1] * s[0] + w[0] * ds[1] - w[1] * ds[0];
}
"""
LEVERS = """/* L = R (e_k x s) (3) of each axis k: what a speed about it does. */
static void levers(const double *R, const double *s, double *L) {
    for (int i = 0; i < 3; i++) {
        L[i] = R[3 * i + 2] * s[1] - R[3 * i + 1] * s[2];
        L[3 + i] = R[3 * i] * s[2] - R[3 * i + 2] * s[0];
        L[6 + i] = R[3 * i + 1] * s[0] - R[3 * i] * s[1];
    }
}
"""
FUNCTIONS = {
    "rotation": ROTATION,
    "rotation_change": ROTATION_CHANGE,
    "turned": TURNED,
    "turned_change": TURNED_CHANGE,
    "across": ACROSS,
    "across_change": ACROSS_CHANGE,
    "levers": LEVERS,
}


def calls(steps: Sequence[Step], printed: Callable[[Expr], str]) -> Iterator[str]:
    """Statements: the arrays, then what fills them."""
    for step in steps:
        if step.operation == VECTOR:
            numbers = ", ".join(map(printed, step.numbers))
            yield f"const double {step.name}[] = {{{numbers}}};"
    made = [step for step in steps if step.operation != VECTOR]
    if made:
        yield f"double {', '.join(f'{step.name}[{step.size}]' for step in made)};"
    for step in made:
        yield f"{step.operation}({', '.join((*step.arguments, step.name))});"


BLOCK = 1000  # different nodes of the expressions in one block
TERMS = 40  # of one sum in one statement
RUN = 6  # equal neighbours that are worth a loop
FILL = (
    "static void fill(double *values, int count, double value) {\n"
    "    for (int i = 0; i < count; i++) {\n        values[i] = value;\n    }\n}\n"
)


@dataclass(frozen=True)
class _Statement:
    """array[index] operator value, or `count` equal values from there on."""

    array: str
    index: int
    operator: str
    value: Expr
    place: str
    count: int = 1


def function(
    name: str,
    doc: str,
    arguments: Mapping[str, Sequence[Expr]],
    results: Mapping[str, Sequence[Value]],
    names: Mapping[Expr, str],
) -> str:
    """C text of `name(arguments, results)`.

    `arguments` maps an array to the symbols in it, a scalar to its one symbol, which has its name.
    """
    statements = [s for array, group in results.items() for s in _statements(array, group)]
    blocks = list(_blocks(statements))
    large = len(blocks) > 1 or any(s.value.has(ClosedFunction) for s in statements)
    if large and (found := kinds(arguments, results, _costly)):
        return _in_loops(name, doc, arguments, results, found, names)
    if len(blocks) > 1:
        return _in_blocks(name, doc, arguments, list(results), blocks, names)
    return f"/* {doc} */\n{_define(name, arguments, list(results), statements, names)}"


def _in_loops(
    name: str,
    doc: str,
    arguments: Mapping[str, Sequence[Expr]],
    results: Mapping[str, Sequence[Value]],
    found: Sequence[Kind],
    names: Mapping[Expr, str],
) -> str:
    """A function for each kind of what is alike, one for the rest, and one that calls them."""
    told = {place for kind in found for place in kind.told}
    rest = {
        array: [None if (array, k) in told else value for k, value in enumerate(group)]
        for array, group in results.items()
    }
    statements = [s for array, group in rest.items() for s in _statements(array, group)]
    blocks = list(_blocks(statements))
    head = f"What is alike of no other in {name}."
    parts = []
    if len(blocks) > 1:
        parts.append(_in_blocks(f"{name}_rest", head, arguments, list(results), blocks, names))
    elif blocks:
        text = _define(f"{name}_rest", arguments, list(results), statements, names)
        parts.append(f"/* {head} */\n{text}")
    data = {x: k for k, x in enumerate(dict.fromkeys(data_of(found)))}
    text, parameters = _constants(data, arguments, names)
    calls = text
    if blocks:
        calls += _lines(f"    {name}_rest(", [*arguments, *results], ", ", ");")
    for number, kind in enumerate(found, 1):
        title = f"{name}_kind_{number}"
        values = [_Statement("y", k, "=", e, "") for k, e in enumerate(kind.values)]
        local = {s: str(s) for s in kind.inputs}
        text = _define(title, {"a": kind.inputs}, ["y"], values, local)
        owners = " ".join(wrap(", ".join(kind.owners), 90, max_lines=1, placeholder=" ..."))
        parts.append(f"/* Of {owners}. */\n{text}")
        calls += _loop(title, kind, arguments, names, data)
    used = {a for kind in found for a in (*kind.reads, *kind.writes)} | parameters
    used |= {*arguments, *results} if blocks else set()
    silence = _silence([a for a in (*arguments, *results) if a not in used])
    signature = _signature(name, arguments, names, list(results))
    return "\n".join([*parts, f"/* {doc} */\n{signature}{silence}{calls}}}\n"])


def _constants(
    data: Mapping[Expr, int], arguments: Mapping[str, Sequence[Expr]], names: Mapping[Expr, str]
) -> tuple[str, set[str]]:
    """The array DATA, and the arguments that stand in it."""
    places = {s: f"{a}[{k}]" for a, group in arguments.items() for k, s in enumerate(group)}
    symbols = set().union(*(e.free_symbols for e in data))
    printer = Printer({s: places[s] for s in symbols})
    const = "const" if symbols else "static const"
    text = data and _lines(f"    {const} double {DATA}[] = {{", [*map(printer, data)], ", ", "};")
    return text or "", {places[s].partition("[")[0] for s in symbols}


def _loop(
    title: str,
    kind: Kind,
    arguments: Mapping[str, Sequence[Expr]],
    names: Mapping[Expr, str],
    data: Mapping[Expr, int],
) -> str:
    """Calls of the function of a kind, for each of its owners."""
    count, inputs, outputs = len(kind.owners), len(kind.reads), len(kind.writes)
    sources = [
        [data[x] if a == DATA else x for x, a in zip(source, kind.reads, strict=True)]
        for source in kind.sources
    ]
    tables = "".join(
        f"        static const int {label}[{count}][{size}] = {{\n"
        + "".join(_lines("            {", [*map(str, row)], ", ", "},", " " * 13) for row in rows)
        + "        };\n"
        for label, size, rows in (
            ("from", inputs, sources),
            ("to", outputs, kind.targets),
        )
    )
    gather = scatter = ""
    for array, first, end in runs(kind.reads):
        scalar = array != DATA and _scalar(array, arguments[array], names)
        source = array if scalar else f"{array}[from[k][j]]"
        gather += f"            for (int j = {first}; j < {end}; j++) a[j] = {source};\n"
    for array, first, end in runs(kind.writes):
        scatter += f"            for (int j = {first}; j < {end}; j++) {array}[to[k][j]] = y[j];\n"
    return (
        f"    {{\n{tables}        for (int k = 0; k < {count}; k++) {{\n"
        f"            double a[{inputs}], y[{outputs}];\n{gather}            {title}(a, y);\n"
        f"{scatter}        }}\n    }}\n"
    )


def _define(
    name: str,
    arguments: Mapping[str, Sequence[Expr]],
    results: Sequence[str],
    statements: Sequence[_Statement],
    names: Mapping[Expr, str],
) -> str:
    body, used = _body(statements, arguments, names)
    silence = _silence([a for a in (*arguments, *results) if a not in used])
    return f"{_signature(name, arguments, names, results)}{silence}{body}}}\n"


def _in_blocks(
    name: str,
    doc: str,
    arguments: Mapping[str, Sequence[Expr]],
    results: Sequence[str],
    blocks: Sequence[Sequence[_Statement]],
    names: Mapping[Expr, str],
) -> str:
    """A function for what blocks share, one for each block, and one that calls them in order.

    It calls them through a table, because compilers would join functions that are called once.
    """
    parts, calls, inner = [], "", dict(arguments)
    shared = {e: sp.Symbol(f"shared {k}", real=True) for k, e in enumerate(_shared(blocks))}
    if shared:
        common = [_Statement("shared", k, "=", e, "") for k, e in enumerate(shared)]
        blocks = [[replace(s, value=s.value.xreplace(shared)) for s in block] for block in blocks]
        parts.append(_define(f"{name}_shared", arguments, ["shared"], common, names))
        calls = f"    double shared[{len(shared)}];\n"
        calls += _lines(f"    {name}_shared(", [*arguments, "shared"], ", ", ");")
        inner["shared"] = tuple(shared.values())
        names = {**names, **_distinct(inner["shared"], set(names.values()))}
    titles = [f"{name}_{k}" for k in range(1, len(blocks) + 1)]
    for title, block in zip(titles, blocks, strict=True):
        parts.append(_define(title, inner, results, block, names))
    types = ["double" if _scalar(a, s, names) else "const double *" for a, s in inner.items()]
    types += ["double *"] * len(results)
    calls += _lines("    static void (*const blocks[])(", types, ", ", ") = {")
    calls += _lines("        ", titles, ", ", "};")
    calls += "    for (size_t k = 0; k < sizeof blocks / sizeof blocks[0]; k++) {\n"
    calls += _lines("        blocks[k](", [*inner, *results], ", ", ");", " " * 18) + "    }\n"
    parts.append(f"/* {doc} */\n{_signature(name, arguments, names, results)}{calls}}}\n")
    return "\n".join(parts)


def _distinct(symbols: Sequence[Expr], taken: set[str]) -> dict[Expr, str]:
    """shared0, shared1, ..., where no symbol of the model is called so."""
    texts = (text for k in count() if (text := f"shared{k}") not in taken)
    return dict(zip(symbols, texts, strict=False))


def _signature(
    name: str,
    arguments: Mapping[str, Sequence[Expr]],
    names: Mapping[Expr, str],
    results: Sequence[str],
) -> str:
    declared = [
        f"double {a}" if _scalar(a, s, names) else f"const double *{a}"
        for a, s in arguments.items()
    ]
    declared += [f"double *{a}" for a in results]
    called = " inline" if name.endswith("dynamics") else ""  # by accelerate (sparsity.py)
    head = f"static{called} void {name}("
    return _lines(head, declared, ", ", ") {", " " * len(head))


def _scalar(argument: str, symbols: Sequence[Expr], names: Mapping[Expr, str]) -> bool:
    return len(symbols) == 1 and names[symbols[0]] == argument


def _silence(unused: Sequence[str]) -> str:
    return _lines("    ", [f"(void){a};" for a in unused], " ", "", "    ") if unused else ""


# ------------------------------------------------------------------------------- statements


def _statements(array: str, group: Sequence[Value | None]) -> Iterator[_Statement]:
    """Assignments (None: to be left out); equal neighbours become one loop, long sums are added up in
    pieces."""
    k = 0
    while k < len(group):
        one = group[k]
        if one is None:
            k += 1
            continue
        value = one.expression
        end = k + 1
        while end < len(group) and (other := group[end]) and other.expression == value:
            end += 1
        if end - k >= RUN:
            last = group[end - 1]
            place = f"{one.place} ... {last.place if last else ''}"
            yield _Statement(array, k, "=", value, place, end - k)
            k = end
            continue
        terms = sp.Add.make_args(value)
        for start in range(0, len(terms), TERMS):
            part = sp.Add(*terms[start : start + TERMS]) if len(terms) > TERMS else value
            yield _Statement(array, k, "+=" if start else "=", part, one.place)
        k += 1


def _blocks(statements: Sequence[_Statement]) -> Iterator[list[_Statement]]:
    """Neighbouring statements in blocks of about BLOCK different nodes and statements."""
    block: list[_Statement] = []
    seen: dict[Expr, None] = {}
    for s in statements:
        more = nodes_of(s.value, seen)
        if block and len(seen) + len(more) + len(block) > BLOCK:
            yield block
            block, seen, more = [], {}, nodes_of(s.value, {})
        block.append(s)
        seen |= more
    if block:
        yield block


def _shared(blocks: Sequence[Sequence[_Statement]]) -> list[Expr]:
    """Calls of functions, roots and powers that more than one block would compute."""
    uses: dict[Expr, int] = {}
    for block in blocks:
        nodes: dict[Expr, None] = {}
        for s in block:
            nodes |= nodes_of(s.value, nodes)
        for e in nodes:
            if _costly(e):
                uses[e] = uses.get(e, 0) + 1
    return [e for e, times in uses.items() if times > 1]


def _costly(e: Expr) -> bool:
    if isinstance(e, ClosedFunction):
        return False
    if e.is_Pow:
        return not e.exp.is_Integer or abs(e.exp) > POWER
    return bool(e.is_Function) and not isinstance(e, Boolean)


def _body(
    statements: Sequence[_Statement],
    arguments: Mapping[str, Sequence[Expr]],
    names: Mapping[Expr, str],
) -> tuple[str, set[str]]:
    """Unpacking, common subexpressions, assignments; and the arguments that they use."""
    values = [s.value for s in statements]
    symbols: set[Expr] = set().union(*(e.free_symbols for e in values)) if values else set()
    local = {s: names[s] for s in symbols}
    taken = Names(local)
    closing = Closing(taken.array)
    values, places = closing.opened(values)
    local |= {s: f"{a}[{k}]" for s, (a, k) in places.items()}
    common, reduced = common_subexpressions(values, taken)
    printed = [*reduced, *(e for _, e in common), *(x for s in closing.steps for x in s.numbers)]
    # a vector may hold more than is read of it
    symbols = set().union(*(e.free_symbols for e in printed))
    printer = Printer(local)
    used = {s.array for s in statements}
    lines = []
    for argument, group in arguments.items():
        wanted = [(k, s) for k, s in enumerate(group) if s in symbols]
        if not wanted:
            continue
        used.add(argument)
        if _scalar(argument, group, names):
            continue
        declared = [f"{names[s]} = {argument}[{k}]" for k, s in wanted]
        lines.append(_lines("    const double ", declared, ", ", ";"))
    lines += [_lines("    ", [call], "") for call in calls(closing.steps, printer)]
    for s, e in common:
        lines.append(_lines("    ", [f"const double {local[s]} = {printer(e)};"], ""))
    if lines:
        lines.append("\n")
    lines += [_assignment(s, printer(e)) for s, e in zip(statements, reduced, strict=True)]
    return "".join(lines), used


def _assignment(s: _Statement, text: str) -> str:
    if s.count > 1:
        place = s.array if s.index == 0 else f"{s.array} + {s.index}"
        line = f"fill({place}, {s.count}, {text});"
    else:
        line = f"{s.array}[{s.index}] {s.operator} {text};"
    if not s.place:
        return _lines("    ", [line], "")
    comment = f"/* {s.place} */"
    if len(line) + len(comment) + 5 <= 100:
        return f"    {line} {comment}\n"
    return _lines("    ", [comment], "") + _lines("    ", [line], "")


def _lines(
    head: str, items: Sequence[str], between: str, end: str = "", indent: str = " " * 8
) -> str:
    """head item, item, ... end, in lines of at most 100 characters, broken between items."""
    if len(items) == 1:  # broken at any blank
        text = wrap(
            items[0] + end,
            100,
            initial_indent=head,
            subsequent_indent=indent,
            break_long_words=False,
            break_on_hyphens=False,
        )
        return "\n".join(text) + "\n"
    lines = [head + items[0]]
    for item in items[1:]:
        if len(lines[-1]) + len(between) + len(item) + len(end) <= 100:
            lines[-1] += between + item
        else:
            lines[-1] += between.rstrip()
            lines.append(indent + item)
    return "\n".join(lines) + end + "\n"
