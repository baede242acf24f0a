"""A node of ROS that notes when messages come and go, by the monotonic clock of this computer.

It knows nothing of diffbotctl. With the argument `echo` it only answers /ping by /pong, as little
as a node can do. With `timer` it follows commands, one JSON object a line:

{"echo": N}: send N pings; prints when each left and when its answer came.
{"arrivals": N, "topic": TOPIC}: prints when N messages of nav_msgs/Odometry came.
{"drive": N}: publish N different velocities on /cmd_vel, and a zero; prints when each left, and
what it was (m/s).
"""

import json
import sys
import time
from typing import Any

import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry

PERIOD_S = 0.05
DISCOVERY_TIMEOUT_S = 30.0
QUEUE_DEPTH = 10


def echo(node: Any) -> None:
    publisher = node.create_publisher(Odometry, "/pong", QUEUE_DEPTH)
    node.create_subscription(Odometry, "/ping", publisher.publish, QUEUE_DEPTH)
    print(json.dumps({"ready": True}), flush=True)
    rclpy.spin(node)


class TimerNode:
    def __init__(self, node: Any) -> None:
        self.node = node

    def publisher(self, kind: Any, topic: str) -> Any:
        publisher = self.node.create_publisher(kind, topic, QUEUE_DEPTH)
        deadline = time.monotonic() + DISCOVERY_TIMEOUT_S
        while not publisher.get_subscription_count():
            assert time.monotonic() < deadline, f"no node subscribes to {topic}"
            rclpy.spin_once(self.node, timeout_sec=0.02)
        return publisher

    def spin_until(self, due: float) -> None:
        while (remaining := due - time.monotonic()) > 0.0:
            rclpy.spin_once(self.node, timeout_sec=remaining)

    def arrivals_of(self, topic: str) -> list[float]:
        """A list to which the time of each arrival is added."""
        times = []
        self.node.create_subscription(
            Odometry, topic, lambda message: times.append(time.monotonic()), QUEUE_DEPTH
        )
        return times

    def echo(self, count: int) -> dict[str, list[float]]:
        came = self.arrivals_of("/pong")
        publisher, left = self.publisher(Odometry, "/ping"), []
        self.spin_until(time.monotonic() + 1.0)  # the way back is found as well
        for _ in range(count):
            left.append(time.monotonic())
            publisher.publish(Odometry())
            self.spin_until(left[-1] + PERIOD_S)
        return {"left": left, "came": came}

    def arrivals(self, count: int, topic: str) -> dict[str, list[float]]:
        came = self.arrivals_of(topic)
        while len(came) < count:
            rclpy.spin_once(self.node, timeout_sec=1.0)
        return {"came": came[:count]}

    def drive(self, count: int) -> dict[str, list[tuple[float, float]]]:
        publisher, left = self.publisher(Twist, "/cmd_vel"), []
        velocity = Twist()
        for number in range(count):
            velocity.linear.x = round(0.05 + 0.0001 * number, 6)
            left.append((time.monotonic(), velocity.linear.x))
            publisher.publish(velocity)
            self.spin_until(left[-1][0] + PERIOD_S)
        publisher.publish(Twist())
        self.spin_until(time.monotonic() + PERIOD_S)
        return {"left": left}


def main() -> None:
    rclpy.init()
    node = rclpy.create_node(f"latency_{sys.argv[1]}")
    if sys.argv[1] == "echo":
        echo(node)
        return
    timer = TimerNode(node)
    print(json.dumps({"ready": True}), flush=True)
    for line in sys.stdin:
        command = json.loads(line)
        done: dict[str, Any]
        if "echo" in command:
            done = timer.echo(command["echo"])
        elif "drive" in command:
            done = timer.drive(command["drive"])
        else:
            done = timer.arrivals(command["arrivals"], command["topic"])
        print(json.dumps({"done": done}), flush=True)
    node.destroy_node()
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()
