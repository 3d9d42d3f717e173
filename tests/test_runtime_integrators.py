"""The integrators of the C runtime: order, error control, arrival, failure, memory."""

from __future__ import annotations

import ctypes
import itertools
import math
import re
from collections.abc import Sequence

import mpmath
import numpy as np
import pytest
import radau
from runtime import RUNTIME_FILES, compile_library
from scipy.integrate import DOP853

SOURCES = (
    "status.c",
    "integrator.c",
    "step_size.c",
    "refused_step.c",
    "dop853.c",
    "rk4.c",
    "radau.c",
    "lu.c",
    "digits.c",
)
PROBLEMS = r"""
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "integrator.h"

typedef struct {
    Integrator i;
    Ode ode;
    Control control;
    Why why;
    Arena saved, scratch;
    double scale[8];
    int problem, calls, jacobians;
    double fails_after, fails_before; /* rate() fails for times in between; fails_at: and at this call */
    int fails_at;
} Run;

/* Jacobi's sn, cn, dn for k^2 = 1/2, and 1/(1 + t^2): nonlinear, not autonomous, closed form */
static void elliptic(double t, const double *y, double *f) {
    f[0] = y[1] * y[2];
    f[1] = -y[0] * y[2];
    f[2] = -0.5 * y[0] * y[1];
    f[3] = -2 * t * y[3] * y[3];
}
static void elliptic_J(double t, const double *y, double *J) {
    J[1] = y[2], J[2] = y[1];
    J[4] = -y[2], J[6] = -y[0];
    J[8] = -0.5 * y[1], J[9] = -0.5 * y[0];
    J[15] = -4 * t * y[3];
}
/* van der Pol, mu = 1e6, in Hairer & Wanner's scaling (II, eq. IV.10.1) */
static void van_der_pol(double t, const double *y, double *f) {
    (void)t;
    f[0] = y[1];
    f[1] = ((1 - y[0] * y[0]) * y[1] - y[0]) / 1e-6;
}
static void van_der_pol_J(const double *y, double *J) {
    J[1] = 1;
    J[2] = (-2 * y[0] * y[1] - 1) / 1e-6;
    J[3] = (1 - y[0] * y[0]) / 1e-6;
}
static Status rate(void *context, double t, const double *y, double *f) {
    Run *r = context;
    r->calls++;
    if (r->calls == r->fails_at || (t > r->fails_after && t < r->fails_before))
        return fail(&r->why, "the mass matrix is singular");
    switch (r->problem) {
    case 0: elliptic(t, y, f); break;
    case 1: van_der_pol(t, y, f); break;
    case 2: f[0] = y[0] * y[0]; break;                       /* escapes: 1/(1 - t) */
    case 3: f[0] = sqrt(1 - t); break;                       /* not a number beyond t = 1 */
    case 4: f[0] = y[1], f[1] = -y[0]; break;
    case 5: f[0] = fmax(0, t - y[1]), f[1] = 0; break;       /* (t - T)^2 / 2 from T on */
    default: for (int k = 0; k < 4; k++) f[k] = y[k]; break; /* next to no cost */
    }
    return OK;
}
static Status jacobian(void *context, double t, const double *y, double *J, double *dfdt) {
    Run *r = context;
    const int n = r->i.ny;
    r->jacobians++;
    memset(J, 0, sizeof(double) * (size_t)(n * n));
    memset(dfdt, 0, sizeof(double) * (size_t)n);
    switch (r->problem) {
    case 0: elliptic_J(t, y, J); break;
    case 1: van_der_pol_J(y, J); break;
    case 2: J[0] = 2 * y[0]; break;
    case 4: J[1] = 1, J[2] = -1; break;
    default: break;
    }
    return OK;
}

SHARED const Method dop853, rk4, radau;
static const Method *const METHODS[] = {&dop853, &rk4, &radau};

Run *run_new(int method, int problem, int ny, const double *y, double t, double h) {
    Run *r = calloc(1, sizeof *r);
    r->problem = problem;
    r->fails_after = HUGE_VAL;
    r->ode = (Ode){r, rate, jacobian, &r->why, NULL};
    for (int k = 0; k < 8; k++) r->scale[k] = 1;
    r->control = (Control){1e-8, r->scale, 0, 0.1};
    integrator_layout(&r->i, &r->saved, &r->scratch, ny, ny, METHODS, 3);
    r->saved.base = calloc(1, r->saved.used);
    r->scratch.base = calloc(1, r->scratch.used);
    r->saved.used = r->scratch.used = 0;
    integrator_layout(&r->i, &r->saved, &r->scratch, ny, ny, METHODS, 3);
    integrator_start(&r->i, METHODS[method], t, y, h);
    return r;
}
void run_free(Run *r) {
    free(r->saved.base);
    free(r->scratch.base);
    free(r);
}
void run_control(Run *r, double tolerance, double maximum, double fixed) {
    r->control.tolerance = tolerance;
    r->control.maximum_step = maximum;
    r->control.fixed_step = fixed;
}
void run_fail(Run *r, double after, double before, int at) {
    r->fails_after = after;
    r->fails_before = before;
    r->fails_at = at;
    r->calls = 0;
}
int run_step(Run *r, double t_bound) { return r->i.method->step(&r->i, &r->ode, &r->control, t_bound); }
int run_to(Run *r, double t_bound) {
    int steps = 0;
    while (r->i.t < t_bound) {
        if (run_step(r, t_bound) != OK) return -1;
        steps++;
    }
    return steps;
}
int run_prepare(Run *r) {
    return r->i.method->prepare_dense ? (int)r->i.method->prepare_dense(&r->i, &r->ode) : 0;
}
void run_dense(Run *r, double t, double *y) { r->i.method->dense(&r->i, t, y); }
void run_move(Run *r, const double *y) { integrator_move(&r->i, y); }
void run_numbers(const Run *r, double *x) {
    x[0] = r->i.t_old, x[1] = r->i.t, x[2] = r->i.h_next, x[3] = r->i.error_old;
    x[4] = r->i.fresh, x[5] = r->calls, x[6] = r->jacobians, x[7] = r->i.fixed_left;
}
void run_state(const Run *r, double *y) { memcpy(y, r->i.y, sizeof(double) * (size_t)r->i.ny); }
const char *run_why(const Run *r) { return r->why.text; }
size_t run_saved(const Run *r) { return r->saved.used; }
void run_save(const Run *r, char *memory) { memcpy(memory, r->saved.base, r->saved.used); }
/* the numbers and the arrays that must be saved, put into another integrator with other scratch */
void run_restore(Run *r, const char *memory, const double *x) {
    memcpy(r->saved.base, memory, r->saved.used);
    r->i.t_old = x[0], r->i.t = x[1], r->i.h_next = x[2], r->i.error_old = x[3];
    r->i.fresh = (int)x[4];
    memset(r->scratch.base, 0xa5, r->scratch.used);
}
"""
METHODS = ("dop853", "rk4", "radau")
ADAPTIVE = ("dop853", "radau")
ORDER = {"dop853": 8, "rk4": 4, "radau": 9}
SIZES = (4, 2, 1, 1, 2, 2, 4)
ELLIPTIC, VAN_DER_POL, ESCAPE, ROOT, CIRCLE, KINK, CHEAP = range(7)
POINTER, DOUBLE, INT = ctypes.c_void_p, ctypes.c_double, ctypes.c_int


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    lib = compile_library(tmp_path_factory.mktemp("integrators"), SOURCES, PROBLEMS)
    lib.run_new.restype = POINTER
    lib.run_new.argtypes = [INT, INT, INT, POINTER, DOUBLE, DOUBLE]
    lib.run_why.restype = ctypes.c_char_p
    lib.run_saved.restype = ctypes.c_size_t
    for name, extra in {
        "free": [],
        "control": [DOUBLE, DOUBLE, DOUBLE],
        "fail": [DOUBLE, DOUBLE, INT],
        "step": [DOUBLE],
        "to": [DOUBLE],
        "prepare": [],
        "dense": [DOUBLE, POINTER],
        "move": [POINTER],
        "numbers": [POINTER],
        "state": [POINTER],
        "why": [],
        "saved": [],
        "save": [POINTER],
        "restore": [POINTER, POINTER],
    }.items():
        getattr(lib, f"run_{name}").argtypes = [POINTER, *extra]
    return lib


