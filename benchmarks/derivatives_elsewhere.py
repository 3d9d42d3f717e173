"""How does the time of an event depend on parameters?  lagfmu, diffrax and heyoka side by side.

    pip install diffrax heyoka          # those that you want; what is not there is skipped, and said
    python benchmarks/derivatives_elsewhere.py [--rounds 7]

hemisphere: the time T at which a particle leaves a hemisphere from rest at theta0 = 0.3, a = 1, g = 9.81,
and its derivatives by a (T/(2 a)) and theta0 (-1.01696078397883).  ball: the time of the fourth impact of a
ball from rest at h = 1 with restitution 0.7, and its derivatives by h and the restitution (closed form).
The others get the equations of motion by hand; what they have no words for, the jump of the columns at an
impact, is written by hand for heyoka (variational equations, a terminal event), and left to automatic
differentiation through one solve for each flight for diffrax (Dopri8, an event found by Newton's method,
forward mode).

Printed for each tolerance: the largest error of a derivative, and the processor time of a run with both
derivatives [us], compiled and warm, the median of the rounds.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import math
import os
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.integrate import quad

from lagfmu import build_fmu
from lagfmu.fmu.session import LAST, Plan, Session, run_batch
from lagfmu.model.file import load

os.environ.setdefault(
    "XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
)
MODELS = Path(__file__).parent.parent / "models"
G, THETA0, RESTITUTION, IMPACTS = 9.81, 0.3, 0.7, 4
TOLERANCES = (1e-6, 1e-9, 1e-11)
RUNS = 20
ABOVE = 1e-14  # m, where a flight begins in heyoka: on the limit itself it finds no event
Run = Callable[[], tuple[float, float]]  # the two derivatives of a problem


def exact(problem: str) -> tuple[float, float]:
    """The derivatives by a and theta0, or by h and the restitution."""
    if problem == "hemisphere":  # the energy integral, over s with theta = theta0 + s^2
        last = math.sqrt(math.acos(2 / 3 * math.cos(THETA0)) - THETA0)

        def slowness(s: float) -> float:
            half = s * s / 2
            fallen = 2 * math.sin(THETA0 + half) * math.sin(half) if s else 0.0
            return (
                2 * s / math.sqrt(2 * G * fallen) if s else 2 / math.sqrt(2 * G * math.sin(THETA0))
            )

        return quad(slowness, 0, last, epsabs=1e-13, epsrel=1e-13)[0] / 2, -1.01696078397883
    fall, e = math.sqrt(2 / G), RESTITUTION
    powers = 1 + 2 * sum(e**k for k in range(1, IMPACTS))
    return fall * powers / 2, fall * 2 * sum(k * e ** (k - 1) for k in range(1, IMPACTS))


def ours(problem: str, folder: str) -> Iterator[tuple[float, Run]]:
    """The FMU, through many runs in one call."""
    name, time_of, by, start = {
        "hemisphere": ("Hemisphere", "departure.surface.time", ("a", "theta"), {"theta": THETA0}),
        "ball": ("BouncingBall", "closing.floor.time", ("y", "e"), {}),
    }[problem]
    file = load(MODELS / f"{'hemisphere' if problem == 'hemisphere' else 'bouncing_ball'}.py")
    scene = next(s for s in file.scenes if s.name == name)
    asked = (f"{time_of}:{','.join(by)}",)
    scene = replace(scene, outputs=(time_of,), sensitivities=asked)
    fmu = build_fmu(file.model, folder, scene, check=False)
    stop = 0.6 if problem == "hemisphere" else 2.0
    keep = tuple((f"sensitivity.{time_of}.by.{n}", LAST) for n in by)
    with Session(fmu) as session:
        plan = Plan((*start, "solver.tolerance"), keep, np.array([0, stop]))
        for tolerance in TOLERANCES:
            row = np.array([[*start.values(), tolerance]])

            def run(row: np.ndarray = row) -> tuple[float, float]:
                found = run_batch(session, plan, row).result[0]
                return float(found[0]), float(found[1])

            yield tolerance, run


def by_diffrax(problem: str, _: str) -> Iterator[tuple[float, Run]]:
    """Automatic differentiation of one solve to the event, or of four."""
    import diffrax
    import jax
    import jax.numpy as jnp
    import optimistix

    jax.config.update("jax_enable_x64", True)
    find = optimistix.Newton(1e-14, 1e-14, optimistix.rms_norm)

    def solved(rate, event, begin, y, tolerance, last):
        return diffrax.diffeqsolve(
            diffrax.ODETerm(rate),
            diffrax.Dopri8(),
            begin,
            last,
            None,
            y,
            stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance),
            event=diffrax.Event(event, find, direction=False),
            saveat=diffrax.SaveAt(t1=True),
            adjoint=diffrax.ForwardMode(),
        )

    def leaves(p, tolerance):
        a, theta0 = p
        found = solved(
            lambda t, y, _: jnp.array([y[1], G / a * jnp.sin(y[0])]),
            lambda t, y, args, **_: G * jnp.cos(y[0]) - a * y[1] ** 2,
            0.0,
            jnp.array([theta0, 0.0]),
            tolerance,
            5.0,
        )
        return found.ts[0]

    def bounces(p, tolerance):
        h, e = p
        begin, y = 0.0, jnp.array([h, 0.0])
        for _ in range(IMPACTS):
            found = solved(
                lambda t, y, _: jnp.array([y[1], -G]),
                lambda t, y, args, **_: y[0],
                begin,
                y,
                tolerance,
                begin + 5.0,
            )
            begin, y = found.ts[0], jnp.array([0.0, -e * found.ys[0, 1]])
        return begin

    of, at = (leaves, (1.0, THETA0)) if problem == "hemisphere" else (bounces, (1.0, RESTITUTION))
    for tolerance in TOLERANCES:
        slope = jax.jit(jax.jacfwd(lambda p, tolerance=tolerance: of(p, tolerance)))
        point = jnp.array(at)

        def run(slope=slope, point=point) -> tuple[float, float]:
            found = slope(point)
            return float(found[0]), float(found[1])

        yield tolerance, run


def by_heyoka(problem: str, _: str) -> Iterator[tuple[float, Run]]:
    """Taylor series of the variational equations, a terminal event; what happens there by hand."""
    import heyoka as hy

    x, v = hy.make_vars("x", "v")
    if problem == "hemisphere":
        equations = [(x, v), (v, G / hy.par[0] * hy.sin(x))]
        limit, start, parameters = G * hy.cos(x) - hy.par[0] * v**2, [THETA0, 0.0], [1.0]
        varied = [x, hy.par[0]]  # by theta0, by a
    else:
        equations = [(x, v), (v, hy.expression(-G))]
        limit, start, parameters = x, [1.0, 0.0], []
        varied = [x, v]
    system = hy.var_ode_sys(equations, varied, order=1)
    for tolerance in TOLERANCES:
        event = hy.t_event(limit, direction=hy.event_direction.negative)
        stepper = hy.taylor_adaptive(
            system, start, pars=parameters, tol=tolerance, t_events=[event]
        )
        columns = np.array(stepper.state[2:])

        def leave(stepper=stepper, columns=columns) -> tuple[float, float]:
            stepper.time = 0.0
            stepper.state[:] = [*start, *columns]
            stepper.reset_cooldowns()
            stepper.propagate_until(5.0)
            q, w = stepper.state[:2]
            by_theta, by_a, of_theta, of_a = stepper.state[2:]
            pace = -G * math.sin(q) * w - 2 * w * G * math.sin(q)
            slope = (-G * math.sin(q), -2 * w)
            late = slope[0] * by_a + slope[1] * of_a - w**2
            return -late / pace, -(slope[0] * by_theta + slope[1] * of_theta) / pace

        def bounce(stepper=stepper, columns=columns) -> tuple[float, float]:
            stepper.time = 0.0
            stepper.state[:] = [*start, *columns]
            carried = np.array([[1.0, 0.0], [0.0, 0.0]])  # (y, v) by (h, e)
            for _ in range(IMPACTS):
                stepper.reset_cooldowns()
                stepper.propagate_until(5.0)
                speed = stepper.state[1]
                before = np.array(stepper.state[2:]).reshape(2, 2) @ carried
                later = -before[0] / speed
                of_speed = before[1] - G * later
                carried = np.array(
                    [RESTITUTION * speed * later, -RESTITUTION * of_speed + G * later]
                )
                carried[1, 1] -= speed
                stepper.state[:] = [ABOVE, -RESTITUTION * speed, *columns]
            return float(later[0]), float(later[1])

        yield tolerance, leave if problem == "hemisphere" else bounce


def microseconds(run: Run) -> float:
    """Processor time of one run, of many."""
    begun = time.process_time()
    for _ in range(RUNS):
        run()
    return (time.process_time() - begun) / RUNS * 1e6


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=7)
    rounds = parser.parse_args().rounds
    programs = {"lagfmu": ours, "diffrax": by_diffrax, "heyoka": by_heyoka}
    for problem in ("hemisphere", "ball"):
        for name, program in programs.items():
            expected = exact(problem)
            with tempfile.TemporaryDirectory(prefix="lagfmu_") as folder:
                try:
                    version = importlib.metadata.version(name)
                    for tolerance, run in program(problem, folder):
                        off = max(abs(a - b) for a, b in zip(run(), expected, strict=True))
                        cost = statistics.median(microseconds(run) for _ in range(rounds))
                        print(
                            f"{problem:11s} {name:8s} {version:8s} {tolerance:.0e}: {off:.1e} {cost:8.0f} us"
                        )
                except ImportError:
                    print(f"{problem:11s} {name:8s} is not installed")


if __name__ == "__main__":
    main()
