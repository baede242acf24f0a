"""The messages of an exported rosbag2 as rclpy itself reads them."""

import json
import subprocess

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from diffbotctl.config.load import load
from diffbotctl.ros2.bag_export import export_bag
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from tests.support.ros2_nodes import environment, ros_python

pytestmark = pytest.mark.skipif(
    ros_python() is None,
    reason="no rclpy here: `make ros2` installs it where its wheels exist (x86-64)",
)
READ = """
import importlib, json, sys
from rclpy.serialization import deserialize_message

def plain(value):
    if hasattr(value, "get_fields_and_field_types"):
        names = value.get_fields_and_field_types()
        return {name: plain(getattr(value, name)) for name in names}
    if isinstance(value, str):
        return value
    if hasattr(value, "tolist"):
        value = value.tolist()  # of numpy
    return [plain(each) for each in value] if hasattr(value, "__len__") else repr(value)

for line in sys.stdin:
    record = json.loads(line)
    package, _, name = record["type"].split("/")
    kind = getattr(importlib.import_module(package + ".msg"), name)
    print(json.dumps(plain(deserialize_message(bytes.fromhex(record["data"]), kind))))
"""


def plain(value, model):
    """A message of the other reader in the form of `model`, with numbers as texts."""
    if isinstance(model, dict):
        return {name: plain(getattr(value, name), each) for name, each in model.items()}
    if isinstance(value, str):
        return value
    if isinstance(model, list):
        if isinstance(value, int):  # a byte, which is bytes of length 1 in rclpy
            return [repr(value)]
        return [plain(*both) for both in zip(value, model, strict=True)]
    return repr(value)


def test_rclpy_reads_every_message_as_another_reader_does(tmp_path):
    recording = tmp_path / "goal.mcap"
    Run(load("goal"), RunOptions(fast=True, record=recording, seed=3)).go()
    export_bag(recording, tmp_path / "bag", None, False)
    with (tmp_path / "bag" / "bag.mcap").open("rb") as file:
        decoded = list(
            make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages()
        )
    lines = [
        json.dumps({"type": schema.name, "data": record.data.hex()})
        for schema, _, record, _ in decoded
    ]
    done = subprocess.run(
        [ros_python(), "-c", READ],
        env=environment(tmp_path),
        input="\n".join(lines),
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    messages = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(messages) == len(decoded) > 1000
    for message, (_, channel, _, other) in zip(messages, decoded, strict=True):
        assert message == plain(other, message), channel.topic
