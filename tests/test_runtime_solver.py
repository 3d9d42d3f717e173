"""The C runtime's states of motion: start, projection, contact modes, impacts and observation.

One library of the runtime serves all models; each model is compiled by itself."""

from __future__ import annotations

import ctypes
import itertools
import re
from collections.abc import Sequence
from ctypes import c_char_p, c_double, c_int, c_void_p
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from runtime import RUNTIME_FILES, compile_library
from sympy import Rational, cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass
from zoo.contacts import cradle
from zoo.linkages import FOUR_BAR, TIME, rods

from lagfmu import (
    Contact,
    Holonomic,
    Input,
    Model,
    Nonholonomic,
    Parameter,
)
from lagfmu.testing import (
    GIVEN,
    OMITTED,
    Prepared,
    model_source,
    prepare,
)

EPS, TINY = np.finfo(float).eps, np.finfo(float).tiny
SOURCES = sorted(  # but what stands on the solver
    name
    for name, path in RUNTIME_FILES.items()
    if name.endswith(".c") and path.parent.name != "fmi"
)
BENCH = Path(__file__).with_name("solver_bench.c")

x, y, s = dynamicsymbols("x y s")
push, lift = dynamicsymbols("push lift")
m, g, J, arm = symbols("m g J arm", positive=True)
MASS = Parameter(m, 2.0, "kg")


class Bench:
    """A solver with its memory; arrays are views into it."""

    def __init__(self, library: ctypes.CDLL, system: c_void_p, prepared: Prepared) -> None:
        self.c, self.prepared, self.system = library, prepared, prepared.system
        self.c.bench_open.restype = c_void_p
        self.c.bench_array.restype = c_void_p
        self.c.bench_why.restype = c_char_p
        self.c.bench_number.restype = c_double
        self.handle = c_void_p(self.c.bench_open(system))
        values = [v.start for v in prepared.table.variables if v.role == "parameter"]
        self.p = self.array("p", len(values))
        self.p[:] = values

    def close(self) -> None:
        self.c.bench_close(self.handle)

    def array(self, name: str, count: int, kind: Any = c_double) -> Any:
        if count == 0:
            return np.zeros(0)
        address = self.c.bench_array(self.handle, name.encode())
        return np.ctypeslib.as_array((kind * count).from_address(address))

    def number(self, name: str) -> float:
        return float(self.c.bench_number(self.handle, name.encode()))

    def why(self) -> str:
        return bytes(self.c.bench_why(self.handle)).decode()

    def drive(self, values: Sequence[float]) -> None:
        self.array("value", len(values))[:] = values

    def start(self, q: Sequence[float], v: Sequence[float], tolerance: float = 1e-8) -> bool:
        return not self.c.bench_start(self.handle, doubles(q), doubles(v), c_double(tolerance))

    def state(self) -> dict[str, Any]:
        n = self.system.nq
        return {name: self.array(f"state.{name}", n).copy() for name in ("q", "v", "size")}

    def project(self, q: Any, v: Any, active: Sequence[int]) -> tuple[Any, Any]:
        x, w = doubles(q), doubles(v)
        if self.c.bench_project(self.handle, x, w, integers(active)):
            raise AssertionError(self.why())
        return np.array(x), np.array(w)

    def modes(self, guess: Sequence[int], departing: Sequence[int] | None = None) -> list[int]:
        """Of contacts that are all touched at rest at 0, and then `lambda` and `vdot`."""
        still, closed, touching = doubles([0.0] * self.system.nv), integers(guess), [1] * len(guess)
        flags = None if departing is None else integers(departing)
        at = self.handle, still, still, closed
        if self.c.bench_modes(*at, integers(touching), flags) or self.c.bench_motion(*at):
            raise AssertionError(self.why())
        return list(closed)

    def impact(self, before: Sequence[float], entering: Sequence[int]) -> tuple[Any, Any]:
        """Velocities after an impact at 0, and the impulses of all rows."""
        v, Lambda = doubles(before), doubles([0.0] * self.system.m)
        at = self.handle, doubles([0.0] * self.system.nv), v, integers(entering), 0, Lambda
        if self.c.bench_impact(*at):
            raise AssertionError(self.why())
        return np.array(v), np.array(Lambda)


