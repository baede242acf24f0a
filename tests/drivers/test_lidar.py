"""Lidars at a pseudo-terminal: each model, others in its place, and a robot that stops for them."""

import time
from math import cos, inf, pi, radians
from statistics import median

import pytest

from diffbotctl.device import DeviceError
from diffbotctl.drivers.lidar import Lidar
from diffbotctl.geometry.lidars import LIDARS
from diffbotctl.log import INFO, Log
from diffbotctl.recording.reader import RecordingReader
from tests.pico_robot import PICO
from tests.support.running import OPEN_FIELD, PlainClient, cli, moves, running, stands
from tests.support.usb_lidar import DEGREES, SCAN_DESCRIPTOR, TURN_PERIOD_S, UsbLidar
from tests.support.virtual_board import board

COMMAND_PERIOD_S = 0.05
STEP_MAX = 20_000_000  # ns
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


def outcome(lidar, model, speed=4, **values):
    """What the driver of `model` makes of `lidar`: its first scans, or why there are none.

    Its clock is `speed` times as fast, and waits for this process and for the lidar.
    """
    driver = Lidar(device=lidar.device, model=model, **values)
    driver.log = Log("lidar", lidar.logged, INFO)
    scans, now, last = [], 0, time.monotonic_ns()
    try:
        driver.open()
        while len(scans) < 3:
            passed = time.monotonic_ns() - last
            latest = round(speed * (lidar.periods + 1) * TURN_PERIOD_S * 1e9)
            now, last = min(now + speed * min(passed, STEP_MAX), latest), last + passed
            scans += [reading.message for reading in driver.read(now)]
            time.sleep(0.002)
        return scans
    except DeviceError as error:
        return f"{error.cause}; {error.fix}"
    finally:
        driver.close()
        lidar.unplug()


@pytest.mark.parametrize("model", LIDARS)
def test_each_model_delivers_its_turns(model):
    facts = LIDARS[model]
    scans = outcome(UsbLidar(model), model, speed=1)
    assert {len(scan.distances) for scan in scans} == {facts.rays}
    assert {scan.step for scan in scans} == {-2 * pi / facts.rays}
    # On a busy computer the bytes of single turns come late.
    assert 0.08 <= median(scan.duration for scan in scans) <= 0.25
    assert all(1.9 < distance < 2.1 for scan in scans for distance in scan.distances)


def test_a_lidar_upside_down_turns_the_other_way():
    [scan, *_] = outcome(UsbLidar("ld19"), "ld19", upside_down=True)
    assert scan.step == 2 * pi / 450


def test_distances_out_of_its_range():
    """An LDS-01 measures from 12 cm to 3.5 m."""
    distances = [0.0] * 90 + [0.05] * 90 + [3.4] * 90 + [3.9] * 90
    [scan, *_] = outcome(UsbLidar("lds01", distances), "lds01")
    assert [scan.distances[degree] for degree in (45, 135, 225, 315)] == [inf, 0.0, 3.4, inf]


@pytest.mark.parametrize(
    ("declared", "connected", "expected"),
    [
        ("lds01", "ld06", "at 230400 baud what ld06 or ld19 sends; write type: ld06 or ld19"),
        (
            "rplidar_a1",
            "ydlidar_x2",
            "at 115200 baud what ydlidar_x2 sends; write type: ydlidar_x2",
        ),
        ("ydlidar_x2", "rplidar_a1", "at 115200 baud what rplidar_a1 sends"),
        ("ld19", "lds02", "type is ld19, but it sends at 115200 baud what lds02 sends"),
        ("ydlidar_x4", "ydlidar_x2", "at 115200 baud what ydlidar_x2 sends"),
        ("ydlidar_x2", "ydlidar_x4", "at 128000 baud what ydlidar_x4 sends"),
        ("rplidar_a1", "rplidar_c1", "at 460800 baud what rplidar_c1 sends"),
        ("lds02", "lds01", "at 230400 baud what lds01 sends"),
    ],
)
def test_another_lidar_is_named_by_what_arrives(declared, connected, expected):
    """An X2 begins with the descriptor of an A1, and must not pass for one."""
    lidar = UsbLidar(connected, power_up=SCAN_DESCRIPTOR if connected == "ydlidar_x2" else b"")
    assert expected in outcome(lidar, declared)


def silence(lidar):
    lidar.is_silent.set()


def lose_bytes(lidar):
    lidar.damage = lambda turn: turn[:1200] + turn[1300:]


def send_text(lidar):
    lidar.damage = lambda turn: b"Hello, here is a thermometer: 21.5 degrees\n" * 20


