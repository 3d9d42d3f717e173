"""What tests need of lagfmu's inside, in one place: a module that moves breaks testing.pyi alone.

What users need is in `lagfmu`.  Each name is imported when it is first asked for: a process that a test
starts needs one or two.
"""

from __future__ import annotations

import ast
import importlib
from pathlib import Path
from typing import Any

PLACES = {
    alias.asname or alias.name: (f"lagfmu.{node.module}", alias.name)
    for node in ast.parse(Path(__file__).with_suffix(".pyi").read_text("utf-8")).body
    if isinstance(node, ast.ImportFrom)
    for alias in node.names
}


def __getattr__(name: str) -> Any:
    if name not in PLACES:
        raise AttributeError(f"lagfmu.testing hands on no {name!r}: see testing.pyi")
    module, own = PLACES[name]
    home = importlib.import_module(module)
    if not hasattr(home, own):
        importlib.import_module(f"{module}.{own}")
    found = globals()[name] = getattr(home, own)
    return found
