"""The wrenches in the joints of models/arm.py against Pinocchio, which reads the same URDF file itself.

    pip install pin
    python benchmarks/arm_elsewhere.py [FILE.urdf]

The largest difference over the motion, relative to the largest force or torque, of the drives' torques and of
all six components in each joint.  A joint's marker has its z axis along the axis of the joint, from the frame
of URDF by the least rotation.  The links of another file fall, each joint beginning at 0 with a rate of 1.
"""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio

from lagfmu import Model, simulate
from lagfmu.bodies import Gravity, from_urdf, mechanism
from lagfmu.model.file import load
from lagfmu.names import derivative

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "independent"))
from linkage import least

ARM = Path(__file__).parent.parent / "models" / "arm.py"
STOP, POINTS = 3.0, 31


def falling(file: Path) -> Model:
    """The links of a file that fall."""
    parts = from_urdf(file, limits=False)
    start = {derivative(name): 1.0 for joint in parts.joints for name in joint.measures}
    loads = [Gravity((0, 0, -9.81)), *parts.loads]
    return mechanism("Falling", bodies=parts.bodies, joints=parts.joints, loads=loads, start=start)


def main() -> None:
    """One line."""
    given = [Path(a) for a in sys.argv[1:2]]
    text = given[0] if given else ARM.with_name("arm.urdf")
    model, stop = (falling(text), STOP / 10) if given else (load(ARM).model, STOP)
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
        run = simulate(model, stop_time=stop, step_size=stop / (POINTS - 1))
    joints = [*enumerate(there.names[1:], 1)]
    shown = run.dtype.names
    called = [next(n for n in (f"angle.{j}", f"position.{j}") if n in shown) for _, j in joints]
    size = worst = 0.0
    for row in run:
        angle, v, a = (
            np.array([row[derivative(name, order)] for name in called]) for order in range(3)
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
            drive = (0.0 if given else row[f"lambda.motor_{joint}"]) - torques[k - 1]
            worst = max(worst, np.abs(found - wanted).max(), abs(drive))
            size = max(size, np.abs(wanted).max())
    print(f"{len(run)} points: {worst / size:.1e} of {size:.0f} N or N m")


if __name__ == "__main__":
    main()
