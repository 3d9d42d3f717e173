"""What a run costs in a sweep: python benchmarks/sweep.py ratios | million | cluster | deaths [RUNS]

Hemisphere, 2 s a run, the start angle varied; the time of the departure and the largest multiplier are kept.

ratios    a run in `lagfmu.sweep` on one core and on all, in `fmpy.simulate_fmu`, in fmpy with a kept
          instance, and in a C host (native/runs.c), at a communication step of 2 s and at the FMU's own,
          which is what fmpy takes by itself; processor time of all processes against the sweep on one
          core, and wall time against that on all; what takes turns within a round; medians
million   10^6 runs on all cores: time, and the memory of the client and of its workers along the way
cluster   a Dask scheduler and workers as a user starts them: the numbers of the local run, the time with one
          and with two workers, and the processor time of the workers and of all the rest
deaths    the same with a worker killed (SIGKILL) every few seconds, and the client once
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from resource import RUSAGE_CHILDREN, RUSAGE_SELF, getrusage

import fmpy
import numpy as np
from fmpy.simulation import instantiate_fmu

import lagfmu
from lagfmu.fmu.write import write
from lagfmu.model.file import load
from lagfmu.prepare.prepare import prepare

HERE = Path(__file__).parent
STOP, FIRST, LAST = 2.0, 0.05, 1.0
WANTED = ["lambda.surface", "departure.surface.time"]
# processor time and wall time of a run [us], a round each
Costs = dict[str, list[tuple[float, float]]]
ONE, EVERY = "lagfmu.sweep, one core", "lagfmu.sweep, all cores"
KEEP = ["lambda.surface:max", "departure.surface.time:last"]


def processor() -> float:
    """Processor time [s] of this process and of those that ended."""
    return sum(sum(getrusage(who)[:2]) for who in (RUSAGE_SELF, RUSAGE_CHILDREN))


def angles(runs: int) -> np.ndarray:
    return np.linspace(FIRST, LAST, runs)


def fmu(folder: Path) -> Path:
    """Hemisphere, native."""
    file = load(HERE.parent / "models" / "hemisphere.py")
    return write(prepare(file.model, file.scenes[0]), folder, file.closed_forms, target="native")


# ---------------------------------------------------------------------------- ratios


def swept(path: Path, step: float, runs: int, workers: int | None = 1) -> np.ndarray:
    """Sums of what is kept."""
    found = lagfmu.sweep(
        path, {"theta": angles(runs)}, keep=KEEP, stop_time=STOP, step_size=step, workers=workers
    )
    return np.array([float(found[k].sum()) for k in KEEP])


def by_fmpy(path: Path, step: float, runs: int, kept: bool) -> np.ndarray:
    """The same with fmpy.simulate_fmu, from the file each time or with an instance that is reset."""
    options = {"stop_time": STOP, "step_size": step, "output_interval": step, "output": WANTED}
    source = str(path)
    if kept:
        description, source = fmpy.read_model_description(source), fmpy.extract(source)
        instance = instantiate_fmu(source, description, "CoSimulation")
        options |= {"model_description": description, "fmu_instance": instance}
    sums = np.zeros(2)
    for theta in angles(runs):
        if kept:
            instance.reset()
        table = fmpy.simulate_fmu(source, start_values={"theta": theta}, **options)
        sums += table[WANTED[0]].max(), table[WANTED[1]][-1]
    return sums


def c_host(path: Path, folder: Path) -> Callable[[float, int], tuple[np.ndarray, float]]:
    """runs.c, compiled: sums, and processor time a run [us]."""
    description = fmpy.read_model_description(str(path))
    numbers = {v.name: str(v.valueReference) for v in description.modelVariables}
    headers = Path(fmpy.__file__).parent / "c-code"
    program = folder / "runs"
    subprocess.run(
        ["gcc", "-O2", f"-I{headers}", HERE / "native" / "runs.c", "-o", program, "-ldl"],
        check=True,
    )
    unpacked = Path(fmpy.extract(str(path), str(folder / "unpacked")))
    name = description.coSimulation.modelIdentifier
    library = unpacked / "binaries" / "linux64" / f"{name}.so"

    def run(step: float, runs: int) -> tuple[np.ndarray, float]:
        words = [library, description.guid, runs, FIRST, LAST, STOP, round(STOP / step)]
        words += [numbers[n] for n in ("theta", *WANTED)]
        done = subprocess.run(
            [program, *map(str, words)], capture_output=True, text=True, check=True
        )
        *sums, cost = map(float, done.stdout.split())
        return np.array(sums), cost

    return run


def timed(work: Callable[[], object]) -> np.ndarray:
    """Processor time and wall time [s]."""
    begun = np.array([processor(), time.perf_counter()])
    work()
    return np.array([processor(), time.perf_counter()]) - begun


def costs(path: Path, folder: Path, step: float, runs: tuple[int, int], rounds: int) -> Costs:
    """Of a run, by each way; of a sweep that of a further one."""
    found: Costs = {
        k: [] for k in (ONE, EVERY, "C host", "fmpy, instance kept", "fmpy.simulate_fmu")
    }
    host = c_host(path, folder)
    for _ in range(rounds):
        for name, workers in ((ONE, 1), (EVERY, None)):
            few, many = (
                timed(lambda n=n, w=workers: swept(path, step, n, w)) for n in (runs[0], runs[1])
            )
            found[name].append(tuple(1e6 * (many - few) / (runs[1] - runs[0])))
        found["C host"].append((host(step, runs[1])[1],) * 2)
        for name, count in (("fmpy, instance kept", 300), ("fmpy.simulate_fmu", 30)):
            spent = timed(lambda n=name, c=count: by_fmpy(path, step, c, "kept" in n))
            found[name].append(tuple(1e6 * spent / count))
    sums = swept(path, step, 500)
    for others in (host(step, 500)[0], by_fmpy(path, step, 500, True)):
        assert np.allclose(others, sums, rtol=1e-9), (others, sums)
    return found


def ratios(path: Path, folder: Path, rounds: int) -> None:
    """A table a communication step."""
    for step, runs in ((STOP, (4000, 40000)), (0.01, (2000, 20000))):
        found = costs(path, folder, step, runs, rounds)
        print(
            f"communication step {step:g} s, {os.cpu_count()} cores; a run in microseconds, and its ratio"
        )
        print(f"  {'':24s} {'processor':>10s} {'/one core':>9s} {'wall':>10s} {'/all cores':>10s}")
        for name, each in found.items():
            cells = []
            for kind, own in enumerate((ONE, EVERY)):
                pairs = zip(each, found[own], strict=True)
                ratio = statistics.median(a[kind] / b[kind] for a, b in pairs)
                cells.append((statistics.median(a[kind] for a in each), ratio))
            (busy, one), (wall, every) = cells
            print(f"  {name:24s} {busy:10.1f} {one:9.2f} {wall:10.1f} {every:10.2f}", flush=True)


# ---------------------------------------------------------------------------- million


def tree(root: int) -> dict[int, float]:
    """Resident memory [MB] of a process and of its descendants."""
    parents, sizes = {}, {}
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            _, tail = (entry / "stat").read_text().rsplit(")", 1)
            parents[int(entry.name)] = int(tail.split()[1])
            pages = int((entry / "statm").read_text().split()[1])
        except OSError:
            continue
        sizes[int(entry.name)] = pages * os.sysconf("SC_PAGE_SIZE") / 1e6
    members = {root}
    while True:
        more = {p for p, q in parents.items() if q in members} - members
        if not more:
            return {p: sizes[p] for p in members if p in sizes}
        members |= more


def million(path: Path, folder: Path, runs: int, step: float) -> None:
    """Times, and memory at each tenth of the way."""
    marks: list[tuple[int, float, list[float]]] = []
    own = os.getpid()

    def tell(done: int, total: int, refused: int) -> None:
        if 10 * done >= (len(marks) + 1) * total // 2 and done < total:  # every twentieth
            sizes = tree(own)
            others = sorted(v for p, v in sizes.items() if p != own)
            marks.append((done, sizes[own], others))
            print(f"  {done:8d} runs: client {sizes[own]:.0f} MB, workers "
                  f"{', '.join(f'{v:.0f}' for v in others)} MB", flush=True)  # fmt: skip

    begun, busy = time.perf_counter(), processor()
    found = lagfmu.sweep(
        path, {"theta": angles(runs)}, keep=KEEP, stop_time=STOP, step_size=step,
        out=folder / "runs.parquet", progress=tell,
    )  # fmt: skip
    wall, busy = time.perf_counter() - begun, processor() - busy
    size = (folder / "runs.parquet").stat().st_size / 1e6
    print(f"{runs} runs, communication step {step:g} s, {os.cpu_count()} cores: {wall:.0f} s, processor "
          f"{busy:.0f} s ({1e6 * busy / runs:.0f} us a run), {found.attrs['refused']} refused, "
          f"{size:.0f} MB of Parquet, client at the end {tree(own)[own]:.0f} MB")  # fmt: skip
    force = np.abs(found["lambda.surface:max"] / (9.81 * np.cos(found.theta)) - 1)
    print(f"  largest multiplier against m g cos(theta): {float(force.max()):.1e}")
    clients, workers = [m[1] for m in marks], [max(m[2], default=0.0) for m in marks]
    print(
        f"  client {min(clients):.0f} ... {max(clients):.0f} MB, workers at most {max(workers):.0f} MB"
    )


# ---------------------------------------------------------------------------- cluster


class Cluster:
    """`dask scheduler` and `dask worker` as a user starts them."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.started = folder, []
        file = folder / "scheduler.json"
        self._start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard",
                    "--scheduler-file", str(file))  # fmt: skip
        while not file.exists() or not file.read_text().strip():
            time.sleep(0.1)
        self.address = json.loads(file.read_text())["address"]

    def _start(self, *words: str) -> subprocess.Popen[bytes]:
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        process = subprocess.Popen([sys.executable, "-m", "dask", *words], **quiet)
        self.started.append(process)
        return process

    def worker(self) -> subprocess.Popen[bytes]:
        """One more, in which one thread works; its nanny starts it again if it dies."""
        return self._start("worker", self.address, "--nthreads", "1", "--no-dashboard",
                           "--local-directory", str(self.folder))  # fmt: skip

    def kill_one(self, worker: subprocess.Popen[bytes]) -> bool:
        """SIGKILL to the process in which the tasks run; the nanny stays."""
        for process in tree(worker.pid):
            words = Path(f"/proc/{process}/cmdline").read_bytes()
            if b"spawn_main" in words:
                os.kill(process, signal.SIGKILL)
                return True
        return False

    def close(self) -> None:
        for process in reversed(self.started):
            process.terminate()
        for process in self.started:
            process.wait()


