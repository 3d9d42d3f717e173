"""Models in both forms, conversion from SymPy, prescribed motions, sparse derivation, energies."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy as sp
from instance import instance
from sympy import Rational, cos, sin, symbols
from sympy.physics.mechanics import (
    LagrangesMethod,
    Particle,
    Point,
    ReferenceFrame,
    RigidBody,
    System,
    TorqueActuator,
    dynamicsymbols,
)
from zoo import point_mass
from zoo.pendulums import chain

from lagfmu import (
    Contact,
    Embedding,
    Holonomic,
    Input,
    Model,
    Nonholonomic,
    Parameter,
    Scene,
    build_fmu,
    derive,
    from_lagranges_method,
    simulate,
)
from lagfmu.errors import ModelError
from lagfmu.testing import prepare

t = dynamicsymbols._t
x, y, theta, phi = dynamicsymbols("x y theta phi")
m, g, L, c, J = symbols("m g L c J", positive=True)
K = m * (x.diff() ** 2 + y.diff() ** 2) / 2
CONSTANTS = (Parameter(m, 2.0, "kg"), Parameter(g, 9.81, "m/s^2"), Parameter(L, 1.5, "m"))
FRICTION = Parameter(c, 0.3, "N.s/m")


def equal(a, b) -> bool:
    """Two expressions, tuples or matrices are the same function."""
    pairs = zip(sp.flatten(sp.Matrix(a)), sp.flatten(sp.Matrix(b)), strict=True)
    return all(sp.simplify(one - other) == 0 for one, other in pairs)


def test_both_forms_give_the_same_equations():
    """L = T - V with friction as Q_nc, or T with weight and friction as F_q: the same M, F, G, gamma."""
    common = {
        "name": "P",
        "coordinates": {x: "m", y: "m"},
        "constraints": [Holonomic("rod", x**2 + y**2 - L**2)],
        "parameters": (*CONSTANTS, FRICTION),
        "start": {y: -1.5},
    }
    drag = {x: -c * x.diff(), y: -c * y.diff()}
    one = derive(Model(lagrangian=K - m * g * y, forces=drag, **common))
    weight = {x: drag[x], y: drag[y] - m * g}
    two = derive(Model(kinetic_energy=K, forces=weight, **common))
    for name in ("M", "F", "G", "nu", "gamma"):
        assert equal(getattr(one, name), getattr(two, name)), name
    assert equal([one.potential], [two.potential])  # of the weight, found from the force


def test_the_equations_of_polar_coordinates_hold_the_centrifugal_and_coriolis_terms():
    """m r'' - m r theta'^2 = lambda, m r^2 theta'' + 2 m r r' theta' = 0 (Marion & Thornton)."""
    r = dynamicsymbols("r")
    model = Model(
        name="P",
        lagrangian=m * (r.diff() ** 2 + r**2 * theta.diff() ** 2) / 2,
        coordinates={r: "m", theta: "rad"},
        constraints=[Holonomic("circle", r - L)],
        parameters=CONSTANTS,
        start={r: 1.5, theta.diff(): 1.0},
    )
    eom = derive(model)
    (q1, _), (v1, v2) = eom.q, eom.v
    mass = eom.p[0]
    assert equal(eom.M, sp.diag(mass, mass * q1**2))
    assert equal(eom.F, [mass * q1 * v2**2, -2 * mass * q1 * v1 * v2])
    assert equal(eom.G, sp.Matrix([[1, 0]]))


def test_energies_are_kinetic_potential_and_their_sum():
    """T = m v^2 / 2 and V = m g y; where a force has a curl there is no potential to report."""
    model = Model(
        name="P", lagrangian=K - m * g * y, coordinates={x: "m", y: "m"}, parameters=CONSTANTS
    )
    eom = derive(model)
    mass, gravity, _ = eom.p
    assert equal([eom.kinetic], [mass * (eom.v[0] ** 2 + eom.v[1] ** 2) / 2])
    assert equal([eom.potential], [mass * gravity * eom.q[1]])
    k = symbols("k", positive=True)
    swirl = Model(
        name="P",
        kinetic_energy=K,
        forces={x: -k * y, y: k * x},
        coordinates={x: "m", y: "m"},
        parameters=(*CONSTANTS, Parameter(k, 1.0, "N/m")),
    )
    prepared = prepare(swirl)
    assert prepared.equations.potential is None
    assert "energy.kinetic" in prepared.table
    assert "energy.total" not in prepared.table


