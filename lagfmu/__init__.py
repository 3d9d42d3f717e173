"""Lagrange's equations with multipliers, from SymPy to FMUs that report the forces of constraint.

The public names are those of __init__.pyi; each is imported when it is first asked for, so that what needs no
SymPy (a worker of a sweep, `lagfmu --version`) does not wait for it.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
