"""Runs trials in forked children of this process, several at a time.

A child inherits all modules and checked files, runs one trial, and hands its result back through a
pipe; so a trial depends neither on those before it nor on the number of workers. Whatever a block
does in it, crash, print or never return, ends with the child.
"""

from __future__ import annotations

import os
import pickle
import select
import signal
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import NamedTuple

from diffbotctl.processes.child_process import fork
from diffbotctl.processes.limited_child import limit_child, send_result
from diffbotctl.trials.plan import Trial
from diffbotctl.trials.trial_run import TrialResult, run_trial

MEMORY_MAX_BYTES = 4 << 30  # of a child: a block that fills the memory ends alone
# Processor time on a busy machine takes longer; a block that sleeps uses none.
WALL_TIME_RATIO, WALL_TIME_MIN_S = 20.0, 120.0


class TrialOutcome(NamedTuple):
    """A result, and the time of a processor that it took (s)."""

    result: TrialResult
    processor: float


class _Worker(NamedTuple):
    number: int  # of the trial
    pid: int
    started: float
    received: bytearray


Notify = Callable[[int, TrialOutcome], None]


def run_trials(
    trials: Sequence[Trial], workers: int, processor_limit: float, notify: Notify
) -> list[TrialOutcome]:
    """Run all trials; their outcomes in the order of `trials`.

    `processor_limit`: time of a processor (s) after which a trial is ended. `notify` is called with
    the number of each trial that has ended, in no order. KeyboardInterrupt ends all children.
    """
    found: dict[int, TrialOutcome] = {}
    active: dict[int, _Worker] = {}
    waiting = list(range(len(trials)))[::-1]
    wall_limit = max(WALL_TIME_RATIO * processor_limit, WALL_TIME_MIN_S)
    try:
        while waiting or active:
            while waiting and len(active) < workers:
                file, worker = _start(waiting.pop(), trials, processor_limit)
                active[file] = worker
            for file in _ended(active, wall_limit):
                worker = active.pop(file)
                os.close(file)
                outcome = _outcome(trials[worker.number], worker, processor_limit)
                found[worker.number] = outcome
                notify(worker.number, outcome)
    finally:
        for file, worker in active.items():
            os.close(file)
            with suppress(ProcessLookupError):
                os.kill(worker.pid, signal.SIGKILL)
            os.waitpid(worker.pid, 0)
    return [found[number] for number in range(len(trials))]


def _start(number: int, trials: Sequence[Trial], processor: float) -> tuple[int, _Worker]:
    read, write = os.pipe()

    def run() -> int:
        os.close(read)
        limit_child(processor, MEMORY_MAX_BYTES)
        send_result(write, _guarded(trials[number]))
        return 0

    pid = fork(run)
    os.close(write)
    return read, _Worker(number, pid, time.monotonic(), bytearray())


def _guarded(trial: Trial) -> TrialResult:
    """The result of a trial; of one that raises, what it raised."""
    try:
        return run_trial(trial)
    except BaseException as error:
        return _crashed(trial, f"{type(error).__name__}: {error}")


def _crashed(trial: Trial, cause: str) -> TrialResult:
    return TrialResult(trial.name, trial.case, trial.robot, trial.seed, "crashed", cause)


def _ended(active: dict[int, _Worker], wall_limit: float) -> list[int]:
    """Read what the children send; the files of those that have ended."""
    ready, _, _ = select.select(list(active), [], [], 1.0)
    ended = []
    for file in ready:
        data = os.read(file, 1 << 16)
        active[file].received.extend(data)
        if not data:
            ended.append(file)
    for worker in active.values():
        if time.monotonic() - worker.started > wall_limit:
            with suppress(ProcessLookupError):
                os.kill(worker.pid, signal.SIGKILL)
    return ended


def _outcome(trial: Trial, worker: _Worker, limit: float) -> TrialOutcome:
    """The outcome of a trial whose child has ended."""
    _, status, usage = os.wait4(worker.pid, 0)
    processor = usage.ru_utime + usage.ru_stime
    try:
        result = pickle.loads(bytes(worker.received))
    except Exception:  # what a child that was killed has written is not whole
        cause = f"its process ended with exit code {os.waitstatus_to_exitcode(status)}"
        number = os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0
        if number == signal.SIGXCPU or (number == signal.SIGKILL and processor >= limit):
            cause = f"it took more than {limit:g} s of processor time: a block does not return"
        elif number:
            cause = f"its process was ended by {signal.Signals(number).name}"
        result = _crashed(trial, cause)
    return TrialOutcome(result, processor)
