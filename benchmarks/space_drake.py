"""The mechanisms of space.py in Drake: trees of hinges and slides, springs, bushings that close loops.

Drake has no constraint in continuous time; its manual closes a four-bar linkage by a
`LinearBushingRollPitchYaw`, a stiff spring of six directions, free about the hinge's axis.  Where one is
needed its stiffness is such that joints give way by the accuracy asked for, critically damped.
"""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt
from typing import Any

import numpy as np
from linkage import least
from rods_elsewhere import Run
from space import Space
from system import G

LOAD = 10.0  # N, of a joint that gives way
LEAST = 1e-8  # m, by which it does


def drake_tree(scheme: str) -> Callable[[Space, float], Run]:
    """Continuous time, error control; accelerations of bodies are an output of the plant."""

    def prepare(problem: Space, accuracy: float) -> Run:
        from pydrake import all as drake

        linkage, plant = problem.linkage, drake.MultibodyPlant(0.0)
        plant.mutable_gravity_field().set_gravity_vector([0, 0, -G])
        bodies = {"ground": plant.world_body()}
        for name, (mass, _) in linkage.bodies.items():
            J = mass.J
            parts = (*J.diagonal(), J[0, 1], J[0, 2], J[1, 2])
            inertia = drake.RotationalInertia(*parts)
            made = drake.SpatialInertia.MakeFromCentralInertia(mass.m, [0, 0, 0], inertia)
            bodies[name] = plant.AddRigidBody(name, made)

        def frame(tie: Any, body: str) -> Any:
            """At the tie, z along its axis."""
            at = drake.RigidTransform(
                drake.RotationMatrix(least(tie.axis)), linkage.arm(body, tie.point)
            )
            name = f"{body} {tie.first} {tie.second}"
            return plant.AddFrame(drake.FixedOffsetFrame(name, bodies[body].body_frame(), at))

        kinds = {"hinge": drake.RevoluteJoint, "slide": drake.PrismaticJoint}
        joints = [
            plant.AddJoint(
                kinds[tie.kind](
                    f"j{k}", frame(tie, tie.first), frame(tie, tie.second), np.array([0.0, 0, 1])
                )
            )
            for k, tie in enumerate(problem.tree)
        ]
        for s in linkage.springs:
            ends = [
                (bodies[b], linkage.arm(b, p)) for b, p in ((s.first, s.point), (s.second, s.other))
            ]
            plant.AddForceElement(drake.LinearSpringDamper(*ends[0], *ends[1], s.length, s.k, s.c))
        for tie in problem.closing:
            k = LOAD / max(accuracy, LEAST)  # N/m, at a lever of 1 m N m/rad
            d = 2 * sqrt(k * min(mass.m for mass, _ in linkage.bodies.values()))
            bushing = [[k, k, 0.0], [d, d, 0.0], [k] * 3, [d] * 3]
            ends = [frame(tie, tie.first), frame(tie, tie.second)]
            plant.AddForceElement(drake.LinearBushingRollPitchYaw(*ends, *bushing))
        plant.Finalize()
        context = plant.CreateDefaultContext()
        simulator = drake.Simulator(plant, context)
        drake.ResetIntegratorFromFlags(simulator, scheme, problem.step)
        simulator.get_mutable_integrator().set_target_accuracy(accuracy)
        accelerations = plant.get_body_spatial_accelerations_output_port()
        numbers = [bodies[name].index() for name in linkage.bodies]
        v0 = np.zeros(len(joints))
        v0[[joint.velocity_start() for joint in joints]] = list(problem.rates())

        def run() -> Any:
            context.SetTime(0.0)
            plant.SetPositions(context, np.zeros(len(joints)))
            plant.SetVelocities(context, v0)
            simulator.get_mutable_integrator().request_initial_step_size_target(1e-3)
            simulator.Initialize()
            rows = []
            for t in problem.times:
                simulator.AdvanceTo(t)
                found = accelerations.Eval(context)
                rows.append(np.concatenate([found[k].translational() for k in numbers]))
            return problem.read(np.array(rows))

        return run

    return prepare
