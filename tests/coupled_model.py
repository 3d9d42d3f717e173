"""An absorber on the cart of CartPendulum, as an FMU of its own.

The absorber is a mass n that a spring k and a damper d tie to a point p; p is moved as the input u says.
The multiplier of the tie u - p = 0 is the force that the absorber exerts on what moves it,

    lambda.tie = k (z - p) + d (z' - p') ,

and so lambda.tie drives F of CartPendulum, whose s, s' and s'' are the absorber's u, u' and u''.
"""

from __future__ import annotations

from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Holonomic, Input, Model, Parameter

z, p, u = dynamicsymbols("z p u")
n, k, d = symbols("n k d", positive=True)

absorber = Model(
    name="Absorber",
    lagrangian=n * z.diff() ** 2 / 2 - k * (z - p) ** 2 / 2,
    forces={z: -d * (z.diff() - p.diff()), p: d * (z.diff() - p.diff())},
    coordinates={z: "m", p: "m"},
    constraints=[Holonomic("tie", u - p, "the absorber's point is where it is moved to")],
    parameters=[
        Parameter(n, 0.5, "kg", "mass of the absorber", min=0),
        Parameter(k, 20.0, "N/m", "stiffness of its spring", min=0),
        Parameter(d, 0.5, "N.s/m", "viscosity of its damper", min=0),
    ],
    inputs=[Input(u, "m", 0.0, "where the absorber's point is moved to")],
    start={z: 0.3},
)
