"""The generated C: the same numbers as the Python twin and as SymPy at 30 digits, clean to compile."""

from __future__ import annotations

import ctypes
import math
import random
import re
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import sympy as sp
from conftest import FILES
from runtime import FLAGS, INCLUDES, RUNTIME_FILES, compile_library, compiler
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass
from zoo.pendulums import chain

from lagfmu import (
    Contact,
    Embedding,
    EquationsOfMotion,
    Holonomic,
    Input,
    Model,
    Nonholonomic,
    Parameter,
    derive,
)
from lagfmu.errors import DerivationError
from lagfmu.methods import NUMBERS as NUMBERS_OF_METHODS
from lagfmu.testing import (
    TIME,
    Form,
    Prepared,
    SplineBase,
    System,
    c_function,
    identifiers,
    lower,
    model_source,
    number,
    reduce,
    string,
)

CLOSE = 1e-14  # of the magnitude of what is added up, about 45 roundings
NAMES = sorted(FILES)
Values = dict[str, list[float]]

CALLS = """
const System *pick(int full) {
    return full && MODEL_SYSTEM->full != NULL ? MODEL_SYSTEM->full : MODEL_SYSTEM;
}
void dynamics_of(int full, double t, const double *q, const double *v, const double *u,
                 const double *p, double *M, double *F, double *G, double *nu, double *gamma) {
    pick(full)->dynamics(t, q, v, u, p, M, F, G, nu, gamma);
}
void residual_of(int full, double t, const double *q, const double *u, const double *p, double *f) {
    pick(full)->residual(t, q, u, p, f);
}
void energies_of(int full, double t, const double *q, const double *v, const double *u,
                 const double *p, double *energy) {
    pick(full)->energies(t, q, v, u, p, energy);
}
void restitution_of(int full, const double *p, double *e) {
    pick(full)->restitution(p, e);
}
void tangent_of(int full, double t, const double *q, const double *v, const double *u,
                const double *p, double dt, const double *dq, const double *dv, const double *du,
                double *dM, double *dF, double *dG, double *dnu, double *dgamma, double *df,
                double *denergy) {
    pick(full)->tangent(t, q, v, u, p, dt, dq, dv, du, NULL, dM, dF, dG, dnu, dgamma, df, denergy);
}
void embed_of(double t, const double *s, const double *sdot, const double *u, const double *p,
              double *q, double *v) {
    MODEL_SYSTEM->embed(t, s, sdot, u, p, q, v);
}
void embed_tangent_of(double t, const double *s, const double *sdot, const double *u,
                      const double *p, double dt, const double *ds, const double *dsdot,
                      const double *du, double *dq, double *dv) {
    MODEL_SYSTEM->embed_tangent(t, s, sdot, u, p, dt, ds, dsdot, du, NULL, dq, dv);
}
const int *prescribed_of(void) { return MODEL_SYSTEM->prescribed; }
int number_of(int which) {
    const System *s = MODEL_SYSTEM;
    const int numbers[] = {s->m, s->entries, s->prescribed_count, s->separable};
    return numbers[which];
}
const char *coordinate_of(int full, int j) { return pick(full)->coordinates[j]; }
const char *row_of(int full, int k) { return pick(full)->rows[k].name; }
int gate_of(int full, int k) { return pick(full)->rows[k].while_closed; }
"""
NUMBERS = ("m", "entries", "prescribed_count", "separable")


def array(values: Sequence[float]) -> Any:
    return (ctypes.c_double * max(1, len(values)))(*values)


class Native:
    """The compiled model: `full` picks the system behind an embedding."""

    def __init__(self, library: ctypes.CDLL) -> None:
        self.library = library
        for name in ("coordinate_of", "row_of"):
            getattr(library, name).restype = ctypes.c_char_p
        library.prescribed_of.restype = ctypes.POINTER(ctypes.c_int)

    def call(self, name: str, sizes: dict[str, int], *arguments: Any) -> Values:
        """Call a function with numbers, sequences and outputs of the given sizes."""
        c = [
            a if isinstance(a, int) else ctypes.c_double(a) if isinstance(a, float) else array(a)
            for a in arguments
        ]
        outputs = {key: array([math.nan] * size) for key, size in sizes.items()}
        getattr(self.library, name)(*c, *outputs.values())
        return {key: list(a)[: sizes[key]] for key, a in outputs.items()}

    def number(self, name: str) -> int:
        return int(self.library.number_of(NUMBERS.index(name)))


