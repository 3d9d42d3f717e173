"""The commands: options in, a call, tables and plots out."""

import signal
import sys
from typing import Any, NoReturn

from ..fmu.archive import version
from ..verification.pipeline import INTERRUPTED, TERMINATED


def main() -> None:
    """The `lagfmu` command, also as `python -m lagfmu`."""
    signal.signal(signal.SIGTERM, _end)  # by the way on which temporary folders go
    if sys.argv[1:] == ["--version"]:
        say_version()
        return
    try:
        from .app import app

        app()
    except KeyboardInterrupt:  # while it is still being loaded; later the command ends likewise
        sys.exit(INTERRUPTED)


def _end(*_: Any) -> NoReturn:
    sys.exit(TERMINATED)


def say_version() -> None:
    """The version that FMUs state as their tool's."""
    print(f"lagfmu {version()}")
