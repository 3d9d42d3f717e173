"""Models that cross features: a disk of four coordinates, to which each feature of a table adds its part.

m, J; x, y, z its centre [m], phi its turn about y [rad]; gravity against z. Each feature is a function of the
parts of a model; `model(features)` puts them together, with an output `drive`, the power of all forces that
are no part of the Lagrangian; `pairs()` are all pairs that can be, and `covering()` few models among which
every pair stands in one at least.
"""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

from sympy import Heaviside, cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Contact,
    Friction,
    Holonomic,
    Input,
    Model,
    Nonholonomic,
    Output,
    Parameter,
    Scene,
    Spline,
    multiplier,
)

t = dynamicsymbols._t
x, y, z, phi, F, P, u = dynamicsymbols("x y z phi F P u")
m, J, g, r, d, k = symbols("m J g r d k", positive=True)
mu = symbols("mu", nonnegative=True)
KNOTS = [j / 2 - 4 for j in range(40)]
GROUND = Spline("ground", KNOTS, [0.02 * math.sin(2 * a) for a in KNOTS], "m", "m")
BRAKE = Spline("brake", [-30.0, -1.0, 0.0, 1.0, 30.0], [-2.0, -0.8, 0.0, 0.8, 2.0], "m/s", "N")


@dataclass
class Parts:
    """What a model is made of, so far; `ground`: the height of what is below z; `rests`: of unilateral floor;
    `bounces`: its restitution."""

    ground: Any = 0
    unilateral: bool = False
    bounces: Any = 0
    forces: dict[Any, Any] = field(default_factory=dict)
    rows: list[Any] = field(default_factory=list)
    inputs: list[Input] = field(default_factory=list)
    outputs: list[Output] = field(default_factory=list)
    start: dict[Any, Any] = field(default_factory=dict)
    formulation: str | None = None

    def push(self, q: Any, force: Any) -> None:
        """One more force on a coordinate."""
        self.forces[q] = self.forces.get(q, 0) + force


def _force(p: Parts) -> None:
    p.inputs += [Input(F, "N", start=1.0), Input(P, "N")]
    p.push(x, F)
    p.push(z, P)


def _contact(p: Parts) -> None:
    p.unilateral = True


def _bounce(p: Parts) -> None:
    p.unilateral, p.bounces = True, 0.5
    p.start[z] = 0.1


def _friction(p: Parts) -> None:
    p.rows += [
        Nonholonomic("rub", x.diff()),
        Friction("grip", of=["rub"], normal=multiplier("floor"), static=mu, kinetic=0.8 * mu),
    ]


def _friction_in_two_rows(p: Parts) -> None:
    p.rows += [
        Nonholonomic("rub_x", x.diff()),
        Nonholonomic("rub_y", y.diff()),
        Friction("grip", of=["rub_x", "rub_y"], normal=multiplier("floor"), static=mu),
    ]


def _guide(p: Parts) -> None:
    p.rows += [
        Holonomic("guide", y),
        Nonholonomic("slide", x.diff()),
        Friction("rail", of=["slide"], normal=multiplier("guide"), static=0.5 * mu),
    ]
    p.push(y, -2 * k * d)  # pressed against it


def _motion(p: Parts) -> None:
    p.inputs.append(Input(u, "m"))
    p.ground += u


def _estimated(p: Parts) -> None:
    p.inputs.append(Input(u, "m", rates="estimated"))
    p.ground += u


def _spline(p: Parts) -> None:
    p.ground += GROUND(x)


def _brake(p: Parts) -> None:
    p.push(x, -BRAKE(x.diff()))


def _rheonomic(p: Parts) -> None:
    p.ground += 0.01 * r * sin(9 * t * symbols("w", positive=True))


def _jump(p: Parts) -> None:
    # away from its surface: one that holds a motion there is no jump
    p.push(x, k * d * Heaviside(x - d))


def _blade(p: Parts) -> None:
    p.rows.append(Nonholonomic("blade", x.diff() * sin(phi) - y.diff() * cos(phi)))
    p.start |= {phi: 0.5, y.diff(): math.tan(0.5)}


def _redundant(p: Parts) -> None:
    p.rows += [Holonomic("bar", y), Holonomic("other_bar", 2 * y)]


def _rolls(p: Parts) -> None:
    p.rows.append(Nonholonomic("rolls", x.diff() - r * phi.diff(), while_closed="floor"))
    p.start[phi.diff()] = 5.0


def _nullspace(p: Parts) -> None:
    p.formulation = "nullspace"


def _outputs(p: Parts) -> None:
    p.outputs += [
        Output("push", multiplier("floor"), "N"),
        Output("work", x.diff() * z.diff(t, 2), "m^2/s^3"),
    ]


