"""The rods of rods.py in other simulators from PyPI, each as its own manual would have it.

A peer prepares the model once and answers a run from the start, which gives the tensions (samples, n).
Angles are those of joints where there are joints: the first from the downward vertical, each other from
the rod above.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import rods
from programs import STEP
from rods import GRAVITY, Rods
from scipy.integrate import solve_ivp

Run = Callable[[], Any]
STEPS = (2e-2, 1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4)
DECADES = [10.0**-k for k in range(2, 13)]


@dataclass(frozen=True)
class Peer:
    """`settings`: tolerances, or steps [s]."""

    label: str
    package: str
    settings: Sequence[float]
    prepare: Callable[[Any, float], Run]  # of a problem and a setting


def drake_joints(scheme: str) -> Callable[[Rods, float], Run]:
    """Revolute joints, continuous time, error control; the joints' reactions are an output of the plant."""

    def prepare(problem: Rods, accuracy: float) -> Run:
        from pydrake import all as drake

        plant = drake.MultibodyPlant(0.0)
        plant.mutable_gravity_field().set_gravity_vector([0, 0, -GRAVITY])
        tip = [0, 0, -problem.length]
        point = drake.SpatialInertia(problem.mass, tip, drake.UnitInertia.PointMass(tip))
        frame, joints = plant.world_frame(), []
        for k in range(problem.count):
            body = plant.AddRigidBody(f"rod{k}", point)
            if k > 0:
                frame = plant.AddFrame(
                    drake.FixedOffsetFrame(f"tip{k}", frame, drake.RigidTransform(tip))
                )
            joint = drake.RevoluteJoint(f"joint{k}", frame, body.body_frame(), [0, -1, 0])
            joints.append(plant.AddJoint(joint))
            frame = body.body_frame()
        plant.Finalize()
        context = plant.CreateDefaultContext()
        simulator = drake.Simulator(plant, context)
        drake.ResetIntegratorFromFlags(simulator, scheme, STEP)
        simulator.get_mutable_integrator().set_target_accuracy(accuracy)
        reactions = plant.get_reaction_forces_output_port()

        def run() -> Any:
            context.SetTime(0.0)
            plant.SetPositions(context, [problem.angle] + [0.0] * (problem.count - 1))
            plant.SetVelocities(context, [0.0] * problem.count)
            simulator.get_mutable_integrator().request_initial_step_size_target(1e-3)
            simulator.Initialize()
            found = []
            for t in problem.times:
                simulator.AdvanceTo(t)
                found.append([f.translational()[2] for f in reactions.Eval(context)])
            return rods.array(found)

        return run

    return prepare


def exudyn_distances(index2: bool) -> Callable[[Rods, float], Run]:
    """Mass points and distance constraints, whose forces sensors record: generalized alpha on the index-3
    equations, or the trapezoidal rule on those of index 2."""

    def prepare(problem: Rods, step: float) -> Run:
        import exudyn
        import exudyn.itemInterface

        items = exudyn.itemInterface
        system = exudyn.SystemContainer().AddSystem()
        ground = system.AddObject(items.ObjectGround())
        above = system.AddMarker(items.MarkerBodyPosition(bodyNumber=ground))
        sensors = []
        for x, y in problem.start:
            node = system.AddNode(items.NodePoint2D(referenceCoordinates=[x, y]))
            bob = system.AddObject(items.MassPoint2D(mass=problem.mass, nodeNumber=node))
            marker = system.AddMarker(items.MarkerBodyPosition(bodyNumber=bob))
            weight = [0, -problem.mass * GRAVITY, 0]
            system.AddLoad(items.Force(markerNumber=marker, loadVector=weight))
            rod = items.DistanceConstraint(markerNumbers=[above, marker], distance=problem.length)
            sensors.append(
                system.AddSensor(
                    items.SensorObject(
                        objectNumber=system.AddObject(rod),
                        storeInternal=True,
                        outputVariableType=exudyn.OutputVariableType.Force,
                    )
                )
            )
            above = marker
        system.Assemble()
        settings = exudyn.SimulationSettings()
        settings.timeIntegration.endTime = problem.stop
        settings.timeIntegration.numberOfSteps = round(problem.stop / step)
        settings.timeIntegration.verboseMode = 0
        settings.timeIntegration.newton.relativeTolerance = 1e-12
        settings.timeIntegration.newton.absoluteTolerance = 1e-14
        settings.timeIntegration.generalizedAlpha.computeInitialAccelerations = True
        settings.solution.sensors.writePeriod = STEP
        settings.solution.file.write = False
        kind = exudyn.DynamicSolverType
        solver = kind.TrapezoidalIndex2 if index2 else kind.GeneralizedAlpha

        def run() -> Any:
            system.SolveDynamic(settings, solverType=solver)
            recorded = [system.GetSensorStoredData(s)[-len(problem.times) :, 1] for s in sensors]
            return rods.array(recorded).T

        return run

    return prepare


