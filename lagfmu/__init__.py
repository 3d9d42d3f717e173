"""Lagrange's equations with multipliers, from SymPy to FMUs that report the forces of constraint.

The public names are those of __init__.pyi; each is imported when it is first asked for, so that what needs no
SymPy (a worker of a sweep, `lagfmu --version`) does not wait for it.
"""

from typing import Any

import lazy_loader

from .model import display

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def _html(thing: Any) -> str:
    from .page.documentation import html

    return html(thing)


def _latex(thing: Any) -> str:
    from .page.documentation import latex

    return latex(thing)


display.register(html=_html, latex=_latex)
