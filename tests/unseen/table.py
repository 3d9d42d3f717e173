"""Table on four legs that falls on a plane floor, one pair of legs first.

z [m] the middle of the top, a, b [rad] its turns about x, then about y; the legs stand at (+-l, +-w), h
below. Four pushes hold three coordinates: once all stand, no lambda is unique, while Q is: sum of the
pushes = Q.z = m (z'' + g).
"""

from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import ClosedForm, Contact, Model, Parameter, Scene, output

t = dynamicsymbols._t
z, a, b = dynamicsymbols("z a b")
m, A, B, g, l, w, h = symbols("m A B g l w h", positive=True)  # noqa: E741 - the literature's letter
e = symbols("e", nonnegative=True)

corners = {"se": (1, -1), "ne": (1, 1), "nw": (-1, 1), "sw": (-1, -1)}


def foot(along, across):
    """Height of a leg's foot."""
    return z + sin(a) * (w * across) - cos(a) * (sin(b) * (l * along) + cos(b) * h)


model = Model(
    name="Table",
    lagrangian=m * z.diff() ** 2 / 2
    + (A * a.diff() ** 2 * cos(b) ** 2 + B * b.diff() ** 2 + (A + B) * a.diff() ** 2 * sin(b) ** 2) / 2
    - m * g * z,
    coordinates={z: "m", a: "rad", b: "rad"},
    constraints=[
        Contact(name, foot(*at), f"the {name} leg stands", restitution=e)
        for name, at in corners.items()
    ],
    parameters=[
        Parameter(m, 15.0, "kg", "mass", min=0),
        Parameter(A, 1.5, "kg.m^2", "moment of inertia about x", min=0),
        Parameter(B, 2.5, "kg.m^2", "moment of inertia about y", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(l, 0.7, "m", "half of the length between the legs", min=0),
        Parameter(w, 0.4, "m", "half of the width between the legs", min=0),
        Parameter(h, 0.72, "m", "height of the legs", min=0),
        Parameter(e, 0.3, "1", "coefficient of restitution", min=0, max=1),
    ],
    start={z: 0.78, a: 0.0, b: 0.05},
    description="Table that falls on its four legs",
)  # fmt: skip

scenes = [Scene("Table", stop_time=1.2, step_size=0.005)]

pushes = sum(output(f"lambda.{name}") for name in corners)
closed_forms = [ClosedForm("weight", m * (z.diff(t, 2) + g), actual=pushes, scale=m * g + pushes)]
