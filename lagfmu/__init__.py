"""Lagrange's equations with multipliers, from SymPy to FMUs that report the forces of constraint."""

from .closed_form import ClosedForm, Conserved, departure, initial, output
from .constraints import classify
from .convert import from_lagranges_method
from .equations import EquationsOfMotion, derive
from .errors import LagfmuError
from .make import build_fmu
from .model import Contact, Embedding, Holonomic, Input, Model, Nonholonomic, Output, Parameter
from .reactions import force_of_constraint, multiplier
from .scene import Scene
from .simulate import simulate
from .verify import Verification, verify

__all__ = [
    "ClosedForm",
    "Conserved",
    "Contact",
    "Embedding",
    "EquationsOfMotion",
    "Holonomic",
    "Input",
    "LagfmuError",
    "Model",
    "Nonholonomic",
    "Output",
    "Parameter",
    "Scene",
    "Verification",
    "build_fmu",
    "classify",
    "departure",
    "derive",
    "force_of_constraint",
    "from_lagranges_method",
    "initial",
    "multiplier",
    "output",
    "simulate",
    "verify",
]
