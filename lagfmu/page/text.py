"""What `lagfmu show` prints: equations of motion, classes of constraints, degrees of freedom, units."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

import sympy as sp
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

from ..mechanics.equations import EquationsOfMotion
from ..mechanics.integrability.classify import Classification, classify
from ..model.elements import TIME
from ..model.model import Contact, Nonholonomic, name_of
from ..names import FORCE, MULTIPLIER, OWN
from ..numeric.failure import OMITTED
from ..prepare.consistency import of_undecided, remedy_of
from ..prepare.steps import Lowered, Prepared
from .documentation import as_given, shown
from .notation import Notation
from .savings import Savings, savings
from .typeset import typeset

# of breaks before operators; between factors or words: 5
KINDS = {"=≤≥<>≠": 0, "+-−±": 1, "/·∧": 4}
OPERATORS = "".join(KINDS)
OPEN, CLOSE = "([{", ")]}"
LEVEL = 4.0  # kinds of operators a level
EMPTY = 4.0  # what a line costs that is left empty, ...
SHORT, LEAST = 8.0, 0.3  # ... and what one costs of which less than this part is used


@dataclass(frozen=True)
class _Word:
    """`depth`: of the brackets around it; `kind`: of a break before it, the better the smaller."""

    text: str
    depth: int
    kind: int


def wrapped(text: str, width: int) -> list[str]:
    """The words of a text, all of them, in lines of at most `width` cells (longer if one word is); those that
    begin inside of brackets are indented."""
    words = list(_words(text))
    lines: list[str] = []
    while words:
        indent = "  " * min(words[0].depth, 3) if lines else ""
        count = _taken(words, width - len(indent))
        lines.append(indent + _joined(words[:count]))
        words = words[count:]
    return lines or [""]


def _joined(words: list[_Word]) -> str:
    return " ".join(word.text for word in words)


def _words(text: str) -> Iterator[_Word]:
    depth, before = 0, " "
    for word in text.split():
        kind = next((k for s, k in KINDS.items() if word in s), 5)
        stays = before in OPERATORS  # with the operator before it
        yield _Word(word, depth, kind + 8 * stays)
        depth += sum(word.count(c) for c in OPEN) - sum(word.count(c) for c in CLOSE)
        before = word


def _taken(words: list[_Word], width: int) -> int:
    """How many words, one at the least, make the best line."""
    used, found, best = cell_len(words[0].text), 1, float("inf")
    for count, word in enumerate(words[1:], 1):
        part = min(used / width, 1.0)
        cost = LEVEL * word.depth + word.kind + EMPTY * (1 - part) + SHORT * (part < LEAST)
        if cost <= best:
            found, best = count, cost
        used += 1 + cell_len(word.text)
        if used > width:
            return found
    return len(words)


INDENT = 6


def show(prepared: Prepared, console: Console, untried: str = "") -> None:
    """Print what is known about a model in a scene; `untried`: why nobody asked if frictions allow its start.

    Raises DerivationError if the nonholonomic constraints contradict each other.
    """
    _show_equations(prepared, console)
    show_besides(prepared, console, untried)


def show_besides(prepared: Prepared, console: Console, untried: str = "") -> None:
    """Print all of it but the equations."""
    structure = prepared.structure
    if prepared.equations.constraints:
        _heading(console, "Classes of constraints")
        _classes(prepared.equations, console)

    _heading(console, "Degrees of freedom")
    contacts = sum(isinstance(c, Contact) for c in prepared.equations.constraints)
    closed, opened = structure.rank, structure.open_rank
    together = contacts <= closed - opened  # two stops of a joint are not closed at once
    rank = closed if together else opened
    count = f"  N = n - rank G = {structure.n} - {rank} = {structure.n - rank}"
    if contacts and together:
        count += f", with every contact closed; {structure.n - opened} with every contact open"
    elif contacts:
        count += ", with every contact open"
    console.print(Text(count))
    if structure.redundant:
        names, shared = ", ".join(structure.redundant), ", ".join(structure.shared)
        text = (
            f"redundant: {names}; λ is not unique for {shared}: of all λ with the same Q the one with "
            "the least norm, rows scaled so that g M⁻¹ gᵀ = 1; Q is unique"
            + remedy_of(prepared.equations)
        )
        _print(console, "  ", text)
    if structure.undecided:
        _print(console, "  ", of_undecided(structure.undecided, structure.redundant))

    saved = savings(prepared)
    if saved is not None:
        _heading(console, "What the scene leaves out")
        _savings(saved, console)

    _given(prepared, console)
    _heading(console, "Units")
    console.print(_units(prepared))
    _heading(console, "Start values")
    _starts(prepared, console)
    if untried:
        text = (
            "whether the frictions allow this start was not examined, as the FMU itself is asked: "
        )
        _print(console, "  ", text + untried)
    console.print()


def _show_equations(prepared: Lowered, console: Console) -> None:
    """Print the name, the formulation and the equations of a model in a scene, whether it starts or not."""
    model, scene = prepared.model, prepared.scene
    head = Text(scene.name, style="bold")
    if scene.name != model.name:
        head.append(f"  (model {model.name})", style="not bold dim")
    console.print(head)
    if model.description:
        console.print(Text(model.description))
    console.print(Text(f"formulation: {scene.formulation}", style="dim"))

    for section in typeset(prepared.form):
        if section.equations:
            _heading(console, section.title)
        width = max((len(e.label) for e in section.equations), default=0)
        for equation in section.equations:
            _line(console, f"{equation.label:{width}}", equation.text)


def show_what_is_known(known: Lowered, console: Console) -> None:
    """Print what can be said of a model that cannot start."""
    _show_equations(known, console)
    _given(known, console)
    console.print()


def _given(prepared: Lowered, console: Console) -> None:
    """Parameters and inputs with their values."""
    for title, role in (("Parameters", "parameter"), ("Inputs", "input")):
        rows = [v for v in prepared.whole.variables if v.role == role]
        if not rows:
            continue
        _heading(console, title)
        table = Table(box=None, header_style="dim", padding=(0, 2))
        for column in ("name", "value" if role == "parameter" else "start", "unit", "description"):
            table.add_column(column, overflow="fold", no_wrap=column not in ("name", "description"))
        for v in rows:
            table.add_row(
                Text(v.name),
                f"{v.start:.15g}",
                f"{shown(v.unit) or '1'}{as_given(v)}",
                Text(v.description),
            )
        console.print(table)


def _savings(saved: Savings, console: Console) -> None:
    for text in saved.left_out:
        _print(console, "  ", text)
    table = Table(box=None, header_style="dim", padding=(0, 2))
    for column in ("", "full FMU", "this scene"):
        table.add_column(column, justify="right" if column else "left")
    for title, before, after in saved.rows():
        table.add_row(title, str(before), Text(str(after), style="" if before == after else "bold"))
    console.print(table)


def _heading(console: Console, title: str) -> None:
    console.print()
    console.print(Text(title, style="bold"))


def _classes(eom: EquationsOfMotion, console: Console) -> None:
    width = max(len(c.name) for c in eom.constraints)
    forms = {}
    for c, f in zip(eom.constraints, eom.f, strict=True):
        closed = getattr(c, "while_closed", None)
        note = f", while {closed} is closed" if closed is not None else ""
        if isinstance(c, Nonholonomic) and _of_parts(eom, c):
            text = f"on velocities: {c.description}" if c.description else "on velocities"
            _line(console, f"{c.name:{width}}", text + note)
            continue
        if isinstance(c, Nonholonomic):
            forms[c.name] = c
            found = _classified(eom, [c])
            _class(eom, console, f"{c.name:{width}}", found, note)
            continue
        kind = "contact (unilateral, holonomic while closed)"
        if not isinstance(c, Contact):
            kind = "holonomic"
        if f is not None and f.free_symbols & {TIME, *eom.u}:
            kind += ", rheonomic"
        _line(console, f"{c.name:{width}}", kind + note)
    if len(forms) > 1:
        found = _classified(eom, list(forms.values()))
        _class(eom, console, " and ".join(forms), found, "")


def _of_parts(eom: EquationsOfMotion, c: Nonholonomic) -> bool:
    """It is of a mechanism's joints, whose many rows are no surface to eliminate with, or in speeds that are
    no rates of coordinates: no one-form as it stands."""
    return bool(eom.model.parts) or sp.sympify(c.expression).has(*(eom.model.speeds or ()))


def _classified(eom: EquationsOfMotion, forms: list[Nonholonomic]) -> Classification:
    """On the surfaces of the holonomic constraints that act whenever one of the forms does."""
    closed = {getattr(c, "while_closed", None) for c in forms} - {None}
    surfaces = []
    for c in eom.constraints:
        acting = c.name if isinstance(c, Contact) else getattr(c, "while_closed", None)
        if not isinstance(c, Nonholonomic) and (acting is None or acting in closed):
            surfaces.append(sp.sympify(c.expression))
    expressions = [sp.sympify(c.expression) for c in forms]
    return classify(expressions, list(eom.model.coordinates), holonomic=surfaces)


def _class(
    eom: EquationsOfMotion, console: Console, label: str, found: Classification, note: str
) -> None:
    """The kind, with its certificate and the functions whose derivative it is."""
    _line(console, label, str(found.kind) + note)
    names = "|".join(name_of(q) for q in eom.model.coordinates)
    certificate = re.sub(rf"\b({names})\(t\)", r"\1", found.certificate)
    _print(console, "      ", certificate, "dim")
    notation = Notation(eom)
    for integral in found.integrals:
        text = notation.show(eom.plain(integral.f))[1]
        _print(console, "      ", f"keeps {text} constant")


def _line(console: Console, label: str, text: str) -> None:
    _print(console, f"  {label}   ", text)


def _print(console: Console, head: str, text: str, style: str = "") -> None:
    """A text behind its heading, in as many lines as it takes; a long heading stands above it."""
    if cell_len(head) > console.width // 3 and cell_len(head + text) > console.width:
        console.print(Text(head.rstrip(), style="dim"), soft_wrap=True)
        head = " " * INDENT
    for line in wrapped(text, max(console.width - cell_len(head), INDENT)):
        console.print(Text.assemble((head, "dim"), (line, style)), soft_wrap=True)
        head = " " * cell_len(head)


def _units(prepared: Prepared) -> Table:
    table = Table(box=None, header_style="dim", padding=(0, 2))
    for column in ("variable", "unit", "description"):
        table.add_column(column, overflow="fold")
    eom = prepared.equations
    names = [str(q) for q in eom.q]
    names += [str(s) for s in prepared.form.stepped.q if s not in eom.q]
    names += [d for d in eom.directions if d not in names]  # speeds of the model's own
    reported = prepared.table.those(MULTIPLIER, FORCE, OWN)
    found = [prepared.table[name] for name in names if name in prepared.table]
    for v in (*found, *(v for v in reported if not (v.of.constraint and v.of.coordinate))):
        table.add_row(Text(v.name), Text(shown(v.unit) or "1"), Text(v.description))
    return table


def _starts(prepared: Prepared, console: Console) -> None:
    """Which start values miss the constraints, and where they are moved to; how a mechanism was assembled."""
    moved = prepared.structure.start.moved
    rough = {str(prepared.form.equations.symbols[s]) for s in prepared.model.rough}
    for v in prepared.whole.variables:
        if v.name in rough and v.start:
            value = f"{v.start!r} {shown(v.unit)}".rstrip()
            _print(console, "  ", f"{v.name} = {value}: assembled")
    if not moved:
        which = "the others as given" if rough else "as given"
        _print(console, "  ", f"{which}: they satisfy the constraints")
    for m in moved:
        unit = shown(prepared.whole[m.name].unit)
        said = (
            "is left out: it becomes" if m.priority == OMITTED else f"= {m.given!r} is projected to"
        )
        _print(console, "  ", f"{m.name} {said} {m.used!r} {unit}")
