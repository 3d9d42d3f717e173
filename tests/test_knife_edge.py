"""Knife edge sliding on an incline (nonholonomic), through fmpy on the built FMU."""

from __future__ import annotations

import pytest
from fmpy.fmi1 import FMICallException
from instance import instance
from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass

from lagfmu import Contact, Nonholonomic, Parameter, build_fmu, simulate
from lagfmu.errors import SimulationError


def test_a_blade_parallel_to_its_wall_is_named(tmp_path):
    """On the wall y = 0 a blade at phi != 0 holds x too, and lambda.blade = -F / sin(phi) grows without bound
    as it turns; where it is parallel, blade and wall are one row that asks for two accelerations."""
    x, y, phi = dynamicsymbols("x y phi")
    J, F = symbols("J F", positive=True)
    model = point_mass(
        "Blade",
        "x y",
        [
            Nonholonomic("blade", x.diff() * sin(phi) - y.diff() * cos(phi)),
            Contact("wall", y),
        ],
        angles="phi",
        up=y,
        energy=J * phi.diff() ** 2 / 2 + F * x,
        parameters=[Parameter(J, 0.05, "kg.m^2"), Parameter(F, 1.0, "N")],
        start={phi: -0.5, phi.diff(): 0.5},
    )
    path = build_fmu(model, tmp_path, target="native", check=False)
    named = "'blade', 'wall' depend on each other"
    with instance(path) as one:
        with pytest.raises(FMICallException):
            one.start({"phi": 0.0, "der(x)": 1.0})
        assert named in one.log[-1][2]
        assert "the configuration is singular" in one.log[-1][2]
    with pytest.raises(SimulationError, match=named):
        simulate(path, start_values={"solver.method": "rk4"}, stop_time=1.7, step_size=0.1)