@pytest.mark.parametrize(
    ("model", "health", "trouble", "expected"),
    [
        ("rplidar_a1", (2, 0x8004), silence, "a fault of its hardware, code 0x8004; check that"),
        ("ydlidar_x4", (2, 0x0010), silence, "a fault of its hardware, code 0x0010; check that"),
        ("rplidar_c1", (0, 0), silence, "no whole turn comes: its motor does not reach its speed"),
        ("ld06", (0, 0), silence, "nothing comes from it; check its plug, cable, power"),
        (
            "lds02",
            (0, 0),
            send_text,
            "at 115200 baud is of no known lidar, and of no LDS-02",
        ),
        ("ld19", (0, 0), lose_bytes, "all its turns come damaged; check plug and cable"),
    ],
)
def test_a_lidar_without_turns_is_named_by_what_arrives(model, health, trouble, expected):
    lidar = UsbLidar(model, health=health)
    trouble(lidar)
    assert expected in outcome(lidar, model)


def test_a_warning_of_a_lidar_is_logged():
    lidar = UsbLidar("rplidar_c1", health=(1, 0x0003))
    assert len(outcome(lidar, "rplidar_c1")) == 3
    assert any("warns of its state, code 0x0003" in text for _, _, text in lidar.logged)


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


def is_blind(status):
    return (status["held"] or {}).get("code") == "scan_blind" and stands(status)


def until(client, condition):
    """Drive on until the status is so: a client must repeat its command."""

    def seen(status):
        drive_forward(client)
        time.sleep(COMMAND_PERIOD_S)
        return condition(status)

    return client.until(seen)


@pytest.mark.parametrize("model", ["lds01", "rplidar_a1"])
def test_the_robot_stops_for_what_the_lidar_sees_and_when_it_is_lost(tmp_path, drive, model):
    lidar = UsbLidar(model)
    recording = tmp_path / "scan.mcap"
    with running(tmp_path, *drive(lidar), "--record", str(recording)) as process:
        client = PlainClient(tmp_path)
        until(client, moves)
        near = [2.0] * DEGREES
        near[-10:] = near[:10] = [0.12] * 10
        lidar.distances = near
        held = until(client, lambda status: status["held"] and stands(status))["held"]
        assert held["code"] == "obstacle"
        lidar.distances = (2.0,) * DEGREES
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


OF_ROBOT = """
format: 1
kind: robot
include: book_2wd
drive: {polarity: checked_by_hand}
sensors:
  scan: {type: ld19, device: $device, upside_down: true, at: {x: 20 mm, heading: 90 deg}}
"""


def test_a_lidar_of_the_robot_file_guards_a_real_robot(tmp_path):
    """It hangs, its zero angle to the left, so that it counts from there to the front clockwise
    from above, which is counter-clockwise for itself: the front is at 270 degrees. Beside it, at
    its zero angle, is a mast of the robot."""
    far = [2.0] * DEGREES
    far[-10:] = far[:10] = [0.04] * 20
    lidar = UsbLidar("ld19", far)
    (tmp_path / "robot.yaml").write_text(OF_ROBOT.replace("$device", lidar.device))
    recording = tmp_path / "scan.mcap"
    words = ["teleop", "--robot", str(tmp_path / "robot.yaml"), "--stay"]
    with board() as virtual:
        words += ["--port", virtual.usb, "--record", str(recording)]
        with running(tmp_path, *words, sets=[]) as process:
            client = PlainClient(tmp_path)
            until(client, moves)
            lidar.distances = [*far[:262], *[0.12] * 16, *far[278:]]
            held = until(client, lambda status: status["held"] and stands(status))["held"]
            assert held["code"] == "obstacle"
            lidar.distances = [*far[:82], *[0.12] * 16, *far[98:]]  # behind it
            until(client, moves)
            lidar.distances = far[:10] + [0.0] * 340 + far[-10:]  # the mast alone
            until(client, is_blind)
            lidar.distances = far
            until(client, moves)
            lidar.unplug()
            client.until(lambda status: (status["held"] or {}).get("code") == "input_stale")
            text = client.request("explain_stop")["text"]
            assert f"sensor scan ({lidar.device})" in text and "disconnected" in text
            process.terminate()
            process.wait(timeout=60)
    code, out, _ = cli(tmp_path, "replay", str(recording), "--check")
    assert code == 0 and "same" in out
    scans = [m for m in RecordingReader(recording).messages() if m.wire == "robot.scan"]
    assert len(scans) > 2 and all(item.from_driver for item in scans)


WALL = 0.4  # m ahead of the start; it stands in no simulated world, only the lidar sees it
FRONT = 0.08  # m, of the robot before its axle, where its lidar is
BOARDS = {"mega2560": [], "pico": [*PICO, "robot.drive.encoder.channels=2"]}


def before_a_wall(x, heading):
    """What a lidar at (x, 0) sees of a wall across the way: distances, clockwise from the front."""
    bearings = [heading - radians(degree) for degree in range(DEGREES)]
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
        lidar.distances = (0.0,) * DEGREES
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
