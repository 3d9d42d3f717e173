"""Mechanisms written from docs/bodies.md alone: lines, seconds from bodies to the run, what must hold.

    python benchmarks/mechanisms.py [NAME ...]

Each function is one mechanism; what it yields are largest errors of statements about its run.
"""

from __future__ import annotations

import inspect
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from math import cos, hypot, pi, sin, tan
from typing import Any

import numpy as np
from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Parameter, simulate
from lagfmu.bodies import (
    Body,
    Contact,
    Cylindrical,
    Distance,
    Force,
    Gear,
    Gravity,
    Ground,
    Motor,
    PointOnPlane,
    Prismatic,
    Revolute,
    Rolling,
    SpringDamper,
    Torque,
    Torsion,
    Universal,
    mechanism,
)

g = 9.81
t = dynamicsymbols._t
w = Parameter(symbols("w"), 20.0, "rad/s")
ground = Ground()
Statements = Iterator[tuple[str, float]]


def largest(values: Any) -> float:
    return float(np.abs(values).max())


def energy(run: Any) -> tuple[str, float]:
    lost = run["energy.dissipated"] if "energy.dissipated" in run.dtype.names else 0.0
    total = run["energy.total"] + lost
    return "energy [J]", largest(total - total[0])


def watt(run: Callable[..., Any]) -> Statements:
    left, right = Body("left", 1.0, 0.08), Body("right", 1.0, 0.08)
    coupler = Body("coupler", 0.5, 0.01)
    joints = [
        Revolute("A", ground.at((0, 0)), left.at((-0.5, 0))),
        Revolute("B", left.at((0.5, 0)), coupler.at((0, 0.25))),
        Revolute("C", coupler.at((0, -0.25)), right.at((-0.5, 0))),
        Revolute("D", ground.at((2.0, -0.5)), right.at((0.5, 0))),
    ]
    start = {"angle.A": 0.3}
    yield energy(run([left, right, coupler], joints, [Gravity((0, -g))], start=start))


def scotch_yoke(run: Callable[..., Any]) -> Statements:
    crank, yoke = Body("crank", 1.0, 0.01), Body("yoke", 2.0, 0.01)
    joints = [
        Revolute("A", ground.at((0, 0)), crank.at((0, 0))),
        Prismatic("D", ground.at((0, 0)), yoke.at((0, 0)), axis="x"),
        PointOnPlane("S", yoke.at((0, 0)), crank.at((0.1, 0)), axis="x"),
    ]
    made = run([crank, yoke], joints, [Motor("M", "A", motion=w.symbol * t)], parameters=[w])
    a = made["angle.A"]
    yield "x = r cos a", largest(made["position.D"] - 0.1 * np.cos(a))
    yield "torque = m r^2 w^2 sin a cos a", largest(made["torque.A.z"] - 8 * np.sin(a) * np.cos(a))


def gate_and_arm(run: Callable[..., Any]) -> Statements:
    arm, gate = Body("arm", 1.0, 0.05), Body("gate", 0.5, 0.02)
    joints = [
        Revolute("A", ground.at((0, 0)), arm.at((0, 0))),
        Revolute("B", ground.at((0.6, 0)), gate.at((0, 0)), limits=(-1.0, 1.0), restitution=0.3),
    ]
    line, tip = gate.at((-0.2, 0), rotation=pi), arm.at((0.45, 0))
    contacts = [Contact("K", line, tip, radius=0.02, restitution=0.5)]
    start = {"angle.A": -0.8, "der(angle.A)": 3.0}
    yield energy(run([arm, gate], joints, contacts=contacts, start=start))


def planetary(run: Callable[..., Any]) -> Statements:
    sun, planet = Body("sun", 1.0, 0.002), Body("planet", 0.3, 0.0002)
    carrier = Body("carrier", 0.5, 0.001)
    joints = [
        Revolute("S", carrier.at((0, 0)), sun.at((0, 0))),
        Revolute("C", ground.at((0, 0)), carrier.at((0, 0))),
        Revolute("P", carrier.at((0.08, 0)), planet.at((0, 0))),
        Gear("inner", "S", "P", ratio=-0.03 / 0.05),
        Gear("outer", "C", "P", ratio=-0.03 / 0.11),
    ]
    made = run([sun, carrier, planet], joints, [Motor("M", "S", torque=0.1)])
    yield "w sun = 3.2 w carrier", largest(made["sun.omega.z"] - 3.2 * made["carrier.omega.z"])
    yield "work of the motor [J]", largest(made["energy.total"] - 0.1 * made["angle.S"])