def mujoco_hinges(problem: Rods, step: float) -> Run:
    """Hinges, fourth-order Runge-Kutta; the forces at the hinges by inverse dynamics, which
    mj_rnePostConstraint adds on demand."""
    import mujoco

    inertia = f'mass="{problem.mass}" diaginertia="1e-14 1e-14 1e-14"'  # zero is refused
    bodies, end = "", ""
    for k in range(problem.count):
        place = "0 0 0" if k == 0 else f"0 0 {-problem.length}"
        bodies += f'<body pos="{place}"><joint type="hinge" axis="0 -1 0"/>'
        bodies += f'<inertial pos="0 0 {-problem.length}" {inertia}/>'
        end += "</body>"
    model = mujoco.MjModel.from_xml_string(mujoco_text(step, bodies + end))
    data = mujoco.MjData(model)
    each = round(STEP / step)

    def run() -> Any:
        mujoco.mj_resetData(model, data)
        data.qpos[0] = problem.angle
        found = []
        for _ in problem.times:
            mujoco.mj_step(model, data, each)
            mujoco.mj_forward(model, data)
            mujoco.mj_rnePostConstraint(model, data)
            a = np.cumsum(data.qpos)
            pulls = data.cfrc_int[1:, [3, 5]]
            found.append(-pulls[:, 0] * np.sin(a) + pulls[:, 1] * np.cos(a))
        return rods.array(found)

    return run


def mujoco_text(step: float, bodies: str, more: str = "") -> str:
    return (
        f'<mujoco><option timestep="{step}" integrator="RK4" gravity="0 0 {-GRAVITY}"'
        ' solver="Newton" tolerance="1e-15" iterations="200"><flag contact="disable"/></option>'
        f"<worldbody>{bodies}</worldbody>{more}</mujoco>"
    )


def mujoco_tendons(problem: Rods, step: float) -> Run:
    """Bobs that move freely on tendons of constant length, as hard as its soft constraints go: they are
    reached in two steps, at an impedance of 0.9999."""
    import mujoco

    bodies, tendons, rows = '<site name="s0"/>', "", ""
    for k in range(1, problem.count + 1):
        bodies += (
            '<body><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>'
            f'<inertial pos="0 0 0" mass="{problem.mass}" diaginertia="1e-14 1e-14 1e-14"/>'
            f'<site name="s{k}"/></body>'
        )
        tendons += f'<spatial name="t{k}"><site site="s{k - 1}"/><site site="s{k}"/></spatial>'
        rows += f'<tendon tendon1="t{k}" solref="{2 * step} 1" solimp="0.9999 0.9999 0.001"/>'
    more = f"<tendon>{tendons}</tendon><equality>{rows}</equality>"
    model = mujoco.MjModel.from_xml_string(mujoco_text(step, bodies, more))
    model.tendon_length0[:] = problem.length
    data = mujoco.MjData(model)
    each = round(STEP / step)

    def run() -> Any:
        mujoco.mj_resetData(model, data)
        data.qpos[:] = np.ravel(problem.start)
        found = []
        for _ in problem.times:
            mujoco.mj_step(model, data, each)
            mujoco.mj_forward(model, data)
            found.append(-data.efc_force[: problem.count])
        return rods.array(found)

    return run


def by_scipy(
    accelerations: Callable[[Any, Any], Any], y0: Any, problem: Any, tolerance: float
) -> Any:
    """The states (q, v) at the problem's times, by SciPy's DOP853, of  q'' = accelerations(q, v)."""
    n = len(y0) // 2

    def rate(_t: float, y: Any) -> Any:
        return np.concatenate([y[n:], accelerations(y[:n], y[n:])])

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of SciPy: rtol below 2.2e-14
        found = solve_ivp(
            rate, (0, problem.stop), y0, "DOP853", problem.times, rtol=tolerance, atol=tolerance
        )
    return found.y.T