def test_a_moving_frame_reports_jacobis_integral():
    """Bead on a wire turned at the rate w, seen in r alone: T_2 + V with V = -m w^2 r^2 / 2 is kept."""
    r = dynamicsymbols("r")
    w = symbols("w", positive=True)
    model = Model(
        name="Bead",
        lagrangian=m * (r.diff() ** 2 + w**2 * r**2) / 2,
        coordinates={r: "m"},
        parameters=(Parameter(m, 1.0, "kg"), Parameter(w, 2.0, "rad/s")),
        start={r: 0.5},
    )
    run = simulate(model, stop_time=1.0)
    assert run["r"] == pytest.approx(0.5 * np.cosh(2 * run["time"]), rel=1e-7)
    assert run["energy.total"] == pytest.approx(-0.5, rel=1e-7)


# ---------------------------------------------------------------------------- LagrangesMethod


def accelerations(method: LagrangesMethod, values: dict) -> tuple[np.ndarray, np.ndarray]:
    """qddot and SymPy's own lambda from the equations that form_lagranges_equations returns."""
    equations = list(method.form_lagranges_equations())
    second = [q.diff(t, 2) for q in method.q]
    if method.lam_vec:
        equations += [e.diff(t) for e in method.coneqs]
    unknown = [*second, *list(method.lam_vec or [])]
    plain = {u: sp.Symbol(f"u{k}") for k, u in enumerate(unknown)}
    system = [sp.sympify(e).doit().xreplace(plain).subs(values) for e in equations]
    solution = sp.solve(system, list(plain.values()), dict=True)[0]
    numbers = [float(solution[s]) for s in plain.values()]
    n = len(second)
    return np.array(numbers[:n]), np.array(numbers[n:])


def observed(model: Model) -> dict:
    """Outputs of the model at its start."""
    run = simulate(model, stop_time=1e-6, step_size=1e-6)
    return {name: run[name][0] for name in run.dtype.names}


def test_a_converted_pendulum_has_minus_sympys_lambda():
    """SymPy writes d/dt dL/dv - dL/dq + G^T lambda = 0; our lambda is on the side of the forces."""
    method = LagrangesMethod(K - m * g * y, [x, y], hol_coneqs=[x**2 + y**2 - L**2])
    start = {x: 0.9, y: -1.2, x.diff(): 0.8, y.diff(): 0.6}
    model = from_lagranges_method(
        method, "P", {x: "m", y: "m"}, CONSTANTS, start=start, constraint_names=["rod"]
    )
    values = {x.diff(): 0.8, y.diff(): 0.6, m: 2.0, g: 9.81, L: 1.5}
    vdot, lam = accelerations(method, values | {x: 0.9, y: -1.2})
    ours = observed(model)
    assert [ours["der(x,2)"], ours["der(y,2)"]] == pytest.approx(vdot, rel=1e-9)
    assert ours["lambda.rod"] == pytest.approx(-lam[0], rel=1e-9)
    tension = 2.0 * (1.0 + 9.81 * 1.2) / 1.5  # m v^2 / L + m g cos(angle), v = 1 m/s
    assert ours["lambda.rod"] == pytest.approx(-tension / (2 * 1.5), rel=1e-9)


