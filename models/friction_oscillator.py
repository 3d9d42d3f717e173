"""A mass on a spring that rubs on the floor: Coulomb damping (Rao, Mechanical Vibrations, sect. 2.7).

x [m] from where the spring is slack.  lambda.rest [N] is the friction on the mass.  Each half swing is that
of a free oscillation about x = -/+ d, d = mu g m/k, so that the amplitude loses 2 d; the mass stays where it
comes to rest within |x| <= mu_s m g/k.
"""

from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Friction, Holonomic, Model, Nonholonomic, Parameter, Scene, multiplier

t = dynamicsymbols._t
x, z = dynamicsymbols("x z")
m, k, g = symbols("m k g", positive=True)
mu_s, mu_k = symbols("mu_s mu_k", nonnegative=True)

model = Model(
    name="FrictionOscillator",
    lagrangian=m * (x.diff() ** 2 + z.diff() ** 2) / 2 - k * x**2 / 2 - m * g * z,
    coordinates={x: "m", z: "m"},
    constraints=[
        Holonomic("floor", z, "the mass is led along the floor"),
        Nonholonomic("rest", x.diff(), "the mass rests on the floor"),
        Friction("grip", of=["rest"], normal=multiplier("floor"), static=mu_s, kinetic=mu_k),
    ],
    parameters=[
        Parameter(m, 1.0, "kg", "mass", min=0),
        Parameter(k, 100.0, "N/m", "stiffness of the spring", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(mu_s, 0.3, "1", "coefficient of static friction", min=0),
        Parameter(mu_k, 0.2, "1", "coefficient of kinetic friction", min=0),
    ],
    start={x: 0.2},
    description="Mass on a spring with Coulomb friction",
    descriptions={x: "extension of the spring", z: "height above the floor"},
)

scenes = [Scene("FrictionOscillator", stop_time=3.0, step_size=0.01)]