def quick_return(run: Callable[..., Any]) -> Statements:
    crank, lever, block = (
        Body("crank", 1.0, 0.01),
        Body("lever", 2.0, 0.1),
        Body("block", 0.2, 0.001),
    )
    joints = [
        Revolute("A", ground.at((0, 0.3)), crank.at((0, 0))),
        Revolute("B", crank.at((0.1, 0)), block.at((0, 0))),
        Prismatic("S", lever.at((0, 0)), block.at((0, 0)), axis="x"),
        Revolute("L", ground.at((0, 0)), lever.at((0, 0))),
    ]
    start = {"angle.A": 0.0, "der(angle.A)": 15.0}
    made = run([crank, block, lever], joints, [Gravity((0, -g))], start=start)
    a = made["angle.A"]
    pointing = np.arctan2(0.3 + 0.1 * np.sin(a), 0.1 * np.cos(a))
    yield "lever through the pin", largest(np.sin(made["angle.L"] - pointing))
    yield energy(made)


def trebuchet(run: Callable[..., Any]) -> Statements:
    beam, weight = Body("beam", 5.0, 6.0), Body("weight", 100.0, 2.0)
    shot = Body("shot", 2.0, 0.001)
    joints = [
        Revolute("P", ground.at((0, 2)), beam.at((-1.0, 0))),
        Revolute("W", beam.at((-2.0, 0)), weight.at((0, 0.5))),
        Distance("sling", beam.at((2.0, 0)), shot.at((0, 0)), 1.5),
    ]
    floor = [Contact("floor", ground.at((0, 0)), shot.at((0, 0)))]
    start = {"angle.P": -0.7, "shot.position.y": 0.0}
    loads = [Gravity((0, -g))]
    yield energy(run([beam, weight, shot], joints, loads, contacts=floor, start=start))


def toggle_clamp(run: Callable[..., Any]) -> Statements:
    one, two, jaw = Body("one", 0.5, 0.002), Body("two", 0.5, 0.002), Body("jaw", 0.3, 0.001)
    joints = [
        Revolute("A", ground.at((0, 0)), one.at((-0.1, 0)), limits=(-0.05, 1.2)),
        Revolute("B", one.at((0.1, 0)), two.at((-0.1, 0))),
        Revolute("C", two.at((0.1, 0)), jaw.at((0, 0))),
        Prismatic("D", ground.at((0, 0)), jaw.at((0, 0))),
    ]
    spring = SpringDamper("hold", ground.at((0.6, 0)), jaw.at((0, 0)), 2000.0, length=0.25)
    loads = [spring, Torsion("rub", "A", damping=0.05), Gravity((0, -g))]
    made = run([one, two, jaw], joints, loads, start={"angle.A": 0.8})
    yield "rests on its stop", abs(made["angle.A"][-1] + 0.05)


def car_on_a_hill(run: Callable[..., Any]) -> Statements:
    chassis = Body("chassis", 1000.0, 1200.0, center=(0.1, 0.3))
    rear, front = Body("rear", 30.0, 0.8), Body("front", 30.0, 0.8)
    road = ground.at((0, 0), rotation=0.1)
    joints = [
        Revolute("R", chassis.at((-1.2, 0)), rear.at((0, 0))),
        Revolute("F", chassis.at((1.2, 0)), front.at((0, 0))),
        Rolling("back", road, rear.at((0, 0)), radius=0.3),
        Rolling("fore", road, front.at((0, 0)), radius=0.3),
    ]
    loads = [Gravity((0, -g)), Motor("engine", "R", torque=-800.0)]
    made = run([chassis, rear, front], joints, loads, start={"chassis.orientation.z": 0.1})
    a = (800 / 0.3 - 1060 * g * sin(0.1)) / (1060 + 1.6 / 0.09)
    along = made["der(chassis.position.x,2)"] / cos(0.1)
    yield "its acceleration [m/s^2]", largest(along - a)
    weight = made["force.back.y"] + made["force.fore.y"]
    yield "the wheels' load [N]", largest(weight - 1060 * g * cos(0.1))


