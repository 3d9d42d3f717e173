"""The classifier of Pfaffian constraints, against mathematical facts that are known by hand."""

import itertools
import random

import pytest
from sympy import (
    Abs,
    Function,
    Matrix,
    cos,
    exp,
    log,
    pi,
    polylog,
    simplify,
    sin,
    sqrt,
    symbols,
    zeta,
)
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import classify
from lagfmu.errors import DerivationError
from lagfmu.testing import Kind, pfaffian

x, y, z, s, phi, theta, psi = dynamicsymbols("x y z s phi theta psi")
t = dynamicsymbols._t
R, omega, v0, alpha, l = symbols("R omega v_0 alpha l")  # noqa: E741
h, g = Function("h"), Function("g")


def d(f):
    return f.diff(t)


def check(answer, kind, rank, depth, found=None):
    """The kind and ranks; each integral satisfies its identity; the witness fits the kind."""
    assert answer.kind is kind, answer.certificate
    assert (answer.rank, answer.holonomic_rank) == (rank, depth)
    assert len(answer.integrals) == (depth if found is None else found)
    for integral in answer.integrals:
        pairs = zip(integral.factors, answer.forms, strict=True)
        assert simplify(d(integral.f) - sum(mu * form for mu, form in pairs)) == 0
    if kind in (Kind.HOLONOMIC, Kind.INTEGRABLE):
        assert answer.witness == 0
    else:
        assert simplify(answer.witness) != 0
    return answer


# --- one form ------------------------------------------------------------------------------

HOLONOMIC = {
    "rolling on a line": (d(x) - R * d(theta), [x, theta]),
    "1/x": (d(x) / x + d(y), [x, y]),
    "in the rotating frame": (
        d(y) * cos(omega * t)
        - d(x) * sin(omega * t)
        - omega * (x * cos(omega * t) + y * sin(omega * t)),
        [x, y],
    ),
    "rolling without slipping": (d(y) - R * d(theta), [y, theta]),
    "circle": (x * d(x) + y * d(y), [x, y]),
    "moving wall": (d(x) - v0, [x]),
    "driven angle": (d(phi) - omega, [phi]),
    "driven with cos": (d(x) - alpha * omega * cos(omega * t), [x]),
    "growing circle": (x * d(x) + y * d(y) - sin(omega * t), [x, y]),
    "xyz": (y * z * d(x) + x * z * d(y) + x * y * d(z), [x, y, z]),
    "root": ((x * d(x) + y * d(y)) / sqrt(x**2 + y**2) + d(z), [x, y, z]),
    "half angles": (sin(phi / 2) * cos(phi / 2) * d(x) - sin(phi) * d(x) / 2 + d(y), [x, y, phi]),
    "polar angle": ((x * d(y) - y * d(x)) / (x**2 + y**2) - d(theta), [x, y, theta]),
}

