"""The bridge process: a node of rclpy that is a client of the engine's control socket.

Runs with the Python that has rclpy; `diffbotctl ros2` starts it. Of this package it imports only
modules that need nothing beyond the standard library and ROS.
"""

from __future__ import annotations

import signal
import sys
import threading
from pathlib import Path
from typing import Any

import rclpy
from rclpy.exceptions import InvalidNamespaceException
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from diffbotctl.client.engine_connection import EngineConnection
from diffbotctl.client.velocity_driver import VelocityDriver
from diffbotctl.client.velocity_rules import RESUMED, Limits, VelocityRules
from diffbotctl.control_socket.address import EngineAddress
from diffbotctl.control_socket.protocol import Fields
from diffbotctl.errors import RunError
from diffbotctl.ros2.commands import LiveParameters, RobotCommands
from diffbotctl.ros2.options import BridgeOptions, decode_options
from diffbotctl.ros2.publishers import RunPublishers
from diffbotctl.ros2.velocity_topic import VelocityTopic

NODE_NAME = "diffbotctl"
CLIENT_NAME = "ros2 bridge"
EXIT_TIMEOUT_S = 1.0  # for each thread; the process ends anyway


class Bridge:
    """Both sides: a thread reads the socket and publishes, the executor serves the node."""

    def __init__(self, node: Any, engine: EngineConnection, options: BridgeOptions) -> None:
        self.node, self.engine = node, engine
        status = engine.request("status")
        is_paced = status.get("paced", True)  # an older engine has no such field
        self.publishers = RunPublishers(node, options, is_paced, engine.request)
        topics = {row["topic"]: row["type"] for row in engine.request("list_topics")["topics"]}
        self.wires = self.publishers.choose_wires(topics)
        self.commands = RobotCommands(node, engine, options.allows_drive, options.frame_prefix)
        self.parameters = LiveParameters(node, engine, options.allows_drive)
        self.driver = VelocityDriver(
            VelocityRules(Limits.of_run(status)), engine.send, node.get_logger().warning
        )
        if options.allows_drive:
            self.driver.start()
            self.velocity = VelocityTopic(node, self.driver)
            self.wires.append(RESUMED)

    def read_engine(self) -> None:
        """Publish what comes, until the run ends."""
        try:
            self.engine.subscribe(self.wires)
            for line in self.engine.lines():
                self._line_received(line)
        except RunError as error:
            print(error, file=sys.stderr)

    def _line_received(self, line: Fields) -> None:
        wire = line.get("topic")
        if wire is None or "message" not in line:
            self.driver.reply_received(line)
        elif wire == RESUMED:
            self.driver.stop_ended()
        else:
            self.publishers.message_received(wire, line["message"])


def main(text: str) -> int:
    """Bridge until the run ends or a signal comes."""
    options = decode_options(text)
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: ended.set())
    rclpy.init(args=None, signal_handler_options=SignalHandlerOptions.NO)
    try:
        engine = EngineConnection(
            EngineAddress(options.engine, Path(options.socket), None), CLIENT_NAME
        )
        node = rclpy.create_node(NODE_NAME, namespace=options.namespace or None)
        bridge = Bridge(node, engine, options)
    except (RunError, InvalidNamespaceException) as error:
        print(error, file=sys.stderr)
        return 1
    print(
        f"ros2: engine {options.engine} is the node {node.get_fully_qualified_name()}", flush=True
    )
    serve(bridge, ended)
    return 0


def serve(bridge: Bridge, ended: threading.Event) -> None:
    """Run both sides until `ended` is set or the run ends. The robot is stopped first."""

    def read() -> None:
        bridge.read_engine()
        ended.set()

    # Not the EventsExecutor: in Jazzy its `spin` keeps the interpreter's lock while it waits.
    executor = SingleThreadedExecutor()
    executor.add_node(bridge.node)
    spinning = threading.Thread(target=executor.spin, daemon=True)
    reading = threading.Thread(target=read, daemon=True)
    spinning.start()
    reading.start()
    ended.wait()
    bridge.engine.close()
    executor.shutdown()
    for thread in (reading, spinning):
        thread.join(EXIT_TIMEOUT_S)
    bridge.node.destroy_node()
    rclpy.try_shutdown()