def test_a_converted_nonholonomic_system_with_forces_agrees_with_sympy():
    """A knife edge with friction, pushed by an input: accelerations and minus lambda."""
    frame, origin = ReferenceFrame("N"), Point("O")
    origin.set_vel(frame, 0)
    point = origin.locatenew("P", x * frame.x + y * frame.y)
    point.set_vel(frame, x.diff() * frame.x + y.diff() * frame.y)
    blade = Particle("blade", point, m)
    push = dynamicsymbols("F")
    lagrangian = blade.kinetic_energy(frame) + J * phi.diff() ** 2 / 2
    method = LagrangesMethod(
        lagrangian,
        [x, y, phi],
        nonhol_coneqs=[x.diff() * sin(phi) - y.diff() * cos(phi)],
        forcelist=[(point, (push - c * x.diff()) * frame.x - c * y.diff() * frame.y)],
        frame=frame,
    )
    start = {phi: 0.5, x.diff(): math.cos(0.5), y.diff(): math.sin(0.5), phi.diff(): 0.7}
    model = from_lagranges_method(
        method,
        "Edge",
        {x: "m", y: "m", phi: "rad"},
        (CONSTANTS[0], Parameter(J, 0.1, "kg.m^2"), FRICTION),
        inputs=[Input(push, "N", 4.0)],
        start=start,
        constraint_names=["edge"],
    )
    rates = {s: v for s, v in start.items() if isinstance(s, sp.Derivative)}
    values = rates | {m: 2.0, J: 0.1, c: 0.3, push: 4.0, x: 0.0, y: 0.0, phi: 0.5}
    vdot, lam = accelerations(method, values)
    ours = observed(model)
    names = ("der(x,2)", "der(y,2)", "der(phi,2)")
    assert [ours[n] for n in names] == pytest.approx(vdot, rel=1e-9, abs=1e-12)
    assert ours["lambda.edge"] == pytest.approx(-lam[0], rel=1e-9)


def test_a_converted_system_of_joints_is_the_pendulum_with_spring_and_damper():
    """m L^2 theta'' = -m g L sin(theta) - k theta - c theta', in speeds u = theta' of a pin joint."""
    k, c = sp.symbols("k c", positive=True)
    angle, u = dynamicsymbols("theta u")
    wall, bob = RigidBody("wall"), Particle("bob", mass=m)
    arm = ReferenceFrame("A")
    arm.orient_axis(wall.frame, wall.z, angle)
    arm.set_ang_vel(wall.frame, u * wall.z)
    bob.masscenter.set_pos(wall.masscenter, -L * arm.y)
    wall.masscenter.set_vel(wall.frame, 0)
    bob.masscenter.v2pt_theory(wall.masscenter, wall.frame, arm)
    system = System(wall.frame, wall.masscenter)
    system.add_bodies(bob)
    system.add_coordinates(angle)
    system.add_speeds(u)
    system.add_kdes(angle.diff() - u)
    system.apply_uniform_gravity(-g * wall.y)
    system.add_actuators(TorqueActuator(-k * angle - c * u, wall.z, arm))
    springs = (Parameter(k, 3.0, "N.m/rad"), Parameter(c, 0.5, "N.m.s/rad"))
    start = {angle: 0.4, angle.diff(): 1.5}
    model = from_lagranges_method(system, "P", {angle: "rad"}, (*CONSTANTS, *springs), start=start)
    ours = observed(model)
    torque = -2.0 * 9.81 * 1.5 * np.sin(0.4) - 3.0 * 0.4 - 0.5 * 1.5
    assert ours["der(theta,2)"] == pytest.approx(torque / (2.0 * 1.5**2), rel=1e-9)
    stop = sp.Symbol("a", positive=True)
    system.add_holonomic_constraints(angle - stop)
    held = observed(
        from_lagranges_method(
            system,
            "P",
            {angle: "rad"},
            (*CONSTANTS, *springs, Parameter(stop, 0.4, "rad")),
            start={angle: 0.4},
        )
    )
    assert held["lambda.c1"] == pytest.approx(2.0 * 9.81 * 1.5 * np.sin(0.4) + 3.0 * 0.4, rel=1e-9)
    message = r"coordinate 'theta' of the System has no unit"
    with pytest.raises(ModelError, match=message):
        from_lagranges_method(system, "P", {})


def test_a_conversion_that_lacks_units_or_names_is_refused():
    """Both problems are named at once."""
    method = LagrangesMethod(K - m * g * y, [x, y], hol_coneqs=[x**2 + y**2 - L**2])
    with pytest.raises(ModelError) as caught:
        from_lagranges_method(method, "P", {x: "m"}, CONSTANTS, constraint_names=["a", "b"])
    assert "coordinate 'y'" in str(caught.value)
    assert "2 constraint names were given, expected 1" in str(caught.value)


