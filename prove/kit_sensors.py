"""Distance sensors and IMU of kits, through plant, firmware, host and stop."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import inf, sqrt
from pathlib import Path
from tempfile import TemporaryDirectory

from diffbotctl.config.load import load
from diffbotctl.emulator.process import FIRST_SONAR
from diffbotctl.geometry.distance_sensors import SHARPS
from diffbotctl.graph import Sink
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_settings import RangeInput
from diffbotctl.messages import Goal, Odometry
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from diffbotctl.time import MILLISECOND, SECOND
from tests.support.board_bench import BOOK, BoardBench
from tests.support.sensor_stops import (
    BEYOND,
    DRIVE_TIME_S,
    GAP_MIN,
    STOP_SETS,
    STOPPING_SENSORS,
    StoppingSensor,
    gap,
)
from tests.support.trials.row import Row
from tests.support.trials.section import drawn

LONG_RANGE = SHARPS["sharp_gp2y0a02yk0f"]  # the part that a sharp_custom is in the plant
OWN_CURVE = StoppingSensor(
    (
        "robot.sensors.front.type=sharp_custom",
        f"robot.sensors.front.near={LONG_RANGE.near} m",
        f"robot.sensors.front.reach={LONG_RANGE.reach} m",
        "robot.sensors.front.curve={{a: {}, b: {} m, c: {}}}".format(*LONG_RANGE.curve),
    ),
    LONG_RANGE.near,
)
ECHOES_US = (23_000, 1_000, 12_000, 400)
ECHO_PINS = ((24, 50), (25, 51), (26, 52), (27, 53))  # trigger, echo
NOTICED_MAX_S, UNSURE_SD = 0.5, 0.05
FAULT_START_S = 3.0
FAULTS = ("silent", "bus_held", "stuck")
ASIDE = Goal(0, 1, 0.6, 0.3, 1.0)


class ObservedRun(Run):
    """A run that keeps the poses of its odometry."""

    def _sinks(self) -> dict[str, list[Sink]]:
        self.poses: list[Odometry] = []
        sinks = super()._sinks()
        sinks["odometry.odometry"].append(lambda now, pose: self.poses.append(pose))
        return sinks


def rows(seed: int, sensors: int = 100) -> Iterator[Row]:
    """Sensors before a wall, four echoes in turn, and each fault of an IMU.

    `sensors`: at most as many distance sensors, and IMUs.
    """
    for name, sensor in drawn((STOPPING_SENSORS | {"own curve": OWN_CURVE}).items(), sensors, seed):
        yield obstacle_stop(name, sensor, seed)
    yield echoes_in_turn()
    for kind in drawn(("mpu6050", "lsm6dso"), sensors, seed):
        yield refused_at_the_start(kind, seed)
        yield noticed_under_way(kind, seed)


def obstacle_stop(name: str, sensor: StoppingSensor, seed: int) -> Row:
    """A drive towards a wall on the emulated board, with a goal behind it."""
    goal = Goal(0, 1, BEYOND, 0.0, 0.0)
    options = RunOptions(
        port="emulated", goals=(goal,), seed=seed, fast=True, duration=DRIVE_TIME_S
    )
    result = Run(load("goal", None, [*sensor.sets, *STOP_SETS]), options, tell=lambda _: None).go()
    assert result.truth is not None
    left_over = gap(result.truth.pose.x)
    is_met = GAP_MIN < left_over < sensor.gap_max and bool(result.ending.stopped)
    target = f"{1000 * GAP_MIN:.0f} to {1000 * sensor.gap_max:.0f} mm"
    figure = f"{1000 * left_over:.0f} mm"
    return Row(f"{name}: stops before a wall, emulated", figure, target, is_met)


def echoes_in_turn() -> Row:
    """Four HC-SR04 on a Mega; in the rig a burst ends the echo of every sensor that listens."""
    inputs = tuple(
        RangeInput(str(number), echo, trigger) for number, (trigger, echo) in enumerate(ECHO_PINS)
    )
    settings = replace(BOOK, range_channel=None, telemetry=30, further_ranges=inputs)
    with BoardBench(settings=settings) as bench:
        bench.run(
            30 * MILLISECOND,
            {FIRST_SONAR + number: width for number, width in enumerate(ECHOES_US)},
        )
        bench.ready()
        bench.wait(300)
        bench.received.clear()
        bench.wait(4000)
        received = [
            each.frame for each in bench.received if isinstance(each.frame, frames.RangeFrame)
        ]
    errors = [abs(each.value * 4 - ECHOES_US[each.sensor]) for each in received]
    worst = max(errors, default=inf)
    figure = f"{len(received)} readings, worst {worst:g} us off"
    is_met = len(received) >= 70 and worst <= 20
    return Row("four HC-SR04 do not receive each other", figure, ">= 70, <= 20 us", is_met)


def _run(kind: str, fault: str, start: float, seed: int) -> ObservedRun:
    text = (
        "format: 1\nkind: robot\ninclude: book_2wd\nboard: {telemetry: 30 Hz}\n"
        f"imu: {{type: {kind}}}\ndrive: {{polarity: checked_by_hand}}\n"
        f"simulation: {{faults: [{{fault: imu_{fault}, at: {start} s}}]}}\n"
        "calibration: {imu.scale: {value: 1.0, sd: 0.003}}\n"
    )
    with TemporaryDirectory() as folder:
        file = Path(folder) / "robot.yaml"
        file.write_text(text)
        options = RunOptions(port="emulated", goals=(ASIDE,), seed=seed, fast=True, duration=60.0)
        return ObservedRun(load("goal", str(file)), options, tell=lambda _: None)


def refused_at_the_start(kind: str, seed: int) -> Row:
    """Each fault of an IMU since the start: an error before anything moves."""
    refused, travel = 0, 0.0
    for fault in FAULTS:
        result = _run(kind, fault, 0.0, seed).go()
        assert result.truth is not None
        codes = [] if result.failure is None else [each.code for each in result.failure.problems]
        refused += codes == ["E-IMU-FAULT"]
        travel = max(travel, result.truth.travel)
    figure = f"{refused} of {len(FAULTS)}, {1000 * travel:g} mm driven"
    is_met = refused == len(FAULTS) and travel == 0.0
    return Row(f"{kind}, faults at the start: refused", figure, "all, 0 mm", is_met)


def noticed_under_way(kind: str, seed: int) -> Row:
    """Each fault while the robot drives: when the covariance widens, and how the goal ends."""
    delays, unsure, widest = [], 0, inf
    for fault in FAULTS:
        run = _run(kind, fault, FAULT_START_S, seed)
        result = run.go()
        warned = [pose for pose in run.poses if pose.warning]
        delays.append(warned[0].time / SECOND - FAULT_START_S if warned else inf)
        widest = min(widest, sqrt(warned[0].covariance[5]) if warned else 0.0)
        unsure += result.ending is not None and result.ending.code == 3
    figure = f"{max(delays):.2f} s, sd {widest:.3f} rad at once, {unsure} of {len(FAULTS)} unsure"
    is_met = max(delays) <= NOTICED_MAX_S and widest >= UNSURE_SD and unsure == len(FAULTS)
    return Row(f"{kind}, faults under way: noticed", figure, "<= 0.5 s, >= 0.05 rad, all", is_met)
