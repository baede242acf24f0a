"""The board restarts under a goal: it stops, reports the cause, and goes on only after `resume`."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterator
from math import hypot, pi
from random import Random
from typing import Any, NamedTuple

from diffbotctl.config.load import load
from diffbotctl.emulator.emulated_robot import EmulatedRobotDriver, emulated_robot_driver
from diffbotctl.emulator.process import BROWNOUT, LINE, Emulator
from diffbotctl.engine.driver import Delivery
from diffbotctl.graph import Sink
from diffbotctl.links.diffbot_frames import ResetCode
from diffbotctl.messages import Goal, Odometry, Text
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.robot_run import PortRobot
from diffbotctl.runs.run import Run
from diffbotctl.time import MILLISECOND as MS
from tests.support.board_bench import trial_board
from tests.support.trials.row import Row

LONGEST = 60.0  # s of virtual time for the goal, the wait included
OFF_WITHIN = 320 * MS
WAIT = 2_000 * MS  # before the operator consents: far more than any stop takes
# m; a program that hangs drives on for 0.1 s, or 0.13 s if its interrupts are off, and no one
# counts. With a frame of 25 ms before and 12 mm of rolling out that is 60 mm at 0.3 m/s; the
# odometry assumes the 37 mm of a reset that takes effect at once.
STEP_MOST = 0.040
MISHAPS: dict[str, Callable[[Emulator], None]] = {
    "line": lambda emulator: emulator.reset(LINE),
    "brownout": lambda emulator: emulator.reset(BROWNOUT),
    "watchdog": lambda emulator: emulator.hang(),
}


class Seen(NamedTuple):
    """What one restart came to."""

    stopped: bool
    """both motors off in time, and until `resume`"""
    reported: bool
    """the run held a latched stop, and a text named the cause"""
    step: float
    """m; longest step of the odometry's error from the restart to `resume`: a difference of counts
    across the restart would be a jump"""
    later_step: float
    """m; longest step after `resume`: a better estimate of the phase at the restart turns the path
    since, and 2 mm of one wheel move the end of a metre by 20 mm"""
    waited: bool
    """the goal was still under way after the wait, and reached after `resume`, if with an uncertain
    pose: nothing is known of the wheels while the board restarts"""


class Struck:
    """The emulated robot, to which something happens at `at`; WAIT later the operator resumes."""

    def __init__(self, robot: EmulatedRobotDriver, run: StruckRun) -> None:
        self._robot, self._run = robot, run

    def __getattr__(self, name: str) -> Any:
        return getattr(self._robot, name)

    def deliver(self, now: int) -> list[Delivery]:
        """As the robot does, and what happens meanwhile."""
        run, board = self._run, self._robot.board
        if not run.struck and now >= run.at:
            run.struck = True
            MISHAPS[run.kind](board.emulator)
        received = self._robot.deliver(now)
        run.truth.append((board.now, board.plant.chassis.x, board.plant.chassis.y))
        if run.struck and not run.resumed:
            if now >= run.at + OFF_WITHIN and board.duty != [0.0, 0.0]:
                run.still = False
            if now >= run.at + WAIT:
                run.consent(now)
        return received


class StruckRun(Run):
    """A run of the packaged goal pipeline whose board restarts in motion."""

    def __init__(self, kind: str, at: int, goal: Goal, seed: int) -> None:
        self.kind, self.at = kind, at
        self.struck = self.resumed = False
        self.still, self.waited, self.held = True, False, False
        self.texts: list[str] = []
        self.step = self.later_step = 0.0
        self.truth: list[tuple[int, float, float]] = []  # ns, m
        self._last: tuple[float, float] | None = None  # error of the last message, m
        super().__init__(
            load("goal", trial_board().robot, (), real=False),
            RunOptions(port="emulated", goals=(goal,), seed=seed, fast=True, duration=LONGEST),
            tell=lambda _: None,
        )

    def consent(self, now: int) -> None:
        """What the operator finds, and `resume`."""
        holding = self.operator.stops_in_force.values()
        self.held = any(stop.code == "board_restart" and stop.latched for stop in holding)
        self.waited = self.operator.reached == 0 and self.operator.active is not None
        self.resumed = True
        self.operator.resume(now)

    def _open_robot(self) -> PortRobot:
        robot = emulated_robot_driver(self.configuration, self.options.seed)
        return PortRobot(Struck(robot, self), robot.robot)

    def _sinks(self) -> dict[str, list[Sink]]:
        sinks = super()._sinks()
        sinks.setdefault("robot.text", []).append(self._note_text)
        sinks.setdefault("odometry.odometry", []).append(self._note_step)
        return sinks

    def _note_text(self, _now: int, text: Text) -> None:
        self.texts.append(text.text)

    def _note_step(self, _now: int, odometry: Odometry) -> None:
        if not self.truth:
            return
        _, x, y = self.truth[max(bisect_left(self.truth, (odometry.time,)) - 1, 0)]
        last, self._last = self._last, (odometry.x - x, odometry.y - y)
        if last is None or not self.struck:
            return
        step = hypot(self._last[0] - last[0], self._last[1] - last[1])
        if self.resumed:
            self.later_step = max(self.later_step, step)
        else:
            self.step = max(self.step, step)


def rows(seed: int, count: int) -> Iterator[Row]:
    """Reset line, brown-out and a hung program in turn, at a random moment of the way."""
    rng = Random(seed)
    kinds = list(MISHAPS)
    seen = [one(kinds[n % len(kinds)], rng, seed * 1000 + n) for n in range(count)]
    for name, each in (
        ("stop until `resume`", lambda s: s.stopped),
        ("reason shown", lambda s: s.reported),
        ("the goal waits for `resume`", lambda s: s.waited),
    ):
        good = sum(map(each, seen))
        yield Row.counted(f"board restart under a goal: {name}", good, count)
    step = 1000 * max(each.step for each in seen)
    later = 1000 * max(each.later_step for each in seen)
    yield Row(
        "the same, counts re-based: longest step of the odometry's error until `resume`",
        f"{step:.1f} mm (later {later:.1f} mm)",
        f"<= {STEP_MOST * 1000:.0f} mm",
        step <= STEP_MOST * 1000,
    )


def one(kind: str, rng: Random, seed: int) -> Seen:
    """One run."""
    at = round(rng.uniform(1.5, 4.0) * 1000) * MS
    goal = Goal(0, 1, 1.5, rng.uniform(-0.5, 0.5), rng.uniform(-pi, pi))
    run = StruckRun(kind, at, goal, seed)
    result = run.go()
    return Seen(
        stopped=run.struck and run.still,
        reported=run.held and any(ResetCode[kind.upper()].meaning in text for text in run.texts),
        step=run.step,
        later_step=run.later_step,
        waited=run.waited and result.reached + run.operator.reached_unsure == 1,
    )
