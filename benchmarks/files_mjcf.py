"""MJCF files against MuJoCo's own equations: python benchmarks/files_mjcf.py [FILE.xml ...]

Without files: the models of gymnasium and of dm_control's suite, as they are installed, then the closed loops
of tests/mjcf.

Of each file that is taken, at a random state: the largest difference of the accelerations of all bodies from
those of MuJoCo's qacc, relative to the largest; of the forces that mj_inverse says these accelerations need
from those that act; the seconds of processor time that reading, assembling and deriving take.  Off are what
`from_mjcf` leaves out and tells, contacts, limits, friction losses, equalities, in MuJoCo's as here.

Of each loop, after half a second: the largest force of its equalities; how far off any joint's is from an
integration with rigid loops (tests/independent/mjcf.py), relative to the largest; then that of MuJoCo's
equalities, which are soft, in the same state and in a run of its own, and how far it is open then.
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

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "independent"))
from mjcf import Rigid
from scipy.linalg import lu_factor, lu_solve

from lagfmu import derive, simulate
from lagfmu.bodies import from_mjcf, mechanism
from lagfmu.errors import LagfmuError
from lagfmu.testing import Form, lower

LOOPS, STOP = Path(__file__).parent.parent / "tests" / "mjcf", 0.5  # s
PACKAGES = {"gymnasium": "envs/mujoco/assets", "dm_control": "suite"}


def accelerations(model: Any) -> dict[str, float]:
    """v' of all speeds at the start of a tree, refined by what M v' - G^T lambda = F, G v' = gamma miss."""
    eom = derive(model)
    system = lower(Form(eom))
    start = {str(s): x for s, x in model.start.items()}
    n = len(model.coordinates)
    values = np.array([start[str(s)] for s in model.states], dtype=float)
    p = [float(x.value) for x in eom.parameters]
    u = [0.0] * len(eom.u)
    M, F, G, _, gamma = map(np.asarray, system.assemble(0.0, values[:n], values[n:], u, p))
    K = np.block([[M, -G.T], [G, np.zeros((len(gamma), len(gamma)))]])
    b, factors = np.concatenate([F, gamma]).astype(np.longdouble), lu_factor(K)
    x = np.zeros(len(b), np.longdouble)
    for _ in range(4):
        x += lu_solve(factors, (b - K.astype(np.longdouble) @ x).astype(float))
    return dict(zip(system.directions, x[: len(F)].astype(float).tolist(), strict=True))


def of_mujoco(m: Any, qpos: Any, qvel: Any) -> tuple[Any, list[tuple[int, Any, Any]]]:
    """Of each body that moves: the acceleration of its frame's origin, and R^T w'; with w and R."""
    d = mujoco.MjData(m)
    m.opt.density = m.opt.viscosity = 0
    m.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    m.body_gravcomp[:] = m.tendon_stiffness[:] = m.tendon_damping[:] = 0
    for a in range(m.nu):
        if m.actuator_trntype[a] > 1 or m.actuator_dyntype[a] or m.actuator_gaintype[a]:
            m.actuator_gainprm[a] = m.actuator_biasprm[a] = 0
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


def compared(path: Path, seed: int = 0) -> tuple[float, float, float, int]:
    """The largest differences of accelerations and forces, relative; seconds; degrees of freedom.  Writes a
    file with a key beside it."""
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
    worst, largest = 0.0, float(np.abs(d.qacc_smooth).max())
    rows, moved = [], []
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
        J, change = np.zeros((6, m.nv)), np.zeros((6, m.nv))
        center = d.xpos[b] + arm
        mujoco.mj_jac(m, d, J[:3], J[3:], center, b)
        mujoco.mj_jacDot(m, d, change[:3], change[3:], center, b)
        rows.append(J)
        moved.append(np.concatenate([mine[0], R @ mine[1]]) - change @ d.qvel)
    return worst / largest, needed(m, d, np.concatenate(rows), np.concatenate(moved)), seconds, m.nv


def needed(m: Any, d: Any, J: Any, moved: Any) -> float:
    """What mj_inverse says the accelerations of the bodies need, less what acts, relative to the largest."""
    acting, bias = d.qfrc_actuator + d.qfrc_passive, d.qfrc_bias.copy()
    d.qacc[:] = np.linalg.lstsq(J, moved, rcond=None)[0]
    mujoco.mj_inverse(m, d)
    found = d.qfrc_inverse + d.qfrc_passive
    return float(np.abs(found - acting).max() / np.abs([found, acting, bias]).max())


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
                    off, forces, seconds, nv = compared(path)
                taken += 1
                print(f"{name:38} {nv:4} {off:9.1e} {forces:9.1e} {seconds:6.1f} s", flush=True)
            except (LagfmuError, ValueError) as error:
                print(f"{name:32} refused: {' '.join(str(error).split())[:300]}", flush=True)
        print(f"{taken} of {len(paths)}")
        for path in () if files else sorted(LOOPS.glob("*.xml")):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                force, off, same, own, gap = closed(path)
            numbers = f"{force:9.4g} N {off:9.1e} {same:9.1e} {own:9.1e} {gap * 1e3:9.2g} mm"
            print(f"{path.stem:14} {numbers}", flush=True)


def closed(path: Path) -> tuple[float, float, float, float, float]:
    """The largest force of an equality; relative to the largest how far off those of joints are here, and of
    equalities MuJoCo's in the same state and in its own run; how far its loops are open then [m]."""
    rigid = Rigid(path, 0)
    state = rigid.moved(np.array([0.0, STOP]))[-1]
    wanted = rigid.forces(state)
    parts = from_mjcf(path, key=rigid.m.key(0).name, limits=False)
    model = mechanism(parts.name, **parts.arguments)
    found = simulate(model, stop_time=STOP, step_size=STOP, tolerance=1e-11)
    largest = max(abs(x) for n, x in wanted.items() if n.startswith("force"))
    told = [n for n in wanted if found[f"unique.{n}"][-1]]
    off = max(abs(found[n][-1] - wanted[n]) for n in told) / largest
    hard = np.linalg.norm(rigid.solve(state)[1], axis=1)
    m = mujoco.MjModel.from_xml_path(str(path))
    m.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    m.opt.timestep, m.opt.integrator = 1e-4, mujoco.mjtIntegrator.mjINT_RK4
    d = mujoco.MjData(m)
    mujoco.mj_resetDataKeyframe(m, d, 0)
    d.qpos[:], d.qvel[:] = state[: m.nq], state[m.nq :]
    same, _ = soft(m, d)
    mujoco.mj_resetDataKeyframe(m, d, 0)
    mujoco.mj_step(m, d, round(STOP / m.opt.timestep))
    own, gap = soft(m, d)
    away = [float(np.abs(of - hard).max() / hard.max()) for of in (same, own)]
    return float(hard.max()), off, *away, float(gap.max())


def soft(m: Any, d: Any) -> tuple[Any, Any]:
    """Of each equality: the magnitude of MuJoCo's force, and how far it is open."""
    mujoco.mj_forward(m, d)
    rows = d.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    return tuple(np.linalg.norm(x[rows].reshape(-1, 3), axis=1) for x in (d.efc_force, d.efc_pos))


if __name__ == "__main__":
    main(sys.argv[1:])
