"""The commands: options in, a call, tables and plots out.

In: the words of a command line.
Out: a call, and its answer as tables and plots.
Never knows: mechanics: the work is done by `api.py` and the rooms.
"""

import atexit
import gc
import os
import signal
import sys
from typing import Any, NoReturn

from ..fmu.archive import tool
from ..verification.pipeline import INTERRUPTED, TERMINATED


def main() -> None:
    """The `lagfmu` command, also as `python -m lagfmu`."""
    gc.set_threshold(100_000, 20, 20)  # SymPy makes many objects and few cycles, ...
    atexit.register(gc.freeze)  # ... which need not be searched for where the process ends
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # of small matrices threads wait for a core
    os.environ.setdefault("SYMPY_CACHE_SIZE", "50000")  # of 1,000 it forgets a chain's symbols
    signal.signal(signal.SIGTERM, _end)  # by the way on which temporary folders go
    if sys.argv[1:] == ["--version"]:
        print(tool())
        return
    try:
        from .app import app

        app()
    except KeyboardInterrupt:  # while it is still being loaded; later the command ends likewise
        sys.exit(INTERRUPTED)


def _end(*_: Any) -> NoReturn:
    sys.exit(TERMINATED)