class Case:
    """A model as symbols, as the Python twin and as compiled C."""

    def __init__(self, form: Form, folder: Path) -> None:
        self.form = form
        self.eom, self.reduction, self.formulation = (
            form.equations,
            form.reduction,
            form.formulation,
        )
        self.source = model_source(self.form)
        self.native = Native(compile_library(folder, ("interval.c",), self.source + CALLS))

    @cached_property
    def system(self) -> System:
        """The Python twin."""
        return lower(self.form)

    def systems(self) -> list[tuple[int, EquationsOfMotion, System]]:
        """(pick, symbols, twin) of the stepped system, and of the full one behind it."""
        if self.reduction is None:
            return [(0, self.eom, self.system)]
        assert self.system.embedding is not None
        return [(0, self.reduction.reduced, self.system), (1, self.eom, self.system.embedding.full)]


@pytest.fixture(scope="session")
def case(
    prepared: Callable[[str], Prepared], tmp_path_factory: pytest.TempPathFactory
) -> Callable[[str], Case]:
    """case(NAME): an FMU's model of models/, compiled once."""
    folder = tmp_path_factory.mktemp("model_c")
    made: dict[str, Case] = {}

    def get(name: str) -> Case:
        if name not in made:
            p = prepared(name)
            made[name] = Case(p.form, folder)
        return made[name]

    return get


# ---------------------------------------------------------------------- evaluation by SymPy


class Point:
    """Random numbers for the state, inputs, parameters and a direction of one system."""

    def __init__(self, eom: EquationsOfMotion, seed: int) -> None:
        draw = random.Random(seed)
        self.eom = eom
        self.t = draw.uniform(0.1, 2.0)
        self.q, self.v, self.u = (
            [draw.uniform(-2.0, 2.0) for _ in group] for group in (eom.q, eom.v, eom.u)
        )
        self.p = [float(p.value) * draw.uniform(0.5, 1.5) for p in eom.model.parameters]
        self.dt = draw.uniform(-1.0, 1.0)
        self.dq, self.dv, self.du = (
            [draw.uniform(-1.0, 1.0) for _ in group] for group in (eom.q, eom.v, eom.u)
        )

    @property
    def state(self) -> tuple[Any, ...]:
        return self.t, self.q, self.v, self.u, self.p

    @property
    def direction(self) -> tuple[Any, ...]:
        return self.dt, self.dq, self.dv, self.du

    def moved(self, h: float) -> tuple[Any, ...]:
        """The state a way h further along the direction."""
        steps = zip((self.q, self.v, self.u), (self.dq, self.dv, self.du), strict=True)
        return (
            self.t + h * self.dt,
            *([x + h * d for x, d in zip(a, b, strict=True)] for a, b in steps),
            self.p,
        )

    def values(self) -> dict[Any, Any]:
        """Symbol -> its exact value."""
        e = self.eom
        symbols = (TIME, *e.q, *e.v, *e.u, *e.p)
        numbers = (self.t, *self.q, *self.v, *self.u, *self.p)
        return {s: sp.Rational(x) for s, x in zip(symbols, numbers, strict=True)}

    def changes(self) -> dict[Any, Any]:
        """Symbol -> its change along the direction."""
        e = self.eom
        symbols = (TIME, *e.q, *e.v, *e.u)
        numbers = (self.dt, *self.dq, *self.dv, *self.du)
        return {s: sp.Rational(x) for s, x in zip(symbols, numbers, strict=True)}


def exact(e: Any, values: dict[Any, Any]) -> tuple[float, float]:
    """The value of e to 30 digits, rounded; and the magnitude of what is added up in it."""
    e = rational(e)
    return float(sp.N(e.xreplace(values), 30)), max(magnitude(e, values), 1e-300)


def rational(e: Any) -> Any:
    """e with each double as the fraction that it is, so that 30 digits are 30 digits."""
    e = sp.sympify(e)
    return e.xreplace({a: sp.Rational(a) for a in e.atoms(sp.Float)})


def magnitude(e: Any, values: dict[Any, Any]) -> float:
    """|e| with every difference taken as a sum: rounding errors are some eps times this."""
    if e.is_Add:
        return math.fsum(magnitude(a, values) for a in e.args)
    if e.is_Mul:
        return math.prod(magnitude(a, values) for a in e.args)
    if e.is_Pow and e.exp.is_Integer and e.exp > 0:
        return magnitude(e.base, values) ** int(e.exp)
    if isinstance(e, sp.Piecewise):
        return next(magnitude(c.expr, values) for c in e.args if c.cond.xreplace(values) == sp.true)
    return abs(float(sp.N(e.xreplace(values), 30)))