class Run:
    """One integration, with the C integrator behind it."""

    def __init__(
        self,
        lib: ctypes.CDLL,
        method: str,
        problem: int = ELLIPTIC,
        y: Sequence[float] | None = None,
        t: float = 0.0,
        h: float = 0.0,
        tolerance: float = 1e-8,
        maximum: float = 0.0,
        fixed: float = 0.1,
    ) -> None:
        self.lib, self.ny = lib, SIZES[problem]
        start = np.array(y if y is not None else [0.0, 1.0, 1.0, 1.0][: self.ny], dtype=float)
        self.run = lib.run_new(METHODS.index(method), problem, self.ny, start.ctypes.data, t, h)
        lib.run_control(self.run, tolerance, maximum, fixed)

    def __del__(self) -> None:
        self.lib.run_free(self.run)

    def numbers(self) -> np.ndarray:
        x = np.zeros(8)
        self.lib.run_numbers(self.run, x.ctypes.data)
        return x

    t_old = property(lambda self: float(self.numbers()[0]))
    t = property(lambda self: float(self.numbers()[1]))
    h_next = property(lambda self: float(self.numbers()[2]))
    fresh = property(lambda self: int(self.numbers()[4]))
    calls = property(lambda self: int(self.numbers()[5]))

    @property
    def y(self) -> np.ndarray:
        y = np.zeros(self.ny)
        self.lib.run_state(self.run, y.ctypes.data)
        return y

    @property
    def why(self) -> str:
        text: bytes = self.lib.run_why(self.run)
        return text.decode()

    def step(self, t_bound: float) -> bool:
        return bool(self.lib.run_step(self.run, t_bound) == 0)

    def to(self, t_bound: float) -> int:
        return int(self.lib.run_to(self.run, t_bound))

    def prepare(self) -> None:
        assert self.lib.run_prepare(self.run) == 0

    def dense(self, t: float) -> np.ndarray:
        y = np.zeros(self.ny)
        self.lib.run_dense(self.run, t, y.ctypes.data)
        return y

    def move(self, y: np.ndarray) -> None:
        self.lib.run_move(self.run, np.ascontiguousarray(y).ctypes.data)

    def save(self) -> tuple[bytes, bytes]:
        memory = ctypes.create_string_buffer(self.lib.run_saved(self.run))
        self.lib.run_save(self.run, memory)
        return bytes(memory), self.numbers().tobytes()

    def restore(self, saved: tuple[bytes, bytes]) -> None:
        self.lib.run_restore(self.run, saved[0], saved[1])


