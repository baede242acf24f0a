"""What the bridge to ROS 2 adds to the time of a message, beside a node that only echoes.

Out: from a message at a client of the control socket to the same one at a subscriber of ROS. In:
from a velocity at its publisher to that velocity at a client of the control socket, less the time
that it takes from another client. The bridge takes one message and publishes one; so does the echo,
whose round trip is the measure for both.
"""

from __future__ import annotations

import json
import threading
import time
from bisect import bisect_right
from contextlib import suppress
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from tests.support.ros2_nodes import RosNode, bridge, ros_node
from tests.support.running import PlainClient, running

NODE = Path(__file__).parent.parent / "ros2_timed_node.py"
MESSAGES, PERIOD_S = 200, 0.05
# The subscriber of ROS may read a message before our client of the socket does, on a busy computer;
# more would be the next one of 40 Hz.
EARLY_S = 0.005
TWIST = "operator.twist"
# Commands of clients wake a simulation only where it has inputs; a real robot's engine always.
PIPELINE = "format: 1\nkind: pipeline\ninclude: standby\ninputs: {back: {type: Text}}\n"


class BridgeLatency(NamedTuple):
    """Medians in s, of at least this many messages."""

    echo: float
    out: float
    into: float
    messages: int


def bridge_latency(folder: Path) -> BridgeLatency:
    """Measure the echo, and the bridge of a simulated robot at 40 Hz, in one run."""
    pipeline = folder / "woken.yaml"
    pipeline.write_text(PIPELINE)
    with (
        running(folder, str(pipeline), "--stay"),
        bridge(folder, "--drive"),
        ros_node(folder, NODE, "echo"),
        ros_node(folder, NODE, "timer") as node,
    ):
        trips = _ask(node, echo=MESSAGES)
        odometry, twists = _Arrivals(folder, "odometry.odometry"), _Arrivals(folder, TWIST)
        arrivals = _ask(node, arrivals=MESSAGES, topic="/odom")["came"]
        left = _ask(node, drive=MESSAGES)["left"]
        own = _drive(folder)
    echo = [came - went for went, came in zip(trips["left"], trips["came"], strict=False)]
    times = [moment for moment, _ in odometry.came]
    out = [
        came - since for came in arrivals if (since := _before(times, came + EARLY_S)) is not None
    ]
    into, directly = _delays(left, twists), _delays(own, twists)
    added = median(into) - median(directly)
    count = min(map(len, (echo, out, into, directly)))
    return BridgeLatency(median(echo), median(out), added, count)


def _ask(node: RosNode, **command: Any) -> Any:
    node.send(json.dumps(command))
    return node.reply("done")


def _drive(folder: Path) -> list[tuple[float, float]]:
    """Drive as the node does, as a client of the control socket: when each left, and its m/s."""
    client, left = PlainClient(folder), []
    client.request("resume")  # a busy computer may have stopped the robot
    for number in range(MESSAGES):
        speed = round(-0.05 - 0.0001 * number, 6)
        left.append((time.monotonic(), speed))
        client.request("drive", linear=speed, angular=0.0)
        time.sleep(max(left[-1][0] + PERIOD_S - time.monotonic(), 0.0))
    client.request("release")
    client.close()
    return left


def _delays(left: list[tuple[float, float]], twists: _Arrivals) -> list[float]:
    """Of the velocities that came. The bridge repeats one: the first one of each counts."""
    first: dict[float, float] = {}
    for moment, message in twists.came:
        first.setdefault(round(message["linear"], 6), moment)
    return [first[speed] - went for went, speed in left if speed in first]


def _before(times: list[float], moment: float) -> float | None:
    """The last of the ascending times up to `moment`."""
    place = bisect_right(times, moment)
    return times[place - 1] if place else None


class _Arrivals:
    """The messages of a wire at a client of the control socket, and when they came."""

    def __init__(self, folder: Path, wire: str) -> None:
        self.came: list[tuple[float, dict[str, Any]]] = []
        self.client = PlainClient(folder)
        self.client.request("subscribe", topic=wire)
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        with suppress(OSError):  # it was silent for long
            while (line := self.client.read()) is not None:
                if "message" in line:
                    self.came.append((time.monotonic(), line["message"]))
