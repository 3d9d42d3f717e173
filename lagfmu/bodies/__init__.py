"""Bodies and joints: a mechanism as an engineer lists it, and the Model that it is."""

from .body import Body, Ground
from .contacts import Contact
from .joints import Distance, Fixed, Gear, PointOnPlane, Prismatic, Revolute, Rolling
from .loads import Force, Gravity, Motor, SpringDamper, Torque, Torsion
from .mechanism import mechanism
from .urdf import from_urdf

__all__ = [
    "Body",
    "Contact",
    "Distance",
    "Fixed",
    "Force",
    "Gear",
    "Gravity",
    "Ground",
    "Motor",
    "PointOnPlane",
    "Prismatic",
    "Revolute",
    "Rolling",
    "SpringDamper",
    "Torque",
    "Torsion",
    "from_urdf",
    "mechanism",
]