def elliptic(t: float) -> np.ndarray:
    """sn, cn, dn at k^2 = 1/2, and 1/(1 + t^2)."""
    functions = (float(mpmath.ellipfun(name, t, m=0.5)) for name in ("sn", "cn", "dn"))
    return np.array([*functions, 1 / (1 + t * t)])


def observed_order(steps: Sequence[float], errors: Sequence[float]) -> float:
    """The slope of log(error) over log(h), least squares."""
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


def fixed_steps(r: Run, t: float, n: int) -> None:
    """n equal steps to t by the bound that each is given."""
    start = r.t
    for j in range(1, n + 1):
        bound = start + (t - start) * j / n
        assert r.step(bound)
        assert r.t == bound


@pytest.mark.parametrize(
    ("method", "t", "counts"),
    [
        ("dop853", 4.0, (12, 16, 24, 32)),
        ("rk4", 6.0, (64, 128, 256)),
    ],
)
def test_order(library: ctypes.CDLL, method: str, t: float, counts: tuple[int, ...]) -> None:
    """The error of n equal steps falls as h^p: p = 8, 4."""
    errors = []
    for n in counts:
        r = Run(library, method, tolerance=1e30, h=t / n, fixed=t / n)
        fixed_steps(r, t, n)
        errors.append(abs(r.y - elliptic(t)).max())
    slope = observed_order([t / n for n in counts], errors)
    assert slope == pytest.approx(ORDER[method], abs=0.15)


