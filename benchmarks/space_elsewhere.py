"""The mechanisms of space.py in other simulators from PyPI, each as its own manual would have it.

A peer prepares the model once and answers a run from the start, which gives m (a + g) [N] of all bodies
(samples, 3 n), in the axes of the ground.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from linkage import Tie
from loops_elsewhere import PARTS
from rods_elsewhere import DECADES, Peer, Run, by_scipy
from space import Space
from space_drake import drake_tree
from space_heyoka import heyoka_tree
from system import G

UP = np.array([0.0, 0.0, 1.0])


def exudyn_bodies(index2: bool) -> Callable[[Space, float], Run]:
    """Rigid bodies by Euler parameters with joints between them, whose accelerations sensors record; rows
    that depend on others are left to its solver for singular matrices."""

    def prepare(problem: Space, parts: float) -> Run:
        import exudyn
        import exudyn.itemInterface
        from exudyn.rigidBodyUtilities import RigidBodyInertia

        linkage, system = problem.linkage, exudyn.SystemContainer().AddSystem()
        _, y = linkage.reference()
        numbers = {"ground": system.CreateGround()}
        for (name, (mass, place)), part in zip(
            linkage.bodies.items(), y.reshape(-1, 13), strict=True
        ):
            numbers[name] = system.CreateRigidBody(
                inertia=RigidBodyInertia(mass=mass.m, inertiaTensor=mass.J),
                referencePosition=list(place),
                initialVelocity=part[7:10].tolist(),
                initialAngularVelocity=part[10:].tolist(),
                gravity=[0, 0, -linkage.gravity],
            )
        for tie in linkage.ties.values():
            joint = {"hinge": system.CreateRevoluteJoint, "slide": system.CreatePrismaticJoint}
            joint[tie.kind](
                bodyNumbers=[numbers[tie.first], numbers[tie.second]],
                position=list(tie.point),
                axis=list(tie.axis),
                useGlobalFrame=True,
            )
        for s in linkage.springs:
            system.CreateSpringDamper(
                bodyNumbers=[numbers[s.first], numbers[s.second]],
                localPosition0=linkage.arm(s.first, s.point).tolist(),
                localPosition1=linkage.arm(s.second, s.other).tolist(),
                referenceLength=s.length,
                stiffness=s.k,
                damping=s.c,
            )
        sensors = [
            system.AddSensor(
                exudyn.itemInterface.SensorBody(
                    bodyNumber=numbers[name],
                    storeInternal=True,
                    outputVariableType=exudyn.OutputVariableType.Acceleration,
                )
            )
            for name in linkage.bodies
        ]
        system.Assemble()
        settings = exudyn.SimulationSettings()
        settings.timeIntegration.endTime = problem.stop
        settings.timeIntegration.numberOfSteps = round(len(problem.times) * parts)
        settings.timeIntegration.verboseMode = 0
        settings.timeIntegration.newton.relativeTolerance = 1e-12
        settings.timeIntegration.newton.absoluteTolerance = 1e-14
        settings.timeIntegration.generalizedAlpha.computeInitialAccelerations = True
        settings.linearSolverType = exudyn.LinearSolverType.EigenDense
        settings.linearSolverSettings.ignoreSingularJacobian = True
        settings.solution.sensors.writePeriod = problem.step
        settings.solution.file.write = False
        kind = exudyn.DynamicSolverType
        solver = kind.TrapezoidalIndex2 if index2 else kind.GeneralizedAlpha

        def run() -> Any:
            system.SolveDynamic(settings, solverType=solver)
            recorded = [system.GetSensorStoredData(s)[-len(problem.times) :, 1:4] for s in sensors]
            return problem.read(np.concatenate(recorded, axis=1))

        return run

    return prepare


def text(vector: Any) -> str:
    """For MuJoCo's XML."""
    return " ".join(map(repr, np.asarray(vector, dtype=float).tolist()))


