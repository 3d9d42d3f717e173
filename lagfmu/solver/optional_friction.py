"""What constraints that hold by friction make of the accelerations; not in an FMU without frictions."""

from .friction import motion_with_friction, sticking

__all__ = ["motion_with_friction", "sticking"]