def doubles(values: Sequence[float]) -> Any:
    return (c_double * len(values))(*[float(x) for x in values])


def integers(values: Sequence[int]) -> Any:
    return (c_int * len(values))(*[int(x) for x in values])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("solver")


@pytest.fixture(scope="module")
def runtime(folder: Path) -> ctypes.CDLL:
    return compile_library(folder, SOURCES, BENCH.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def bench(runtime: ctypes.CDLL, folder: Path, prepared: Any) -> Any:
    """bench(NAME or model): a solver for it."""
    made: list[Bench] = []
    keep: dict[str, tuple[ctypes.CDLL, Prepared]] = {}

    def get(model: str | Model) -> Bench:
        name = model if isinstance(model, str) else model.name
        if name not in keep:
            one = prepared(model) if isinstance(model, str) else prepare(model)
            text = model_source(one.form)
            keep[name] = compile_library(folder, ["interval.c"], text), one
        library, one = keep[name]
        made.append(Bench(runtime, c_void_p.in_dll(library, "MODEL_SYSTEM"), one))
        return made[-1]

    yield get
    for one in made:
        one.close()


def defaults(system: Any, table: Any) -> tuple[list[float], list[float], list[float]]:
    """Start values of q and v, and inputs."""
    value = {v.name: v.start for v in table.variables}
    q = [value[c] for c in system.coordinates]
    v = [value[f"der({c})"] for c in system.coordinates]
    return q, v, [x.start for x in table.variables if x.role == "input"]


# --------------------------------------------------------------------------- start and observation


def test_a_four_bar_starts_from_any_velocities_of_its_crank(bench):
    """The pinned end rests whatever the crank does: its speed, rounding of the crank's, is no
    contradiction, in any of 20 starts."""
    one = bench(rods("FourBar", FOUR_BAR))
    q, v, _ = defaults(one.system, one.prepared.table)
    chance = np.random.default_rng(1)
    ends = [one.system.coordinates.index(name) for name in ("x3", "y3")]
    for _ in range(20):
        v = chance.uniform(-1, 1, len(q))
        v[ends] = 0
        near = np.array(q) + chance.uniform(-0.2, 0.2, len(q))
        assert one.start(near.tolist(), v.tolist()), one.why()
        assert np.abs(one.state()["v"][ends]).max() < 1e-14
        assert np.abs(one.state()["v"]).max() > 1e-3


def test_an_omitted_value_whose_zero_is_singular_is_asked_for(bench):
    """x = 0.6 on a circle of 1 m and nothing said of y: at y = 0 the circle does not depend on y to first
    order, and which of +-0.8 is meant nobody can know."""
    one = bench("PendulumCartesian")
    one.array("priority", 4, c_int)[:] = [GIVEN, OMITTED, OMITTED, OMITTED]
    assert not one.start([0.6, 0.0], [0.0, 0.0])
    assert "give y a start value" in one.why()
    assert one.start([0.6, -0.1], [0.0, 0.0]), one.why()
    np.testing.assert_allclose(one.state()["q"], [0.6, -0.8], rtol=1e-15)


def test_where_curves_touch_a_projection_ends_at_rounding(bench):
    """y = 0 and y = k x^2 touch at x = 0, where Newton's method only halves x: 1e-9 m from there f is 1e-18 m
    beside a length of 1 m, rounding; 1e-3 m from there it is not, and what is told is that the place is
    singular, not that steps are too long."""
    k, length = symbols("k length", positive=True)
    model = point_mass(
        "Tangent",
        "x y",
        [Holonomic("line", y), Holonomic("curve", y - k * x**2)],
        parameters=[MASS, Parameter(k, 1.0, "1/m"), Parameter(length, 1.0, "m")],
        start={x: 0.0, y: 0.0},
    )
    one = bench(model)
    one.array("state.size", 2)[:] = 1.0
    one.array("state.offset", 2)[:] = 0.0
    q, _ = one.project([1e-9, 0.0], [0.0, 0.0], [1, 1])
    assert abs(q[0]) < 1e-9
    with pytest.raises(AssertionError, match="singular"):
        one.project([1e-3, 0.0], [0.0, 0.0], [1, 1])


def test_velocities_that_contradict_each_other_are_refused(bench):
    """x' = 1 and x' = 0.5 cannot both hold."""
    fast, slow = symbols("a b", real=True)
    model = point_mass(
        "Twice",
        "x y",
        [Nonholonomic("one", x.diff() - fast), Nonholonomic("two", x.diff() - slow)],
        parameters=[MASS, Parameter(fast, 1.0, "m/s"), Parameter(slow, 1.0, "m/s")],
    )
    with pytest.warns(UserWarning, match="follows from the others"):
        one = bench(model)
    assert one.start([0.0, 0.0], [0.0, 0.0]), one.why()
    assert one.state()["v"].tolist() == [1.0, 0.0]
    one.p[2] = 0.5
    assert not one.start([0.0, 0.0], [0.0, 0.0])
    assert "contradict" in one.why()


def test_an_output_that_overflows_is_named(bench):
    """A kinetic energy beyond 1e308 J is no value, though the motion is one."""
    one = bench("KnifeEdge")
    q, v, _ = defaults(one.system, one.prepared.table)
    assert one.start(q, v)
    state = one.array("state.v", len(v))
    state[:] *= 1e200
    assert one.c.bench_observe(one.handle)
    assert re.search(r"not finite at t = 0\.0 s: .*energy\.kinetic", one.why())


# --------------------------------------------------------------------------- projection


def disturbed(one: Bench, size: float, rng: Any) -> tuple[Any, Any]:
    """The start moved by `size`, relative to the coordinates' magnitudes."""
    state = one.state()
    n = one.system.nq
    scale = state["size"]
    speed = np.maximum(scale * one.number("rate"), np.abs(state["v"]))
    move = rng.standard_normal(2 * n) * size
    return state["q"] + move[:n] * scale, state["v"] + move[n:] * speed


def shares(one: Bench, q: Any, v: Any) -> tuple[Any, Any]:
    """f and G v - nu of each row, as magnitudes relative to their terms."""
    system = one.system
    u = one.array("value", len(defaults(system, one.prepared.table)[2])).tolist()
    _, _, G, nu, _ = system.assemble(0.0, q, v, u, one.p.tolist())
    size = np.abs(G) @ np.array(one.state()["size"])
    missed = np.array(system.residual(0.0, q.tolist(), u, one.p.tolist()))
    f = missed / (np.abs(G) @ np.abs(q) + EPS * size + TINY)
    slip = (G @ v - nu) / (np.abs(G) @ np.abs(v) + np.abs(nu) + EPS * size + TINY)
    return np.abs(f), np.abs(slip)


@pytest.mark.parametrize("name", ["PendulumCartesian", "CartPendulum", "Atwood", "InclineDisk"])
@pytest.mark.parametrize("size", [1e-15, 1e-12, 1e-9, 1e-6, 1e-3])
def test_projection_leaves_rounding_only(name, size, bench):
    """|f| and |G v - nu| are a few roundings of their own terms, however far the state had drifted,
    and a second projection finds nothing more to move than rounding."""
    one = bench(name)
    q0, v0, _ = defaults(one.system, one.prepared.table)
    v0 = [0.3 + 0.1 * j for j in range(len(v0))]
    assert one.start(q0, v0)
    active = one.array("active", one.system.m, c_int).tolist()
    rng = np.random.default_rng(7)
    for _ in range(50):
        q, v = one.project(*disturbed(one, size, rng), active)
        f, slip = shares(one, q, v)
        assert f.max() <= 3 * EPS
        assert slip.max() <= 3 * EPS
        again, w = one.project(q, v, active)
        assert np.abs(again - q).max() <= 4 * EPS * np.abs(q).max()
        assert np.abs(w - v).max() <= 8 * EPS * np.abs(v).max()


def test_projection_goes_the_shortest_way_in_the_metric_of_the_mass(bench):
    """M dq is normal to the constraint: the heavy cart moves less than the light bob, and the total
    momentum M s' + m x' stays."""
    one = bench("CartPendulum")
    q0, v0, _ = defaults(one.system, one.prepared.table)
    assert one.start(q0, v0)
    q = one.state()["q"] + [1e-5, -2e-5, 3e-5]
    v = np.array([0.1, 0.2, -0.3])
    moved, w = one.project(q, v, [1])
    for change in (moved - q, w - v):
        M, G = np.diag([2.0, 1.0, 1.0]), 2 * np.array([moved[0] - moved[1], moved[1] - moved[0], 0])
        G[2] = 2 * moved[2]
        normal = np.linalg.solve(M, G)
        along = normal * (change @ M @ normal) / (normal @ M @ normal)
        np.testing.assert_allclose(change, along, atol=3e-5 * np.abs(change).max())
        assert abs(2 * change[0] + change[1]) <= 4 * EPS


@pytest.mark.parametrize(("size", "evaluations", "residuals"), [(0, 1, 1), (1e-9, 2, 2)])
def test_projection_costs_two_evaluations_near_the_constraints(size, evaluations, residuals, bench):
    """One at the state that came and one at the state that leaves; one alone where none was missed."""
    one = bench("PendulumCartesian")
    assert one.start([0.6, -0.8], [0.4, 0.3])
    one.c.bench_count(one.handle)
    one.project([0.6 * (1 + size), -0.8], [0.4, 0.3], [1])
    assert one.number("evaluations") == evaluations
    assert one.number("residuals") == residuals


@pytest.mark.filterwarnings("ignore::lagfmu.testing.RedundantConstraintWarning")
def test_rows_that_others_hold_at_rest_need_no_orthogonal_factors(bench):
    """A bar swings level on two strings of one length, and a third row says so again.  Its slip is rounding
    of the other speeds: the rows that stand for all lead there by the Schur complement."""
    d, height, turn = symbols("d", positive=True), *dynamicsymbols("height turn")
    strings = [
        (x + side * d * (cos(turn) - 1)) ** 2 + (height + side * d * sin(turn)) ** 2 - arm**2
        for side in (-1, 1)
    ]
    one = bench(
        point_mass(
            "LevelBar",
            "x height",
            [
                *(Holonomic(f"string{k}", f) for k, f in enumerate(strings)),
                Holonomic("level", turn),
            ],
            angles="turn",
            up=height,
            energy=J * turn.diff() ** 2 / 2,
            parameters=[
                MASS,
                Parameter(J, 0.1, "kg.m^2"),
                Parameter(arm, 1.1, "m"),
                Parameter(d, 0.4, "m"),
            ],
            start={x: 0.66, height: -0.88},
        )
    )
    assert one.start([0.66, -0.88, 0.0], [0.8, 0.6, 0.0])
    for off in np.linspace(1e-10, 1e-9, 10):
        _, v = one.project([0.66, -0.88 + off, 0.0], [0.8, 0.6 + off, off], [1, 1, 1])
        assert abs(v[2]) < 10 * EPS
        assert one.number("plain")


@pytest.mark.parametrize("tolerance", [1e-5, 1e-8, 1e-11])
def test_an_event_costs_as_much_as_ten_steps(tolerance, bench):
    """A mass on a spring that rubs turns round at pi/omega: to find that, and to go on, takes no more
    than ten steps of twelve evaluations do."""
    turns = np.pi / 10
    cost = {}
    for end in (turns - 1e-3, turns + 1e-3):
        one = bench("FrictionOscillator")
        assert one.start([0.2], [0.0], tolerance=tolerance)
        one.c.bench_count(one.handle)
        assert one.c.bench_advance(one.handle, c_double(end)) == 0, one.why()
        assert (one.array("state.v", 1)[0] > 0) == (end > turns)
        cost[end > turns] = one.number("evaluations")
    assert 12 < cost[True] - cost[False] <= 120


def test_a_start_with_rows_at_a_small_angle_looks_for_no_crossing(bench):
    """A light bob (1 g) above a heavy one (1 kg), both links in one line: the angle of the two rows in the
    metric of M is 0.03 rad, and stays so.  The first step and the rates at its start take 12 evaluations each
    at most, where a search for the least angle within it takes 17 and more."""
    a, b, c, d = coordinates = dynamicsymbols("a b c d")
    light, heavy = symbols("light heavy", positive=True)
    kinetic = (
        light * (a.diff() ** 2 + b.diff() ** 2) + heavy * (c.diff() ** 2 + d.diff() ** 2)
    ) / 2
    angle = 0.3
    one = bench(
        Model(
            name="LightAbove",
            lagrangian=kinetic - g * (light * b + heavy * d),
            coordinates=dict.fromkeys(coordinates, "m"),
            constraints=[
                Holonomic("upper", a**2 + b**2 - arm**2),
                Holonomic("lower", (c - a) ** 2 + (d - b) ** 2 - arm**2),
                Contact("floor", d + 9 * arm),
            ],
            parameters=[
                Parameter(light, 1e-3, "kg"),
                Parameter(heavy, 1.0, "kg"),
                Parameter(g, 9.81, "m/s^2"),
                Parameter(arm, 1.0, "m"),
            ],
            start={
                a: np.sin(angle),
                b: -np.cos(angle),
                c: 2 * np.sin(angle),
                d: -2 * np.cos(angle),
            },
        )
    )
    q, v, _ = defaults(one.prepared.system, one.prepared.table)
    assert one.start(q, v)
    one.c.bench_count(one.handle)
    assert one.c.bench_advance(one.handle, c_double(1e-5)) == 0, one.why()
    assert one.number("evaluations") <= 5 * 12  # four steps from rest


# --------------------------------------------------------------------------- contacts


def walls(count: int) -> tuple[Model, Any]:
    """A particle in a wedge of `count` smooth walls through the origin, pushed by two inputs; the
    walls' inward normals."""
    angles = np.linspace(0.2, 2.9, count)
    normals = np.column_stack([np.cos(angles), np.sin(angles)])
    model = point_mass(
        f"Wedge{count}",
        "x y",
        [Contact(f"wall{k}", float(a) * x + float(b) * y) for k, (a, b) in enumerate(normals)],
        parameters=[MASS],
        forces={x: push, y: lift},
        inputs=[Input(push, "N"), Input(lift, "N", 1.0)],
        start={x: 0.0, y: 1.0},
    )
    return model, normals


def into_cone(force: Any, normals: Any) -> Any:
    """The part of a plane force that no wall takes: the nearest admissible acceleration (Moreau)."""
    trials = [force, np.zeros(2)]
    for a in normals:
        along = np.array([-a[1], a[0]])
        trials.append(along * (along @ force))
    fitting = [t for t in trials if (normals @ t >= -1e-12).all()]
    return min(fitting, key=lambda t: float(np.sum((force - t) ** 2)))


@pytest.mark.filterwarnings("ignore:.*follows from the others")
@pytest.mark.parametrize(("count", "sets"), [(1, 2), (2, 4), (3, 6)])
def test_contact_modes_satisfy_signorinis_condition(count, sets, bench):
    """Whatever the force and the first guess, the modes give lambda > 0 where closed, an acceleration
    that leaves where open, and together the force's projection into the wedge."""
    model, normals = walls(count)
    one = bench(model)
    rng = np.random.default_rng(11)
    seen = set()
    for _ in range(60):
        force = rng.standard_normal(2) * 10
        one.drive(force)
        closed = one.modes(rng.integers(0, 2, count))
        lam, vdot = one.array("lambda", count), one.array("vdot", 2)
        for k in range(count):
            assert lam[k] > (-1e-12 if count == 3 else 0) if closed[k] else lam[k] == 0
            assert closed[k] or normals[k] @ vdot >= -1e-12
        np.testing.assert_allclose(2.0 * vdot, into_cone(force, normals), atol=1e-12)
        seen.add(tuple(closed))
    assert len(seen) == sets


@pytest.mark.parametrize("guess", list(itertools.product((0, 1), repeat=2)))
def test_a_balance_is_no_motion(guess, bench):
    """Two masses coupled by their inertia, M = [[11, -9], [-9, 10]] kg, pushed by (-6, 0) N against
    x >= 0 and y >= 0: lambda = 6 N holds x, and nothing moves; what rounding leaves of y'' is zero,
    beside the accelerations that the forces could give."""
    inertia = 11 * x.diff() ** 2 - 18 * x.diff() * y.diff() + 10 * y.diff() ** 2
    model = Model(
        name="Coupled",
        lagrangian=m * inertia / 2,
        forces={x: push, y: lift},
        coordinates={x: "m", y: "m"},
        constraints=[Contact("left", x), Contact("below", y)],
        parameters=[Parameter(m, 1.0, "kg")],
        inputs=[Input(push, "N"), Input(lift, "N")],
        start={x: 1.0, y: 1.0},
    )
    one = bench(model)
    one.drive([-6.0, 0.0])
    one.modes(guess)
    np.testing.assert_allclose(one.array("lambda", 2), [6, 0], atol=1e-14)
    np.testing.assert_allclose(one.array("vdot", 2), [0, 0], atol=1e-15)


@pytest.mark.filterwarnings("ignore:.*follow from the others")
def test_modes_are_found_where_the_active_set_goes_in_a_circle(bench):
    """A particle in a narrow place, pushed by 3 N against the one wall that faces the push: opening
    and closing the worst contact comes back to where it was; trying all finds the wall."""
    normals = np.array([(3, -1), (2, 0), (-1, -2), (0, -1), (-1, 0)])
    across, along = symbols("a0:5", real=True), symbols("b0:5", real=True)
    model = point_mass(
        "Jammed",
        "x y",
        [
            Contact(f"wall{k}", a * x + b * y)
            for k, (a, b) in enumerate(zip(across, along, strict=True))
        ],
        parameters=[*(Parameter(k, 1.0, "1") for k in (*across, *along))],
        forces={x: push, y: lift},
        inputs=[Input(push, "N"), Input(lift, "N")],
        start={x: 1.0, y: 1.0},
    )
    one = bench(model)
    one.p[1:] = normals.T.ravel()
    one.drive([-3.0, 0.0])
    assert one.modes([0] * 5) == [0, 1, 0, 0, 0]


@pytest.mark.parametrize("unit", [1e-9, -1e-9, 1.0, -1.0, 1e9, -1e9])
def test_what_a_wall_does_depends_on_no_unit_and_no_side(unit, bench):
    """f = c x in whatever unit of length, of a floor (c > 0) or a ceiling (c < 0): 1 N towards it is met by
    lambda = 1/|c|, with 1 N away from it the body leaves."""
    model = point_mass(
        "Wall",
        "x",
        [Contact("wall", arm * x)],
        parameters=[MASS, Parameter(arm, 1.0, "1")],
        forces={x: push},
        inputs=[Input(push, "N")],
        start={x: 1.0},
    )
    one = bench(model)
    one.p[1] = unit
    for away, guess in itertools.product((False, True), (0, 1)):
        one.drive([1.0 if away == (unit > 0) else -1.0])
        assert one.modes([guess]) == [not away]
        assert one.array("lambda", 1)[0] == pytest.approx(0 if away else 1 / abs(unit))


LEGS = {  # where five legs stand [m], and the torques [N m] with the weight of 1 N
    "in a line": ([(2, 2), (2, 1), (1, 0), (-2, 0), (0, 0)], (-0.75, 0.75)),
    "in a trapezoid": ([(-2, -1), (-1, -1), (2, 2), (0, 0), (-1, 2)], (-0.5, 0.75)),
    "in a kite": ([(-1, 2), (1, -2), (1, -1), (1, 2), (0, 0)], (0.75, -0.75)),
}


@pytest.mark.filterwarnings("ignore:.*follow from the others")
@pytest.mark.parametrize("case", LEGS)
def test_what_the_legs_of_a_table_carry_depends_on_no_order(case, bench):
    """Five legs of a table that tips, several of which could be the ones that stay: whoever comes first,
    each carries the same, none pulls, none goes into the floor, and what rises carries nothing."""
    places, torques = LEGS[case]
    across, along = symbols("a0:5", real=True), symbols("b0:5", real=True)
    z, roll, pitch = dynamicsymbols("z roll pitch")
    model = Model(
        name="Legs",
        lagrangian=m * (z.diff() ** 2 + 4 * arm**2 * (roll.diff() ** 2 + pitch.diff() ** 2)) / 2,
        forces={z: -push, roll: lift * arm, pitch: s * arm},
        coordinates={z: "m", roll: "rad", pitch: "rad"},
        constraints=[
            Contact(f"leg{k}", z + a * roll + b * pitch)
            for k, (a, b) in enumerate(zip(across, along, strict=True))
        ],
        parameters=[
            Parameter(m, 1.0, "kg"),
            Parameter(arm, 1.0, "m"),
            *(Parameter(k, 1.0, "m") for k in (*across, *along)),
        ],
        inputs=[Input(push, "N"), Input(lift, "N"), Input(s, "N")],
        start={z: 1.0},
    )
    one = bench(model)
    found = []
    one.drive([1.0, *torques])
    for order in itertools.islice(itertools.permutations(range(5)), 0, None, 7):
        stand = np.array(places, float)[list(order)]
        one.p[2:] = stand.T.ravel()
        one.modes([1] * 5)
        carried, rising = np.zeros(5), one.array("vdot", 3)
        carried[list(order)] = one.array("lambda", 5)
        found.append(carried)
        lifted = rising[0] + np.array(places) @ rising[1:]
        assert (carried >= 0).all()
        assert (lifted >= -1e-12).all()
        assert abs(carried @ lifted) < 1e-12
    np.testing.assert_allclose(found, [found[0]] * len(found), atol=1e-12)


def test_a_contact_that_departs_is_not_closed_again(bench):
    """Where the force presses, only the flag keeps it open."""
    one = bench(walls(1)[0])
    force = -walls(1)[1][0]
    one.drive(force)
    for departing, expected in (([0], 1), ([1], 0), (None, 1)):
        assert one.modes([0], departing) == [expected]


def struck(one: Bench, q: Sequence[float], before: Sequence[float]) -> Any:
    """The velocities after all impacts at one instant, every contact being touched."""
    v, count = doubles(before), len(one.system.contacts)
    slow, found = doubles([1e-12] * count), integers([0] * count)
    at = one.handle, doubles(q), v, integers([1] * count), slow, found
    assert not one.c.bench_impacts(*at), one.why()
    return np.array(v)


def test_a_contact_that_separates_takes_no_part_and_is_driven_back(bench):
    """Three equal balls that touch, e = 1.  Ball 1 comes with 1, ball 3 goes with 1/4: first 1 strikes 2,
    which goes with 1 and then strikes 3 at the same instant: (0, 1/4, 1)."""
    after = struck(bench(cradle(3)), [0, 0.1, 0.2], [1.0, 0.0, 0.25])
    np.testing.assert_allclose(after, [0, 0.25, 1], atol=1e-15)


def test_impacts_without_end_come_to_an_end(bench):
    """A ball of 1 g between two of 1 kg, both of which it keeps striking: with e = 1/2 the three go on
    together, with the momentum that there was."""
    left, middle, right = balls = dynamicsymbols("left middle right")
    masses = 1, Rational(1, 1000), 1
    model = Model(
        name="Between",
        lagrangian=sum(k * b.diff() ** 2 for k, b in zip(masses, balls, strict=True)) * m / 2,
        coordinates=dict.fromkeys(balls, "m"),
        constraints=[
            Contact("first", middle - left, restitution=Rational(1, 2)),
            Contact("second", right - middle, restitution=Rational(1, 2)),
        ],
        parameters=[Parameter(m, 1.0, "kg")],
        start={left: -1.0, right: 1.0},
    )
    after = struck(bench(model), [0, 0, 0], [1.0, 0.5, 0.6])
    assert (np.diff(after) >= -1e-12).all()
    assert after @ [1, 1e-3, 1] == pytest.approx(1.6005, rel=1e-14)


def jointed() -> Model:
    """Any three contacts beside a rod, the first of them rough: constant masses and normals, all drawn."""
    q = dynamicsymbols("q0:4")
    M = [[symbols(f"M{i}{j}") for j in range(i + 1)] for i in range(4)]
    A = [symbols(f"a{k}_0:4") for k in range(5)]
    along = [sum(a * b for a, b in zip(row, q, strict=True)) for row in A]
    bounce = symbols("e0:3")
    numbers = [a for row in (*M, *A) for a in row]
    return Model(
        name="Jointed",
        lagrangian=sum(
            M[i][j] * q[i].diff() * q[j].diff() / (2 if i == j else 1)
            for i in range(4)
            for j in range(i + 1)
        ),
        coordinates=dict.fromkeys(q, "m"),
        constraints=[
            Holonomic("rod", along[0]),
            Contact("rough", along[1], restitution=bounce[0]),
            Nonholonomic("grip", along[2].diff(TIME), while_closed="rough"),
            Contact("near", along[3], restitution=bounce[1]),
            Contact("far", along[4], restitution=bounce[2]),
        ],
        parameters=[
            *(
                Parameter(a, 9.0 if k in (0, 2, 5, 9) else np.cos(k * k), "kg" if k < 10 else "1")
                for k, a in enumerate(numbers)
            ),
            *(Parameter(a, 0.5, "1", min=0, max=1) for a in bounce),
        ],
        start=dict.fromkeys(q, 0.0),
    )


@pytest.mark.filterwarnings("ignore:.*follows from the others")
def test_contacts_of_unlike_restitution_keep_newtons_law(bench):
    """For all that strike, of any masses and directions: M (v+ - v-) = G^T Lambda, the rod keeps its length,
    no contact pulls or is still approached, and the energy does not rise, though the rough one holds.  The
    smooth ones alone, each with its own e: 0 <= Lambda, 0 <= s+ + e s-, one of them zero."""
    one, rng, smooth = bench(jointed()), np.random.default_rng(5), np.array([3, 4])
    contacts, gripped, lifted, kept = np.array([1, 3, 4]), 0, 0, 0
    for draw in range(200):
        B, A = rng.standard_normal((4, 4)), rng.standard_normal((5, 4))
        M, before, values = B @ B.T + 0.1 * np.eye(4), rng.standard_normal(4), rng.uniform(0, 1, 3)
        A[contacts] *= -np.sign(A[contacts] @ before)[:, None]
        A[0] -= (A[0] @ before) / (before @ before) * before
        one.p[:] = [*M[np.tril_indices(4)], *A.ravel(), *values]
        entering = [(1, 1, 1), (0, 1, 1), (0, 0, 1), (1, 0, 1)][draw % 4]
        after, pushes = one.impact(before, entering)
        size = np.abs(pushes).max()
        np.testing.assert_allclose(M @ (after - before), A.T @ pushes, atol=1e-9 * size)
        assert A[0] @ after == pytest.approx(0, abs=1e-9)
        assert (pushes[contacts] >= -1e-9 * size).all()
        struck = contacts[np.array(entering, bool)]
        assert (A[struck] @ after > -1e-9).all()
        assert after @ M @ after <= before @ M @ before * (1 + 1e-12)
        kept += after @ M @ after > before @ M @ before * (1 - 1e-12)
        gripped += pushes[2] != 0
        lifted += bool(entering[0]) and pushes[1] == 0
        assert pushes[2] == 0 or pushes[1] != 0 or A[1] @ after == pytest.approx(0, abs=1e-9)
        if not entering[0]:
            left = A[smooth] @ after + values[1:] * (A[smooth] @ before)
            left, pushes = left[2 - len(struck) :], pushes[struck]
            assert (left >= -1e-9).all()
            assert np.abs(left * pushes).max() < 1e-9 * size
    assert kept > 8
    assert gripped > 20
    assert lifted > 5


@pytest.mark.filterwarnings("ignore:.*follows from the others")
def test_rounding_of_a_fast_motion_does_not_jam_an_impact(bench):
    """A particle runs at 1e3 m/s between two walls that it touches, G v being rounding, and strikes a third
    with 1e-6 m/s: it rebounds with e = 1/2 and runs on."""
    a = 0.3
    across = -sin(a) * x + float(np.cos(a)) * y
    model = point_mass(
        "Alley",
        "x y s",
        [
            Contact("left", across),
            Contact("right", -1.1 * across),
            Contact("end", s, restitution=Rational(1, 2)),
        ],
        parameters=[MASS],
        start={x: 0.0, y: 0.0, s: 0.0},
    )
    one, jammed = bench(model), 0
    for k in range(50):
        before = np.array([*((1e3 + k) * np.array([np.cos(a), np.sin(a)])), -1e-6])
        left = np.cos(a) * before[1] - np.sin(a) * before[0]
        jammed += left != 0
        after, _ = one.impact(before, [1] * 3)
        np.testing.assert_allclose(after, [*before[:2], 0.5e-6], rtol=1e-14, atol=1e-12)
    assert jammed > 5
