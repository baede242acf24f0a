"""A host that does not run while a stock board drives: suspended, hanging, or without its watchdog.

In real time, on a pseudo-terminal. The board loses frames as the real client library does, and its
bytes wait in the kernel at 9600 baud, so that a host is often cut off within a frame.
"""

from __future__ import annotations

import os
import pty
import signal
import subprocess
import sys
import tempfile
import time
import tty
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from random import Random
from typing import NamedTuple

from diffbotctl.block import Block, In, Out
from diffbotctl.messages import Twist
from diffbotctl.params import Param
from diffbotctl.time import SECOND
from tests.support.book_board import STOCK
from tests.support.command_process import children_of, command_line_with_block, start_in_pipe
from tests.support.rosserial_device import RosserialDevice, RosserialDevicePort
from tests.support.trials.row import Row
from tests.support.trials.section import drawn

STOP_TARGET_S = 0.5  # from the fault to PWM 0 on both motors
HANGING_BLOCK = "tests.support.trials.host_freeze:Hangs"  # also where this file is `__main__`
START_TIMEOUT_S = 40.0
START_ATTEMPTS = 3
OVERLOADED = "STOP host_frozen"
WATCH_TIME_S = 6.0  # after the fault; the longest time in which the motors are waited for
REST_TIME_S = 0.7  # PWM 0 counts as off when it stays so
HANGS = "the block hangs now"  # on the output of a block that does
WATCHDOG_SILENCE_S = 2.0  # heartbeats without an answer for one second, and the stop
PARALLEL_TRIALS = 3  # each waits most of the time
RESUMED_TIME_S = 2.0  # during which a host that runs again must not drive


class FreezeOutcome(NamedTuple):
    """`stop_s`: time until both motors were off for good, None if never.

    `stays`: still off after the host ran again. `output`: of the host.
    """

    stop_s: float | None
    stays: bool
    output: str


class Stand:
    """A stock board on a pseudo-terminal, and one run of diffbotctl that drives it."""

    def __init__(self, seed: int) -> None:
        self.board, self.host = pty.openpty()
        tty.setraw(self.host)
        self.device = RosserialDevice(seed, straddle=True)
        self.driven_at = 0  # ns, the last time at which a motor was on
        self.now = 0
        self.port = RosserialDevicePort(self.device, self.board, self._look)
        self.process: subprocess.Popen[str] | None = None

    def _look(self, now: int) -> None:
        self.now = now
        if any(self.device.pwm):
            self.driven_at = now

    def start(self, words: list[str]) -> subprocess.Popen[str]:
        """Start a run; returns when both motors are on.

        An overloaded computer stops the robot before the trial has begun: then it begins again.
        """
        line = [*words, "--port", os.ttyname(self.host), *STOCK]
        attempts_left = START_ATTEMPTS
        while True:
            attempts_left -= 1
            self.process = process = start_in_pipe(line, start_new_session=True)
            if self.wait(lambda: all(self.device.pwm), START_TIMEOUT_S):
                return process
            output = self.end()
            assert attempts_left and OVERLOADED in output, output

    def drive_for(self, seconds: float) -> None:
        """Let it drive; both motors are on at the end, also after a stop that ended by itself."""
        time.sleep(seconds)
        assert self.wait(lambda: all(self.device.pwm), START_TIMEOUT_S), self.end()

    def wait(self, holds: Callable[[], bool], seconds: float) -> bool:
        """Wait until `holds`; False when it has not come true in time."""
        deadline = time.monotonic() + seconds
        while not holds():
            if time.monotonic() > deadline:
                return False
            time.sleep(0.002)
        return True

    def time_to_stop(self, since: int) -> float | None:
        """Seconds from `since` until both motors were off for REST_TIME_S; None if they stay on."""
        rest = round(REST_TIME_S * 1e9)
        off = self.wait(lambda: self.now - max(self.driven_at, since) > rest, WATCH_TIME_S)
        return max(0, self.driven_at - since) / 1e9 if off else None

    def end(self) -> str:
        """End the run, if it has not ended; returns its output."""
        process, self.process = self.process, None
        if process is None:
            return ""
        with suppress(ProcessLookupError):
            process.send_signal(signal.SIGCONT)
            process.terminate()
        try:
            return process.communicate(timeout=20)[0]
        except subprocess.TimeoutExpired:
            process.kill()
            return process.communicate()[0]


@contextmanager
def stand(seed: int) -> Iterator[Stand]:
    """A stand that is cleared away at the end."""
    place = Stand(seed)
    try:
        with place.port:
            try:
                yield place
            finally:
                place.end()
    finally:
        os.close(place.host)
        os.close(place.board)


PROGRAM = [sys.executable, "-m", "diffbotctl", "run", "goal", "--goal", "9 0"]


def watchdog_of(process: subprocess.Popen[str]) -> int:
    """The pid of the watchdog process: the child in a session of its own."""
    return next(child for child in children_of(process.pid) if os.getsid(child) == child)


