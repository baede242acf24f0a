"""The bridge to ROS 2: load, delay, and what happens when somebody fails while the robot moves."""

from __future__ import annotations

import json
import signal
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import median
from subprocess import Popen
from typing import NamedTuple

from tests.support.command_process import processor_s
from tests.support.ros2_nodes import (
    COMMANDED_NODE,
    TWIST,
    RosNode,
    bridge,
    ros_node,
    ros_python,
)
from tests.support.running import PlainClient, moves, running, stands
from tests.support.trials.bridge_latency import MESSAGES, bridge_latency
from tests.support.trials.row import NoData, Row

STOP_MAX_S, CPU_MAX = 0.5, 0.05
OUT_MAX, IN_MAX = 2.0, 1.5


def rows(repeats: int, load_s: float = 10.0) -> Iterator[Row]:
    """All rows; each failure is repeated `repeats` times."""
    if ros_python() is None:
        yield NoData("bridge to ROS 2", "no rclpy", "`make ros2` installs it", True)
        return
    yield load_row(load_s)
    yield latency_row()
    for name, fail in FAILURES.items():
        yield failure_row(name, fail, repeats)


def publish(node: RosNode, linear: float, **options: float) -> None:
    """Publish a velocity, with `rate` again and again."""
    fields = {"linear": {"x": linear}}
    node.command(publish="/cmd_vel", type=TWIST, fields=fields, **options)
    node.reply("published")


def load_row(seconds: float) -> Row:
    """Processor time of the bridge at 38 Hz of telemetry, with one watching node."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with (
            running(folder, "standby", "--stay"),
            bridge(folder) as process,
            ros_node(folder, COMMANDED_NODE, "watcher") as node,
        ):
            node.command(watch="/odom", type="nav_msgs/msg/Odometry")
            node.reply("/odom")
            before = processor_s(process.process.pid)
            time.sleep(seconds)
            load = (processor_s(process.process.pid) - before) / seconds
    return Row(
        "bridge: processor load at 38 Hz", f"{load:.1%}", "<= 5 % of a core", load <= CPU_MAX
    )


def latency_row() -> Row:
    """What the bridge adds to the time of a message, over the round trip of a bare echo."""
    with tempfile.TemporaryDirectory() as name:
        found = bridge_latency(Path(name))
    out, into = found.out / found.echo, found.into / found.echo
    return Row(
        "bridge: time added to ROS / from ROS, p50 over an echo's",
        f"{found.out * 1e3:.2f} ms ({out:.1f}x) / {found.into * 1e3:.2f} ms ({into:.1f}x); "
        f"echo {found.echo * 1e3:.2f} ms; {found.messages} of {MESSAGES} messages",
        f"<= {OUT_MAX:g}x / <= {IN_MAX:g}x",
        out <= OUT_MAX and into <= IN_MAX and found.messages >= MESSAGES // 2,
    )


class Trial(NamedTuple):
    """The processes of a trial: the bridge, the node that drives, and one that does not yet."""

    bridge: Popen[str]
    teleop: RosNode
    other: RosNode


Fail = Callable[[Trial], float]  # the monotonic time at which it failed


def failure_row(name: str, fail: Fail, repeats: int) -> Row:
    """How long the wheels were commanded to move after the failure, and whether it is latched."""
    delays = [_failure(name, fail) for _ in range(repeats)]
    met = sum(delay is not None and delay <= STOP_MAX_S for delay in delays)
    known = [delay for delay in delays if delay is not None]
    slowest = f", slowest {max(known):.2f} s, median {median(known):.2f} s" if known else ""
    figure = f"{met} of {repeats}{slowest}"
    return Row(name, figure, "wheels 0 in 0.5 s, latched, named: all", met == repeats)


def _failure(what: str, fail: Fail) -> float | None:
    """Seconds from the failure to wheels commanded to zero.

    None where that was not latched with the name of who failed, or where the trial broke off.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        try:
            with (
                running(folder, "standby", "--stay"),
                bridge(folder, "--drive") as process,
                ros_node(folder, COMMANDED_NODE, "teleop") as teleop,
                ros_node(folder, COMMANDED_NODE, "other") as other,
            ):
                return _delay(folder, Trial(process.process, teleop, other), fail)
        except (AssertionError, OSError, ValueError) as error:
            print(f"a trial of '{what}' broke off: {error}", flush=True)
            return None


def _delay(folder: Path, trial: Trial, fail: Fail) -> float | None:
    client, stream = PlainClient(folder), PlainClient(folder)
    publish(trial.teleop, 0.2, rate=20)
    client.until(moves)
    stream.request("subscribe", topic="gate.wheels")
    began = fail(trial)
    delay = wait_for_zero(stream) - began
    status = client.until(lambda status: status["held"] and stands(status))
    held = status["held"]
    named = any(word in held["cause"] for word in ("teleop", "ros2 bridge"))
    for each in (trial.bridge, trial.teleop.process):
        each.send_signal(signal.SIGCONT)
    return delay if held["latched"] and named else None


def wait_for_zero(stream: PlainClient) -> float:
    """The monotonic time at which the first command of zero to the wheels came."""
    while (line := stream.read()) is not None:
        message = line.get("message", {})
        if message.get("left") == 0.0 and message.get("right") == 0.0:
            return time.monotonic()
    raise AssertionError("the run has ended")


def kill_teleop(trial: Trial) -> float:
    """The node is killed."""
    began = time.monotonic()
    trial.teleop.process.kill()
    return began


def freeze_teleop(trial: Trial) -> float:
    """The node is suspended."""
    began = time.monotonic()
    trial.teleop.process.send_signal(signal.SIGSTOP)
    return began


def kill_bridge(trial: Trial) -> float:
    """The bridge is killed."""
    began = time.monotonic()
    trial.bridge.kill()
    return began


def freeze_bridge(trial: Trial) -> float:
    """The bridge is suspended."""
    began = time.monotonic()
    trial.bridge.send_signal(signal.SIGSTOP)
    return began


def flood(trial: Trial) -> float:
    """The node publishes as fast as it can."""
    fields = {"linear": {"x": 0.2}}
    command = {"publish": "/cmd_vel", "type": TWIST, "fields": fields, "rate": 10_000}
    began = time.monotonic()
    trial.teleop.send(json.dumps(command))
    return began


def second_publisher(trial: Trial) -> float:
    """Another node publishes, too, from its first message on."""
    fields = {"linear": {"x": 0.1}}
    command = {"publish": "/cmd_vel", "type": TWIST, "fields": fields, "rate": 20}
    trial.other.send(json.dumps(command))
    trial.other.reply("published")
    return time.monotonic()


FAILURES: dict[str, Fail] = {
    "teleop node killed": kill_teleop,
    "teleop node frozen": freeze_teleop,
    "bridge killed": kill_bridge,
    "bridge frozen": freeze_bridge,
    "teleop node floods": flood,
    "two nodes publish": second_publisher,
}
