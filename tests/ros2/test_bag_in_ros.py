"""The messages of an exported rosbag2 in rclpy itself: it reads each, and writes the same bytes."""

import json
import subprocess

import pytest
from mcap.reader import make_reader

from diffbotctl.config.load import load
from diffbotctl.ros2.bag_export import export_bag
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from diffbotctl.testing.ros2_nodes import environment, ros_python

pytestmark = pytest.mark.skipif(
    ros_python() is None,
    reason="no rclpy here: `make ros2` installs it where its wheels exist (x86-64)",
)
READ_AND_WRITE = """
import importlib, json, sys
from rclpy.serialization import deserialize_message, serialize_message
for line in sys.stdin:
    record = json.loads(line)
    package, _, name = record["type"].split("/")
    kind = getattr(importlib.import_module(package + ".msg"), name)
    data = bytes.fromhex(record["data"])
    written = bytes(serialize_message(deserialize_message(data, kind)))
    print(json.dumps({"type": record["type"], "same": written == data}))
"""


def test_rclpy_reads_every_message_and_writes_the_same_bytes(tmp_path):
    recording = tmp_path / "goal.mcap"
    Run(load("goal"), RunOptions(fast=True, record=recording, seed=3)).go()
    export_bag(recording, tmp_path / "bag", None, False)
    with (tmp_path / "bag" / "bag.mcap").open("rb") as file:
        lines = [
            json.dumps({"type": schema.name, "data": message.data.hex()})
            for schema, _, message in make_reader(file).iter_messages()
        ]
    done = subprocess.run(
        [ros_python(), "-c", READ_AND_WRITE],
        env=environment(tmp_path),
        input="\n".join(lines),
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    results = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(results) == len(lines) > 1000
    assert {each["type"] for each in results if not each["same"]} == set()
    assert {"nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"} <= {e["type"] for e in results}