def cardan_shaft(run: Callable[..., Any]) -> Statements:
    b, J = 0.5, (0.01, 0.01, 0.02)
    one, two, three = (Body(n, 1.0, J) for n in ("one", "two", "three"))
    joints = [
        Revolute("A", ground.at((0, 0, 0)), one.at((0, 0, 0))),
        Universal("U", one.at((0, 0, 0.1)), two.at((0, 0, -0.5))),
        Universal("V", two.at((0, 0, 0.5)), three.at((0, 0, -0.1)), "y", second_axis="x"),
        Cylindrical("B", ground.at((0, sin(b), 0.2 + cos(b))), three.at((0, 0, 0))),
    ]
    made = run([one, two, three], joints, plane=None, start={"der(angle.A)": 10.0})
    yield "turns evenly [rad/s]", largest(made["der(angle.B)"] - made["der(angle.A)"])
    yield energy(made)


def swash_plate(run: Callable[..., Any]) -> Statements:
    plate, plunger = (
        Body("plate", 3.0, (0.02, 0.02, 0.04)),
        Body("plunger", 0.5, (1e-3, 1e-3, 1e-3)),
    )
    tilt, R = 0.3, 0.1
    joints = [
        Revolute("A", ground.at((0, 0, 0)), plate.at((0, 0, 0))),
        Prismatic("D", ground.at((R, 0, 0)), plunger.at((0, 0, 0)), axis="z"),
        PointOnPlane("P", plate.at((0, 0, 0), ("rpy", 0, tilt, 0)), plunger.at((0, 0, 0))),
    ]
    start = {"der(angle.A)": 30.0}
    made = run([plate, plunger], joints, [Gravity((0, 0, -g))], plane=None, start=start)
    yield (
        "z = -R tan(tilt) cos a",
        largest(made["position.D"] + R * tan(tilt) * np.cos(made["angle.A"])),
    )
    yield energy(made)


def turntable(run: Callable[..., Any]) -> Statements:
    table, r = Body("table", 50.0, (10.0, 10.0, 20.0)), 0.02
    ball = Body("ball", 0.1, (0.4 * 0.1 * r**2,) * 3)
    joints = [
        Revolute("T", ground.at((0, 0, 0)), table.at((0, 0, 0))),
        Rolling("R", table.at((0, 0, 0)), ball.at((0, 0, 0)), radius=r),
    ]
    loads = [Gravity((0, 0, -g)), Motor("M", "T", motion=w.symbol * t)]
    start = {"ball.position": (0.3, 0.0, r), "ball.velocity": (0.1, 0.2, 0.0)}
    made = run([table, ball], joints, loads, plane=None, start=start, parameters=[w])
    circle = hypot(0.1, 0.2) / (20 * 2 / 7)
    middle = 0.3 - 0.2 * 7 / 40, 0.1 * 7 / 40
    x, y = made["ball.position.x"] - middle[0], made["ball.position.y"] - middle[1]
    yield "its circle [m]", largest(np.hypot(x, y) - circle)


def spinning_top(run: Callable[..., Any]) -> Statements:
    top = Body("top", 0.1, (1e-4, 1e-4, 5e-5), center=(0, 0, 0.04))
    tip = [Contact("tip", ground.at((0, 0, 0)), top.at((0, 0, 0)), friction=0.3)]
    start = {"top.rpy": (0.2, 0, 0), "top.omega": (0, 0, 150.0)}
    made = run([top], [], [Gravity((0, 0, -g))], contacts=tip, plane=None, start=start)
    yield energy(made)


def pushed_boat(run: Callable[..., Any]) -> Statements:
    boat = Body("boat", 80.0, 40.0)
    push = Force("push", boat.at((-1.5, 0.2)), (30.0, 0.0), follows=True)
    made = run([boat], [], [push])
    turn = made["boat.orientation.z"] + 0.5 * 0.2 * 30.0 / 40.0 * made["time"] ** 2
    yield "angle = M t^2/(2 J)", largest(turn)


