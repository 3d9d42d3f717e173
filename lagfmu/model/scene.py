"""What one FMU reports: the full FMU is the scene that asks for everything.

`outputs`, `fixed`, `inputs`, `contacts` and `frictions` name what an importer reads, changes and drives, and
what may open and slip; mechanics/prune.py removes everything else before code is printed.

The accuracy that is asked for: 1e-6, 1e-6:lambda.surface, 1e-6:lambda.surface,Q.*
"""

from __future__ import annotations

import difflib
import fnmatch
import keyword
import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase

from ..errors import RequestError, UsageError
from ..methods import AUTO, DIFFERENTIATED, EXPLICIT, METHODS, UNLESS_STIFF, integrators, unknown
from ..numeric.thresholds import DEFAULT_TOLERANCE, tolerance_problem
from .elements import NAME, is_number


def select(
    wanted: Iterable[str], known: Sequence[str], what: str, problems: list[str]
) -> tuple[str, ...]:
    """Those of `known`, in their order, that a name or pattern (* and ?) of `wanted` means.

    A name that means nothing is added to `problems`; `what` says what it should be, e.g. 'parameter'.
    """
    found: set[str] = set()
    for name in wanted:
        meant = [k for k in known if k == name or fnmatchcase(k, name)]
        found.update(meant)
        if not meant and name != "*":
            near = difflib.get_close_matches(name, known, 3, 0.5) or list(known[:8])
            hint = f"; did you mean {', '.join(map(repr, near))}?" if near else "; there is none"
            problems.append(f"{what} {name!r} is unknown{hint}")
    return tuple(k for k in known if k in found)


def listed(text: str) -> tuple[str, ...]:
    """NAME,NAME as names; a comma within parentheses belongs to the name, as in der(x,2)."""
    found: list[str] = []
    depth, word = 0, ""
    for letter in f"{text},":
        depth += (letter == "(") - (letter == ")")
        if letter == "," and depth <= 0:
            found.append(word.strip())
            word = ""
        else:
            word += letter
    return tuple(w for w in found if w)


MARGIN = 5.0  # the choice is this much better on the scene than what was asked
HELD_OUT_MARGIN = 2.0  # and still this much on other start values and parameters
LOOSEST, FINEST = 0.1, 1e-12
GROUPS = {  # of quantities that an accuracy is asked of
    "lambda": r"lambda\.[\w.]+",
    "Q": r"Q\.\w+(\.\w+\.\w+)?",
    "coordinates": r"(\w+\.(position|orientation)\.)?[A-Za-z_]\w*",
    "event time": r"departure\.[\w.]+\.time",
}
USUAL = 10.0  # times the tolerance that a closed form may miss, unless it says otherwise


def _is(variable: str, name: str) -> bool:
    """Whether a variable is meant by a name, a pattern (Q.*) or a group."""
    group = GROUPS.get(name)
    if group is not None and re.fullmatch(group, variable):
        return True
    return fnmatch.fnmatchcase(variable, name)


@dataclass(frozen=True)
class Goal:
    """A relative error, and the quantities that it is asked of (all measured ones if empty)."""

    accuracy: float
    names: tuple[str, ...] = ()

    @property
    def on_the_scene(self) -> float:
        """The error that a setting may have where it is chosen."""
        return self.accuracy / MARGIN

    @property
    def held_out(self) -> float:
        """The error that it may have elsewhere."""
        return self.accuracy / HELD_OUT_MARGIN

    def allowed(self, symbols: Collection[str], within: float) -> float | None:
        """What a statement about these variables may miss, relative to its scale; None: not asked.

        A measured quantity is held to the accuracy itself.  An expression of such, which loosens them
        by its terms, is when it is allowed `within` / USUAL of what is usual.
        """
        if self.names and not all(any(_is(s, n) for n in self.names) for s in symbols):
            return None
        measured = len(symbols) == 1 and any(_is(s, group) for s in symbols for group in GROUPS)
        return self.accuracy if measured else self.accuracy * max(1.0, within / USUAL)

    def __str__(self) -> str:
        return f"{self.accuracy:g}" + (f" of {', '.join(self.names)}" if self.names else "")


