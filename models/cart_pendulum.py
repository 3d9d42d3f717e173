"""Pendulum on a cart, with kinetic energy and forces (ME 6590, eq. 2) in place of a Lagrangian.

s [m] is the cart (the pivot) and x [m] the bob, both to the right from a fixed point; y [m] is the
bob's height above the pivot, negative while it hangs.  The input F [N] pushes the cart, viscous
friction c brakes it.  With f = (x - s)^2 + y^2 - L^2 the rod's force on the bob is
2 lambda (x - s, y), so that lambda = -tension/(2 L) [N/m]; the cart feels its reaction, Q.s.
"""

from sympy import sqrt, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Arrow,
    ClosedForm,
    Conserved,
    Disk,
    Ground,
    Holonomic,
    Input,
    Line,
    Model,
    Output,
    Parameter,
    Rod,
    Scene,
    multiplier,
    output,
)

t = dynamicsymbols._t
s, x, y, F = dynamicsymbols("s x y F")
M, m, g, L = symbols("M m g L", positive=True)
c = symbols("c", nonnegative=True)

CART = 0.15  # m, height of the drawn cart

model = Model(
    name="CartPendulum",
    kinetic_energy=M * s.diff() ** 2 / 2 + m * (x.diff() ** 2 + y.diff() ** 2) / 2,
    forces={s: F - c * s.diff(), y: -m * g},
    coordinates={s: "m", x: "m", y: "m"},
    constraints=[Holonomic("rod", (x - s) ** 2 + y**2 - L**2, "the rod keeps its length")],
    parameters=[
        Parameter(M, 2.0, "kg", "mass of the cart", min=0),
        Parameter(m, 1.0, "kg", "mass of the bob", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(L, 1.0, "m", "length of the rod", min=0),
        Parameter(c, 0.1, "N.s/m", "viscous friction of the cart", min=0),
    ],
    inputs=[Input(F, "N", 0.0, "force on the cart, to the right")],
    start={s: 0.0, x: 0.8414709848078965, y: -0.5403023058681398},  # sin(1), -cos(1)
    description="Pendulum on a cart with viscous friction and a driving force",
    descriptions={
        s: "cart, to the right",
        x: "bob, to the right",
        y: "bob, above the pivot",
    },
    outputs=[
        Output("tension", -2 * L * multiplier("rod"), "N", "pull of the rod on the bob"),
        Output("drive.power", F * s.diff(), "W", "power of the driving force"),
    ],
    picture=[
        Ground((-3 * L, -CART), (3 * L, -CART)),
        Line(
            (s - 2 * CART, -CART),
            (s + 2 * CART, -CART),
            (s + 2 * CART, 0),
            (s - 2 * CART, 0),
            (s - 2 * CART, -CART),
        ),
        Rod((s, 0), (x, y)),
        Disk((x, y), trace=True),
        Arrow("rod", at=(x, y)),
    ],
)

scenes = [Scene("CartPendulum", stop_time=10.0, step_size=0.01)]

# With d = x - s the equations of motion are
#     M s'' = F - c s' - 2 d lambda ,   m x'' = 2 d lambda ,   m y'' = -m g + 2 y lambda ,
# and f'' = 0 reads  d (x'' - s'') + y y'' + d'^2 + y'^2 = 0.  Solved for lambda:
d = x - s
square = d.diff() ** 2 + y.diff() ** 2
drive = F - c * s.diff()
push = m * (M * g * y + drive * d - M * square) / (2 * (M * L**2 + m * d**2))  # lambda.rod

# The rod does no work: the driving force feeds the energy and the friction.
power = M * s.diff() * s.diff(t, 2) + m * (x.diff() * x.diff(t, 2) + y.diff() * y.diff(t, 2))
power += m * g * y.diff() + c * s.diff() ** 2

# The first two add up to  d/dt (M s' + m x' + c s) = F.
momentum = M * s.diff() + m * x.diff() + c * s - F * t

closed_forms = [
    ClosedForm("lambda.rod", push),
    ClosedForm("tension", -2 * L * push),
    ClosedForm("drive.power", power, scale=output("energy.kinetic") * sqrt(g / L)),
    ClosedForm("der(s,2)", (drive - 2 * d * push) / M),
    ClosedForm("Q.s", -output("Q.x")),
    # while F is held constant:
    Conserved("momentum and friction's impulse", momentum, scale=m * sqrt(g * L)),
]
