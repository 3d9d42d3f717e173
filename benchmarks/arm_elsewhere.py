"""The wrenches in the joints of models/arm.py against Pinocchio, which reads the same URDF file itself.

    pip install pin
    python benchmarks/arm_elsewhere.py

The largest difference over the motion, relative to the largest force or torque, of the drives' torques and of
all six components in each joint.  A joint's marker has its z axis along the axis of the joint, from the frame
of URDF by the least rotation.
"""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio

from lagfmu import simulate
from lagfmu.model.file import load

sys.path.insert(0, str(Path(__file__).parent / "independent"))
from linkage import least

ARM = Path(__file__).parent.parent / "models" / "arm.py"
STOP, POINTS = 3.0, 31


def main() -> None:
    """One line."""
    text = ARM.with_name("arm.urdf")
    there = pinocchio.buildModelFromUrdf(str(text))
    there.gravity.linear = np.array([0, 0, -9.81])
    data = there.createData()
    axes = {
        joint.get("name"): [float(x) for x in joint.find("axis").get("xyz").split()]
        for joint in ElementTree.parse(text).getroot().findall("joint")
        if joint.get("type") != "fixed"
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        run = simulate(load(ARM).model, stop_time=STOP, step_size=STOP / (POINTS - 1))
    joints = [*enumerate(there.names[1:], 1)]
    size = worst = 0.0
    for row in run:
        angle, v, a = (
            np.array([row[name % joint] for _, joint in joints])
            for name in ("angle.%s", "der(angle.%s)", "der(angle.%s,2)")
        )
        q = []
        for x, (k, _) in zip(angle, joints, strict=True):  # one without limits is cos, sin
            q += [np.cos(x), np.sin(x)] if there.joints[k].nq == 2 else [x]
        torques = pinocchio.rnea(there, data, np.array(q), v, a)
        for k, joint in joints:
            turn = there.jointPlacements[k].rotation.T @ data.liMi[k].rotation
            turn = least(axes[joint]).T @ turn
            wanted = np.array([*(turn @ data.f[k].linear), *(turn @ data.f[k].angular)])
            found = [row[f"{what}.{joint}.{x}"] for what in ("force", "torque") for x in "xyz"]
            drive = row[f"lambda.motor_{joint}"] - torques[k - 1]
            worst = max(worst, np.abs(found - wanted).max(), abs(drive))
            size = max(size, np.abs(wanted).max())
    print(f"{len(run)} points: {worst / size:.1e} of {size:.0f} N or N m")


if __name__ == "__main__":
    main()
