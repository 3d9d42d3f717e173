"""Linkages of uniform rods in the coordinates of their ends, for tests of starts and of projections."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

from sympy import S, cos, sin, sqrt, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Holonomic, Model, Parameter
from lagfmu.bodies import Body, Ground, Revolute, mechanism
from zoo import point_mass

TIME = dynamicsymbols._t


def rods(name: str, joints: Sequence[tuple[float, float]]) -> Model:
    """Uniform rods of 1 kg from the origin through the joints, whose last is held; lengths are the
    joints' distances.  Coordinates x1, y1, ... [m], held by x = D, y = E."""
    n = len(joints)
    x, y = dynamicsymbols(f"x1:{n + 1}"), dynamicsymbols(f"y1:{n + 1}")
    m, g = symbols("m g", positive=True)
    lengths = symbols(f"L1:{n + 1}", positive=True)
    D, E = symbols("D E", real=True)
    ends = [(S.Zero, S.Zero), *zip(x, y, strict=True)]
    pairs = list(itertools.pairwise(ends))
    kinetic = S.Zero
    for a, b in pairs:  # m/6 (va . va + va . vb + vb . vb)
        for p, q in zip(a, b, strict=True):
            u, w = p.diff(TIME), q.diff(TIME)
            kinetic += m / 6 * (u**2 + u * w + w**2)
    height = sum((a[1] + b[1]) / 2 for a, b in pairs)
    constraints = [
        Holonomic(f"rod{k}", (b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 - L**2)
        for k, ((a, b), L) in enumerate(zip(pairs, lengths, strict=True), 1)
    ]
    constraints += [Holonomic("endx", x[-1] - D), Holonomic("endy", y[-1] - E)]
    places = [(0.0, 0.0), *joints]
    spans = [
        ((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2) ** 0.5 for a, b in itertools.pairwise(places)
    ]
    start = {}
    for a, b, (at_x, at_y) in zip(x, y, joints, strict=True):
        start |= {a: at_x, b: at_y}
    return Model(
        name=name,
        lagrangian=kinetic - m * g * height,
        coordinates=dict.fromkeys((*x, *y), "m"),
        constraints=constraints,
        parameters=[
            Parameter(m, 1.0, "kg"),
            Parameter(g, 9.81, "m/s^2"),
            Parameter(D, joints[-1][0], "m"),
            Parameter(E, joints[-1][1], "m"),
            *(Parameter(L, span, "m") for L, span in zip(lengths, spans, strict=True)),
        ],
        start=start,
    )


FOUR_BAR = ((0.5, 0.75**0.5), (1.9, 1.6), (2.2, 0.0))


def hinged(n: int, axes: str) -> Model:
    """n links of 1 m in space that hang straight down, hinged one on the other about these axes by turns: J0,
    J1, ..., b0, b1, ..."""
    above = Ground().at((0, 0, 0))
    links = [Body(f"b{k}", 1.0, (0.02, 0.03, 0.01)) for k in range(n)]
    joints, start = [], {}
    for k, link in enumerate(links):
        joints.append(Revolute(f"J{k}", above, link.at((0, 0, 0.5)), axis=axes[k % len(axes)]))
        above = link.at((0, 0, -0.5))
        start[f"{link.name}.position"] = (0, 0, -0.5 - k)
    return mechanism(f"Hinged{n}", bodies=links, joints=joints, start=start)


def pinned_rod(start: Mapping[Any, float]) -> Model:
    """A uniform rod on a pivot in a vertical plane, in its angle and the place of its middle."""
    x, y, theta = dynamicsymbols("x y theta")
    m, length = symbols("m l", positive=True)
    return point_mass(
        "PinnedRod",
        "x y",
        [
            Holonomic("pinx", x - length / 2 * cos(theta)),
            Holonomic("piny", y - length / 2 * sin(theta)),
        ],
        angles="theta",
        up=y,
        energy=m * length**2 * theta.diff() ** 2 / 24,
        parameters=[Parameter(length, 1.5, "m")],
        start=start,
    )


def straight_line(turned: float) -> Model:
    """Peaucellier's linkage: arms of 3 m from the origin O to B and C, a rhombus P B Q C of 1.5 m, and P on a
    circle of 1 m through O: Q moves straight, across the line from O to the circle's centre.  The frame is
    `turned` by an angle [rad]; gravity pulls along that straight."""
    coordinates = dynamicsymbols("xp yp xb yb xc yc xq yq")
    c, s = float(cos(turned)), float(sin(turned))
    points = [  # in the linkage's own frame
        (x * c - y * s, x * s + y * c) for x, y in zip(*[iter(coordinates)] * 2, strict=True)
    ]
    p, b, q_c, q = points
    m, g, length = symbols("m g r", positive=True)
    kinetic = sum(m * x.diff(TIME) ** 2 / 2 for x in coordinates)
    lean = 0.3  # rad, of P seen from the origin
    near = 2 * float(cos(lean))
    far = (3.0**2 - 1.5**2) / near
    along, across = (near + far) / 2, (9 - ((near + far) / 2) ** 2) ** 0.5
    ray, normal = (float(cos(lean)), float(sin(lean))), (-float(sin(lean)), float(cos(lean)))

    def at(u: float, w: float) -> tuple[float, float]:
        return (u * ray[0] + w * normal[0], u * ray[1] + w * normal[1])

    places = [at(near, 0), at(along, across), at(along, -across), at(far, 0)]
    start: dict[Any, float] = {}
    for k, (x, y) in enumerate(places):
        start |= {coordinates[2 * k]: x * c + y * s, coordinates[2 * k + 1]: -x * s + y * c}
    centre, origin = (length, 0), (0, 0)
    bars = [
        ("circle", p, centre, 1),
        ("arm1", b, origin, 3),
        ("arm2", q_c, origin, 3),
        *((f"side{k}", u, w, 1.5) for k, (u, w) in enumerate(((p, b), (p, q_c), (q, b), (q, q_c)))),
    ]
    return Model(
        name="StraightLine",
        lagrangian=kinetic - m * g * sum(point[1] for point in points),
        coordinates=dict.fromkeys(coordinates, "m"),
        constraints=[
            Holonomic(name, (u[0] - w[0]) ** 2 + (u[1] - w[1]) ** 2 - (k * length) ** 2)
            for name, u, w, k in bars
        ],
        parameters=[
            Parameter(m, 1.0, "kg"),
            Parameter(g, 9.81, "m/s^2"),
            Parameter(length, 1.0, "m"),
        ],
        start=start,
    )


SET_OUT = {"angle.A": 0.3, "der(angle.A)": -2.0, "angle.B": 0.5}


def cart_arm() -> Model:
    """A pendulum of two links on a cart that nothing holds, in space."""
    bodies = [Body(n, 1.0, (0.02, 0.01, 0.03)) for n in ("cart", "upper", "lower")]
    cart, upper, lower = bodies
    joints = [
        Revolute("A", cart.at((0.1, 0, 0)), upper.at((-0.2, 0, 0)), axis="y"),
        Revolute("B", upper.at((0.2, 0, 0)), lower.at((0, 0.3, 0)), axis="z"),
    ]
    return mechanism("CartArm", bodies=bodies, joints=joints, start=SET_OUT)


def isosceles() -> Model:
    """Slider-crank whose crank and rod are equally long: f = x (x - 2 r cos phi) is zero on two branches,
    which cross at phi = pi/2, x = 0, where df = 0."""
    phi, x = dynamicsymbols("phi x")
    J, m, r = symbols("J m r", positive=True)
    return Model(
        name="Isosceles",
        lagrangian=J * phi.diff() ** 2 / 2 + m * x.diff() ** 2 / 2,
        coordinates={phi: "rad", x: "m"},
        constraints=[Holonomic("rod", (x - r * cos(phi)) ** 2 + (r * sin(phi)) ** 2 - r**2)],
        parameters=[Parameter(J, 1.0, "kg.m^2"), Parameter(m, 1.0, "kg"), Parameter(r, 0.5, "m")],
        start={phi: 0.25, x: math.cos(0.25), phi.diff(): 1.0, x.diff(): -math.sin(0.25)},
    )


def parallelogram() -> Model:
    """Four-bar with a coupler as long as the frame: it can turn into the anti-parallelogram where all bars
    lie on one line (phi = 0): there the two rows of G depend on each other."""
    phi, theta, psi = dynamicsymbols("phi theta psi")
    J, r = symbols("J r", positive=True)
    return Model(
        name="Parallelogram",
        lagrangian=J * (phi.diff() ** 2 + theta.diff() ** 2 + psi.diff() ** 2) / 2,
        coordinates={phi: "rad", theta: "rad", psi: "rad"},
        constraints=[
            Holonomic("along", r * cos(phi) + 2 * r * cos(theta) - r * cos(psi) - 2 * r),
            Holonomic("across", r * sin(phi) + 2 * r * sin(theta) - r * sin(psi)),
        ],
        parameters=[Parameter(J, 1.0, "kg.m^2"), Parameter(r, 0.5, "m")],
        start={phi: -0.5, theta: 0.0, psi: -0.5, phi.diff(): 1.0, psi.diff(): 1.0},
    )


def four_points(again: bool) -> Model:
    """The parallelogram as two points on cranks and a coupler, under gravity, turning over and over.
    `again`: the length of a crank is said twice, by its square and by itself."""
    xs, ys = dynamicsymbols("x1:3"), dynamicsymbols("y1:3")
    m, g, r, L = symbols("m g r L", positive=True)
    speeds = [a.diff() ** 2 + b.diff() ** 2 for a, b in zip(xs, ys, strict=True)]
    a, w = -0.5, 9.0
    at = {
        xs[0]: math.cos(a) / 2,
        xs[1]: 1 + math.cos(a) / 2,
        ys[0]: math.sin(a) / 2,
        ys[1]: math.sin(a) / 2,
    }
    rates = {q.diff(): w / 2 * (-math.sin(a) if q in xs else math.cos(a)) for q in (*xs, *ys)}
    return Model(
        name="FourPointsAgain" if again else "FourPoints",
        lagrangian=m * (speeds[0] + 2 * speeds[1]) / 2 - m * g * (ys[0] + 2 * ys[1]),
        coordinates=dict.fromkeys((*xs, *ys), "m"),
        constraints=[
            Holonomic("crank", xs[0] ** 2 + ys[0] ** 2 - r**2),
            Holonomic("coupler", (xs[1] - xs[0]) ** 2 + (ys[1] - ys[0]) ** 2 - L**2),
            Holonomic("rocker", (xs[1] - L) ** 2 + ys[1] ** 2 - r**2),
            *([Holonomic("again", sqrt(xs[0] ** 2 + ys[0] ** 2) - r)] if again else []),
        ],
        parameters=[
            Parameter(m, 1.0, "kg"),
            Parameter(g, 9.81, "m/s^2"),
            Parameter(r, 0.5, "m"),
            Parameter(L, 1.0, "m"),
        ],
        start=at | rates,
    )
