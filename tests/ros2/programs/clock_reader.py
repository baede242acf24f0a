"""Prints the stamps of an odometry beside the node's clock, which follows /clock."""

import json

import rclpy
from nav_msgs.msg import Odometry
from rclpy.parameter import Parameter


def main():
    rclpy.init()
    simulated = Parameter("use_sim_time", value=True)
    node = rclpy.create_node("clock_reader", parameter_overrides=[simulated])

    def received(message):
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        times = [stamp, node.get_clock().now().nanoseconds]
        print(json.dumps({"stamp_and_now": times}), flush=True)

    node.create_subscription(Odometry, "odom", received, 10)
    print(json.dumps({"ready": True}), flush=True)
    rclpy.spin(node)


if __name__ == "__main__":
    main()