# ---------------------------------------------------------------------------- prescribed motion


def driven(second_mass: bool = False) -> Model:
    """A mass on a rail that follows u(t), against a spring and a damper."""
    u = dynamicsymbols("u")
    k = symbols("k", positive=True)
    return point_mass(
        "Driven",
        "x",
        [Holonomic("drive", x - u)],
        energy=-k * x**2 / 2,
        parameters=[CONSTANTS[0], FRICTION, Parameter(k, 5.0, "N/m")],
        forces={x: -c * x.diff()},
        inputs=[Input(u, "m", 0.0, "where the mass is")],
    )


def test_a_prescribed_motion_gives_three_inputs():
    """u, its rate and its second derivative: the constraint's derivatives hold them."""
    table = prepare(driven()).table
    inputs = {v.name: v for v in table.variables if v.causality == "input"}
    assert list(inputs) == ["u", "der(u)", "der(u,2)"]
    assert [v.unit.name for v in inputs.values()] == ["m", "m/s", "m/s2"]
    assert {"u", "der(u)", "der(u,2)"} <= set(table["lambda.drive"].depends_initially)


def test_the_drives_force_carries_inertia_damping_and_spring(tmp_path):
    """lambda = m u'' + c u' + k u for u = 0.1 sin 3t, held by Taylor's rule between the points."""
    path = build_fmu(driven(), tmp_path, Scene("Driven"), check=False)
    step, worst = 1e-3, 0.0
    with instance(path) as one:
        one.start({"u": 0.0, "der(u)": 0.3, "der(u,2)": 0.0})
        for _ in range(1000):
            one.step(step)
            time = one.time
            u, du = 0.1 * math.sin(3 * time), 0.3 * math.cos(3 * time)
            for name, value in (("u", u), ("der(u)", du), ("der(u,2)", -9 * u)):
                one.set(name, value)
            expected = 2.0 * -9 * u + 0.3 * du + 5.0 * u
            worst = max(worst, abs(one.get("lambda.drive") - expected))
            assert one.get("x") == pytest.approx(u, abs=1e-8)
    assert worst < 1e-5


def test_a_pendulum_whose_pivot_is_driven_is_parametrically_excited():
    """Pivot at height u(t) with a constant acceleration b: gravity becomes g + b."""
    u = dynamicsymbols("u")
    model = Model(
        name="Lift",
        lagrangian=K - m * g * y,
        coordinates={x: "m", y: "m"},
        constraints=[Holonomic("rod", x**2 + (y - u) ** 2 - L**2)],
        parameters=CONSTANTS,
        inputs=[Input(u, "m")],
        start={x: 1.5 * math.sin(0.5), y: -1.5 * math.cos(0.5)},
    )
    times = np.linspace(0, 2, 201)
    b = 3.0
    signal = np.zeros(
        len(times), [("time", float), ("u", float), ("der(u)", float), ("der(u,2)", float)]
    )
    signal["time"], signal["u"] = times, b * times**2 / 2
    signal["der(u)"], signal["der(u,2)"] = b * times, b
    run = simulate(model, stop_time=2.0, step_size=0.01, inputs=signal)
    still = Model(
        name="Still",
        lagrangian=K - m * g * y,
        coordinates={x: "m", y: "m"},
        constraints=[Holonomic("rod", x**2 + y**2 - L**2)],
        parameters=(CONSTANTS[0], Parameter(g, 9.81 + b, "m/s^2"), CONSTANTS[2]),
        start=model.start,
    )
    other = simulate(still, stop_time=2.0, step_size=0.01)
    assert run["x"] == pytest.approx(other["x"], abs=1e-6)
    assert run["lambda.rod"] == pytest.approx(other["lambda.rod"], rel=1e-6, abs=1e-5)


def test_an_input_may_be_a_plain_symbol():
    """A force input that is never differentiated need not be a function of time."""
    push = symbols("F", real=True)
    model = Model(
        name="P",
        kinetic_energy=m * x.diff() ** 2 / 2,
        forces={x: push},
        coordinates={x: "m"},
        parameters=CONSTANTS,
        inputs=[Input(push, "N", 6.0)],
    )
    run = simulate(model, stop_time=1.0)
    assert run["x"][-1] == pytest.approx(1.5, rel=1e-12)


