"""What the package imports is what pyproject.toml declares."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

REPOSITORY = Path(__file__).parent.parent


def test_what_is_imported_is_declared_and_what_is_declared_is_imported():
    """deptry finds no import of a package that only another one brings, and no dependency that is idle."""
    command = [sys.executable, "-m", "deptry", "."]
    run = subprocess.run(
        command, cwd=REPOSITORY, capture_output=True, text=True, timeout=100, check=False
    )
    assert run.returncode == 0, run.stderr[-2000:]
