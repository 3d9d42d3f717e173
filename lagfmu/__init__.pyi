"""Lagrange's equations with multipliers, from SymPy to FMUs that report the forces of constraint."""

from .api import build_fmu, show
from .errors import LagfmuError, VerificationError
from .mechanics.derive import derive
from .mechanics.equations import EquationsOfMotion
from .mechanics.integrability.classify import classify
from .model.attitude import rotation_matrix
from .model.closed_form import ClosedForm, Conserved, departure, initial, output
from .model.convert import from_lagranges_method
from .model.model import (
    Contact,
    Embedding,
    Friction,
    Holonomic,
    Input,
    Model,
    Nonholonomic,
    Output,
    Parameter,
    Peak,
)
from .model.picture import (
    Arrow,
    Box,
    Direction,
    Disk,
    Frame,
    Ground,
    Line,
    Page,
    Pivot,
    Rod,
    Sphere,
    Spring,
    Track,
)
from .model.reactions import force_of_constraint, multiplier, norm
from .model.scene import Scene
from .model.spline import Spline
from .studio.fit.problem import Experiment
from .studio.fit.result import Fit
from .studio.fit.solve import fit
from .studio.linearize.linearize import linearize
from .studio.linearize.result import Linearization
from .studio.live.play import play
from .studio.report.report import report
from .studio.sensitivity.local import sensitivity
from .studio.sweep.sweep import sweep
from .verification.check import Verification
from .verification.simulate import Result, simulate
from .verification.verify import verify

__all__ = [
    "Arrow",
    "Box",
    "ClosedForm",
    "Conserved",
    "Contact",
    "Direction",
    "Disk",
    "Embedding",
    "EquationsOfMotion",
    "Experiment",
    "Fit",
    "Frame",
    "Friction",
    "Ground",
    "Holonomic",
    "Input",
    "LagfmuError",
    "Line",
    "Linearization",
    "Model",
    "Nonholonomic",
    "Output",
    "Page",
    "Parameter",
    "Peak",
    "Pivot",
    "Result",
    "Rod",
    "Scene",
    "Sphere",
    "Spline",
    "Spring",
    "Track",
    "Verification",
    "VerificationError",
    "build_fmu",
    "classify",
    "departure",
    "derive",
    "fit",
    "force_of_constraint",
    "from_lagranges_method",
    "initial",
    "linearize",
    "multiplier",
    "norm",
    "output",
    "play",
    "report",
    "rotation_matrix",
    "sensitivity",
    "show",
    "simulate",
    "sweep",
    "verify",
]