def test_a_start_at_rest_is_set_in_motion_by_its_constraints():
    """x' = w L drives y' = x' with no force along either: at rest both are projected to w L."""
    w = symbols("w", positive=True)
    model = Model(
        name="Rail",
        lagrangian=K,
        coordinates={x: "m", y: "m"},
        constraints=[
            Nonholonomic("steer", x.diff() / 3 - y.diff() * 0.7),
            Holonomic("rail", x - w * L * t),
        ],
        parameters=(CONSTANTS[0], CONSTANTS[2], Parameter(w, 0.1, "1/s")),
    )
    assert observed(model)["der(x)"] == pytest.approx(0.15)
    assert observed(model)["der(y)"] == pytest.approx(0.15 / 2.1)


# ---------------------------------------------------------------------------- sparsity


def hanging(n: int) -> Model:
    """n masses on n rods, stretched out."""
    start = {dynamicsymbols(f"x{k}"): 1.5 * (k + 1) for k in range(n)}
    return chain(n, "Chain", "rod", first=0, mass=2.0, length=1.5, start=start)


def test_a_chains_matrices_are_sparse():
    """M is diagonal and each rod touches two masses: 2 n and 4 n - 2 entries, nothing else stored."""
    n = 20
    eom = derive(hanging(n))
    assert len(eom.M.todok()) == 2 * n
    assert len(eom.G.todok()) == 4 * n - 2
    assert all(len(f.free_symbols) <= 2 for f in eom.F)
    assert all(len(a.free_symbols) <= 9 for a in eom.gamma)


def test_a_horizontal_chain_starts_in_free_fall():
    """All rods horizontal and at rest: they carry nothing, every mass falls with g."""
    run = observed(hanging(5))
    assert [run[f"der(y{k},2)"] for k in range(5)] == pytest.approx([-9.81] * 5, rel=1e-9)
    assert [run[f"lambda.rod{k}"] for k in range(5)] == pytest.approx([0.0] * 5, abs=1e-9)


# ---------------------------------------------------------------------------- the Model itself


def test_a_model_is_a_value_and_stays_what_it_was():
    """derive() and prepare() change nothing, and the user's dictionaries are copied."""
    coordinates, start = {x: "m", y: "m"}, {x: 1.5}
    model = Model(
        name="P",
        lagrangian=K - m * g * y,
        coordinates=coordinates,
        constraints=[Holonomic("rod", x**2 + y**2 - L**2)],
        parameters=CONSTANTS,
        start=start,
    )
    before = repr(model)
    coordinates.clear()
    start[x] = 99.0
    prepare(model)
    assert repr(model) == before
    with pytest.raises(AttributeError):
        model.name = "Q"


def test_exact_numbers_become_doubles():
    """Rationals and square roots in parameters, start values and expressions do not become integers."""
    model = Model(
        name="P",
        lagrangian=Rational(1, 2) * K * 2 - Rational(10**30, 10**30 + 1) * m * g * y,
        coordinates={x: "m", y: "m"},
        parameters=(Parameter(m, Rational(1, 3), "kg"), Parameter(g, sp.sqrt(2), "m/s^2")),
        start={x: sp.Rational(1, 10)},
    )
    run = observed(model)
    assert run["x"] == 0.1
    assert run["der(y,2)"] == pytest.approx(-math.sqrt(2), rel=1e-14)


def test_an_embedding_may_depend_on_time_and_leave_constraints():
    """Bead on a wire that turns at the rate w: s along the wire remains, with Coriolis' force as Q."""
    w, s = symbols("w", positive=True), dynamicsymbols("s")
    model = Model(
        name="Wire",
        lagrangian=K,
        coordinates={x: "m", y: "m"},
        constraints=[
            Nonholonomic(
                "wire",
                y.diff() * cos(w * t)
                - x.diff() * sin(w * t)
                - w * (x * cos(w * t) + y * sin(w * t)),
            )
        ],
        parameters=(CONSTANTS[0], Parameter(w, 2.0, "rad/s")),
        start={x: 0.5},
        embedding=Embedding({s: "m"}, {x: s * cos(w * t), y: s * sin(w * t)}, {s: 0.5}),
    )
    run = simulate(model, stop_time=1.0, scene=Scene("W", formulation="minimal"))
    radius = 0.5 * np.cosh(2 * run["time"])
    assert run["s"] == pytest.approx(radius, rel=1e-7)
    force = 2 * 2.0 * 2.0 * np.sinh(2 * run["time"])  # 2 m w s', s' = sinh 2t
    assert run["lambda.wire"] == pytest.approx(force, rel=1e-6, abs=1e-6)


