"""An MJCF file with rigid equalities: MuJoCo's M, bias and Jacobians, its soft constraints left out.

    M v' + c = tau + J^T f ,   J v' + J' v = 0        J of each connect, weld, polynomial of two joints

A state is qpos, qvel.  The joint forces are Newton's and Euler's for what hangs on each joint, with f at the
ends of the equalities.  The integration is SciPy's DOP853 at 1e-12; nothing holds the constraints.
None of lagfmu is used.
"""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
from linkage import least
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Vector = NDArray[np.float64]
CONNECT, WELD, JOINT = range(3)
SITE = int(mujoco.mjtObj.mjOBJ_SITE)
BALLS = {0: 3, 1: 0}  # free, ball: how many numbers stand before the quaternion


class Rigid:
    """A file, at a key frame."""

    def __init__(self, file: Path, key: int = -1) -> None:
        self.m = mujoco.MjModel.from_xml_path(str(file))
        self.d = mujoco.MjData(self.m)
        off = mujoco.mjtDisableBit
        self.m.opt.disableflags |= int(off.mjDSBL_CONSTRAINT)
        mujoco.mj_kinematics(self.m, self.d)
        self.axes = self.d.xaxis.copy()
        self.turned = self.d.xmat.reshape(-1, 3, 3).copy()
        if key >= 0:
            mujoco.mj_resetDataKeyframe(self.m, self.d, key)
        self.begin = np.concatenate([self.d.qpos, self.d.qvel])

    def look(self, y: Vector) -> None:
        """Everything at a state."""
        m, d = self.m, self.d
        d.qpos[:], d.qvel[:] = y[: m.nq], y[m.nq :]
        mujoco.mj_forward(m, d)

    def jacobian(self, b: int, point: Vector) -> tuple[Vector, Vector]:
        """Of a point of a body and of the body's turning, (6, nv), and its derivative."""
        J, change = np.zeros((6, self.m.nv)), np.zeros((6, self.m.nv))
        mujoco.mj_jac(self.m, self.d, J[:3], J[3:], point, b)
        mujoco.mj_jacDot(self.m, self.d, change[:3], change[3:], point, b)
        return J, change

    def ends(self, e: int) -> list[tuple[int, Vector]]:
        """The two bodies that an equality ties, and the points where."""
        m, d, data = self.m, self.d, self.m.eq_data[e]
        those = int(m.eq_obj1id[e]), int(m.eq_obj2id[e])
        if m.eq_objtype[e] == SITE:
            return [(int(m.site_bodyid[s]), d.site_xpos[s].copy()) for s in those]
        points = (data[:3], data[3:6]) if m.eq_type[e] == CONNECT else (data[3:6], data[:3])
        return [
            (b, d.xpos[b] + d.xmat[b].reshape(3, 3) @ p) for b, p in zip(those, points, strict=True)
        ]

    def rows(self, e: int) -> tuple[Vector, Vector]:
        """J and J' v of an equality; f is what the second body receives, a torque about its point."""
        m, d = self.m, self.d
        if m.eq_type[e] == JOINT:
            J, bend = np.zeros((1, m.nv)), 0.0
            one, two = int(m.eq_obj1id[e]), int(m.eq_obj2id[e])
            J[0, m.jnt_dofadr[one]] = 1
            if two >= 0:
                k = int(m.jnt_dofadr[two])
                x = d.qpos[m.jnt_qposadr[two]] - m.qpos0[m.jnt_qposadr[two]]
                p = np.polynomial.Polynomial(m.eq_data[e][:5])
                J[0, k] = -p.deriv()(x)
                bend = -p.deriv(2)(x) * d.qvel[k] ** 2
            return J, np.array([bend])
        (a, one), (b, two) = self.ends(e)
        (J1, D1), (J2, D2) = self.jacobian(a, one), self.jacobian(b, two)
        n = 3 if m.eq_type[e] == CONNECT else 6
        return (J2 - J1)[:n], (D2 - D1)[:n] @ d.qvel

    def solve(self, y: Vector) -> tuple[Vector, list[Vector]]:
        """v', and f of each equality: of those that fit the one with the least norm."""
        m, d = self.m, self.d
        self.look(y)
        M = np.zeros((m.nv, m.nv))
        mujoco.mj_fullM(m, d, M)
        free = np.linalg.solve(M, d.qfrc_passive + d.qfrc_actuator - d.qfrc_bias)
        parts = [self.rows(e) for e in range(m.neq)]
        if not parts:
            return free, []
        J, bend = (np.concatenate([p[k] for p in parts]) for k in (0, 1))
        root = np.linalg.cholesky(M)
        A = np.linalg.solve(root, J.T).T
        f = np.linalg.lstsq(A @ A.T, -bend - J @ free, rcond=1e-12)[0]
        cuts = np.cumsum([len(p[1]) for p in parts])[:-1]
        return free + np.linalg.solve(M, J.T @ f), np.split(f, cuts)

    def rate(self, _: float, y: Vector) -> Vector:
        """y'."""
        m = self.m
        v, dq = y[m.nq :], np.zeros(m.nq)
        for j in range(m.njnt):
            q, k, kind = int(m.jnt_qposadr[j]), int(m.jnt_dofadr[j]), int(m.jnt_type[j])
            if kind not in BALLS:
                dq[q] = v[k]
                continue
            n = BALLS[kind]
            dq[q : q + n] = v[k : k + n]
            w, u, p = v[k + n : k + n + 3], y[q + n + 1 : q + n + 4], y[q + n]
            dq[q + n] = -(u @ w) / 2
            dq[q + n + 1 : q + n + 4] = (p * w + np.cross(u, w)) / 2
        return np.concatenate([dq, self.solve(y)[0]])

    def moved(self, times: Vector) -> Vector:
        """The states at these times."""
        found = solve_ivp(
            self.rate,
            (0.0, float(times[-1])),
            self.begin,
            "DOP853",
            times,
            rtol=1e-12,
            atol=1e-13,
        )
        return np.asarray(found.y.T)

    def forces(self, y: Vector) -> dict[str, float]:
        """force.J.x, .y, .z of hinges, slides and equalities, in the axes of the first body that are the
        second's as the file has them, z that of the joint; torque.J.x, .y of lone hinges."""
        vdot, f = self.solve(y)
        m, d = self.m, self.d
        found: dict[str, float] = {}
        pushed = np.zeros((m.nbody, 6))  # by equalities, about the origin
        for e, part in enumerate(f):
            if m.eq_type[e] == JOINT:
                continue
            (a, _), (b, point) = self.ends(e)
            force, torque = part[:3], part[3:] if len(part) == 6 else np.zeros(3)
            wrench = np.concatenate([force, torque + np.cross(point, force)])
            pushed[a] -= wrench
            pushed[b] += wrench
            axes = d.xmat[b if len(part) == 6 else a].reshape(
                3, 3
            )  # a weld's are those of its second
            if m.eq_objtype[e] == SITE:
                axes = d.site_xmat[m.eq_obj1id[e]].reshape(3, 3)
            name = mujoco.mj_id2name(m, mujoco.mjtObj.mjOBJ_EQUALITY, e)
            found |= named(f"force.{name}", axes.T @ force)
            if len(part) == 6:
                found |= named(f"torque.{name}", axes.T @ torque)
        hung = np.zeros((m.nbody, 6))
        for b in range(m.nbody - 1, 0, -1):
            J, change = self.jacobian(b, d.xipos[b])
            a, w = J @ vdot + change @ d.qvel, J[3:] @ d.qvel
            R = d.ximat[b].reshape(3, 3)
            inertia = R @ np.diag(m.body_inertia[b]) @ R.T
            force = m.body_mass[b] * (a[:3] - m.opt.gravity)
            torque = inertia @ a[3:] + np.cross(w, inertia @ w) + np.cross(d.xipos[b], force)
            hung[b] += [*force, *torque] - pushed[b]
            hung[m.body_parentid[b]] += hung[b]
            found |= self._joint(b, hung[b])
        return found

    def _joint(self, b: int, wrench: Vector) -> dict[str, float]:
        m, d = self.m, self.d
        if m.body_jntnum[b] != 1 or m.jnt_type[m.body_jntadr[b]] not in (2, 3):
            return {}
        j, parent = int(m.body_jntadr[b]), int(m.body_parentid[b])
        own, on = self.turned[b], d.xmat[parent].reshape(3, 3) @ self.turned[parent].T
        axes = on @ own @ least(own.T @ self.axes[j])
        name = mujoco.mj_id2name(m, mujoco.mjtObj.mjOBJ_JOINT, j)
        found = named(f"force.{name}", axes.T @ wrench[:3])
        if m.jnt_type[j] == 3:
            torque = wrench[3:] - np.cross(d.xanchor[j], wrench[:3])
            found |= named(f"torque.{name}", axes.T @ torque)
            del found[f"torque.{name}.z"]  # motors, springs and rotors beside the rows
        else:
            del found[f"force.{name}.z"]
        return found


def named(name: str, vector: Vector) -> dict[str, float]:
    """NAME.x, NAME.y, NAME.z."""
    return {f"{name}.{x}": float(v) for x, v in zip("xyz", vector, strict=True)}