def spent(processes: list[subprocess.Popen[bytes]]) -> float:
    """Processor time [s] of processes and their descendants so far."""
    ticks = 0
    for p in {member for process in processes for member in tree(process.pid)}:
        with contextlib.suppress(OSError):
            words = Path(f"/proc/{p}/stat").read_text().rsplit(")", 1)[1].split()
            ticks += sum(map(int, words[11:15]))  # its own, and of children that ended
    return ticks / os.sysconf("SC_CLK_TCK")


def cluster(path: Path, folder: Path, runs: int, step: float, every: float | None) -> None:
    """Numbers and speed; with `every` deaths, so many seconds apart."""
    options = {"keep": KEEP, "stop_time": STOP, "step_size": step}
    vary = {"theta": angles(runs)}
    here = lagfmu.sweep(path, vary, **options)

    def same(found: object) -> bool:
        return all(found[k].values.tobytes() == here[k].values.tobytes() for k in KEEP)

    dask = Cluster(folder)
    try:
        workers, walls = [dask.worker()], []
        if every is not None:
            murders(dask, [*workers, dask.worker()], path, folder, runs, step, every)
            print(f"the local numbers: {same(table_of(folder / 'out.parquet', runs))}")
            return
        for count in (1, 2):
            if count > 1:
                workers.append(dask.worker())
            lagfmu.sweep(path, {"theta": angles(200)}, on=dask.address, **options)  # warm
            begun = time.perf_counter()
            theirs, rest = spent(workers), spent(dask.started[:1]) + processor()
            found = lagfmu.sweep(path, vary, on=dask.address, **options)
            walls.append(time.perf_counter() - begun)
            theirs = spent(workers) - theirs
            rest = spent(dask.started[:1]) + processor() - rest
            print(f"{count} workers: {runs} runs in {walls[-1]:.1f} s, processor {theirs:.1f} s in the "
                  f"workers, {rest:.1f} s in scheduler and client; the local numbers: {same(found)}",
                  flush=True)  # fmt: skip
        print(
            f"speed-up {walls[0] / walls[1]:.2f} on a machine with a load of {os.getloadavg()[0]:.0f}"
        )
    finally:
        dask.close()


