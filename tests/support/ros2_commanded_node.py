"""A node of ROS that follows commands, one JSON object a line; it knows nothing of diffbotctl.

{"watch": TOPIC, "type": "nav_msgs/msg/Odometry", "qos": "sensor" | "latched" | ""}
{"publish": TOPIC, "type": TYPE, "fields": {...}, "rate": HZ, "count": N}
{"call": SERVICE} (std_srvs/Trigger); {"set": PARAMETER, "value": VALUE}; {"hash": TOPIC}
"""

import json
import math
import sys
import threading
import time
from importlib import import_module
from typing import Any

import rclpy
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from std_srvs.srv import Trigger

LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
PROFILES = {"": 10, "sensor": qos_profile_sensor_data, "latched": LATCHED}


def say(**fields: object) -> None:
    sys.stdout.write(json.dumps(fields) + "\n")  # one write: several threads print
    sys.stdout.flush()


def plain(value: Any) -> Any:
    """A ROS message as JSON; bytes as whole numbers, numbers that are not finite as texts."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, bytes):
        return list(value)
    if isinstance(value, str | bool | int):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    return [plain(each) for each in value] if hasattr(value, "__iter__") else float(value)


def fill(message: Any, fields: dict[str, Any]) -> Any:
    for name, value in fields.items():
        if isinstance(value, dict):
            fill(getattr(message, name), value)
        else:
            setattr(
                message,
                name,
                float(value) if isinstance(value, str | int) and name in "xyzw" else value,
            )
    return message


def kind_of(name: str) -> Any:
    package, folder, kind = name.split("/")
    return getattr(import_module(f"{package}.{folder}"), kind)


class CommandedNode:
    def __init__(self, name: str) -> None:
        rclpy.init()
        self.node = rclpy.create_node(name)
        self.publishers: dict[str, Any] = {}
        self.subscriptions: list[Any] = []
        self.repeats: dict[str, threading.Event] = {}
        threading.Thread(target=rclpy.spin, args=(self.node,), daemon=True).start()

    def follow(self, command: dict[str, Any]) -> None:
        for verb in ("watch", "publish", "call", "set", "hash"):
            if verb in command:
                getattr(self, verb)(command)

    def watch(self, command: dict[str, Any]) -> None:
        topic = command["watch"]
        self.subscriptions.append(
            self.node.create_subscription(
                kind_of(command["type"]),
                topic,
                lambda message: say(**{topic: plain(message)}),
                PROFILES[command.get("qos", "")],
            )
        )

    def publish(self, command: dict[str, Any]) -> None:
        """Publish once, `count` times, or until the next command for the topic with `rate`."""
        topic, kind = command["publish"], kind_of(command["type"])
        if topic not in self.publishers:
            self.publishers[topic] = self.node.create_publisher(kind, topic, 10)
            deadline = time.monotonic() + 30
            while not self.publishers[topic].get_subscription_count():
                assert time.monotonic() < deadline, "no node subscribes"
                time.sleep(0.02)
        message = fill(kind(), command["fields"])
        self.repeats.pop(topic, threading.Event()).set()
        self.publishers[topic].publish(message)
        if "rate" in command:
            over = self.repeats[topic] = threading.Event()
            args = (topic, message, command["rate"], over)
            threading.Thread(target=self.repeat, args=args, daemon=True).start()
        say(published=topic)

    def repeat(self, topic: str, message: Any, rate: float, over: threading.Event) -> None:
        """Publish at this rate also where a wait takes longer than a period."""
        due = time.monotonic() + 1.0 / rate
        while not over.wait(max(due - time.monotonic(), 0.0)):
            self.publishers[topic].publish(message)
            due += 1.0 / rate

    def call(self, command: dict[str, Any]) -> None:
        client = self.node.create_client(Trigger, command["call"])
        assert client.wait_for_service(30)
        future = client.call_async(Trigger.Request())
        future.add_done_callback(lambda done: say(called=plain(done.result())))

    def set(self, command: dict[str, Any]) -> None:
        client = self.node.create_client(SetParameters, "/diffbotctl/set_parameters")
        assert client.wait_for_service(30)
        parameter = Parameter(command["set"], value=command["value"]).to_parameter_msg()
        future = client.call_async(SetParameters.Request(parameters=[parameter]))
        future.add_done_callback(lambda done: say(was_set=plain(done.result().results[0])))

    def hash(self, command: dict[str, Any]) -> None:
        found = self.node.get_publishers_info_by_topic(command["hash"])
        say(hash=[str(each.topic_type_hash) for each in found])


def main() -> None:
    node = CommandedNode(sys.argv[1])
    say(ready=True)
    for line in sys.stdin:
        node.follow(json.loads(line))
    node.node.destroy_node()
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()
