"""The URDF files of public packages, and what becomes of them, against Pinocchio.

    pip install pin example-robot-data pybullet robot-properties-fingers hello-robot-stretch-urdf \
        jvrc-description armar airo-models dexmate-urdf
    python benchmarks/files.py [--in SITE-PACKAGES] [--package NAME] [--build N] [WORD ...]

Nothing is downloaded.  Of each file with at least two joints that move: taken, refused, or broken, with the
cause; of what is taken the largest difference of the accelerations of all bodies, and of all six components
of the wrench in each joint, from Pinocchio's at three random states, relative to the largest of each.
Friction, damping and limits are off; <mimic> is a constraint in both, whose effort Pinocchio counts to the
wrenches.  A file that is refused is broken where Pinocchio does not read it either, where its M is singular,
or where what it says cannot be (a moment of inertia above the sum of the others, a joint that follows one
that there is not).  With --build every N-th of those that are taken is built, without the run that verifies
it: seconds of processor time, of the compiler too, and size of the FMU.  WORD: files whose path holds it.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import resource
import site
import statistics
import sys
import tempfile
import warnings
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from lagfmu import build_fmu, derive
from lagfmu.bodies import Gear, Gravity, Prismatic, from_urdf, mechanism
from lagfmu.errors import LagfmuError
from lagfmu.testing import Form, load, lower

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "independent"))
from linkage import least

PACKAGES = {
    "example-robot-data": "cmeel.prefix/share/example-robot-data",
    "pybullet": "pybullet_data",
    "robot-properties-fingers": "robot_properties_fingers",
    "hello-robot-stretch-urdf": "stretch_urdf",
    "jvrc-description": "jvrc_description",
    "armar": "armar",
    "airo-models": "airo_models",
    "dexmate-urdf": "dexmate_urdf",
}
MOVES = ("revolute", "continuous", "prismatic", "floating", "planar", "spherical")
GRAVITY = (0.0, 0.0, -9.81)
STATES = 3
SINGULAR = 1e-12  # of M scaled to a diagonal of 1: the least eigenvalue that is none


@dataclass(frozen=True)
class Joint:
    """A joint of the file that Pinocchio moves: its number there, its child's frame is the link's."""

    name: str
    number: int
    axis: tuple[float, ...] | None


class Reference:
    """A file as Pinocchio reads it, with <mimic> as rows qdot = S rdot of its rates."""

    def __init__(self, path: Path) -> None:
        self.model = pin.buildModelFromUrdf(str(path), mimic=False)
        self.model.gravity.linear = np.array(GRAVITY)
        self.data = self.model.createData()
        root = ElementTree.fromstring(_plain(path))
        found = {j.get("name", ""): j for j in root.iter("joint") if j.find("parent") is not None}
        self.joints = [
            Joint(n, k, _axis(found[n])) for k, n in enumerate(self.model.names) if k and n in found
        ]
        self.links = {j.name: found[j.name].find("child").get("link") for j in self.joints}
        follows = {
            n: found[n].find("mimic") for n in self.links if found[n].find("mimic") is not None
        }
        self.follows = {
            n: (m.get("joint"), float(m.get("multiplier", 1)), float(m.get("offset", 0)))
            for n, m in follows.items()
        }
        self.S, self.offset = self._rows()

    def _rows(self) -> tuple[Any, Any]:
        """q = S r + offset of joints with one rate each."""
        m, numbers = self.model, {j.name: j.number for j in self.joints}
        S, offset = np.eye(m.nv), np.zeros(m.nv)
        for name in self.follows:
            at = m.joints[numbers[name]].idx_v
            S[at] = 0
            leader, factor, shift = name, 1.0, 0.0
            while leader in self.follows and leader in numbers:
                leader, times, plus = self.follows[leader]
                shift, factor = shift + factor * plus, factor * times
            S[at, m.joints[numbers[leader]].idx_v], offset[at] = factor, shift
        return S[:, np.abs(S).max(axis=0, initial=0) > 0], offset

    def random_state(self, rng: Any) -> tuple[Any, Any]:
        """Within a radian and a metre of 0."""
        m, S = self.model, self.S
        way = S @ rng.uniform(-1, 1, S.shape[1]) + self.offset
        q = pin.integrate(m, pin.neutral(m), way)
        return q, S @ rng.uniform(-1, 1, S.shape[1])

    def accelerations(self, q: Any, v: Any) -> Any:
        """S^T M S r'' = -S^T b; without <mimic> that of Pinocchio's articulated bodies."""
        m, d, S = self.model, self.data, self.S
        if not self.follows:
            return np.array(pin.aba(m, d, q, v, np.zeros(m.nv)))
        M = pin.crba(m, d, q)
        M = np.triu(M) + np.triu(M, 1).T
        b = pin.nonLinearEffects(m, d, q, v)
        return S @ np.linalg.solve(S.T @ M @ S, -S.T @ b)

    def is_singular(self, q: Any) -> bool:
        """Its M, reduced, at a place."""
        M = pin.crba(self.model, self.data, q)
        M = self.S.T @ (np.triu(M) + np.triu(M, 1).T) @ self.S
        size = np.sqrt(np.diag(M))
        if not (size > 0).all():
            return True
        return bool(np.linalg.eigvalsh(M / np.outer(size, size))[0] < SINGULAR)