FEATURES: dict[str, Callable[[Parts], None]] = {
    "force": _force,
    "contact": _contact,
    "bounce": _bounce,
    "friction": _friction,
    "two rows": _friction_in_two_rows,
    "guide": _guide,
    "motion": _motion,
    "estimated": _estimated,
    "spline": _spline,
    "brake": _brake,
    "rheonomic": _rheonomic,
    "jump": _jump,
    "blade": _blade,
    "redundant": _redundant,
    "rolls": _rolls,
    "nullspace": _nullspace,
    "outputs": _outputs,
}
NEVER = {  # two that stand in each other's place, or that no mechanism has together
    ("contact", "bounce"): "a bounce is a contact",
    ("friction", "two rows"): "one friction of the floor",
    ("motion", "estimated"): "one motion of the floor",
    ("guide", "redundant"): "both hold y",
    ("friction", "rolls"): "both hold the contact point",
    ("two rows", "rolls"): "both hold the contact point",
    ("two rows", "guide"): "both hold y, and a friction's row that is held by another is none",
    ("two rows", "redundant"): "both hold y",
    ("blade", "two rows"): "a blade that lies across a rough floor holds one of its rows",
    ("blade", "redundant"): "x is held as well",
    ("blade", "guide"): "x is held as well",
    ("nullspace", "redundant"): "nullspace needs independent rows",
}


def together(features: Iterable[str]) -> bool:
    """Whether a model can have them all."""
    return not any({*pair} <= set(features) for pair in NEVER)


def pairs() -> list[tuple[str, ...]]:
    """Every pair that can be."""
    return [p for p in itertools.combinations(FEATURES, 2) if together(p)]


@cache
def covering() -> list[tuple[str, ...]]:
    """Few sets of features: each pair stands in one of them at least."""
    chance, left, found = random.Random(3), set(pairs()), []
    while left:
        best: tuple[str, ...] = ()
        for _ in range(60):
            order = list(FEATURES)
            chance.shuffle(order)
            chosen = list(chance.choice(sorted(left)))
            for f in order:
                if f not in chosen and together([*chosen, f]):
                    chosen.append(f)
            one = tuple(f for f in FEATURES if f in chosen)
            best = max(best, one, key=lambda s: len(left & {*itertools.combinations(s, 2)}))
        found.append(best)
        left -= {*itertools.combinations(best, 2)}
    return found


def model(features: Iterable[str]) -> tuple[Model, Scene]:
    """The model of these features, and the scene of its default experiment."""
    parts, chosen = Parts(), list(features)
    if {"rolls"} & set(chosen):
        parts.unilateral = True
    for name in chosen:
        FEATURES[name](parts)
    floor = z - parts.ground
    kind = replace(Contact("floor", floor), restitution=parts.bounces)
    rows = [kind if parts.unilateral else Holonomic("floor", floor), *parts.rows]
    w = symbols("w", positive=True)
    known = {m: "kg", J: "kg*m^2", g: "m/s^2", r: "m", d: "m", k: "N/m", mu: "1", w: "1/s"}
    values = {m: 1.0, J: 0.02, g: 9.81, r: 0.2, d: 0.1, k: 20.0, mu: 0.3, w: 1.0}
    lagrangian = (
        m * (x.diff() ** 2 + y.diff() ** 2 + z.diff() ** 2) / 2
        + J * phi.diff() ** 2 / 2
        - m * g * z
    )
    power = sum(force * q.diff() for q, force in parts.forces.items())
    outputs = [*parts.outputs, *([Output("drive", power, "W")] if power else [])]
    used = [e.free_symbols for e in (lagrangian, *parts.forces.values())]
    for row in rows:
        parts_of = [row.static, row.sliding] if isinstance(row, Friction) else [row.expression]
        used += [e.free_symbols for e in parts_of]
    name = "".join(f.title().replace(" ", "") for f in chosen) or "Disk"
    start = {x: 0.0, y: 0.0, z: 0.0, phi: 0.1, x.diff(): 1.0, phi.diff(): 2.0}
    return (
        Model(
            name=name,
            lagrangian=lagrangian,
            coordinates={x: "m", y: "m", z: "m", phi: "rad"},
            forces=parts.forces,
            constraints=rows,
            parameters=[
                Parameter(s, values[s], unit)
                for s, unit in known.items()
                if s in set().union(*used)
            ],
            inputs=parts.inputs,
            outputs=outputs,
            start=start | parts.start,
        ),
        Scene(name[:60], parts.formulation, stop_time=1.0, step_size=0.02),
    )
