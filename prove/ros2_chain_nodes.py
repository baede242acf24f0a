"""The chain from encoders to wheels as nodes of ROS 2, written as tutorials write them.

Arguments: the serial port, and the names of the nodes of this process. They know nothing of
diffbotctl. Odometry, goal and limits are as simple as they can be. The number of the tick goes
along in fields that are not used otherwise, so that every answer is known to belong to its tick.
"""

import os
import struct
import sys
import threading
import tty
from contextlib import suppress
from math import atan2, cos, hypot, pi, sin
from typing import Any

import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

RADIUS, TRACK, SLOTS = 0.0325, 0.125, 20
GOAL = (9.0, 0.0)
SPEED, TURN_RATE = 0.2, 1.0
FULL_SPEED = 33.3 / SLOTS * 2 * pi  # rad/s at full PWM
QUEUE_DEPTH = 10
HEADER = b"\xff\xfe\x04\x00\xfb"  # of a frame with a payload of four bytes
FRAME_BYTES = 12
CODES = 8  # each PWM carries a digit of the number of the tick that it answers
LEFT_TICKS, RIGHT_TICKS, LEFT_PWM, RIGHT_PWM = 125, 126, 100, 101


def limited(value: float, limit: float) -> float:
    return max(-limit, min(value, limit))


class Driver(Node):  # type: ignore[misc]  # rclpy is not installed here
    """The serial port: ticks in, PWM out."""

    def __init__(self, port: str) -> None:
        super().__init__("driver")
        self.port = os.open(port, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self.port)
        self.counts = {LEFT_TICKS: 0, RIGHT_TICKS: 0}
        self.number = 0  # of the tick
        self.publisher = self.create_publisher(JointState, "joint_states", QUEUE_DEPTH)
        self.create_subscription(Float64MultiArray, "wheels", self.command, QUEUE_DEPTH)
        threading.Thread(target=self.read, daemon=True).start()

    def read(self) -> None:
        data = b""
        while True:
            data += os.read(self.port, 4096)
            while (start := data.find(HEADER)) >= 0 and len(data) - start >= FRAME_BYTES:
                topic, payload = struct.unpack_from("<H4s", data, start + len(HEADER))
                data = data[start + FRAME_BYTES :]
                if topic in self.counts:
                    self.counts[topic] = struct.unpack("<i", payload)[0]
                if topic == RIGHT_TICKS:
                    self.tick()

    def tick(self) -> None:
        message = JointState(name=["left", "right"])
        message.header.stamp = self.get_clock().now().to_msg()
        self.number += 1
        message.effort = [float(self.number)]
        message.position = [2 * pi * count / SLOTS for count in self.counts.values()]
        self.publisher.publish(message)

    def command(self, message: Any) -> None:
        *speeds, number = message.data
        data, rest = b"", int(number)
        for topic, speed in zip((LEFT_PWM, RIGHT_PWM), speeds, strict=True):
            steps = round(limited(speed / FULL_SPEED, 0.95) * 255 / CODES)
            rest, code = divmod(rest, CODES)
            pwm = CODES * steps + code  # shows to which tick it belongs
            body = struct.pack("<Hi", topic, pwm)
            data += HEADER + body + bytes([255 - sum(body) % 256])
        os.write(self.port, data)


class Reckoning(Node):  # type: ignore[misc]  # rclpy is not installed here
    """Odometry by dead reckoning."""

    def __init__(self, port: str) -> None:
        super().__init__("odometry")
        self.last: tuple[float, float] | None = None
        self.x = self.y = self.heading = 0.0
        self.publisher = self.create_publisher(Odometry, "odom", QUEUE_DEPTH)
        self.create_subscription(JointState, "joint_states", self.turned, QUEUE_DEPTH)

    def turned(self, message: Any) -> None:
        left, right = (angle * RADIUS for angle in message.position)
        if self.last is not None:
            way = 0.5 * (left - self.last[0] + right - self.last[1])
            self.heading += (right - self.last[1] - left + self.last[0]) / TRACK
            self.x += way * cos(self.heading)
            self.y += way * sin(self.heading)
        self.last = left, right
        odometry = Odometry(child_frame_id="base_link")
        odometry.header.frame_id = "odom"
        odometry.header.stamp = message.header.stamp
        pose = odometry.pose.pose
        pose.position.z = message.effort[0]
        pose.position.x, pose.position.y = self.x, self.y
        pose.orientation.z, pose.orientation.w = sin(self.heading / 2), cos(self.heading / 2)
        self.publisher.publish(odometry)


class Follower(Node):  # type: ignore[misc]  # rclpy is not installed here
    """Drives to the goal."""

    def __init__(self, port: str) -> None:
        super().__init__("follower")
        self.publisher = self.create_publisher(Twist, "goal_vel", QUEUE_DEPTH)
        self.create_subscription(Odometry, "odom", self.moved, QUEUE_DEPTH)

    def moved(self, message: Any) -> None:
        pose = message.pose.pose
        ahead, left = GOAL[0] - pose.position.x, GOAL[1] - pose.position.y
        heading = 2 * atan2(pose.orientation.z, pose.orientation.w)
        turn = (atan2(left, ahead) - heading + pi) % (2 * pi) - pi
        twist = Twist()
        twist.linear.x = min(hypot(ahead, left), SPEED) * max(cos(turn), 0.0)
        twist.angular.z = limited(2.0 * turn, TURN_RATE)
        twist.linear.z = pose.position.z
        self.publisher.publish(twist)


class Limiter(Node):  # type: ignore[misc]  # rclpy is not installed here
    """Keeps the acceleration small."""

    STEP = 0.02  # m/s, for each message

    def __init__(self, port: str) -> None:
        super().__init__("limiter")
        self.linear = 0.0
        self.publisher = self.create_publisher(Twist, "cmd_vel", QUEUE_DEPTH)
        self.create_subscription(Twist, "goal_vel", self.take_goal_velocity, QUEUE_DEPTH)

    def take_goal_velocity(self, message: Any) -> None:
        self.linear += limited(message.linear.x - self.linear, self.STEP)
        message.linear.x = self.linear
        self.publisher.publish(message)


class Kinematics(Node):  # type: ignore[misc]  # rclpy is not installed here
    """Wheel speeds from the velocity of the body."""

    def __init__(self, port: str) -> None:
        super().__init__("kinematics")
        self.publisher = self.create_publisher(Float64MultiArray, "wheels", QUEUE_DEPTH)
        self.create_subscription(Twist, "cmd_vel", self.commanded, QUEUE_DEPTH)

    def commanded(self, message: Any) -> None:
        turn = 0.5 * TRACK * message.angular.z
        speeds = [(message.linear.x + sign * turn) / RADIUS for sign in (-1.0, 1.0)]
        self.publisher.publish(Float64MultiArray(data=[*speeds, message.linear.z]))


NODES = {
    "driver": Driver,
    "odometry": Reckoning,
    "follower": Follower,
    "limiter": Limiter,
    "kinematics": Kinematics,
}


def main() -> None:
    rclpy.init()
    executor = SingleThreadedExecutor()
    for name in sys.argv[2:]:
        executor.add_node(NODES[name](sys.argv[1]))
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        executor.spin()


if __name__ == "__main__":
    main()
