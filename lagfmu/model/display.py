"""What notebooks ask a thing for: its mathematics.  lagfmu.page.notebook knows how it is typeset."""

from __future__ import annotations

from importlib import import_module


class Displayed:
    """A mixin for what typesets itself in a notebook."""

    def _repr_html_(self) -> str:
        found: str = import_module("lagfmu.page.notebook").html(self)
        return found

    def _repr_latex_(self) -> str:
        found: str = import_module("lagfmu.page.notebook").latex(self)
        return found
