"""The closed loops of loops.py in other simulators from PyPI, each as its own manual would have it.

A peer prepares the model once and answers a run from the start, which gives the forces (samples, 2 k) on the
second bodies of the pins that close the loops, in the axes of the ground.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from loops import Loops
from plane import GROUND, Pin
from rods_elsewhere import DECADES, Peer, Run, by_scipy

PARTS = (5, 10, 20, 50, 100, 200, 500, 1000)  # steps between two samples


def exudyn_pins(index2: bool) -> Any:
    """Rigid bodies and revolute joints in the plane, whose forces sensors record: generalized alpha on the
    index-3 equations, or the trapezoidal rule on those of index 2."""

    def prepare(problem: Loops, parts: float) -> Run:
        import exudyn
        import exudyn.itemInterface

        items, system = exudyn.itemInterface, exudyn.SystemContainer().AddSystem()
        q, v = problem.start.reshape(2, -1, 3).tolist()
        bodies = []
        for (m, J), place, rate in zip(problem.mechanism.masses, q, v, strict=True):
            node = items.NodeRigidBody2D(referenceCoordinates=place, initialVelocities=rate)
            bodies.append(
                system.AddObject(
                    items.ObjectRigidBody2D(
                        physicsMass=m, physicsInertia=J, nodeNumber=system.AddNode(node)
                    )
                )
            )
            at = system.AddMarker(items.MarkerBodyMass(bodyNumber=bodies[-1]))
            weight = [0, -problem.gravity, 0]
            system.AddLoad(items.LoadMassProportional(markerNumber=at, loadVector=weight))
        bodies.append(system.AddObject(items.ObjectGround()))  # number -1

        def marker(body: int, point: complex) -> Any:
            at = [point.real, point.imag, 0]
            return system.AddMarker(
                items.MarkerBodyPosition(bodyNumber=bodies[body], localPosition=at)
            )

        pins = [
            system.AddObject(
                items.ObjectJointRevolute2D(
                    markerNumbers=[marker(p.first, p.s1), marker(p.second, p.s2)]
                )
            )
            for p in problem.mechanism.joints
        ]
        if problem.torque:
            turned = system.AddMarker(items.MarkerBodyRigid(bodyNumber=bodies[0]))
            torque = [0, 0, problem.torque]
            system.AddLoad(items.LoadTorqueVector(markerNumber=turned, loadVector=torque))
        if problem.spring:
            body, s, hook, k, length = problem.spring
            system.AddObject(
                items.ObjectConnectorSpringDamper(
                    markerNumbers=[marker(GROUND, hook), marker(body, s)],
                    stiffness=k,
                    referenceLength=length,
                )
            )
        sensors = [
            system.AddSensor(
                items.SensorObject(
                    objectNumber=pin,
                    storeInternal=True,
                    outputVariableType=exudyn.OutputVariableType.Force,
                )
            )
            for pin in pins[len(problem.tree) :]
        ]
        system.Assemble()
        settings = exudyn.SimulationSettings()
        settings.timeIntegration.endTime = problem.stop
        settings.timeIntegration.numberOfSteps = round(len(problem.times) * parts)
        settings.timeIntegration.verboseMode = 0
        settings.timeIntegration.newton.relativeTolerance = 1e-12
        settings.timeIntegration.newton.absoluteTolerance = 1e-14
        settings.timeIntegration.generalizedAlpha.computeInitialAccelerations = True
        settings.solution.sensors.writePeriod = problem.step
        settings.solution.file.write = False
        kind = exudyn.DynamicSolverType
        solver = kind.TrapezoidalIndex2 if index2 else kind.GeneralizedAlpha

        def run() -> Any:
            system.SolveDynamic(settings, solverType=solver)
            recorded = [system.GetSensorStoredData(s)[-len(problem.times) :, 1:3] for s in sensors]
            return -np.concatenate(recorded, axis=1)  # they are those on the first bodies

        return run

    return prepare


def angles(problem: Loops, tree: Sequence[Pin]) -> tuple[Any, Any]:
    """Of the tree's joints, and their rates: of each body against the one that it hangs on."""
    parts = problem.start.reshape(2, -1, 3)[:, :, 2]
    turned = np.concatenate([parts, np.zeros((2, 1))], axis=1)  # the ground is body -1
    q, v = turned[:, [p.second for p in tree]] - turned[:, [p.first for p in tree]]
    return q, v


def downward(problem: Loops, body: int = GROUND) -> list[Pin]:
    """The tree's pins, each branch to its end before the next."""
    found = []
    for pin in problem.tree:
        if pin.first == body:
            found += [pin, *downward(problem, pin.second)]
    return found


