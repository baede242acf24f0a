"""Several robots: ten turtles driven at once; the cost of ten robots in one pipeline; two with a
network each, found and lost for 5 s.

The operator reaches them through ssh (`--at`), and as a node of ROS 2 through a bridge each.
"""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial
from math import inf
from pathlib import Path
from typing import Any

from diffbotctl.config.load import load
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from tests.support.background import repeating
from tests.support.lossy_network import can_make_namespaces
from tests.support.ros2_nodes import ros_python
from tests.support.running import PlainClient, running
from tests.support.trials import two_robots, two_robots_ros2
from tests.support.trials.row import NoData, Row
from tests.support.trials.two_robots import CUT_S, DELAY_S, LOSS, ROBOTS, CutOutcome

STOP_MAX_S = 0.5
SEVERAL, COST_RATIO_MAX = 10, 11.0
FURTHER_TURTLES = range(2, 11)
TURTLE_VELOCITIES = ("operator.twist", *(f"input.turtle{n}_twist" for n in FURTHER_TURTLES))
TURTLE_POSES = ("robot.pose", *(f"turtle{n}.pose" for n in FURTHER_TURTLES))
TURTLE_WAY_M = 0.3
LINK = f"{DELAY_S * 1e3:.0f} ms, {LOSS:.0%} loss, cut {CUT_S:g} s"
BROKEN_OFF = CutOutcome((), inf, inf, (), ("it broke off",), False)
TARGET = "both, 0 in 0.5 s, nothing moves by itself"


def rows(repeats: int, simulated_s: float = 20.0) -> Iterator[Row]:
    """Ten turtles at once; the cost of ten robots over `simulated_s`, the least of `repeats`."""
    yield turtles_row()
    yield cost_row(repeats, simulated_s)


def cut_rows(trials: int, observed_s: float = 5.0) -> Iterator[Row]:
    """`trials` cuts of each kind of link, after each of which `observed_s` are looked at."""
    if not can_make_namespaces():
        yield NoData(f"two robots, {LINK}", "needs root", TARGET, True)
        return
    yield from _rows("ssh", _outcomes(two_robots.cut_trial, trials, observed_s))
    if ros_python() is None:
        yield NoData(f"two robots by ROS 2, {LINK}", "no rclpy: `make ros2`", TARGET, True)
        return
    yield from _rows("ROS 2", _outcomes(two_robots_ros2.cut_trial, trials, observed_s))


def turtles_row() -> Row:
    """The turtle that is the robot and all spawned ones, each driven by a client of its own."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with running(folder, "turtles", sets=()), ExitStack() as publishers:
            watcher = PlainClient(folder)
            for number in FURTHER_TURTLES:
                arguments = {"x": 2.0, "y": float(number)}
                watcher.request("call_action", action="canvas.spawn", arguments=arguments)
            before = _places(watcher)
            for topic in TURTLE_VELOCITIES:
                client = PlainClient(folder)
                fields = {"topic": topic, "message": {"linear": 0.5, "angular": 0.0}}
                line = json.dumps({"method": "publish", **fields})
                publishers.enter_context(repeating(partial(client.send, line), 0.05))
            watcher.until(lambda status: _moved(before, _places(watcher)) == len(before))
            moved = _moved(before, _places(watcher))
    count = len(TURTLE_VELOCITIES)
    return Row.counted("turtles driven at once", moved, count)


def _places(client: PlainClient) -> dict[str, float]:
    """The position along x of each turtle, by topic, when all have one."""
    found: dict[str, float] = {}

    def are_there(status: dict[str, Any]) -> bool:
        messages = client.request("snapshot")["messages"]
        found.update({topic: messages[topic]["x"] for topic in TURTLE_POSES if topic in messages})
        return len(found) == len(TURTLE_POSES)

    client.until(are_there)
    return found


def _moved(before: dict[str, float], after: dict[str, float]) -> int:
    return sum(after[topic] - before[topic] > TURTLE_WAY_M for topic in before)


def cost_row(repeats: int, simulated_s: float) -> Row:
    """Processor time of ten simulated robots in one pipeline, as a multiple of that of one.

    The one is the mean of the same ten alone: their seeds differ, and so does their work.
    """
    with tempfile.TemporaryDirectory() as folder:
        single, joined = (_pipeline(Path(folder), count) for count in (1, SEVERAL))
        # Alternating, so that a slow moment of the machine meets both.
        spent = [
            (
                sum(_processor_time(single, seed, simulated_s) for seed in range(SEVERAL))
                / SEVERAL,
                _processor_time(joined, 0, simulated_s),
            )
            for _ in range(repeats)
        ]
    one, several = (min(times) for times in zip(*spent, strict=True))
    figure = f"{several / one:.1f} times"
    target = f"{COST_RATIO_MAX:g} times one"
    return Row(f"{SEVERAL} simulated robots", figure, target, several <= COST_RATIO_MAX * one)


def _pipeline(folder: Path, count: int) -> str:
    robots = "".join(f"  - {{path: square, as: robot_{number}}}\n" for number in range(count))
    path = folder / f"{count}.yaml"
    path.write_text(f"format: 1\nkind: pipeline\ninclude:\n{robots}")
    return str(path)


def _processor_time(pipeline: str, seed: int, seconds: float) -> float:
    run = Run(load(pipeline), RunOptions(seed=seed, fast=True, duration=seconds, stay=True))
    began = time.process_time()
    run.go()
    return time.process_time() - began


def _outcomes(
    trial: Callable[[Path, int, float], CutOutcome], trials: int, observed_s: float
) -> list[CutOutcome]:
    """The outcomes; a trial that breaks off counts as one in which everything is missed."""
    outcomes = []
    for seed in range(trials):
        with tempfile.TemporaryDirectory() as name:
            try:
                outcomes.append(trial(Path(name), seed, observed_s))
            except (AssertionError, OSError, ValueError) as error:
                print(f"trial {seed} of two robots broke off: {error}", flush=True)
                outcomes.append(BROKEN_OFF)
    return outcomes


def _rows(way: str, outcomes: list[CutOutcome]) -> Iterator[Row]:
    count = len(outcomes)
    found = sum(outcome.found == ROBOTS for outcome in outcomes)
    slowest = max(outcome.listed_s for outcome in outcomes)
    yield Row(
        f"two robots by {way}, {LINK}: found",
        f"{found} of {count}, {slowest:.1f} s at most",
        "both",
        found == count,
    )
    worst = max(outcome.stop_s for outcome in outcomes)
    right = sum(
        outcome.stop_s <= STOP_MAX_S and set(outcome.causes) == {"operator_lost"}
        for outcome in outcomes
    )
    yield Row(
        f"two robots by {way}: wheels 0 after the cut, latched",
        f"{right} of {count}, {worst:.2f} s at most",
        f"all, <= {STOP_MAX_S:g} s",
        right == count,
    )
    still = sum(not outcome.moved_after for outcome in outcomes)
    events = {event for outcome in outcomes for event in outcome.moved_after}
    yield Row(
        f"two robots by {way}: none moves by itself afterwards",
        f"{still} of {count} {', '.join(sorted(events))}".rstrip(),
        "all",
        still == count,
    )
    again = sum(outcome.drives_again for outcome in outcomes)
    yield Row.counted(f"two robots by {way}: both are driven again", again, count)
