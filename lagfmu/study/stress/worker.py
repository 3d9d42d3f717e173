"""The process in which an FMU is probed: `python -m lagfmu.study.stress.worker FMU RESULTS FIRST QUICK`.

It writes a line of JSON to RESULTS for each probe that begins and for each verdict, so that the
command knows what the FMU was doing when it takes this process down.
"""

from __future__ import annotations

import errno
import json
import sys
import time
import warnings
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ...errors import TemporaryFolderError
from .bench import Bench
from .probe import NO_ROOM, attempt, verdict
from .probes import probes


def main(fmu: str, results: str, first: str, quick: str) -> None:
    """Probe from number `first` on."""
    warnings.simplefilter("ignore")
    with open(results, "a", encoding="utf-8") as file, Bench(Path(fmu), quick == "1") as bench:

        def tell(**line: Any) -> None:
            file.write(json.dumps(line) + "\n")
            file.flush()

        work = probes(bench.facts, bench.quick)
        tell(total=len(work), name=bench.facts.name, target=bench.facts.target)
        for k, probe in enumerate(work):
            if k < int(first):
                continue
            tell(begin=k, family=probe.family, probe=probe.name)
            begun = time.perf_counter()
            finding = attempt(probe, bench)
            tell(end=k, row=asdict(verdict(probe, finding, time.perf_counter() - begun)))
        tell(done=True)


def _no_room(error: Exception) -> bool:
    full = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
    return isinstance(error, TemporaryFolderError) or getattr(error, "errno", None) in full


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except Exception as error:
        if not _no_room(error):
            raise
        sys.exit(NO_ROOM)  # what it would say has no room either