def test_order_of_radau(library: ctypes.CDLL) -> None:
    """y'' = -y over six radians: the error of n equal steps falls as h^9."""
    counts, errors = (5, 6, 8, 10, 12), []
    for n in counts:
        r = Run(library, "radau", CIRCLE, [1.0, 0.0], tolerance=1e-5, h=6 / n)
        fixed_steps(r, 6, n)
        errors.append(abs(r.y - [math.cos(6), -math.sin(6)]).max())
    assert observed_order([1 / n for n in counts], errors) == pytest.approx(9, abs=0.15)


def test_tables_of_radau() -> None:
    """Its tables are those of collocation at Radau's five nodes: A satisfies the conditions of
    order 5 of the stages and of order 9 of the step, and A^-1 = T L T^-1."""
    t, text = radau.tableau(5), RUNTIME_FILES["radau.c"].read_text("utf-8")
    for name in ("C", "L", "T", "T_INVERSE", "P"):
        (table,) = re.findall(rf"double {name}\[[^=]*= (.*?);", text, re.DOTALL)
        told = [mpmath.mpf(x) for x in re.findall(r"-?[\d.]+", table)]
        assert told == pytest.approx(list(getattr(t, name)), rel=1e-15, abs=1e-19)
    with mpmath.workdps(30):
        for i, k in itertools.product(range(5), range(1, 10)):
            if k <= 5 or i == 4:
                integral = sum(t.A[i, j] * t.C[j] ** (k - 1) for j in range(5))
                assert abs(integral - t.C[i] ** k / k) < 1e-25
        L = mpmath.diag([t.L[k] for k in (0, 1, 1, 3, 3)])
        for k in (1, 3):
            L[k + 1, k], L[k, k + 1] = t.L[k + 1], -t.L[k + 1]
        assert mpmath.norm(t.T * L * t.T_INVERSE * t.A - mpmath.eye(5)) < 1e-25


@pytest.mark.parametrize(
    ("method", "order", "counts", "tolerance"),
    [
        ("dop853", 7, (32, 48, 64, 80), 1e30),
        ("rk4", 3, (32, 64, 128), 1e30),
        ("radau", 5, (32, 48, 64, 96), 1e-8),
    ],
)
def test_order_of_dense_output(
    library: ctypes.CDLL, method: str, order: int, counts: tuple[int, ...], tolerance: float
) -> None:
    """Within one step from an exact state the interpolation's error falls as h^(q + 1): q = 7, 3, 5."""
    errors = []
    for n in counts:
        h = 6 / n
        r = Run(library, method, y=elliptic(1.0), t=1.0, tolerance=tolerance, h=h, fixed=h)
        assert r.step(1 + h)
        r.prepare()
        inside = 1 + h * np.linspace(0.1, 0.9, 9)
        errors.append(max(abs(r.dense(t) - elliptic(t)).max() for t in inside))
        assert (r.dense(r.t_old) == elliptic(1.0)).all()
        assert r.dense(r.t) == pytest.approx(r.y, rel=1e-14, abs=1e-14)
    slope = observed_order([6 / n for n in counts], errors)
    assert slope == pytest.approx(order + 1, abs=0.15)


