"""Where the runs of a study are done: chunk by chunk, on the cores of this machine or on a Dask cluster.

A chunk is a task; which worker does it, in which order and how often changes no number.  The client never
loads the FMU's binary: host processes do.
"""

from __future__ import annotations

import atexit
import contextlib
import hashlib
import io
import itertools
import logging
import os
import signal
import threading
import zipfile
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from pathlib import Path
from typing import Any

from ...errors import SimulationError
from ...fmu.archive import version
from ...fmu.session import Outcome, Plan
from ..host import EndedError
from .design import Values
from .process import SessionProcess

PATIENCE = 15  # [s] for a scheduler to answer, and to have a worker
TRIES = 20  # of a chunk whose workers die, after Dask's own
BEAT = 0.5  # [s] between looks at how far it is
AHEAD = 3  # chunks a core that are under way or wait

Chunks = Sequence[tuple[int, Values]]  # number, rows


@contextlib.contextmanager
def asked_to_stop() -> Iterator[threading.Event]:
    """Ctrl-C, and SIGINT from anywhere, set the event, so that what is finished can be kept first; the second
    one raises KeyboardInterrupt.  In another thread than the main one the event is never set."""
    stop = threading.Event()

    def heard(*_: Any) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()

    if threading.current_thread() is not threading.main_thread():
        yield stop
        return
    before = signal.signal(signal.SIGINT, heard)
    try:
        yield stop
    finally:
        signal.signal(signal.SIGINT, before)


def local(
    folder: str,
    plan: Plan,
    chunks: Chunks,
    workers: int,
    limit: float | None,
    stop: threading.Event,
    beat: Callable[[int], None],
) -> Generator[tuple[int, Outcome], None, None]:
    """Chunks as they are done, on `workers` host processes of this machine, until they are asked to stop.

    `limit`: of the time of a run [s]; `beat` hears in between how many runs of unfinished chunks are done.
    """
    processes: list[SessionProcess] = []
    own = threading.local()
    under_way: dict[int, int] = {}
    over = threading.Event()

    def run(number: int, values: Values) -> Outcome:
        if not hasattr(own, "process"):
            own.process = SessionProcess(folder, limit)
            processes.append(own.process)
        if over.is_set():
            raise EndedError
        found: Outcome = own.process.run(plan, values, lambda n: under_way.update({number: n}))
        return found

    waiting = iter(chunks)
    pending: dict[Future[Outcome], int] = {}
    with contextlib.ExitStack() as last, ThreadPoolExecutor(workers) as pool:
        try:
            while not stop.is_set():
                for number, values in itertools.islice(waiting, AHEAD * workers - len(pending)):
                    pending[pool.submit(run, number, values)] = number
                if not pending:
                    return
                done, _ = wait(pending, BEAT, FIRST_COMPLETED)
                for future in done:
                    number = pending.pop(future)
                    under_way.pop(number, None)
                    yield number, future.result()
                if not done:
                    beat(sum(under_way.values()))
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
            over.set()
            for process in processes:
                process.end()  # what waits for an answer gets none
                last.callback(process.close)


def connected(on: Any) -> tuple[Any, bool]:
    """A `dask.distributed.Client` from an address, or the one given; and whether it is ours to close.

    Raises SimulationError if Dask is not installed, the scheduler does not answer, or it has no workers.
    """
    try:
        from dask.distributed import Client
    except ImportError:
        raise SimulationError(
            "a sweep on a cluster needs dask.distributed: pip install distributed"
        ) from None
    if not isinstance(on, str):
        return on, False
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # what it says, we raise
    try:
        client = Client(on, timeout=PATIENCE, set_as_default=False)
    except Exception as error:
        raise SimulationError(
            f"no Dask scheduler answers at {on!r} within {PATIENCE} s ({type(error).__name__}): start one "
            "with `dask scheduler`, and workers with `dask worker ADDRESS`"
        ) from None
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError:
        client.close()
        raise SimulationError(
            f"the Dask scheduler at {on!r} has no workers: start some with `dask worker {on}`"
        ) from None
    return client, True


def closed(client: Any) -> None:
    """Close a client, also one whose scheduler is gone."""
    with contextlib.suppress(Exception):
        client.close(timeout=1)


def distributed(
    client: Any, fmu: Path, plan: Plan, chunks: Chunks, limit: float | None
) -> Generator[tuple[int, Outcome], None, None]:
    """Chunks as they are done on a cluster.  The FMU is a task of its own: it goes to each worker once, and
    is made again where the workers that had it died."""
    from dask import distributed as dask

    content = fmu.read_bytes()
    digest = hashlib.sha256(content).hexdigest()
    archive = client.submit(bytes, content, key=f"lagfmu-{digest[:24]}", retries=TRIES)
    waiting, tries = iter(chunks), dict.fromkeys((n for n, _ in chunks), 0)
    rows = dict(chunks)
    known: dict[Any, int] = {}  # what is under way

    def submit(number: int) -> Any:
        future = client.submit(
            work, archive, digest, plan, rows[number], limit, retries=TRIES, pure=False
        )
        known[future] = number
        return future

    def more() -> list[Any]:
        """As many chunks as there is work for, however many workers there are by now."""
        room = AHEAD * (sum(client.nthreads().values()) or 1) - len(known)
        return [submit(n) for n, _ in itertools.islice(waiting, max(room, 0))]

    queue: Any = dask.as_completed(more(), loop=client.loop)
    for future in queue:
        number = known.pop(future)
        try:
            found = future.result()
        except SimulationError:
            raise
        except Exception as error:  # the workers that had it died, too often for Dask
            if client.status != "running" or isinstance(error, (CancelledError, OSError)):
                raise SimulationError(
                    f"the Dask scheduler at {client.scheduler.address!r} is gone ({type(error).__name__}): "
                    "start one with `dask scheduler`, and go on with resume (--resume)"
                ) from None
            tries[number] += 1
            if tries[number] > TRIES or "KilledWorker" not in type(error).__name__:
                raise SimulationError(
                    f"chunk {number} cannot be run on the cluster ({type(error).__name__}: {error}): its "
                    f"workers need Python with lagfmu {version()}, as here"
                ) from None
            queue.add(submit(number))
            continue
        yield number, found
        queue.update(more())


# ---------------------------------------------------------------------------- in a worker

_lock = threading.Lock()
_unpacked: set[str] = set()  # folders
_own = threading.local()


def work(
    content: bytes, digest: str, plan: Plan, values: Values, limit: float | None = None
) -> Outcome:
    """One chunk in a Dask worker: its thread keeps a host process with the FMU."""
    from dask.distributed import get_worker

    here = get_worker().local_directory  # Dask clears it behind a worker that was killed
    place = os.path.join(here, f"lagfmu_{digest}")
    with _lock:
        if place not in _unpacked:
            with zipfile.ZipFile(io.BytesIO(content)) as packed:
                packed.extractall(place)
            _unpacked.add(place)
    process: SessionProcess | None = getattr(_own, "process", None)
    if process is None or process.folder != place or process.limit != limit:
        if process is not None:
            process.close()
        process = _own.process = SessionProcess(place, limit)
        atexit.register(process.close)
    return process.run(plan, values)