INTEGRABLE = {
    "homogeneous, sin(y/x)": ((y + x * sin(y / x)) * d(x) - x * d(y), [x, y]),
    "homogeneous, exp(y/x)": ((y + x * exp(y / x)) * d(x) - x * d(y), [x, y]),
    "homogeneous, spiral": ((x + y) * d(x) - (x - y) * d(y), [x, y]),
    "angle": (y * d(x) - x * d(y) + (x**2 + y**2) * d(theta), [x, y, theta]),
    "bead on a rod": (d(x) - x * omega, [x]),
    "relaxation to a speed": (d(x) + alpha * x - v0, [x]),
    "driven relaxation": (d(x) + alpha * x - v0 * sin(omega * t), [x]),
    "logistic growth": (d(x) - alpha * x * (1 - x / l), [x]),
    "Torricelli": (d(x) + alpha * sqrt(x), [x]),
    "sin(phi) factor": (sin(phi) * (d(x) - R * d(theta)), [x, theta, phi]),
    "yz dx + 2xz dy + 3xy dz": (
        y * z * d(x) + 2 * x * z * d(y) + 3 * x * y * d(z),
        [x, y, z],
    ),
    "yz dx + (xz - yz^3) dy - 2xy dz": (
        y * z * d(x) + (x * z - y * z**3) * d(y) - 2 * x * y * d(z),
        [x, y, z],
    ),
    "spheres": ((y**2 + z**2 - x**2) * d(x) - 2 * x * y * d(y) - 2 * x * z * d(z), [x, y, z]),
    "y dx - x dy": (y * d(x) - x * d(y), [x, y]),
    "exponential growth": (d(x) - omega * x, [x]),
    "nowhere-zero factor": (exp(x) * (d(x) + d(y)), [x, y]),
    "2yz dx + xz dy + xy dz": (2 * y * z * d(x) + x * z * d(y) + x * y * d(z), [x, y, z]),
    "(x + y)/z": (z * d(x) + z * d(y) - (x + y) * d(z), [x, y, z]),
    "Natani": (
        (y**2 + y * z) * d(x) + (x * z + z**2) * d(y) + (y**2 - x * y) * d(z),
        [x, y, z],
    ),
    "Bernoulli": (d(y) + y * d(x) - x * y**3 * d(x), [x, y]),
    "homogeneous": ((x**2 + y**2) * d(x) - 2 * x * y * d(y), [x, y]),
    "steering to a moving point": (d(y) * (x - omega * t) - y * (d(x) - omega), [x, y]),
    "rotating line": (x * d(y) - y * d(x) - omega * (x**2 + y**2), [x, y]),
    "a factor of another variable": (
        cos(s) * (x * d(y) - y * d(x) + x**2 * d(z)) / x**2,
        [x, y, z, s],
    ),
}

WITHOUT_CLOSED_FORM = {
    "unknown input": (d(x) - h(t) * x, [x], Kind.INTEGRABLE),
    "linear with an unknown function": (d(y) + h(x) * y * d(x), [x, y], Kind.INTEGRABLE),
    "error function": (d(y) + 2 * t * y - 1, [y], Kind.INTEGRABLE),
    "Riccati": (d(y) - (x**2 + y**2) * d(x), [x, y], Kind.INTEGRABLE),
    "unknown functions": (h(x) * d(x) + g(y) * d(y), [x, y], Kind.HOLONOMIC),
    "exp(-x^2) sin(x^3)": (exp(-(x**2)) * sin(x**3) * d(x) + d(y), [x, y], Kind.HOLONOMIC),
}

NONHOLONOMIC = {
    "rotating line": (sin(omega * t) * d(x) - cos(omega * t) * d(y), [x, y]),
    "Chaplygin sleigh": (sin(phi) * d(x) - cos(phi) * d(y) - alpha * d(phi), [x, y, phi]),
    "knife edge": (sin(phi) * d(x) - cos(phi) * d(y), [x, y, phi]),
    "Chaplygin sleigh, moving": (
        sin(phi) * d(x) - cos(phi) * d(y) - alpha * exp(t) * d(phi),
        [x, y, phi],
    ),
    "contact form": (d(z) - y * d(x), [x, y, z]),
    "contact form of 5 variables": (d(z) - x * d(y) - psi * d(phi), [x, y, z, phi, psi]),
    "pursuit": (d(y) * (v0 * t - x) + y * d(x), [x, y]),
    "rheonomic": (d(phi) - omega * cos(omega * t) * x, [x, phi]),
    "unknown function": (d(x) - h(y) * z * d(y), [x, y, z]),
}


@pytest.mark.parametrize("name", HOLONOMIC)
def test_holonomic(name):
    """d(omega) = 0: the form is df/dt as it stands, and the factor is 1."""
    answer = check(classify(*HOLONOMIC[name]), Kind.HOLONOMIC, 1, 1)
    assert simplify(answer.integrals[0].factors[0] - 1) == 0