def groups(eom: EquationsOfMotion) -> dict[str, list[Any]]:
    """The expressions behind each array, in the layout of both targets."""
    M, G = eom.M.todok(), eom.G.todok()
    return {
        "M": [M[ij] for ij in sorted(M) if ij[0] >= ij[1]],
        "F": list(eom.F),
        "G": [G[kj] for kj in sorted(G)],
        "nu": list(eom.nu),
        "gamma": list(eom.gamma),
        "f": [sp.S.Zero if f is None else f for f in eom.f],
        "energy": [eom.kinetic, eom.potential if eom.potential is not None else sp.S.Zero],
    }


def computed(native: Native, full: int, eom: EquationsOfMotion, state: tuple[Any, ...]) -> Values:
    """All arrays of a system as the C functions give them."""
    sizes = {a: len(g) for a, g in groups(eom).items()}
    t, q, _, u, p = state
    five = {a: sizes[a] for a in ("M", "F", "G", "nu", "gamma")}
    return {
        **native.call("dynamics_of", five, full, *state),
        **native.call("residual_of", {"f": sizes["f"]}, full, t, q, u, p),
        **native.call("energies_of", {"energy": 2}, full, *state),
    }


def tangents(native: Native, full: int, point: Point) -> Values:
    """The change of all arrays along the point's direction, as the C function gives it."""
    sizes = {a: len(g) for a, g in groups(point.eom).items()}
    return native.call("tangent_of", sizes, full, *point.state, *point.direction)


def derivative(e: Any, point: Point, values: dict[Any, Any]) -> tuple[float, float]:
    """The limit of (e(x + h d) - e(x - h d)) / 2h, by 60 digits; and the magnitude of its terms."""
    e = rational(e)
    present = {s: d for s, d in point.changes().items() if e.has(s)}
    if not present:
        return 0.0, 1e-300
    if e.has(SplineBase):
        # a table has double precision: no limit, but the sum of partial derivatives
        terms = [sp.N(e.diff(s).xreplace(values), 30) * d for s, d in present.items()]
        return float(sum(terms)), max(math.fsum(abs(float(x)) for x in terms), 1.0)
    h = sp.Rational(1, 10**20)
    ahead, behind = (
        sp.N(e.xreplace(values | {s: values[s] + way * h * d for s, d in present.items()}), 60)
        for way in (1, -1)
    )
    value = float((ahead - behind) / (2 * h))
    if e.has(sp.floor, sp.ceiling, sp.Mod):  # which SymPy does not differentiate
        return value, 1 + abs(value)
    parts = (magnitude(e.diff(s), values) * abs(float(d)) for s, d in present.items())
    return value, max(math.fsum(parts), 1e-300)


def assert_tangent(native: Native, full: int, point: Point) -> None:
    """The C tangent is the directional derivative."""
    values = point.values()
    found = tangents(native, full, point)
    for label, expressions in groups(point.eom).items():
        for k, e in enumerate(expressions):
            expected, size = derivative(e, point, values)
            assert abs(found[label][k] - expected) <= CLOSE * size, (label, k, e)


def assert_values(native: Native, full: int, point: Point) -> None:
    """The C values are SymPy's at 30 digits."""
    values = point.values()
    found = computed(native, full, point.eom, point.state)
    for label, expressions in groups(point.eom).items():
        for k, e in enumerate(expressions):
            expected, size = exact(e, values)
            assert abs(found[label][k] - expected) <= CLOSE * size, (label, k, e)


def assert_embedding(one: Case, seed: int) -> None:
    """q = phi(s, t), v = J sdot + dphi/dt, and their change along (dt, ds, dsdot, du)."""
    assert one.reduction is not None
    point = Point(one.reduction.reduced, seed)
    values = point.values()
    sizes = {"q": one.eom.nq, "v": one.eom.nv}
    found = one.native.call("embed_of", sizes, *point.state)
    change = one.native.call("embed_tangent_of", sizes, *point.state, *point.direction)
    for label, group in (("q", one.reduction.phi), ("v", one.reduction.vel)):
        for k, e in enumerate(group):
            expected, size = exact(e, values)
            assert abs(found[label][k] - expected) <= CLOSE * size, (label, k, e)
            expected, size = derivative(e, point, values)
            assert abs(change[label][k] - expected) <= CLOSE * size, (label, k, e)


