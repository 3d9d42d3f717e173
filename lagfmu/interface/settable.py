"""Variables that the importer sets, besides start values: parameters, solver settings, inputs."""

from __future__ import annotations

from typing import Any

from .. import names
from ..mechanics.equations import EquationsOfMotion
from ..methods import FIXED_STEP, described
from ..model.model import name_of
from ..model.scene import Scene
from ..model.units import ONE, SECOND
from ..names import Subject, derivative
from ..numeric.thresholds import LARGEST_TOLERANCE
from ..numeric.tolerance import MAXIMUM_STEPS
from .variables import Value, Variable


def parameters(eom: EquationsOfMotion) -> list[Variable]:
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


def solver_settings(scene: Scene) -> list[Variable]:
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


def drives(eom: EquationsOfMotion, driven: list[str]) -> list[Variable]:
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
