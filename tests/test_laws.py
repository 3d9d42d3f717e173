"""Newton's and Euler's laws of each body, with the wrenches that its FMU tells: of every mechanism."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import lagfmu
from lagfmu import Parameter, Scene, Track, verify
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
    Planar,
    PointOnCurve,
    Prismatic,
    Revolute,
    SpringDamper,
    Torque,
    Torsion,
    Universal,
    mechanism,
)
from lagfmu.testing import CarriedLaws

t = dynamicsymbols._t
ground = Ground()
f0, t0, q0, wf = sp.symbols("f0 t0 q0 wf", real=True)
PARAMETERS = [
    Parameter(f0, 1.0, "N"),
    Parameter(t0, 0.2, "s"),
    Parameter(q0, 0.5, "N.m"),
    Parameter(wf, 3.0, "rad/s"),
]
JUMPS = f0 * (1 + 2 * sp.Heaviside(t - t0))
TURNED = ("rpy", 0.1, 0.2, 0.3)


@cache
def of_the_plane():
    """A joint, a load and a contact of each kind, with frictions, limits and inputs."""
    a, b = Body("a", 2.0, 0.05, center=(0.02, 0.01)), Body("b", 1.0, 0.02)
    c, w, p, d, e = (
        Body(n, m, 0.02) for n, m in zip("cwpde", (0.5, 0.7, 0.3, 0.4, 1.1), strict=True)
    )
    s = sp.Symbol("s", real=True)
    return mechanism(
        "OfThePlane",
        plane="xy",
        bodies=[a, b, c, w, p, d, e],
        joints=[
            Revolute("A", ground.at((0.1, 0.2)), a.at((-0.2, 0)), friction=0.2, radius=0.02),
            Revolute("B", a.at((0.3, 0.05), 0.3), b.at((-0.2, 0)), limits=(-0.1, 0.6)),
            Prismatic("S", b.at((0.1, 0), 0.4), c.at((0, 0), 0.1), friction=0.1),
            Revolute("D", ground.at((1, 0)), d.at((0.05, 0))),
            Gear("G", "D", "A", -2.0),
            PointOnCurve(
                "K",
                ground.at((2, 0)),
                p.at((0.01, 0.02)),
                Track((s, s**2), s, -2, 2),
                friction=0.05,
            ),
            Distance("rod", c.at((0.1, 0)), w.at((0, 0.05)), 0.4),
        ],
        loads=[
            Gravity((0.1, -9.81)),
            SpringDamper("sp", ground.at((0, 1)), b.at((0.1, 0.1)), 50, 0.4, 2.0, 1.0),
            Torsion("ts", "B", 3.0, 0.2, 0.1, 0.3),
            Motor("mo", "A", torque=q0 * sp.sin(wf * t)),
            Motor("mi", "S"),
            Force("F", b.at((0.1, 0), 0.7), (JUMPS, f0), follows=True),
            Force("Fi", c.at((0.1, 0))),
            Torque("Ti", w),
        ],
        contacts=[Contact("floor", ground.at((0, -0.6)), e.at((0, 0)), 0.1, friction=0.3)],
        parameters=PARAMETERS,
        start={"p.position.x": 2.5, "angle.B": 0.1, "e.position": (-3, -0.5), "e.velocity.x": 1.0},
    )


@cache
def of_space():
    """The same in space."""
    a = Body("a", 2.0, (0.05, 0.06, 0.07, 0.002, 0, -0.001), center=(0.02, 0.01, 0))
    b, c, w, d, u, p = (
        Body(n, m, (0.02, 0.03, 0.025)) for n, m in zip("bcwdup", range(1, 7), strict=True)
    )
    return mechanism(
        "OfSpace",
        bodies=[a, b, c, w, d, u, p],
        joints=[
            Revolute(
                "A", ground.at((0.1, 0.2, 0)), a.at((-0.2, 0, 0)), "y", friction=0.2, radius=0.02
            ),
            Cylindrical("B", a.at((0.3, 0.05, 0), TURNED), b.at((-0.2, 0, 0))),
            Prismatic("S", b.at((0.1, 0, 0)), c.at((0, 0, 0)), axis="x", limits=(-0.4, 0.4)),
            Universal("U", c.at((0.1, 0, 0)), u.at((-0.1, 0, 0))),
            Revolute("D", ground.at((1, 0, 0)), d.at((0.05, 0, 0)), axis="x"),
            Gear("G", "D", "A", -2.0),
            Planar("P", ground.at((0, 0, 1)), p.at((0, 0.1, 0))),
            Distance("rod", u.at((0.1, 0, 0)), p.at((0, 0.05, 0)), 1.0),
        ],
        loads=[
            Gravity((0.1, 0, -9.81)),
            SpringDamper("sp", ground.at((0, 1, 0)), b.at((0.1, 0.1, 0)), 50, 0.4, 2.0, 1.0),
            Torsion("ts", "A", 3.0, 0.2, 0.1, 0.3),
            Motor("mo", "D", torque=q0 * sp.sin(wf * t)),
            Motor("mi", "S"),
            Force("F", b.at((0.1, 0, 0), TURNED), (JUMPS, f0, f0), follows=True),
            Force("Fi", c.at((0.1, 0, 0))),
            Torque("Ti", w),
        ],
        contacts=[Contact("floor", ground.at((0, 0, -0.15)), w.at((0, 0, 0)), 0.1, friction=0.3)],
        parameters=PARAMETERS,
        start={"w.velocity.x": 1.0, "w.omega": (1.0, 2.0, 3.0), "angle.A": 0.1},
    )


MAKERS = (of_the_plane, of_space)


def driven(model):
    """Inputs that jump at 0.1 s."""
    names = [str(i.symbol.func) for i in model.inputs]
    table = np.zeros(4, dtype=[("time", float), *((n, float) for n in names)])
    table["time"] = 0, 0.1, 0.1, 0.3
    for k, n in enumerate(names):
        table[n] = 0.1 * k + np.array([0.1, 0.2, -0.5, 0.3])
    return table


def felt(act, run):
    """Whether it is ever more than nothing."""
    symbols = {str(s) for e in (*act.force, *act.torque) for s in sp.sympify(e).free_symbols}
    return any(n not in run.dtype.names or np.abs(run[n]).max() > 1e-6 for n in symbols)


def laws(found):
    return [c for c in found.checks if " law of " in c.name]


@pytest.mark.parametrize("make", MAKERS)
def test_both_laws_hold_for_each_body_to_rounding(make, built):
    """m r'' is the sum of the forces that the FMU tells, J w' + w x J w that of the moments, whatever the
    tolerance of the run and the values of its parameters; nothing is said only where a load jumps."""
    model = make()
    fmu = built(model, Scene(model.name, stop_time=0.3, step_size=0.01))
    for options in ({}, {"tolerance": 1e-3}, {"start_values": {"a.mass": 7.0, "G.ratio": -3.0}}):
        found = verify(fmu, inputs=driven(model), **options)
        held = laws(found)
        assert len(held) == found.closed_forms == 2 * len(model.laws.names)
        assert found.passed, [str(c) for c in found.checks if c.failed]
        assert all(c.points >= 29 and c.error < 1e-14 for c in held)


@pytest.mark.parametrize("make", MAKERS)
def test_each_wrong_sign_of_what_acts_breaks_a_law(make, built):
    """A force with the wrong sign is off by twice itself, of whatever kind it is, on either of its bodies."""
    model = make()
    fmu = built(model, Scene(model.name, stop_time=0.3, step_size=0.01))
    inputs = driven(model)
    run = lagfmu.simulate(fmu, inputs=inputs, besides=list(inputs.dtype.names[1:]))
    known = {*run.dtype.names, *(str(p.symbol) for p in model.parameters)}
    values = {str(p.symbol): p.value for p in model.parameters}
    told = model.laws
    acts = [a for a in told.acts if felt(a, run)]
    assert len(acts) >= 14
    assert not any(c.failed for c in CarriedLaws(told, known).checks(run, values))
    for act in acts:
        k = told.acts.index(act)
        for turned in (
            replace(act, force=[-f for f in act.force], torque=[-q for q in act.torque]),
            replace(act, against=-1) if act.against >= 0 else None,
        ):
            if turned is not None:
                seeded = replace(told, acts=[*told.acts[:k], turned, *told.acts[k + 1 :]])
                assert any(c.failed for c in CarriedLaws(seeded, known).checks(run, values)), act


def seeds(model, told):
    """What is told with the wrong sign, and what acts with it."""
    for of in told:
        outputs = [
            replace(o, expression=-o.expression) if o.name == of else o for o in model.outputs
        ]
        yield replace(model, outputs=outputs)
    damped = next(q for q in model.forces if str(q.func) == "b.position.x")
    yield replace(model, forces={**model.forces, damped: -model.forces[damped]})
    yield replace(model, lagrangian=2 * model.lagrangian)


@pytest.mark.parametrize(
    "told",
    [
        ("force.A.x",),
        pytest.param(("torque.B.z", "force.rod.y", "force.sp"), marks=pytest.mark.thorough),
    ],
)
def test_an_fmu_that_tells_or_does_the_wrong_thing_fails(built, told):
    """One component told with the wrong sign, a damper that drives, a mass that counts twice."""
    made = of_the_plane()
    for model in seeds(made, told):
        fmu = built(model, Scene(made.name, stop_time=0.1, step_size=0.01))
        assert any(c.failed for c in laws(verify(fmu)))


def test_of_bodies_whose_forces_are_not_told_nothing_is_said(built):
    """A scene that leaves out an acceleration leaves both laws of that body unchecked, and counts them."""
    model = of_the_plane()
    names = ["der(d.position.*", "der(d.orientation.z*", "d.position.*", "d.orientation.z"]
    names += ["force.D.*", "torque.D.z", "lambda.G", "a.position.*", "a.orientation.z"]
    fmu = built(model, Scene(model.name, stop_time=0.1, step_size=0.01, outputs=names))
    found = verify(fmu)
    assert {c.name for c in laws(found)} == {"Newton's law of d", "Euler's law of d"}
    assert (found.passed, found.left_out) == (True, 12)
