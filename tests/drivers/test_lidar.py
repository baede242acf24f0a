"""USB lidars: their frames, byte by byte and damaged; and a robot that stops for what they see."""

import time
from math import cos, inf, radians

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diffbotctl.links.lidar_frames import RAYS, LdsParser, RplidarParser
from diffbotctl.recording.reader import RecordingReader
from tests.pico_robot import PICO
from tests.support.running import OPEN_FIELD, PlainClient, cli, moves, running, stands
from tests.support.usb_lidar import UsbLidar, lds_turn, rplidar_turn

COMMAND_PERIOD_S = 0.05
PARSERS = {"lds01": LdsParser, "rplidar_a1": RplidarParser}
DESCRIPTOR = bytes.fromhex("a5 5a 05 00 00 40 81")
# A frame of the data sheet's fields: 0xFA, index 2, 300.0 rpm, six readings, both checksums.
LDS_PACKET = bytes.fromhex("fa a2 b8 0b" + "c8 00 e8 03 00 00" * 6 + "15 15")
ROBOT = """
format: 1
kind: robot
include: book_2wd
sensors: {scan: {type: lds01, pin: none, at: {x: 0 mm, y: 0 mm}}}
"""
PIPELINE = """
format: 1
kind: pipeline
include: $include
sources:
  lidar: {driver: lidar, with: {device: $device, model: $model}}
blocks:
  scan_guard: {in: {scan: lidar.scan}}
"""


def whole(model, turns):
    """The bytes of some turns, and the beginning of the next one."""
    if model == "lds01":
        return b"".join(map(lds_turn, turns))
    return DESCRIPTOR + b"".join(map(rplidar_turn, [*turns, turns[-1]]))


def test_a_packet_of_the_data_sheet():
    parser = LdsParser()
    packets = [bytes([0xFA, 0xA0 + number]) + LDS_PACKET[2:] for number in range(60)]
    [turn] = parser.receive(b"".join(packets))
    assert turn == (1.0,) * RAYS and parser.damaged == 0


def test_a_sample_of_the_data_sheet():
    # angle 90.5 deg is 5792 / 64; distance 1234.25 mm is 4937 / 4
    sample = bytes([0x3E, (5792 & 0x7F) << 1 | 1, 5792 >> 7, 4937 & 0xFF, 4937 >> 8])
    parser = RplidarParser()
    parser.receive(DESCRIPTOR + sample)
    assert parser.turn.rays[90] == pytest.approx(1.23425)


@pytest.mark.parametrize("model", PARSERS)
def test_the_right_of_the_robot_is_at_270_degrees(model):
    seen = [0.0] * RAYS
    seen[0], seen[90] = 1.0, 0.5  # ahead, and clockwise of it
    [turn] = PARSERS[model]().receive(whole(model, [seen]))
    assert (turn[0], turn[270], turn[90]) == (1.0, 0.5, inf)


@pytest.mark.parametrize("model", PARSERS)
@given(cuts=st.lists(st.integers(1, 600), max_size=40))
def test_bytes_may_come_in_any_portions(model, cuts):
    parser = PARSERS[model]()
    data = whole(model, [(0.5,) * RAYS, (1.5,) * RAYS])
    turns = []
    for cut in [*cuts, len(data)]:
        turns += parser.receive(data[:cut])
        data = data[cut:]
    assert [turn[7] for turn in turns] == [0.5, 1.5] and parser.damaged == 0


@pytest.mark.parametrize("model", PARSERS)
@given(start=st.integers(0, 2000), length=st.integers(60, 300))
def test_a_turn_with_a_lost_part_is_never_taken_for_whole(model, start, length):
    parser = PARSERS[model]()
    data = whole(model, [(0.5,) * RAYS, (1.0,) * RAYS, (2.0,) * RAYS])
    first = 400  # within the first turn
    turns = parser.receive(data[: first + start % 1000] + data[first + start % 1000 + length :])
    assert turns and all(set(turn) in ({0.5}, {1.0}, {2.0}) for turn in turns)


