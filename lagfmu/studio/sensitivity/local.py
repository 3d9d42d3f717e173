"""sensitivity(): derivatives of outputs at the end of a run by parameters and start values.

The FMU's own where it has them (`sensitivity.OUTPUT.by.PARAMETER`), else central differences of runs.  Where
the runs beside each other meet different events no difference is given: it would be none of a derivative.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.markup import escape
from rich.table import Table

from ... import names
from ...errors import SettingError, SimulationError
from ...fmu.read import (
    Trajectory,
    check_inputs,
    columns_at,
    communication_points,
    described_rules,
    experiment_of,
    jumps,
    kind_of,
    obstacle,
    read_description,
    warn_of_rates,
)
from ...fmu.session import RefusalError, Session
from ...fmu.write import as_fmu
from ...interface.variables import problems_of, unsettable
from ...model.model import Model
from ...model.rule import Rule, missing
from ...model.scene import Scene
from ...model.units import for_reading
from ...numeric.thresholds import tolerance_problem
from ...page.table import as_text, new_table
from ...prepare.starts import tell
from ...verification.reference import Driven, driven

MOST = 12  # bars of one output


def tornado(
    bars: Mapping[str, Sequence[tuple[str, float]]],
    label: str,
    title: str,
    out: Any = None,
    errors: Mapping[str, Mapping[str, float]] | None = None,
) -> Any:
    """A panel an output with its bars (name, length), the first on top, and `errors` about their ends; a
    Figure, or with `out` the file.  Raises BuildError if it cannot be written."""
    import matplotlib as mpl

    from ...verification.plot import COLOURS, STYLE, Drawn, plain, save

    shown = {o: [b for b in rows if np.isfinite(b[1])][:MOST] for o, rows in bars.items()}
    heights = [0.6 + 0.28 * max(len(rows), 1) for rows in shown.values()]
    with mpl.rc_context(STYLE | {"font.size": 10}):
        figure = Drawn(figsize=(7.5, 0.6 + sum(heights)), layout="constrained")
        panels = figure.subplots(len(shown), 1, squeeze=False, height_ratios=heights)[:, 0]
        for panel, (output, rows) in zip(panels, shown.items(), strict=True):
            places = np.arange(len(rows))[::-1]
            lengths = [length for _, length in rows]
            colours = [COLOURS[0] if x >= 0 else COLOURS[1] for x in lengths]
            spread = None if errors is None else [errors[output][n] for n, _ in rows]
            panel.barh(places, lengths, color=colours, xerr=spread, height=0.7)
            panel.set_yticks(places, [plain(n) for n, _ in rows])
            panel.axvline(0, color="#48525e", lw=1)
            panel.set_title(plain(output), loc="left", fontsize=10)
            panel.grid(visible=False, axis="y")
        panels[-1].set_xlabel(plain(label))
        figure.suptitle(plain(title), fontsize=11)
        return figure if out is None else save(figure, Path(out))


Floats = NDArray[np.float64]
TOLERANCE = 1e-11  # of the runs: their noise limits the differences
ALL = "all"
MATTERS = (
    1e-3  # of the largest relative derivative: what is below is not shown where all were asked for
)
LONGEST = 40  # characters of a remark inside a table


def _short(text: str, notes: Sequence[str]) -> str:
    """A remark, or the number of the note that it is."""
    return f"({list(notes).index(text) + 1})" if text in notes else text


@dataclass(frozen=True)
class Sensitivity:
    """Derivatives (outputs, parameters) at the end of a run, in the units [output]/[parameter], NaN where
    there is none; `why`: of each of these the reason; `own`: of each whether the FMU gave it; `values` and
    `points`: of outputs and parameters, by name; `step`: of differences, relative; `ended`: the FMU tells
    derivatives, and they ended within the run; `everything`: all parameters were asked for, of which `tables`
    show those that matter."""

    name: str
    stop_time: float
    values: Mapping[str, float]
    points: Mapping[str, float]
    derivatives: Floats
    why: Mapping[tuple[str, str], str]
    own: NDArray[np.bool_]
    units: Mapping[str, str]
    step: float
    ended: bool = False
    everything: bool = False

    @property
    def relative(self) -> Floats:
        """(outputs, parameters): by how many parts in 100 an output grows if a parameter grows by one; NaN
        where one of them is 0."""
        above, below = np.array(list(self.points.values())), np.array(list(self.values.values()))
        with np.errstate(divide="ignore", invalid="ignore"):
            found = self.derivatives * above[None, :] / below[:, None]
        found[~np.isfinite(found)] = np.nan
        found[:, above == 0] = np.nan
        return np.asarray(found)

    def order(self, output: int) -> list[int]:
        """Parameters by the size of their relative derivative, the largest first."""
        part = np.abs(self.relative[output])
        return sorted(range(len(part)), key=lambda k: -np.nan_to_num(part[k], nan=-1.0))

    def to_dict(self) -> dict[str, Any]:
        """Everything, for JSON."""
        relative = self.relative
        return {
            "fmu": self.name,
            "stop_time": self.stop_time,
            "outputs": [
                {
                    "name": o,
                    "value": value,
                    "unit": self.units.get(o, ""),
                    "by": [
                        {
                            "name": p,
                            "value": point,
                            "unit": self.units.get(p, ""),
                            "derivative": float(self.derivatives[i, k]),
                            "relative": float(relative[i, k]),
                            "of_the_fmu": bool(self.own[i, k]),
                            "reason": self.why.get((o, p), ""),
                        }
                        for k, (p, point) in enumerate(self.points.items())
                    ],
                }
                for i, (o, value) in enumerate(self.values.items())
            ],
        }

    def plot(self, out: Any = None) -> Any:
        """Bars of the relative derivatives, the longest on top: a matplotlib Figure, or a file `out`."""

        bars = [
            [(list(self.points)[k], float(self.relative[i, k])) for k in self.order(i)]
            for i in range(len(self.values))
        ]
        label = "change of the output by 1 % of the parameter [%]"
        return tornado(dict(zip(self.values, bars, strict=True)), label, self.name, out)

    def tables(self) -> list[Table]:
        """A table an output: parameter, relative derivative, derivative, why there is none."""
        found = []
        for i, (output, value) in enumerate(self.values.items()):
            unit = for_reading(self.units.get(output))
            title = f"{output} = {value:.9g} {unit} at t = {self.stop_time:g} s"
            head = ("parameter", "% per %", "derivative", "unit", "remark")
            drawn = new_table(escape(title), *head, words=["parameter", "unit"], text=["remark"])
            shown, notes = self._shown(i), self._notes()
            for k in shown:
                name = list(self.points)[k]
                part, slope = self.relative[i, k], self.derivatives[i, k]
                drawn.add_row(
                    escape(name),
                    "" if np.isnan(part) else f"{part:+.6f}",
                    "" if np.isnan(slope) else f"{slope:.9g}",
                    f"{unit or '1'} / {for_reading(self.units.get(name)) or '1'}",
                    _short(self.why.get((output, name), ""), notes),
                )
            found.append(drawn)
        return found

    def _shown(self, output: int) -> list[int]:
        """Of a table the parameters that matter, the first of them first; all that were asked for by name."""
        order = self.order(output)
        if not self.everything:
            return order
        part, slopes = np.abs(self.relative[output]), self.derivatives[output]
        least = MATTERS * float(np.nanmax(part, initial=0.0))
        size = abs(list(self.values.values())[output])
        apart = np.isnan(part) & (
            np.abs(np.nan_to_num(slopes)) > MATTERS * size
        )  # of 0 no part can be told
        return [k for k in order if (part[k] >= least and part[k] > 0) or apart[k]] or order[:1]

    def _notes(self) -> list[str]:
        """Reasons that are too long for a table."""
        shown = {
            (o, list(self.points)[k]) for i, o in enumerate(self.values) for k in self._shown(i)
        }
        told = dict.fromkeys(text for pair, text in self.why.items() if pair in shown)
        return [text for text in told if len(text) > LONGEST]

    def remarks(self) -> list[str]:
        """Reasons that are too long for a table, and which derivatives are differences of runs."""
        notes = [f"({k}) {text}" for k, text in enumerate(self._notes(), 1)]
        for i, output in enumerate(self.values):
            hidden = set(range(len(self.points))) - set(self._shown(i))
            untold: dict[str, list[str]] = {}
            for k, name in enumerate(self.points):
                if k in hidden and (output, name) in self.why:
                    untold.setdefault(self.why[output, name], []).append(name)
            notes += [
                f"{output}: no derivative by {', '.join(by)}: {why}" for why, by in untold.items()
            ]
            if rest := len(hidden) - sum(map(len, untold.values())):
                text = f"{output}: not shown: {rest} below {MATTERS:g} of the first"
                notes.append(f"{text}: --to NAME shows them")
        return notes + self._differences()

    def _differences(self) -> list[str]:
        if self.own.all():
            return []
        these = "derivatives" if not self.own.any() else f"{int((~self.own).sum())} derivatives"
        ended = ": those of the FMU end within the run (sensitivity.valid)" if self.ended else ""
        return [f"{these} by central differences of runs, relative step {self.step:.1e}{ended}"]

    def __repr__(self) -> str:
        return "\n".join([self.name, as_text(*self.tables()), *self.remarks()])


def sensitivity(
    source: str | os.PathLike[str] | Model,
    of: Sequence[str],
    to: Sequence[str] | str = ALL,
    *,
    start_values: Mapping[str, Any] | None = None,
    stop_time: float | None = None,
    step_size: float | None = None,
    tolerance: float = TOLERANCE,
    inputs: Driven | None = None,
    scene: Scene | str | None = None,
) -> Sensitivity:
    """How outputs at the end of a run change with parameters and start values, at the values given.

    `of` names outputs: those that tell of a whole run, as `departure.surface.time` and `peak.lambda.rod.max`,
    mean most.  `to` names parameters and start values; 'all': every Real one but the solver's.  Raises
    SettingError with every name that is unknown, SimulationError for a run that fails.
    """
    if problem := tolerance_problem(tolerance):
        raise SettingError(problem)
    inputs = driven(inputs)
    with made_for(source, of, to, scene) as path, Session(path) as session:
        description, rules, given = session.description, session.rules, dict(start_values or {})
        variables = {v.name: v for v in description.modelVariables}
        asked = _settable(variables, rules) if to in (ALL, [ALL], (ALL,)) else list(to)
        _check(variables, rules, of, asked, given)
        check_inputs(inputs, rules, session.inputs)
        warn_of_rates(inputs, rules)
        experiment = experiment_of(description, stop_time, step_size)
        points = communication_points(experiment.stop_time, experiment.step_size)
        runs = _Runs(session, np.union1d(points, jumps(inputs, points)), tolerance, inputs, of)
        start = {p: float(given.get(p, rules[p].start or 0.0)) for p in asked}
        found = _found(description, runs, of, start, given, rules)
        return replace(found, everything=to in (ALL, [ALL], (ALL,)))


@contextlib.contextmanager
def made_for(
    source: str | os.PathLike[str] | Model,
    of: Sequence[str],
    to: Sequence[str] | str = ALL,
    scene: Scene | str | None = None,
) -> Iterator[Path]:
    """An FMU as it is; of a model, or a model file, one that tells derivatives and extremes among `of`.

    A start by which there are none, as that of a body on a floor, would end those by all others: where all
    are asked for and the run begins so, the FMU tells those by parameters alone."""
    everything = to in (ALL, [ALL], (ALL,))
    peaks = [n for text in of if (n := names.measured(text))]

    def told(by: Iterable[str]) -> contextlib.AbstractContextManager[Path]:
        return as_fmu(source, scene, peaks=peaks, sensitivities=[f"{','.join(of)}:{','.join(by)}"])

    with told("*" if everything else to) as path:
        parameters = _parameters_alone(path) if everything else []
        if not parameters:
            yield path
            return
    with told(parameters) as path:
        yield path


def _parameters_alone(fmu: Path) -> list[str]:
    """Its parameters, where it tells derivatives and begins without; else none."""
    description = read_description(fmu)
    variables = {v.name: v for v in description.modelVariables}
    if names.SENSITIVITY_VALID not in variables or obstacle(fmu, description):
        return []
    with Session(fmu) as session:
        times = [0.0, experiment_of(description).step_size]
        run = session.run(times, {}, TOLERANCE, [names.SENSITIVITY_VALID], late=True)
        if len(run.rows) == 0 or run.rows[names.SENSITIVITY_VALID][0]:
            return []
    rules = described_rules(description)
    return [n for n in _settable(variables, rules) if variables[n].causality == "parameter"]


def _settable(variables: Mapping[str, Any], rules: Mapping[str, Rule]) -> list[str]:
    """Real parameters and start values, but for the solver's."""
    return [
        n
        for n, v in variables.items()
        if rules[n].settable
        and kind_of(v) == "Real"
        and v.causality != "input"
        and names.read(n).head != names.SOLVER
    ]