def assert_twin(one: Case, full: int, point: Point, twin: System) -> None:
    """C and Python agree to 1e-14 of the magnitude of the terms."""
    t, q, _, u, p = point.state
    found = computed(one.native, full, point.eom, point.state)
    expected = dict(zip(("M", "F", "G", "nu", "gamma"), twin.dynamics(*point.state), strict=True))
    expected["f"] = twin.residual(t, q, u, p)
    if full or one.reduction is None:
        expected["energy"] = twin.energies(*point.state)
    for label, e in groups(point.eom).items():
        for k, x in enumerate(expected.get(label, ())):
            size = max(magnitude(sp.sympify(e[k]), point.values()), 1e-300)
            assert abs(found[label][k] - x) <= CLOSE * size, (label, k)
    if twin.restitution is not None:
        rest = one.native.call("restitution_of", {"e": point.eom.m}, full, p)["e"]
        assert rest == twin.restitution(p)[: point.eom.m]


def checked(one: Case, seeds: Sequence[int] = (1, 2, 3)) -> None:
    """Values and tangents of every system of the case, and its embedding, against SymPy."""
    for full, eom, _ in one.systems():
        for seed in seeds:
            point = Point(eom, seed)
            assert_values(one.native, full, point)
            assert_tangent(one.native, full, point)
    if one.reduction is not None:
        assert_embedding(one, 4)


# -------------------------------------------------------------------------------- the models


@pytest.mark.parametrize("name", NAMES)
def test_c_and_python_compute_what_the_symbols_say(case: Callable[[str], Case], name: str) -> None:
    """M, F, G, nu, gamma, f, the energies and e of every model at random states are SymPy's at 30 digits, the
    tangents their directional derivatives at 60, and Python's numbers are C's."""
    one = case(name)
    checked(one, (1, 11))
    for full, eom, twin in one.systems():
        for seed in range(3):
            assert_twin(one, full, Point(eom, seed), twin)


@pytest.mark.parametrize("name", NAMES)
def test_nothing_is_multiplied_by_zero_or_computed_twice(
    case: Callable[[str], Case], name: str
) -> None:
    """Zeros appear as `= 0.0` alone, no function of math.h is called twice with one argument, and no model
    of models/ is so large that a function of it is split."""
    text = re.sub(r"/\*.*?\*/", "", case(name).source, flags=re.DOTALL)
    assert not re.search(r"[*/+-] ?0\.0\b(?!\d)|\b0\.0 ?[*/+-]|\*1\.0\b|\b1\.0\*", text)
    for body in re.split(r"\n}\n", text):
        calls = re.findall(r"\b(?:sin|cos|tan|sqrt|pow|exp|log)\([^()]*\)", body)
        assert len(calls) == len(set(calls))
    assert "blocks[k]" not in text


@pytest.mark.parametrize(
    ("name", "separable"),
    [
        ("PendulumCartesian", 1),
        ("PendulumNullspace", 0),  # its accelerations come without multipliers
        ("PendulumAngle", 0),  # no multipliers to keep it on the constraints, none needed
        ("Atwood", 1),
        ("InclineDisk", 1),
        ("CartPendulum", 0),  # friction depends on the velocity
        ("Hemisphere", 0),  # m r^2 is not constant
        ("KnifeEdge", 0),  # nonholonomic
    ],
)
def test_what_is_separable(case: Callable[[str], Case], name: str, separable: int) -> None:
    """M of parameters only, forces of q, t, u, and positions that are held: what `rattle` can step."""
    assert case(name).native.number("separable") == separable


# ------------------------------------------------------------------------------ hostile models


def made(model: Model, folder: Path, formulation: str = "multipliers") -> Case:
    eom = derive(model)
    reduction = reduce(eom) if formulation == "minimal" else None
    return Case(Form(eom, reduction, formulation), folder)


