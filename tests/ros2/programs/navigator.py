"""Drives to x = 0.3 m with TwistStamped by the odometry; at its goal a zero, and then silence."""

import sys

import rclpy
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node

GOAL, GAIN, TOLERANCE = 0.3, 1.0, 0.02


class Navigator(Node):
    def __init__(self):
        super().__init__("navigator")
        self.publisher = self.create_publisher(TwistStamped, "cmd_vel", 10)
        self.create_subscription(Odometry, "odom", self.odometry, 10)
        self.is_done = False

    def odometry(self, message):
        if self.is_done:
            return
        remaining = GOAL - message.pose.pose.position.x
        self.is_done = abs(remaining) < TOLERANCE
        twist = TwistStamped()
        twist.header.stamp = self.get_clock().now().to_msg()
        twist.twist.linear.x = 0.0 if self.is_done else max(-0.2, min(GAIN * remaining, 0.2))
        self.publisher.publish(twist)
        if self.is_done:
            print('{"done": true}', flush=True)


def main():
    rclpy.init()
    print('{"ready": true}', flush=True)
    rclpy.spin(Navigator())


sys.exit(main())