def _plain(path: Path) -> bytes:
    """What ElementTree reads, too."""
    from lagfmu.bodies import markup
    from lagfmu.bodies.check_files import needed

    root, problem = markup.read(path)
    if root is None:
        raise ValueError(problem)
    return needed(root)


def _axis(joint: Any) -> tuple[float, ...] | None:
    if joint.get("type") not in ("revolute", "continuous", "prismatic", "planar"):
        return None
    axis = joint.find("axis")
    return (1.0, 0.0, 0.0) if axis is None else tuple(map(float, axis.get("xyz").split()))


def _slippery(joint: Any) -> Any:
    names = {"friction_torque", "friction_force"} & {f.name for f in fields(joint)}
    return replace(joint, **dict.fromkeys(names)) if names else joint


class NotReadError(Exception):
    """Pinocchio does not read what lagfmu takes."""


class Mine:
    """A file as lagfmu reads it."""

    def __init__(self, path: Path) -> None:
        parts = from_urdf(path, limits=False)
        joints = [j if isinstance(j, Gear) else _slippery(j) for j in parts.joints]
        self.parts = parts
        self.model = mechanism(
            parts.name,
            bodies=parts.bodies,
            joints=joints,
            loads=[Gravity(GRAVITY)],
            start=parts.start,
        )
        self.eom = derive(self.model)
        self.system = lower(Form(self.eom))
        self.words = _words(parts)
        slides = {j.name for j in joints if isinstance(j, Prismatic)}
        names = (j.name for j in joints)
        self.axial = {n: f"{'force' if n in slides else 'torque'}.{n}.z" for n in names}

    def at(self, places: dict[str, tuple[Any, Any]]) -> tuple[dict[str, float], dict[str, float]]:
        """Accelerations by directions, and outputs, with each body's pose (4, 4) and motion (6) given."""
        values: dict[str, float] = {}
        for body in self.parts.bodies:
            pose, motion = places[body.name]
            R, arm = pose[:3, :3], pose[:3, :3] @ np.array(body.center, dtype=float)
            e = pin.Quaternion(R).coeffs()
            straight = motion[:3] + np.cross(motion[3:], arm)
            turning = R.T @ motion[3:]
            for k, x in enumerate("xyz"):
                values[f"{body.name}.position.{x}"] = (pose[:3, 3] + arm)[k]
                values[f"der({body.name}.position.{x})"] = straight[k]
                values[f"{body.name}.omega.{x}"] = turning[k]
            values |= {
                f"{body.name}.orientation.{x}": e[k]
                for x, k in zip("wxyz", (3, 0, 1, 2), strict=True)
            }
        system = self.system
        q = np.array([values.get(n, 0.0) for n in system.coordinates])
        v = np.array([values.get(n, 0.0) for n in system.speeds])
        p = [float(x.value) for x in self.eom.parameters]
        u = [0.0] * len(self.eom.u)
        M, F, G, _, gamma = map(np.asarray, system.assemble(0.0, q, v, u, p))
        vdot, lam = solved(M, F, G, gamma)
        Q = (G.T @ lam).tolist()
        told = {
            o.name: o.value(0.0, q.tolist(), v.tolist(), vdot.tolist(), u, p, lam.tolist(), Q)[0]
            for o in system.outputs
            if o.name.startswith(("force.", "torque."))
        }
        by_row = dict(zip((r.name for r in system.rows), lam.tolist(), strict=True))
        for gear in (j for j in self.parts.joints if isinstance(j, Gear)):
            for name, share in ((gear.first, 1.0), (gear.second, -float(gear.ratio))):
                told[self.axial[name]] += share * by_row[gear.name]
        return dict(zip(system.directions, vdot.tolist(), strict=True)), told