@pytest.mark.parametrize("name", INTEGRABLE)
def test_integrating_factor(name):
    """d(omega) wedge omega = 0 but d(omega) is not: an integrating factor is needed."""
    check(classify(*INTEGRABLE[name]), Kind.INTEGRABLE, 1, 1)


@pytest.mark.parametrize("name", NONHOLONOMIC)
def test_nonholonomic(name):
    """d(omega) wedge omega has a coefficient that is not zero."""
    check(classify(*NONHOLONOMIC[name]), Kind.NONHOLONOMIC, 1, 0)


def test_knife_edge_witness():
    """For sin(phi) dx - cos(phi) dy, omega wedge d(omega) is dx dy dphi up to sign."""
    assert abs(classify(*NONHOLONOMIC["knife edge"]).witness) == 1


def test_exponential_growth():
    """x' = omega x has the integral x exp(-omega t)."""
    (integral,) = classify(*INTEGRABLE["exponential growth"]).integrals
    assert integral.f == x * exp(-omega * t)


@pytest.mark.parametrize("name", WITHOUT_CLOSED_FORM)
def test_integrable_but_not_in_closed_form(name):
    """Any form in two variables is integrable; its integral need not be an elementary function, nor that of
    an exact one."""
    form, names, kind = WITHOUT_CLOSED_FORM[name]
    answer = check(classify(form, names), kind, 1, 1, found=0)
    assert "no closed form found for 1 of 1 integrals" in answer.certificate


# --- sets ----------------------------------------------------------------------------------


COIN = [d(x) - R * cos(phi) * d(theta), d(y) - R * sin(phi) * d(theta)]
KNIFE = sin(phi) * d(x) - cos(phi) * d(y)
CONTACT = d(s) - z * d(phi)
HIDDEN = d(s) - z * d(y)
HOLDS, FACTOR, FREE, PARTLY = Kind.HOLONOMIC, Kind.INTEGRABLE, Kind.NONHOLONOMIC, Kind.PARTLY
# forms, coordinates; kind, rank and holonomic rank of all together; the kind of each alone
SETS = {
    "the rolling disk": (COIN, [x, y, theta, phi], FREE, 2, 0, [FREE, FREE]),
    "Engel's normal form": (
        [d(y) - z * d(x), d(z) - psi * d(x)],
        [x, y, z, psi],
        *(FREE, 2, 0, [FREE, FREE]),
    ),
    "a disk on a line beside a knife edge": (
        [d(z) - R * cos(alpha) * d(theta), d(s) - R * sin(alpha) * d(theta), KNIFE],
        [x, y, theta, z, s, phi],
        *(PARTLY, 3, 2, [HOLDS, HOLDS, FREE]),
    ),
    "d(xy) and dz, mixed by a function": (
        [d(x * y) + psi * d(z), d(z) - psi * d(x * y)],
        [x, y, z, psi],
        *(FACTOR, 2, 2, [FREE, FREE]),
    ),
    "dx and dy, turned by an angle": (
        [cos(psi) * d(x) + sin(psi) * d(y), -sin(psi) * d(x) + cos(psi) * d(y)],
        [x, y, psi],
        *(FACTOR, 2, 2, [FREE, FREE]),
    ),
    "an exact form hidden behind a knife edge": (
        [KNIFE, d(z) - R * d(psi) + KNIFE],
        [x, y, z, phi, psi],
        *(PARTLY, 2, 1, [FREE, FREE]),
    ),
    "x omega_1 + omega_2 = d(xy)": (
        [CONTACT, d(x * y) - x * CONTACT],
        [x, y, z, s, phi],
        *(PARTLY, 2, 1, [FREE, FREE]),
    ),
    "d(x y exp(z)) mixed into both, which no ansatz finds": (
        [
            sin(x) * HIDDEN + (2 + cos(y)) * exp(z) * d(x * y * exp(z)),
            cos(x) * HIDDEN + x * d(x * y * exp(z)),
        ],
        [x, y, z, s],
        *(PARTLY, 2, 1, [FREE, FREE]),
    ),
    "two driven wheels: l phi - R (theta - psi) is constant": (
        [
            d(x) - cos(phi) * R / 2 * (d(theta) + d(psi)),
            d(y) - sin(phi) * R / 2 * (d(theta) + d(psi)),
            d(phi) - R / l * (d(theta) - d(psi)),
        ],
        [x, y, phi, theta, psi],
        *(PARTLY, 3, 1, [FREE, FREE, HOLDS]),
    ),
    "one form twice": (
        [d(x) - d(y), 2 * d(x) - 2 * d(y)],
        [x, y],
        *(HOLDS, 1, 1, [HOLDS, HOLDS]),
    ),
    "exact forms": ([d(x) - d(y), x * d(x) + d(z)], [x, y, z], HOLDS, 2, 2, [HOLDS, HOLDS]),
}
FLAGS = {
    "the rolling disk": (2, 1, 0),  # Bryant et al., Engel's normal form
    "Engel's normal form": (2, 1, 0),
    "two driven wheels: l phi - R (theta - psi) is constant": (3, 2, 1),
}


