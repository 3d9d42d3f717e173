"""Small mechanical systems drawn at random: point masses in the plane on rods, springs and curves.

`drawn(number)` is the same model each time.  Nothing was done to make any of them well behaved: chains of up
to three masses, gravity, springs that are no line, damping, a force that is an input, a floor with or without
rebound, a rough one.  What is calibrated on them is judged elsewhere.
"""

from __future__ import annotations

import math

import numpy as np
from sympy import Symbol, cos, sqrt, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Contact,
    Friction,
    Holonomic,
    Input,
    Model,
    Nonholonomic,
    Parameter,
    Scene,
    multiplier,
)

g = symbols("g", positive=True)
FLOOR = -2.0  # m, height of the floor at the defaults


class Drawing:
    """A model on its way: what was drawn so far."""

    def __init__(self, number: int) -> None:
        self.chance = np.random.default_rng([20, number])
        self.parameters = [Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0)]
        self.coordinates, self.start, self.forces = {}, {}, {}
        self.constraints, self.inputs = [], []
        self.kinetic = self.potential = 0
        self.place = {None: (0.0, 0.0)}

    def parameter(self, name: str, value: float, unit: str) -> Symbol:
        """Another parameter."""
        symbol = symbols(name, positive=True)
        self.parameters.append(Parameter(symbol, value, unit, min=0))
        return symbol

    def mass(self, i: int) -> None:
        """Another mass, on a rod or a spring to the one before it (or to the origin), or on a curve."""
        r = self.chance
        x, y = dynamicsymbols(f"x{i} y{i}")
        m = self.parameter(f"m{i}", 10 ** r.uniform(-0.5, 0.5), "kg")
        before, length, angle = (
            self.place[i - 1 if i else None],
            r.uniform(0.4, 1.5),
            r.normal(0, 1),
        )
        here = (before[0] + length * math.sin(angle), before[1] - length * math.cos(angle))
        self.coordinates |= {x: "m", y: "m"}
        self.kinetic += m * (x.diff() ** 2 + y.diff() ** 2) / 2
        self.potential += m * g * y
        u, v = dynamicsymbols(f"x{i - 1} y{i - 1}") if i else (0, 0)
        kind = r.choice(["rod", "spring", "curve"], p=[0.45, 0.35, 0.2])
        if kind == "rod":
            L = self.parameter(f"L{i}", length, "m")
            self.constraints.append(Holonomic(f"rod{i}", (x - u) ** 2 + (y - v) ** 2 - L**2))
        elif kind == "spring":
            k = self.parameter(f"k{i}", 10 ** r.uniform(1, 2.5), "N/m")
            L = self.parameter(f"L{i}", length, "m")
            self.potential += k * (sqrt((x - u) ** 2 + (y - v) ** 2) - L) ** 2 / 2
        else:
            a = self.parameter(f"a{i}", r.uniform(0.2, 2), "1/m")
            b = self.parameter(f"b{i}", r.uniform(0.05, 0.3), "m")
            c = self.parameter(f"c{i}", r.uniform(1, 4), "1/m")
            here = (here[0], 0.0)
            height = lambda x, a, b, c, cosine: a * x**2 / 2 - b * cosine(c * x)  # noqa: E731
            value = [p.value for p in self.parameters[-3:]]
            here = (here[0], float(height(here[0], *value, math.cos)))
            self.constraints.append(Holonomic(f"curve{i}", y - height(x, a, b, c, cos)))
        if r.random() < 0.4:
            d = self.parameter(f"d{i}", 10 ** r.uniform(-1.5, 0.3), "N.s/m")
            self.forces |= {x: -d * x.diff(), y: -d * y.diff()}
        self.place[i] = here
        self.start |= {x: here[0], y: here[1], x.diff(): 0.0, y.diff(): 0.0}
        if kind == "spring" and r.random() < 0.6:
            self.floor(i, x, y)

    def floor(self, i: int, x: Symbol, y: Symbol) -> None:
        """What the mass may fall on, rough or with rebound."""
        r = self.chance
        H = self.parameter(f"H{i}", max(-FLOOR, 0.3 - self.place[i][1]), "m")
        rebound = (0, 0.3, 0.8)[r.integers(3)]
        self.constraints.append(Contact(f"floor{i}", y + H, restitution=rebound))
        if rebound or r.random() < 0.5:
            return
        mu = self.parameter(f"mu{i}", r.uniform(0.05, 0.6), "1")
        self.constraints += [
            Nonholonomic(f"rub{i}", x.diff()),
            Friction(f"grip{i}", of=[f"rub{i}"], normal=multiplier(f"floor{i}"), static=mu),
        ]

    def push(self) -> None:
        """A force that is an input."""
        F = dynamicsymbols("F")
        x = next(iter(self.coordinates))
        self.forces[x] = self.forces.get(x, 0) + F
        self.inputs.append(Input(F, "N", 0.0))


def drawn(number: int) -> tuple[Model, Scene]:
    """A model and the scene in which it runs."""
    it = Drawing(number)
    for i in range(int(it.chance.integers(1, 4))):
        it.mass(i)
    if it.chance.random() < 0.25:
        it.push()
    model = Model(
        name=f"Drawn{number}",
        lagrangian=it.kinetic - it.potential,
        forces=it.forces,
        coordinates=it.coordinates,
        constraints=it.constraints,
        parameters=it.parameters,
        inputs=it.inputs,
        start=it.start,
    )
    step = float(10 ** it.chance.uniform(-2, -1))
    return model, Scene(f"Drawn{number}", stop_time=4.0, step_size=step)
