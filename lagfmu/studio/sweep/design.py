"""What varies in a study: axes that are crossed, samples of distributions, or rows of a file.

theta=0.01:1.2:50        50 values, evenly spaced; with :log behind them, evenly spaced in the logarithm
m=0.5,1,2                these values
m ~ normal(1, 0.05)      also uniform(low, high), loguniform(low, high), truncnormal(mean, sd, low, high)
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from ...errors import SettingError
from ...files import foreign, parquet_of
from ...methods import NUMBERS, unknown
from ...names import METHOD

Values = NDArray[np.float64]
MOST = 10**8  # values of one quantity
PLANS = ("latin-hypercube", "sobol")
DISTRIBUTIONS = {  # name -> parameters
    "uniform": ("low", "high"),
    "loguniform": ("low", "high"),
    "normal": ("mean", "sd"),
    "truncnormal": ("mean", "sd", "low", "high"),
}
SAMPLE = re.compile(r"\s*(?P<name>[^~]+?)\s*~\s*(?P<kind>\w+)\s*\((?P<arguments>[^()]*)\)\s*\Z")


@dataclass(frozen=True)
class Design:
    """The runs of a study: `table` (runs, names), in the order in which they are numbered.

    `axes` are the crossed quantities if there is nothing else: run i stands at the point of the grid whose
    number, last axis fastest, is i.
    """

    names: tuple[str, ...]
    table: Values
    axes: tuple[tuple[str, Values], ...]

    def __len__(self) -> int:
        return len(self.table)

    @property
    def digest(self) -> str:
        """A hash of names and values."""
        digest = hashlib.sha256("\0".join(self.names).encode())
        digest.update(np.ascontiguousarray(self.table).tobytes())
        return digest.hexdigest()


def number(text: str, name: str, what: str) -> float:
    """A finite number; for `solver.method` also a method's name."""
    text = text.strip()
    if name == METHOD:
        if text not in NUMBERS:
            raise SettingError(f"{what}: {unknown(text)}")
        return float(NUMBERS[text])
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise SettingError(
            f"{what}: {text!r} is no finite number; expected one in SI, without a unit"
        )
    return value


def axis(text: str) -> tuple[str, Values]:
    """NAME=FROM:TO:COUNT, NAME=FROM:TO:COUNT:log or NAME=VALUE,VALUE,...  Raises SettingError."""
    name, sign, values = (part.strip() for part in text.partition("="))
    what = f"--vary {text!r}"
    if not (name and sign and values):
        raise SettingError(f"{what}: expected NAME=FROM:TO:COUNT or NAME=VALUE,VALUE,...")
    if ":" not in values:
        return name, np.array([number(v, name, what) for v in values.split(",")])
    parts = values.split(":")
    if len(parts) not in (3, 4) or (len(parts) == 4 and parts[3].strip() != "log"):
        raise SettingError(f"{what}: expected FROM:TO:COUNT, or FROM:TO:COUNT:log")
    low, high = number(parts[0], name, what), number(parts[1], name, what)
    if not parts[2].strip().isdigit() or int(parts[2]) < 1:
        raise SettingError(f"{what}: {parts[2]!r} values, expected a whole number from 1")
    count = int(parts[2])
    if count > MOST:
        raise SettingError(
            f"{what}: {count} values, {8e-9 * count:.3g} GB, expected at most {MOST:.0e}"
        )
    if low == high and count > 1:
        raise SettingError(f"{what}: {count} values from {low!r} to {high!r}: the step is zero")
    if len(parts) == 4:
        if not (low > 0 and high > 0):
            raise SettingError(f"{what}: logarithmic, expected both ends above zero")
        return name, np.geomspace(low, high, count)
    return name, np.linspace(low, high, count)


def distribution(text: str) -> tuple[str, Any]:
    """NAME ~ KIND(...), as name and a frozen distribution of SciPy.  Raises SettingError."""
    what = f"--sample {text!r}"
    known = ", ".join(f"{k}({', '.join(v)})" for k, v in DISTRIBUTIONS.items())
    match = SAMPLE.match(text)
    if match is None or match["kind"] not in DISTRIBUTIONS:
        raise SettingError(f"{what}: expected NAME ~ one of {known}")
    wanted = DISTRIBUTIONS[match["kind"]]
    given = [number(v, "", what) for v in match["arguments"].split(",") if v.strip()]
    if len(given) != len(wanted):
        raise SettingError(f"{what}: expected {match['kind']}({', '.join(wanted)})")
    value = dict(zip(wanted, given, strict=True))
    low, high, mean, sd = (value.get(k, 0.0) for k in ("low", "high", "mean", "sd"))
    if "low" in value and not low < high:
        raise SettingError(f"{what}: low = {low!r}, expected less than high = {high!r}")
    if "sd" in value and not sd > 0:
        raise SettingError(f"{what}: sd = {sd!r}, expected more than zero")
    name = match["name"]
    if match["kind"] == "loguniform":
        if not low > 0:
            raise SettingError(f"{what}: low = {low!r}, expected more than zero")
        return name, stats.loguniform(low, high)
    if match["kind"] == "uniform":
        return name, stats.uniform(low, high - low)
    if match["kind"] == "normal":
        return name, stats.norm(mean, sd)
    return name, stats.truncnorm((low - mean) / sd, (high - mean) / sd, mean, sd)


