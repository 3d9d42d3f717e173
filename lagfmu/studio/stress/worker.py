"""The process in which an FMU is probed (host.py): it answers the number of a probe with the verdict."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..host import serve
from .bench import Bench
from .probes import Probe, Verdict, attempt, probes, verdict


def probing() -> Callable[[Any], Verdict | None]:
    """What answers orders: first (FMU, the folder into which it was unpacked, quick), then numbers."""
    benches: list[Bench] = []
    work: list[Probe] = []

    def answer(order: Any) -> Verdict | None:
        if not isinstance(order, int):
            fmu, folder, quick = order
            benches.append(Bench(Path(fmu), quick, Path(folder)))
            work.extend(probes(benches[0].facts, quick))
            return None
        begun = time.perf_counter()
        finding = attempt(work[order], benches[0])
        return verdict(work[order], finding, time.perf_counter() - begun)

    return answer


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    serve(probing())