@pytest.mark.parametrize("name", SETS)
def test_a_set_is_more_than_its_forms(name):
    """Forms of which none is integrable may be so together, or some combination of them; the derived flag
    ends at the number of integrals."""
    forms, coordinates, kind, rank, depth, each = SETS[name]
    answer = check(classify(forms, coordinates), kind, rank, depth)
    assert [c.kind for c in answer.each] == each
    assert answer.flag == FLAGS.get(name, answer.flag)


def test_integrable_only_together():
    """dz - y dx is a contact form; with dy = 0, z - x y is constant, too (which is not looked for)."""
    answer = check(classify([d(z) - y * d(x), d(y)], [x, y, z]), FACTOR, 2, 2, found=1)
    assert [c.kind for c in answer.each] == [FREE, HOLDS]


LINEAR = {
    "rotation": ([d(x) + omega * y, d(y) - omega * x], [x, y]),
    "damped": ([d(x) - y, d(y) + 2 * x + 3 * y], [x, y]),
    "aperiodic limit": ([d(x) - y, d(y) + x + 2 * y], [x, y]),
    "oscillator": ([d(x) - y, d(y) + alpha * x], [x, y]),
    "circle with drift": ([d(x) + omega * y - v0, d(y) - omega * x], [x, y]),
    "forced": ([d(x) - y, d(y) + x - sin(omega * t)], [x, y]),
    "integrators": ([d(x) - y, d(y) - z, d(z)], [x, y, z]),
    "third order": ([d(x) - y, d(y) - z, d(z) + x], [x, y, z]),
    "turned by an angle": ([d(x) - y * d(theta), d(y) + x * d(theta)], [x, y, theta]),
    "driven by a place": ([d(z) - y * d(x), d(y) - z * d(x)], [x, y, z]),
    "two of them, and an exact form": (
        [
            d(x) - y * d(theta),
            d(y) + x * d(theta),
            d(z) - s * d(psi),
            d(s) - z * d(psi),
            d(phi) - R * d(psi),
        ],
        [x, y, z, s, theta, phi, psi],
    ),
}


@pytest.mark.parametrize("name", LINEAR)
def test_linear_system(name):
    """x' = A x + c(t) has the n integrals exp(-A t) x - int exp(-A t) c dt, which are not looked for; any
    coordinate may be what time is there."""
    forms, names = LINEAR[name]
    answer = classify(forms, names)
    check(answer, Kind.INTEGRABLE, len(forms), len(forms), found=len(answer.integrals))