def test_an_embedding_may_ride_on_a_prescribed_motion():
    """A pendulum on a pivot that is moved by U: the angle alone, with x = U + L sin(phi), moves and
    pulls on its rod as the Cartesian one does, dU/dt and its derivative included."""
    x, y, phi, U = dynamicsymbols("x y phi U")
    L = symbols("L", positive=True)
    model = point_mass(
        "Moved",
        "x y",
        [Holonomic("rod", (x - U) ** 2 + y**2 - L**2)],
        up=y,
        mass=1.3,
        parameters=[Parameter(L, 0.7, "m")],
        inputs=[Input(U, "m", 0.1)],
        start={x: 0.1 + 0.7 * math.sin(0.4), y: -0.7 * math.cos(0.4)},
        embedding=Embedding(
            {phi: "rad"}, {x: U + L * sin(phi), y: -L * cos(phi)}, {phi: 0.4, phi.diff(): 0.5}
        ),
    )
    drive = {"U": 0.1, "der(U)": 0.7, "der(U,2)": 0.5}
    speeds = {
        "der(x)": 0.7 + 0.7 * 0.5 * math.cos(0.4),
        "der(y)": 0.7 * 0.5 * math.sin(0.4),
    }
    free = simulate(model, 0.5, 0.5, 1e-12, {**drive, **speeds}, scene=Scene("Moved"))
    angle = simulate(model, 0.5, 0.5, 1e-12, drive, scene=Scene("Moved", "minimal"))
    for name in ("x", "der(x)", "der(x,2)", "y", "lambda.rod", "energy.total"):
        np.testing.assert_allclose(angle[name], free[name], rtol=1e-9, err_msg=name)


def test_a_departure_is_told_in_all_coordinates_of_an_embedding():
    """A bead on the wire y = x/2 lies against a stop at x = L: lambda = m g/2, and Q.y = m g is the wire's
    and the stop's together, until it is pushed away; of the place x and y are told, not s alone."""
    s, push = dynamicsymbols("s F")
    model = Model(
        name="Slope",
        lagrangian=K - m * g * y,
        forces={x: push},
        coordinates={x: "m", y: "m"},
        constraints=[Holonomic("wire", y - x / 2), Contact("stop", x - L)],
        parameters=CONSTANTS,
        inputs=[Input(push, "N")],
        embedding=Embedding(
            {s: "m"}, {x: 2 * s / sp.sqrt(5), y: s / sp.sqrt(5)}, {s: 1.5 * math.sqrt(5) / 2}
        ),
    )
    away = np.array([(0.0, 0.0), (0.5, 0.0), (0.5, 20.0), (1.0, 20.0)], "f8,f8")
    away.dtype.names = ("time", "F")
    run = simulate(model, 1.0, 0.25, 1e-10, inputs=away, scene=Scene("Slope", "minimal"))
    assert run["lambda.stop"][0] == pytest.approx(2.0 * 9.81 / 2, rel=1e-14)
    assert run["Q.y"][0] == pytest.approx(2.0 * 9.81, rel=1e-14)
    assert run["departure.stop.x"][0] == 0
    last = run[-1]
    assert (last["departure.stop.count"], last["departure.stop.time"]) == (1, 0.5)
    assert last["departure.stop.x"] == pytest.approx(1.5, rel=1e-12)
    assert last["departure.stop.y"] == pytest.approx(0.75, rel=1e-12)
    assert last["der(s,2)"] == pytest.approx((2 * 20 / 2 - 9.81) / math.sqrt(5), rel=1e-9)
