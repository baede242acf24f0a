"""Drives one side and one corner of a square by time, for turtlesim; ends with a zero."""

from contextlib import suppress

import rclpy
from geometry_msgs.msg import Twist
from rclpy.node import Node

STEPS = [(0.2, 0.0)] * 15 + [(0.0, 1.0)] * 15 + [(0.0, 0.0)]


class SquareDriver(Node):
    def __init__(self):
        super().__init__("square_driver")
        self.publisher = self.create_publisher(Twist, "turtle1/cmd_vel", 10)
        self.steps = list(STEPS)
        self.timer = self.create_timer(0.1, self.step)

    def step(self):
        if self.publisher.get_subscription_count() == 0:
            return
        twist = Twist()
        twist.linear.x, twist.angular.z = self.steps.pop(0)
        self.publisher.publish(twist)
        if not self.steps:
            raise SystemExit


def main():
    rclpy.init()
    print('{"ready": true}', flush=True)
    node = SquareDriver()
    with suppress(SystemExit):
        rclpy.spin(node)
    node.destroy_node()
    rclpy.shutdown()
    print('{"done": true}', flush=True)


main()