@pytest.mark.parametrize("method", ADAPTIVE)
def test_accepted_error_is_below_tolerance(library: ctypes.CDLL, method: str) -> None:
    """The first step, of a size chosen by the method, has an error below the tolerance."""
    for tolerance in (1e-4, 1e-6, 1e-8, 1e-10):
        r = Run(library, method, tolerance=tolerance)
        assert r.step(5.0)
        assert abs(r.y - elliptic(r.t)).max() < tolerance


def test_a_kink_is_not_overlooked(library: ctypes.CDLL) -> None:
    """y' = max(0, t - T): y(1) = (1 - T)^2/2 within 100 tolerances, wherever T lies; an estimate that is zero
    for kinks in certain places of a step lets it be 100,000."""
    tolerance, largest = 1e-8, 0.0
    for T in np.linspace(0.1, 0.9, 4001):
        r = Run(library, "dop853", KINK, [0.0, T], h=0.05, tolerance=tolerance)
        r.to(1.0)
        largest = max(largest, abs(r.y[0] - (1 - T) ** 2 / 2))
    assert largest < 100 * tolerance


def test_dop853_takes_the_step_of_scipy(library: ctypes.CDLL) -> None:
    """One step of the same size agrees with SciPy's DOP853 to rounding, and its dense output, too."""

    def f(t: float, y: np.ndarray) -> np.ndarray:
        return np.array([y[1] * y[2], -y[0] * y[2], -0.5 * y[0] * y[1], -2 * t * y[3] ** 2])

    for h in (0.1, 0.4):
        y0 = elliptic(0.7)
        other = DOP853(f, 0.7, y0, 10.0, first_step=h, rtol=1e-3, atol=1e-3)
        other.step()
        r = Run(library, "dop853", y=y0, t=0.7, h=h, tolerance=1e-3)
        assert r.step(0.7 + h)
        r.prepare()
        assert r.t == pytest.approx(other.t, rel=1e-15)
        assert r.y == pytest.approx(other.y, rel=1e-14, abs=1e-15)
        theirs = other.dense_output()
        for t in 0.7 + h * np.linspace(0, 1, 7):
            assert r.dense(t) == pytest.approx(theirs(t), rel=1e-13, abs=1e-14)


@pytest.mark.parametrize("method", METHODS)
def test_arrival_is_exact(library: ctypes.CDLL, method: str) -> None:
    """t_bound is reached bitwise, never passed, wherever it lies and however often it is moved."""
    for bound in (0.1, math.pi, 7 / 3, 1e-9, 1e-300, 123.456):
        r = Run(library, method, CIRCLE, [1.0, 0.0], fixed=0.07, tolerance=1e-6)
        times = []
        while r.t < bound:
            assert r.step(bound)
            times.append(r.t)
        assert times[-1] == bound
        assert all(t < bound for t in times[:-1])
    r = Run(library, method, CIRCLE, [1.0, 0.0], t=1e6, fixed=0.07)
    for bound in (math.nextafter(1e6, 2e6), 1e6 + 0.1, 1e6 + 0.3):
        assert r.to(bound) > 0
        assert r.t == bound


@pytest.mark.parametrize("method", ADAPTIVE)
def test_bound_just_beyond_a_step_is_reached_in_one(library: ctypes.CDLL, method: str) -> None:
    """A bound at 1.009 h is reached in one step, one at 1.02 h is not."""
    for part, steps in ((0.5, 1), (1.0, 1), (1.009, 1), (1.02, 2)):
        r = Run(library, method, CIRCLE, [1.0, 0.0], h=0.01, tolerance=1e-6)
        assert r.to(0.01 * part) == steps


@pytest.mark.parametrize("method", ADAPTIVE)
def test_step_cut_short_does_not_spoil_the_next(library: ctypes.CDLL, method: str) -> None:
    """The step tried after an arrival is not smaller than the one that was offered before it."""
    r = Run(library, method, CIRCLE, [1.0, 0.0])
    for _ in range(10):
        assert r.step(1e3)
    for _ in range(5):
        offered = r.h_next
        bound = r.t + offered / 1000
        assert r.step(bound)
        assert r.t == bound
        assert r.h_next >= offered


