"""Compares trials with the same ones of another pipeline, robot or setting, seed by seed."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator, Sequence
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple

from diffbotctl.config.load import takes_robot
from diffbotctl.errors import Problem, UsageError
from diffbotctl.trials.plan import TrialsPlan, read_plan
from diffbotctl.trials.statistics import ConfidenceInterval, mean_difference, paired_shares
from diffbotctl.trials.verdict import JudgedRun

WORSE_RATIO = 0.1  # of the mean: what is worse by less is no regression, though it may be proven
NAMES_SHOWN_MAX = 5
MM = 1000.0
KEYS = ("run", "passed", "outcome", "error", "time")  # of a line, which are read
UNREADABLE = "this is not what `diffbotctl trials FILE --json` printed"


class ComparedRun(NamedTuple):
    """What is compared of a run: lengths in m, times in s."""

    name: str
    passed: bool
    error: float | None
    time: float

    @staticmethod
    def of(judged: JudgedRun) -> ComparedRun:
        """Of a run that was judged now."""
        found = judged.result
        error = found.error if found.is_claimed else None
        return ComparedRun(found.name, judged.passed, error, found.time)


def other_plan(file: str, other: str, sets: Sequence[str]) -> TrialsPlan:
    """The trials of `file` with `other` in place of its own: a setting, a robot or a pipeline.

    Raises UserError as `read_plan` does.
    """
    if "=" in other:
        return read_plan(file, (*sets, other))
    return read_plan(file, sets, **{"pipeline" if takes_robot(other) else "robot": other})


def read_baseline(path: Path, names: Collection[str]) -> list[ComparedRun]:
    """The runs that `--json` once printed. Raises UsageError, also if it has none of `names`."""
    place, cause, runs = str(path), "it has none of these runs", list[ComparedRun]()
    try:
        for number, line in enumerate(path.read_text(encoding="utf-8").split("\n"), 1):
            place = f"{path}:{number}"
            runs += _compared(json.loads(line or "{}"))
        place = str(path)
    except OSError as error:
        cause = error.strerror or UNREADABLE
    except (ValueError, LookupError, TypeError, OverflowError, RecursionError):
        cause = UNREADABLE
    else:
        if any(run.name in names for run in runs):
            return runs
    fix = "write it with: diffbotctl trials FILE --json > base.json"
    raise UsageError(Problem("E-TRIALS-BASELINE", place, cause, fix))


def _compared(record: dict[str, Any]) -> list[ComparedRun]:
    """The run of a line; none of one that is of no run. Raises whatever a wrong line raises."""
    if "run" not in record:
        return []
    name, passed, outcome, error, time = (record[key] for key in KEYS)
    if not (isinstance(name, str) and isinstance(passed, bool) and isinstance(outcome, str)):
        raise TypeError
    for number in (time, time if error is None else error):
        if type(number) not in (int, float) or not isfinite(number):
            raise TypeError
    is_claimed = outcome in ("reached", "reached_unsure")
    return [ComparedRun(name, passed, error if is_claimed else None, time)]


class Comparison(NamedTuple):
    """Pairs of runs with the same seed, the other one first; `name` is what the other one is.

    `unpaired`: how many of the other's runs, and of these, have no partner.
    """

    name: str
    pairs: Sequence[tuple[ComparedRun, ComparedRun]]
    unpaired: tuple[int, int] = (0, 0)

    @property
    def lost(self) -> list[str]:
        """Runs that passed with the other, and fail."""
        return [after.name for before, after in self.pairs if before.passed and not after.passed]

    @property
    def gained(self) -> int:
        """How many runs failed with the other, and pass."""
        return sum(after.passed and not before.passed for before, after in self.pairs)

    def differences(self, field: str) -> list[tuple[float, float]]:
        """Values of both, where both reached their goals."""
        return [
            (getattr(before, field), getattr(after, field))
            for before, after in self.pairs
            if before.error is not None and after.error is not None
        ]

    def is_worse(self, field: str) -> bool:
        """Whether a mean is larger than the other's by a tenth, and this is proven."""
        values = self.differences(field)
        interval = mean_difference([after - before for before, after in values])
        mean = sum(before for before, _ in values) / max(len(values), 1)
        return interval is not None and interval.low > 0.0 and interval.value > WORSE_RATIO * mean

    @property
    def is_regression(self) -> bool:
        """Whether more runs were lost than gained, or error or time are worse."""
        return len(self.lost) > self.gained or self.is_worse("error") or self.is_worse("time")

    def lines(self) -> Iterator[str]:
        """The comparison as text."""
        count = len(self.pairs)
        yield f"against {self.name}, {count} pairs with equal seeds:"
        if any(self.unpaired):
            others, these = self.unpaired
            yield f"  without a partner of the same name: {these} of these, {others} of the other"
        before, after = (sum(pair[side].passed for pair in self.pairs) for side in (0, 1))
        share = paired_shares([(first.passed, second.passed) for first, second in self.pairs])
        yield f"  passed  {after} of {count}, against {before}: {_interval_text(share, 100.0, '%')}"
        for field, factor, unit in (("error", MM, "mm"), ("time", 1.0, "s")):
            values = self.differences(field)
            interval = mean_difference([second - first for first, second in values])
            if interval is None:
                yield f"  {field:7} reached by both in {len(values)} pairs: too few to compare"
                continue
            first, second = (
                sum(value[side] for value in values) / len(values) * factor for side in (0, 1)
            )
            text = _interval_text(interval, factor, unit)
            yield f"  {field:7} {second:.1f} {unit}, against {first:.1f} {unit}: {text}"
        if self.is_regression:
            worse = [field for field in ("error", "time") if self.is_worse(field)]
            names = ", ".join(self.lost[:NAMES_SHOWN_MAX]) or f"the {' and the '.join(worse)}"
            rest = len(self.lost) - NAMES_SHOWN_MAX
            more = f" and {rest} more" if rest > 0 else ""
            yield f"REGRESSION: worse than {self.name}: {names}{more}"


def _interval_text(interval: ConfidenceInterval, factor: float, unit: str) -> str:
    value, low, high = (each * factor for each in interval)
    proof = "proven" if interval.is_proven else "not proven"
    return f"{value:+.1f} {unit} (95 %: {low:+.1f} to {high:+.1f}; {proof})"


def compare(
    name: str, before: Sequence[ComparedRun], after: Sequence[ComparedRun], by_name: bool
) -> Comparison:
    """Pair the runs by their names, or in their order."""
    if not by_name:
        return Comparison(name, list(zip(before, after, strict=True)))
    known = {run.name: run for run in before}
    pairs = [(known[run.name], run) for run in after if run.name in known]
    return Comparison(name, pairs, (len(before) - len(pairs), len(after) - len(pairs)))
