"""Bodies and joints from an MJCF file, as MuJoCo compiles it.

A body keeps its frame, a joint its name and its coordinate: angle.J and position.J are those of the file.
Constraints are rigid here.  The world is the ground, a body without joints a part of what it is on.

The model that an MJCF file is by itself: all of it, with its own gravity and its actuators, or others.
"""

from __future__ import annotations

import contextlib
import os
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp
from numpy.polynomial import Polynomial
from numpy.typing import NDArray
from sympy.physics.vector import dynamicsymbols

from ..errors import LagfmuWarning, ModelError
from ..files import foreign
from ..model.elements import Input, Parameter
from ..model.model import Model
from ..model.picture import Box, Rod, Shape, Sphere
from ..names import RESERVED
from .body import Body, Ground, Marker, onto, turn, turned_by
from .check_files import problems_of_files
from .joints import Fixed, Gear, Joint, Prismatic, Revolute, Spherical
from .loads import Gravity, Motor, Rotor, SpringDamper, Torsion
from .markup import chosen, components, letters, motors, together
from .mechanism import mechanism
from .motion import AXES
from .series import Series

Array = NDArray[np.float64]
FREE, BALL, SLIDE, HINGE = range(4)  # MuJoCo's mjtJoint
CONNECT, WELD, JOINT = range(3)  # mjtEq
SITE, SITE_OF_TENDON = 6, 3  # mjtObj, mjtWrap
SPHERE, CAPSULE, CYLINDER, BOX = 2, 3, 5, 6  # mjtGeom
NO_GRAVITY = 1 << 7  # mjtDisableBit
# transmission joint or joint in parent, no dynamics, a fixed gain, no bias or an affine one
BY_JOINT = {(transmission, 0, 0, bias) for transmission in (0, 1) for bias in (0, 1)}
OPEN = 1e-2  # m or rad: what an equality may miss at the start, written with few digits, untold
LARGEST = 1e60  # numbers of a compiled model: products of a few of them are finite
SQUARE = 1e-9  # cosine of two axes that are square, and what two points may differ by, relative


@dataclass(frozen=True)
class MjcfParts:
    """What an MJCF file holds: `mechanism(parts.name, **parts.arguments)`, or its lists by themselves.

    `loads` are gravity, springs, dampers, rotors and actuators; `frames` are the sites; `start` and, of
    joints that equalities tie, `near` are the configuration of the file, or a key frame of it.
    """

    name: str
    ground: Ground
    bodies: tuple[Body, ...]
    joints: tuple[Any, ...]
    loads: tuple[Any, ...]
    frames: dict[str, Marker]
    start: dict[str, Any]
    near: dict[str, float]
    inputs: tuple[Input, ...]
    parameters: tuple[Parameter, ...]

    @property
    def arguments(self) -> dict[str, Any]:
        """Those of `mechanism`."""
        names = ("bodies", "joints", "loads", "start", "near", "inputs", "parameters")
        return {name: getattr(self, name) for name in names}


def from_mjcf(
    file: str | os.PathLike[str], limits: bool = True, key: str = "", actuators: bool = True
) -> MjcfParts:
    """The bodies, joints and loads of an MJCF file; without `limits` its joints do not stop where it says so;
    without `actuators` nothing drives them; `key` names the key frame at which it begins.

    Raises ModelError with every problem at once.  What MuJoCo has and this has not is told once, counted.
    """
    path = Path(file)
    try:
        import mujoco
    except ImportError:
        raise ModelError(path.name, ["reading MJCF needs mujoco: pip install mujoco"]) from None
    if problems := problems_of_files(path):
        raise ModelError(path.name, problems)
    with (
        _quiet(mujoco),
        foreign(
            lambda said: ModelError(path.name, [f"MuJoCo does not take it: {said}: correct that"])
        ),
    ):
        m = mujoco.MjModel.from_xml_path(str(path))
        if wrong := _not_computable(m):
            raise ValueError(wrong)
    return _Reader(mujoco, m, path.stem, limits, key, actuators).parts()


