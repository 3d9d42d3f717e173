"""Mechanisms in space, by Newton and Euler: redundant ones, a governor, a platform, a suspension."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from linkage import Linkage, Point, Spring, Tie
from rigid import Mass, Vector
from system import System


def bar(m: float, a: Point, b: Point, thick: float = 0.1) -> tuple[Mass, Point]:
    """A uniform bar of round section between two places: its mass, inertia, and centre."""
    d = np.subtract(b, a)
    L2 = float(d @ d)
    e = d / np.sqrt(L2)
    across = m * (L2 / 12 + thick**2 / 4)
    J = across * (np.eye(3) - np.outer(e, e)) + m * thick**2 / 2 * np.outer(e, e)
    return Mass(m, J), (np.add(a, b) / 2).tolist()


def door() -> Linkage:
    """A door on two hinges, one above the other on a line that leans: five of ten rows are redundant."""
    lean = (0.0, np.sin(0.3), np.cos(0.3))
    low, high = np.multiply(0.2, lean), np.multiply(1.7, lean)
    mass = Mass.of(20.0, 6.0, 8.0, 2.2, 0.1, 0.2, -0.3)
    return Linkage(
        "Door",
        {"leaf": (mass, (0.4, 0.25, 0.9))},
        {
            "lower": Tie("hinge", "ground", "leaf", low.tolist(), lean),
            "upper": Tie("hinge", "ground", "leaf", high.tolist(), lean),
        },
        {"leaf": np.multiply(1.5, lean).tolist()},
    )


def cardan() -> Linkage:
    """Two shafts at 0.6 rad by a universal joint; a hinge and a ball bear them: of 12 rows 11 count."""
    way = (np.cos(0.6), 0.0, np.sin(0.6))
    cross, end = (0.5, 0.0, 0.0), np.add((0.5, 0.0, 0.0), np.multiply(0.8, way))
    driven, center = bar(3.0, cross, end.tolist())
    return Linkage(
        "Cardan",
        {
            "driving": (Mass.of(4.0, 0.02, 0.12, 0.11, 0.003, 0.0, -0.002), (0.25, 0.02, 0.01)),
            "driven": (driven, np.add(center, (0.0, 0.03, 0.0)).tolist()),
        },
        {
            "A": Tie("hinge", "ground", "driving", (0.0, 0.0, 0.0), (1, 0, 0)),
            "U": Tie("universal", "driving", "driven", cross, (0, 1, 0), (), (-way[2], 0, way[0])),
            "B": Tie("ball", "driven", "ground", end.tolist()),
        },
        {"driving": (8.0, 0.0, 0.0)},
    )


def governor() -> Linkage:
    """A flyball governor: a shaft, two arms that hang on it unlike, a sleeve that two rods lift, a spring."""
    top, sleeve = (0.0, 0.0, 1.0), (0.0, 0.0, 0.5)
    bodies = {
        "shaft": (Mass.of(3.0, 0.3, 0.3, 0.02), (0.0, 0.0, 0.6)),
        "sleeve": (Mass.of(1.0, 0.004, 0.004, 0.006), sleeve),
    }
    ties = {
        "bearing": Tie("hinge", "ground", "shaft", (0.0, 0.0, 0.0), (0, 0, 1)),
        "guide": Tie("slide", "shaft", "sleeve", sleeve, (0, 0, 1)),
    }
    for name, side, ball in (("left", -1, 1.0), ("right", 1, 1.2)):
        hung, end = (0.05 * side, 0.0, 1.0), (0.45 * side, 0.0, 0.6)
        middle = tuple(np.add(hung, end) / 2)
        mass, center = bar(ball, hung, np.add(end, np.subtract(end, hung)).tolist(), 0.05)
        bodies[name] = (mass, center)
        ties[f"{name}.hinge"] = Tie("hinge", "shaft", name, hung, (0, 1, 0))
        ties[f"{name}.rod"] = Tie("rod", name, "sleeve", middle, (), (0.05 * side, 0.0, 0.5))
    return Linkage(
        "Governor",
        bodies,
        {k.replace(".", "_"): tie for k, tie in ties.items()},
        {"shaft": (0.0, 0.0, 6.0)},
        springs=[Spring("shaft", "sleeve", top, sleeve, 400.0, 0.45)],
    )


def four_bar() -> Linkage:
    """A four-bar linkage that is plane, on four hinges in space: of 20 rows 17 count."""
    places = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.3), (0.8, 0.0, 0.6), (0.7, 0.0, 0.0))
    names = ("ground", "crank", "coupler", "rocker", "ground")
    return Linkage(
        "FourBar",
        {names[k]: bar(m, places[k - 1], places[k]) for k, m in ((1, 1.0), (2, 3.0), (3, 2.0))},
        {
            joint: Tie("hinge", names[k], names[k + 1], places[k], (0, 1, 0))
            for k, joint in enumerate("ABCD")
        },
        {"crank": (0.0, 5.0, 0.0)},
    )


def bricard() -> Linkage:
    """Bricard's linkage of six right angles along the edges of a cube: one motion, of 30 rows 29 count."""
    ends = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 1, 1], [0, 1, 1], [0, 0, 1]], dtype=float)
    ways = np.roll(ends, -1, axis=0) - ends
    names = ["ground", "bar1", "bar2", "bar3", "bar4", "bar5", "ground"]
    bodies = {f"bar{k}": bar(1.0, ends[k], ends[(k + 1) % 6]) for k in range(1, 6)}
    ties = {}
    for k in range(6):  # the joint at the end of the k-th edge
        axis = np.cross(ways[k], ways[(k + 1) % 6])
        ties[f"J{k}"] = Tie(
            "hinge", names[k], names[k + 1], ends[(k + 1) % 6].tolist(), axis.tolist()
        )
    return Linkage("Bricard", bodies, ties, {"bar1": (0.0, 0.0, 1.0)})


