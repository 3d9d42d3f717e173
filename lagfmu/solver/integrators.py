"""The integrators that can be chosen; an FMU that offers fewer carries a file with those alone.

dopri5 and radau5 are SciPy's (Hairer, Norsett & Wanner I, sect. II.5; Hairer & Wanner II, sect. IV.8).
"""

from typing import Any

from scipy.integrate import RK45, Radau

from .dop853 import Dop853
from .rk4 import RK4

INTEGRATORS: dict[str, Any] = {"dop853": Dop853, "dopri5": RK45, "radau5": Radau, "rk4": RK4}