@contextlib.contextmanager
def _quiet(mujoco: Any) -> Iterator[None]:
    """Without MUJOCO_LOG.TXT, which its warnings would leave in the folder where one works."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda said: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


class _Reader:
    """One compiled model."""

    def __init__(
        self, mujoco: Any, m: Any, stem: str, limits: bool, key: str, actuators: bool
    ) -> None:
        self.mj, self.m, self.limits, self.actuators = mujoco, m, limits, actuators
        self.problems: list[str] = []
        self.left: Counter[str] = Counter()
        self.taken: set[str] = {"ground"}
        self.data = mujoco.MjData(m)
        self.data.qpos[:] = m.qpos0
        with _quiet(mujoco):
            mujoco.mj_kinematics(m, self.data)
        self.called = letters(m.names[: m.names.index(b"\0")].decode() or stem)
        self.key = self._key(key)
        self.ground = Ground(shape=self._looks(self._with(0)) or None)
        self.roots = [b if m.body_jntnum[b] else 0 for b in range(m.nbody)]
        for b in range(1, m.nbody):
            if not m.body_jntnum[b]:
                self.roots[b] = self.roots[m.body_parentid[b]]
        names = {b: self._name("body", b) for b in self._movers()}
        self.joint_names = [self._name("joint", j) for j in range(m.njnt)]
        self.bodies = {b: self._body(b, name) for b, name in names.items()}
        self.between: list[Body] = []  # without mass, between joints of one body
        self.inputs: list[Input] = []
        self.parameters: list[Parameter] = []

    def parts(self) -> MjcfParts:
        """The whole of it."""
        joints: list[Any] = (
            [] if self.problems else [j for b in self.bodies for j in self._joints(b)]
        )
        if self.problems:
            raise ModelError(self.called, self.problems)
        joints += self._equalities()
        loads = [*self._gravity(), *self._passive(), *self._tendons(), *self._actuators()]
        frames = {self._name("site", s): self._site(s) for s in range(self.m.nsite)}
        if self.problems:
            raise ModelError(self.called, self.problems)
        self._tell()
        bodies = (*self.bodies.values(), *self.between)
        parts = bodies, tuple(joints), tuple(loads)
        more = tuple(self.inputs), tuple(self.parameters)
        start, tied = self._start(), self._tied()
        near = {n: start.pop(n) for n in [*start] if n in tied}
        return MjcfParts(self.called, self.ground, *parts, frames, start, near, *more)

    # ------------------------------------------------------------------ names

    def _own(self, kind: str, k: int) -> str:
        """What the file calls it."""
        thing = getattr(self.mj.mjtObj, f"mjOBJ_{kind.upper()}")
        return self.mj.mj_id2name(self.m, thing, k) or f"{kind}{k}"

    def _name(self, kind: str, k: int) -> str:
        """One word of its name in the file, that nothing else has."""
        plain = letters(self._own(kind, k))
        return self._added(plain if plain not in self.taken | set(RESERVED) else f"{plain}_{kind}")

    def _added(self, name: str) -> str:
        """It, or with as many _ behind it that nothing else has it."""
        while name in self.taken:
            name += "_"
        self.taken.add(name)
        return name

    def _key(self, key: str) -> int:
        known = [self._own("key", k) for k in range(self.m.nkey)]
        if key and key not in known:
            self.problems.append(
                f"no key frame is called {key!r}, expected one of {', '.join(known) or 'none: it has none'}"
            )
        return known.index(key) if key in known else -1

    # ------------------------------------------------------------------ bodies

    def _movers(self) -> list[int]:
        return [b for b in range(1, self.m.nbody) if self.m.body_jntnum[b]]

    def _with(self, root: int) -> list[int]:
        """A body of the file and those that are welded to it."""
        m, found = self.m, [root]
        for b in range(1, m.nbody):
            if not m.body_jntnum[b] and m.body_parentid[b] in found:
                found.append(b)
        return found

    def _frame(self, b: int) -> tuple[Array, Array]:
        """Its axes and origin at the configuration of the file."""
        return self.data.xmat[b].reshape(3, 3).copy(), self.data.xpos[b].copy()

    def _body(self, root: int, name: str) -> Body:
        """What is welded together, as one body."""
        m, (R, origin) = self.m, self._frame(root)
        those = self._with(root)
        found = []
        for b in those:
            axes, center = (
                R.T @ self.data.ximat[b].reshape(3, 3),
                R.T @ (self.data.xipos[b] - origin),
            )
            J = axes @ np.diag(m.body_inertia[b]) @ axes.T
            found.append((float(m.body_mass[b]), center, J))
        mass, center, J = together(found)
        own = self._own("body", root)
        description = "" if own == name else f"{own!r} of the file"
        shape = self._looks(those) or None
        return Body(name, mass, components(J), tuple(map(float, center)), description, shape)

    def _looks(self, those: Sequence[int]) -> list[Shape]:
        R, origin = self._frame(those[0])
        of = [g for g in range(self.m.ngeom) if self.m.geom_bodyid[g] in those]
        return [shape for g in of for shape in self._shape(g, R, origin)]

    def _shape(self, g: int, R: Array, origin: Array) -> Iterator[Shape]:
        b = self.m.geom_bodyid[g]
        axes, at = self._frame(b)
        turned = axes @ turned_by(self.m.geom_quat[g])
        own, center = R.T @ turned, R.T @ (at + axes @ self.m.geom_pos[g] - origin)
        kind, size = int(self.m.geom_type[g]), self.m.geom_size[g].tolist()
        where = tuple(center.tolist())
        if kind == SPHERE:
            yield Sphere(where, size[0])
        elif kind in (CAPSULE, CYLINDER):
            low, high = (tuple((center + s * size[1] * own[:, 2]).tolist()) for s in (-1, 1))
            yield Rod(low, high, size[0])
        elif kind == BOX:
            yield Box(where, tuple(2 * x for x in size), own.tolist())

    def _carrier(self, b: int) -> tuple[Body | Ground, Array, Array]:
        """What a body of the file is part of, and the axes and the origin of that."""
        root = self.roots[b]
        return (self.bodies[root] if root else self.ground, *self._frame(root))

    def _marker(self, b: int, axes: Array, point: Array, on: Body | None = None) -> Marker:
        """A frame that is given at the configuration of the file, on what a body is part of, or `on` another
        in its place."""
        carrier, R, origin = self._carrier(b)
        own = R.T @ axes
        rotation = None if np.array_equal(own, np.eye(3)) else _square(own).tolist()
        return (on or carrier).at(tuple((R.T @ (point - origin)).tolist()), rotation=rotation)

    def _within(self, b: int, point: Any, quat: Any = None) -> Marker:
        """A frame that is given in the frame of a body of the file."""
        R, origin = self._frame(b)
        turned = R if quat is None else R @ turned_by(quat)
        return self._marker(b, turned, origin + R @ point)

    def _site(self, s: int) -> Marker:
        return self._within(self.m.site_bodyid[s], self.m.site_pos[s], self.m.site_quat[s])

    # ------------------------------------------------------------------ joints

    def _joints(self, b: int) -> Iterator[Joint]:
        """The joint by which a body hangs on its parent; several of the file in one body are a Series."""
        m = self.m
        own = range(m.body_jntadr[b], m.body_jntadr[b] + m.body_jntnum[b])
        kinds = [int(m.jnt_type[j]) for j in own]
        j, parent = own[0], int(m.body_parentid[b])
        if kinds == [FREE]:
            if self.roots[parent]:
                self.problems.append(f"free joint {self._own('joint', j)!r} is not on the world")
        elif kinds == [BALL]:
            ends: Any = [
                self._marker(x, self._frame(b)[0], self.data.xanchor[j]) for x in (parent, b)
            ]
            self.left["limits of ball joints"] += self._has_limits(j)
            yield Spherical(self.joint_names[j], *ends)
        elif kinds in ([HINGE], [SLIDE]):
            yield self._axle(j, parent, b)
        elif (series := self._series(b, parent, list(own), kinds)) is not None:
            yield series
        else:
            yield from self._chain(b, parent, list(own))

    def _axle(
        self, j: int, parent: int, b: int, before: Body | None = None, after: Body | None = None
    ) -> Joint:
        """A hinge or a slide; `before`, `after`: what is in the place of b on either side of it."""
        m, axis, R = self.m, self.data.xaxis[j], self._frame(b)[0]
        hinge = int(m.jnt_type[j]) == HINGE
        axes = R @ onto(np.array([0.0, 0.0, 1.0]), R.T @ axis)
        ref, point = float(m.qpos0[m.jnt_qposadr[j]]), self.data.xanchor[j]
        first = point if hinge else point - ref * axis
        turned = axes @ turn(2, ref) if hinge else axes
        ends = (
            self._marker(b if before else parent, axes, first, before),
            self._marker(b, turned, point, after),
        )
        rubs: dict[str, Any] = {}
        if loss := float(m.dof_frictionloss[m.jnt_dofadr[j]]):
            rubs["friction_torque" if hinge else "friction_force"] = loss
        kind = Revolute if hinge else Prismatic
        return kind(self.joint_names[j], *ends, "z", self._limits(j), **rubs)

    def _chain(self, b: int, parent: int, own: list[int]) -> Iterator[Joint]:
        """Joints of one body that are no Series, with bodies without mass between them."""
        before = None
        for j in own:
            after = None
            if j != own[-1]:
                name = self._added(f"{self.joint_names[j]}_body")
                after = Body(name, 0.0, (0.0, 0.0, 0.0))
                self.between.append(after)
            yield self._axle(j, parent, b, before, after)
            before = after

    def _series(self, b: int, parent: int, own: list[int], kinds: list[int]) -> Series | None:
        """None where slides are not first, axes not square, points apart, or where they rub."""
        m, x = self.m, self.data.xaxis
        slides = [j for j, kind in zip(own, kinds, strict=True) if kind == SLIDE]
        hinges = [j for j, kind in zip(own, kinds, strict=True) if kind == HINGE]
        axes = self._letters(slides, hinges)
        points = np.array([self.data.xanchor[j] for j in hinges or own[-1:]])
        apart = float(np.ptp(points, axis=0).max())
        refs = [float(m.qpos0[m.jnt_qposadr[j]]) for j in own]
        if own != slides + hinges or axes is None or (len(hinges) > 1 and any(refs[len(slides) :])):
            return None
        rub = any(m.dof_frictionloss[m.jnt_dofadr[j]] for j in own)
        if rub or (len(hinges) != 2 and apart > SQUARE * max(1.0, float(np.abs(points).max()))):
            return None
        letters, frame = axes
        along, about = (letters[: len(slides)], letters[len(slides) :])
        first, second, arm = self._met(hinges, points)
        turned = frame
        for j, ref in zip(own, refs, strict=True):
            first -= ref * x[j] if j in slides else 0.0
            turned = turned @ turn(AXES.index(about), ref) if j in hinges and ref else turned
        ends = self._marker(parent, frame, first), self._marker(b, turned, second)
        names = [self.joint_names[j] for j in own]
        stops = {self.joint_names[j]: s for j in own if (s := self._limits(j)) is not None}
        name = self._added(f"{self.bodies[b].name}_joints")
        return Series(
            name, *ends, sliding=along, turning=about, names=names, stops=stops, apart=arm
        )

    def _met(self, hinges: list[int], points: Array) -> tuple[Array, Array, float]:
        """A point of the first hinge's axis and one of the last's, that are next to each other of two, and
        how far the second is along the cross product of the axes."""
        first, second = points[0].copy(), points[-1].copy()
        if len(hinges) != 2:
            return first, second, 0.0
        u, v = (self.data.xaxis[j] for j in hinges)
        between = second - first
        arm = float(between @ np.cross(u, v))
        size = SQUARE * max(1.0, float(np.abs(points).max()))
        return (
            first + (between @ u) * u,
            second - (between @ v) * v,
            arm if abs(arm) > size else 0.0,
        )

    def _letters(self, slides: list[int], hinges: list[int]) -> tuple[str, Array] | None:
        """The letter of each axis in a right-handed frame that has them all; none if none has."""
        found: list[Array] = []
        places = []
        for j in slides + hinges:
            axis = self.data.xaxis[j]
            same = [k for k, e in enumerate(found) if np.abs(e - axis).max() <= SQUARE]
            if not same and any(abs(e @ axis) > SQUARE for e in found):
                return None
            places.append(same[0] if same else len(found))
            found += [] if same else [axis.copy()]
        if any(len({*part}) < len(part) for part in (places[: len(slides)], places[len(slides) :])):
            return None
        order = "xyz"
        if len(found) == 3 and np.linalg.det(found) < 0:
            order = "xzy"
        elif len(found) == 2:
            found.append(np.cross(found[0], found[1]))
        elif len(found) == 1:
            frame = onto(np.array([1.0, 0, 0]), found[0])
            found += [frame[:, 1], frame[:, 2]]
        columns = sorted(zip(order, found, strict=True), key=lambda pair: pair[0])
        return "".join(order[k] for k in places), _square(np.array([e for _, e in columns]).T)

    def _has_limits(self, j: int) -> bool:
        return bool(self.m.jnt_limited[j]) and self.limits

    def _limits(self, j: int) -> tuple[float, float] | None:
        low, high = map(float, self.m.jnt_range[j])
        return (low, high) if self._has_limits(j) else None

    def _equalities(self) -> Iterator[Any]:
        m = self.m
        for e in range(m.neq):
            kind, data = int(m.eq_type[e]), m.eq_data[e]
            ends = int(m.eq_obj1id[e]), int(m.eq_obj2id[e])
            if not m.eq_active0[e]:
                self.left["equalities that are not active"] += 1
            elif kind == JOINT:
                yield from self._tied_joints(e, *ends)
            elif kind not in (CONNECT, WELD):
                self.left["equalities of tendons, flexes and distances"] += 1
            elif m.eq_objtype[e] == SITE:
                tie = Spherical if kind == CONNECT else Fixed
                first, second = map(self._site, ends)
                yield tie(self._name("equality", e), first, second)
            elif kind == CONNECT:
                first, second = self._within(ends[0], data[:3]), self._within(ends[1], data[3:6])
                yield Spherical(self._name("equality", e), first, second)
            else:
                first = self._within(ends[0], data[3:6], data[6:10])
                yield Fixed(self._name("equality", e), first, self._within(ends[1], data[:3]))

    def _tied_joints(self, e: int, first: int, second: int) -> Iterator[Any]:
        """q1 - ref1 = a0 + a1 x + ... + a4 x^4,  x = q2 - ref2."""
        m, a, name = self.m, self.m.eq_data[e][:5], self._name("equality", e)
        start = float(m.qpos0[m.jnt_qposadr[first]])
        if second < 0 or not a[1:].any():
            yield Motor(name, self._measure(first), motion=start + float(a[0]))
            return
        x = Polynomial([-m.qpos0[m.jnt_qposadr[second]], 1.0])
        offset, ratio, *higher = Polynomial(np.trim_zeros(a, "b"))(x).coef.tolist()
        ties = self._measure(first), self._measure(second)
        yield Gear(name, *ties, ratio, start + offset, higher)

    def _measure(self, j: int) -> str:
        kind = "position" if self.m.jnt_type[j] == SLIDE else "angle"
        return f"{kind}.{self.joint_names[j]}"

    # ------------------------------------------------------------------ loads

    def _gravity(self) -> Iterator[Gravity]:
        if not self.m.opt.disableflags & NO_GRAVITY and self.m.opt.gravity.any():
            yield Gravity(tuple(self.m.opt.gravity.tolist()))

    def _passive(self) -> Iterator[Any]:
        """Springs, dampers and rotors of joints of one motion."""
        m = self.m
        for j in range(m.njnt):
            d, name = int(m.jnt_dofadr[j]), self.joint_names[j]
            values = float(m.jnt_stiffness[j]), float(m.dof_damping[d]), float(m.dof_armature[d])
            if m.jnt_type[j] in (FREE, BALL):
                self.left["springs, dampers and armatures of free and ball joints"] += any(values)
                continue
            self.left["springs and dampers of higher degree"] += self._has_powers("jnt", j)
            if values[0] or values[1]:
                slack = float(m.qpos_spring[m.jnt_qposadr[j]]) if values[0] else 0.0
                spring = self._added(f"{name}_spring")
                yield Torsion(spring, self._measure(j), values[0], slack, values[1])
            if values[2]:
                yield Rotor(self._added(f"{name}_rotor"), self._measure(j), values[2])

    def _tendons(self) -> Iterator[SpringDamper]:
        """A straight one from site to site pulls as a spring does; where it has no spring and damper it is
        nothing."""
        m = self.m
        for t in range(m.ntendon):
            wraps = range(m.tendon_adr[t], m.tendon_adr[t] + m.tendon_num[t])
            straight = [int(m.wrap_type[w]) for w in wraps] == [SITE_OF_TENDON] * 2
            k, c = float(m.tendon_stiffness[t]), float(m.tendon_damping[t])
            slack, taut = map(float, m.tendon_lengthspring[t])
            more = m.tendon_limited[t] or m.tendon_frictionloss[t] or m.tendon_armature[t]
            bent = self._has_powers("tendon", t)
            if (k or c) and straight and slack == taut and not more and not bent:
                first, second = (self._site(int(m.wrap_objid[w])) for w in wraps)
                yield SpringDamper(
                    self._name("tendon", t), first, second, k, slack if k else 0.0, c
                )
            else:
                self.left["tendons that are no spring between two sites"] += 1

    def _has_powers(self, kind: str, k: int) -> bool:
        """Whether a spring or damper of a joint or tendon is not linear."""
        names = f"{kind}_stiffnesspoly", f"{'dof' if kind == 'jnt' else kind}_dampingpoly"
        rows = k, int(self.m.jnt_dofadr[k]) if kind == "jnt" else k
        found = (getattr(self.m, name, None) for name in names)  # newer than version 3.3
        return any(of is not None and of[row].any() for of, row in zip(found, rows, strict=True))

    def _actuators(self) -> Iterator[Any]:
        """gain u + b0 + b1 (gear q) + b2 (gear q'), times the gear."""
        m = self.m
        for a in range(len(m.actuator_trntype) if self.actuators else 0):
            j, gear = int(m.actuator_trnid[a][0]), float(m.actuator_gear[a][0])
            kinds = m.actuator_trntype, m.actuator_dyntype, m.actuator_gaintype, m.actuator_biastype
            kind = tuple(int(of[a]) for of in kinds)
            if kind not in BY_JOINT or m.jnt_type[j] in (FREE, BALL):
                self.left["actuators that are no motor, position or velocity of a joint"] += 1
                continue
            name, measure = self._name("actuator", a), self._measure(j)
            self.left["limits of controls and of forces of actuators"] += bool(
                m.actuator_ctrllimited[a] or m.actuator_forcelimited[a]
            )
            b0, b1, b2 = map(float, m.actuator_biasprm[a][:3])
            yield Motor(name, measure, torque=self._control(a, j, name, (b1, b2)))
            if b0 or b1 or b2:
                servo = self._added(f"{name}_servo")
                yield Torsion(
                    servo, measure, -(gear**2) * b1, 0.0, -(gear**2) * b2, preload=gear * b0
                )

    def _control(self, a: int, j: int, name: str, bias: tuple[float, float]) -> Any:
        """The input NAME.control with its gain; it is what the servo follows, gear times."""
        turns = self.m.jnt_type[j] == HINGE
        effort, way = ("N.m", "rad") if turns else ("N", "m")
        unit, per = "1", effort
        if bias[0]:
            unit, per = way, f"{effort}/{way}"
        elif bias[1]:
            unit, per = f"{way}/s", f"{effort}.s/{way}"
        gain = sp.Symbol(f"{name}.gain", real=True)
        value = float(self.m.actuator_gear[a][0] * self.m.actuator_gainprm[a][0])
        self.parameters.append(Parameter(gain, value, per, f"gear times gain of {name}"))
        control = dynamicsymbols(f"{name}.control")
        place = getattr(self.m, "actuator_ctrladr", range(a + 1))[a]  # one each before version 4
        start = float(self.m.key_ctrl[self.key][place]) if self.key >= 0 else 0.0
        self.inputs.append(Input(control, unit, start, f"control of {name}"))
        return gain * control

    # ------------------------------------------------------------------ start, and what is left out

    def _start(self) -> dict[str, Any]:
        """The coordinate of each joint of one motion, the place of each body behind another."""
        m, mj, data = self.m, self.mj, self.mj.MjData(self.m)
        data.qpos[:] = m.qpos0 if self.key < 0 else m.key_qpos[self.key]
        if self.key >= 0:
            data.qvel[:] = m.key_qvel[self.key]
        mj.mj_forward(m, data)
        tied = data.efc_type == mj.mjtConstraint.mjCNSTR_EQUALITY
        open_ = float(np.abs(data.efc_pos[tied]).max(initial=0.0))
        if open_ > OPEN:
            warnings.warn(
                f"{self.called!r}: where the file begins its equalities miss by {open_:.3g} (m or rad): its "
                "joints are closed near there",
                LagfmuWarning,
                stacklevel=5,
            )
        found: dict[str, Any] = {}
        for j in range(m.njnt):
            b, q, d = int(m.jnt_bodyid[j]), int(m.jnt_qposadr[j]), int(m.jnt_dofadr[j])
            if m.jnt_type[j] in (SLIDE, HINGE):
                found[self._measure(j)] = float(data.qpos[q])
                found[f"der({self._measure(j)})"] = float(data.qvel[d])
                continue
            body, R, rates = self.bodies[b], data.xmat[b].reshape(3, 3), np.zeros(6)
            mj.mj_objectVelocity(m, data, mj.mjtObj.mjOBJ_XBODY, b, rates, 0)
            found[f"{body.name}.orientation"] = tuple(data.xquat[b].tolist())
            found[f"{body.name}.omega"] = tuple((R.T @ rates[:3]).tolist())
            if m.jnt_type[j] == FREE:
                arm = R @ np.array(body.center, dtype=float)
                velocity = rates[3:] + np.cross(rates[:3], arm)
                found[f"{body.name}.position"] = tuple((data.xpos[b] + arm).tolist())
                found[f"{body.name}.velocity"] = tuple(velocity.tolist())
        return found

    def _tied(self) -> set[str]:
        """The coordinates of joints in loops, and of those that equalities tie."""
        m, found = self.m, set()
        for e in range(m.neq):
            ends = int(m.eq_obj1id[e]), int(m.eq_obj2id[e])
            if not m.eq_active0[e] or m.eq_type[e] not in (CONNECT, WELD, JOINT):
                continue
            if m.eq_type[e] == JOINT:
                found |= {j for j in ends if j >= 0}
                continue
            ways = [self._way(m.site_bodyid[b] if m.eq_objtype[e] == SITE else b) for b in ends]
            for b in ways[0] ^ ways[1]:
                found |= {*range(m.body_jntadr[b], m.body_jntadr[b] + m.body_jntnum[b])}
        return {self._measure(j) for j in found if m.jnt_type[j] in (SLIDE, HINGE)}

    def _way(self, b: int) -> set[int]:
        """A body and all that it hangs on."""
        return {b, *self._way(self.m.body_parentid[b])} if b else set()

    def _tell(self) -> None:
        m = self.m
        self.left["geoms that can touch"] += int(((m.geom_contype | m.geom_conaffinity) != 0).sum())
        self.left["skins"] += m.nskin
        self.left["flexes"] += m.nflex
        self.left["sensors"] += m.nsensor
        self.left["bodies that a mocap moves"] += m.nmocap
        self.left["bodies whose gravity is compensated"] += int((m.body_gravcomp != 0).sum())
        self.left["fluids"] += int(bool(m.opt.density or m.opt.viscosity))
        self.left["meshes and other shapes of the picture"] += int((m.geom_type > BOX).sum())
        told = [f"{count} {what}" for what, count in self.left.items() if count]
        if told:
            warnings.warn(
                f"{self.called!r}: left out: {'; '.join(told)}; constraints are rigid, whatever solref and "
                "solimp say",
                LagfmuWarning,
                stacklevel=4,
            )


def _not_computable(m: Any) -> str:
    """What is wrong with the numbers of a compiled model; empty if nothing is."""
    for name in dir(m):
        values = getattr(m, name)
        numbers = isinstance(values, np.ndarray) and values.dtype.kind == "f"
        if numbers and not (np.abs(values.astype(float)) < LARGEST).all():
            return f"{name} holds what is no number below {LARGEST:g}"
    lengths = np.linalg.norm(m.jnt_axis, axis=1)
    if not (np.abs(lengths - 1) < SQUARE).all():
        return f"joint {np.argmin(lengths)} has an axis of no finite length"
    return ""


def _square(axes: Array) -> Array:
    """The rotation next to a matrix that is one but for rounding."""
    left, _, right = np.linalg.svd(axes)
    return np.asarray(left @ right)


CHOICES = {
    "key": ("",),
    "motors": ("file", "none", "torque", "motion"),
    "limits": ("true", "false"),
}
# The Python file that says the same.
PYTHON = '''"""The mechanism of {file}.  Add motors, contacts and closed loops of your own, then:

    lagfmu simulate {own} --plot out.svg
"""

from pathlib import Path

from lagfmu import Scene
from lagfmu.bodies import from_mjcf, mechanism

parts = from_mjcf(Path(__file__).parent / {path!r})  # key="home" begins at that key frame
model = mechanism(
    parts.name,
    bodies=parts.bodies,
    joints=[*parts.joints],
    loads=[*parts.loads],  # gravity among them
    start={{**parts.start}},  # e.g. "angle.j2": 0.5
    near=parts.near,
    inputs=parts.inputs,
    parameters=parts.parameters,
    description={file!r},
)
scenes = [Scene(model.name, stop_time=1.0, step_size=0.01)]
'''


def read(path: Path, arguments: Sequence[str] = ()) -> Model:
    """The model of an MJCF file; `arguments` are texts key=home, motors=none, torque or motion, limits=false,
    and starts by names of the FMU, angle.j2=0.5.

    motors= says what stands in place of the actuators of the file: nothing, an input J_motor.torque
    (J_motor.force) of each joint of one motion that follows no other, or J_motor.angle (J_motor.position).
    Raises RequestError for arguments, ModelError.
    """
    asked, given = chosen(path, arguments, CHOICES)
    own = asked["motors"] == "file"
    parts = from_mjcf(path, limits=asked["limits"] == "true", key=asked["key"], actuators=own)
    if not parts.bodies:
        raise ModelError(parts.name, ["nothing in the file moves: give a body of it a joint"])
    if asked["motors"] == "motion" and parts.near:
        raise ModelError(
            parts.name,
            [
                f"motors=motion: {', '.join(parts.near)} are tied by equalities, so that not each moves by "
                "itself: choose motors=torque, or write those Motor(..., motion=True) that drive it: lagfmu "
                f"new my.py --from {path.name}"
            ],
        )
    start = {**parts.start, **given}
    added = motors(parts.joints, asked["motors"], {**parts.near, **start})
    return mechanism(
        parts.name,
        **{**parts.arguments, "loads": [*parts.loads, *added], "start": start},
        description=path.name,
    )
