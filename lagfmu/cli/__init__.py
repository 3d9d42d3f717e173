"""The commands: options in, a call, tables and plots out."""

import sys

from ..fmu.archive import version

INTERRUPTED = 130  # the exit status that shells know for Ctrl-C


def main() -> None:
    """The `lagfmu` command, also as `python -m lagfmu`.  Asked for its version it waits for no SymPy."""
    if sys.argv[1:] == ["--version"]:
        say_version()
        return
    try:
        from .app import app

        app()
    except KeyboardInterrupt:  # while SymPy is still being loaded; later the command ends likewise
        sys.exit(INTERRUPTED)


def say_version() -> None:
    """The version that FMUs state as their tool's."""
    print(f"lagfmu {version()}")