def mujoco_tree(problem: Loops, parts: float) -> Run:
    """A tree of hinges whose loops are closed by its soft `connect`, as hard as it goes: reached in two
    steps, at an impedance of 0.9999; fourth-order Runge-Kutta.  The forces are those of its constraints."""
    import mujoco

    step = problem.step / parts
    children: dict[int, list[Pin]] = {}
    for pin in problem.tree:
        children.setdefault(pin.first, []).append(pin)

    def text(point: complex) -> str:
        return f"{point.real!r} 0 {point.imag!r}"

    def bodies(parent: int) -> str:
        """In the plane xz, turned against the ground by nothing: angles are those of hinges about -y."""
        found = ""
        for pin in children.get(parent, []):
            m, J = problem.mechanism.masses[pin.second]
            at = pin.s1 - (0 if parent == GROUND else hung[parent])
            found += f'<body name="b{pin.second}" pos="{text(at)}">'
            found += f'<joint name="j{pin.second}" type="hinge" axis="0 -1 0"/>'
            found += f'<inertial pos="{text(-pin.s2)}" mass="{m}" diaginertia="{J} {J} {J}"/>'
            found += f"{sites.get(pin.second, '')}{bodies(pin.second)}</body>"
        return found

    hung = {pin.second: pin.s2 for pin in problem.tree}
    sites: dict[int, str] = {}
    ties = ""
    for k, pin in enumerate(problem.closing):
        for which, body, s in (("a", pin.first, pin.s1), ("b", pin.second, pin.s2)):
            at = text(s - hung[body])
            sites[body] = sites.get(body, "") + f'<site name="{which}{k}" pos="{at}"/>'
        soft = f'solref="{2 * step} 1" solimp="0.9999 0.9999 0.001"'
        ties += f'<connect site1="b{k}" site2="a{k}" {soft}/>'
    more, ground = f"<equality>{ties}</equality>", ""
    if problem.spring:
        body, s, hook, k, length = problem.spring
        ground = f'<site name="hook" pos="{text(hook)}"/>'
        sites[body] = sites.get(body, "") + f'<site name="end" pos="{text(s - hung[body])}"/>'
        more += f'<tendon><spatial stiffness="{k}" springlength="{length}">'
        more += '<site site="hook"/><site site="end"/></spatial></tendon>'
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler angle="radian"/><option timestep="{step!r}" integrator="RK4"'
        f' gravity="0 0 {-problem.gravity}" solver="Newton" tolerance="1e-15" iterations="200">'
        f'<flag contact="disable"/></option><worldbody>{ground}{bodies(GROUND)}</worldbody>{more}</mujoco>'
    )
    data = mujoco.MjData(model)
    places = [model.joint(f"j{p.second}").qposadr[0] for p in problem.tree]
    turned, rates = angles(problem, problem.tree)
    if problem.torque:
        data.qfrc_applied[model.joint("j0").dofadr[0]] = problem.torque

    def run() -> Any:
        torque = data.qfrc_applied.copy()
        mujoco.mj_resetData(model, data)
        data.qfrc_applied[:] = torque
        data.qpos[places], data.qvel[places] = turned, rates
        found = []
        for _ in problem.times:
            mujoco.mj_step(model, data, round(parts))
            mujoco.mj_forward(model, data)
            pairs = data.efc_force[: 3 * len(problem.closing)].reshape(-1, 3)[:, [0, 2]]
            found.append(pairs.ravel().copy())
        return np.array(found)

    return run


def pinocchio_tree(problem: Loops, tolerance: float) -> Run:
    """A tree of hinges whose loops are closed by rigid constraints (`constraintDynamics`, without Baumgarte's
    correctors), integrated by SciPy's DOP853; the forces are those of the constraints."""
    import pinocchio as pin

    def at(z: complex) -> Any:
        return pin.SE3(np.eye(3), np.array([z.real, z.imag, 0.0]))

    model = pin.Model()
    model.gravity.linear = np.array([0.0, -problem.gravity, 0.0])
    joints, hung = {GROUND: 0}, {GROUND: 0j}
    tree = downward(problem)  # the order that Pinocchio's factorization expects
    for tie in tree:
        m, J = problem.mechanism.masses[tie.second]
        joint = model.addJoint(
            joints[tie.first],
            pin.JointModelRZ(),
            at(tie.s1 - hung[tie.first]),
            f"joint{tie.second}",
        )
        inertia = pin.Inertia(m, np.array([-tie.s2.real, -tie.s2.imag, 0.0]), J * np.eye(3))
        model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
        joints[tie.second], hung[tie.second] = joint, tie.s2
    data = model.createData()
    ties = [
        pin.RigidConstraintModel(
            pin.ContactType.CONTACT_3D,
            *(model, joints[tie.first], at(tie.s1 - hung[tie.first])),
            *(joints[tie.second], at(tie.s2 - hung[tie.second])),
            pin.ReferenceFrame.LOCAL,
        )
        for tie in problem.closing
    ]
    loops, known = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    for tie in ties:
        loops.append(tie)
        known.append(tie.createData())
    pin.initConstraintDynamics(model, data, loops, known)
    proximal = pin.ProximalSettings(1e-14, 1e-5, 20)
    push = np.zeros(model.nv)
    push[0] = problem.torque
    turned, rates = angles(problem, tree)
    y0, n = np.concatenate([turned, rates]), model.nv

    def accelerations(q: Any, v: Any) -> Any:
        tau = push
        if problem.spring:
            body, s, hook, k, length = problem.spring
            joint = joints[body]
            pin.computeJointJacobians(model, data, q)
            frame = data.oMi[joint]
            end = s - hung[body]
            arm = frame.rotation @ np.array([end.real, end.imag, 0.0])
            d = frame.translation + arm - [hook.real, hook.imag, 0.0]
            size = np.linalg.norm(d)
            pull = -k * (size - length) * d / size
            J = pin.getJointJacobian(model, data, joint, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            tau = push + J[:3].T @ pull + J[3:].T @ np.cross(arm, pull)
        return pin.constraintDynamics(model, data, q, v, tau, loops, known, proximal)

    def run() -> Any:
        rows = []
        for y in by_scipy(accelerations, y0, problem, tolerance):
            accelerations(y[:n], y[n:])
            forces = [-(c.oMc1.rotation @ c.contact_force.linear)[:2] for c in known]
            rows.append(np.concatenate(forces))
        return np.array(rows)

    return run


PEERS = [
    Peer("exudyn, pins, generalized alpha", "exudyn", PARTS, exudyn_pins(False)),
    Peer("exudyn, pins, index 2", "exudyn", PARTS, exudyn_pins(True)),
    Peer("MuJoCo, hinges and `connect`", "mujoco", PARTS, mujoco_tree),
    Peer("Pinocchio, hinges and constraints, SciPy's DOP853", "pin", DECADES, pinocchio_tree),
]
