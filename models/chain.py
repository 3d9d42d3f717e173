"""Chain of n equal bobs on n massless links, in Cartesian coordinates: family(n) makes it:
`lagfmu build models/chain.py -p n=8` builds Chain8.

x1, y1, ... xn, yn [m] are the bobs, to the right and up from the support; link k holds bob k to bob
k - 1.  With f = |d|^2 - l^2 of a link d, lambda.link1, ... [N/m] are -tension/(2 l), as for the pendulum:
at rest -(n - k + 1) m g/(2 l).  Hanging, its small oscillations have the frequencies sqrt(g z/l) with
the zeros z of the Laguerre polynomial of degree n (Daniel Bernoulli, 1732).
"""

from itertools import pairwise
from math import cos, sin

from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Arrow,
    ClosedForm,
    Conserved,
    Disk,
    Holonomic,
    Model,
    Parameter,
    Rod,
    Scene,
    output,
)

m, g, l = symbols("m g l", positive=True)  # noqa: E741 - the literature's letter
ANGLE = 1.0  # rad from the downward vertical, of all links at the start
LENGTH = 0.25  # m


def bobs(n):
    """(x, y) of the support and of each bob."""
    return [(0, 0), *(tuple(dynamicsymbols(f"x{k} y{k}")) for k in range(1, n + 1))]


def links(n):
    """(dx, dy) of each link, downward."""
    p = bobs(n)
    return [(p[k][0] - p[k - 1][0], p[k][1] - p[k - 1][1]) for k in range(1, n + 1)]


def chain(n):
    """The chain of n links, let go from rest along a straight line at ANGLE."""
    if n < 1:
        raise ValueError(f"a chain of n = {n} links, expected at least 1")
    p = bobs(n)[1:]
    T = sum(m * (x.diff() ** 2 + y.diff() ** 2) / 2 for x, y in p)
    V = sum(m * g * y for _, y in p)
    start = {}
    for k, (x, y) in enumerate(p, 1):
        start |= {x: k * LENGTH * sin(ANGLE), y: -k * LENGTH * cos(ANGLE)}
    return Model(
        name="Chain",
        lagrangian=T - V,
        coordinates={q: "m" for bob in p for q in bob},
        constraints=[
            Holonomic(f"link{k}", dx**2 + dy**2 - l**2, f"link {k} keeps its length")
            for k, (dx, dy) in enumerate(links(n), 1)
        ],
        parameters=[
            Parameter(m, 0.1, "kg", "mass of each bob", min=0),
            Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
            Parameter(l, LENGTH, "m", "length of each link", min=0),
        ],
        start=start,
        description=f"Chain of {n} bobs on massless links",
        descriptions={q: f"bob {k}" for k, bob in enumerate(p, 1) for q in bob},
        picture=[
            *(Rod(p, q) for p, q in pairwise(bobs(n))),
            *(Disk(bob) for bob in p),
            *(Arrow(f"link{k}", at=bob) for k, bob in enumerate(p, 1)),
        ],
    )


def multipliers(n):
    """lambda of every link from the state: the solution of a tridiagonal system, from the lowest up.

    Newton's equations m p_k'' = m (0, -g) + 2 lambda_k d_k - 2 lambda_k+1 d_k+1 in f_k'' = 0 give
        2 l^2 lambda_k = s_k + (d_k . d_k-1) lambda_k-1 + (d_k . d_k+1) lambda_k+1 ,   k = 2 .. n,
    with s_k = -m |d_k'|^2/2, and l^2 lambda_1 = s_1 + m g d_1y/2 + (d_1 . d_2) lambda_2 for the first.
    """
    d = links(n)
    s = [-m * (dx.diff() ** 2 + dy.diff() ** 2) / 2 for dx, dy in d]
    s[0] += m * g * d[0][1] / 2
    joint = [d[k][0] * d[k + 1][0] + d[k][1] * d[k + 1][1] for k in range(n - 1)]
    pivot, right = [2 * l**2] * n, list(s)
    pivot[0] = l**2
    for k in range(n - 2, -1, -1):  # lambda_k+1 is put into the equation of lambda_k
        right[k] += joint[k] * right[k + 1] / pivot[k + 1]
        pivot[k] -= joint[k] ** 2 / pivot[k + 1]
    found = [right[0] / pivot[0]]
    for k in range(1, n):
        found.append((right[k] + joint[k - 1] * found[k - 1]) / pivot[k])
    return found


LINKS = 4


def family(n=LINKS):
    """The chain of n links, its scene and its closed forms."""
    model = chain(n)
    scene = Scene("Chain" if n == LINKS else f"Chain{n}", stop_time=5.0, step_size=0.01)
    closed_forms = [
        *(ClosedForm(f"lambda.link{k}", e) for k, e in enumerate(multipliers(n), 1)),
        *(
            ClosedForm(f"length of link {k} squared", l**2, actual=dx**2 + dy**2)
            for k, (dx, dy) in enumerate(links(n), 1)
        ),
        Conserved("energy", output("energy.total"), scale=n * (n + 1) * m * g * l / 2),
    ]
    return model, [scene], closed_forms


model, scenes, closed_forms = family()
