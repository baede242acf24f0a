"""Runs trials in forked children of this process, several at a time.

A child inherits all modules and checked files, runs one trial, and hands its result back through a
pipe; so a trial depends neither on those before it nor on the number of workers. Whatever a block
does in it, crash, print or never return, ends with the child.
"""

from __future__ import annotations

import select
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

from diffbotctl.printable import printable
from diffbotctl.processes.limited_child import ChildEndedError, ChildLimits, LimitedChild
from diffbotctl.trials.plan import Trial
from diffbotctl.trials.trial_run import StopRecord, TrialResult, run_trial

MEMORY_MAX_BYTES = 4 << 30  # of a child: a block that fills the memory ends alone
# Processor time on a busy machine takes longer; a block that sleeps uses none.
WALL_TIME_RATIO, WALL_TIME_MIN_S = 20.0, 120.0
LOOK_PERIOD_S = 1.0  # for children that are late


class TrialOutcome(NamedTuple):
    """A result, and the time of a processor that it took (s)."""

    result: TrialResult
    processor: float


Notify = Callable[[int, TrialOutcome], None]


def run_trials(
    trials: Sequence[Trial], workers: int, processor_limit: float, notify: Notify
) -> list[TrialOutcome]:
    """Run all trials; their outcomes in the order of `trials`.

    `processor_limit`: time of a processor (s) after which a trial is ended. `notify` is called with
    the number of each trial that has ended, in no order. KeyboardInterrupt ends all children.
    """
    simulated = max((trial.time_limit for trial in trials), default=0.0)  # with programs: real time
    wall = max(WALL_TIME_RATIO * processor_limit, WALL_TIME_MIN_S + simulated)
    limits = ChildLimits(processor_limit, wall, MEMORY_MAX_BYTES)
    found: dict[int, TrialOutcome] = {}
    active: dict[LimitedChild[TrialResult], int] = {}
    waiting = list(range(len(trials)))[::-1]
    try:
        while waiting or active:
            while waiting and len(active) < workers:
                number = waiting.pop()
                child = LimitedChild(partial(_guarded, trials[number]), limits)
                active[child] = number
            ready, _, _ = select.select(list(active), [], [], LOOK_PERIOD_S)
            sent = {child for child in ready if child.receive()}
            for child in [each for each in active if each in sent or each.is_late()]:
                number = active.pop(child)
                found[number] = _outcome(trials[number], child)
                notify(number, found[number])
    finally:
        for child in active:
            child.close()
    return [found[number] for number in range(len(trials))]


def _guarded(trial: Trial) -> TrialResult:
    """The result of a trial; of one that raises, what it raised."""
    try:
        return run_trial(trial)
    except BaseException as error:
        return _crashed(trial, f"{type(error).__name__}: {error}")


def _crashed(trial: Trial, cause: str) -> TrialResult:
    return TrialResult(trial.name, trial.case, trial.robot, trial.seed, "crashed", cause)


def _outcome(trial: Trial, child: LimitedChild[TrialResult]) -> TrialOutcome:
    """The outcome of a trial whose child has ended, or is late; the texts of its code printable."""
    try:
        result = child.result()
    except ChildEndedError as error:
        result = _crashed(trial, str(error))
    stops = (StopRecord(time, code, printable(cause)) for time, code, cause in result.stops)
    result = result._replace(cause=printable(result.cause), stops=tuple(stops))
    return TrialOutcome(result, child.processor)
