"""Where the runs of a study are done: chunk by chunk, on the cores of this machine or on a Dask cluster.

A chunk is a task; which worker does it, in which order and how often changes no number.  The client never
loads the FMU's binary: host processes do.
"""

from __future__ import annotations

import atexit
import hashlib
import io
import itertools
import os
import threading
import zipfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...errors import SimulationError
from ...fmu.archive import version
from ...fmu.session import Outcome, Plan, Plug
from .design import Values
from .host import Host

PATIENCE = 15  # [s] for a scheduler to answer, and to have a worker
TRIES = 20  # of a chunk whose workers die, after Dask's own
AHEAD = 3  # chunks a core that are under way or wait

Chunks = Sequence[tuple[int, Values]]  # number, rows


def local(plug: Plug, plan: Plan, chunks: Chunks, workers: int) -> Iterator[tuple[int, Outcome]]:
    """Chunks as they are done, on `workers` host processes of this machine."""
    hosts: list[Host] = []
    own = threading.local()

    def run(values: Values) -> Outcome:
        if not hasattr(own, "host"):
            own.host = Host(plug)
            hosts.append(own.host)
        found: Outcome = own.host.run(plan, values)
        return found

    with ThreadPoolExecutor(workers) as pool:
        try:
            yield from _windowed(lambda values: pool.submit(run, values), chunks, AHEAD * workers)
        finally:
            for host in hosts:
                host.close()  # what waits for an answer gets none
            pool.shutdown(wait=False, cancel_futures=True)


def _windowed(
    submit: Callable[[Values], Future[Outcome]], chunks: Chunks, width: int
) -> Iterator[tuple[int, Outcome]]:
    """Results as they come, with at most `width` chunks under way."""
    waiting = iter(chunks)
    pending: dict[Future[Outcome], int] = {}
    while True:
        for number, values in waiting:
            pending[submit(values)] = number
            if len(pending) >= width:
                break
        if not pending:
            return
        done, _ = wait(pending, return_when=FIRST_COMPLETED)
        for future in done:
            yield pending.pop(future), future.result()


def connected(on: Any) -> tuple[Any, bool]:
    """A `dask.distributed.Client` from an address, or the one given; and whether it is ours to close.

    Raises SimulationError if Dask is not installed, the scheduler does not answer, or it has no workers.
    """
    try:
        from dask.distributed import Client
    except ImportError:
        raise SimulationError(
            "a sweep on a cluster needs dask.distributed: pip install 'lagfmu[study]'"
        ) from None
    if not isinstance(on, str):
        return on, False
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


def distributed(
    client: Any, fmu: Path, plug: Plug, plan: Plan, chunks: Chunks
) -> Iterator[tuple[int, Outcome]]:
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
            work, archive, digest, plug, plan, rows[number], retries=TRIES, pure=False
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
_hosts = threading.local()


def work(content: bytes, digest: str, plug: Plug, plan: Plan, values: Values) -> Outcome:
    """One chunk in a Dask worker: its thread keeps a host process with the FMU."""
    from dask.distributed import get_worker

    here = get_worker().local_directory  # Dask clears it behind a worker that was killed
    place = os.path.join(here, f"lagfmu_{digest}")
    with _lock:
        if place not in _unpacked:
            with zipfile.ZipFile(io.BytesIO(content)) as packed:
                packed.extractall(place)
            _unpacked.add(place)
    host: Host | None = getattr(_hosts, "host", None)
    if host is None or host.plug.folder != place:
        if host is not None:
            host.close()
        host = _hosts.host = Host(replace(plug, folder=place))
        atexit.register(host.close)
    return host.run(plan, values)
