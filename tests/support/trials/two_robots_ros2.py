"""Two robots with bridges to ROS 2, and one node that drives both over a link that is cut.

Needs root, and rclpy (`make ros2`).
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from tests.support.ros2_nodes import COMMANDED_NODE, TWIST, RosNode, bridge, ros_node
from tests.support.running import moves, stands
from tests.support.trials.two_robots import (
    ADDRESSES,
    ATTEMPTS,
    CUT_S,
    OPERATOR,
    ROBOTS,
    CutOutcome,
    FarRobots,
    two_robots,
)

RATE_HZ = 20  # of the velocities, as a joystick sends them
ODOMETRY = "nav_msgs/msg/Odometry"
MOVING_MAX_S = 5.0  # until both move
SETTLE_S = 1.0  # for what was on the way, several times its delay


@contextmanager
def bridges(far: FarRobots) -> Iterator[None]:
    """A bridge beside each robot, in the namespace of its name, that finds the operator."""
    with ExitStack() as stack:
        for name in ROBOTS:
            words = ("--drive", "--namespace", name, "--frame-prefix", f"{name}/")
            stack.enter_context(
                bridge(
                    far.folder / name,
                    *words,
                    "--peer",
                    ADDRESSES[OPERATOR],
                    name=name,
                    prefix=far.network.inside(name),
                    common=far.folder,
                )
            )
        yield


def publish(node: RosNode, linear: float) -> None:
    """Publish a velocity to both robots: again and again, but a zero once."""
    for name in ROBOTS:
        fields = {"linear": {"x": linear}}
        rate = {"rate": RATE_HZ} if linear else {}
        node.command(publish=f"/{name}/cmd_vel", type=TWIST, fields=fields, **rate)
        node.reply("published")


def drive_both(far: FarRobots, node: RosNode) -> None:
    """Drive both robots until they move at the same time; a lost packet may stop one before."""
    for _ in range(ATTEMPTS):
        publish(node, 0.0)
        far.resume()
        for client in far.clients.values():
            client.until(lambda status: status["held"] is None and stands(status))
        time.sleep(SETTLE_S)
        publish(node, 0.1)
        deadline = time.monotonic() + MOVING_MAX_S
        while time.monotonic() < deadline:
            if all(moves(client.request("status")) for client in far.clients.values()):
                return
    raise AssertionError("both robots were never driven at once")


def cut_trial(folder: Path, seed: int, observed_s: float) -> CutOutcome:
    """Find both, drive both, cut the link for CUT_S while the node goes on; drive again."""
    with two_robots(folder, seed) as far, bridges(far):
        peers = tuple(ADDRESSES[name] for name in ROBOTS)
        inside = far.network.inside(OPERATOR)
        began = time.monotonic()
        with ros_node(folder, COMMANDED_NODE, "joystick", prefix=inside, peers=peers) as node:
            topics = {name: f"/{name}/odom" for name in ROBOTS}
            for topic in topics.values():
                node.command(watch=topic, type=ODOMETRY)
            node.until(lambda line: seen(node, topics.values()))
            listed_s = time.monotonic() - began
            found = tuple(name for name in ROBOTS if seen(node, [topics[name]]))
            drive_both(far, node)
            cut_at = time.monotonic()
            far.network.cut = frozenset({OPERATOR})
            time.sleep(CUT_S)
            last_motion = max(watcher.moved_at for watcher in far.watchers.values())
            statuses = [client.request("status") for client in far.clients.values()]
            healed_at = time.monotonic()
            far.network.cut = frozenset()
            time.sleep(observed_s)  # the node still publishes its velocity
            moved_after = ("the link works again",) if far.moved_since(healed_at) else ()
            drive_both(far, node)
            publish(node, 0.0)
    causes = tuple(str(status["held"] and status["held"]["code"]) for status in statuses)
    return CutOutcome(found, listed_s, last_motion - cut_at, causes, moved_after, True)


def seen(node: RosNode, topics: Iterable[str]) -> bool:
    """Whether a message of each topic has come."""
    return all(any(f'"{topic}"' in line for line in list(node.printed)) for topic in topics)
