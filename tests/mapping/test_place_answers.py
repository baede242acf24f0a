"""A running robot in a room that looks the same from both ends: it asks, and commands answer."""

import time
from math import hypot, pi

import pytest

from diffbotctl.config.load import load
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from tests.support.running import LONGEST_WAIT, PlainClient, cli, running
from tests.web.test_map_page import PIPELINE


@pytest.fixture
def client(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    path = tmp_path / "room.yaml"
    path.write_text(PIPELINE)
    Run(load(str(path)), RunOptions(fast=True, duration=12.0, seed=4)).go()
    sets = ["--set", "map.load=autosave", "--set", "map.autosave=false"]
    with running(tmp_path, path, "--stay", sets=sets):
        client = PlainClient(tmp_path)
        yield client
        client.close()


def newest(client, topic):
    return client.request("describe_topic", topic=topic)["last"]


def until_state(client, state):
    deadline = time.monotonic() + LONGEST_WAIT
    while (pose := newest(client, "slam.pose")) is None or pose["state"] != state:
        assert time.monotonic() < deadline, pose
        time.sleep(0.05)
    return pose


def test_a_place_that_is_stated_by_command_is_the_robots(client, tmp_path):
    pose = until_state(client, "ambiguous")
    assert pose["covariance"][0] > 100, "nothing is claimed"
    assert "ambiguous" in cli(tmp_path, "log", "--once")[1]
    odometry, places = newest(client, "odometry.odometry"), newest(client, "map.update")
    flat = places["candidates"]
    candidates = [flat[i : i + 3] for i in range(0, len(flat), 3)]
    assert len(candidates) == 2
    # The map and odom begin at the same place, with the same heading.
    x, y, heading = min(
        candidates, key=lambda place: hypot(place[0] - odometry["x"], place[1] - odometry["y"])
    )
    words = ("--x", f"{x}m", "--y", f"{y}m", "--heading", f"{heading}rad")
    assert cli(tmp_path, "map", "place", *words)[0] == 0
    pose = until_state(client, "localised")
    assert hypot(*pose["odom"][:2]) < 0.15
    assert abs((pose["odom"][2] + pi) % (2 * pi) - pi) < 0.15
