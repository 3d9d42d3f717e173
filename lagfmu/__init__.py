"""Lagrange's equations with multipliers, from SymPy to FMUs that report the forces of constraint."""

from .equations import EquationsOfMotion, derive
from .model import Contact, Embedding, Holonomic, Input, Model, Nonholonomic, Parameter