def oscillators(forces: Sequence[Any], c: Any = None) -> EquationsOfMotion:
    """Masses, each pushed by a force of its own coordinate, written as x, and of the parameter c [1]."""
    c = c if c is not None else sp.Symbol("c", real=True)
    xs = dynamicsymbols(f"x:{len(forces)}")
    model = Model(
        name="Oscillators",
        lagrangian=sum(m * a.diff() ** 2 / 2 for a in xs),
        coordinates=dict.fromkeys(xs, "1"),
        parameters=[Parameter(m, 2, "kg.m^2"), Parameter(k, 1, "J"), Parameter(c, 3, "1")],
    )
    eom = derive(model)
    own = (sp.sympify(f).xreplace({x: a}) for f, a in zip(forces, xs, strict=True))
    return replace(eom, F=tuple(eom.plain(f) * k for f in own))


def pushed(forces: Sequence[Any], folder: Path, c: Any = None) -> Case:
    return Case(Form(oscillators(forces, c)), folder)


x = dynamicsymbols("x")
m, k = sp.symbols("m k", positive=True)

HOSTILE = """int double q M F G u p v f e x0 x1 y0 j1 gamma nu sin exp NULL NAN M_PI HUGE_VAL E I pi N S
    linux unix HOLONOMIC AT_Q fill sign heaviside main errno signgam isnan restrict _x __y d_q dq
    der_q const"""


def names_model() -> Model:
    """A chain of masses and springs in one coordinate, every name of which C would trip over, and what sin
    and exp are called with."""
    coordinates = [dynamicsymbols(name) for name in HOSTILE.split()]
    stiff, mass, rate = sp.symbols("while for default", positive=True)
    lagrangian = sum(mass * c.diff() ** 2 / 2 for c in coordinates)
    lagrangian -= sum(stiff * (b - a) ** 2 / 2 for a, b in pairwise(coordinates))
    for function in (sp.sin, sp.exp):
        lagrangian -= stiff * rate**2 * function(dynamicsymbols(str(function)) / rate)
    return Model(
        name="Names",
        description='it ends here */ or /* there "quoted" ??/ \\ µ\nand goes on',
        lagrangian=lagrangian,
        coordinates=dict.fromkeys(coordinates, "m"),
        constraints=[
            Holonomic("struct", coordinates[0] - coordinates[1]),
            Nonholonomic(
                "static", coordinates[2].diff() - coordinates[3].diff() * coordinates[4] / rate
            ),
        ],
        parameters=[Parameter(mass, 1, "kg"), Parameter(stiff, 3, "N/m"), Parameter(rate, 2, "m")],
    )


def test_names_that_c_has_taken(tmp_path: Path) -> None:
    """Keywords, math.h's functions and macros, and our own arguments are no trouble as model names."""
    one = made(names_model(), tmp_path)
    checked(one, (1,))
    names = HOSTILE.split()
    assert [one.native.library.coordinate_of(0, j).decode() for j in range(len(names))] == names


def zig() -> list[str] | None:
    """Zig's clang, the compiler of the other platforms, where it is installed."""
    try:
        import ziglang  # noqa: F401
    except ImportError:
        return None
    return [sys.executable, "-m", "ziglang", "cc"]


