"""What the runtime and the build decide by stands once, in runtime/base/thresholds.h."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from runtime import INCLUDES, compiler

import lagfmu
from lagfmu.testing import thresholds

PACKAGE = Path(lagfmu.__file__).parent
NAMES = sorted(thresholds._VALUES)


def test_python_reads_what_c_compiles(tmp_path: Path) -> None:
    """Each threshold is the same double in C and in Python, to the last bit."""
    rows = "".join(f'    printf("{n} %a\\n", (double){n});\n' for n in NAMES)
    text = (
        f'#include "thresholds.h"\n#include <stdio.h>\nint main(void) {{\n{rows}    return 0;\n}}\n'
    )
    (tmp_path / "print.c").write_text(text)
    command = [compiler(), *INCLUDES, "print.c", "-o", "print"]
    subprocess.run(command, cwd=tmp_path, check=True, timeout=120)
    printed = subprocess.run(
        [str(tmp_path / "print")], capture_output=True, text=True, check=True, timeout=20
    )
    compiled = dict(line.split() for line in printed.stdout.splitlines())
    assert {n: float.fromhex(v) for n, v in compiled.items()} == {
        n: float(thresholds._VALUES[n]) for n in NAMES
    }


def test_a_name_that_is_not_there_is_an_import_error() -> None:
    """A misspelt threshold is no number."""
    with pytest.raises(AttributeError, match=r"thresholds\.h defines no RNAK"):
        thresholds.RNAK  # noqa: B018