def parse(text: str) -> Goal:
    """'1e-6' or '1e-6:NAME,NAME'.  Raises UsageError if it is neither."""
    number, colon, names = text.partition(":")
    wanted = tuple(n.strip() for n in names.split(",") if n.strip())
    try:
        accuracy = float(number)
    except ValueError:
        accuracy = float("nan")
    if not FINEST <= accuracy <= LOOSEST or (colon and not wanted):
        raise UsageError(
            f"--accuracy {text!r}: expected a relative error from {FINEST:g} to {LOOSEST:g}, and after "
            "a colon the outputs that it is asked of, e.g. 1e-6 or 1e-6:lambda.surface,Q.*"
        )
    return Goal(accuracy, wanted)


FORMULATIONS = ("multipliers", "nullspace", "minimal")
EVERYTHING = ("*",)
LONGEST = 200  # letters of a name: a file's may have 255, with what stands before and after


@dataclass(frozen=True)
class Scene:
    """One FMU of a model.

    `formulation` is 'multipliers' (KKT), 'nullspace' (lambda eliminated) or 'minimal' (dependent
    coordinates eliminated); all three report lambda and Q.  None: 'minimal' where `outputs` need no
    lambda and dependent coordinates can be eliminated, else 'multipliers'.  `stop_time` and
    `step_size` [s], `tolerance`, `method` and `step` (the largest one of a method with a fixed step
    [s]; 0: chosen from the start) are the defaults that the FMU states and starts with.

    What the importer needs; names may be patterns such as 'lambda.*':
    `outputs`: the variables that it reads (start values can be set whether they are read or not).
    `fixed`: parameters that become numbers in the code, 'm' at the model's value or 'm=2.5' at
    another [SI]; the other ones stay adjustable, but for those on which no output depends.
    `inputs`: those that it drives; the others keep their start values, and can no longer be set.
    `contacts`: those that may open; the others hold like a holonomic constraint, whatever the sign of
    lambda.
    `frictions`: those that may slip; what the others limit always sticks, while their contact is closed.
    `accuracy`: '1e-6' or '1e-6:lambda.surface', the relative error that the FMU is to hold; the
    method's tolerance or step is then found by bisection when it is built.
    `methods`: those that `solver.method` can be set to; None: `method` alone if `outputs` are named,
    else all.
    `reals_only`: for importers that take every variable for a Real: modes and counts are Reals (1.0 for
    true), and `solver.method` is left out.
    `error_bars`: besides each lambda, Q, coordinate, velocity, output of the model's own and time of an
    event that is an output, `error.NAME`: an estimate of how far this run's
    value may be off, by a finer run (docs/error_bars.md); co-simulation only.
    `sensitivities`: derivatives of what the FMU reports, as 'lambda.surface:a' or
    'departure.surface.time:theta,a': `sensitivity.OUTPUT.by.PARAMETER` by parameters and start values
    (patterns, * for all), along the run and through its events (docs/sensitivities.md); native
    co-simulation by dop853 (which `auto` then is) or rk4.
    `derivatives`: whether a native FMU offers directional derivatives; None: unless `outputs` are
    named.

    Raises RequestError with every problem at once.
    """

    name: str
    formulation: str | None = None
    stop_time: float = 1.0
    step_size: float = 0.01
    tolerance: float = DEFAULT_TOLERANCE
    method: str = "auto"
    step: float = 0.0
    outputs: Sequence[str] = EVERYTHING
    fixed: Sequence[str] = ()
    inputs: Sequence[str] = EVERYTHING
    contacts: Sequence[str] = EVERYTHING
    frictions: Sequence[str] = EVERYTHING
    accuracy: str | None = None
    methods: Sequence[str] | None = None
    derivatives: bool | None = None
    reals_only: bool = False
    error_bars: bool = False
    sensitivities: Sequence[str] = ()

    def __post_init__(self) -> None:
        problems = []
        if not NAME.match(self.name):
            problems.append(
                f"scene name {self.name!r} is not a name that FMI allows: use letters, digits and _"
            )
        elif len(self.name) > LONGEST:
            problems.append(
                f"scene name {self.name[:20] + '...'!r} has {len(self.name)} letters, expected at most "
                f"{LONGEST}: files are called by it"
            )
        elif keyword.iskeyword(self.name):
            problems.append(
                f"scene name {self.name!r} is a word of the Python language: choose another"
            )
        if self.formulation is not None and self.formulation not in FORMULATIONS:
            problems.append(
                f"formulation {self.formulation!r} is unknown, expected one of "
                f"{', '.join(FORMULATIONS)}"
            )
        for method in (self.method, *(self.methods or ())):
            if method not in METHODS:
                problems.append(unknown(method))
        for what in ("stop_time", "step_size"):
            value = getattr(self, what)
            if not is_number(value) or not value > 0:
                problems.append(f"{what} = {value!r}, expected a positive number")
        if problem := tolerance_problem(self.tolerance):
            problems.append(problem)
        if not is_number(self.step) or self.step < 0:
            problems.append(f"step = {self.step!r}, expected a positive number, or 0")
        for what in ("outputs", "fixed", "inputs", "contacts", "frictions", "sensitivities"):
            problems += self._listed(what)
        if self.sensitivities and not problems:
            problems += self._varied()
        if self.methods is not None:
            wanted = {self.method, *self.methods}
            chosen = tuple(m for m in METHODS if m in wanted)
            whole = self.complete and chosen == METHODS
            object.__setattr__(self, "methods", None if whole else chosen)
        if problems:
            raise RequestError(self.name, problems)

    def _listed(self, what: str) -> list[str]:
        """A list of names is kept as a tuple; a bare text would be taken letter by letter."""
        value = getattr(self, what)
        if isinstance(value, str) or not all(isinstance(x, str) for x in value):
            return [f"{what} = {value!r}, expected a list of names, e.g. {what}=['m']"]
        whole = "*" in value and what not in ("fixed", "sensitivities")
        object.__setattr__(self, what, EVERYTHING if whole else tuple(value))
        return []

    def _varied(self) -> list[str]:
        """Pairs that can be read, methods whose steps can be differentiated."""
        problems = [
            f"sensitivities: {text!r}, expected OUTPUT:PARAMETER,..., e.g. 'lambda.surface:a'"
            for text in self.sensitivities
            if not all(text.partition(":")[::2])
        ]
        if self.method == AUTO:
            object.__setattr__(self, "method", UNLESS_STIFF)
        chosen = [self.method, *(m for m in self.methods or () if m != AUTO)]
        problems += [
            f"sensitivities with the method {m!r}: expected {' or '.join(DIFFERENTIATED)}, whose steps are "
            "differentiated"
            for m in chosen
            if m not in DIFFERENTIATED
        ]
        object.__setattr__(self, "methods", tuple(chosen) if self.methods else None)
        return problems

    @property
    def whole(self) -> Scene:
        """The scene that asks for everything, of the same experiment."""
        return replace(
            self,
            outputs=EVERYTHING,
            fixed=(),
            inputs=EVERYTHING,
            contacts=EVERYTHING,
            methods=None,
            derivatives=None,
            sensitivities=(),
        )

    @property
    def complete(self) -> bool:
        """True if every variable of the model can be read."""
        return tuple(self.outputs) == EVERYTHING

    @property
    def selectable(self) -> tuple[str, ...]:
        """The methods that `solver.method` can be set to."""
        if self.reals_only:
            return (self.method,)
        if self.methods is not None:
            return tuple(self.methods)
        if self.sensitivities:
            return tuple(
                m for m in DIFFERENTIATED if m == self.method or (self.complete and m in EXPLICIT)
            )
        return METHODS if self.complete else (self.method,)

    @property
    def integrators(self) -> tuple[str, ...]:
        """The integrators behind the methods that can be chosen."""
        return integrators(self.selectable)

    @property
    def differentiable(self) -> bool:
        """True if a native FMU offers directional derivatives."""
        return self.complete if self.derivatives is None else self.derivatives