def sampled(laws: Mapping[str, Any], runs: int, seed: int, plan: str = PLANS[0]) -> Values:
    """(runs, laws) values: points of the unit cube, put through the inverses of the distributions."""
    if plan == "sobol":
        unit = stats.qmc.Sobol(len(laws), rng=seed).random_base2(math.ceil(math.log2(max(runs, 1))))
        unit = unit[:runs]
    else:
        unit = stats.qmc.LatinHypercube(len(laws), rng=seed).random(runs)
    tiny = np.finfo(float).eps / 2
    unit = np.clip(unit, tiny, 1 - tiny)  # 0 would be minus infinity of a normal distribution
    return np.column_stack([law.ppf(unit[:, k]) for k, law in enumerate(laws.values())])


def from_file(path: Path) -> tuple[tuple[str, ...], Values]:
    """Names and rows of a .csv or .parquet file, a column a quantity.  Raises SettingError."""
    import pandas as pd

    if path.suffix not in (".csv", ".parquet"):
        raise SettingError(f"--from {str(path)!r}: expected a .csv or .parquet file")
    with foreign(
        lambda said: SettingError(
            f"--from {str(path)!r} cannot be read ({said}): expected finite numbers below a line of names"
        )
    ):
        csv = path.suffix == ".csv"
        frame = pd.read_csv(path, low_memory=False) if csv else parquet_of(path).to_pandas()
    names = tuple(str(c).strip() for c in frame.columns)
    values, wrong = np.zeros((len(frame), len(names))), []
    for k, name in enumerate(names):
        column = frame.iloc[:, k].astype(object)
        if name == METHOD:
            column = column.map(lambda v: NUMBERS.get(str(v).strip(), v))
        values[:, k] = [_finite(v) for v in column]
        if len(bad := np.flatnonzero(np.isnan(values[:, k]))):
            wrong.append(f"{name} in row {bad[0] + 1} is {column.iloc[bad[0]]!r}")
    if wrong or not len(frame):
        raise SettingError(
            f"--from {str(path)!r}: {'; '.join(wrong) or 'no rows'}; expected finite numbers below a "
            "line of names"
        )
    return names, values


def _finite(value: Any) -> float:
    """A number as it is, or written out; NaN for what is none."""
    try:
        found = float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan
    return found if math.isfinite(found) else math.nan


def design(
    vary: Mapping[str, Sequence[float] | Values] | None = None,
    sample: Mapping[str, Any] | None = None,
    runs: int | None = None,
    seed: int = 0,
    plan: str = PLANS[0],
    rows: tuple[Sequence[str], Values] | None = None,
    most: float = math.inf,
) -> Design:
    """All combinations of the axes `vary`, the samples and the rows.

    `sample` maps names to frozen distributions of SciPy, of which `runs` points are drawn; `most` is how many
    bytes the table may have.  Raises SettingError.
    """
    vary, sample = dict(vary or {}), dict(sample or {})
    blocks: list[tuple[tuple[str, ...], Values]] = [
        ((name,), np.asarray(values, dtype=float).reshape(-1, 1)) for name, values in vary.items()
    ]
    if plan not in PLANS:
        raise SettingError(f"sampling {plan!r} is unknown, expected one of {', '.join(PLANS)}")
    empty = [n for n, v in blocks if not len(v)]
    if empty:
        raise SettingError(f"nothing is given for {', '.join(n[0] for n in empty)}")
    if sample:
        if runs is None or not 1 <= runs <= MOST:
            size = f" ({8e-9 * runs * len(sample):.3g} GB)" if runs and runs > MOST else ""
            raise SettingError(
                f"runs = {runs!r}{size}, expected a whole number from 1 to {MOST:.0e} for the samples"
            )
    elif runs is not None:
        raise SettingError("runs is for samples, and nothing is sampled")
    names = [n for block, _ in blocks for n in block] + list(sample) + list(rows[0] if rows else ())
    twice = sorted({n for n in names if names.count(n) > 1})
    if twice:
        raise SettingError(f"{', '.join(twice)} varies in two ways")
    if not names:
        raise SettingError("nothing varies: give an axis, a sample, or rows of a file")
    count = math.prod(len(v) for _, v in blocks) * (runs or 1) * (len(rows[1]) if rows else 1)
    if count * 8 * len(names) > most:
        raise SettingError(
            f"{count:.3g} runs: their table of {len(names)} quantities alone has "
            f"{count * 8 * len(names) / 1e9:.3g} GB, expected at most {most / 1e9:.3g} GB"
        )
    if sample:
        blocks.append((tuple(sample), sampled(sample, runs or 0, seed, plan)))
    if rows:
        blocks.append((tuple(rows[0]), np.asarray(rows[1], dtype=float)))
    places = np.unravel_index(np.arange(count), [len(v) for _, v in blocks])
    table = np.hstack([v[place] for place, (_, v) in zip(places, blocks, strict=True)])
    axes = tuple((n, v[:, 0]) for (n,), v in blocks) if not (sample or rows) else ()
    return Design(tuple(names), np.ascontiguousarray(table), axes)
