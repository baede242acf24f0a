"""A keyboard teleop as tutorials have it: publishes only when a key is pressed; k is a zero."""

import sys

import rclpy
from geometry_msgs.msg import Twist

KEYS = {"i": (0.2, 0.0), ",": (-0.2, 0.0), "j": (0.0, 1.0), "l": (0.0, -1.0), "k": (0.0, 0.0)}


def main():
    rclpy.init()
    node = rclpy.create_node("teleop_keyboard")
    publisher = node.create_publisher(Twist, "cmd_vel", 10)
    while publisher.get_subscription_count() == 0:
        rclpy.spin_once(node, timeout_sec=0.05)
    print('{"ready": true}', flush=True)
    for line in sys.stdin:
        twist = Twist()
        twist.linear.x, twist.angular.z = KEYS[line.strip()]
        publisher.publish(twist)
    node.destroy_node()
    rclpy.shutdown()


main()
