"""Why a step or a start cannot be done.  The message names the cause; the FMI layer picks the status."""

from __future__ import annotations


class StepFailureError(Exception):
    """A numerical or physical reason for which the solver refuses to go on."""


class StartFailureError(StepFailureError):
    """Start values from which no consistent state can be reached."""
