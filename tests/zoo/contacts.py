"""Systems whose contacts close together: what a user would try first."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sympy import Rational, cos, sin, sqrt, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Contact, Model, Parameter
from zoo import point_mass

G = 9.81
m, g, J, l = symbols("m g J l", positive=True)  # noqa: E741
e = symbols("e", nonnegative=True)
x, z, theta, phi = dynamicsymbols("x z theta phi")
GRAVITY = Parameter(g, G, "m/s^2")
MASS = Parameter(m, 1.0, "kg")


def restitution(value: float) -> Parameter:
    return Parameter(e, value, "1", min=0, max=1)


def rod(
    order: Sequence[int] = (0, 1), value: float = 0.5, inertia: float = 2.0, **start: float
) -> Model:
    """A rod of length 2 l with a foot at each end, its moment of inertia J larger than m l^2."""
    feet = [
        Contact("left", z - l * sin(theta), restitution=e),
        Contact("right", z + l * sin(theta), restitution=e),
    ]
    return point_mass(
        "Rod",
        "z",
        [feet[k] for k in order],
        angles="theta",
        up=z,
        energy=J * theta.diff() ** 2 / 2,
        parameters=[
            MASS,
            GRAVITY,
            Parameter(J, inertia, "kg.m^2"),
            Parameter(l, 1.0, "m"),
            restitution(value),
        ],
        start={z: start.get("z", 1.0), theta: start.get("theta", 0.0)},
    )


def table(order: Sequence[int] = (0, 1, 2, 3), value: float = 0.5) -> Model:
    """A square plate on four legs: one contact more than it has degrees of freedom."""
    legs = [
        Contact(f"leg{i}{j}", z + (2 * i - 1) * l * theta + (2 * j - 1) * l * phi, restitution=e)
        for i in (0, 1)
        for j in (0, 1)
    ]
    return point_mass(
        "Plate",
        "z",
        [legs[k] for k in order],
        angles="theta phi",
        up=z,
        energy=J * (theta.diff() ** 2 + phi.diff() ** 2) / 2,
        parameters=[
            MASS,
            GRAVITY,
            Parameter(J, 2.0, "kg.m^2"),
            Parameter(l, 0.5, "m"),
            restitution(value),
        ],
        start={z: 1.0},
    )


def wedge(order: Sequence[int] = (0, 1), value: float = 0.0, angle: float = 1.0) -> Model:
    """A particle above a V whose walls stand at `angle` [rad] from the vertical, one each side."""
    c, s = cos(Rational(angle)), sin(Rational(angle))
    walls = [
        Contact("left", x * c + z * s, restitution=e),
        Contact("right", -x * c + z * s, restitution=e),
    ]
    return point_mass(
        "Wedge",
        "x z",
        [walls[k] for k in order],
        up=z,
        parameters=[MASS, GRAVITY, restitution(value)],
        start={x: 0.0, z: 1.0},
    )


def cradle(
    count: int = 3, order: Sequence[int] | None = None, value: float = 1.0, mirrored: bool = False
) -> Model:
    """Equal balls on a line; the first comes with 1 m/s, the others touch each other at rest."""
    balls = dynamicsymbols(f"x0:{count}")
    d = symbols("d", positive=True)
    between = [
        Contact(f"c{k}", balls[k + 1] - balls[k] - d, restitution=e) for k in range(count - 1)
    ]
    start: dict[Any, float] = {ball: 0.1 * k for k, ball in enumerate(balls)}
    if mirrored:
        start |= {balls[-1]: 0.1 * (count - 1) + 0.5, balls[-1].diff(): -1.0}
    else:
        start |= {balls[0]: -0.5, balls[0].diff(): 1.0}
    return Model(
        name="Cradle",
        lagrangian=sum(m * ball.diff() ** 2 for ball in balls) / 2,
        coordinates=dict.fromkeys(balls, "m"),
        constraints=[between[k] for k in (order or range(count - 1))],
        parameters=[MASS, Parameter(d, 0.1, "m"), restitution(value)],
        start=start,
    )


def corner(order: Sequence[int] = (0, 1), value: float = 0.8, tilt: float = 0.0) -> Model:
    """A ball without weight that flies into a right-angled corner, its walls turned by `tilt` [rad]."""
    c, s = cos(Rational(tilt)), sin(Rational(tilt))
    walls = [
        Contact("floor", -x * s + z * c, restitution=e),
        Contact("wall", x * c + z * s, restitution=e),
    ]
    return point_mass(
        "InTheCorner",
        "x z",
        [walls[k] for k in order],
        parameters=[MASS, restitution(value)],
        start={x: 1 / sqrt(2), z: 1 / sqrt(2), x.diff(): -1.0, z.diff(): -1.0},
    )
