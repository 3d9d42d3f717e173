"""Starts where two branches of the motion cross, or a coordinate has no mass: refused, or right."""

from __future__ import annotations

from math import cos, pi

import pytest
from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Holonomic, Model, Parameter, simulate
from lagfmu.bodies import Body, Gravity, Ground, Prismatic, Revolute, mechanism
from lagfmu.errors import ModelError, SimulationError

ground = Ground()


def slider_crank(**start: float) -> Model:
    """Crank and rod of 1 m: where the crank stands upright the rod lies on it, and the piston may stay in the
    origin or go on along x."""
    crank, rod, piston = (
        Body(n, m, 0.02) for n, m in (("crank", 2.0), ("rod", 1.0), ("piston", 0.5))
    )
    return mechanism(
        "Equal",
        plane="xy",
        bodies=[crank, rod, piston],
        joints=[
            Revolute("A", ground.at((0, 0)), crank.at((-0.5, 0))),
            Revolute("B", crank.at((0.5, 0)), rod.at((-0.5, 0))),
            Revolute("C", rod.at((0.5, 0)), piston.at((0, 0))),
            Prismatic("D", ground.at((0, 0)), piston.at((0, 0)), axis="x"),
        ],
        loads=[Gravity((0, -9.81))],
        start=start,
    )


def test_a_crank_at_the_crossing_of_two_branches_does_not_begin_on_neither() -> None:
    """Its rate alone says not which branch; the least speeds that satisfy the rows are those of no motion,
    and made 6.6e16 N.  Beside it, on one branch, x = 2 cos(angle), the energy is that of the other rows."""
    with pytest.raises(ModelError, match=r"'A\.y', .* depend on each other, another branch"):
        simulate(slider_crank(**{"angle.A": pi / 2, "der(angle.A)": 8.0}), stop_time=0.01)
    run = simulate(
        slider_crank(**{"angle.A": pi / 2 - 1e-3, "der(angle.A)": 8.0}),
        stop_time=0.02,
        step_size=1e-3,
    )
    assert run["position.D"] == pytest.approx([2 * cos(a) for a in run["angle.A"]], abs=1e-8)
    assert run["energy.total"] == pytest.approx([run["energy.total"][0]] * len(run), rel=1e-9)


def parallelogram(angle: float, **rates: float) -> Model:
    """Cranks of 0.2 m, coupler and base of 0.5 m."""
    bodies = [Body(f"b{k}", 1.0, 0.01) for k in range(3)]
    a, coupler, b = bodies
    return mechanism(
        "Parallelogram",
        plane="xy",
        bodies=bodies,
        joints=[
            Revolute("A", ground.at((0, 0)), a.at((-0.1, 0))),
            Revolute("B", a.at((0.1, 0)), coupler.at((-0.25, 0))),
            Revolute("C", coupler.at((0.25, 0)), b.at((0.1, 0))),
            Revolute("D", b.at((-0.1, 0)), ground.at((0.5, 0))),
        ],
        loads=[Gravity((0, -9.81))],
        start={"angle.A": angle, "b1.orientation.z": 0.0, "b2.orientation.z": angle, **rates},
    )


@pytest.mark.parametrize("angle", [0.0, 1e-6, 1e-3])
def test_a_parallelogram_begins_in_line_with_the_speeds_of_one_branch(angle: float) -> None:
    """Both cranks turn alike, the coupler keeps its attitude: r w^2 acts on each link, and the force in the
    pin is that of half the coupler and more, 2.5 N, as nearby."""
    w = 5.0
    rates = {"der(angle.A)": w, "der(angle.B)": -w, "der(angle.C)": w, "der(angle.D)": -w}
    run = simulate(parallelogram(angle, **rates), stop_time=0.1, step_size=0.01)
    assert run["angle.D"] == pytest.approx((-run["angle.A"]).tolist(), abs=1e-7)
    assert run["force.B.norm"][0] == pytest.approx(2.5, abs=0.01)


@pytest.mark.parametrize("angle", [1e-12, 1e-10, 1e-9, -1e-8])
def test_next_to_the_line_no_multiplier_has_digits_and_the_start_is_refused(angle: float) -> None:
    """Rounding of the speeds over the angle, squared, is more than the force: 479 N were told in place of
    2.5 N."""
    with pytest.raises(
        (ModelError, SimulationError), match=r"another branch|contradict each other"
    ):
        simulate(parallelogram(angle, **{"der(angle.A)": 5.0}), stop_time=0.1)


@pytest.mark.parametrize("target", ["native", "python"])
def test_a_puck_in_the_hole_has_no_inertia_about_it(target: str) -> None:
    """r = 0 is set: it stays 0, where m r^2 is none and no angle has an acceleration."""
    r, phi, z = dynamicsymbols("r phi z")
    m, M, g, L = symbols("m M g L", positive=True)
    model = Model(
        name="Puck",
        lagrangian=m * (r.diff() ** 2 + r**2 * phi.diff() ** 2) / 2
        + M * z.diff() ** 2 / 2
        - M * g * z,
        coordinates={r: "m", phi: "rad", z: "m"},
        constraints=[Holonomic("string", r - z - L)],
        parameters=[
            Parameter(m, 1.0, "kg"),
            Parameter(M, 1.0, "kg"),
            Parameter(g, 9.81, "m/s^2"),
            Parameter(L, 1.0, "m"),
        ],
        start={r: 0.5, phi.diff(): 5.0},
    )
    with pytest.raises(SimulationError, match=r"singular on the constraint surface.*phi"):
        simulate(model, stop_time=0.1, start_values={"r": 0.0}, target=target)
    assert simulate(model, stop_time=0.01, target=target)["phi"][0] == 0
