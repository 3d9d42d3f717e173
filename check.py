"""One command for all checks: format, lint, types, tests.  `--ci` checks the format only."""

from __future__ import annotations

import subprocess
import sys

CI = "--ci" in sys.argv[1:]
COMMANDS = (
    ["ruff", "format", *(["--check"] if CI else []), "."],
    ["ruff", "check", *([] if CI else ["--fix"]), "."],
    ["mypy"],
    ["pytest", "-q"],
)


def main() -> int:
    """Run every command, report all that fail."""
    failed = []
    for command in COMMANDS:
        print("$", " ".join(command), flush=True)
        if subprocess.run([sys.executable, "-m", *command], check=False).returncode:
            failed.append(command[0])
    if failed:
        print("failed:", ", ".join(failed))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