def test_time_is_what_was_travelled(library: ctypes.CDLL) -> None:
    """At t = 1e6 s the steps are rounded to the clock's grid: y = e^(t - t0) to 1e-14, not to 1e-10."""
    t0 = 1e6
    r = Run(library, "dop853", CHEAP, [1.0] * 4, t=t0, tolerance=1e-12)
    for _ in range(12):
        assert r.step(math.inf)
    assert r.y[0] == pytest.approx(math.exp(r.t - t0), rel=2e-13)


@pytest.mark.parametrize("method", METHODS)
def test_moving_to_the_same_state_changes_nothing(library: ctypes.CDLL, method: str) -> None:
    """A projection that moves nothing leaves all later steps the same to the bit; one that does, does not."""
    runs = [Run(library, method, fixed=0.05) for _ in range(3)]
    for k in range(10):
        for r in runs:
            assert r.step(100.0)
        runs[1].move(runs[1].y)
        if k == 4:
            runs[2].move(runs[2].y * (1 + 1e-9))
            assert runs[2].fresh == 1
    assert runs[0].t == runs[1].t
    assert runs[0].y.tolist() == runs[1].y.tolist()
    assert runs[0].calls == runs[1].calls
    assert runs[0].y.tolist() != runs[2].y.tolist()


@pytest.mark.parametrize(("method", "calls"), [("dop853", 12), ("rk4", 4)])
def test_evaluations_a_step(library: ctypes.CDLL, method: str, calls: int) -> None:
    """A step that is accepted needs 12 and 4 evaluations of f; one more after a move, but for dop853."""
    r = Run(library, method, CIRCLE, [1.0, 0.0], fixed=0.01, h=1e-3, maximum=1e-3)
    assert r.step(10.0)
    before = r.calls
    assert r.step(10.0)
    assert r.calls - before == calls
    r.move(r.y * (1 + 1e-12))
    before = r.calls
    assert r.step(10.0)
    assert r.calls - before == calls + (method != "dop853")


@pytest.mark.parametrize("method", METHODS)
def test_dense_output_survives_a_projection(library: ctypes.CDLL, method: str) -> None:
    """Once prepared, the interpolation does not see that y is moved at the end of the step."""
    r = Run(library, method, fixed=0.1)
    for _ in range(3):
        assert r.step(10.0)
    r.prepare()
    times = np.linspace(r.t_old, r.t, 5)
    before = [r.dense(t).tolist() for t in times]
    r.move(r.y + 1e-3)
    assert [r.dense(t).tolist() for t in times] == before


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("prepared", [False, True])
def test_rollback_is_exact(library: ctypes.CDLL, method: str, prepared: bool) -> None:
    """Put back from a copy of numbers and arrays, an integration goes on as if nothing had happened."""
    r, other = (Run(library, method, fixed=0.05, tolerance=1e-7) for _ in range(2))
    for _ in range(7):
        assert r.step(30.0)
    if prepared:
        r.prepare()
    r.move(r.y * (1 + 1e-12))
    saved, here = r.save(), 0.5 * (r.t_old + r.t)
    between = r.dense(here).tolist() if prepared else []
    path: list[list[list[float]]] = []
    for run in (r, r, other):
        run.restore(saved)
        if prepared:
            assert run.dense(here).tolist() == between
        path.append([])
        for _ in range(9):
            assert run.step(30.0)
            path[-1].append([run.t, run.h_next, *run.y])
    assert path[0] == path[1] == path[2]


def test_preparing_dense_output_changes_no_step(library: ctypes.CDLL) -> None:
    """Steps are the same to the bit, whether or not someone looks in between."""
    for method in METHODS:
        runs = [Run(library, method, fixed=0.05) for _ in range(2)]
        for _ in range(10):
            for r in runs:
                assert r.step(30.0)
            runs[1].prepare()
            runs[1].dense(runs[1].t)
        assert runs[0].y.tolist() == runs[1].y.tolist()
        assert runs[0].t == runs[1].t