@pytest.mark.parametrize("model", PARSERS)
@given(noise=st.binary(max_size=3000))
def test_noise_ends_nothing(model, noise):
    parser = PARSERS[model]()
    parser.receive(noise)
    if model == "rplidar_a1":
        parser.receive(bytes(10) + DESCRIPTOR)
    turns = parser.receive(
        b"".join(map(rplidar_turn if model != "lds01" else lds_turn, [(1.0,) * RAYS] * 4))
    )
    assert turns and set(turns[-1]) == {1.0}


@pytest.fixture
def drive(tmp_path):
    """What starts the pipeline with a lidar, and the pipeline's file."""
    (tmp_path / "robot.yaml").write_text(ROBOT)
    path = tmp_path / "scan.yaml"

    def write(lidar, include="teleop"):
        text = PIPELINE.replace("$device", lidar.device).replace("$model", lidar.model)
        path.write_text(text.replace("$include", include))
        return [str(path), "--robot", str(tmp_path / "robot.yaml"), "--stay"]

    return write


def drive_forward(client):
    client.send('{"method": "drive", "linear": 0.1}')


def until(client, condition):
    """Drive on until the status is so: a client must repeat its command."""

    def seen(status):
        drive_forward(client)
        time.sleep(COMMAND_PERIOD_S)
        return condition(status)

    return client.until(seen)


@pytest.mark.parametrize("model", PARSERS)
def test_the_robot_stops_for_what_the_lidar_sees_and_when_it_is_lost(tmp_path, drive, model):
    lidar = UsbLidar(model)
    recording = tmp_path / "scan.mcap"
    with running(tmp_path, *drive(lidar), "--record", str(recording)) as process:
        client = PlainClient(tmp_path)
        until(client, moves)
        near = [2.0] * RAYS
        near[-10:] = near[:10] = [0.12] * 10
        lidar.distances = near
        held = until(client, lambda status: status["held"] and stands(status))["held"]
        assert held["code"] == "obstacle"
        lidar.distances = (2.0,) * RAYS
        until(client, moves)
        lidar.is_silent.set()
        held = until(client, lambda status: status["held"] and stands(status))["held"]
        client.until(lambda status: (status["held"] or {}).get("code") == "input_stale")
        cause = client.request("status")["held"]["cause"]
        assert f"source lidar ({lidar.device}) has published nothing on lidar.scan" in cause
        lidar.is_silent.clear()
        client.until(lambda status: client.request("topic_rate", topic="lidar.scan")["age"] < 0.4)
        assert client.request("status")["held"]["latched"]
        client.until(lambda status: client.request("resume")["ok"])  # the drive lease has to end
        until(client, moves)
        lidar.unplug()
        held = until(client, lambda status: status["held"] and stands(status))["held"]
        client.until(lambda status: (status["held"] or {}).get("code") == "input_stale")
        text = client.request("explain_stop")["text"]
        assert f"source lidar ({lidar.device})" in text and "disconnected" in text
        process.terminate()
        process.wait(timeout=60)
    code, out, _ = cli(tmp_path, "replay", str(recording), "--check")
    assert code == 0 and "same" in out
    scans = [m for m in RecordingReader(recording).messages() if m.wire == "lidar.scan"]
    assert len(scans) > 2 and all(item.from_driver for item in scans)


WALL = 0.4  # m ahead of the start; it stands in no simulated world, only the lidar sees it
FRONT = 0.08  # m, of the robot before its axle, where its lidar is
BOARDS = {"mega2560": [], "pico": [*PICO, "robot.drive.encoder.channels=2"]}


def before_a_wall(x, heading):
    """What a lidar at (x, 0) sees of a wall across the way: distances, clockwise from the front."""
    bearings = [heading - radians(degree) for degree in range(RAYS)]
    return [(WALL - x) / cos(each) if cos(each) > 0.05 else 0.0 for each in bearings]


