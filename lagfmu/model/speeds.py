"""Speeds of a model's own (quasi-velocities): q' = B(q, t) v + b(q, t), with no more speeds than coordinates.

A coordinate that `kinematics` does not name has its own q' as speed.  Those that it names move by its
expressions, affine in the speeds; their own derivatives mean these expressions.  What is wrong with them,
and which of the coordinates are a unit quaternion, is found here.
"""

from __future__ import annotations

import random
from collections.abc import Iterator

import sympy as sp
from sympy.core.function import AppliedUndef

from .differential import Differential
from .dimensions import check_dimension
from .elements import Expr, ModelFields, plain
from .units import Unit


def quaternions(model: ModelFields) -> list[tuple[Expr, Expr, Expr, Expr]]:
    """The coordinates e0, e1, e2, e3 that are one after the other and whose kinematics keep their norm.

    Raises nothing; a norm that is kept to rounding is one that is kept at random rational points.
    """
    names = list(model.coordinates)
    found, k = [], 0
    while k + 4 <= len(names):
        four = names[k : k + 4]
        if all(q in model.kinematics for q in four) and _keeps_norm(model, four):
            found.append(tuple(four))
            k += 4
        else:
            k += 1
    return found


def _keeps_norm(model: ModelFields, four: list[Expr]) -> bool:
    rate = sum(q * sp.sympify(model.kinematics[q]) for q in four)
    symbols = sorted(rate.free_symbols | rate.atoms(AppliedUndef), key=str)
    generator = random.Random(7)
    for _ in range(3):
        at = {s: sp.Rational(generator.randint(-999, 999), 331) for s in symbols}
        if rate.xreplace(at) != 0:
            return False
    return True


def check_speeds(model: ModelFields, problems: list[str]) -> None:
    """What is wrong with the speeds and the kinematics, apart from units."""
    if not model.speeds and not model.kinematics and not model.unwrapped:
        return
    for q, expression in model.kinematics.items():
        if q not in model.coordinates:
            problems.append(f"kinematics give {plain(q)}, which is no coordinate of the model")
            continue
        problems += _of_rate(model, q, sp.sympify(expression))
        if _lags(model, sp.sympify(expression)) and model.energy_expression.has(q.diff()):
            problems.append(
                f"the energy holds the rate of {plain(q)}, which no speed moves: give it a speed, and a "
                "Nonholonomic constraint for what it follows"
            )
    used = {s for e in model.kinematics.values() for s in sp.sympify(e).atoms(AppliedUndef)}
    problems += [
        f"speed {plain(w)} moves nothing: say in `kinematics` which coordinates move by it"
        for w in model.speeds
        if w not in used
    ]
    for q, expression in model.unwrapped.items():
        if q not in model.kinematics:
            problems.append(
                f"unwrapped gives {plain(q)}, which has no entry in `kinematics`: say there how fast it grows"
            )
        problems += [
            f"unwrapped {plain(q)} holds the speed {plain(w)}, expected coordinates and parameters"
            for w in model.speeds
            if sp.sympify(expression).has(w)
        ]
    if len(model.directions) > len(model.coordinates):
        problems.append(
            f"there are {len(model.directions)} speeds and {len(model.coordinates)} coordinates, expected no "
            "more speeds: name in `kinematics` each coordinate that moves by them"
        )
    if model.embedding is not None:
        problems.append(
            "an embedding eliminates coordinates whose rates are their speeds: leave out either the "
            "embedding or `kinematics`"
        )


def _lags(model: ModelFields, rate: Expr) -> bool:
    """True of a rate that follows from coordinates alone."""
    present = rate.atoms(AppliedUndef)
    return bool(present & model.coordinates.keys()) and not present & model.speeds.keys()


def _of_rate(model: ModelFields, q: Expr, rate: Expr) -> Iterator[str]:
    what = f"kinematics of {plain(q)}"
    if rate.has(sp.Derivative):
        yield f"{what}: {plain(rate)} holds a derivative, expected coordinates and speeds"
        return
    present = rate.atoms(AppliedUndef) & model.speeds.keys()
    change = Differential({w: sp.Symbol(f"d {w}", real=True) for w in present})
    if change(rate).atoms(AppliedUndef) & present:
        yield f"{what}: {plain(rate)} is not affine in the speeds, expected B(q, t) v + b(q, t)"


def check_rates(model: ModelFields, units: dict[Expr, Unit], problems: list[str]) -> None:
    """The dimensions of the kinematics: [q]/s; of what is unwrapped: an angle."""
    for q, rate in model.kinematics.items():
        expected = units[q].per_second()
        what = f"kinematics of {plain(q)}"
        problems += check_dimension(sp.sympify(rate), expected, units, what)
    for q, angle in model.unwrapped.items():
        problems += check_dimension(sp.sympify(angle), units[q], units, f"unwrapped {plain(q)}")
