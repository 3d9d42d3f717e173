"""MJCF files against MuJoCo's own accelerations: python benchmarks/files_mjcf.py [FILE.xml ...]

Without files: the models of gymnasium and of dm_control's suite, as they are installed.  Of each file that is
taken: the largest difference of the accelerations of all bodies from MuJoCo's at a random state, relative to
the largest, and the seconds of processor time that reading, assembling and deriving take.  Contacts, limits,
friction losses, equalities and fluids are off in MuJoCo's, limits and equalities here.
"""

from __future__ import annotations

import importlib.util
import shutil
import sys
import tempfile
import time
import warnings
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from lagfmu import derive
from lagfmu.bodies import from_mjcf, mechanism
from lagfmu.errors import LagfmuError
from lagfmu.testing import Form, lower

PACKAGES = {"gymnasium": "envs/mujoco/assets", "dm_control": "suite"}


def accelerations(model: Any) -> dict[str, float]:
    """v' of all speeds at the start of a mechanism: minimize (v' - M^-1 F)^T M (...) with G v' = gamma."""
    eom = derive(model)
    system = lower(Form(eom))
    start = {str(s): x for s, x in model.start.items()}
    n = len(model.coordinates)
    values = np.array([start[str(s)] for s in model.states], dtype=float)
    p = [float(x.value) for x in eom.parameters]
    u = [0.0] * len(eom.u)
    M, F, G, _, gamma = map(np.asarray, system.assemble(0.0, values[:n], values[n:], u, p))
    root = np.linalg.cholesky(M)
    free, A = np.linalg.solve(root, F), np.linalg.solve(root, G.T).T
    if len(gamma):
        free = free + np.linalg.lstsq(A, gamma - A @ free, rcond=1e-11)[0]
    return dict(zip(system.directions, np.linalg.solve(root.T, free).tolist(), strict=True))


def of_mujoco(m: Any, qpos: Any, qvel: Any) -> tuple[Any, list[tuple[int, Any, Any]]]:
    """Of each body that moves: the acceleration of its frame's origin, and R^T w'; with w and R."""
    d = mujoco.MjData(m)
    m.opt.density = m.opt.viscosity = 0
    m.body_gravcomp[:] = 0
    d.qpos[:], d.qvel[:] = qpos, qvel
    mujoco.mj_forward(m, d)
    found = []
    for b in range(1, m.nbody):
        J, change = np.zeros((6, m.nv)), np.zeros((6, m.nv))
        mujoco.mj_jac(m, d, J[:3], J[3:], d.xpos[b], b)
        mujoco.mj_jacDot(m, d, change[:3], change[3:], d.xpos[b], b)
        found.append((b, J @ d.qacc_smooth + change @ d.qvel, J @ d.qvel))
    return d, found


def random_state(m: Any, seed: int) -> tuple[Any, Any]:
    """Somewhere within a radian and a metre of the file's configuration."""
    rng = np.random.default_rng(seed)
    qpos = np.array(m.qpos0)
    mujoco.mj_integratePos(m, qpos, rng.uniform(-1, 1, m.nv), 1.0)
    return qpos, rng.uniform(-1, 1, m.nv)


def compared(path: Path, seed: int = 0) -> tuple[float, float, int]:
    """The largest difference, relative; seconds; degrees of freedom.  Writes a file with a key beside it."""
    m = mujoco.MjModel.from_xml_path(str(path))
    qpos, qvel = random_state(m, seed)
    numbers = (" ".join(map(repr, x.tolist())) for x in (qpos, qvel))
    key = '<keyframe><key name="random" qpos="{}" qvel="{}"/></keyframe></mujoco>'.format(*numbers)
    text = path.read_text()
    keyed = path.with_name(f"{path.stem}_random.xml")
    keyed.write_text(text[: text.rindex("</mujoco>")] + key)
    before = time.process_time()
    parts = from_mjcf(keyed, limits=False, key="random")
    joints = [_slippery(j) for j in parts.joints if j.name not in _equalities(m)]
    model = mechanism(parts.name, **{**parts.arguments, "joints": joints})
    found = accelerations(model)
    seconds = time.process_time() - before
    d, wanted = of_mujoco(m, qpos, qvel)
    bodies = {b.name: b for b in parts.bodies}
    worst = largest = 0.0
    for b, acceleration, rates in wanted:
        name = mujoco.mj_id2name(m, mujoco.mjtObj.mjOBJ_BODY, b) or f"body{b}"
        body = next((x for n, x in bodies.items() if n in (name, f"{name}_body")), None)
        if body is None:
            continue
        R = d.xmat[b].reshape(3, 3)
        arm = R @ np.array(body.center)
        w, dw = rates[3:], acceleration[3:]
        straight = acceleration[:3] + np.cross(dw, arm) + np.cross(w, np.cross(w, arm))
        mine = [[found[f"{body.name}.{what}.{x}"] for x in "xyz"] for what in ("position", "omega")]
        difference = np.concatenate([mine[0] - straight, mine[1] - R.T @ dw])
        worst = max(worst, float(np.abs(difference).max()))
        largest = max(largest, float(np.abs([straight, acceleration[:3], dw]).max()))
    return worst / largest, seconds, m.nv


def _slippery(joint: Any) -> Any:
    names = {"friction_torque", "friction_force"} & {f.name for f in fields(joint)}
    return replace(joint, **dict.fromkeys(names)) if names else joint


def _equalities(m: Any) -> set[str]:
    kind = mujoco.mjtObj.mjOBJ_EQUALITY
    return {mujoco.mj_id2name(m, kind, e) or f"equality{e}" for e in range(m.neq)}


def installed(into: Path) -> list[Path]:
    """Copies of the files of both packages."""
    found = []
    for package, folder in PACKAGES.items():
        spec = importlib.util.find_spec(package)
        if spec is None or spec.origin is None:
            print(f"{package} is not installed")
            continue
        shutil.copytree(Path(spec.origin).parent / folder, into / package)
        found += sorted((into / package).glob("*.xml"))
    return found


def main(files: list[str]) -> None:
    """A line for each file."""
    taken = 0
    with tempfile.TemporaryDirectory() as folder, np.errstate(all="ignore"):
        paths = installed(Path(folder))
        if files:
            paths = [Path(shutil.copy(file, folder)) for file in files]
        for path in paths:
            name = f"{path.parent.name}/{path.name}"
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    off, seconds, nv = compared(path)
                taken += 1
                print(f"{name:32} {nv:4} {off:8.1e} {seconds:7.1f} s", flush=True)
            except (LagfmuError, ValueError) as error:
                print(f"{name:32} refused: {' '.join(str(error).split())[:300]}", flush=True)
    print(f"{taken} of {len(paths)}")


if __name__ == "__main__":
    main(sys.argv[1:])