def solved(M: Any, F: Any, G: Any, gamma: Any) -> tuple[Any, Any]:
    """M v' = F + G^T lambda, G v' = gamma, by an orthogonal factorization: of M^(-1/2) G^T; where M is
    singular of G^T, which is of full rank in a tree."""
    size = np.sqrt(np.diag(M))
    if not size.all() or np.linalg.eigvalsh(M / np.outer(size, size))[0] < SINGULAR:
        Q, R = np.linalg.qr(G.T, mode="complete")
        V, Z, R = Q[:, : len(G)], Q[:, len(G) :], R[: len(G)]
        vdot = V @ np.linalg.solve(R.T, gamma)
        vdot += Z @ np.linalg.solve(Z.T @ M @ Z, Z.T @ (F - M @ vdot))
        return vdot, np.linalg.solve(R, V.T @ (M @ vdot - F))
    root = np.linalg.cholesky(M)
    free, A = np.linalg.solve(root, F), np.linalg.solve(root, G.T)
    Q, R = np.linalg.qr(A)
    c = np.linalg.solve(R.T, gamma) - Q.T @ free
    lam = np.linalg.solve(R, c)
    return np.linalg.solve(root.T, free + Q @ c), lam


def _words(parts: Any) -> dict[str, str]:
    """What the file calls a link or a joint -> what it is called here."""
    told = parts.description.split("; ")[0]
    if not told.startswith("names: "):
        return {}
    found = {}
    for text in told.removeprefix("names: ").split(", "):
        word, _, rest = text.partition(" is the ")
        kind, _, name = rest.partition(" ")
        found[f"{kind} {name.strip(chr(39))}"] = word
    return found


def compared(path: Path, seed: int = 1) -> tuple[float, float, int]:
    """The largest relative differences of accelerations and of wrenches; how many joints move."""
    mine = Mine(path)
    try:
        there = Reference(path)
    except (ValueError, RuntimeError, KeyError) as error:
        raise NotReadError from error
    rng = np.random.default_rng(seed)
    far = [0.0, 0.0]
    size = [-GRAVITY[2], 0.0]
    bodies = {b.name: b for b in mine.parts.bodies}
    for _ in range(STATES):
        q, v = there.random_state(rng)
        a = there.accelerations(q, v)
        efforts = pin.rnea(there.model, there.data, q, v, a)
        assert there.follows or np.abs(efforts).max() < 1e-6 * max(
            1, *(np.abs(f.vector).max() for f in there.data.f)
        )
        pin.forwardKinematics(there.model, there.data, q, v, a)
        aligned = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        places, wanted = {}, {}
        for j in there.joints:
            link = there.links[j.name]
            name = mine.words.get(f"link {link}", link)
            motion = pin.getVelocity(there.model, there.data, j.number, aligned).vector
            change = pin.getClassicalAcceleration(there.model, there.data, j.number, aligned).vector
            places[name] = there.data.oMi[j.number].homogeneous, motion
            wanted[name] = change
        vdot, told = mine.at(places)
        for name, change in wanted.items():
            R, w = places[name][0][:3, :3], places[name][1][3:]
            arm, dw = R @ np.array(bodies[name].center, dtype=float), change[3:]
            straight = change[:3] + np.cross(dw, arm) + np.cross(w, np.cross(w, arm))
            own = [[vdot[f"{name}.{what}.{x}"] for x in "xyz"] for what in ("position", "omega")]
            far[0] = max(far[0], np.abs(own[0] - straight).max(), np.abs(own[1] - R.T @ dw).max())
            size[0] = max(size[0], np.abs(change).max(), np.abs(straight).max())
        for j in there.joints:
            name = mine.words.get(f"joint {j.name}", j.name)
            turn = (
                there.model.jointPlacements[j.number].rotation.T
                @ there.data.liMi[j.number].rotation
            )
            if j.axis is not None:
                turn = least(j.axis).T @ turn
            f = there.data.f[j.number]
            wrench = np.array([*(turn @ f.linear), *(turn @ f.angular)])
            found = [
                told.get(f"{what}.{name}.{x}", 0.0) for what in ("force", "torque") for x in "xyz"
            ]
            far[1] = max(far[1], np.abs(found - wrench).max())
            size[1] = max(size[1], np.abs(wrench).max())
    return far[0] / size[0], far[1] / size[1], len(there.joints)