def _check(
    variables: Mapping[str, Any],
    rules: Mapping[str, Rule],
    of: Sequence[str],
    to: Sequence[str],
    given: Mapping[str, Any],
) -> None:
    outputs = [n for n, v in variables.items() if v.causality == "output" and kind_of(v) == "Real"]
    problems = problems_of(rules, given)
    problems += [missing(n, outputs, "is no Real output") for n in of if n not in outputs]
    problems += [text for n in to if (text := unsettable(rules, n))]
    problems += [
        f"{n!r} is a {rules[n].kind}, expected what changes continuously"
        for n in to
        if n in rules and rules[n].kind != "Real"
    ]
    if not of:
        problems.append("nothing is asked for, expected names of outputs")
    if problems:
        raise SettingError("; ".join(problems))


class _Runs:
    """Runs to the end: the outputs `of` there, what the FMU tells of their derivatives, and its events."""

    def __init__(
        self,
        session: Session,
        points: Floats,
        tolerance: float,
        inputs: Trajectory | None,
        of: Sequence[str],
    ) -> None:
        self.session, self.points, self.tolerance = session, points, tolerance
        self.drive = columns_at(inputs, points, session.rules)
        self.of = list(of)
        self.counts = names.those(session.outputs, *names.COUNTS)

    def end(self, values: Mapping[str, Any], more: Sequence[str] = ()) -> dict[str, float]:
        """The last row.  Raises RefusalError."""
        read = list(dict.fromkeys([*self.of, *self.counts, *more]))
        run = self.session.run(
            self.points.tolist(), values, self.tolerance, read, self.drive, late=True
        )
        if run.refusal is not None:
            raise run.refusal
        return {n: float(run.rows[n][-1]) for n in read}

    def events(self, row: Mapping[str, float]) -> tuple[float, ...]:
        """How many of each kind there were."""
        return tuple(row[n] for n in self.counts)


