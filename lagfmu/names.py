"""The names of an FMU's variables: composed and read here, and nowhere else.  Imports nothing of lagfmu.

A name says what its variable is of (FMI's structured naming): lambda.rod, Q.rod.x, departure.rod.velocity.x,
der(x,2).  What a model names may have several words itself, as those of bodies and joints do:

    crank.position.x, der(crank.position.x)   a coordinate: of three words, so that Q.crank.position.x is the
                                              force of all constraints, and Q.rod.x the share of one
    lambda.A.x, unique.A.x                    the constraint A.x
    crank.mass, motor.torque, force.A.x       a parameter, an input, an output

Shares of a force and the states at an event (departure.rod.x) are named between words alone: they are left
out where the constraint or the coordinate has several.  It travels inside python FMUs.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

VALUE = "value"  # of a coordinate, an input, a parameter or an output that the model names; or its derivative
OWN = "own"  # in the variable table: the outputs among these
MULTIPLIER, UNIQUE, RESIDUAL = "lambda", "unique", "residual"  # of a constraint
EQUATION = "equation"  # what an importer drives to zero that solves for its multiplier
FORCE = "Q"  # on a coordinate: of all constraints, or the share of one
CONTACT, DEPARTURE, CLOSING = "contact", "departure", "closing"
STICKS, MARGIN, POWER = "sticks", "margin", "power"  # of a friction
SLIPPING, STICKING = "slipping", "sticking"  # likewise: its events
SLIP = "slip"  # of a constraint that holds by friction
DEPARTURES, DEPARTURE_TIME = "departure.count", "departure.time"
CLOSINGS, CLOSING_TIME = "closing.count", "closing.time"
IMPULSE = "closing.impulse"
SLIPS, SLIP_TIME = "slipping.count", "slipping.time"
STICKINGS, STICKING_TIME = "sticking.count", "sticking.time"
COUNT_OF = {  # of the events whose latest time it is
    DEPARTURE_TIME: DEPARTURES,
    CLOSING_TIME: CLOSINGS,
    SLIP_TIME: SLIPS,
    STICKING_TIME: STICKINGS,
}
COUNTS = tuple(COUNT_OF.values())
KINETIC, POTENTIAL, TOTAL = "energy.kinetic", "energy.potential", "energy.total"
DISSIPATED = "energy.dissipated"
DISSIPATION = "der(energy.dissipated)"
ENERGY, SOLVER = "energy", "solver"
RATE = re.compile(r"der\((?!energy\.)([\w.]+)(?:,(\d+))?\)")
SENSITIVITY = "sensitivity"  # of another variable, by a parameter: sensitivity.lambda.rod.by.L
SENSITIVITY_VALID = "sensitivity.valid"
BY = ".by."
ERROR = "error"  # how far off another variable may be: error.lambda.rod
STEPS = "solver.steps"
DAE = "solver.dae"  # whether an importer solves for the multipliers
TIME, INDICATOR, CLOCK = "time", "indicator", "clock"  # what FMI 3.0 has variables for, besides
FOLLOWS = "unless another start is set"  # ends the description of a start that is an expression
VELOCITY_OF = (
    "velocity of"  # begins the description of the rate of a coordinate, whatever the coordinate is
)
MISSED_VELOCITY = "velocity residual"  # likewise of the residual of a constraint of velocities
METHOD, TOLERANCE, STEP = "solver.method", "solver.tolerance", "solver.step"
MAXIMUM_STEP, MAXIMUM_STEPS = "solver.maximum_step", "solver.maximum_steps"

EVENTS = (DEPARTURE, CLOSING, SLIPPING, STICKING)
PEAK = "peak"  # the extremes of another variable: peak.lambda.rod.max
PEAKS = tuple(f"{PEAK}.{part}" for part in ("max", "min", "max_time", "min_time"))
RATES = ("", "velocity", "acceleration")  # a structured name has der() around it or not at all
REACTIONS = (MULTIPLIER, FORCE)
MODES = (CONTACT, STICKS)
OF_OTHERS = (ERROR, PEAK, SENSITIVITY)  # of another variable
RESERVED = (  # what nothing of a model's can be called
    *("Q", "contact", "count", "departure", "der", "energy", "error", "lambda", "residual"),
    *("sensitivity", "solver", "t", "time", "unique", "velocity"),
)


# Of what there is one output each: the model, a constraint, the direction of a coordinate (or a share of the
# force on it), a contact, a friction, a row of one.
MODEL, CONSTRAINT, DIRECTION, SHARE = "model", "constraint", "direction", "share"
OF_CONTACT, FRICTION, ROW = "of a contact", "friction", "row"


@dataclass(frozen=True)
class Kind:
    """A kind of output: all that is to say of it but its formula.

    `each`: of what there is one; `place`: where the native runtime has it (runtime/fmi/variables.h); `text`:
    what it is, {what} being its owner's name; `unit`, `behind`: what interface/outputs.py knows its owner
    by, or the parts of an energy that the equations have; `held`: it changes at events alone, so that a peak
    does not sample it; `barred`: it has an error bar.
    """

    quantity: str
    each: str
    place: str
    text: str
    unit: str = ""
    behind: str = ""
    type: str = "Real"
    held: bool = False
    barred: bool = False


OUTPUTS = (
    Kind(
        MULTIPLIER,
        CONSTRAINT,
        "LAMBDA",
        "multiplier of {what}",
        "multiplier",
        "solved",
        barred=True,
    ),
    Kind(RESIDUAL, CONSTRAINT, "RESIDUAL", "{missed} of {what}", "missed", "missed"),
    Kind(
        *(UNIQUE, CONSTRAINT, "UNIQUE", "true where {multiplier} is determined uniquely"),
        behind="entries",
        type="Boolean",
    ),
    Kind(
        *(FORCE, DIRECTION, "FORCE", "generalized force of all constraints on {what}"),
        *("force", "solved"),
        barred=True,
    ),
    Kind(
        *(FORCE, SHARE, "SHARE", "generalized force of constraint {constraint} on {what}"),
        *("force", "solved"),
        barred=True,
    ),
    Kind(KINETIC, MODEL, "KINETIC", "kinetic energy", "J", "kinetic"),
    Kind(POTENTIAL, MODEL, "POTENTIAL", "potential energy", "J", "potential"),
    Kind(TOTAL, MODEL, "TOTAL", "kinetic plus potential energy", "J", "kinetic potential"),
    Kind(
        *(CONTACT, OF_CONTACT, "CONTACT", "true while {what} is closed"),
        behind="modes",
        type="Boolean",
    ),
    Kind(
        *(IMPULSE, OF_CONTACT, "IMPULSE"),
        "impulse of {what} in its latest impact: the integral of its multiplier over time",
        *("impulse", "nothing"),
        held=True,
    ),
    Kind(
        *(
            STICKS,
            FRICTION,
            "STICKS",
            "true while {what} sticks (and its normal contact is closed)",
        ),
        behind="modes",
        type="Boolean",
    ),
    Kind(SLIP, ROW, "SLIP", "slip velocity G v - nu of {what}", "velocity", "rates"),
    Kind(
        *(MARGIN, FRICTION, "MARGIN"),
        "static coefficient times normal force less |lambda| of {what}",
        *("multiplier", "modes"),
    ),
    Kind(
        *(POWER, FRICTION, "POWER"),
        "power of {what}, lambda times slip velocity, never positive",
        *("W", "modes"),
    ),
    Kind(DISSIPATED, MODEL, "LOST", "energy that {what} dissipated so far", "J", "nothing"),
    Kind(DISSIPATION, MODEL, "LOST_RATE", "power that frictions dissipate", "W", "losses"),
    Kind(STEPS, MODEL, "STEPS", "internal steps taken so far", behind="nothing", type="Integer"),
)


def kinds(*each: str) -> tuple[Kind, ...]:
    """The kinds of output of which there is one for each of these, in the order of the table."""
    return tuple(kind for kind in OUTPUTS if kind.each in each)


OF_ONE = tuple(
    kind.quantity
    for kind in kinds(CONSTRAINT, OF_CONTACT, FRICTION, ROW)
    if "." not in kind.quantity
)
OF_FRICTION = (*(kind.quantity for kind in kinds(FRICTION, ROW)), SLIPPING, STICKING)
ENERGIES = {  # by what the equations have of them
    kind.quantity: parts
    for kind in kinds(MODEL)
    if (parts := kind.behind.split()) and {*parts} <= {"kinetic", "potential"}
}
BARRED = (  # what has an error bar, besides coordinates and velocities
    *dict.fromkeys(kind.quantity for kind in OUTPUTS if kind.barred),
    *(OWN, *COUNT_OF),
)


@dataclass(frozen=True)
class Subject:
    """What a variable is of: one of the quantities above, the constraint (contact, friction), the
    coordinate (input, parameter, output of the model's own), the order of the time derivative.  Of a
    sensitivity the constraint is by what it is taken, the coordinate of what."""

    quantity: str
    constraint: str = ""
    coordinate: str = ""
    order: int = 0

    @property
    def name(self) -> str:
        """As the FMU calls it."""
        return name(self.quantity, self.constraint, self.coordinate, self.order)

    @property
    def head(self) -> str:
        """The first word of the name where that is a kind: energy, departure, ...; else the quantity."""
        return self.quantity.partition(".")[0]


@lru_cache(maxsize=4096)  # the python target asks at every communication point
def name(quantity: str, constraint: str = "", coordinate: str = "", order: int = 0) -> str:
    """The name of what a `Subject` with these fields is."""
    if quantity in (VALUE, OWN):
        return derivative(coordinate, order)
    head, _, tail = quantity.partition(".")
    if quantity == SENSITIVITY:
        return f"{head}.{_structured(coordinate)}{BY}{_structured(constraint)}"
    if head == PEAK:
        return f"{head}.{_structured(coordinate)}.{tail}"
    if quantity == ERROR and (rate := RATE.fullmatch(coordinate)) and rate[2] is None:
        coordinate, order = rate[1], 1  # a structured name has der() around it or not at all
    words = (head, constraint, tail, "velocity" if order else "", coordinate)
    return ".".join(word for word in words if word)


def _structured(variable: str) -> str:
    """velocity.x for der(x), acceleration.x for der(x,2)."""
    rate = RATE.fullmatch(variable)
    return f"{RATES[int(rate[2] or 1)]}.{rate[1]}" if rate else variable


def _plain(words: list[str]) -> str:
    """The variable of such words."""
    order = RATES.index(words[0]) if words[0] in RATES and len(words) > 1 else 0
    return derivative(".".join(words[1:]), order) if order else ".".join(words)


def derivative(coordinate: str, order: int = 1) -> str:
    """x, der(x), der(x,2), ..."""
    return (coordinate, f"der({coordinate})", f"der({coordinate},{order})")[min(order, 2)]


def rate_of(state: str) -> str:
    """The derivative of a coordinate, a velocity der(x) or a speed of the model's own."""
    found = RATE.fullmatch(state)
    return derivative(found[1], int(found[2] or 1) + 1) if found else derivative(state)


def motion(coordinates: Iterable[str]) -> list[str]:
    """The coordinates, then their velocities."""
    known = list(coordinates)
    return [*known, *(derivative(q) for q in known)]


def read(text: str) -> Subject:
    """What a variable of that name is of."""
    if found := RATE.fullmatch(text):
        return Subject(VALUE, "", found[1], int(found[2] or 1))
    head, *rest = text.split(".")
    if text == DISSIPATION or (head in (ENERGY, SOLVER) and len(rest) == 1):
        return Subject(text)
    if head == ERROR and rest:
        of_velocity = rest[0] == "velocity" and len(rest) > 1
        return Subject(head, "", derivative(".".join(rest[1:])) if of_velocity else ".".join(rest))
    if f"{head}.{rest[-1] if rest else ''}" in PEAKS and len(rest) > 1:
        return Subject(f"{head}.{rest[-1]}", "", _plain(rest[:-1]))
    if text == SENSITIVITY_VALID:
        return Subject(text)
    if head == SENSITIVITY and BY in text:
        of, _, by = ".".join(rest).rpartition(BY)
        return Subject(head, _plain(by.split(".")), _plain(of.split(".")))
    if head in EVENTS and len(rest) > 1:
        *owner, last = rest
        if last in ("count", "time") or (head == CLOSING and last == "impulse"):
            return Subject(f"{head}.{last}", ".".join(owner))
        if len(rest) < 3 or (len(rest) == 3 and rest[1] == "velocity"):
            return Subject(head, rest[0], last, len(rest) - 2)
    if head == FORCE and len(rest) == 2:
        return Subject(head, rest[0], rest[1])
    if head == FORCE and rest:
        return Subject(head, "", ".".join(rest))
    if head in (*OF_ONE, EQUATION) and rest:
        return Subject(head, ".".join(rest))
    return Subject(VALUE, "", text)


def shared(constraint: str, coordinate: str) -> bool:
    """Whether Q.CONSTRAINT.COORDINATE is a variable: only where both names are one word."""
    return "." not in constraint + coordinate


def bar(of: str) -> str:
    """The error bar of a variable."""
    return name(ERROR, "", of)


def measured(text: str) -> str:
    """The variable whose extreme it is; empty if it is none."""
    found = read(text)
    return found.coordinate if found.head == PEAK else ""


def varied(text: str) -> str:
    """The variable whose derivative along the run it is; empty if it is none."""
    found = read(text)
    return found.coordinate if found.quantity == SENSITIVITY else ""


def barred(text: str) -> str:
    """The variable whose error bar it is; empty if it is none."""
    found = read(text)
    return found.coordinate if found.quantity == ERROR else ""


def counted(text: str) -> str:
    """The count of the event that a variable tells the latest time or state of: while it is 0, the variable
    says nothing (FMI has no way to leave it out: it is a finite 0); of a derivative along the run whether
    there is one.  Empty for every other variable."""
    found = read(text)
    if found.quantity == ERROR:
        return counted(found.coordinate)
    if found.quantity == SENSITIVITY:
        return SENSITIVITY_VALID
    if found.head not in EVENTS or found.quantity in COUNTS:
        return ""
    return name(f"{found.head}.count", found.constraint)


def those(known: Iterable[str], *quantities: str) -> list[str]:
    """The names, among those known, of these quantities."""
    return [text for text in known if read(text).quantity in quantities]


def constraints(known: Iterable[str], quantity: str) -> list[str]:
    """The constraints (contacts, frictions) of which that quantity is known."""
    return [read(text).constraint for text in those(known, quantity)]


def coordinates(known: Iterable[str]) -> list[str]:
    """Those whose acceleration is known."""
    subjects = [read(text) for text in known]
    return [s.coordinate for s in subjects if s.quantity == VALUE and s.order == 2]


def of_interest(known: Iterable[str]) -> list[str]:
    """What a reader asks for first: of a mechanism the force in each joint and the coordinates of joints,
    elsewhere every multiplier and the coordinates."""
    texts = list(known)
    forces = [n for n in texts if n.startswith("force.") and n.endswith(".norm")]
    moving = coordinates(texts)
    if not forces:
        return those(texts, MULTIPLIER) + moving
    return forces + ([n for n in moving if n.startswith(("angle.", "position."))] or moving)


def initial(text: str) -> str:
    """How closed forms call the value of a variable at the start."""
    return f"initial({text})"


def initially(symbol: str) -> str:
    """The variable whose value at the start closed forms call so; empty if it is none."""
    return symbol[len("initial(") : -1] if symbol.startswith("initial(") else ""
