"""References that pythonfmu 0.7.0's binary drops although it does not own them.

* Each fmi2Instantiate releases the dictionary of the slave's module (it only borrowed it), so that the
  process crashes at about the fifth instance.
* Each exception that it reports releases the instance, its class and its log once too often, so that the
  process crashes at a later call.

Adding what is dropped keeps the process alive; if a later pythonfmu drops nothing, a few bytes leak.
"""

from __future__ import annotations

import ctypes
import sys
from typing import Any


def keep(*objects: Any) -> None:
    """One more reference for each object, never to be released by Python itself."""
    for kept in objects:
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(kept))


def keep_module_of(instance: Any) -> None:
    """One more reference for the namespace of the module that defines the instance's class."""
    keep(vars(sys.modules[type(instance).__module__]))
