"""Bodies and joints: a mechanism as an engineer lists it, and the Model that it is.

In: bodies, joints and loads, or a URDF or MJCF file.
Out: a `Model` with a start at which the joints close.
Never knows: the solver and FMI.
"""

from .body import Body, Ground
from .contacts import Contact, PointOnCurve
from .joints import (
    Cylindrical,
    Distance,
    Fixed,
    Gear,
    Planar,
    PointOnPlane,
    Prismatic,
    Revolute,
    Rolling,
    Screw,
    Spherical,
    Universal,
)
from .loads import Force, Gravity, Motor, Rotor, SpringDamper, Torque, Torsion
from .mechanism import mechanism
from .mjcf import from_mjcf
from .series import Series
from .urdf import from_urdf

__all__ = [
    "Body",
    "Contact",
    "Cylindrical",
    "Distance",
    "Fixed",
    "Force",
    "Gear",
    "Gravity",
    "Ground",
    "Motor",
    "Planar",
    "PointOnCurve",
    "PointOnPlane",
    "Prismatic",
    "Revolute",
    "Rolling",
    "Rotor",
    "Screw",
    "Series",
    "Spherical",
    "SpringDamper",
    "Torque",
    "Torsion",
    "Universal",
    "from_mjcf",
    "from_urdf",
    "mechanism",
]
