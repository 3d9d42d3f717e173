"""What the solver does at contacts; an FMU without contacts carries none of it, and this file empty."""

from .contacts import complementary_modes, low
from .impact import check_restitution
from .switch import released, switched

__all__ = ["check_restitution", "complementary_modes", "low", "released", "switched"]
