"""(form, scene) -> the FMU's variable table.

Names, order, references, causality, units, start values and dependencies are decided in this room only.

What FMI 3.0 has variables for besides those of the table: time, event indicators, the equations of a DAE
and the parameter that switches to it, clocks, arrays.

They come last, so that all others have the same value references in both versions, and the interface
answers for them itself: in this order.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from .. import names
from ..errors import ModelError
from ..mechanics.equations import EquationsOfMotion
from ..mechanics.formulations import Form
from ..methods import FIXED_STEP, described
from ..model.model import name_of
from ..model.scene import Scene, listed, select
from ..model.units import ONE, SECOND, DisplayUnit, Unit, parse_scaled
from ..names import Subject, derivative
from ..numeric.system import System
from ..numeric.thresholds import LARGEST_TOLERANCE, MAXIMUM_STEPS
from .dependencies import Dependencies
from .outputs import Outputs
from .variables import Value, Variable, VariableTable


def _parameters(eom: EquationsOfMotion) -> list[Variable]:
    """Those of the model."""
    return [
        _fixed(
            Subject(names.VALUE, "", name_of(p.symbol)),
            "parameter",
            p.description,
            float(p.value),
            unit=eom.units[name_of(p.symbol)],
            minimum=p.min,
            maximum=p.max,
            positive=bool(p.symbol.is_positive),
        )
        for p in eom.parameters
    ]


def _solver_settings(scene: Scene) -> list[Variable]:
    """How the equations are integrated: solver.method, solver.tolerance, ..."""

    def setting(name: str, text: str, start: Value, **more: Any) -> Variable:
        return _fixed(Subject(name), "solver", text, start, **more)

    methods = tuple(scene.selectable)
    text = described(methods)
    choice = setting(names.METHOD, text, scene.method, kind="Enumeration", items=methods)
    text = f"largest fixed step of {' and '.join(FIXED_STEP)}; 0: chosen from the start"
    step = setting(names.STEP, text, scene.step, unit=SECOND, minimum=0.0)
    text = (
        f"relative tolerance of each step; 0: the one of the experiment, else {scene.tolerance!r}"
    )
    largest = float(LARGEST_TOLERANCE)
    tolerance = setting(names.TOLERANCE, text, 0.0, unit=ONE, minimum=0.0, maximum=largest)
    text = "largest adaptive step; 0: no limit"
    longest = setting(names.MAXIMUM_STEP, text, 0.0, unit=SECOND, minimum=0.0)
    text = "steps shorter than 1e-6 of the natural time that a communication step may take; 0: no limit"
    short = setting(names.MAXIMUM_STEPS, text, MAXIMUM_STEPS, unit=ONE, minimum=0.0)
    return [
        *([choice] if len(methods) > 1 else []),
        tolerance,
        *([step] if set(FIXED_STEP).intersection(methods) else []),
        longest,
        short,
    ]


def _fixed(of: Subject, role: str, text: str, start: Value, **more: Any) -> Variable:
    return Variable(
        of=of,
        role=role,
        causality="parameter",
        description=text,
        variability="fixed",
        initial="exact",
        start=start,
        **more,
    )


def _drives(eom: EquationsOfMotion, driven: list[str]) -> list[Variable]:
    """The inputs that are `driven`, with the rates of prescribed motions; the others keep their starts."""
    variables = []
    for i in eom.model.inputs:
        name = name_of(i.symbol)
        if name not in driven:
            continue
        estimated = i.rates == "estimated"
        text = i.description or f"input {name}"
        orders = (3 if i in eom.model.prescribed else 1) + (1 if estimated else 0)
        heads = ("", "rate of ", "second derivative of ", "third derivative of ")
        starts = (float(i.start), float(i.rate), 0.0, 0.0)
        unit = eom.units[name]
        for order in range(orders):
            given = order == 0 or not estimated
            tail = "" if given else ", estimated from its values at the communication points"
            variables.append(
                Variable(
                    of=Subject(names.VALUE, "", name, order),
                    role="input" if given else "estimate",
                    causality="input" if given else "local",
                    initial=None if given else "calculated",
                    description=f"{heads[order]}{text}{tail}",
                    start=starts[order],
                    unit=unit,
                    derivative_of=derivative(name, order - 1) if order and given else None,
                )
            )
            unit = unit.per_second()
    return variables


NOT_DIFFERENTIATED = (names.RESIDUAL, names.ERROR, names.STEPS, *names.COUNTS)


def differentiated(
    variables: Sequence[Variable], asked: Sequence[str], problems: list[str]
) -> list[tuple[Variable, Variable]]:
    """Each output with a parameter or start value by which its derivative is asked for, by these in order.

    What names nothing is added to `problems`.
    """
    of = {v.name: v for v in variables if _is_differentiable(v)}
    others = {v.name for v in variables} - of.keys()
    by = {v.name: v for v in variables if v.role in ("parameter", "start")}
    pairs: set[tuple[str, str]] = set()
    for text in asked:
        outputs, _, numbers = text.partition(":")
        wanted = listed(outputs)
        problems += [
            f"sensitivities: {name!r} is not differentiated: expected an output of the motion or of its "
            "events, or an extreme of one, but no residual or count, and no energy that frictions dissipate"
            for name in wanted
            if name in others
        ]
        known = [name for name in wanted if name not in others]
        rows = select(known, list(of), "sensitivities: the output", problems)
        rows = tuple(row for row in rows if _is_meant(row, known))
        columns = select(
            listed(numbers), list(by), "sensitivities: the parameter or start value", problems
        )
        pairs |= {(row, column) for row in rows for column in columns}
    rows_of = {name: k for k, name in enumerate(of)}
    columns_of = {name: k for k, name in enumerate(by)}
    ordered = sorted(pairs, key=lambda pair: (columns_of[pair[1]], rows_of[pair[0]]))
    return [(of[a], by[b]) for a, b in ordered]


def named(asked: Sequence[str]) -> set[str]:
    """The parameters and start values that are named, not meant by a pattern."""
    found = {number for text in asked for number in listed(text.partition(":")[2])}
    return {number for number in found if not {"*", "?"} & set(number)}


def _is_meant(output: str, asked: Sequence[str]) -> bool:
    """Not the time of an extreme by a pattern of everything: at a start from rest it has no derivative."""
    if not names.read(output).quantity.endswith("_time"):
        return True
    return bool(select([text for text in asked if text.startswith(names.PEAK)], [output], "", []))


def _is_differentiable(v: Variable) -> bool:
    """What is reported of the motion, and of its events; and their extremes."""
    if v.measured is not None:
        return _is_differentiable(v.measured)
    if v.of.quantity == names.DISSIPATED and v.variability == "continuous":
        return False  # the work of frictions is summed up, not integrated
    calculated = v.role in ("output", "start") and v.kind == "Real"
    return calculated and v.of.quantity not in NOT_DIFFERENTIATED


def variable_table(form: Form, scene: Scene) -> VariableTable:
    """All variables of the FMU.  Raises ModelError if names collide or a unit cannot be written."""
    table = _table(form, scene)
    if scene.reals_only:
        table = table.as_reals()
    problems = _collisions([v.name for v in table.variables])
    for v in table.variables:
        if v.unit is not None and any(e.denominator != 1 for e in v.unit.exponents):
            problems.append(
                f"the unit {v.unit.name} of {v.name!r} has fractional exponents, which FMI cannot "
                "express: write the constraint in another power"
            )
    if problems:
        raise ModelError(form.equations.model.name, problems)
    return table


def _table(form: Form, scene: Scene) -> VariableTable:
    eom, behind = form.equations, Dependencies(form)
    alone = not (scene.error_bars or scene.sensitivities or eom.estimated)
    loses = bool(eom.frictions) and alone
    outputs = Outputs(behind, loses)
    variables = [
        *_parameters(eom),
        *_solver_settings(scene),
        *_drives(eom, behind.inputs),
        *outputs.all(),
    ]
    if scene.error_bars:
        variables += outputs.error_bars(variables)
    measurable = VariableTable(tuple(variables), (), ()).measurable
    variables += outputs.peaks(measurable)
    variables += outputs.sensitivities(differentiated(variables, scene.sensitivities, []))
    shown = eom.model.display_units
    variables = [replace(v, display=_displayed(v, shown.get(v.of.coordinate))) for v in variables]
    states = outputs.behind.states
    if eom.moves_plainly:  # each coordinate with its velocity
        states = [derivative(str(q), k) for q in form.stepped.q for k in (0, 1)]
    derivatives = [names.rate_of(s) for s in states]
    if loses:
        states.append(names.DISSIPATED)
        derivatives.append(names.DISSIPATION)
    return VariableTable(tuple(variables), tuple(states), tuple(derivatives))


def _displayed(v: Variable, text: str | None) -> DisplayUnit | None:
    """The unit in which the model gives what the variable is of."""
    if text is None or v.unit is None:
        return None
    shown: DisplayUnit | None = parse_scaled(text, v.name)
    for _ in range(v.of.order):
        shown = None if shown is None else shown.per_second()
    return shown if shown is not None and shown.unit.same_dimension(v.unit) else None


def _collisions(known: Sequence[str]) -> list[str]:
    """What is wrong with these names: two that are the same, or a variable that is a group too."""
    problems = []
    seen = set()
    for name in known:
        if name in seen:
            problems.append(f"two variables of the FMU would be called {name!r}: rename one")
        seen.add(name)
    for name in sorted(seen):
        parts = name.split(".")
        for k in range(1, len(parts)):
            if ".".join(parts[:k]) in seen:
                problems.append(
                    f"{'.'.join(parts[:k])!r} would be a variable and a group: rename it"
                )
    return problems


INTERFACE = "interface"  # their role
IN_ARRAYS = (names.MULTIPLIER, names.FORCE, names.RESIDUAL)


def with_further(
    table: VariableTable,
    system: System,
    model: str,
    exchanged: bool,
    clocks: bool = False,
    arrays: bool = False,
    dae: bool = False,
) -> VariableTable:
    """The table with `time`; for model exchange (`exchanged`) with the event indicators of the system; with
    `dae` an equation for each multiplier, and the parameter that leaves them to the importer; with `clocks`,
    one for each contact and friction; with `arrays`, one for each unit of IN_ARRAYS.

    Raises ModelError, of `model`, if names collide.
    """
    contacts = [system.rows[k].name for k in system.contacts]
    frictions = [law.name for law in system.frictions]
    more = [_time()]
    if exchanged:
        known = [v.name for v in table.variables if v.causality == "input"]
        known += [*table.states, names.TIME]
        more += _indicators(contacts, len(system.switches), frictions, tuple(known))
    if dae:
        more += _equations(table, system)
    if clocks:
        more += [_clock(c, f"each impact, closing and departure of {c}") for c in contacts]
        more += [_clock(c, f"each start of sliding and of sticking of {c}") for c in frictions]
    if arrays:
        more += _arrays(table)
    found = replace(table, variables=(*table.variables, *more))
    if problems := _collisions([v.name for v in found.variables]):
        raise ModelError(model, problems)
    return found


def _of_interface(of: Subject, text: str, causality: str = "local", **more: object) -> Variable:
    fields: dict[str, object] = {"variability": "continuous", "initial": "calculated", **more}
    return Variable(of=of, role=INTERFACE, causality=causality, description=text, **fields)  # type: ignore[arg-type]


def _time() -> Variable:
    of = Subject(names.TIME)
    return _of_interface(of, "simulation time", "independent", initial=None, unit=SECOND)


def _indicators(
    contacts: Iterable[str], jumps: int, frictions: Iterable[str], known: tuple[str, ...]
) -> Iterator[Variable]:
    """In the order of runtime/simulation/indicators.h."""
    told = [(c, f"contact {c}: its multiplier while closed, its gap while open") for c in contacts]
    told += [(f"jump.{k + 1}", f"the surface of jump {k + 1} of the forces") for k in range(jumps)]
    for c in frictions:
        told.append((f"{c}.mode", f"friction {c}: reserve of its cone, or velocity of its slip"))
        told.append((f"{c}.normal", f"friction {c}: the normal force on which it slips"))
    for name, text in told:
        of = Subject(names.INDICATOR, name)
        yield _of_interface(of, f"event indicator of {text}", depends=known)


def _equations(table: VariableTable, system: System) -> Iterator[Variable]:
    """Of each multiplier; without a unit, which is that of an acceleration or, where the row does not act, of
    the multiplier."""
    for row in system.rows:
        of = Subject(names.EQUATION, row.name)
        text = f"what vanishes by the multiplier of {row.name}, in the continuous-time mode of DAE mode"
        yield _of_interface(of, text)
    text = "true: the importer solves for the multipliers (FMI-LS-DAE)"
    fields = {"kind": "Boolean", "variability": "fixed", "initial": None, "start": False}
    yield _of_interface(Subject(names.DAE), text, "structuralParameter", **fields)


def _clock(of: str, text: str) -> Variable:
    told = f"ticks at {text}"
    subject = Subject(names.CLOCK, of)
    return _of_interface(subject, told, "output", kind="Clock", variability="discrete")


def _arrays(table: VariableTable) -> Iterator[Variable]:
    """Outputs of one kind and unit, in the order of the table."""
    for quantity in IN_ARRAYS:
        units: dict[str, tuple[Unit, list[Variable]]] = {}
        for v in table.those(quantity):
            if (
                v.causality == "output"
                and v.unit is not None
                and not (v.of.constraint and v.of.coordinate)
            ):
                units.setdefault(v.unit.name, (v.unit, []))[1].append(v)
        for unit, members in units.values():
            of = Subject(quantity, unit.name if unit.name.isidentifier() else f"'{unit.name}'")
            text = ", ".join(v.name for v in members)
            yield _of_interface(
                of,
                f"array of {text}",
                "output",
                unit=unit,
                members=tuple(v.name for v in members),
                depends=_union(v.depends for v in members),
                depends_initially=_union(v.depends_initially for v in members),
            )


def _union(groups: Iterable[tuple[str, ...]]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(d for group in groups for d in group))
