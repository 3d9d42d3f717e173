"""What pythonfmu 0.7.0's binary releases once too often.

* Each fmi2Instantiate releases the dictionary of the slave's module (it only borrowed it), so that the
  process crashes at about the fifth instance.
* Each exception that it reports releases the instance, its class and its log once too often, so that the
  process crashes at a later call.
* The exit of the process on Linux releases its Python state twice, first as a static object, then in the
  library's destructor, which writes into freed memory: now and then glibc aborts ("corrupted
  double-linked list").

Adding what is dropped keeps the process alive; if a later pythonfmu drops nothing, a few bytes leak.
The Python state is released before both, by the binary's own function, which leaves them nothing.
"""

from __future__ import annotations

import ctypes
import os
import sys
from pathlib import Path
from typing import Any

ENDING: set[int] = set()  # handles of the libraries whose end is arranged


def keep(*objects: Any) -> None:
    """One more reference for each object, never to be released by Python itself."""
    for kept in objects:
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(kept))


def keep_module_of(instance: Any) -> None:
    """One more reference for the namespace of the module that defines the instance's class."""
    keep(vars(sys.modules[type(instance).__module__]))


def end_once(instance: Any) -> None:
    """Release the Python state of the instance's library as the first thing that exit() does."""
    if sys.platform != "linux" or not instance.resources:
        return
    binaries = Path(instance.resources).parent / "binaries" / "linux64"
    try:  # only the library that is loaded already; its handle is never closed, so it stays
        library = ctypes.CDLL(str(binaries / f"{type(instance).__name__}.so"), os.RTLD_NOLOAD)
        end = library.finalizePythonInterpreter
    except (AttributeError, OSError):  # being built, loaded from elsewhere, or a later pythonfmu
        return
    if library._handle not in ENDING:
        ENDING.add(library._handle)
        # C, not Python's atexit: it must also be right where the library itself started Python, and
        # handlers run last in, first out, so this one comes before those of the library.
        ctypes.CDLL(None).__cxa_atexit(end, None, None)