def bennett() -> Linkage:
    """Bennett's linkage: four hinges on skew axes, sin(alpha)/a = sin(beta)/b; of 20 rows 17 count."""
    a, b, alpha = 1.0, 0.7, 0.9
    beta = np.arcsin(b / a * np.sin(alpha))
    first = 1.1
    second = 2 * np.arctan(
        np.sin((beta + alpha) / 2) / np.sin((beta - alpha) / 2) / np.tan(first / 2)
    )
    frames = [np.eye(4)]
    for turn, length, twist in (
        (first, a, alpha),
        (second, b, beta),
        (-first, a, alpha),
        (-second, b, beta),
    ):
        frames.append(frames[-1] @ _turn(2, turn) @ _move(length) @ _turn(0, twist))
    assert np.allclose(frames[4], np.eye(4), atol=1e-14), frames[4]
    places, axes = [f[:3, 3] for f in frames], [f[:3, 2] for f in frames]
    names = ["ground", "crank", "coupler", "rocker", "ground"]
    # the link from frame k to frame k + 1 is rigid; link 4 (from frame 3 back to frame 0) is the ground
    bodies = {
        name: bar(m, places[k], places[k + 1])
        for k, (name, m) in enumerate((("crank", 1.0), ("coupler", 2.0), ("rocker", 1.5)))
    }
    ties = {
        f"J{k}": Tie("hinge", names[k], names[k + 1], places[k].tolist(), axes[k].tolist())
        for k in range(4)
    }
    return Linkage("Bennett", bodies, ties, {"crank": (4.0 * axes[0]).tolist()})


def _turn(axis: int, angle: float) -> Vector:
    found = np.eye(4)
    i, k = (1, 2) if axis == 0 else (0, 1)
    c, s = np.cos(angle), np.sin(angle)
    found[[i, i, k, k], [i, k, i, k]] = c, -s, s, c
    return found


def _move(length: float) -> Vector:
    found = np.eye(4)
    found[0, 3] = length
    return found


def stewart() -> Linkage:
    """Stewart's platform on five rods and a spring."""
    feet = np.array([k * 2 * np.pi / 3 + s * np.pi / 12 for k in range(3) for s in (-1, 1)])
    heads = feet + np.tile([-1, 1], 3) * (np.pi / 3 - np.pi / 18 - np.pi / 12)
    ground = np.stack([0.7 * np.cos(feet), 0.7 * np.sin(feet), 0 * feet], axis=1)
    plate = np.stack([0.35 * np.cos(heads), 0.35 * np.sin(heads), 0.8 + 0 * heads], axis=1)
    legs = [*zip(ground.tolist(), plate.tolist(), strict=True)]
    return Linkage(
        "Platform",
        {"plate": (Mass.of(12.0, 0.4, 0.5, 0.8, 0.02, -0.03, 0.01), (0.02, -0.01, 0.83))},
        {
            f"leg{k}": Tie("rod", "ground", "plate", foot, (), head)
            for k, (foot, head) in enumerate(legs[:5], 1)
        },
        {"plate": (0.0, 0.0, 0.5)},
        springs=[Spring("ground", "plate", *legs[5], 3000.0, 0.8)],
    )


def wishbone() -> Linkage:
    """A double wishbone suspension: two triangular arms, an upright with its wheel, a tie rod, a spring."""
    low, high = (0.0, 0.45, 0.20), (0.05, 0.40, 0.55)
    lower = Mass.of(4.0, 0.05, 0.03, 0.07, 0.002, 0.0, -0.004)
    upper = Mass.of(2.0, 0.02, 0.012, 0.027, -0.001, 0.002, 0.0)
    upright = Mass.of(25.0, 0.6, 0.9, 0.6, 0.01, 0.02, -0.03)
    return Linkage(
        "Wishbone",
        {
            "lower": (lower, (0.01, 0.25, 0.21)),
            "upper": (upper, (0.04, 0.28, 0.54)),
            "upright": (upright, (0.02, 0.50, 0.36)),
        },
        {
            "A": Tie("hinge", "ground", "lower", (0.0, 0.10, 0.22), (1.0, 0.05, 0.02)),
            "B": Tie("hinge", "ground", "upper", (0.03, 0.15, 0.52), (1.0, -0.04, 0.03)),
            "C": Tie("ball", "lower", "upright", low),
            "D": Tie("ball", "upper", "upright", high),
            "tie": Tie("rod", "ground", "upright", (-0.12, 0.12, 0.27), (), (-0.13, 0.43, 0.26)),
        },
        {"upright": (-1.5, 0.0, 0.0)},
        springs=[Spring("ground", "lower", (0.02, 0.22, 0.62), (0.01, 0.33, 0.22), 25000.0, 0.43)],
    )


LINKAGES = (door, four_bar, cardan, governor, bricard, bennett, stewart, wishbone)


def _system(make: Callable[[], Linkage]) -> Callable[[], System]:
    def system() -> System:
        return make().system(0.4)

    system.__name__ = make.__name__
    return system


SYSTEMS = [_system(make) for make in LINKAGES]