def _found(
    description: Any,
    runs: _Runs,
    of: Sequence[str],
    start: Mapping[str, float],
    given: Mapping[str, Any],
    rules: Mapping[str, Rule],
) -> Sensitivity:
    told = {
        (o, p): n for o in of for p in start if (n := names.name(names.SENSITIVITY, p, o)) in rules
    }
    flag = [names.SENSITIVITY_VALID] if told and names.SENSITIVITY_VALID in rules else []
    try:
        base = runs.end(given, [*told.values(), *flag])
        tell(runs.session.moved)
    except RefusalError as error:
        raise SimulationError(f"the run at the given values fails: {error.message}") from None
    ended = bool(flag) and not base[flag[0]]
    if ended:
        told = {}  # from some event on there is none: differences tell what can be told
    step = runs.tolerance ** (1 / 3)
    slopes = np.full((len(of), len(start)), np.nan)
    own = np.zeros(slopes.shape, dtype=bool)
    why: dict[tuple[str, str], str] = {}
    for k, (p, point) in enumerate(start.items()):
        if all((o, p) in told for o in of):
            for i, o in enumerate(of):
                slopes[i, k], own[i, k] = base[told[o, p]], True
            continue
        column, reason = _difference(runs, base, given, p, point, step, rules[p])
        for i, o in enumerate(of):
            if (o, p) in told:
                slopes[i, k], own[i, k] = base[told[o, p]], True
            elif reason:
                why[o, p] = reason
            else:
                slopes[i, k] = column[i]
    units = {v.name: v.unit or "1" for v in description.modelVariables}
    stop = float(runs.points[-1])
    values = {o: base[o] for o in of}
    return Sensitivity(
        description.modelName, stop, values, dict(start), slopes, why, own, units, step, ended
    )


def _difference(
    runs: _Runs,
    base: Mapping[str, float],
    given: Mapping[str, Any],
    name: str,
    point: float,
    step: float,
    rule: Rule,
) -> tuple[Floats, str]:
    """The slopes (outputs,) by a central difference, one-sided at a bound; or why there are none."""
    h = step * (abs(point) or 1.0)
    sides: list[tuple[float, Mapping[str, float]]] = []
    for value in (point - h, point + h):
        if rule.problem(value):
            sides.append((point, base))
            continue
        try:
            sides.append((value, runs.end({**given, name: value})))
        except RefusalError as error:
            return np.empty(0), f"the run at {value:.6g} fails: {error.message}"
    (low, left), (high, right) = sides
    if low == high:
        return np.empty(0), "it cannot be changed"
    if not runs.events(left) == runs.events(right) == runs.events(base):
        return np.empty(0), "runs beside this one meet other events"
    return np.array([(right[o] - left[o]) / (high - low) for o in runs.of]), ""