@pytest.mark.parametrize("method", ADAPTIVE)
def test_a_stage_that_cannot_be_evaluated_makes_the_step_smaller(
    library: ctypes.CDLL, method: str
) -> None:
    """f fails once, within a step: the step is taken again, smaller, and the result is as good."""
    r = Run(library, method, tolerance=1e-8)
    assert r.step(5.0)
    offered = r.h_next
    library.run_fail(r.run, math.inf, math.inf, 3)
    assert r.step(5.0)
    assert r.t - r.t_old < 0.6 * offered
    assert r.to(5.0) > 0
    assert abs(r.y - elliptic(5.0)).max() < 1e-6


@pytest.mark.parametrize("method", METHODS)
def test_failure_leaves_the_integrator_as_it_was(library: ctypes.CDLL, method: str) -> None:
    """f fails for good after t: FAILED, the cause is named, the last step and its dense output stay."""
    r = Run(library, method, fixed=0.05)
    for _ in range(4):
        assert r.step(50.0)
    r.prepare()
    times = np.linspace(r.t_old, r.t, 5)

    def everything() -> list[list[float]]:
        return [r.numbers()[:4].tolist(), r.y.tolist(), *(r.dense(t).tolist() for t in times)]

    before = everything()
    library.run_fail(r.run, r.t * (1 + 1e-15), math.inf, 0)
    assert not r.step(50.0)
    assert everything() == before
    assert r.why.startswith(f"the integration stops at t = {r.t!r} s, ")
    assert r.why.endswith(": the mass matrix is singular")
    if method != "rk4":
        assert "step size underflow" in r.why


@pytest.mark.parametrize("method", METHODS)
def test_what_is_not_finite_is_not_a_step(library: ctypes.CDLL, method: str) -> None:
    """y' = y^2 escapes at t = 1, y' = sqrt(1 - t) is not a number beyond: both stop there, finite."""
    for problem, y0 in ((ESCAPE, 1.0), (ROOT, 0.0)):
        r = Run(library, method, problem, [y0], fixed=1e-3)
        assert r.to(2.0) == -1
        assert r.t == pytest.approx(1, abs=2e-3 if method == "rk4" else 1e-8)
        assert np.isfinite(r.y).all()
        assert ("not finite" if method == "rk4" else "step size underflow") in r.why


@pytest.mark.parametrize("method", METHODS)
def test_failure_at_the_start_names_its_cause(library: ctypes.CDLL, method: str) -> None:
    """No step can help where f cannot be evaluated at the state itself: its own sentence is kept."""
    r = Run(library, method)
    library.run_fail(r.run, -1.0, 1e-300, 0)
    assert not r.step(1.0)
    assert r.why == "the mass matrix is singular"


def test_van_der_pol(library: ctypes.CDLL) -> None:
    """mu = 1e6, two relaxation jumps (Hairer & Wanner II, sect. IV.10): the error follows the
    tolerance from 1e-3 to 1e-12, and the steps the sixth root of tol^(2/3), as of an estimate of order 5."""
    exact = np.array([1.7061677321704830, -0.89280970102479750])
    errors, steps, tolerances = [], [], [10.0**-k for k in range(3, 13)]
    for tolerance in tolerances:
        r = Run(library, "radau", VAN_DER_POL, [2.0, 0.0], tolerance=tolerance)
        steps.append(r.to(2.0))
        errors.append(abs(r.y / exact - 1).max())
        assert errors[-1] < 100 * tolerance
    assert all(b < a for a, b in itertools.pairwise(errors))
    assert 0 < steps[0] < 250
    assert observed_order(tolerances[4:], steps[4:]) == pytest.approx(-1 / 9, abs=0.01)
