"""A probe: one thing that is done to an FMU, and the verdict on what it did."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ...fmu.session import RefusalError
from .bench import Bench, Finding
from .player import clear

RIGHT, REFUSED, WRONG, UNFINISHED = "right", "refused", "wrong", "unfinished"
CONSISTENT = "consistent"  # right at each instant; nothing could be said of the motion's course


@dataclass(frozen=True)
class Probe:
    """`may_refuse`: false for what an FMU has to be able to do, where a refusal is wrong too; `near`: its
    values are within a factor of ten of the model's own."""

    family: str
    name: str
    do: Callable[[Bench], Finding]
    may_refuse: bool = True
    near: bool = False


@dataclass(frozen=True)
class Verdict:
    """The verdict on a probe; `closest`: the check that came nearest to its limit, `ratio` of it; `near` as
    in Probe."""

    family: str
    probe: str
    verdict: str
    detail: str
    closest: str
    ratio: float
    checks: int
    seconds: float
    near: bool = False

    @property
    def worry(self) -> bool:
        """A refusal that concerns the user: of values such as the model's own."""
        return self.verdict == REFUSED and self.near


def verdict(probe: Probe, finding: Finding, seconds: float) -> Verdict:
    """Wrong if a check fails or a refusal is unclear; else refused, if it was; else right.

    Where nothing but single instants could be judged it is only consistent.
    """
    worst = max(finding.checks, key=lambda c: c.ratio, default=None)
    closest, ratio = ("", 0.0) if worst is None else (worst.what, worst.ratio)
    answer, detail = RIGHT, finding.note
    if finding.refusal is not None:
        answer, detail = REFUSED, str(finding.refusal)
        if not clear(finding.refusal):
            answer, detail = WRONG, f"refused without a cause: {detail}"
        elif not probe.may_refuse:
            answer, detail = WRONG, f"has to be done and is refused: {detail}"
    elif not finding.checks:
        answer, detail = WRONG, "nothing could be checked"
    elif all(c.instant for c in finding.checks):
        answer = CONSISTENT
    failed = [c for c in finding.checks if not c.ratio <= 1]
    if failed:
        answer = WRONG
        told = [f"{c.what}: {c.error:.2e}, allowed {c.allowed:.2e}" for c in failed[:4]]
        told += [f"and {len(failed) - 4} more"] if len(failed) > 4 else []
        told += [f"then refused: {finding.refusal}"] if finding.refusal is not None else []
        detail = "; ".join(told)
    return Verdict(
        *(probe.family, probe.name, answer, detail, closest, ratio, len(finding.checks), seconds),
        near=probe.near,
    )


def attempt(probe: Probe, bench: Bench) -> Finding:
    """What came of it; a refusal outside a run counts as one."""
    try:
        return probe.do(bench)
    except RefusalError as refusal:
        return Finding((), refusal)