def frozen(seed: int, whole_group: bool = False) -> FreezeOutcome:
    """SIGSTOP to the engine, or to its process group; later SIGCONT.

    The moment is random, so that the freeze also falls into a frame that is under way.
    """
    rng = Random(seed)
    with stand(seed) as place:
        process = place.start(PROGRAM)
        place.drive_for(rng.uniform(0.0, 1.0))
        target = -process.pid if whole_group else process.pid
        send = os.killpg if whole_group else os.kill
        since = place.now
        send(abs(target), signal.SIGSTOP)
        stop_s = place.time_to_stop(since)
        send(abs(target), signal.SIGCONT)
        resumed = place.now
        time.sleep(RESUMED_TIME_S)
        stays = place.driven_at < resumed
        return FreezeOutcome(stop_s, stays, place.end())


HANGING_PIPELINE = """\
format: 1
kind: pipeline
robot: {in: {wheels: kinematics.wheels}}
blocks:
  odometry:   {block: odometry,      in: {encoders: robot.encoders}}
  follower:   {block: goal_follower, in: {odometry: odometry.odometry, goal: operator.goal},
               with: {tolerance: 20 mm}}
  hangs:      {block: hangs,         in: {requested: follower.twist}}
  limiter:    {block: speed_limiter, in: {twist: hangs.twist}}
  kinematics: {block: diff_drive,    in: {twist: limiter.twist}}
"""
HANG_TIME_S = 2.5


class Hangs(Block):
    """Pass the twist; after `after` seconds of the run, do not return for a long time."""

    after = Param(float, default=3.0, unit="s", above=0.0, help="Time at which it hangs.")
    requested = In(Twist)
    twist = Out(Twist)

    def reset(self) -> None:
        self.has_hung = False

    def react(self, now: int, requested: Twist | None) -> Twist | None:
        if now > self.after * SECOND and not self.has_hung:
            self.has_hung = True
            print(HANGS, flush=True)
            time.sleep(HANG_TIME_S)
        return requested


def hanging(seed: int) -> FreezeOutcome:
    """A block hangs while the robot drives: the loop is alive as a process, but does not run."""
    after = Random(seed).uniform(4.0, 6.0)
    with stand(seed) as place, tempfile.TemporaryDirectory() as folder:
        pipeline = Path(folder) / "hanging.yaml"
        pipeline.write_text(HANGING_PIPELINE)
        words = ("run", pipeline, "--goal", "9 0", "--set", f"hangs.after={after:.3f} s")
        process = place.start(command_line_with_block("hangs", HANGING_BLOCK, *words))
        assert process.stdout is not None
        for line in process.stdout:
            if HANGS in line:
                break
        since = place.now
        stop_s = place.time_to_stop(since)
        stopped = place.now
        time.sleep(HANG_TIME_S + 1.0)
        return FreezeOutcome(stop_s, place.driven_at < stopped, place.end())


def watchdog_signalled(seed: int, number: int) -> FreezeOutcome:
    """A signal to the watchdog process: the engine has to notice, and stop."""
    with stand(seed) as place:
        process = place.start(PROGRAM)
        place.drive_for(Random(seed).uniform(0.0, 1.0))
        since = place.now
        os.kill(watchdog_of(process), number)
        stop_s = place.time_to_stop(since)
        stays = place.driven_at < place.now - round(REST_TIME_S * 1e9)
        with suppress(subprocess.TimeoutExpired):
            process.wait(10)
        return FreezeOutcome(stop_s, stays, place.end())


class Kind(NamedTuple):
    """One kind of trial, its target in s, and the share of the trials that it gets."""

    name: str
    target: float
    share: float
    trial: Callable[[int], FreezeOutcome]


KINDS = (
    Kind("engine suspended (SIGSTOP)", STOP_TARGET_S, 1.0, frozen),
    Kind("a block hangs", STOP_TARGET_S, 0.3, hanging),
    Kind("its process group suspended", STOP_TARGET_S, 0.3, lambda seed: frozen(seed, True)),
    Kind(
        "watchdog killed",
        STOP_TARGET_S,
        0.3,
        lambda seed: watchdog_signalled(seed, signal.SIGKILL),
    ),
    Kind(
        "watchdog suspended",
        WATCHDOG_SILENCE_S,
        0.3,
        lambda seed: watchdog_signalled(seed, signal.SIGSTOP),
    ),
)


def rows(seed: int, trials: int, kinds: int = len(KINDS)) -> Iterator[Row]:
    """One row for each kind."""
    for kind in drawn(KINDS, kinds, seed):
        rng = Random(f"{seed} {kind.name}")
        seeds = [rng.getrandbits(31) for _ in range(max(1, round(trials * kind.share)))]
        with ThreadPoolExecutor(PARALLEL_TRIALS) as pool:
            outcomes = list(pool.map(kind.trial, seeds))
        times = [outcome.stop_s for outcome in outcomes]
        good = sum(
            outcome.stop_s is not None and outcome.stop_s <= kind.target and outcome.stays
            for outcome in outcomes
        )
        worst = max(WATCH_TIME_S if stop_s is None else stop_s for stop_s in times)
        yield Row(
            f"stock board, {kind.name}: motors off",
            f"{good} of {len(seeds)}, {worst:.2f} s",
            f"all within {kind.target:g} s, and off until `resume`",
            good == len(seeds),
        )