def test_disk_with_a_given_heading():
    """The rolling disk: phi' = 0 makes it integrable, as do a steady turn, and an arc; of a set, integrals of
    the reduced rows one by one are looked for."""
    names = [x, y, theta, phi]
    check(classify([*COIN, d(phi)], names), Kind.INTEGRABLE, 3, 3, found=1)
    check(classify([*COIN, d(phi) - alpha * d(theta)], names), Kind.INTEGRABLE, 3, 3)
    check(classify([*COIN, d(phi) - omega, d(theta) - v0], names), Kind.INTEGRABLE, 4, 4, found=2)
    answer = check(classify([*COIN, d(phi) - omega], names), Kind.PARTLY, 3, 1)
    assert answer.integrals[0].f == phi - omega * t


# --- on the surfaces of holonomic constraints ------------------------------------------------


@pytest.mark.parametrize("held", [phi, phi - alpha, 2 * phi - alpha])
def test_a_coin_whose_heading_is_held_rolls_along_a_line(held):
    """With phi held, x = R theta cos(phi): two integrals, where the free coin has none."""
    free = classify(COIN, [x, y, phi, theta])
    assert (free.kind, free.holonomic_rank) == (Kind.NONHOLONOMIC, 0)
    answer = classify(COIN, [x, y, phi, theta], holonomic=[held])
    assert (answer.kind, answer.rank, answer.holonomic_rank) == (Kind.HOLONOMIC, 2, 2)
    assert len(answer.integrals) == 2


def test_a_coin_that_is_turned_at_a_given_rate_is_nonholonomic():
    """phi = omega t takes one coordinate, not the constraint's nature: theta may be anything."""
    answer = classify(COIN, [x, y, phi, theta], holonomic=[phi - omega * t])
    assert (answer.kind, answer.holonomic_rank) == (Kind.NONHOLONOMIC, 0)


def test_a_cylinder_that_rolls_in_a_cylinder_has_one_degree_of_freedom():
    """Its centre on a circle, x^2 + y^2 = R^2: x dy - y dx is R^2 times an angle's differential, there."""
    rolling = x * d(y) - y * d(x) + R**2 * d(theta)
    assert classify(rolling, [x, y, theta]).kind is Kind.NONHOLONOMIC
    answer = classify(rolling, [x, y, theta], holonomic=[x**2 + y**2 - R**2])
    assert (answer.kind, answer.rank, answer.holonomic_rank) == (Kind.INTEGRABLE, 1, 1)
    polar = classify(
        (R - 1) * d(phi) + d(theta), [x, y, phi, theta], holonomic=[x - sin(phi), y - cos(phi)]
    )
    assert polar.kind is Kind.HOLONOMIC


def test_a_form_that_the_surface_implies_constrains_nothing():
    """x dx + y dy = 0 on every circle, dz - y dx = 0 where z and y are held at 0."""
    circle = classify(x * d(x) + y * d(y), [x, y], holonomic=[x**2 + y**2 - 1])
    corner = classify(d(z) - y * d(x), [x, y, z], holonomic=[z, y])
    assert circle.rank == corner.rank == 0
    assert "constrains nothing" in circle.certificate


def test_a_surface_beside_does_not_make_a_knife_edge_integrable():
    """A bead elsewhere on a circle has nothing to do with the knife edge: it stays nonholonomic."""
    answer = classify(
        sin(phi) * d(x) - cos(phi) * d(y), [x, y, phi, z, s], holonomic=[z**2 + s**2 - 1]
    )
    assert (answer.kind, answer.rank, answer.holonomic_rank) == (Kind.NONHOLONOMIC, 1, 0)
    assert answer.witness != 0


# --- limits --------------------------------------------------------------------------------


def test_undecided():
    """Euler's reflection of the dilogarithm is 0, which SymPy does not know: no guess."""
    zero = polylog(2, x) + polylog(2, 1 - x) + log(x) * log(1 - x) - pi**2 / 6
    answer = classify(d(z) + zeta(3) * zero * y * d(x), [x, y, z])
    assert answer.kind is Kind.UNDECIDED
    assert answer.holonomic_rank is None
    assert answer.witness != 0


def test_undecided_in_regions():
    """|y| - y is zero on one side of y = 0 only."""
    answer = classify((Abs(y) - y) * x * d(y) + d(x) + z * d(z), [x, y, z])
    assert answer.kind is Kind.UNDECIDED