def pinocchio_joints(problem: Rods, tolerance: float) -> Run:
    """Joint angles by Pinocchio's articulated-body algorithm, integrated by SciPy's DOP853; the forces at the
    joints by its recursive Newton-Euler algorithm."""
    import pinocchio

    model = pinocchio.Model()
    model.gravity.linear = rods.array([0.0, 0.0, -GRAVITY])
    tip, joint = rods.array([0.0, 0.0, -problem.length]), 0
    point = pinocchio.Inertia(problem.mass, tip, np.zeros((3, 3)))
    for k in range(problem.count):
        place = pinocchio.SE3(np.eye(3), tip if k > 0 else np.zeros(3))
        joint = model.addJoint(joint, pinocchio.JointModelRY(), place, f"joint{k}")
        model.appendBodyToJoint(joint, point, pinocchio.SE3.Identity())
    data = model.createData()
    n = problem.count
    rest = np.zeros(n)
    y0 = np.concatenate([[-problem.angle], np.zeros(2 * n - 1)])

    def accelerations(q: Any, v: Any) -> Any:
        return pinocchio.aba(model, data, q, v, rest)

    def run() -> Any:
        rows = []
        for y in by_scipy(accelerations, y0, problem, tolerance):
            a = accelerations(y[:n], y[n:])
            pinocchio.rnea(model, data, y[:n], y[n:], a)
            rows.append([data.f[k].linear[2] for k in range(1, n + 1)])
        return rods.array(rows)

    return run


def heyoka_angles(problem: Rods, tolerance: float) -> Run:
    """Angles by Taylor's method, of equations derived by hand (those of rods.py), which it compiles; so are
    the tensions, from the bobs' accelerations."""
    import heyoka as hy

    n, length = problem.count, problem.length
    a, w = ([hy.expression(f"{x}{k}") for k in range(n)] for x in "aw")
    rows = []  # of the linear equations for w', with the right-hand side at the end
    for k in range(n):
        below = [n - max(j, k) for j in range(n)]
        row = [c * hy.cos(a[k] - a[j]) for j, c in enumerate(below)]
        bends = [c * hy.sin(a[k] - a[j]) * w[j] ** 2.0 for j, c in enumerate(below)]
        rows.append([*row, -hy.sum([*bends, (n - k) * GRAVITY / length * hy.sin(a[k])])])
    for k in range(n):  # elimination
        for i in range(k + 1, n):
            factor = rows[i][k] / rows[k][k]
            rows[i] = [x - factor * y for x, y in zip(rows[i], rows[k], strict=True)]
    spins: list[Any] = [None] * n
    for k in reversed(range(n)):
        known = [rows[k][j] * spins[j] for j in range(k + 1, n)]
        spins[k] = (rows[k][n] - hy.sum(known) if known else rows[k][n]) / rows[k][k]
    place, forces, acceleration = [*a, *w], [], (0.0, 0.0)
    for k in range(n):  # what each bob needs, along its rod
        acceleration = (
            acceleration[0] + length * (spins[k] * hy.cos(a[k]) - w[k] ** 2.0 * hy.sin(a[k])),
            acceleration[1] + length * (spins[k] * hy.sin(a[k]) + w[k] ** 2.0 * hy.cos(a[k])),
        )
        forces.append([problem.mass * x for x in (acceleration[0], acceleration[1] + GRAVITY)])
    pulls = []
    for k in range(n):
        x, y = (hy.sum([f[i] for f in forces[k:]]) for i in (0, 1))
        pulls.append(y * hy.cos(a[k]) - x * hy.sin(a[k]))
    read = hy.cfunc(pulls, place)
    y0 = np.array([problem.angle] * n + [0.0] * n)
    equations = [*zip(a, w, strict=True), *zip(w, spins, strict=True)]
    solver = hy.taylor_adaptive(equations, y0, tol=tolerance)

    def run() -> Any:
        solver.time = 0.0
        solver.state[:] = y0
        found = np.empty((len(problem.times), 2 * n))
        for row, t in zip(found, problem.times, strict=True):
            solver.propagate_until(t)
            row[:] = solver.state
        return read(np.ascontiguousarray(found.T)).T

    return run


PEERS = [
    Peer(
        "Drake, joints, runge_kutta3 (its default)",
        "drake",
        DECADES[:8],
        drake_joints("runge_kutta3"),
    ),
    Peer("Drake, joints, runge_kutta5", "drake", DECADES, drake_joints("runge_kutta5")),
    Peer("exudyn, distances, generalized alpha", "exudyn", STEPS, exudyn_distances(False)),
    Peer("exudyn, distances, index 2", "exudyn", STEPS, exudyn_distances(True)),
    Peer("heyoka, angles by hand", "heyoka", DECADES[2:], heyoka_angles),
    Peer("MuJoCo, hinges", "mujoco", STEPS, mujoco_hinges),
    Peer("MuJoCo, tendons", "mujoco", STEPS, mujoco_tendons),
    Peer("Pinocchio, joints, SciPy's DOP853", "pin", DECADES, pinocchio_joints),
]
