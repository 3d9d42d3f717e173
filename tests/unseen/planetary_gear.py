"""Planetary gear with its ring held: teeth as constraints on angles, and Willis' equation once more.

sun, planet, carrier, ring [rad]. Teeth do not slip: r_s (sun - carrier) + r_p (planet - carrier) = 0 and
r_r (ring - carrier) - r_p (planet - carrier) = 0, r_r = r_s + 2 r_p; Willis' equation r_s sun + r_r ring
- (r_s + r_r) carrier = 0 follows. Torques: tau on the sun, a load c carrier'. With the ring held and i =
1 + r_r/r_s turns of the sun for one of the carrier, carrier'' (J_c + J_s i^2 + J_p k^2) = i tau - c
carrier', k = (r_r - r_p)/r_p turns of the planet, backwards.
"""

from sympy import exp, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import ClosedForm, Holonomic, Input, Model, Parameter, Scene, initial

t = dynamicsymbols._t
sun, planet, carrier, ring, tau = dynamicsymbols("sun planet carrier ring tau")
Js, Jp, Jc, Jr, rs, rp = symbols("J_s J_p J_c J_r r_s r_p", positive=True)
c = symbols("c", nonnegative=True)

rr = rs + 2 * rp

model = Model(
    name="PlanetaryGear",
    lagrangian=(
        Js * sun.diff() ** 2
        + Jp * planet.diff() ** 2
        + Jc * carrier.diff() ** 2
        + Jr * ring.diff() ** 2
    )
    / 2,
    forces={sun: tau, carrier: -c * carrier.diff()},
    coordinates=dict.fromkeys((sun, planet, carrier, ring), "rad"),
    constraints=[
        Holonomic("inner", rs * (sun - carrier) + rp * (planet - carrier), "sun on planet"),
        Holonomic("outer", rr * (ring - carrier) - rp * (planet - carrier), "planet in ring"),
        Holonomic("willis", rs * sun + rr * ring - (rs + rr) * carrier, "Willis' equation"),
        Holonomic("brake", ring, "the ring is held"),
    ],
    parameters=[
        Parameter(Js, 2e-4, "kg.m^2", "moment of inertia of the sun", min=0),
        Parameter(Jp, 1e-4, "kg.m^2", "moment of inertia of the planets about their axes", min=0),
        Parameter(Jc, 3e-3, "kg.m^2", "moment of inertia of the carrier with the planets", min=0),
        Parameter(Jr, 5e-3, "kg.m^2", "moment of inertia of the ring", min=0),
        Parameter(rs, 0.02, "m", "radius of the sun", min=0),
        Parameter(rp, 0.015, "m", "radius of a planet", min=0),
        Parameter(c, 0.02, "N.m.s/rad", "load on the carrier", min=0),
    ],
    inputs=[Input(tau, "N.m", 0.5, "torque on the sun")],
    start={sun: 0.0, planet: 0.0, carrier: 0.0, ring: 0.0},
    description="Planetary gear with its ring held",
)

scenes = [Scene("PlanetaryGear", stop_time=1.0, step_size=0.01)]

i, k = 1 + rr / rs, (rr - rp) / rp
J = Jc + Js * i**2 + Jp * k**2
final = i * tau / c
closed_forms = [
    ClosedForm(
        "der(carrier,2)",
        (i * tau - c * carrier.diff()) / J,
        scale=(i * tau + c * carrier.diff()) / J,
    ),
    ClosedForm(
        "der(carrier)",
        final + (initial(carrier.diff()) - final) * exp(-c / J * t),
        when=c,
    ),
    ClosedForm("Q.sun", Js * sun.diff(t, 2) - tau, scale=tau),
]