def peaucellier(run: Callable[..., Any]) -> Statements:
    crank = Body("crank", 0.3, 0.001)
    arms = [Body(f"arm{i}", 1.0, 0.02) for i in (1, 2)]
    bars = [Body(f"bar{i}", 0.5, 0.003) for i in (1, 2, 3, 4)]
    far = [arm.at((0.25, 0)) for arm in arms]
    left, right = [[bar.at((x, 0)) for bar in bars] for x in (-0.125, 0.125)]
    end = crank.at((0.075, 0))
    joints = [
        Revolute("P", ground.at((0.15, 0)), crank.at((-0.075, 0))),
        *(Revolute(f"O{i}", ground.at((0, 0)), arms[i].at((-0.25, 0))) for i in (0, 1)),
        *(Revolute(f"B{i}", end, left[i]) for i in (0, 1)),
        *(Revolute(f"C{i}", far[i], right[i]) for i in (0, 1)),
        *(Revolute(f"C{i}{i}", far[i], left[2 + i]) for i in (0, 1)),
        Revolute("D", right[2], right[3]),
    ]
    drive, load = Motor("drive", "P", motion=0.5), Force("load", right[2], (0, 100.0))
    start = {"angle.O0": 0.6105, "angle.O1": -0.1105}
    made = run([crank, *arms, *bars], joints, [drive, load], start=start, read={"tip": right[2]})
    x, z = (0.5**2 - 0.25**2) / 0.3, 0.5 / 2
    yield "x of a straight line [m]", largest(made["tip.position.x"] - x)
    yield "y of the inverse [m]", largest(made["tip.position.y"] - x * tan(z))
    yield "torque by virtual work [N.m]", largest(made["torque.P.z"] + 100 * x / 2 / cos(z) ** 2)


def flyball_governor(run: Callable[..., Any]) -> Statements:
    spindle = Body("spindle", 5.0, (0.03, 0.03, 0.05))
    sleeve = Body("sleeve", 3.0, (0.01, 0.01, 0.01))
    joints = [
        Revolute("A", ground.at((0, 0, 0)), spindle.at((0, 0, 0))),
        Prismatic("S", spindle.at((0, 0, 0)), sleeve.at((0, 0, 0)), axis="z"),
    ]
    bodies = [spindle, sleeve]
    for s, sign in (("r", 1), ("l", -1)):
        arm = Body(f"arm_{s}", 2.0, (0.01, 0.01, 0.001), center=(0, 0, -0.3))
        link = Body(f"link_{s}", 0.1, (0.001, 0.001, 0.0001))
        hip, foot = (b.at((sign * 0.02, 0, 0)) for b in (spindle, sleeve))
        joints += [
            Revolute(f"hip_{s}", hip, arm.at((0, 0, 0)), axis="y"),
            Revolute(f"knee_{s}", arm.at((0, 0, -0.2)), link.at((0, 0, 0.1)), axis="y"),
            Revolute(f"foot_{s}", link.at((0, 0, -0.1)), foot, axis="y"),
        ]
        bodies += [arm, link]
    start = {"angle.hip_r": -0.5, "angle.hip_l": 0.5, "der(angle.A)": 10.0}
    loads = [Gravity((0, 0, -g)), Motor("engine", "A", torque=0.5)]
    made = run(bodies, joints, loads, None, start=start)
    yield "two arms alike [rad]", largest(made["angle.hip_r"] + made["angle.hip_l"])
    work = made["energy.total"] - 0.5 * made["angle.A"]
    yield "energy less the engine's work [J]", largest(work - work[0])


def cardan_in_z(run: Callable[..., Any]) -> Statements:
    a, shaft = 0.5, (0.001, 0.02, 0.02)
    one, two = (Body(name, 2.0, (0.01, 0.01, 0.01)) for name in ("one", "two"))
    tube, rod = (Body(name, 1.0, shaft) for name in ("tube", "rod"))
    end = (0.4 + cos(a), sin(a), 0)
    joints = [
        Revolute("A", ground.at((0, 0, 0)), one.at((0, 0, 0)), axis="x"),
        Universal("U", one.at((0.2, 0, 0)), tube.at((-0.2, 0, 0)), axis="z", second_axis="y"),
        Prismatic("S", tube.at((0, 0, 0)), rod.at((0, 0, 0)), axis="x"),
        Universal("V", rod.at((0.2, 0, 0)), two.at((-0.2, 0, 0)), axis="y", second_axis="z"),
        Revolute("B", ground.at(end), two.at((0, 0, 0)), axis="x"),
    ]
    start = {"tube.rpy": (0, 0, a), "rod.rpy": (0, 0, a), "der(angle.B)": 20.0}
    drive, brake = Motor("drive", "A", motion=w.symbol * t), Torque("brake", two, (-50.0, 0, 0))
    made = run([one, tube, rod, two], joints, [drive, brake], None, parameters=[w], start=start)
    yield "output turns as input [rad]", largest(made["angle.B"] - made["angle.A"])
    J, x = 0.002, made["angle.A"]
    ratio = cos(a) / (1 - (sin(a) * np.sin(x)) ** 2)  # of the shaft between
    bend = ratio**2 / cos(a) * sin(a) ** 2 * np.sin(2 * x) * 400
    yield "drive's power [W]", largest(made["drive.power"] - 20 * (50 + J * ratio * bend))