def mujoco_tree(problem: Space, parts: float) -> Run:
    """A tree of hinges and slides; its soft `connect`, as hard as it goes, at two points of the axis closes
    the loop.  Fourth-order Runge-Kutta."""
    import mujoco

    linkage, step = problem.linkage, problem.step / parts

    def sites(name: str) -> str:
        ends = [(f"a{k}", s.first, s.point) for k, s in enumerate(linkage.springs)]
        ends += [(f"b{k}", s.second, s.other) for k, s in enumerate(linkage.springs)]
        found = (
            f'<site name="{n}" pos="{text(linkage.arm(of, p))}"/>'
            for n, of, p in ends
            if of == name
        )
        return "".join(found)

    def bodies(parent: str) -> str:
        found = sites(parent)
        for k, tie in enumerate(problem.tree):
            if tie.first != parent:
                continue
            mass, name, J = (
                linkage.bodies[tie.second][0],
                tie.second,
                linkage.bodies[tie.second][0].J,
            )
            tensor = text([*J.diagonal(), J[0, 1], J[0, 2], J[1, 2]])
            at, hung = problem.place(name) - problem.place(parent), linkage.arm(name, tie.point)
            found += f'<body name="{name}" pos="{text(at)}"><joint name="j{k}" type="{tie.kind}"'
            found += f' pos="{text(hung)}" axis="{text(tie.axis)}"/><inertial pos="0 0 0"'
            found += f' mass="{mass.m}" fullinertia="{tensor}"/>{bodies(name)}</body>'
        return found

    ties = ""
    for tie in problem.closing:  # back to the ground
        soft = f'solref="{2 * step} 1" solimp="0.9999 0.9999 0.001"'
        for along in (0, 1):
            anchor = linkage.arm(tie.first, tie.point) + along * np.asarray(tie.axis)
            ties += f'<connect body1="{tie.first}" anchor="{text(anchor)}" {soft}/>'
    springs = "".join(
        f'<spatial stiffness="{s.k}" damping="{s.c}" springlength="{s.length}"><site site="a{k}"/>'
        f'<site site="b{k}"/></spatial>'
        for k, s in enumerate(linkage.springs)
    )
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler angle="radian"/><option timestep="{step!r}" integrator="RK4" gravity="0 0 {-G}"'
        ' solver="Newton" tolerance="1e-15" iterations="200"><flag contact="disable"/></option>'
        f"<worldbody>{bodies('ground')}</worldbody><equality>{ties}</equality><tendon>{springs}</tendon>"
        "</mujoco>"
    )
    data = mujoco.MjData(model)
    places = [model.joint(f"j{k}").dofadr[0] for k in range(len(problem.tree))]
    numbers = [model.body(name).id for name in linkage.bodies]
    felt = np.zeros(6)

    def run() -> Any:
        mujoco.mj_resetData(model, data)
        data.qvel[places] = list(problem.rates())
        found = []
        for _ in problem.times:
            mujoco.mj_step(model, data, round(parts))
            mujoco.mj_forward(model, data)
            mujoco.mj_rnePostConstraint(model, data)
            row = []
            for number in numbers:  # accelerations as one feels them, a + g
                kind = mujoco.mjtObj.mjOBJ_BODY
                mujoco.mj_objectAcceleration(model, data, kind, number, felt, 0)
                row += felt[3:].tolist()
            found.append(row)
        return problem.masses * np.array(found)

    return run


