"""The commands: options in, a call, tables and plots out."""

import sys

from ..fmu.archive import version


def main() -> None:
    """The `lagfmu` command, also as `python -m lagfmu`.  Asked for its version it waits for no SymPy."""
    if sys.argv[1:] == ["--version"]:
        say_version()
        return
    from .app import app

    app()


def say_version() -> None:
    """The version that FMUs state as their tool's."""
    print(f"lagfmu {version()}")