class WallAhead:
    """What the lidar of a run sees of the wall, from where the robot is by its odometry."""

    def __init__(self, folder):
        self.folder, self.client = folder, None

    def __call__(self):
        pose = self.pose() if self.client is not None else None
        return before_a_wall(pose["x"], pose["heading"]) if pose else before_a_wall(0.0, 0.0)

    def pose(self):
        return self.client.request("snapshot")["messages"].get("odometry.odometry")


@pytest.mark.parametrize("board", BOARDS)
def test_a_robot_with_a_board_stops_before_what_only_its_lidar_sees(tmp_path, drive, board):
    ahead = WallAhead(tmp_path)
    lidar = UsbLidar("lds01", ahead)
    sets = [*OPEN_FIELD, "--set", "robot.limits.speed=0.1", "--set", "follower.patience=1"]
    sets += [word for text in BOARDS[board] for word in ("--set", text)]
    with running(tmp_path, *drive(lidar, "standby"), "--port", "emulated", sets=sets) as process:
        client, ahead.client = PlainClient(tmp_path), PlainClient(tmp_path)

        def has_seen_it(status):
            time.sleep(COMMAND_PERIOD_S)
            goal = status["goal_state"] or {"state": "none", "cause": ""}
            if "the scanner sees" in goal["cause"]:
                return True
            # A computer that stands still delays telemetry and scans: a latched stop ends the goal,
            # which then begins anew. At an obstacle it goes on, and counts its patience.
            held = status["held"]
            if goal["state"] in ("none", "stuck", "blocked") or (held and held["latched"]):
                client.request("resume")
                client.request("goto", x=1.0, y=0.0)
            return False

        goal = client.until(has_seen_it)["goal_state"]
        lidar.unplug()
        process.terminate()
        process.wait(timeout=60)
    assert goal["state"] == "blocked"
    assert 1.0 - WALL < goal["distance"] - FRONT < 1.0 - WALL + 0.2


def test_goals_wait_for_a_lidar_that_starts_late_and_end_where_it_sees_nothing(tmp_path, drive):
    lidar = UsbLidar("lds01")
    lidar.is_silent.set()
    sets = [*OPEN_FIELD, "--set", "follower.patience=0.3"]
    with running(tmp_path, *drive(lidar, "standby"), sets=sets) as process:
        client = PlainClient(tmp_path)
        assert client.request("goto", x=0.2, y=0.0)["ok"]
        # Longer than the patience, which does not count while the driver waits.
        status = client.until(lambda status: status["time"] > 1.2e9)
        assert status["held"]["code"] == "source_starting"
        assert f"source lidar ({lidar.device}) starts" in status["held"]["cause"]
        assert (status["goal_state"] or {}).get("state") != "blocked"
        lidar.is_silent.clear()
        client.until(lambda status: (status["goal_state"] or {}).get("state") == "reached")
        lidar.distances = (0.0,) * RAYS
        blind = client.request("status")["time"] + 1.5e9  # a second, and two turns
        client.until(lambda status: status["time"] > blind)
        x = client.request("snapshot")["messages"]["odometry.odometry"]["x"]
        assert client.request("goto", x=1.0, y=0.0)["ok"]
        goal = client.until(lambda status: status["goal_state"]["state"] == "blocked")["goal_state"]
        assert "the scanner measures nothing" in goal["cause"]
        assert "0 of 360 rays with a distance" in client.request("explain_stop")["text"]
        after = client.request("snapshot")["messages"]["odometry.odometry"]["x"]
        assert after == pytest.approx(x, abs=0.02)
        process.terminate()
        process.wait(timeout=60)
    lidar.unplug()


def test_a_lidar_that_sends_nothing_is_named(tmp_path, drive):
    lidar = UsbLidar("lds01")
    lidar.is_silent.set()
    with running(tmp_path, *drive(lidar)):
        client = PlainClient(tmp_path)
        client.until(lambda status: (status["held"] or {}).get("code") == "input_stale")
        lines = [line["text"] for line in client.request("read_log")["lines"]]
        expected = f"source lidar ({lidar.device}): nothing comes from it"
        assert any(expected in text and "cable" in text for text in lines)
    lidar.unplug()