def pinocchio_tree(problem: Space, tolerance: float) -> Run:
    """A tree of hinges and slides whose loop is closed by rigid constraints at two points of the axis
    (`constraintDynamics`, without Baumgarte's correctors), integrated by SciPy's DOP853."""
    import pinocchio as pin

    linkage = problem.linkage
    model = pin.Model()
    model.gravity.linear = -G * UP
    joints, hung, frames = {"ground": 0}, {"ground": np.zeros(3)}, {}

    def at(point: Any) -> Any:
        return pin.SE3(np.eye(3), np.asarray(point, dtype=float))

    def axis(tie: Tie) -> Any:
        made = (
            pin.JointModelRevoluteUnaligned
            if tie.kind == "hinge"
            else pin.JointModelPrismaticUnaligned
        )
        return made(np.asarray(tie.axis, dtype=float))

    for tie in problem.tree:
        mass, name = linkage.bodies[tie.second][0], tie.second
        origin = np.asarray(tie.point, dtype=float)
        joints[name] = model.addJoint(
            joints[tie.first], axis(tie), at(origin - hung[tie.first]), name
        )
        hung[name], center = origin, problem.place(name) - origin
        model.appendBodyToJoint(
            joints[name], pin.Inertia(mass.m, center, mass.J), pin.SE3.Identity()
        )
        frame = pin.Frame(f"{name} center", joints[name], 0, at(center), pin.FrameType.OP_FRAME)
        frames[name] = model.addFrame(frame)
    data = model.createData()
    loops, known = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    for tie in problem.closing:
        for along in (0, 1):
            point = np.asarray(tie.point) + along * np.asarray(tie.axis)
            ends = [(joints[b], at(point - hung[b])) for b in (tie.first, tie.second)]
            one = pin.RigidConstraintModel(
                pin.ContactType.CONTACT_3D, model, *ends[0], *ends[1], pin.ReferenceFrame.LOCAL
            )
            loops.append(one)
            known.append(one.createData())
    pin.initConstraintDynamics(model, data, loops, known)
    proximal = pin.ProximalSettings(1e-14, 1e-5, 20)
    n, aligned = model.nv, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    y0 = np.concatenate([np.zeros(n), list(problem.rates())])

    def end(body: str, point: Any, q: Any, v: Any) -> tuple[Any, Any, Any]:
        """Of a place of the start: where it is, its velocity, its Jacobian (3, n)."""
        J = pin.getJointJacobian(model, data, joints[body], aligned)
        frame = data.oMi[joints[body]]
        arm = frame.rotation @ (np.asarray(point) - hung[body])
        slope = J[:3] - pin.skew(arm) @ J[3:]
        return frame.translation + arm, slope @ v, slope

    def accelerations(q: Any, v: Any) -> Any:
        tau = np.zeros(n)
        if linkage.springs:
            pin.computeJointJacobians(model, data, q)
        for s in linkage.springs:
            (p, vp, Jp), (r, vr, Jr) = end(s.first, s.point, q, v), end(s.second, s.other, q, v)
            tau += (Jr - Jp).T @ s.pull(r - p, vr - vp)
        if not problem.closing:
            return pin.aba(model, data, q, v, tau)
        return pin.constraintDynamics(model, data, q, v, tau, loops, known, proximal)

    def run() -> Any:
        rows = []
        for y in by_scipy(accelerations, y0, problem, tolerance):
            a = accelerations(y[:n], y[n:]).copy()
            pin.forwardKinematics(model, data, y[:n], y[n:], a)
            rows.append(
                np.concatenate(
                    [
                        pin.getFrameClassicalAcceleration(model, data, frame, aligned).linear
                        for frame in frames.values()
                    ]
                )
            )
        return problem.read(np.array(rows))

    return run


PEERS = [
    Peer("Drake, joints and bushings, third order", "drake", DECADES, drake_tree("runge_kutta3")),
    Peer("Drake, joints and bushings, Radau", "drake", DECADES[:8], drake_tree("radau3")),
    Peer("exudyn, bodies, generalized alpha", "exudyn", PARTS, exudyn_bodies(False)),
    Peer("exudyn, bodies, index 2", "exudyn", PARTS, exudyn_bodies(True)),
    Peer("heyoka, joints by its own differentiation", "heyoka", DECADES[2:], heyoka_tree),
    Peer("MuJoCo, hinges and `connect`", "mujoco", PARTS, mujoco_tree),
    Peer("Pinocchio, hinges and constraints, SciPy's DOP853", "pin", DECADES, pinocchio_tree),
]
