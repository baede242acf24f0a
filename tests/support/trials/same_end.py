"""The simulator and the emulated board, which runs the firmware's binary, end a run alike.

Each scenario is run on both, with the same robot and seed. The exit code, the goal's end, and code
and cause of the latched stops have to be equal, and the board's rate of telemetry within 5 %.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from diffbotctl.config.load import load
from diffbotctl.drivers.simulated_robot import SimulatedRobotDriver
from diffbotctl.engine.clock import Clock, VirtualClock
from diffbotctl.graph import Sink
from diffbotctl.messages import Encoders, Goal
from diffbotctl.plant.simulated_robot import SimulatedRobot
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from diffbotctl.time import SECOND
from tests.support.trials.row import Row
from tests.support.trials.section import drawn

PORTS = ("sim", "emulated")
DURATION_S = 30.0
RATE_TOLERANCE = 0.05
DEADMAN_TOLERANCE_S = 0.03  # a frame, by which the last command before the silence may differ
NO_WALLS = ("world.walls=[]",)
AHEAD = (1.0, 0.0, None)
NUMBERS, SIDE = re.compile(r"-?\d+(\.\d+)?"), re.compile(r"\b(left|right)\b")


class Scenario(NamedTuple):
    """`sets` of the robot's simulation unless they begin with `robot.` or `world.`.

    `silence`: span (s) in which nothing that the host sends reaches the board. `is_unproven`: the
    run treats the robot as a real one whose wiring is unproven. `is_symmetric`: chance decides
    which of the wheels fails.
    """

    sets: tuple[str, ...] = ()
    goal: tuple[float, float, float | None] = AHEAD
    robot: str = "book_2wd"
    duration: float = DURATION_S
    silence: tuple[float, float] | None = None
    is_unproven: bool = False
    is_symmetric: bool = False


class RunEnd(NamedTuple):
    """How a run ended. Numbers in `causes` are replaced, since they differ by the last digit.

    `goal` is how its goal ended, without what was measured. A goal that was reached with an
    uncertain pose counts as reached.
    """

    code: int
    goal: str
    stops: tuple[str, ...]
    causes: tuple[str, ...]
    rate: float  # telemetry frames a second, from the first one on
    off_after: float = 0.0  # s from the begin of the silence until both motors were off

    def agrees(self, other: RunEnd) -> bool:
        """Whether another run ended alike."""
        rates_agree = abs(self.rate - other.rate) <= RATE_TOLERANCE * self.rate
        stops_agree = abs(self.off_after - other.off_after) <= DEADMAN_TOLERANCE_S
        return self[:4] == other[:4] and rates_agree and stops_agree


def _low_battery(volts: float) -> tuple[str, ...]:
    return (
        "robot.battery.pin=A1",
        "robot.battery.divider=3",
        "robot.battery.low=6.6 V",
        f"battery.volts={volts} V",
    )


def _crossed(*sets: str) -> Scenario:
    """Wiring with which each wheel answers the commands of the other one.

    The speed loop of a wheel that turns too fast then slows down the other wheel, whose loop makes
    the first one faster still: a small difference grows by a factor of e in some tenths of a second
    until one wheel stands. Edge times that differ by microseconds decide which. With the speed of
    proven wiring they even decide whether a leg ends before; no real robot has that.
    """
    return Scenario(sets, is_unproven=True, is_symmetric=True)


BUTTON = "robot.board.stop_button=24"

SCENARIOS: dict[str, Scenario] = {
    "straight": Scenario(),
    "behind": Scenario(goal=(-0.4, 0.0, None)),
    "pose": Scenario(goal=(0.3, 0.4, 1.0)),
    "turn in place": Scenario(goal=(0.0, 0.0, 1.5)),
    "time limit": Scenario(goal=(3.0, 0.0, None), duration=4.0),
    "wall ahead": Scenario(("world.walls=[{from: [0.6 m, -1 m], to: [0.6 m, 1 m]}]",)),
    "wall beside": Scenario(("world.walls=[{from: [0 m, 0.9 m], to: [2 m, 0.9 m]}]",)),
    "discs of 20 and 30 slots": Scenario(("robot.drive.right.encoder.slots=30",)),
    "counts board": Scenario(robot="book_2wd_counts"),
    "telemetry 20 Hz": Scenario(("robot.board.telemetry=20 Hz",)),
    "telemetry 30 Hz": Scenario(("robot.board.telemetry=30 Hz",)),
    "slow": Scenario(("robot.limits.speed=0.1 m/s",), (0.4, 0.0, None)),
    "crawling": Scenario(("robot.limits.speed=0.03 m/s",), (0.15, 0.0, None)),
    "brakes": Scenario(("robot.drive.motor.idle=brake",)),
    "short dead-man": Scenario(("robot.board.deadman=150 ms",)),
    "slow motors": Scenario(("motor.lag=[300 ms, 300 ms]",)),
    "unequal motors": Scenario(("motor.gain_spread=0.4",)),
    "stiff motors": Scenario(("motor.start_duty=[0.35, 0.4]",)),
    "sag": Scenario(("battery.sag=0.3",)),
    "second plant": Scenario(("equations=torque",)),
    "missed edges": Scenario(("encoder.missed=0.05",)),
    "doubled edges": Scenario(("encoder.doubled=0.03",)),
    "left wheel blocked": Scenario(("faults=[{fault: wheel_blocked, side: left}]",)),
    "right wheel blocked under way": Scenario(
        ("faults=[{fault: wheel_blocked, at: 2 s, side: right}]",)
    ),
    "left motor dead": Scenario(("wiring.left=dead",)),
    "both motors dead": Scenario(("wiring.left=dead", "wiring.right=dead")),
    "left encoder dead": Scenario(("wiring.left_encoder=dead",)),
    "right encoder dead, pivot": Scenario(("wiring.right_encoder=dead",), (0.0, 0.0, 2.0)),
    "motors swapped": _crossed("wiring.left=swapped", "wiring.right=swapped"),
    "encoders swapped": _crossed("wiring.encoders=swapped"),
    "low battery": Scenario(_low_battery(6.0), (4.0, 0.0, None)),
    "full battery, measured": Scenario(_low_battery(8.0)),
    "stop button": Scenario(
        (BUTTON, "faults=[{fault: stop_button, at: 2 s, for: 1 s}]"), duration=6.0
    ),
    "stop button held at the start": Scenario(
        (BUTTON, "faults=[{fault: stop_button}]"), duration=4.0
    ),
    "silent host": Scenario(silence=(2.0, 3.0)),
    "silent host, short dead-man": Scenario(("robot.board.deadman=150 ms",), silence=(1.5, 2.5)),
    "polarity unproven": Scenario(goal=(0.5, 0.0, None), is_unproven=True),
}


class CountingRun(Run):
    """A run that counts the frames of telemetry; `began`: the time (ns) of the first one."""

    frames = began = 0

    def _sinks(self) -> dict[str, list[Sink]]:
        sinks = super()._sinks()
        sinks["robot.encoders"].append(self._count)
        return sinks

    def _count(self, now: int, frame: Encoders) -> None:
        if not self.frames:
            self.began = now
        self.frames += 1


class UnprovenRun(CountingRun):
    """A run that limits the speed as on a real port."""

    @property
    def is_real(self) -> bool:
        """True: the graph is built for a real robot."""
        return True

    @is_real.setter
    def is_real(self, value: bool) -> None:
        """The port does not decide it here."""

    def _clock(self) -> Clock:
        return VirtualClock()


class InterruptedRobot:
    """A simulated robot whose commands go through `command`."""

    def __init__(self, robot: SimulatedRobot, command: Callable[..., None]) -> None:
        self._robot, self.command = robot, command

    def __getattr__(self, name: str) -> Any:
        return getattr(self._robot, name)


def _interrupt(run: Run, span: tuple[float, float]) -> list[int]:
    """Lose what the host sends in `span` (s). The list gets the time (ns) of motors off."""
    begin, end = (round(time * SECOND) for time in span)
    off_at: list[int] = []
    robot: Any = run.robot
    deliver = robot.deliver
    is_simulated = isinstance(robot, SimulatedRobotDriver)
    send = robot.robot.command if is_simulated else robot.board.send

    def lossy(now: int, *words: Any) -> None:
        if not begin <= now < end:
            send(now, *words)

    def watching(now: int) -> Any:
        deliveries = deliver(now)
        if is_simulated:
            duties = [side.duty for side in robot.robot.board.sides]
        else:
            duties = robot.board.duty
        if now > begin and not off_at and not any(duties):
            off_at.append(now)
        return deliveries

    if is_simulated:
        robot.robot = InterruptedRobot(robot.robot, lossy)
    else:
        robot.board.send = lossy
    robot.deliver = watching
    return off_at


def run_end(scenario: Scenario, port: str, seed: int) -> RunEnd:
    """Run a scenario on a port."""
    prefixes = ("robot.", "world.")
    sets = [
        text if text.startswith(prefixes) else f"robot.simulation.{text}" for text in scenario.sets
    ]
    walls = () if any(text.startswith("world.walls") for text in sets) else NO_WALLS
    options = RunOptions(
        port=port,
        goals=(Goal(0, 1, *scenario.goal),),
        seed=seed,
        fast=True,
        duration=scenario.duration,
    )
    kind = UnprovenRun if scenario.is_unproven else CountingRun
    if scenario.is_unproven:
        sets.append("robot.drive.polarity=unproven")
    run = kind(load("goal", scenario.robot, [*walls, *sets]), options, tell=lambda text: None)
    off_at = [] if scenario.silence is None else _interrupt(run, scenario.silence)
    result = run.go()
    latched = [stop for stop in result.stops if stop.latched]
    code, cause = result.ending.code, result.ending.cause
    # How well the pose is known depends on the times of the edges, whose noise differs.
    if run.operator.reached_unsure and run.operator.reached_unsure == run.operator.number:
        code, cause = 0, "all goals reached"
    causes = [NUMBERS.sub("#", stop.cause) for stop in latched]
    if scenario.is_symmetric:
        causes = [SIDE.sub("a wheel", text) for text in causes]
    return RunEnd(
        code,
        NUMBERS.sub("#", cause.partition(":")[0]),
        tuple(dict.fromkeys(stop.code for stop in latched)),
        tuple(dict.fromkeys(causes)),
        # A board with a link of its own sends only once host and board have met.
        run.frames / ((run.engine.last_instant - run.began) / SECOND),
        off_at[0] / SECOND - scenario.silence[0] if scenario.silence and off_at else 0.0,
    )


def compare(name: str, seed: int) -> tuple[RunEnd, RunEnd]:
    """The ends on both ports."""
    simulated, emulated = (run_end(SCENARIOS[name], port, seed) for port in PORTS)
    return simulated, emulated


def rows(seed: int, scenarios: int = len(SCENARIOS)) -> Iterator[Row]:
    """One row; the scenarios that differ are printed."""
    differing = 0
    chosen = drawn(SCENARIOS, scenarios, seed)
    for name in chosen:
        simulated, emulated = compare(name, seed)
        if not simulated.agrees(emulated):
            differing += 1
            print(f"        {name}: sim {simulated}, emulated {emulated}")
    count = len(chosen)
    same = count - differing
    yield Row(
        "scenarios that end alike in simulator and emulator",
        f"{same} of {count}",
        f"{count} of {count}",
        not differing,
    )