def excavator(run: Callable[..., Any]) -> Statements:
    boom, stick = Body("boom", 500.0, 700.0), Body("stick", 250.0, 120.0, center=(0.2, 0))
    lift, lifting = Body("lift", 40.0, 4.0), Body("lifting", 20.0, 2.0)
    dig, digging = Body("dig", 30.0, 3.0), Body("digging", 15.0, 1.5)
    joints = [
        Revolute("foot", ground.at((0, 1.5)), boom.at((-2, 0))),
        Revolute("elbow", boom.at((2, 0)), stick.at((-0.3, 0))),
        Revolute("A", ground.at((0.8, 1.0)), lift.at((-0.6, 0))),
        Prismatic("L", lift.at((0, 0)), lifting.at((0, 0)), limits=(0.2, 1.4)),
        Revolute("B", lifting.at((0.5, 0)), boom.at((-0.5, 0.2))),
        Revolute("C", boom.at((0, 0.4)), dig.at((-0.6, 0))),
        Prismatic("D", dig.at((0, 0)), digging.at((0, 0)), limits=(0.5, 1.4)),
        Revolute("E", digging.at((0.5, 0)), stick.at((-0.7, 0))),
    ]
    a, b = (Parameter(symbols(n), x, "m") for n, x in (("a", 0.45), ("b", 0.8)))
    v = Parameter(symbols("v"), 0.1, "m/s")
    loads = [
        Gravity((0, -g)),
        Motor("raise", "L", motion=a.symbol + v.symbol * t),
        Motor("curl", "D", motion=b.symbol + v.symbol * t),
        Force("bucket", stick.at((1.5, 0)), (0.0, -5000.0)),
    ]
    bodies, start = (
        [boom, stick, lift, lifting, dig, digging],
        {"angle.foot": 0.6, "position.L": 0.45},
    )
    made = run(bodies, joints, loads, parameters=[a, b, v], start=start)
    reach = made["position.L"] + 1.1, made["position.D"] + 1.1
    foot, elbow = made["angle.foot"], made["angle.elbow"]
    eye = hypot(1.5, 0.2), np.arctan2(0.2, 1.5) + foot
    x, y = eye[0] * np.cos(eye[1]) - 0.8, eye[0] * np.sin(eye[1]) + 0.5
    yield "length of the lift cylinder [m]", largest(np.hypot(x, y) - reach[0])
    x, y = 2 - 0.4 * np.cos(elbow), -0.4 - 0.4 * np.sin(elbow)
    yield "length of the dig cylinder [m]", largest(np.hypot(x, y) - reach[1])


MECHANISMS = (
    *(watt, scotch_yoke, gate_and_arm, planetary, quick_return, trebuchet, toggle_clamp),
    *(car_on_a_hill, cardan_shaft, swash_plate, turntable, spinning_top, pushed_boat),
    *(peaucellier, flyball_governor, cardan_in_z, excavator),
)


def main(names: list[str]) -> None:
    """A row for each."""
    print(
        "| mechanism | lines | seconds | warnings | statements |\n| --- | --- | --- | --- | --- |"
    )
    for write in MECHANISMS:
        if names and write.__name__ not in names:
            continue

        def run(bodies: Any, joints: Any, loads: Any = (), plane: Any = "xy", **more: Any) -> Any:
            given = {"bodies": bodies, "joints": joints, "loads": loads, "plane": plane}
            return simulate(mechanism("Tried", **given, **more), 1.0, 0.05, tolerance=1e-10)

        begun = time.perf_counter()
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            found = [f"{what}: {error:.0e}" for what, error in write(run)]
        taken = time.perf_counter() - begun
        lines = len([x for x in inspect.getsource(write).splitlines() if "yield" not in x])
        row = (write.__name__.replace("_", " "), lines, f"{taken:.1f}", len(told), "; ".join(found))
        print(f"| {' | '.join(map(str, row))} |")


if __name__ == "__main__":
    main(sys.argv[1:])
