"""What the solver does at contacts; an FMU without contacts carries none of it, and this file empty."""

from .contacts import complementary_modes
from .events import first_event
from .switch import released, switched

__all__ = ["complementary_modes", "first_event", "released", "switched"]