@pytest.mark.parametrize(
    "target",
    [
        "x86_64-windows-gnu",
        *(pytest.param(t, marks=pytest.mark.thorough) for t in ("", "aarch64-macos")),
    ],
)
def test_no_warning_from_clang(tmp_path: Path, target: str) -> None:
    """-Wall -Wextra -Wpedantic -Wconversion is silent for zig's clang too, on every platform."""
    command = zig()
    if command is None:
        pytest.skip("ziglang is not installed")
    file = tmp_path / "model.c"
    file.write_text(model_source(Form(derive(names_model()))), encoding="utf-8")
    options = [*FLAGS, "-Werror", *INCLUDES, *(["-target", target] if target else [])]
    result = subprocess.run(
        [*command, *options, "-c", str(file), "-o", str(tmp_path / "model.o")],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert result.returncode == 0, result.stderr


def test_no_identifier_is_a_macro(tmp_path: Path) -> None:
    """What <math.h> and <stddef.h> define, in GNU mode too, is never the name of a local."""
    file = tmp_path / "empty.c"
    file.write_text("#include <math.h>\n#include <stddef.h>\n")
    for mode in ("c99", "gnu99", "gnu17"):
        text = subprocess.run(
            [compiler(), f"-std={mode}", "-D_GNU_SOURCE", "-dM", "-E", str(file)],
            capture_output=True,
            text=True,
            check=True,
            timeout=60,
        ).stdout
        macros = {name for name in re.findall(r"#define (\w+)", text) if name[0] != "_"}
        assert "M_PI" in macros
        locals_ = identifiers([sp.Symbol(name) for name in sorted(macros)]).values()
        assert not macros & set(locals_)


def test_identifiers_are_distinct() -> None:
    """der(q), der_q, d(q) and d_q keep names apart; each is a valid C identifier."""
    names = [
        "q",
        "der(q)",
        "der(q,2)",
        "der_q",
        "der2_q",
        "d(q)",
        "d(der(q))",
        "d_q",
        "d_der_q",
        "q_",
    ]
    found = identifiers([sp.Symbol(name) for name in names])
    assert len(set(found.values())) == len(names)
    assert all(re.fullmatch(r"[A-Za-z]\w*", text) for text in found.values())


NUMBERS_OF_INTEREST = [
    sp.Rational(1, 3),
    sp.Rational(10**30, 7),
    sp.Integer(10) ** 20,
    sp.Integer(2) ** 64 + 1,
    -(sp.Integer(3) ** 40),
    sp.Rational(1, 10**25),
    sp.Float("0.1"),
    sp.Float("1e-300"),
    sp.pi,
    sp.E,
    sp.sqrt(2),
    sp.GoldenRatio,
    sp.Rational(2, 3) ** sp.Rational(5, 3),
]


def test_numbers_are_doubles(tmp_path: Path) -> None:
    """1/3, 10^20, 2^64 + 1, pi and sqrt(2) are printed as doubles: no integer divides or overflows."""
    force = sum(c * x ** (j + 1) for j, c in enumerate(NUMBERS_OF_INTEREST))
    one = pushed([force, *(c * sp.sin(x) for c in NUMBERS_OF_INTEREST)], tmp_path)
    checked(one)
    point = Point(one.eom, 1)
    found = computed(one.native, 0, one.eom, point.state)["F"][1:]
    for c, q, F in zip(NUMBERS_OF_INTEREST, point.q[1:], found, strict=True):
        expected = float(sp.N(c, 30)) * math.sin(q) * point.p[1]
        assert pytest.approx(expected, rel=5e-16, abs=0) == F
    source = model_source(Form(oscillators([force]))).split("static const")[0]
    text = re.sub(r"/\*.*?\*/|\[\d+\]", "", source, flags=re.DOTALL)
    numbers = re.findall(r"(?<![\w.])\d[\d.]*(?:e[+-]?\d+)?", text)
    assert len(numbers) > len(NUMBERS_OF_INTEREST)
    assert all("." in n or "e" in n for n in numbers)


@pytest.mark.parametrize("bad", [sp.Integer(10) ** 400, sp.Rational(1, 10**400)])
def test_numbers_outside_doubles_are_refused(bad: Any) -> None:
    """10^400 and 10^-400 have no double: they are named, not silently inf or 0, which is one."""
    eom = oscillators([sp.sin(x) + bad * x])
    with pytest.raises(DerivationError, match=r"outside the range of double precision"):
        model_source(Form(eom))
    assert number(sp.Float(0.0)) == "0.0"


POWERS = [
    x**2 + x**3 - x**5 + x**6 - x**7,
    1 / (2 + x**2) + 1 / (2 + x**2) ** 2 - 1 / (2 + x**2) ** 3,
    sp.sqrt(2 + x**2) + (2 + x**2) ** sp.Rational(3, 2) - (2 + x**2) ** sp.Rational(-5, 2),
    1 / sp.sqrt(1 + x**2) - 3 / (1 + x**4) / (2 + sp.cos(x)),
    (3 + x) ** sp.Rational(1, 3) + (3 + x) ** sp.Rational(-1, 3) + (3 + x) ** sp.pi,
    (3 + x) ** x + 2**x + sp.exp(x) - sp.exp(-(x**2)),
    -((x - 1) ** 2) - (1 - x) ** 4 / 7 + (x * (x + 1)) ** 3,
]


def test_powers(tmp_path: Path) -> None:
    """Squares are products, x^(k/2) are square roots, 1/x is a division, the rest is pow."""
    checked(pushed(POWERS, tmp_path))


FUNCTIONS = [
    sp.sin(x) * sp.cos(x) + sp.tan(x / 3),
    sp.asin(x / 3) + sp.acos(x / 3) * sp.atan(x) + sp.atan2(x, 3 + sp.cos(x)),
    sp.sinh(x) - sp.cosh(x) * sp.tanh(x),
    sp.asinh(x) + sp.acosh(4 + x) + sp.atanh(x / 3),
    sp.exp(x) * sp.log(3 + x) + sp.erf(x) - sp.erfc(x / 2),
    sp.Abs(x) + sp.Abs(x - 1) ** 3,
    sp.sign(x) * x**2 + sp.Heaviside(x) * sp.sin(x) + sp.Heaviside(x - 1, 0),
    sp.Max(x, sp.sin(x), sp.Rational(1, 2)) - sp.Min(x**2, 1 + x),
    sp.floor(3 * x) * x + sp.ceiling(2 * x) ** 2,
    sp.Mod(x, sp.Rational(1, 3)) * x,
    sp.cot(2 + x / 3) + sp.sec(x / 2) + sp.csc(3 + x / 2) + sp.sinc(x) + sp.coth(3 + x),
    sp.Piecewise((x**2, x < 0), (sp.sin(x), (x < 1) | (x > 3)), (sp.log(x), True)),
    sp.Piecewise((0, sp.And(x > -1, x < 1) & sp.Not(sp.Eq(x, 0))), (x - 1, x >= 1), (x + 1, True)),
    sp.Piecewise((-x, x > 0), (2 * x - 1, True)) * sp.Piecewise((0, x > 0), (sp.sin(x), True)),
    3 * sp.Piecewise((-x, x > 0), (2 * x - 1, True)) / 2
    - 1 / sp.Piecewise((2 + x**2, x > 0), (3, True)),
]


def test_functions(tmp_path: Path) -> None:
    """Each function that C's math.h has, and what can be written with them, with its derivative."""
    checked(pushed(FUNCTIONS, tmp_path), range(6))


@pytest.mark.parametrize(
    ("expression", "word"),
    [
        (sp.besselj(0, x), "besselj"),
        (sp.zeta(3 + x), "zeta"),
        (sp.Piecewise((x, x > 0)), "Piecewise"),
    ],
)
def test_functions_without_counterpart_are_refused(expression: Any, word: str) -> None:
    """A Bessel function has no counterpart in C99: the message names it and the remedy."""
    eom = oscillators([expression])
    with pytest.raises(DerivationError, match=word) as caught:
        model_source(Form(eom))
    assert "cannot be written as numeric code" in str(caught.value)


def test_symbols_that_are_not_declared_real(tmp_path: Path) -> None:
    """|c x| with a plain symbol c has the derivative c sign(c x): every quantity is real."""
    c = sp.Symbol("c")
    one = pushed([sp.Abs(c * x) + sp.sqrt(c**2 * x**2)], tmp_path, c)
    value = computed(one.native, 0, one.eom, (0.0, [0.5], [0.0], [], [1.0, 1.0, -3.0]))
    assert value["F"] == pytest.approx([3.0], rel=1e-15)
    sizes = {a: len(g) for a, g in groups(one.eom).items()}
    state = (0.0, [0.5], [0.0], [], [1.0, 1.0, -3.0])
    change = one.native.call("tangent_of", sizes, 0, *state, 0.0, [2.0], [0.0], [])
    assert change["F"] == pytest.approx([12.0], rel=1e-15)


def driven(formulation: str, folder: Path) -> Case:
    """A pendulum whose pivot follows u(t), with a torque, a drive in time and a contact."""
    x, y, theta, u, force = dynamicsymbols("x y theta u F")
    m, g, L, e = sp.symbols("m g L e", positive=True)
    w = sp.Symbol("w", real=True)
    model = point_mass(
        "Driven",
        "x y",
        [
            Holonomic("rod", (x - u) ** 2 + y**2 - L**2),
            Contact("floor", y + 2 * L * (1 + sp.sin(w * TIME) / 10), restitution=e / (1 + e)),
            Holonomic("stuck", x - 3 * L, while_closed="floor"),
        ],
        up=y,
        parameters=[
            *(Parameter(m, 1, "kg"), Parameter(g, 9.81, "m/s^2"), Parameter(L, 1, "m")),
            *(Parameter(e, 0.5, "1"), Parameter(w, 3, "rad/s")),
        ],
        forces={x: force * sp.cos(w * TIME)},
        inputs=[Input(force, "N"), Input(u, "m")],
        embedding=Embedding(
            coordinates={theta: "rad"},
            relations={x: u + L * sp.sin(theta), y: -L * sp.cos(theta)},
        ),
    )
    return made(model, folder, formulation)


@pytest.mark.parametrize("formulation", ["multipliers", "minimal"])
def test_prescribed_motions_contacts_and_time(tmp_path: Path, formulation: str) -> None:
    """u, u', u'' and t stand in G, nu and gamma; a contact gates a constraint; e is a formula."""
    one = driven(formulation, tmp_path)
    checked(one)
    count = one.native.number("prescribed_count")
    assert one.native.library.prescribed_of()[:count] == [1]
    for full, eom, twin in one.systems():
        p = Point(eom, 1).p
        found = one.native.call("restitution_of", {"e": twin.m}, full, p)["e"]
        assert found == pytest.approx(list(twin.restitution(p)), rel=1e-15)
        assert found[twin.contacts[0]] == pytest.approx(p[3] / (1 + p[3]), rel=1e-15)
        names = [one.native.library.row_of(full, k).decode() for k in range(twin.m)]
        assert one.native.library.gate_of(full, names.index("stuck")) == names.index("floor")


def test_a_system_without_constraints(tmp_path: Path) -> None:
    """Empty tables are arrays of length one, and nothing is read from or written to them."""
    one = pushed([sp.S.Zero], tmp_path)
    checked(one, (1,))
    assert one.native.number("m") == one.native.number("entries") == 0
    assert not re.search(r"\[\] = \{\}", one.source)


# --------------------------------------------------------------------------------- large models


def bodies(text: str) -> list[int]:
    """Statements of each function."""
    found = re.findall(r"^static void \w+\([^{]*\) \{\n(.*?)^\}", text, re.DOTALL | re.MULTILINE)
    return [body.count(";") for body in found]


def test_code_grows_linearly_and_in_blocks(tmp_path: Path) -> None:
    """Twice the links, twice the text; and no function grows beyond a bounded block."""
    half, whole = (model_source(Form(derive(chain(n, "Chain", "rod")))) for n in (16, 32))
    assert len(whole) < 2.1 * len(half)
    assert sum(bodies(whole)) < 2.1 * sum(bodies(half))
    assert len(bodies(whole)) > len(bodies(half))
    assert max(bodies(whole)) < c_function.BLOCK


def serial(n: int) -> Model:
    """n rods hung from each other, each angle taken from the rod before: everything shares everything."""
    angles = dynamicsymbols(f"a1:{n + 1}")
    m, g, L = sp.symbols("m g L", positive=True)
    total = x = y = lagrangian = sp.S.Zero
    for a in angles:
        total += a
        x, y = x + L * sp.sin(total), y - L * sp.cos(total)
        lagrangian += m * (x.diff(TIME) ** 2 + y.diff(TIME) ** 2) / 2 - m * g * y
    return Model(
        name="Serial",
        lagrangian=lagrangian,
        coordinates=dict.fromkeys(angles, "rad"),
        parameters=[Parameter(m, 1, "kg"), Parameter(g, 9.81, "m/s^2"), Parameter(L, 1, "m")],
    )


def test_blocks_share_what_is_costly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Split or whole, the sine of an angle is computed once a function; the values stay right."""
    monkeypatch.setattr(c_function, "BLOCK", 150)
    one = made(serial(3), tmp_path)
    checked(one, (1,))
    assert "blocks[k]" in one.source
    for name in ("dynamics", "tangent"):
        parts = re.findall(rf"^static void {name}\w*\(.*?^}}", one.source, re.DOTALL | re.MULTILINE)
        assert len(parts) > 2
        assert sum(len(re.findall(r"\bsin\(", part)) for part in parts) == 3


def test_strings_are_escaped() -> None:
    """Quotes, backslashes, trigraphs and letters beyond ASCII survive a C string literal."""
    assert string('a"b\\c') == '"a\\042b\\134c"'
    assert string("??/") == '"\\077\\077/"'
    assert string("µ") == '"\\302\\265"'


def test_methods_have_one_number_in_python_and_in_c() -> None:
    """optional.c, of what runs without an FMU, has them at the places that methods.py numbers; `auto`, the
    first, begins with its explicit one, and at 0 is what nobody chooses."""
    text = RUNTIME_FILES["optional.c"].read_text(encoding="utf-8")
    found = re.search(r"\.methods = \{&\w+, &dop853, ([^}]*)\}", text)
    assert found is not None
    numbers = {name.strip("& "): k for k, name in enumerate(found[1].split(","), start=2)}
    assert {"auto": 1, **numbers} == dict(NUMBERS_OF_METHODS)