def table_of(file: Path, runs: int) -> dict[str, object]:
    """The kept columns of a Parquet file that has every run exactly once."""
    import pandas as pd

    table = pd.read_parquet(file)
    assert table["run"].tolist() == list(range(runs)), "not every run is there once"
    assert (table["status"] == "ok").all()
    return {k: table[k] for k in KEEP}


def murders(
    dask: Cluster, workers: list, path: Path, folder: Path, runs: int, step: float, every: float
) -> None:
    """A worker is killed every so many seconds, and the client once."""
    out = folder / "out.parquet"
    words = [sys.executable, "-m", "lagfmu", "sweep", str(path), "--on", dask.address, "--out", str(out),
             "--vary", f"theta={FIRST}:{LAST}:{runs}", "--stop-time", str(STOP), "--step-size", str(step),
             *(w for k in KEEP for w in ("--keep", k))]  # fmt: skip
    parts = out.with_name(f"{out.name}.parts")
    client = subprocess.Popen(words)
    killed, last, found = 0, time.monotonic(), None
    while client.poll() is None:
        time.sleep(0.2)
        done = len(list(parts.glob("part_*.parquet"))) if parts.exists() else 0
        if found is None and done > 30:
            client.kill()
            client.wait()
            found = done
            client = subprocess.Popen([*words, "--resume"])
        if done and time.monotonic() - last > every:
            killed += dask.kill_one(workers[killed % 2])
            last = time.monotonic()
    assert client.returncode == 0
    print(f"{killed} workers killed, the client once after {found} chunks: every run exactly once")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("what", choices=["ratios", "million", "cluster", "deaths"])
    parser.add_argument("runs", type=int, nargs="?")
    parser.add_argument("--step", type=float, default=0.01, help="communication step [s]")
    parser.add_argument("--every", type=float, default=4, help="[s] from death to death")
    parser.add_argument("--rounds", type=int, default=5)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="lagfmu_") as name:
        place = Path(name)
        if given.what == "ratios":
            ratios(fmu(place), place, given.rounds)
        elif given.what == "million":
            million(fmu(place), place, given.runs or 10**6, given.step)
        else:
            every = given.every if given.what == "deaths" else None
            cluster(fmu(place), place, given.runs or 20000, given.step, every)
