"""The integrators that can be chosen; an FMU that offers fewer carries a file with those alone.

radau5 is SciPy's (Hairer & Wanner II, sect. IV.8).
"""

from typing import Any

from scipy.integrate import Radau

from .dop853 import Dop853
from .rk4 import RK4

INTEGRATORS: dict[str, Any] = {"dop853": Dop853, "radau5": Radau, "rk4": RK4}