def test_what_would_take_minutes_is_undecided():
    """A GCD of polynomials of degree 6 in 9 variables makes integers of 7^9 digits: no guess, and no wait."""
    parameters = symbols("c:6")
    total = x + y + z + sum(parameters)
    forms = [total**6 / (total + 3) ** 6 * d(x) + (total - 1) ** 6 * d(y), d(z) - y * d(x)]
    answer = classify(forms, [x, y, z])
    assert answer.kind is Kind.UNDECIDED
    assert "a long expression" in answer.certificate
    assert "too large to decide" in answer.certificate


def test_nonlinear_in_velocities():
    """An isokinetic constraint is not Pfaffian; the message names the term."""
    with pytest.raises(DerivationError, match=r"Derivative\(x\(t\), t\)\*\*2"):
        pfaffian(d(x) ** 2 + d(y) - v0, [x, y])
    with pytest.raises(DerivationError, match="accelerations"):
        pfaffian(x.diff(t, 2) + d(y), [x, y])
    assert pfaffian((d(x) + 1) ** 2 - d(x) ** 2 + y, [x, y]) == ([2, 0], y + 1)


def test_contradictory():
    """x' = 1 and x' = 2 leave no motion; a form without velocities is no Pfaffian form."""
    with pytest.raises(DerivationError, match="contradictory"):
        classify([d(x) - 1, d(x) - 2], [x])
    with pytest.raises(DerivationError, match="no velocity"):
        classify(x**2 + y**2 - l**2, [x, y])


@pytest.mark.parametrize(
    ("form", "f"),
    [
        (cos(t) * d(x) + x * cos(t) * d(y) - x * sin(t), x * exp(y) * cos(t)),
        (exp(x * z) * d(x * exp(y) + z * sin(x)), x * exp(y) + z * sin(x)),
    ],
)
def test_integrals_are_written_plainly(form, f):
    """Without factors that cancel, which would leave 0/0 where they vanish."""
    (integral,) = classify(form, [x, y, z]).integrals
    assert integral.f.count_ops() <= f.expand().count_ops()
    assert simplify(integral.f / f).is_number


# --- properties ----------------------------------------------------------------------------


def polynomial(chance, names):
    terms = [*names, *(a * b for a, b in itertools.combinations_with_replacement(names, 2))]
    return sum(chance.randint(-3, 3) * term for term in terms) + 4 * names[0]


@pytest.mark.parametrize(
    "seed", [0, 3, *(pytest.param(k, marks=pytest.mark.thorough) for k in (1, 2, 4, 5))]
)
def test_factor_times_exact(seed):
    """mu df is integrable, and the integral found, f2, has df2 wedge df = 0."""
    chance = random.Random(seed)
    names = [x, y, z]
    f = polynomial(chance, names) + chance.choice([0, t, sin(t)])
    mu = chance.choice([exp(x), 1 + y**2, 2 + cos(z), x + 3 * y, 1 / (1 + x**2)])
    answer = check(classify((mu * d(f)).expand(), names), Kind.INTEGRABLE, 1, 1)
    f2 = answer.integrals[0].f
    for a, b in itertools.combinations(names, 2):
        assert simplify(f2.diff(a) * f.diff(b) - f2.diff(b) * f.diff(a)) == 0


def test_mixture_of_exact_forms():
    """M(q) (df1, df2) with det M not 0 spans what df1, df2 span: integrable together."""
    chance = random.Random(100)
    names = [x, y, z, s]
    exact = Matrix([d(polynomial(chance, [x, y])) + d(z), d(polynomial(chance, [y, z, s]))])
    mixture = Matrix([[1, x * chance.randint(1, 3)], [s, chance.randint(2, 4) + x * s]])
    answer = classify(list(mixture * exact), names)
    check(answer, Kind.INTEGRABLE, 2, 2, found=len(answer.integrals))