def built(path: Path, into: Path) -> tuple[float, int]:
    """Processor seconds of a build, with those of the compiler, and bytes of the FMU."""

    def spent() -> float:
        of = [resource.getrusage(w) for w in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        return sum(r.ru_utime + r.ru_stime for r in of)

    before = spent()
    fmu = build_fmu(load(path).model, into, check=False)
    return spent() - before, Path(fmu).stat().st_size


def moving(path: Path) -> int:
    """How many joints of a file move; of one that is no XML how many say so."""
    return len(
        re.findall(rf"type\s*=\s*[\"'](?:{'|'.join(MOVES)})[\"']".encode(), path.read_bytes())
    )


def cause(error: Exception) -> str:
    """The first problem that a refusal tells."""
    lines = str(error).splitlines()
    text = (lines[1] if len(lines) > 1 else lines[0]).strip(" -")
    return f"{text[:150]}{f' (and {len(lines) - 2} more)' if len(lines) > 2 else ''}"


@contextlib.contextmanager
def silence() -> Iterator[None]:
    """Without what C++ prints."""
    sys.stderr.flush()
    kept, nothing = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(nothing)
        os.close(kept)


def why_broken(path: Path, error: Exception) -> str:
    """Why a file that is refused is broken; nothing where it is legal."""
    told = str(error)
    if "moments of inertia" in told:
        found = re.findall(r"moments of inertia (\S+), (\S+), (\S+) kg", told)
        beyond = any(float(c) > float(a) + float(b) for a, b, c in found)
        return "no distribution of mass has such moments of inertia" if beyond else ""
    for words, what in (
        ("mimics", "a joint follows one that there is not"),
        ("is a macro", "macros that are not expanded"),
        ("of the type", "a joint of no kind that URDF has"),
        ("expected 3 finite numbers", "a vector is no three numbers"),
        ("expected a finite number", "a number is none"),
        ("is no XML", "no XML"),
    ):
        if words in told:
            return what
    try:
        there = Reference(path)
    except Exception as failed:
        return f"Pinocchio does not read it ({type(failed).__name__})"
    q, _ = there.random_state(np.random.default_rng(1))
    return (
        "M is singular: a link moves that has neither mass nor inertia"
        if there.is_singular(q)
        else ""
    )


def main() -> None:
    """A line for each file, and for each package."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--in", dest="folder", type=Path, default=Path(site.getsitepackages()[0]))
    parser.add_argument("--build", type=int, default=0)
    parser.add_argument("--package", action="append", choices=PACKAGES)
    parser.add_argument("words", nargs="*")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    worst, seconds, sizes = [0.0, 0.0], [], []
    for package in given.package or PACKAGES:
        for path in sorted((given.folder / PACKAGES[package]).rglob("*.urdf")):
            name = str(path.relative_to(given.folder / PACKAGES[package]))
            if moving(path) < 2 or not all(w in str(path) for w in given.words):
                continue
            shown = f"{package} {name}"
            try:
                with silence():
                    a, f, n = compared(path)
            except NotReadError:
                counts[package]["taken"] += 1
                print(f"{shown}: taken, not compared: Pinocchio does not read it", flush=True)
                continue
            except (LagfmuError, ValueError, RuntimeError) as error:
                with silence():
                    broken = why_broken(path, error)
                counts[package]["broken" if broken else "refused"] += 1
                print(
                    f"{shown}: {'broken, ' + broken if broken else 'refused'}: {cause(error)}",
                    flush=True,
                )
                continue
            counts[package]["taken"] += 1
            worst = [max(worst[0], a), max(worst[1], f)]
            line = f"{shown}: taken, {n} joints, {a:.1e} {f:.1e}"
            if given.build and counts[package]["taken"] % given.build == 1 % given.build:
                try:
                    with tempfile.TemporaryDirectory() as folder:
                        spent, size = built(path, Path(folder))
                except LagfmuError as error:
                    line += f", not built: {cause(error)}"
                else:
                    seconds.append(spent)
                    sizes.append(size)
                    line += f", {spent:.1f} s, {size / 1e3:.0f} kB"
            print(line, flush=True)
    for package, of in counts.items():
        print(f"{package}: {', '.join(f'{of[w]} {w}' for w in ('taken', 'refused', 'broken'))}")
    print(f"largest differences: accelerations {worst[0]:.1e}, wrenches {worst[1]:.1e}")
    if seconds:
        print(
            f"{len(seconds)} built: median {statistics.median(seconds):.1f} s, largest {max(seconds):.1f} s; "
            f"median {statistics.median(sizes) / 1e3:.0f} kB, largest {max(sizes) / 1e3:.0f} kB"
        )


if __name__ == "__main__":
    main()
